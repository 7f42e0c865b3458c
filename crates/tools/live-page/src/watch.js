"use strict";

// The list that is shown: its pins and their order, grouping, order and formats; named lists are in files beside each driver.cfg.

const watch = (() => {
  const { make, write } = elements;
  const get = (id) => document.getElementById(id);
  const FRESH = { name: "", pins: [], group: "station", order: "file", formats: {} };
  /** The time between two looks at the files, in milliseconds. */
  const PERIOD = 3000;
  let act = {};
  /** Signals are named as in `plant.keyOf`. */
  let view = { ...structuredClone(FRESH), ...JSON.parse(sessionStorage.getItem("list") ?? "{}") };
  /** The files, by the id of the driver: `{ file, lists, sets, told, mistakes }`. */
  let files = new Map();
  /** The parts of the shown list as they were read, by the id of the driver. */
  let read = new Map(JSON.parse(sessionStorage.getItem("list-read") ?? "[]"));
  /** The list without a name, while another one is shown. */
  let own = JSON.parse(sessionStorage.getItem("list-own") ?? "null") ?? FRESH;
  let folded = new Set();
  /** The number of changes of files, begun and ended: an answer from before one is out of date. */
  let changes = 0;
  let mayChange = false;
  let wanted = views.list;
  // After a reload the list is shown already, perhaps with changes.
  if (wanted === view.name) wanted = null;

  const id = (key) => Number(key.slice(0, key.indexOf("/")));
  const nameOf = (key) => key.slice(key.indexOf("/") + 1);
  const isSame = (a, b) => JSON.stringify(a) === JSON.stringify(b);
  const names = () => [...new Set([...files.values()].flatMap(({ lists }) => lists.map(({ name }) => name)))];
  const entry = (file, name) => file.lists.find((list) => list.name === name) ?? null;

  /** The part of the list that belongs into a driver's file; null if none does. */
  function part(driver, name) {
    const pins = view.pins.filter((key) => id(key) === driver).map(nameOf);
    const own = Object.keys(view.formats).filter((key) => id(key) === driver).sort();
    const isFirst = driver === [...files.keys()][0] && ![...read.keys()].some((it) => it !== driver);
    if (!pins.length && !own.length && !read.get(driver) && !isFirst) return null;
    return { name, pins, group: view.group, order: view.order, formats: Object.fromEntries(own.map((key) => [nameOf(key), view.formats[key]])) };
  }

  const partsOf = (name) => [...files].map(([driver, file]) => [driver, entry(file, name)]).filter(([, list]) => list);

  /** The list that consists of these parts. */
  function joined(name, parts) {
    const { group, order } = parts[0][1];
    const pins = parts.flatMap(([driver, list]) => list.pins.map((pin) => `${driver}/${pin}`));
    const formats = Object.fromEntries(parts.flatMap(([driver, list]) => Object.entries(list.formats).map(([pin, format]) => [`${driver}/${pin}`, format])));
    return { name, pins, group, order, formats };
  }

  /** A list, so that two of them can be compared: the files have no order between pins of different drivers. */
  const comparable = ({ pins, group, order, formats }) => [group, order, [...pins].sort((a, b) => id(a) - id(b)), Object.entries(formats).sort()];

  const isChanged = () => view.name !== "" && files.size > 0 && (!read.size || !isSame(comparable(view), comparable(joined(view.name, [...read]))));

  /** Shows a named list; without a name, the one that has none. */
  function open(name) {
    if (!view.name) own = structuredClone(view);
    if (name) {
      read = new Map(partsOf(name));
      view = joined(name, [...read]);
    } else {
      read = new Map();
      view = structuredClone(own);
    }
    views.list = name;
    folded = new Set();
    changed();
    act.opened(view.pins.length > 0);
  }

  function changed() {
    sessionStorage.setItem("list", JSON.stringify(view));
    sessionStorage.setItem("list-read", JSON.stringify([...read]));
    sessionStorage.setItem("list-own", JSON.stringify(own));
    show();
    act.changed();
  }

  /** Shows the tools, and what is wrong in the files. */
  function show() {
    const known = names();
    const select = get("watch-name");
    const options = ["", ...known, ...(view.name && !known.includes(view.name) ? [view.name] : [])];
    if (!isSame([...select.options].map(({ value }) => value), options)) {
      select.replaceChildren();
      for (const name of options) make("option", "", select, name || "(no name)").value = name;
    }
    select.value = view.name;
    get("watch-group").value = view.group;
    get("watch-order").value = view.order;
    const isOther = isChanged();
    get("watch-file").hidden = !mayChange || files.size === 0;
    get("watch-save").hidden = get("watch-revert").hidden = !isOther;
    get("watch-remove").hidden = view.name === "";
    write(get("watch-state"), isOther ? "changed, not saved" : "");
    const told = [...files.values()].flatMap(({ file, told, mistakes }) => [
      ...mistakes.map((text) => `${text}. Nothing is saved until that is corrected, by hand.`),
      ...told.map((text) => `${file}: ${text}.`.replace("?.", "?")),
    ]);
    const list = get("watch-told");
    list.hidden = !told.length;
    if (list.dataset.told !== told.join("\n")) {
      list.dataset.told = told.join("\n");
      list.replaceChildren();
      for (const text of told) make("li", "", list, text);
    }
  }

  /** A list with its keys in the order of `part`, so that two can be compared as texts. */
  const ordered = ({ name, pins, group, order, formats }) => ({ name, pins, group, order, formats: Object.fromEntries(Object.entries(formats).sort(([a], [b]) => (a < b ? -1 : 1))) });

  /** Reads the files, and takes a list that others have changed if it was not changed here. */
  async function readFiles() {
    const before = changes;
    const drivers = plant.drivers.filter((driver) => driver.lists);
    const answers = await Promise.all(drivers.map(async ({ id }) => {
      const answer = await room.ask(`/lists/${id}`);
      if (!answer.ok) return [];
      const file = await answer.json();
      return [[id, { ...file, lists: file.lists.map(ordered) }]];
    }));
    const now = new Map(answers.flat());
    if (changes !== before || isSame([...now], [...files])) return;
    files = now;
    const wasChanged = isChanged();
    if (wanted !== null) return openWanted();
    const isThere = names().includes(view.name);
    // The part of a driver that has left, or does not answer, is as it was.
    const parts = new Map([...read].filter(([driver]) => !files.has(driver)).concat(partsOf(view.name)).sort(([a], [b]) => a - b));
    if (isThere && !isSame([...parts], [...read].sort(([a], [b]) => a - b))) {
      if (!read.size) {
        // After a reload, what was changed here and is not saved stays.
        read = parts;
      } else if (wasChanged) {
        act.say(`The list "${view.name}" has been changed in the file, and here as well: Revert shows that of the file.`, true);
      } else {
        view = joined(view.name, [...parts]);
        read = parts;
        act.say(`The list "${view.name}" has been changed in the file, and is shown so.`);
      }
    }
    const isRead = (driver) => files.get(driver)?.mistakes.length === 0;
    if (!isThere && read.size && [...read.keys()].every(isRead)) {
      // Another page has removed the list.
      read = new Map();
      act.say(`The list "${view.name}" is no longer in the file; Save puts it there again.`, true);
    }
    changed();
  }
  /** What gets no answer is read the next time. */
  const look = () => readFiles().catch(() => {});
  room.every(PERIOD, async () => { if (!document.hidden) await look(); });

  function openWanted() {
    const name = wanted;
    wanted = null;
    if (mayChange && isChanged()) {
      changed();
      return sayUnsaved();
    }
    if (names().includes(name)) return open(name);
    changed();
    act.say(`There is no list "${name}" here${names().length ? `; lists are ${names().map((it) => `"${it}"`).join(", ")}` : ""}.`, true);
  }

  /** Changes one list or set in a driver's file; true if it is done. */
  async function replace(driver, what, was, is) {
    changes += 1;
    const answer = await room.change("PUT", `/lists/${driver}/${what}`, JSON.stringify({ was, is }));
    changes += 1;
    if (answer?.ok !== true) act.say(answer?.text ?? "Nobody answers; nothing is saved.", true);
    return answer?.ok === true;
  }

  /** Saves the list under a name, which no other list has. */
  async function save(name) {
    const isNew = name !== view.name;
    if (isNew && names().includes(name)) {
      act.say(`There is a list "${name}" already, which is not overwritten; take another name.`, true);
      return false;
    }
    const written = isNew ? new Map() : read;
    for (const driver of files.keys()) {
      const was = isNew ? null : read.get(driver) ?? null;
      const is = part(driver, name);
      if (isSame(was, is)) continue;
      if (!await replace(driver, "list", was, is)) return false;
      written.set(driver, is);
    }
    read = written;
    view.name = name;
    views.list = name;
    await look();
    changed();
    act.say(`The list "${name}" is saved in ${[...files.values()].map(({ file }) => file).join(", ")}.`);
    return true;
  }

  async function remove() {
    const { name } = view;
    for (const [driver, was] of read) if (!await replace(driver, "list", was, null)) return;
    open("");
    await look();
    act.say(`The list "${name}" is removed from the file.`);
  }

  // Pins.

  const placeOf = (signal) => view.pins.indexOf(plant.keyOf(signal));

  function pin(signal) {
    const key = plant.keyOf(signal);
    const isPinned = view.pins.includes(key);
    view.pins = isPinned ? view.pins.filter((it) => it !== key) : [...view.pins, key];
    changed();
    act.say(`${signal.name} is ${isPinned ? "no longer pinned" : "pinned to the top"}.`);
  }

  /** Puts a signal among the pins to this place. */
  function place(signal, at) {
    const key = plant.keyOf(signal);
    const rest = view.pins.filter((it) => it !== key);
    const to = Math.max(0, Math.min(at, rest.length));
    view.pins = [...rest.slice(0, to), key, ...rest.slice(to)];
    changed();
    act.say(`${signal.name} is number ${to + 1} of ${view.pins.length}.`);
  }

  const sayUnsaved = () => act.say(`The changes of the list "${view.name}" are not saved: press Save or Revert first.`, true);
  get("watch-name").addEventListener("change", () => {
    if (!mayChange || !isChanged()) return open(get("watch-name").value);
    show();
    sayUnsaved();
  });
  get("watch-group").addEventListener("change", () => { view.group = get("watch-group").value; changed(); });
  get("watch-order").addEventListener("change", () => { view.order = get("watch-order").value; changed(); });
  get("watch-save").addEventListener("click", () => save(view.name));
  get("watch-revert").addEventListener("click", () => open(names().includes(view.name) ? view.name : ""));
  get("watch-remove").addEventListener("click", remove);
  get("watch-file").addEventListener("submit", async (event) => {
    event.preventDefault();
    const name = get("watch-new").value.trim();
    if (!name) act.say("The list has no name; write one, such as Level control.", true);
    else if (await save(name)) get("watch-new").value = "";
  });
  window.addEventListener("hashchange", () => {
    wanted = views.list;
    if (wanted === view.name) wanted = null;
    if (wanted !== null) openWanted();
  });

  return {
    look, pin, place, placeOf, replace,
    move: (signal, by) => { if (placeOf(signal) >= 0) place(signal, placeOf(signal) + by); },
    /** The pins in their order: signals, and the keys of those that are not there. */
    pinned() {
      if (!view.pins.length) return [];
      const known = new Map(plant.signals.map((signal) => [plant.keyOf(signal), signal]));
      return view.pins.map((key) => known.get(key) ?? key);
    },
    unpin(key) { view.pins = view.pins.filter((it) => it !== key); changed(); },
    nameOf,
    formatOf: (signal) => view.formats[plant.keyOf(signal)] ?? "",
    setFormat(signal, format) {
      if (format) view.formats[plant.keyOf(signal)] = format;
      else delete view.formats[plant.keyOf(signal)];
      changed();
    },
    isFolded: (key) => folded.has(key),
    fold(key) { if (!folded.delete(key)) folded.add(key); act.changed(); },
    access(isRight) { mayChange = isRight; show(); },
    /** Sets what the page does: `say(text, isBad)`, `changed()`, `opened(hasPins)`. */
    begin(actions) {
      act = actions;
      show();
      if (view.name) act.opened(view.pins.length > 0);
    },
    get files() { return files; },
    get group() { return view.group; },
    get order() { return view.order; },
    get name() { return view.name; },
  };
})();
