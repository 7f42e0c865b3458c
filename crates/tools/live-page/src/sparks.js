"use strict";

// Small trends in the rows of the list, of the 60 s before now or before the moment that the page shows.

const sparks = (() => {
  /** The length of time that they show, and the time between two requests, in milliseconds. */
  const LENGTH = 60000;
  const PERIOD = 2000;
  /** The pause after other rows are shown, or another moment, in milliseconds: moving the bar of time has to stay quick. */
  const PAUSE = 250;
  /** The same times as multiples of what an answer took: reading a long history costs the server much. */
  const PERIODS = 20;
  const PAUSES = 4;
  /** The most that they get, in milliseconds. */
  const LONGEST = 10000;
  /** The most points of a signal in that time, and the fewest of a request: those of two spans. */
  const POINTS = 240;
  const FEWEST = 10;
  const HEIGHT = 24;
  const frame = document.getElementById("list");
  /** The canvases of the rows, and the signal of each; null in a row without a small trend. */
  const rows = new Map();
  /** The known changes by their signals. */
  const known = new Map();
  /** What each canvas shows. */
  const drawn = new Map();
  let colours = null;
  /** The width in pixels; 0 while there are none. */
  let width = 0;
  /** No request before these times. */
  let [due, rested] = [0, 0];
  /** How long the slowest answer of the last time took, in milliseconds. */
  let last = 0;
  /** How often other rows or another moment were shown. */
  let changes = 0;

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    colours = null;
    renew();
  });

  /** The rows that are shown, as pairs of canvas and signal. */
  const shown = () => [...rows].filter(([canvas, signal]) => signal?.driver.past && !canvas.closest(".row").hidden);

  /** The newest time of a signal's driver that the page shows. */
  const endOf = ({ driver }) => driver.moment?.ms ?? plant.now(driver);

  /** Requests what the shown rows lack, one request after the other, and draws it. */
  async function collect() {
    const now = performance.now();
    if (!width || document.hidden || now < Math.max(due, rested)) return;
    due = now + PERIOD;
    let longest = 0;
    const before = changes;
    for (const [signal, { until }] of known) if (until < endOf(signal) - LENGTH || !plant.drivers.includes(signal.driver)) known.delete(signal);
    const signals = shown().map(([, signal]) => signal);
    for (const signal of signals) if (!known.has(signal)) known.set(signal, trend.unknown());
    for (const driver of plant.drivers) {
      const own = signals.filter((signal) => signal.driver === driver);
      if (!own.length) continue;
      const end = endOf(own[0]);
      const begin = end - LENGTH;
      const series = own.map((signal) => ({ index: signal.index, trend: known.get(signal) }));
      const points = (span) => `/${Math.max(FEWEST, Math.ceil(POINTS * span / LENGTH))}`;
      for (const request of trend.requests(driver, series, { begin, end, from: begin, to: end }, points)) {
        const asked = performance.now();
        await request();
        longest = Math.max(longest, performance.now() - asked);
      }
      for (const { trend } of series) drop(trend, begin);
    }
    // One slow answer may have waited behind another request.
    const usual = Math.min(longest, last);
    last = longest;
    rested = performance.now() + Math.min(PAUSES * usual, LONGEST);
    if (changes === before) {
      due = Math.max(due, now + Math.min(PERIODS * usual, LONGEST));
      frame.classList.remove("is-late");
    }
    draw();
  }

  /** Drops the changes before a time, except the value at that time. */
  function drop(series, begin) {
    const old = Math.max(0, indexAt(series.times, begin));
    series.times.splice(0, old);
    series.values.splice(0, old);
    series.from = Math.max(series.from, begin);
  }

  /** Draws all of them in another width or in other colours. */
  function renew() {
    drawn.clear();
    for (const canvas of rows.keys()) context(canvas, width, HEIGHT);
    draw();
  }

  function draw() {
    if (!width) return;
    colours ??= coloursAt(document.body);
    for (const [canvas, signal] of shown()) if (known.has(signal)) drawOne(canvas, signal, known.get(signal));
  }

  /** Draws a small trend, if it has changed. */
  function drawOne(canvas, signal, series) {
    const end = signal.driver.moment?.ms ?? series.until;
    const data = trend.since(series, end - LENGTH);
    data.times.length = data.values.length = indexAt(data.times, LENGTH) + 1;
    const isSame = data.times.length === 1 && data.times[0] <= 0 && series.until >= end;
    const now = isSame ? String(data.values[0]) : `${end}/${series.until}`;
    if (drawn.get(canvas) === now) return;
    drawn.set(canvas, now);
    const ctx = context(canvas, width, HEIGHT);
    run.end = Math.min(end, series.until) - (end - LENGTH);
    trend.paintTrace({ ctx, colours, left: 0, width, from: 0, to: LENGTH }, signal, data, 3, HEIGHT - 3);
  }

  // The title above them is as wide, and is hidden with them.
  new ResizeObserver(([{ contentRect }]) => {
    ({ width } = contentRect);
    renew();
  }).observe(document.getElementById("spark"));
  room.every(50, collect);

  return {
    /** Gives a row's canvas another signal, or none. */
    put(canvas, signal) {
      rows.set(canvas, signal);
      drawn.delete(canvas);
      if (width) context(canvas, width, HEIGHT);
      changes += 1;
      due = Math.min(due, performance.now() + PAUSE);
    },
    /** After the moment that the page shows has changed. */
    moved() {
      changes += 1;
      due = performance.now() + PAUSE;
      frame.classList.add("is-late");
    },
  };
})();
