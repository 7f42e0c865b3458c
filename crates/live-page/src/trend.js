"use strict";

// The trend of a signal: what the server has kept, and what has come since, drawn as the report draws it.

const trend = (() => {
  /** What is shown, in milliseconds. */
  const LENGTHS = [15000, 60000, 300000];
  /** Values that are kept by the page, for each signal. */
  const MOST = 60000;
  let length = LENGTHS[1];
  let colours = null;

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours = null; });

  /** Begins to collect a signal, with what the server has of it. */
  async function open(signal) {
    signal.isOpen = true;
    if (signal.trend) return;
    const mine = { times: [plant.now()], values: [plant.number(signal)] };
    signal.trend = mine;
    try {
      const answer = await room.ask(`/trend/${signal.driver.id}/${signal.index}`);
      if (!answer.ok || signal.trend !== mine) return;
      const { ms, values } = await answer.json();
      const begin = mine.times[0];
      const end = ms.findIndex((time) => time >= begin);
      const kept = end < 0 ? ms.length : end;
      mine.times = ms.slice(0, kept).concat(mine.times);
      mine.values = values.slice(0, kept).map((value) => value ?? NaN).concat(mine.values);
    } catch {
      // The trend begins now, then.
    }
  }

  function close(signal) {
    signal.isOpen = false;
    signal.trend = null;
  }

  /** A signal has another value. */
  function add(signal, time) {
    const data = signal.trend;
    const value = plant.number(signal);
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
    // The run of the report ends with the present here, which is 0 s on the axis.
    run.begin = -length * run.unit;
    run.end = length;
    const begin = plant.now() - length;
    const first = Math.max(0, indexAt(signal.trend.times, begin));
    const data = {
      times: signal.trend.times.slice(first).map((time) => time - begin),
      values: signal.trend.values.slice(first),
    };
    paintGrid(painted, height - axis);
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

  /** The next length of time, for all trends. */
  function next() {
    length = LENGTHS[(LENGTHS.indexOf(length) + 1) % LENGTHS.length];
    return length;
  }

  return { open, close, add, draw, next, get length() { return length; } };
})();
