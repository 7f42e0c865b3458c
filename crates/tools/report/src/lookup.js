"use strict";

// Changes of signals by their time. The report and the live page share this and draw.js: each has a `run` with `begin` (of
// the simulation, in nanoseconds), `end` (in units), and `unit` (in nanoseconds).

/** The number of changes per block of the pyramid of least and greatest values. */
const BLOCK = 128;

/** Least and greatest value of every BLOCK changes, so that a pixel reads few of a million. */
function pyramid(values) {
  const blocks = Math.floor(values.length / BLOCK);
  const low = new values.constructor(blocks).fill(Infinity);
  const high = new values.constructor(blocks).fill(-Infinity);
  for (let block = 0, i = 0; block < blocks; block++) {
    for (const end = i + BLOCK; i < end; i++) {
      const value = values[i];
      if (value < low[block]) low[block] = value;
      if (value > high[block]) high[block] = value;
    }
  }
  return { low, high };
}

/** The last change at or before a time; -1 before the first. */
function indexAt(times, time, from = 0, to = times.length) {
  while (from < to) {
    const middle = (from + to) >>> 1;
    if (times[middle] <= time) from = middle + 1;
    else to = middle;
  }
  return from - 1;
}

/** The value from a change on; NaN before the first. */
function valueOf(data, index) {
  if (index < 0) return NaN;
  return data.values ? data.values[index] : (data.first + index) % 2;
}

/** Least and greatest value of the changes from `from` on and before `to`. */
function extremes(data, from, to) {
  let low = Infinity;
  let high = -Infinity;
  const values = data.values;
  for (let i = from; i < to;) {
    if (data.pyramid && i % BLOCK === 0 && i + BLOCK <= to) {
      const block = i / BLOCK;
      if (data.pyramid.low[block] < low) low = data.pyramid.low[block];
      if (data.pyramid.high[block] > high) high = data.pyramid.high[block];
      i += BLOCK;
    } else {
      const value = values[i++];
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low, high];
}
