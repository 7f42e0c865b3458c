"use strict";

// The list of signals. Only the visible rows exist; scrolling gives each another signal.

const list = (() => {
  const TREND = 132;
  const frame = document.getElementById("list");
  const view = document.getElementById("window");
  const narrow = matchMedia("(max-width: 640px)");
  /** The rows, `{ kind: "station" | "signal" | "missing" | "trend", … }`, and the top of each, in pixels. */
  let all = [];
  let tops = [0];
  let chosen = null;
  let chosenRow = -1;
  let kind = "all";
  let wanted = [];
  let isDue = false;
  /** The row elements by their contents, and the empty ones. */
  let shown = new Map();
  const spare = { station: [], signal: [], missing: [], trend: [] };
  /** For measurements: the number of redraws, and the longest one, in milliseconds. */
  const drawn = { count: 0, longest: 0 };
  let act = {};

  const heightOf = { station: () => 38, signal: () => (narrow.matches ? 58 : 34), missing: () => 34, trend: () => TREND };

  function fits(signal) {
    if (kind === "I" || kind === "Q") {
      if (signal.direction !== kind) return false;
    } else if (kind === "pinned") {
      if (watch.placeOf(signal) < 0) return false;
    } else if (kind === "forced" ? !signal.isForced : kind === "failsafe" && !signal.isFailSafe) {
      return false;
    }
    return wanted.every((word) => signal.words.includes(word));
  }

  /** Rebuilds the rows. */
  function choose() {
    const { rows: fitting, found } = rows.of(fits);
    all = fitting;
    layOut();
    chosenRow = all.findIndex((row) => row.kind === "signal" && row.signal === chosen);
    const count = plant.signals.length;
    document.getElementById("found").textContent = found === count ? words.count(count, "signal", "signals") : `${words.whole(found)} of ${words.count(count, "signal", "signals")}`;
    const empty = document.getElementById("empty");
    empty.hidden = all.length > 0 || count === 0;
    const nothing = { forced: "No signal is forced.", failsafe: "No signal has its fail-safe value.", pinned: "No signal is pinned: choose one and press W." };
    empty.textContent = (!wanted.length && nothing[kind]) || "No signal fits the filter.";
    frame.setAttribute("aria-rowcount", all.length + 1);
    redraw();
  }

  function layOut() {
    tops = new Array(all.length + 1);
    tops[0] = 0;
    all.forEach((row, i) => { tops[i + 1] = tops[i] + heightOf[row.kind](); });
    view.style.height = tops[all.length] + "px";
  }

  function redraw() {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => { if (isDue) draw(); });
  }

  /** The visible range of the rows, whichever element scrolls. */
  function seen() {
    const box = view.getBoundingClientRect();
    const own = frame.getBoundingClientRect();
    const top = Math.max(0, own.top) - box.top;
    return [top, Math.min(window.innerHeight, own.bottom) - box.top];
  }

  /** Draws at once. It reads the layout first: within a frame before anything is written. */
  function draw() {
    isDue = false;
    const begun = performance.now();
    const [top, bottom] = seen();
    const first = Math.max(0, indexAt(tops, top - 80));
    const now = new Map();
    for (let i = first; i < all.length && tops[i] < bottom + 80; i++) now.set(all[i].key, i);
    for (const [key, element] of shown) {
      if (now.has(key)) continue;
      shown.delete(key);
      element.hidden = true;
      view.append(element);
      spare[element.dataset.kind].push(element);
    }
    let before = null;
    for (const [key, i] of now) {
      const row = all[i];
      let element = shown.get(key);
      if (!element) {
        element = spare[row.kind].pop() ?? make[row.kind]();
        element.hidden = false;
        shown.set(key, element);
      }
      // A screen reader reads the elements in their order, wherever they are on the screen.
      if ((before ? before.nextElementSibling : view.firstElementChild) !== element) {
        if (before) before.after(element);
        else view.prepend(element);
      }
      before = element;
      set(element, "top", `${tops[i]}px`, (it, value) => { it.style.transform = `translateY(${value})`; });
      set(element, "index", i + 2, (it, value) => it.setAttribute("aria-rowindex", value));
      paint[row.kind](element, row);
    }
    frame.setAttribute("aria-activedescendant", shown.get(`s${chosen ? plant.keyOf(chosen) : ""}`)?.id ?? "");
    drawn.count += 1;
    drawn.longest = Math.max(drawn.longest, performance.now() - begun);
  }

  /** Changes an element only if the value differs: most of it stays the same from one redraw to the next. */
  function set(element, name, value, change) {
    const known = element.known ??= {};
    if (known[name] === value) return;
    known[name] = value;
    change(element, value);
  }

  const text = (element, name, value) => set(element, name, value, (it) => { it.parts[name].textContent = value; });
  /** Only a row that has had a comment has an element for it. To a screen reader the row's title describes the row. */
  const note = (element, value) => set(element, "comment", value, ({ parts }) => {
    if (!value && !parts.comment) return;
    parts.comment ??= part("comment", "", parts.name.parentElement);
    parts.comment.ariaHidden = "true";
    parts.comment.textContent = value;
  });
  const flag = (element, name, value) => set(element, name, value, (it) => it.classList.toggle(name, value));

  function part(name, role, parent, tag = "span") {
    const it = document.createElement(tag);
    it.className = name;
    if (role) it.setAttribute("role", role);
    parent.append(it);
    return it;
  }

  function button(name, parent) {
    const it = part(name, "", parent, "button");
    it.type = "button";
    return it;
  }

  let ids = 0;
  const make = {
    station() {
      const element = document.createElement("div");
      element.className = "row station";
      element.setAttribute("role", "row");
      element.dataset.kind = "station";
      const cell = part("name", "rowheader", element);
      const fold = button("fold", cell);
      element.parts = { fold, name: part("", "", cell, "b"), facts: part("note", "", cell) };
      return element;
    },
    missing() {
      const element = document.createElement("div");
      element.className = "row signal missing";
      element.setAttribute("role", "row");
      element.dataset.kind = "missing";
      const name = part("name", "rowheader", element);
      element.parts = { name: part("text", "", name), mark: part("tag", "", name) };
      element.parts.mark.textContent = "not in this driver";
      element.parts.unpin = button("pin", part("do", "gridcell", element));
      element.parts.unpin.textContent = "×";
      return element;
    },
    signal() {
      const element = document.createElement("div");
      element.className = "row signal";
      element.draggable = true;
      element.id = `row${ids++}`;
      element.setAttribute("role", "row");
      element.dataset.kind = "signal";
      const name = part("name", "rowheader", element);
      const pin = button("pin", name);
      pin.tabIndex = -1;
      const parts = { pin, name: part("text", "", name), mark: part("tag", "", name), spark: part("spark", "", name, "canvas") };
      parts.spark.setAttribute("aria-hidden", "true");
      for (const cell of ["address", "value", "raw", "edges", "age"]) parts[cell] = part(cell, "gridcell", element);
      parts.lamp = part("lamp", "", parts.value);
      parts.number = part("number", "", parts.value);
      parts.unit = part("unit", "", parts.value);
      const cell = part("do", "gridcell", element);
      parts.open = button("open", cell);
      parts.open.tabIndex = -1;
      element.parts = parts;
      return element;
    },
    trend() {
      const element = document.createElement("div");
      element.className = "row trend";
      element.setAttribute("role", "row");
      element.dataset.kind = "trend";
      const cell = part("picture", "gridcell", element);
      const canvas = part("", "", cell, "canvas");
      const length = button("length", cell);
      length.tabIndex = -1;
      length.title = "Another length of time";
      element.parts = { canvas, length };
      return element;
    },
  };

  /** The changes of a signal without a latch that the other side never saw. */
  function swallowed({ driver, name }) {
    const count = driver.line?.counters?.[`swallowed.${name.replace(/[=\\]/g, "\\$&")}`];
    return count ? `${words.whole(Number(count))} swallowed` : "";
  }

  const paint = {
    station(element, { key, title, driver, station, count }) {
      element.group = key;
      const line = driver && plant.lineOf(driver)?.stations?.[station];
      const name = title ?? driver.stations[station];
      const full = title ?? (plant.drivers.length > 1 ? (driver.stations.length > 1 ? `${driver.name} · ${name}` : driver.name) : name);
      text(element, "name", full);
      const age = typeof line?.age_ms === "number" ? `, ${words.span(line.age_ms)} old` : "";
      const state = line?.state ? ` · ${line.stale && line.age_ms !== null ? "stale" : line.state}${age}` : "";
      text(element, "facts", words.count(count, "signal", "signals") + state);
      flag(element, "is-stale", Boolean(line?.stale));
      const isFolded = watch.isFolded(key);
      text(element, "fold", isFolded ? "▸" : "▾");
      set(element, "expanded", !isFolded, (it, yes) => it.parts.fold.setAttribute("aria-expanded", yes));
      set(element, "label", full, (it, label) => { it.parts.fold.setAttribute("aria-label", label); it.parts.name.title = label; });
    },
    missing(element, { pin }) {
      element.pin = pin;
      text(element, "name", watch.nameOf(pin));
      set(element, "label", `Unpin ${watch.nameOf(pin)}`, (it, label) => { it.parts.unpin.setAttribute("aria-label", label); it.parts.unpin.title = label; });
    },
    signal(element, { signal }) {
      element.signal = signal;
      set(element, "spark", signal.isOpen ? null : signal, (it, of) => sparks.put(it.parts.spark, of));
      const value = format.value(signal);
      const isOn = signal.isBool && plant.number(signal) > 0.5;
      text(element, "name", signal.name);
      note(element, signal.comment);
      text(element, "address", signal.address);
      text(element, "number", value);
      text(element, "unit", signal.unit);
      text(element, "raw", format.raw(signal));
      flag(element, "long", value.length > 12 && value.length < 25);
      flag(element, "longer", value.length > 24);
      flag(element, "long-raw", value.length < 13 && watch.formatOf(signal) === "binary");
      const isPinned = watch.placeOf(signal) >= 0;
      text(element, "pin", isPinned ? "★" : "☆");
      flag(element, "pinned", isPinned);
      set(element, "pin-label", `${isPinned ? "Unpin" : "Pin"} ${signal.name}`, (it, label) => { it.parts.pin.setAttribute("aria-label", label); it.parts.pin.title = label; });
      text(element, "edges", !signal.latch ? swallowed(signal) : signal.edges === null ? "–" : words.whole(signal.edges));
      text(element, "age", words.span(plant.age(signal)));
      text(element, "mark", signal.isForced ? "forced" : signal.isFailSafe ? "fail-safe" : signal.isStale ? "stale" : "");
      text(element, "open", signal.isOpen ? "▾" : "▸");
      flag(element, "bool", signal.isBool);
      flag(element, "on", isOn);
      flag(element, "input", signal.direction === "I");
      flag(element, "forced", signal.isForced);
      flag(element, "failsafe", (signal.isFailSafe || signal.isStale) && !signal.isForced);
      flag(element, "new", plant.isNew(signal));
      set(element, "chosen", signal === chosen, (it, yes) => it.setAttribute("aria-selected", yes));
      set(element, "label", `Trend of ${signal.name}`, (it, label) => { it.parts.open.setAttribute("aria-label", label); it.parts.open.title = label; });
      set(element, "title", `${signal.name}, ${signal.type}${signal.address && ` at ${signal.address}`}${signal.latch ? `, latch ${signal.latch}` : ""}${signal.reply ? `, reply: ${signal.reply}` : ""}${signal.comment && `: ${signal.comment}`}`, (it, title) => { it.title = title; });
      set(element, "expanded", signal.isOpen, (it, yes) => it.parts.open.setAttribute("aria-expanded", yes));
    },
    trend(element, { signal }) {
      element.signal = signal;
      if (!signal.trend) trend.open(signal);
      text(element, "length", words.span(trend.length).replace("120 s", "2 min"));
      set(element, "label", `Trend of ${signal.name}`, (it, label) => { it.parts.canvas.setAttribute("role", "img"); it.parts.canvas.setAttribute("aria-label", label); });
      trend.draw(element.parts.canvas, signal, element.clientWidth, TREND - 8);
    },
  };

  /** True if something visible moves without events: trends, and values that are shown as new. */
  const isMoving = () => {
    for (const element of shown.values()) {
      if (element.dataset.kind === "trend" || element.known?.new) return true;
    }
    return false;
  };

  function scrollTo(row) {
    const [top, bottom] = seen();
    const head = narrow.matches ? 0 : document.getElementById("head").offsetHeight;
    const scroller = frame.scrollHeight > frame.clientHeight + 1 && getComputedStyle(frame).overflowY !== "visible" ? frame : document.scrollingElement;
    const space = scroller === frame ? 0 : document.getElementById("foot").offsetHeight;
    if (tops[row] < top + head) scroller.scrollTop -= top + head - tops[row];
    else if (tops[row + 1] > bottom - space) scroller.scrollTop += tops[row + 1] - bottom + space;
  }

  function select(signal) {
    chosen = signal;
    chosenRow = all.findIndex((row) => row.kind === "signal" && row.signal === signal);
    act.chosen(signal);
    redraw();
  }

  /** Selects a signal and scrolls to it; false if it is not listed. Without `far` the page itself stays where it is. */
  function find(signal, far = true) {
    select(signal);
    if (chosenRow < 0) return false;
    if (far || frame.scrollHeight > frame.clientHeight + 1) {
      // With its trend, if that is open.
      if (signal.isOpen) scrollTo(chosenRow + 1);
      scrollTo(chosenRow);
    }
    return true;
  }

  /** Moves the choice by this many signals. */
  function move(by) {
    const step = Math.sign(by);
    let at = chosenRow;
    let last = chosenRow;
    for (let left = Math.abs(by); left > 0;) {
      at += step;
      if (at < 0 || at >= all.length) break;
      if (all[at].kind !== "signal") continue;
      last = at;
      left -= 1;
    }
    if (last < 0) return;
    select(all[last].signal);
    scrollTo(last);
  }

  function toggle(signal) {
    if (signal.isOpen) trend.close(signal);
    else trend.open(signal);
    choose();
    // The trend would open below the edge of the list, unseen.
    if (signal.isOpen && signal === chosen) find(signal, false);
  }

  /** Moves a pinned signal up or down among the pins, and keeps it in sight. */
  function moveOne(signal, by) {
    watch.move(signal, by);
    if (chosenRow >= 0) scrollTo(chosenRow);
  }

  const page = () => Math.max(1, Math.floor((seen()[1] - seen()[0]) / heightOf.signal()) - 1);
  const keys = {
    ArrowDown: () => move(1),
    ArrowUp: () => move(-1),
    PageDown: () => move(page()),
    PageUp: () => move(-page()),
    Home: () => { chosenRow = -1; move(1); },
    End: () => { chosenRow = all.length; move(-1); },
    Enter: () => { if (chosen) toggle(chosen); },
    " ": () => { if (chosen) toggle(chosen); },
    f: () => act.force(chosen),
    a: () => act.analyse(chosen),
    w: () => { if (chosen) watch.pin(chosen); },
    x: () => { if (chosen) format.next(chosen); },
    Delete: () => act.release(chosen),
    Backspace: () => act.release(chosen),
    Escape: () => select(null),
  };

  frame.addEventListener("keydown", (event) => {
    const by = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (event.altKey && by && chosen) {
      event.preventDefault();
      moveOne(chosen, by);
      return;
    }
    if (event.target.closest("button") && (event.key === "Enter" || event.key === " ")) return;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const action = keys[event.key] ?? keys[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  });

  view.addEventListener("click", (event) => {
    const element = event.target.closest(".row");
    if (event.target.closest(".fold") || element?.dataset.kind === "station") {
      watch.fold(element.group);
    } else if (element?.dataset.kind === "missing") {
      if (event.target.closest(".pin")) watch.unpin(element.pin);
    } else if (!element?.signal) {
      return;
    } else if (event.target.closest(".pin")) {
      watch.pin(element.signal);
    } else if (event.target.closest(".length")) {
      trend.next();
      redraw();
    } else if (event.target.closest(".open")) {
      toggle(element.signal);
    } else {
      select(element.signal);
    }
  });

  // A signal is dragged onto a pinned one, and takes its place.

  let dragged = null;
  let touched = -Infinity;
  const rowUnder = (event) => dragged && event.target.closest(".row.pinned");
  const mark = (row) => { for (const element of shown.values()) element.classList.toggle("drop", element === row); };
  view.addEventListener("dragstart", (event) => { dragged = event.target.closest?.(".row.signal")?.signal ?? null; });
  view.addEventListener("dragover", (event) => {
    const row = rowUnder(event);
    mark(row);
    if (row) event.preventDefault();
  });
  view.addEventListener("drop", (event) => {
    const row = rowUnder(event);
    if (!row) return;
    event.preventDefault();
    watch.place(dragged, watch.placeOf(row.signal));
  });
  document.addEventListener("dragend", () => {
    dragged = null;
    mark(null);
  });
  // By the last change: not while somebody is about to click.
  view.addEventListener("pointermove", () => { touched = performance.now(); }, { passive: true });
  setInterval(() => {
    if (watch.order === "changed" && !plant.isPast && !document.hidden && performance.now() - touched > 2000) choose();
  }, 1000);

  document.addEventListener("scroll", redraw, { passive: true, capture: true });
  window.addEventListener("resize", redraw);
  narrow.addEventListener("change", () => {
    layOut();
    redraw();
  });

  return {
    choose, redraw, draw, select, find, toggle, isMoving, drawn, moveOne,
    filter(text) {
      wanted = text.toLowerCase().split(/\s+/).filter(Boolean);
      choose();
    },
    show(which) {
      kind = which;
      choose();
    },
    /** Sets the listeners: `chosen(signal)`, `force(signal)`, `release(signal)`, `analyse(signal)`. */
    begin(actions) { act = actions; },
    /** After the signals were replaced: finds the chosen one by its name. */
    renew() {
      const key = chosen && plant.keyOf(chosen);
      chosen = (key && plant.signals.find((signal) => plant.keyOf(signal) === key)) ?? null;
      act.chosen(chosen);
      choose();
    },
    get kind() { return kind; },
    get chosen() { return chosen; },
  };
})();
