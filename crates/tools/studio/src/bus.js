"use strict";

// The tables [driver] and [fieldbus], as a form that the schema of driver.cfg describes.

const bus = (() => {
  const get = (id) => document.getElementById(id);
  let schema = null;
  let tell = {};
  /** What the form shows at present; it is made again only if that changes. */
  let drawn = "";
  /** True while the form is made again: a field that goes loses its focus then, and its user has typed half of a value. */
  let isDrawing = false;

  const rules = (kind) => schema?.allOf.find((rule) => rule.if.properties.fieldbus.properties.kind.const === kind)?.then.properties.fieldbus;
  const kinds = () => schema?.properties.fieldbus.properties.kind.enum ?? [];

  /** The description of a key of [fieldbus] on this kind of bus. */
  function described(kind, key) {
    const own = rules(kind)?.properties[key];
    return own && own !== true ? own : schema.properties.fieldbus.properties[key] ?? {};
  }

  function choices(shape) {
    if (shape.enum) return shape.enum.map(String);
    if (shape.type === "boolean") return ["true", "false"];
    return (shape.anyOf ?? []).flatMap((it) => choices(it));
  }

  function make(kind, properties, ...children) {
    const element = Object.assign(document.createElement(kind), properties);
    element.append(...children);
    return element;
  }

  function row(table, key, value, shape, wrong) {
    const id = `key-${table}-${key}`;
    const field = make("input", { id, type: "text", value, autocomplete: "off", spellcheck: false, placeholder: shape.default === undefined ? "" : String(shape.default) });
    field.dataset.was = value;
    const list = choices(shape);
    const parts = [make("label", { htmlFor: id, textContent: key, title: shape.description ?? "" }), field];
    if (list.length) {
      field.setAttribute("list", `${id}-list`);
      parts.push(make("datalist", { id: `${id}-list` }, ...list.map((name) => make("option", { value: name }))));
    }
    const help = make("span", { className: wrong ? "help wrong" : "help", id: `${id}-help`, textContent: wrong ?? shape.description ?? "" });
    field.setAttribute("aria-describedby", help.id);
    if (wrong) field.setAttribute("aria-invalid", "true");
    const commit = () => {
      if (isDrawing || field.value.trim() === field.dataset.was) return;
      const { was } = field.dataset;
      field.dataset.was = field.value.trim();
      tell.set([table, key], was, field.value.trim());
    };
    field.addEventListener("change", commit);
    // A value that was put back while the form was made again is no change for the browser.
    field.addEventListener("blur", commit);
    return make("div", { className: "setting" }, ...parts, help);
  }

  function show(sheet, checked) {
    const form = get("settings");
    if (!schema || !sheet) return;
    const told = new Map();
    for (const { at, what, right } of checked) {
      const key = at.slice(0, 2).join("/");
      if (at[1] !== "at" && !told.has(key)) told.set(key, `${what}; ${right}`);
    }
    const now = JSON.stringify([sheet.kind, sheet.driver, sheet.fieldbus, [...told]]);
    if (now === drawn) return;
    drawn = now;
    const field = document.activeElement;
    const active = field?.id;
    const typed = field?.dataset.was !== undefined && field.value !== field.dataset.was ? field : null;
    const isOpen = form.querySelector("details")?.open ?? false;
    const { kind } = sheet;
    const select = make("select", { id: "kind" }, ...(kinds().includes(kind) ? [] : [make("option", { value: kind, textContent: kind || "choose a bus" })]), ...kinds().map((name) => make("option", { value: name, textContent: name })));
    select.value = kind;
    select.addEventListener("change", () => tell.set(["fieldbus", "kind"], kind, select.value));
    const wrong = told.get("fieldbus/kind") ?? told.get("fieldbus");
    const parts = [make("div", { className: "setting" }, make("label", { htmlFor: "kind", textContent: "kind" }), select, make("span", { className: wrong ? "help wrong" : "help", textContent: wrong ?? "The bus, and this end of it" }))];
    const driver = schema.properties.driver.properties;
    const ofBus = Object.keys(rules(kind)?.properties ?? {}).filter((key) => key !== "kind" && key !== "at");
    const isShown = (table, key, cells) => key in cells || told.has(`${table}/${key}`);
    const required = ["address", "device", "name", "id", ...(rules(kind)?.required ?? [])];
    const lists = [[], []];
    for (const key of ofBus) lists[isShown("fieldbus", key, sheet.fieldbus) || required.includes(key) ? 0 : 1].push(row("fieldbus", key, sheet.fieldbus[key] ?? "", described(kind, key), told.get(`fieldbus/${key}`)));
    for (const key of Object.keys(sheet.fieldbus)) if (key !== "kind" && !ofBus.includes(key)) lists[0].push(row("fieldbus", key, sheet.fieldbus[key], {}, told.get(`fieldbus/${key}`) ?? "not a setting of this bus"));
    for (const key of Object.keys(driver)) lists[isShown("driver", key, sheet.driver) || required.includes(key) ? 0 : 1].push(row("driver", key, sheet.driver[key] ?? "", driver[key], told.get(`driver/${key}`)));
    const more = make("details", { open: isOpen }, make("summary", { textContent: `${lists[1].length} more settings` }), ...lists[1]);
    isDrawing = true;
    form.replaceChildren(...parts, ...lists[0], more);
    isDrawing = false;
    if (!active?.startsWith("key-") && active !== "kind") return;
    const again = document.getElementById(active);
    if (again && typed) {
      // What is half typed stays, and knows what was there before it.
      again.value = typed.value;
      again.dataset.was = typed.dataset.was;
    }
    again?.focus({ preventScroll: true });
  }

  return {
    begin(given, listener) {
      schema = given;
      tell = listener;
      get("settings").addEventListener("submit", (event) => event.preventDefault());
      const signal = schema.properties.signal.items.properties;
      for (const key of ["type", "latch", "order"]) cells.hint(key, choices(signal[key]));
    },
    show,
    /** Makes the form again at the next look: a change was refused, and a field shows it. */
    forget() { drawn = ""; },
    go(table, key) {
      const field = document.getElementById(key === "kind" ? "kind" : `key-${table}-${key}`);
      if (!field) return false;
      const box = field.closest("details");
      if (box) box.open = true;
      field.focus();
      return true;
    },
  };
})();
