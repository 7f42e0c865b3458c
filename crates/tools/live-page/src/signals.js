"use strict";

// The drivers and their signals, as received in the events.

/** For drawing: the unit is milliseconds, and now is 0 s. */
const run = { begin: 0, end: 0, unit: 1e6 };

const plant = (() => {
  /** How long a changed value is shown as new, in milliseconds. */
  const NEW = 350;
  /** A connection that returns within this time has missed nothing visible in a trend, in milliseconds. */
  const MISSED = 250;
  const FAIL_SAFE = 1;
  const FORCED = 2;
  const STALE = 4;
  let layout = null;
  let drivers = [];
  let signals = [];
  /** The server's clock at its last message, in milliseconds, and this page's clock then. */
  let time = 0;
  let heard = 0;

  function signalOf(driver, given, index) {
    const words = [given.name, given.address, given.unit ?? "", given.type, driver.kind === "sync" ? driver.stations[given.station] : ""];
    const signal = {
      driver, index,
      name: given.name,
      address: given.address,
      type: given.type,
      unit: given.unit ?? "",
      station: given.station,
      direction: given.direction,
      latch: given.latch,
      reply: given.reply,
      isWritable: given.writable,
      isBool: given.type === "BOOL",
      words: words.join(" ").toLowerCase(),
      changed: -Infinity,
      isOpen: false,
      trend: null,
    };
    take(signal, given.value, given.raw, given.edges, (given.failsafe ? FAIL_SAFE : 0) | (given.forced === null ? 0 : FORCED) | (given.stale ? STALE : 0));
    return signal;
  }

  function take(signal, value, raw, edges, flags) {
    signal.value = value;
    signal.raw = raw;
    signal.edges = edges;
    signal.isFailSafe = (flags & FAIL_SAFE) !== 0;
    signal.isForced = (flags & FORCED) !== 0;
    signal.isStale = (flags & STALE) !== 0;
  }

  /** Replaces the signals: signals that exist after a restart, too, keep their open trends. */
  function takeAll(given, before) {
    const known = new Map(signals.map((signal) => [keyOf(signal), signal]));
    drivers = given.drivers.map((driver) => ({ ...driver, line: null }));
    signals = [];
    for (const driver of drivers) {
      driver.signals = driver.signals.map((it, index) => signalOf(driver, it, index));
      driver.byName = new Map(driver.signals.map((signal) => [signal.name, signal]));
      for (const signal of driver.signals) {
        const old = known.get(keyOf(signal));
        signal.isOpen = old?.isOpen ?? false;
        // The server has the missed values, coarsely.
        if (old?.trend && old.index === signal.index && time - before < MISSED) {
          signal.trend = old.trend;
          trend.add(signal, time);
        }
        signals.push(signal);
      }
    }
  }

  const keyOf = (signal) => `${signal.driver.id}/${signal.name}`;

  function takeLine(line) {
    for (const given of line.drivers) {
      const driver = drivers.find(({ id }) => id === given.id);
      if (driver) driver.line = { ...given, heard: performance.now() };
    }
  }

  /** Applies an event. Returns whether the signals were replaced, and whether the line has changed. */
  function hear(text) {
    const event = JSON.parse(text);
    // Another server has another clock: values collected by the old clock are not comparable.
    if (event.full && event.time_ms < time) for (const signal of signals) signal.trend = null;
    const before = time;
    time = event.time_ms;
    heard = performance.now();
    const isOther = event.full === true;
    if (isOther) {
      layout = event.layout;
      takeAll(event.signals, before);
    } else if (event.layout !== layout) {
      return { isOther: false, isLine: false };
    }
    if (event.line) takeLine(event.line);
    for (const [id, changes] of Object.entries(event.values ?? {})) {
      const driver = drivers.find((driver) => String(driver.id) === id);
      for (const [index, value, raw, edges, flags] of changes) {
        const signal = driver?.signals[index];
        if (!signal) continue;
        if (!Object.is(signal.value, value)) signal.changed = heard;
        take(signal, value, raw, edges, flags);
        if (signal.trend) trend.add(signal, time);
      }
    }
    return { isOther, isLine: Boolean(event.line) };
  }

  /** The server's time, in milliseconds. */
  const now = () => time + (performance.now() - heard);

  /** A value as a number; NaN without a value. */
  const number = (signal) => (signal.value === null ? NaN : Number(signal.value));

  /** A value as a measurement: NaN while it is stale. */
  const live = (signal) => (signal.isStale ? NaN : number(signal));

  /** The age of the data of a signal's station, in milliseconds; null if unknown. */
  function age(signal) {
    const line = signal.driver.line;
    const age = line?.stations?.[signal.station]?.age_ms;
    return age === undefined || age === null ? null : age;
  }

  return {
    hear, now, number, live, age, keyOf,
    isNew: (signal) => performance.now() - signal.changed < NEW,
    get drivers() { return drivers; },
    get signals() { return signals; },
  };
})();

/** Texts for people. */
const words = {
  /** A value without its unit, with enough decimals that its width is constant while it changes. */
  value(signal) {
    if (signal.value === null) return "–";
    if (signal.isBool) return plant.number(signal) > 0.5 ? "TRUE" : "FALSE";
    if (typeof signal.value === "string") return signal.value.replace("-", "−");
    return this.number(signal.value, signal);
  },
  number(value, signal) {
    if (Number.isInteger(value) && !signal.unit && !/REAL/.test(signal.type)) return String(value).replace("-", "−");
    const size = Math.abs(value);
    // A REAL has seven digits; integers of 32 bits, scaled or not, are written out.
    if (size !== 0 && (size >= (signal.type === "REAL" ? 1e7 : 1e10) || size < 1e-4)) return value.toExponential(3).replaceAll("-", "−");
    const decimals = size >= 10000 ? 0 : size >= 1000 ? 1 : size >= 1 || size === 0 ? 2 : 4;
    return value.toFixed(decimals).replace("-", "−");
  },
  /** A length of time in milliseconds. */
  span(ms) {
    if (ms === null) return "–";
    if (ms < 1000) return `${Math.round(ms)} ms`;
    if (ms < 120000) return `${(ms / 1000).toFixed(ms < 10000 ? 1 : 0)} s`;
    if (ms < 7200000) return `${Math.floor(ms / 60000)} min`;
    return `${Math.floor(ms / 3600000)} h`;
  },
  /** A length of time in microseconds. */
  fine(us) {
    if (us < 1000) return `${Number(us.toPrecision(3))} µs`;
    return us < 1e6 ? `${Number((us / 1e3).toPrecision(3))} ms` : `${Number((us / 1e6).toPrecision(3))} s`;
  },
  count: (number, one, many) => `${number.toLocaleString("en")} ${number === 1 ? one : many}`,
};
