"use strict";

// The table of signals: only the rows that are seen exist as elements.

const cells = (() => {
  const ROW = 32;
  /** Rows beyond the edges of the view. */
  const SPARE = 8;
  const get = (id) => document.getElementById(id);
  const all = [
    { key: "name", title: "Name" },
    { key: "address", title: "Address" },
    { key: "type", title: "Type" },
    { key: "at", title: "In device" },
    { key: "unit", title: "Unit" },
    { key: "scale", title: "Scale" },
    { key: "latch", title: "Latch" },
    { key: "fail_safe", title: "Fail-safe" },
    { key: "order", title: "Order" },
    { key: "station", title: "Station" },
    { key: "comment", title: "Comment" },
    { key: "folder", title: "Folder" },
  ];
  let columns = all;
  let sheet = null;
  /** The indexes of the rows that the filter leaves. */
  let shown = [];
  let words = "";
  /** What the checker says, by row and key. */
  let told = new Map();
  let values = new Map();
  /** The chosen cell: its row in `shown`, its column. */
  let row = 0;
  let column = 0;
  let field = null;
  let tell = {};
  let hints = {};

  const text = (index, key) => {
    const signal = sheet?.signals[index];
    if (!signal) return "";
    if (key !== "at") return signal[key] ?? "";
    // A signal may be named as what every object has, such as "constructor".
    return Object.hasOwn(sheet.at, signal.name ?? "") ? sheet.at[signal.name] : "";
  };
  const toldOf = (index, key) => told.get(`${index}/${key}`);

  function begin(listener) {
    tell = listener;
    const grid = get("grid");
    grid.addEventListener("scroll", draw);
    new ResizeObserver(draw).observe(grid);
    grid.addEventListener("keydown", key);
    grid.addEventListener("mousedown", (event) => {
      const cell = event.target.closest("[data-key]");
      if (!cell || event.target === field) return;
      event.preventDefault();
      leave(true);
      choose(shown.indexOf(Number(cell.parentElement.dataset.index)), columns.findIndex(({ key }) => key === cell.dataset.key));
      grid.focus({ preventScroll: true });
    });
    grid.addEventListener("dblclick", (event) => {
      if (event.target.closest("[data-key]")) edit();
    });
  }

  /** Shows this sheet; the chosen row stays with its signal, and the chosen column with its key. */
  function show(newSheet, checked) {
    const name = sheet?.signals[shown[row]]?.name;
    const chosenKey = columns[column]?.key;
    sheet = newSheet;
    columns = all.filter(({ key }) => (key !== "at" || tell.hasPlaces()) && (key !== "station" || sheet?.stations.length > 1));
    get("head").replaceChildren(...columns.map(({ key, title }) => make("span", `c-${key}`, title, "columnheader")), make("span", "c-value", "Value", "columnheader"));
    // The value stands behind the address, where it is seen on narrow screens as well.
    const widths = columns.map(({ key }) => `var(--c-${key})`);
    get("grid").style.setProperty("--columns", [...widths.slice(0, 2), "var(--c-value)", ...widths.slice(2)].join(" "));
    mark(checked);
    chooseRows();
    const again = shown.findIndex((index) => sheet.signals[index].name === name);
    if (again >= 0) row = again;
    row = Math.max(0, Math.min(row, shown.length - 1));
    column = Math.max(0, columns.findIndex(({ key }) => key === chosenKey));
    draw();
    tellChosen();
  }

  /** Shows the checker's words of the chosen cell. */
  const tellChosen = () => tell.chosen(toldOf(shown[row], columns[column]?.key) ?? "");

  /** Takes the checker's words: those of a place in the device belong to the signal of its name. */
  function mark(checked) {
    told = new Map();
    const byName = new Map(sheet?.signals.map(({ name }, index) => [name, index]));
    for (const mistake of checked) {
      const [list, index, key] = mistake.at;
      let place = null;
      if (list === "signal" && typeof index === "number") place = [index, key ?? "name"];
      else if (list === "fieldbus" && index === "at" && byName.has(key)) place = [byName.get(key), "at"];
      if (place && !told.has(place.join("/"))) told.set(place.join("/"), `${mistake.what}; ${mistake.right}`);
    }
  }

  function chooseRows() {
    const signals = sheet?.signals ?? [];
    const has = (signal) => !words || `${signal.name} ${signal.address} ${signal.unit ?? ""} ${signal.type ?? ""} ${signal.comment ?? ""}`.toLowerCase().includes(words);
    shown = signals.map((_, index) => index).filter((index) => has(signals[index]));
    get("found").textContent = words ? `${shown.length} of ${signals.length}` : `${signals.length}`;
    get("grid").setAttribute("aria-rowcount", String(signals.length + 1));
  }

  function make(kind, name, content = "", role = "") {
    const element = document.createElement(kind);
    element.className = name;
    element.textContent = content;
    if (role) element.setAttribute("role", role);
    return element;
  }

  function draw() {
    const grid = get("grid");
    const rows = get("rows");
    rows.style.height = `${shown.length * ROW}px`;
    const first = Math.max(0, Math.floor(grid.scrollTop / ROW) - SPARE);
    const last = Math.min(shown.length, Math.ceil((grid.scrollTop + grid.clientHeight) / ROW) + SPARE);
    // A field that is edited stays as it is.
    const keep = field?.closest(".row");
    const made = [];
    for (let at = first; at < last; at++) {
      const index = shown[at];
      if (keep && Number(keep.dataset.index) === index) {
        keep.style.top = `${at * ROW}px`;
        made.push(keep);
        continue;
      }
      made.push(rowOf(at, index));
    }
    // Only the others are replaced: a field that leaves the page for a moment loses its focus.
    for (const element of [...rows.children]) if (!made.includes(element)) element.remove();
    let place = rows.firstChild;
    for (const element of made) {
      if (element === place) place = place.nextSibling;
      else rows.insertBefore(element, place);
    }
    const id = `cell-${shown[row]}-${columns[column]?.key}`;
    if (document.getElementById(id)) grid.setAttribute("aria-activedescendant", id);
    else grid.removeAttribute("aria-activedescendant");
    fill();
  }

  function rowOf(at, index) {
    const element = make("div", "row", "", "row");
    element.dataset.index = index;
    element.setAttribute("aria-rowindex", String(index + 2));
    element.style.top = `${at * ROW}px`;
    columns.forEach(({ key }, place) => {
      const cell = make("span", `c-${key}`, text(index, key), "gridcell");
      cell.dataset.key = key;
      cell.id = `cell-${index}-${key}`;
      const wrong = toldOf(index, key);
      if (wrong) {
        cell.classList.add("wrong");
        cell.title = wrong;
        cell.setAttribute("aria-invalid", "true");
      }
      // A node is longer than its column.
      if (!wrong && key === "at") cell.title = text(index, key);
      const isChosen = at === row && place === column;
      cell.setAttribute("aria-selected", String(isChosen));
      if (isChosen) element.classList.add("chosen");
      element.append(cell);
    });
    element.append(make("span", "c-value", "", "gridcell"));
    return element;
  }

  /** The present values of a running line, by name. */
  function fill() {
    for (const element of get("rows").children) {
      const value = values.get(sheet.signals[element.dataset.index]?.name);
      const cell = element.lastChild;
      if (cell.textContent !== (value?.text ?? "")) cell.textContent = value?.text ?? "";
      cell.classList.toggle("is-stale", value?.isStale ?? false);
    }
  }

  function choose(newRow, newColumn) {
    row = Math.max(0, Math.min(newRow, shown.length - 1));
    column = Math.max(0, Math.min(newColumn, columns.length - 1));
    const grid = get("grid");
    const head = get("head").offsetHeight;
    const top = row * ROW;
    if (top < grid.scrollTop) grid.scrollTop = top;
    else if (top + ROW + head > grid.scrollTop + grid.clientHeight) grid.scrollTop = top + ROW + head - grid.clientHeight;
    draw();
    const cell = document.getElementById(`cell-${shown[row]}-${columns[column].key}`);
    if (cell) grid.scrollLeft = Math.max(Math.min(grid.scrollLeft, cell.offsetLeft), cell.offsetLeft + cell.offsetWidth - grid.clientWidth);
    tellChosen();
  }

  /** Opens the chosen cell, with this text in place of its own. */
  function edit(typed) {
    const index = shown[row];
    const key = columns[column]?.key;
    const cell = document.getElementById(`cell-${index}-${key}`);
    if (!cell || !tell.mayEdit()) return;
    leave(true);
    const was = text(index, key);
    field = document.createElement("input");
    field.type = "text";
    field.autocomplete = "off";
    field.spellcheck = false;
    field.value = typed ?? was;
    field.setAttribute("aria-label", `${columns[column].title} of ${text(index, "name")}`);
    if (hints[key]) field.setAttribute("list", `hints-${key}`);
    field.dataset.was = was;
    field.dataset.of = text(index, "name");
    cell.replaceChildren(field);
    field.focus();
    if (typed === undefined) field.select();
    field.addEventListener("blur", () => leave(true));
  }

  /** Closes the open field, and hands its text on if it is another. */
  function leave(isKept) {
    if (!field) return;
    const closing = field;
    field = null;
    const cell = closing.parentElement;
    const index = Number(cell.parentElement.dataset.index);
    const { key } = cell.dataset;
    const { was, of } = closing.dataset;
    cell.textContent = isKept ? closing.value : was;
    if (isKept && closing.value.trim() !== was) tell.set(index, key, was, closing.value.trim(), of);
  }

  function key(event) {
    if (event.target === field) {
      const ends = { Enter: [1, 0], Tab: [0, event.shiftKey ? -1 : 1], Escape: null };
      if (!(event.key in ends)) return;
      event.preventDefault();
      leave(event.key !== "Escape");
      get("grid").focus({ preventScroll: true });
      const by = ends[event.key];
      if (by) choose(row + by[0], column + by[1]);
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const page = Math.max(1, Math.floor(get("grid").clientHeight / ROW) - 2);
    const moves = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1], PageUp: [-page, 0], PageDown: [page, 0], Home: [0, -columns.length], End: [0, columns.length] };
    if (moves[event.key]) choose(row + moves[event.key][0], column + moves[event.key][1]);
    else if (event.key === "Enter" || event.key === "F2") edit();
    else if (event.key === "Delete" || event.key === "Backspace") {
      const index = shown[row];
      const { key } = columns[column];
      if (text(index, key)) tell.set(index, key, text(index, key), "", text(index, "name"));
    } else if (event.key.length === 1 && event.key !== " ") edit(event.key);
    else return;
    event.preventDefault();
  }

  return {
    begin, show,
    /** Names for the fields of a column. */
    hint(key, list) {
      hints[key] = true;
      const element = document.createElement("datalist");
      element.id = `hints-${key}`;
      for (const name of list) element.append(Object.assign(document.createElement("option"), { value: name }));
      document.body.append(element);
    },
    filter(typed) {
      words = typed.trim().toLowerCase();
      chooseRows();
      choose(row, column);
    },
    values(given) {
      values = given;
      if (sheet) fill();
    },
    /** The index of the chosen signal in the file; -1 without one. */
    get chosen() { return shown[row] ?? -1; },
    get isEditing() { return field !== null; },
    /** Goes to a cell of the file. */
    go(index, key) {
      if (!shown.includes(index)) {
        words = get("filter").value = "";
        chooseRows();
      }
      choose(shown.indexOf(index), Math.max(0, columns.findIndex((it) => it.key === key)));
      get("grid").focus({ preventScroll: true });
    },
    /** Chooses a signal without taking the focus. */
    reveal(index) {
      if (shown.includes(index)) choose(shown.indexOf(index), column);
    },
    edit,
    leave,
  };
})();
