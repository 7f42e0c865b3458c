// The chart on the screen: the visible range, and how the user moves it.

const element = (id) => document.getElementById(id);
const lanes = element("lanes");
const canvas = element("canvas");
const overview = element("overview");

/** From the first to the last moment; never empty. */
const whole = { from: 0, to: Math.max(run.end, 1) };
/** The shortest visible range, in units: a tenth of a change, and within a double's resolution. */
const CLOSEST = Math.max(0.1, run.end * 1e-12);

const view = { ...whole };
let rows = [];
let tops = [];
let chosen = -1;
/** The time at which values are read, and the time from which the distance is measured; or null. */
let cursor = null;
let mark = null;
let colours = null;
/** For measurements: when the first redraw was done, and the longest one, in milliseconds. */
let drawn = { count: 0, first: 0, longest: 0 };

const isNarrow = () => lanes.clientWidth < 640;
const labelWidth = () => (isNarrow() ? 0 : Math.min(280, Math.round(lanes.clientWidth * 0.26)));
const heightOf = (row) => (row.spans ? (isNarrow() ? 44 : 30) : (isNarrow() ? 56 : 36));

function painting(ctx) {
  const left = labelWidth() + (isNarrow() ? MARGIN : 0);
  return { ctx, colours, left, width: Math.max(10, lanes.clientWidth - left - MARGIN), isNarrow: isNarrow(), ...view };
}

/** Selects the rows by the filter. */
function choose() {
  const words = element("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  const onlyActive = element("active").checked;
  const fits = (signal) => {
    const name = signal.name.toLowerCase();
    return (!onlyActive || signal.count > 1) && words.every((word) => name.includes(word));
  };
  const kept = rows[chosen];
  const signals = run.signals.filter(fits);
  rows = [...run.bands, ...signals];
  chosen = rows.indexOf(kept);
  element("empty").hidden = signals.length > 0;
  element("empty").textContent = run.signals.length ? "No signal fits the filter." : "The recording has no signals.";
  layOut();
}

function layOut() {
  tops = [0];
  for (const row of rows) tops.push(tops[tops.length - 1] + heightOf(row));
  const total = tops[tops.length - 1];
  element("room").style.height = total + "px";
  lanes.style.height = Math.min(total, Math.max(280, Math.round(window.innerHeight * 0.68))) + "px";
  redraw();
}

let isDue = false;
function redraw() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    draw();
  });
}

/** The row at a height within all rows. */
const rowAt = (y) => Math.min(rows.length - 1, Math.max(0, indexAt(tops, y)));

/** The height of the bands, which stay at the top while the signals scroll below: signals are read against them. */
function pinned() {
  const height = tops[run.bands.length] ?? 0;
  return !isNarrow() && height <= lanes.clientHeight * 0.4 ? height : 0;
}

function draw() {
  const begun = performance.now();
  colours ??= coloursAt(document.body);
  const [width, height] = [lanes.clientWidth, lanes.clientHeight];
  if (!width) return;
  const shown = painting(context(canvas, width, height));
  const { ctx } = shown;
  const scrolled = lanes.scrollTop;
  paintGrid(shown, height);
  const waiting = [];
  function paint(i, top) {
    const row = rows[i];
    if (i === chosen) {
      ctx.fillStyle = colours.chosen;
      ctx.fillRect(0, top, width, tops[i + 1] - tops[i]);
    }
    if (!row.spans && !row.data && !row.failure) waiting.push(row.number);
    paintRow(shown, row, top, tops[i + 1] - tops[i], cursor === null ? "" : readAt(row, cursor));
  }
  const fixed = pinned();
  const bands = fixed ? run.bands.length : 0;
  for (let i = 0; i < bands; i++) paint(i, tops[i]);
  ctx.save();
  ctx.beginPath();
  ctx.rect(0, fixed, width, height - fixed);
  ctx.clip();
  for (let i = Math.max(bands, rowAt(scrolled + fixed)); i < rows.length && tops[i] < scrolled + height; i++) {
    paint(i, tops[i] - scrolled);
  }
  ctx.restore();
  if (fixed) {
    ctx.fillStyle = colours.soft;
    ctx.fillRect(0, fixed - 1, width - MARGIN, 1);
  }
  paintLine(shown, mark, colours.mark, height, [5, 4]);
  paintLine(shown, cursor, colours.cursor, height, []);
  const axis = painting(context(element("axis"), width, 26));
  paintAxis(axis, 26);
  paintOverview();
  tell();
  if (waiting.length) want(waiting);
  const took = performance.now() - begun;
  drawn = { count: drawn.count + 1, first: drawn.first || begun + took, longest: Math.max(drawn.longest, took) };
}

function paintLine({ ctx, left, width, ...rest }, time, colour, height, dashes) {
  if (time === null) return;
  const x = place({ left, width, ...rest }, time);
  if (x < left - 1 || x > left + width + 1) return;
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1;
  ctx.setLineDash(dashes);
  ctx.beginPath();
  ctx.moveTo(Math.round(x) + 0.5, 0);
  ctx.lineTo(Math.round(x) + 0.5, height);
  ctx.stroke();
  ctx.setLineDash([]);
}

/** The value of a row at a time, as text. */
function readAt(row, time) {
  if (row.spans) {
    const there = row.spans.filter(([from, to]) => from <= time && time < to).map(([, , , text]) => text);
    return there.length > 2 ? there.length + " at once" : there.join(", ");
  }
  if (!row.data) return "";
  return valueText(row, valueOf(row.data, indexAt(row.data.times, time)));
}

function overviewPainting() {
  return { left: MARGIN, width: Math.max(10, overview.parentElement.clientWidth - 2 * MARGIN), ...whole };
}

function paintOverview() {
  const height = 44;
  const ctx = context(overview, overview.parentElement.clientWidth, height);
  const all = { ...overviewPainting(), ctx, colours };
  const most = Math.max(1, ...run.activity.map(Math.sqrt));
  const step = all.width / run.activity.length;
  ctx.fillStyle = colours.busy;
  run.activity.forEach((count, i) => {
    const size = count ? Math.max(2, Math.sqrt(count) / most * 28) : 0;
    ctx.fillRect(all.left + i * step, 32 - size, Math.max(1, step), size);
  });
  for (const band of run.bands) {
    if (band.kind === "link" || band.kind === "fault") {
      for (const [from, to, kind] of band.spans) {
        if (kind === "good" && band.kind === "link") continue;
        ctx.fillStyle = colours[kind === "fault" ? "bad" : kind];
        const x = place(all, from);
        ctx.fillRect(x, 34, Math.max(2, place(all, to) - x), 6);
      }
    }
  }
  const [from, to] = [place(all, Math.max(view.from, whole.from)), place(all, Math.min(view.to, whole.to))];
  ctx.fillStyle = colours.paper;
  ctx.globalAlpha = 0.65;
  ctx.fillRect(0, 0, from, height);
  ctx.fillRect(to, 0, all.left + all.width + MARGIN - to, height);
  ctx.globalAlpha = 1;
  ctx.strokeStyle = colours.trace;
  ctx.lineWidth = 1.5;
  ctx.strokeRect(from, 1, Math.max(2, to - from), height - 2);
}

/** Writes the line of text above the chart. */
function tell() {
  const step = (view.to - view.from) * run.unit / 1e9 / 1000;
  const fine = Math.max(step, run.unit / 1e9);
  let text = `${timeText(view.from, fine)} to ${timeText(view.to, fine)}`;
  if (cursor !== null) text += ` · at ${timeText(cursor, fine)}`;
  if (cursor !== null && mark !== null) text += ` · ${spanText(cursor - mark)} from the mark`;
  element("range").textContent = text;
}

let saying = 0;
/** Updates the text for screen readers, once the keys rest. */
function say() {
  clearTimeout(saying);
  saying = setTimeout(() => {
    const row = rows[chosen];
    let text = element("range").textContent;
    if (row) text += `. ${row.name}: ${cursor === null ? "" : readAt(row, cursor) || "nothing"}`;
    element("said").textContent = text;
  }, 400);
}

/** Shows a range, shifted to lie within the run. */
function show(from, to) {
  const most = whole.to - whole.from;
  const size = Math.min(most, Math.max(CLOSEST, to - from));
  const middle = (from + to) / 2;
  let begin = middle - size / 2;
  begin = Math.min(Math.max(begin, whole.from), whole.to - size);
  view.from = begin;
  view.to = begin + size;
  redraw();
}

function zoom(factor, at = (view.from + view.to) / 2) {
  const size = Math.min(whole.to - whole.from, Math.max(CLOSEST, (view.to - view.from) * factor));
  const share = (at - view.from) / (view.to - view.from);
  show(at - share * size, at - share * size + size);
}

const pan = (share) => {
  const by = (view.to - view.from) * share;
  show(view.from + by, view.to + by);
};

/** The centre of a zoom by key: the cursor, if it is visible. */
const focus = () => (cursor !== null && cursor >= view.from && cursor <= view.to ? cursor : undefined);

function chooseRow(row) {
  if (!rows.length) return;
  chosen = Math.min(rows.length - 1, Math.max(0, row));
  const [top, end] = [tops[chosen], tops[chosen + 1]];
  const fixed = pinned();
  if (top < lanes.scrollTop + fixed && !(fixed && rows[chosen].spans)) lanes.scrollTop = top - fixed;
  if (end > lanes.scrollTop + lanes.clientHeight) lanes.scrollTop = end - lanes.clientHeight;
  redraw();
}

/** Moves to the next (1) or previous (-1) change of the chosen row. */
function step(direction) {
  const row = rows[chosen];
  if (!row) return;
  const here = cursor ?? (direction > 0 ? view.from : view.to);
  let times = row.spans ? Array.from(new Set(row.spans.flatMap(([from, to]) => [from, to]))).sort((a, b) => a - b) : row.data?.times;
  if (!times) return;
  let index = indexAt(times, here);
  if (direction > 0) index += 1;
  else if (index >= 0 && times[index] === here) index -= 1;
  if (index < 0 || index >= times.length) return;
  cursor = times[index];
  if (cursor < view.from || cursor > view.to) {
    const half = (view.to - view.from) / 2;
    show(cursor - half, cursor + half);
  }
  redraw();
}

const keys = {
  "+": () => zoom(0.5, focus()),
  "=": () => zoom(0.5, focus()),
  "-": () => zoom(2, focus()),
  "−": () => zoom(2, focus()),
  "0": () => show(whole.from, whole.to),
  ArrowLeft: () => pan(-0.15),
  ArrowRight: () => pan(0.15),
  PageUp: () => chooseRow(chosen - 10),
  PageDown: () => chooseRow(chosen + 10),
  Home: () => show(whole.from, whole.from + view.to - view.from),
  End: () => show(whole.to - (view.to - view.from), whole.to),
  ArrowUp: () => chooseRow(chosen - 1),
  ArrowDown: () => chooseRow(chosen + 1),
  n: () => step(1),
  p: () => step(-1),
  m: () => { mark = cursor; redraw(); },
  Escape: () => { mark = cursor = null; redraw(); },
};

lanes.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const action = keys[event.key] ?? keys[event.key.toLowerCase()];
  if (!action) return;
  event.preventDefault();
  action();
  say();
});

const tools = { in: () => zoom(0.5, focus()), out: () => zoom(2, focus()), left: () => pan(-0.4), right: () => pan(0.4), fit: () => show(whole.from, whole.to) };
document.querySelector(".tools").addEventListener("click", (event) => {
  const action = event.target.closest("button")?.dataset.do;
  if (action) {
    tools[action]();
    say();
  }
});

/** The time at a place of the chart. */
function timeAt(clientX) {
  const { left, width } = painting(null);
  const x = clientX - lanes.getBoundingClientRect().left;
  return view.from + (x - left) / width * (view.to - view.from);
}

lanes.addEventListener("wheel", (event) => {
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
  if (event.ctrlKey || event.metaKey) {
    event.preventDefault();
    zoom(Math.exp(Math.max(-120, Math.min(120, event.deltaY * lines)) * 0.008), timeAt(event.clientX));
  } else if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
    event.preventDefault();
    pan((event.deltaX || event.deltaY) * lines / painting(null).width);
  }
}, { passive: false });

// The pressed pointers: where each began, and the view at that time.
const pointers = new Map();
let grip = null;
const CLICK = 5;

function takeGrip() {
  const places = Array.from(pointers.values());
  grip = { view: { ...view }, places: places.map((x) => x), moved: grip?.moved ?? 0, times: places.map(timeAt) };
}

lanes.addEventListener("pointerdown", (event) => {
  if (event.button || event.target !== canvas) return;
  pointers.set(event.pointerId, event.clientX);
  canvas.setPointerCapture(event.pointerId);
  if (pointers.size === 1) grip = null;
  takeGrip();
});

lanes.addEventListener("pointermove", (event) => {
  if (!pointers.has(event.pointerId)) {
    if (event.pointerType === "mouse") {
      const time = timeAt(event.clientX);
      cursor = time >= view.from && time <= view.to ? time : null;
      redraw();
    }
    return;
  }
  pointers.set(event.pointerId, event.clientX);
  const places = Array.from(pointers.values());
  const { left, width } = painting(null);
  const box = lanes.getBoundingClientRect().left + left;
  if (places.length === 1) {
    const by = places[0] - grip.places[0];
    grip.moved = Math.max(grip.moved, Math.abs(by));
    if (grip.moved < CLICK) return;
    const units = by / width * (grip.view.to - grip.view.from);
    show(grip.view.from - units, grip.view.to - units);
  } else {
    grip.moved = CLICK;
    const [a, b] = [places[0] - box, places[1] - box];
    const [s, t] = grip.times;
    if (Math.abs(a - b) < 8) return;
    const scale = Math.abs((s - t) / (a - b));
    const from = (s + t) / 2 - (a + b) / 2 * scale;
    show(from, from + width * scale);
  }
});

function release(event) {
  if (!pointers.delete(event.pointerId)) return;
  if (event.type === "pointerup" && grip.moved < CLICK) {
    cursor = Math.min(view.to, Math.max(view.from, timeAt(event.clientX)));
    if (event.pointerType === "mouse") mark = cursor;
    const y = event.clientY - lanes.getBoundingClientRect().top;
    chosen = rows.length ? rowAt(y < pinned() ? y : y + lanes.scrollTop) : -1;
    redraw();
  }
  if (pointers.size) takeGrip();
}
lanes.addEventListener("pointerup", release);
lanes.addEventListener("pointercancel", release);
lanes.addEventListener("dblclick", (event) => zoom(event.shiftKey ? 2 : 0.4, timeAt(event.clientX)));
lanes.addEventListener("pointerleave", (event) => {
  if (event.pointerType === "mouse" && !pointers.size) {
    cursor = null;
    redraw();
  }
});
lanes.addEventListener("scroll", redraw, { passive: true });

// The strip of the whole run: a drag chooses a range; one that begins within a chosen range moves it.
let strip = null;
const stripTime = (event) => {
  const { left, width } = overviewPainting();
  const share = (event.clientX - overview.getBoundingClientRect().left - left) / width;
  return whole.from + Math.min(1, Math.max(0, share)) * (whole.to - whole.from);
};
overview.addEventListener("pointerdown", (event) => {
  if (event.button) return;
  overview.setPointerCapture(event.pointerId);
  const time = stripTime(event);
  const isPart = view.to - view.from < 0.98 * (whole.to - whole.from);
  strip = { time, x: event.clientX, moves: isPart && time >= view.from && time <= view.to, view: { ...view } };
});
overview.addEventListener("pointermove", (event) => {
  if (!strip || Math.abs(event.clientX - strip.x) < CLICK) return;
  const time = stripTime(event);
  if (strip.moves) show(strip.view.from + time - strip.time, strip.view.to + time - strip.time);
  else show(Math.min(time, strip.time), Math.max(time, strip.time));
});
overview.addEventListener("pointerup", (event) => {
  if (strip && !strip.moves && Math.abs(event.clientX - strip.x) < CLICK) {
    const half = (view.to - view.from) / 2;
    show(strip.time - half, strip.time + half);
  }
  strip = null;
});
overview.addEventListener("pointercancel", () => { strip = null; });

// Times in the tables lead to their place in the chart.
document.addEventListener("click", (event) => {
  const link = event.target.closest?.("a[data-from]");
  if (!link) return;
  event.preventDefault();
  const [from, to] = [Number(link.dataset.from), Number(link.dataset.to)];
  const around = Math.max(to - from, (whole.to - whole.from) / 1000) / 4;
  show(from - around, to + around);
  cursor = from;
  element("signals").scrollIntoView();
  lanes.focus({ preventScroll: true });
  say();
});
