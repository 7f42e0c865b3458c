// Painting: rows of a chart on a canvas. A painting has a context, colours, a view (from, to, in units), and the horizontal
// range of the traces (left, width).

const FONT = "12px system-ui, sans-serif";
const SMALL = "10.5px system-ui, sans-serif";
/** Between the traces and the right edge; on narrow screens also at the left. */
const MARGIN = 10;
const NUMBERS = "12px ui-monospace, 'DejaVu Sans Mono', monospace";

/** The style sheet's colours at an element. */
function coloursAt(element) {
  const style = getComputedStyle(element);
  const colour = (name) => style.getPropertyValue("--" + name).trim();
  const names = ["text", "soft", "rail", "paper", "trace", "tint", "busy", "analog", "chosen", "cursor", "mark",
    "good", "good-text", "stale", "stale-text", "bad", "bad-text", "idle", "idle-text", "gap", "gap-text", "step", "step-text"];
  return Object.fromEntries(names.map((name) => [name, colour(name)]));
}

/** Sizes a canvas for its screen, and returns its context in CSS pixels. */
function context(canvas, width, height, ratio = window.devicePixelRatio || 1) {
  const [wide, high] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
  if (canvas.width !== wide || canvas.height !== high) {
    canvas.width = wide;
    canvas.height = high;
    canvas.style.width = width + "px";
    canvas.style.height = height + "px";
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  return ctx;
}

/** A text fitted to a width, its end cut off if necessary. */
function fitted(ctx, text, room) {
  if (ctx.measureText(text).width <= room) return text;
  // No text of more characters than pixels fits.
  const signs = Array.from(text.slice(0, Math.max(0, Math.ceil(room))));
  let [fits, fails] = [0, signs.length + 1];
  while (fails - fits > 1) {
    const middle = (fits + fails) >> 1;
    if (ctx.measureText(signs.slice(0, middle).join("") + "…").width <= room) fits = middle;
    else fails = middle;
  }
  return fits ? signs.slice(0, fits).join("") + "…" : "";
}

/** A number in few digits. */
function short(value, digits = 6) {
  if (Number.isNaN(value)) return "–";
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

/** A value of a signal, with its unit. */
function valueText(signal, value, digits) {
  if (Number.isNaN(value)) return "–";
  return signal.unit ? short(value, digits) + " " + signal.unit : short(value, digits);
}

const place = (painting, time) =>
  painting.left + (time - painting.from) / (painting.to - painting.from) * painting.width;

/** The thickness of traces, in pixels. */
const THICK = 1.5;

/**
 * Traces are horizontal and vertical lines, drawn as rectangles: without a graphics card, browsers take fifty times as long to
 * stroke a path of them.
 */
const across = (ctx, x, end, y) => ctx.fillRect(x, y - THICK / 2, end - x, THICK);
const upright = (ctx, x, from, to) => ctx.fillRect(x - THICK / 2, Math.min(from, to) - THICK / 2, THICK, Math.abs(to - from) + THICK);

/** The trace of a bool between `top` and `bottom`. */
function paintBool(painting, data, top, bottom) {
  const { ctx, colours, left, width, from, to } = painting;
  const { times } = data;
  const first = indexAt(times, from);
  const last = indexAt(times, to);
  /** Levels, `[value, begin, end]`, and the places of edges. */
  const levels = [];
  const edges = [];
  const busy = [];
  // Next to a time without a value, a change is unknown.
  const isEdge = (i) => i >= 0 && !Number.isNaN(valueOf(data, i)) && !Number.isNaN(valueOf(data, i + 1));
  const segment = (value, x, end) => { if (!Number.isNaN(value)) levels.push([value > 0.5, x, end]); };
  const edge = Math.min(left + width, place(painting, run.end));
  if (last - first <= width / 4) {
    let x = Math.max(left, place(painting, 0));
    for (let i = first; i <= last; i++) {
      const end = i < last ? place(painting, times[i + 1]) : edge;
      segment(valueOf(data, i), x, end);
      if (i < last && isEdge(i)) edges.push(end);
      x = end;
    }
  } else {
    // Per pixel: one level, or changes too close to distinguish.
    const step = (to - from) / width;
    let index = first;
    let [begin, was] = [left, valueOf(data, first)];
    for (let x = 0; x < width; x++) {
      const next = indexAt(times, from + (x + 1) * step, Math.max(index, 0), last + 1);
      const now = next > index + 1 ? "busy" : valueOf(data, next);
      if (next === index + 1 && isEdge(index)) edges.push(left + x + 0.5);
      if (!Object.is(now, was)) {
        if (was === "busy") busy.push([begin, left + x]);
        else segment(was, begin, left + x);
        [begin, was] = [left + x, now];
      }
      index = next;
    }
    if (was === "busy") busy.push([begin, left + width]);
    else segment(was, begin, edge);
  }
  ctx.fillStyle = colours.tint;
  for (const [isOn, x, end] of levels) if (isOn) ctx.fillRect(x, top, end - x, bottom - top);
  ctx.fillStyle = colours.busy;
  for (const [x, end] of busy) ctx.fillRect(x, top, end - x, bottom - top);
  ctx.fillStyle = colours.trace;
  for (const [isOn, x, end] of levels) across(ctx, x, end, isOn ? top : bottom);
  for (const x of edges) upright(ctx, x, top, bottom);
}

/** The trace of numbers between `top` and `bottom`; a value holds until the next. */
function paintReal(painting, signal, data, top, bottom) {
  const { ctx, colours, left, width, from, to } = painting;
  const { times } = data;
  const first = indexAt(times, from);
  const last = indexAt(times, to);
  const [low, high] = [signal.low ?? 0, signal.high ?? 0];
  const size = high - low;
  // Infinite values are drawn at the edge.
  const y = (value) => {
    const share = size > 0 ? Math.min(1, Math.max(0, (value - low) / size)) : 0.5;
    return bottom - share * (bottom - top);
  };
  ctx.fillStyle = colours.analog;
  const edge = Math.min(left + width, place(painting, run.end));
  if (last - first <= 2 * width) {
    let x = Math.max(left, place(painting, 0));
    let was = NaN;
    for (let i = first; i <= last; i++) {
      const end = i < last ? place(painting, times[i + 1]) : edge;
      const value = valueOf(data, i);
      const now = Number.isNaN(value) ? NaN : y(value);
      if (!Number.isNaN(was) && !Number.isNaN(now)) upright(ctx, x, was, now);
      if (!Number.isNaN(now)) across(ctx, x, end, now);
      [x, was] = [end, now];
    }
  } else {
    const step = (to - from) / width;
    let index = first;
    for (let x = 0; x < width; x++) {
      const next = indexAt(times, from + (x + 1) * step, Math.max(index, 0), last + 1);
      let [least, most] = extremes(data, index + 1, next + 1);
      // The value at the pixel's begin connects it to the previous pixel.
      const held = valueOf(data, index);
      if (!Number.isNaN(held)) {
        least = Math.min(least, held);
        most = Math.max(most, held);
      }
      if (least <= most && left + x < edge) upright(ctx, left + x + 0.5, y(least), y(most));
      index = next;
    }
  }
}

/** Paints durations: boxes with their text, also distinguished by their pattern. */
function paintSpans(painting, spans, top, bottom) {
  const { ctx, colours, left, width, from, to } = painting;
  ctx.font = FONT;
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  let drawnTo = -Infinity;
  // Spans are sorted by their begin; the first visible one can begin long before.
  for (const [begin, end, kind, text] of spans) {
    if (end < from || begin > to) continue;
    const x = Math.max(left, place(painting, begin));
    const stop = Math.min(left + width, place(painting, end));
    if (stop <= drawnTo && stop - x < 1) continue;
    const wide = Math.max(stop - x, 3);
    drawnTo = x + wide;
    const colour = kind === "fault" ? "bad" : kind === "note" ? "idle" : kind;
    ctx.fillStyle = colours[colour];
    ctx.fillRect(x, top, wide, bottom - top);
    if (kind === "stale" || kind === "bad" || kind === "gap") hatch(painting, x, top, wide, bottom - top, colours[colour + "-text"] || colours.text);
    if (wide > 4) {
      ctx.strokeStyle = colours.paper;
      ctx.lineWidth = 1;
      ctx.strokeRect(x + 0.5, top + 0.5, wide - 1, bottom - top - 1);
    }
    if (wide > 8) {
      const words = fitted(ctx, text, wide - 3);
      // Two letters of a word are useless.
      if (words === text || words.length > 3) {
        const room = ctx.measureText(words).width;
        const begins = x + Math.min(5, (wide - room) / 2);
        ctx.fillStyle = colours[colour];
        ctx.fillRect(begins - 2, top + 2, Math.min(room + 4, x + wide - begins), bottom - top - 4);
        ctx.fillStyle = colours[colour + "-text"];
        ctx.fillText(words, begins, (top + bottom) / 2 + 0.5);
      }
    }
  }
}

function hatch({ ctx }, x, y, width, height, colour) {
  ctx.save();
  ctx.beginPath();
  ctx.rect(x, y, width, height);
  ctx.clip();
  ctx.beginPath();
  for (let at = x - height - (x % 7); at < x + width; at += 7) {
    ctx.moveTo(at, y + height);
    ctx.lineTo(at + height, y);
  }
  ctx.globalAlpha = 0.35;
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1;
  ctx.stroke();
  ctx.restore();
}

/** The least step of 1, 2 or 5 times a power of ten that is no less. */
function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= least * (1 - 1e-9));
}

/** Seconds since the epoch of the simulation, of a time in units. */
const secondsOf = (time) => (Number(run.begin) + time * run.unit) / 1e9;

/** A time of the run for people, to the precision of a step in seconds. */
function timeText(time, step = run.unit / 1e9) {
  const decimals = Math.min(9, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
  return secondsOf(time).toFixed(decimals).replace("-", "−") + " s";
}

/** A duration in a suitable unit. */
function spanText(units) {
  const seconds = Math.abs(units) * run.unit / 1e9;
  const [size, name] = [[1, "s"], [1e-3, "ms"], [1e-6, "µs"], [1e-9, "ns"]].find(([size]) => seconds >= size) ?? [1e-9, "ns"];
  return Number((seconds / size).toPrecision(6)) + " " + name;
}

/** The lines of the axis: times in units, with the step in seconds. */
function ticksOf(painting) {
  const seconds = (painting.to - painting.from) * run.unit / 1e9;
  const step = niceStep(Math.max(seconds / painting.width * (painting.isNarrow ? 72 : 100), 1e-9));
  const ticks = [];
  const end = secondsOf(painting.to);
  // Counted, not summed: a step can be too small to change a large number.
  for (let n = Math.ceil(secondsOf(painting.from) / step), last = n + 100; n * step <= end && n < last; n++) {
    ticks.push((n * step * 1e9 - Number(run.begin)) / run.unit);
  }
  return { ticks, step };
}

function paintAxis(painting, height) {
  const { ctx, colours, left, width } = painting;
  const { ticks, step } = ticksOf(painting);
  ctx.font = NUMBERS;
  ctx.textBaseline = "middle";
  ctx.textAlign = "center";
  for (const tick of ticks) {
    const x = place(painting, tick);
    const text = timeText(tick, step);
    const half = ctx.measureText(text).width / 2;
    ctx.fillStyle = colours.rail;
    ctx.fillRect(Math.round(x), height - 5, 1, 5);
    // At the ends there is room beyond the traces.
    if (x + half > left + width + MARGIN) ctx.textAlign = "right";
    else if (x - half < 0) ctx.textAlign = "left";
    const shift = ctx.textAlign === "right" ? MARGIN : ctx.textAlign === "left" ? -Math.min(MARGIN, left) : 0;
    ctx.fillStyle = colours.soft;
    ctx.fillText(text, x + shift, height / 2 - 2);
    ctx.textAlign = "center";
  }
}

function paintGrid(painting, height) {
  const { ctx, colours } = painting;
  ctx.fillStyle = colours.rail;
  ctx.globalAlpha = 0.5;
  for (const tick of ticksOf(painting).ticks) ctx.fillRect(Math.round(place(painting, tick)), 0, 1, height);
  ctx.globalAlpha = 1;
}

/** The range that a trace's height represents, and the values beyond it. */
function rangeText(row) {
  const parts = [];
  if (row.kind === "real" && row.low !== undefined && row.low < row.high) {
    // A value close to 0 compared with the whole range looks like 0.
    const round = (value) => (Math.abs(value) < (row.high - row.low) * 1e-6 ? 0 : value);
    parts.push(`${short(round(row.low), 4)} to ${valueText(row, round(row.high), 4)}`);
  }
  if (row.resolution) parts.push(`thinned to ${row.resolution}`);
  return parts.join(", ");
}

/** One row with its label; `row` is a band or a signal, `value` the text at the cursor. */
function paintRow(painting, row, top, height, value) {
  const { ctx, colours, left, width, isNarrow } = painting;
  const labelHeight = isNarrow ? 18 : 0;
  const [high, low] = [top + labelHeight + 5, top + height - 5];
  ctx.font = FONT;
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  const end = isNarrow ? left + width : left - 8;
  let room = end - 8;
  const middle = isNarrow ? top + 11 : top + height / 2;
  if (value) {
    ctx.font = NUMBERS;
    ctx.textAlign = "right";
    ctx.fillStyle = colours.text;
    const text = fitted(ctx, value, room * 0.45);
    ctx.fillText(text, end, middle);
    room -= ctx.measureText(text).width + 8;
    ctx.font = FONT;
    ctx.textAlign = "left";
  }
  const range = rangeText(row);
  ctx.fillStyle = row.spans ? colours.soft : colours.text;
  const name = fitted(ctx, row.name, room);
  ctx.fillText(name, 6, range && !isNarrow ? middle - 6 : middle);
  if (range) {
    const after = isNarrow ? 14 + ctx.measureText(name).width : 6;
    ctx.font = SMALL;
    ctx.fillStyle = colours.soft;
    ctx.fillText(fitted(ctx, range, room + 6 - after), after, isNarrow ? middle : middle + 8);
  }
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, top, width, height);
  ctx.clip();
  if (row.spans) {
    paintSpans(painting, row.spans, high - 2, low + 2);
  } else if (row.data) {
    if (row.kind === "bool") paintBool(painting, row.data, high, low);
    else paintReal(painting, row, row.data, high, low);
  } else {
    ctx.fillStyle = colours.soft;
    ctx.fillText(row.failure ? "cannot be unpacked: " + row.failure : "…", left + 6, (high + low) / 2);
  }
  ctx.restore();
  ctx.fillStyle = colours.rail;
  ctx.fillRect(0, top + height - 1, left + width, 1);
}
