"use strict";

// The drivers and their signals, as received in the events.

/** For drawing: the unit is milliseconds, and now is 0 s. */
const run = { begin: 0, end: 0, unit: 1e6 };

const plant = (() => {
  /** How long a changed value is shown as new, in milliseconds. */
  const NEW = 350;
  /** The longest time for which a driver's clock is assumed to go on between two events, in milliseconds. */
  const ASSUMED = 1000;
  const FAIL_SAFE = 1;
  const FORCED = 2;
  const STALE = 4;
  /** True while the signals show a moment of the past. */
  let isPast = false;
  /** The server's run, and the number of its layout: while both are the same, so are the drivers and signals. */
  let serverRun = null;
  let layout = null;
  let drivers = [];
  let signals = [];
  /** The server's clock at its last message, in milliseconds, and this page's clock then. */
  let time = 0;
  let heard = 0;

  function signalOf(driver, given, index) {
    const words = [given.name, given.address, given.unit ?? "", given.comment ?? "", given.type, driver.isRun ? driver.stations[given.station] : ""];
    const signal = {
      driver, index,
      name: given.name,
      address: given.address,
      type: given.type,
      unit: given.unit ?? "",
      comment: given.comment ?? "",
      folder: given.folder ?? "",
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
    show(signal, ...takeGiven(signal, given));
    return signal;
  }

  /** The bytes of the types whose raw value can follow from the value. */
  const SIZES = { BYTE: 1, SINT: 1, USINT: 1, WORD: 2, INT: 2, UINT: 2, DWORD: 4, DINT: 4, UDINT: 4, REAL: 4, LREAL: 8 };
  const bits = new DataView(new ArrayBuffer(8));

  /** The raw value of a signal without a scale, as the server writes it: `16#6C00`. */
  function rawOf(type, value) {
    const size = SIZES[type];
    if (!size || typeof value !== "number") return "";
    if (type === "REAL") bits.setFloat32(0, value);
    else if (type === "LREAL") bits.setFloat64(0, value);
    else bits.setBigUint64(0, BigInt.asUintN(64, BigInt(value)) << BigInt(64 - 8 * size));
    let text = "16#";
    for (let i = 0; i < size; i++) text += bits.getUint8(i).toString(16).toUpperCase().padStart(2, "0");
    return text;
  }

  /** Stores the value of now, which is shown unless the page shows the past. */
  function live(signal, value, raw, edges, flags) {
    signal.live = [value, raw, edges, flags];
    return signal.live;
  }

  function show(signal, value, raw, edges, flags) {
    signal.value = value;
    signal.raw = raw;
    signal.edges = edges;
    signal.isFailSafe = (flags & FAIL_SAFE) !== 0;
    signal.isForced = (flags & FORCED) !== 0;
    signal.isStale = (flags & STALE) !== 0;
  }

  /** Stores the value of now from the list of all signals. */
  const takeGiven = (signal, given) => live(signal, given.value, given.raw, given.edges, (given.failsafe ? FAIL_SAFE : 0) | (given.forced === null ? 0 : FORCED) | (given.stale ? STALE : 0));

  /** Takes the values of all signals after another connection with the same run, so that what the page shows stays. */
  function takeValues(given) {
    given.drivers.forEach((driver, i) => driver.signals.forEach((it, index) => {
      const signal = drivers[i].signals[index];
      const now = takeGiven(signal, it);
      if (!isPast) show(signal, ...now);
    }));
  }

  /** Replaces the signals: trends that were open stay open. */
  function takeAll(given) {
    const known = new Map(signals.map((signal) => [keyOf(signal), signal]));
    isPast = false;
    drivers = given.drivers.map((driver) => ({ ...driver, isRun: driver.kind === "sync", isRecording: driver.kind === "recording", line: null, past: null, moment: null }));
    signals = [];
    for (const driver of drivers) {
      driver.signals = driver.signals.map((it, index) => signalOf(driver, it, index));
      driver.byName = new Map(driver.signals.map((signal) => [signal.name, signal]));
      for (const signal of driver.signals) {
        const old = known.get(keyOf(signal));
        signal.isOpen = old?.isOpen ?? false;
        signals.push(signal);
      }
    }
  }

  const keyOf = (signal) => `${signal.driver.id}/${signal.name}`;

  /** Notes how far the histories reach, and how fast their time passes. */
  function takePast(reaches) {
    for (const driver of drivers) {
      const reach = reaches?.[driver.id];
      if (!reach) continue;
      const [first, last, tick, isCut] = reach;
      const past = driver.past ??= { from: heard, begin: last, speed: 1 };
      const passed = heard - past.from;
      // Over an interval, since single events come irregularly.
      if (passed > ASSUMED) {
        past.speed = Math.max(0, (last - past.begin) / passed);
        [past.from, past.begin] = [heard, last];
      }
      Object.assign(past, { first, last, tick, isCut, heard });
    }
  }

  function takeLine(line) {
    for (const given of line.drivers) {
      const driver = drivers.find(({ id }) => id === given.id);
      if (driver) driver.line = { ...given, heard: performance.now() };
    }
  }

  /** Applies an event. Returns whether the signals were replaced, and whether the line has changed; null for one of another kind of page. */
  function hear(text) {
    const event = JSON.parse(text);
    if (event.layout === undefined) return null;
    time = event.time_ms;
    heard = performance.now();
    const isFull = event.full === true;
    const isOther = isFull && (event.run !== serverRun || event.layout !== layout);
    if (isOther) {
      serverRun = event.run;
      layout = event.layout;
      takeAll(event.signals);
    } else if (isFull) {
      takeValues(event.signals);
    } else if (event.layout !== layout) {
      return { isOther: false, isLine: false };
    }
    takePast(event.past);
    if (event.line) takeLine(event.line);
    for (const [id, changes] of Object.entries(event.values ?? {})) {
      const driver = drivers.find((driver) => String(driver.id) === id);
      for (const [index, value, raw = null, edges = null, flags = 0] of changes) {
        const signal = driver?.signals[index];
        if (!signal) continue;
        const now = live(signal, value, raw ?? rawOf(signal.type, value), edges, flags);
        if (isPast) continue;
        if (!Object.is(signal.value, value)) signal.changed = heard;
        show(signal, ...now);
      }
    }
    return { isOther, isLine: Boolean(event.line) };
  }

  /** Shows a moment of a driver's past: its answer, with all signals or those that differ from the moment shown now. */
  function showPast(driver, moment, isStep) {
    if (!isPast) for (const signal of signals) if (!signal.driver.past) show(signal, null, "", null, 0);
    isPast = true;
    for (const [index, value, raw = null, edges = null, flags = 0] of moment.values) {
      const signal = driver.signals[index];
      if (isStep && !Object.is(signal.value, value)) signal.changed = performance.now();
      show(signal, value, raw ?? rawOf(signal.type, value), edges, flags);
    }
    driver.moment = { ...moment, values: null };
  }

  /** Shows the present again. */
  function showPresent() {
    isPast = false;
    for (const driver of drivers) driver.moment = null;
    for (const signal of signals) show(signal, ...signal.live);
  }

  /** The line of a driver, at the moment that is shown. */
  function lineOf(driver) {
    const { line, moment } = driver;
    if (!line || !moment) return line;
    const isStale = (status) => status < 0 || status > 1;
    const statuses = moment.stations.length ? moment.stations : [moment.status];
    const known = moment.line ?? { state: isStale(moment.status) ? "stale" : "running", cause: "unknown", reason: "", events: [] };
    // Before it took its present settings, the line may have had another address.
    const isOther = line.events?.some(({ kind, ago_ms }) => kind === "settings" && ago_ms < now(driver) - moment.ms);
    return {
      ...line, ...known, next_ms: undefined, address: isOther ? undefined : line.address,
      isPast: true,
      status: ["fresh", "unchanged"][moment.status] ?? "stale",
      stations: line.stations.map((station, i) => {
        const stale = isStale(statuses[Math.min(i, statuses.length - 1)]);
        return { ...station, stale, state: stale ? "stale" : "running", age_ms: null, reason: "" };
      }),
      faults: moment.faults.map((what) => ({ phase: "active", name: "forced: ", what })),
      facts: [["Time", words.moment(moment.ms)]],
      times: {}, counters: line.counters, tick: moment.tick, silence_ms: 0,
    };
  }

  /** The time of a driver, in milliseconds: that of its history, or the page's without one. */
  function now(driver) {
    const { past } = driver;
    if (!past) return time + (performance.now() - heard);
    if (driver.isRecording) return past.last;
    return past.last + Math.min(ASSUMED, performance.now() - past.heard) * past.speed;
  }

  /** A value as a number; NaN without a value. */
  const number = (signal) => (signal.value === null ? NaN : Number(signal.value));

  /** The value of now as a measurement: NaN while it is stale. */
  const measured = ({ live: [value, , , flags] }) => (value === null || (flags & STALE) ? NaN : Number(value));

  /** The marks of now, even while the past is shown. */
  const isForcedNow = ({ live: [, , , flags] }) => (flags & FORCED) !== 0;
  const isFailSafeNow = ({ live: [, , , flags] }) => (flags & FAIL_SAFE) !== 0;

  /** True if the simulation of a line stands still. */
  const isSilent = (line) => line.silence_ms > 1000;

  /** The age of the data of a signal's station, in milliseconds; null if unknown. */
  function age(signal) {
    const line = lineOf(signal.driver);
    const age = line?.stations?.[signal.station]?.age_ms;
    return age === undefined || age === null ? null : age;
  }

  return {
    hear, now, number, measured, age, keyOf, lineOf, showPast, showPresent, isForcedNow, isFailSafeNow, isSilent,
    isNew: (signal) => performance.now() - signal.changed < NEW,
    get drivers() { return drivers; },
    get isPast() { return isPast; },
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
  /** A time of a run in milliseconds. */
  moment(ms) {
    // A short recording is one of hardware, with nanoseconds.
    const isShort = plant.drivers.some(({ isRecording, past }) => isRecording && past && past.last - past.first < 1000);
    return `${(ms / 1000).toFixed(isShort ? 9 : 3).replace("-", "−")} s`;
  },
  /** A length of time in microseconds. */
  fine(us) {
    if (us < 1000) return `${Number(us.toPrecision(3))} µs`;
    return us < 1e6 ? `${Number((us / 1e3).toPrecision(3))} ms` : `${Number((us / 1e6).toPrecision(3))} s`;
  },
  /** A whole number with commas. Its format is made once: toLocaleString makes one each time. */
  whole: (() => {
    const format = new Intl.NumberFormat("en");
    return (number) => format.format(number);
  })(),
  count: (number, one, many) => `${words.whole(number)} ${number === 1 ? one : many}`,
};
