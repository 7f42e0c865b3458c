"use strict";

// The trend of a signal: the server's history and the values received since, drawn by the report's code.

const trend = (() => {
  /** The selectable lengths, in milliseconds. */
  const LENGTHS = [15000, 60000, 300000];
  /** The most values that the page keeps per signal. */
  const MOST = 60000;
  let length = LENGTHS[1];
  let colours = null;

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours = null; });

  /** Begins to collect a signal, starting with the server's history. */
  async function open(signal) {
    signal.isOpen = true;
    if (signal.trend) return;
    const mine = { times: [plant.now()], values: [plant.live(signal)], sampled: null };
    signal.trend = mine;
    try {
      const answer = await room.ask(`/trend/${signal.driver.id}/${signal.index}`);
      if (!answer.ok || signal.trend !== mine) return;
      const kept = await answer.json();
      const begin = mine.times[0];
      const end = kept.ms.findIndex((time) => time >= begin);
      const count = end < 0 ? kept.ms.length : end;
      const times = kept.ms.slice(0, count).concat(mine.times);
      const values = kept.values.slice(0, count).map((value) => value ?? NaN).concat(mine.values);
      // Each point is drawn as a change.
      const isChange = (_, i) => i === 0 || !Object.is(values[i], values[i - 1]);
      mine.times = times.filter(isChange);
      mine.values = values.filter(isChange);
      mine.sampled = { until: begin, often: kept.samples_per_s };
    } catch {
      // Without the history, the trend begins now.
    }
  }

  function close(signal) {
    signal.isOpen = false;
    signal.trend = null;
  }

  /** Adds a signal's new value. */
  function add(signal, time) {
    const data = signal.trend;
    const value = plant.live(signal);
    if (Object.is(value, data.values.at(-1))) return;
    data.times.push(time);
    data.values.push(value);
    if (data.times.length <= MOST) return;
    data.times.splice(0, MOST / 4);
    data.values.splice(0, MOST / 4);
  }

  /** Draws a signal's trend on a canvas of this width. */
  function draw(canvas, signal, width, height) {
    colours ??= coloursAt(document.body);
    const ctx = context(canvas, width, height);
    const axis = 20;
    const gutter = 58;
    const painted = { ctx, colours, left: gutter, width: Math.max(10, width - gutter - MARGIN), isNarrow: true, from: 0, to: length };
    // The report's run ends now, which is 0 s on the axis.
    run.begin = -length * run.unit;
    run.end = length;
    const begin = plant.now() - length;
    const first = Math.max(0, indexAt(signal.trend.times, begin));
    const data = {
      times: signal.trend.times.slice(first).map((time) => time - begin),
      values: signal.trend.values.slice(first),
    };
    paintGrid(painted, height - axis);
    paintSampled(painted, signal.trend.sampled, begin, height - axis);
    paintUnknown(painted, data, height - axis);
    const [top, bottom] = [6, height - axis - 5];
    ctx.save();
    ctx.beginPath();
    ctx.rect(painted.left, 0, painted.width, height - axis);
    ctx.clip();
    let [low, high] = [0, 1];
    if (signal.isBool) {
      paintBool(painted, data, top, bottom);
    } else {
      [low, high] = [Infinity, -Infinity];
      for (const value of data.values) {
        if (value < low) low = value;
        if (value > high) high = value;
      }
      if (low === high) [low, high] = [low - 1, high + 1];
      paintReal(painted, { low, high }, data, top, bottom);
    }
    ctx.restore();
    ctx.font = SMALL;
    ctx.fillStyle = colours.soft;
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    const ends = signal.isBool ? ["TRUE", "FALSE"] : [high, low].map((value) => (Number.isFinite(value) ? short(value, 4) : "–"));
    ctx.fillText(ends[0], gutter - 6, top + 4);
    ctx.fillText(ends[1], gutter - 6, bottom - 4);
    ctx.translate(0, height - axis);
    paintAxis(painted, axis);
  }

  /** Paints the time of which only samples are known, and their number. */
  function paintSampled({ ctx, colours, left, width, to }, sampled, begin, height) {
    const end = sampled ? (sampled.until - begin) / to * width : 0;
    if (end <= 0) return;
    ctx.globalAlpha = 0.5;
    ctx.fillStyle = colours.idle;
    ctx.fillRect(left, 0, end, height);
    ctx.globalAlpha = 1;
    ctx.fillStyle = colours["idle-text"];
    ctx.fillRect(left + end - 1, 0, 1, height);
    ctx.font = SMALL;
    ctx.textAlign = "right";
    ctx.textBaseline = "top";
    const text = fitted(ctx, `${sampled.often} samples a second until here`, end - 8);
    if (text.length > 3) ctx.fillText(text, left + end - 4, height / 2 - 5);
  }

  /** Paints the time without a valid value. */
  function paintUnknown(painted, { times, values }, height) {
    const { ctx, colours, left, width, to } = painted;
    values.forEach((value, i) => {
      if (!Number.isNaN(value)) return;
      const x = left + Math.max(0, times[i]) / to * width;
      const end = left + Math.min(to, times[i + 1] ?? to) / to * width;
      if (end <= x) return;
      ctx.fillStyle = colours.stale;
      ctx.fillRect(x, 0, end - x, height);
      hatch(painted, x, 0, end - x, height, colours["stale-text"]);
    });
  }

  /** Selects the next length, for all trends. */
  function next() {
    length = LENGTHS[(LENGTHS.indexOf(length) + 1) % LENGTHS.length];
    return length;
  }

  return { open, close, add, draw, next, get length() { return length; } };
})();
