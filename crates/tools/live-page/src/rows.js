"use strict";

// Which rows the list has: the pins, then the other signals in their groups or by their last change.

const rows = (() => {
  /** A prefix is one if at least this many signals have it. */
  const LEAST = 3;
  const prefixes = new WeakMap();

  /** The beginnings of a name that end between two words: of "Oven zone 3 heater" those of one, two and three words. */
  const beginnings = (name) => [...name.matchAll(/(?<=[^\s._:/-])(?=[\s._:/-])/g)].map(({ index }) => name.slice(0, index));

  /** The longest beginning that the name has in common with at least two others; empty without one. */
  function prefixOf(driver, signal) {
    let known = prefixes.get(driver);
    if (!known) {
      const counts = new Map();
      for (const { name } of driver.signals) for (const it of beginnings(name)) counts.set(it, (counts.get(it) ?? 0) + 1);
      known = driver.signals.map(({ name }) => beginnings(name).findLast((it) => counts.get(it) >= LEAST) ?? "");
      prefixes.set(driver, known);
    }
    return known[signal.index];
  }

  /** The rows of the signals that fit, and their number. */
  function of(fits) {
    const rows = [];
    let found = 0;
    const add = (signal) => {
      rows.push({ kind: "signal", key: `s${plant.keyOf(signal)}`, signal });
      if (signal.isOpen) rows.push({ kind: "trend", key: `t${plant.keyOf(signal)}`, signal });
    };
    /** Adds a head and its signals, unless they are folded. */
    const group = (head, signals) => {
      if (!signals.length) return;
      rows.push({ kind: "station", ...head, count: signals.length });
      if (!watch.isFolded(head.key)) signals.forEach(add);
    };
    const pins = watch.pinned();
    const there = new Set(pins);
    const chosen = pins.filter((pin) => typeof pin === "string" || fits(pin));
    if (chosen.length) {
      const key = "g pinned";
      found += chosen.filter((pin) => typeof pin !== "string").length;
      rows.push({ kind: "station", key, title: watch.name || "Pinned", count: chosen.length });
      for (const pin of watch.isFolded(key) ? [] : chosen) {
        if (typeof pin === "string") rows.push({ kind: "missing", key: `m${pin}`, pin });
        else add(pin);
      }
    }
    const others = plant.signals.filter((signal) => !there.has(signal) && fits(signal));
    found += others.length;
    const isOne = plant.drivers.length === 1 && plant.drivers[0].stations.length <= 1;
    const alone = { key: "g others", title: "Other signals" };
    if (watch.order === "changed") {
      // By the second, so that those that change all the time stay in their order.
      const second = ({ changed }) => Math.floor(changed / 1000);
      others.sort((a, b) => second(b) - second(a) || 0);
    }
    if (watch.order === "changed" || watch.group === "none" || (isOne && watch.group === "station")) {
      if (chosen.length) group(alone, others);
      else others.forEach(add);
      return { rows, found };
    }
    const groups = new Map();
    for (const signal of others) {
      const { driver } = signal;
      const isFolder = watch.group === "folder";
      const part = isFolder ? signal.folder : watch.group === "prefix" ? prefixOf(driver, signal) : null;
      const name = part ?? signal.station;
      const key = `g${driver.id}/${name}`;
      const head = part === null ? { driver, station: signal.station } : { title: `${plant.drivers.length > 1 ? `${driver.name} · ` : ""}${part || (isFolder ? "No folder" : "Others")}` };
      if (!groups.has(key)) groups.set(key, [{ key, ...head, isRest: part === "" }, []]);
      groups.get(key)[1].push(signal);
    }
    // Signals without a prefix or a folder come last.
    for (const isRest of [false, true]) for (const [head, signals] of groups.values()) if (head.isRest === isRest) group(head, signals);
    return { rows, found };
  }

  return { of, prefixOf };
})();
