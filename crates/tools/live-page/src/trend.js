"use strict";

// The trends of signals: every change of every tick, from the server's history, drawn by the report's code.

const trend = (() => {
  /** The selectable lengths, in milliseconds. */
  const LENGTHS = [15000, 60000, 300000];
  /** The time between two requests for what is new, in milliseconds. */
  const PERIOD = 100;
  /** The most values that the page keeps per signal without a history. */
  const MOST = 60000;
  let length = LENGTHS[1];
  let colours = null;

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours = null; });

  /** The changes between `from` and `until` are known: none yet. */
  const unknown = () => ({ times: [], values: [], from: Infinity, until: -Infinity, isSampled: false });

  /** Begins to collect a signal. */
  function open(signal) {
    signal.isOpen = true;
    signal.trend ??= unknown();
  }

  function close(signal) {
    signal.isOpen = false;
    signal.trend = null;
  }

  /** The time that a driver's trends show: its begin and end, and the moment that the page shows. */
  function view(driver) {
    const now = plant.now(driver);
    if (!driver.moment) return { begin: now - length, end: now, at: now };
    const at = driver.moment.ms;
    const end = Math.min(Math.max(now, at), at + length / 4);
    return { begin: end - length, end, at };
  }

  /** Requests what the open trends lack. */
  const collect = room.every(PERIOD, async () => {
    if (!document.hidden) await Promise.all(plant.drivers.map(collectOf));
  });

  async function collectOf(driver) {
    const open = driver.signals.filter((signal) => signal.isOpen && signal.trend);
    if (!driver.past) {
      for (const signal of open) collectOwn(signal);
      return;
    }
    if (!open.length) return;
    const { begin, end } = view(driver);
    const span = { begin, end, from: begin - length, to: driver.moment ? end + length : end + 1000 };
    await Promise.all(requests(driver, open, span).map((request) => request()));
    list.redraw();
  }

  /**
   * The requests, as functions, for what signals lack between `begin` and `end`: one for those that continue, until `to`, and
   * one for those that begin, from `from` on. `most` is the number of points that is enough for a time.
   */
  function requests(driver, signals, { begin, end, from: first, to }, most = () => "") {
    const ask = [];
    for (const signal of signals) {
      const { trend } = signal;
      // What the server no longer has is not asked for again.
      if (trend.from > Math.max(begin, driver.past.first) + 1 || trend.until < begin) Object.assign(trend, unknown());
      if (trend.until < end && trend.until < driver.past.last) ask.push(signal);
    }
    const groups = [ask.filter(({ trend }) => trend.times.length), ask.filter(({ trend }) => !trend.times.length)];
    return groups.filter((group) => group.length).map((group) => async () => {
      const from = group[0].trend.times.length ? Math.min(...group.map(({ trend }) => trend.until)) : first;
      const answer = await room.ask(`/trend/${driver.id}/${group.slice(0, 100).map(({ index }) => index).join(",")}/${from}/${to}${most(to - from)}`);
      if (!answer.ok) return;
      const news = await answer.json();
      for (const { index, trend } of group) if (news.signals[index] && trend) add(trend, news.signals[index], news, from);
    });
  }

  /** Puts the changes of an answer, from a time on, into the place of those that were known. */
  function merge({ times, values }, given, from) {
    while (times.length && times.at(-1) > from) times.pop();
    values.length = times.length;
    given.ms.forEach((time, i) => {
      const value = given.values[i] ?? NaN;
      if (times.length && Object.is(value, values.at(-1))) return;
      times.push(time);
      values.push(value);
    });
  }

  /** Adds the changes of an answer from a time on; each is drawn as an edge. */
  function add(trend, given, { to_ms: until, is_sampled: isSampled }, from) {
    merge(trend, given, from);
    trend.from = Math.min(trend.from, from);
    trend.until = Math.max(trend.until, until);
    trend.isSampled = isSampled;
    if (trend.times.length > MOST) drop(trend);
  }

  /** Drops the oldest quarter. */
  function drop(trend) {
    trend.times.splice(0, MOST / 4);
    trend.values.splice(0, MOST / 4);
    trend.from = trend.times[0];
  }

  /** Without a history: the values that the page itself receives. */
  function collectOwn(signal) {
    const { trend } = signal;
    const value = plant.measured(signal);
    if (trend.times.length && Object.is(value, trend.values.at(-1))) return;
    trend.times.push(plant.now(signal.driver));
    trend.values.push(value);
    trend.isSampled = true;
    if (trend.times.length > MOST) drop(trend);
  }

  /** The changes from a time on, which becomes 0, with the value at that time. */
  function since({ times, values }, begin) {
    const first = Math.max(0, indexAt(times, begin));
    return { times: times.slice(first).map((time) => time - begin), values: values.slice(first) };
  }

  /** Paints a trace, and returns the range of its values. */
  function paintTrace(painted, signal, data, top, bottom) {
    if (signal.isBool) {
      paintBool(painted, data, top, bottom);
      return [0, 1];
    }
    let [low, high] = [Infinity, -Infinity];
    for (const value of data.values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (low === high) [low, high] = [low - 1, high + 1];
    paintReal(painted, { low, high }, data, top, bottom);
    return [low, high];
  }

  /** Draws a signal's trend on a canvas of this width. */
  function draw(canvas, signal, width, height) {
    colours ??= coloursAt(document.body);
    const ctx = context(canvas, width, height);
    const axis = 20;
    const gutter = 58;
    const painted = { ctx, colours, left: gutter, width: Math.max(10, width - gutter - MARGIN), isNarrow: true, from: 0, to: length };
    const { begin, end, at } = view(signal.driver);
    // The moment that is shown is 0 s on the axis.
    run.begin = (begin - at) * run.unit;
    const { until, isSampled } = signal.trend;
    const known = Math.min(end, Math.max(until, plant.now(signal.driver)));
    run.end = known - begin;
    const data = since(signal.trend, begin);
    const value = plant.measured(signal);
    // The value of now is here before the server's next answer.
    if (!signal.driver.moment && data.times.length && !Object.is(value, data.values.at(-1))) {
      data.times.push(Math.max(until - begin, data.times.at(-1)));
      data.values.push(value);
    }
    paintGrid(painted, height - axis);
    paintUnknown(painted, data, height - axis);
    const [top, bottom] = [6, height - axis - 5];
    ctx.save();
    ctx.beginPath();
    ctx.rect(painted.left, 0, painted.width, height - axis);
    ctx.clip();
    const [low, high] = paintTrace(painted, signal, data, top, bottom);
    if (signal.driver.moment) paintMoment(painted, at - begin, height - axis);
    ctx.restore();
    if (isSampled) paintSampled(painted, signal.driver.past !== null);
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

  /** Paints the moment that the page shows. */
  function paintMoment({ ctx, colours, left, width, to }, time, height) {
    ctx.fillStyle = colours.cursor;
    ctx.fillRect(left + time / to * width - 0.75, 0, 1.5, height);
  }

  /** Says that not every change is there. */
  function paintSampled({ ctx, colours, left, width }, isOfRun) {
    ctx.font = SMALL;
    ctx.textAlign = "left";
    ctx.textBaseline = "top";
    ctx.fillStyle = colours.soft;
    ctx.fillText(fitted(ctx, isOfRun ? "the steps that this page has seen" : "samples: this page has no history", width - 8), left + 4, 1);
  }

  /** Paints the time without a valid value. */
  function paintUnknown(painted, { times, values }, height) {
    const { ctx, colours, from, to } = painted;
    values.forEach((value, i) => {
      if (!Number.isNaN(value)) return;
      const x = place(painted, Math.max(from, times[i]));
      const end = place(painted, Math.min(to, run.end, times[i + 1] ?? run.end));
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

  return { open, close, draw, next, collect, merge, paintUnknown, unknown, requests, since, paintTrace, get length() { return length; } };
})();
