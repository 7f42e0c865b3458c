"use strict";

// Stored sets: values of several signals under a name, forced together and released together.

const sets = (() => {
  const { make } = elements;
  const get = (id) => document.getElementById(id);
  let act = {};
  let shown = "";

  /** The sets by their names: the parts of each, by the id of the driver. */
  function all() {
    const found = new Map();
    for (const [driver, { sets }] of watch.files) {
      for (const set of sets) found.set(set.name, [...found.get(set.name) ?? [], [driver, set]]);
    }
    return found;
  }

  async function force(name, parts) {
    if (act.isPast()) return;
    for (const [driver, { values }] of parts) {
      if (!await act.change("PUT", `/force/${driver}`, JSON.stringify(values), `The set "${name}" is forced.`)) return;
    }
  }

  async function release(name, parts) {
    for (const [driver, { values }] of parts) {
      if (!await act.change("DELETE", `/force/${driver}`, JSON.stringify(values.map(([signal]) => signal)), `The set "${name}" is released.`)) return;
    }
  }

  async function remove(name, parts) {
    for (const [driver, set] of parts) if (!await watch.replace(driver, "set", set, null)) return;
    await watch.look();
    act.say(`The set "${name}" is removed from the file.`);
  }

  /** Stores the signals that are forced now with their values, also in the place of a set of this name. */
  async function store(name) {
    const known = new Map(all().get(name) ?? []);
    const forced = act.forced();
    if (!name) return act.say("The set has no name; write one, such as start position.", true);
    if (!forced.length) return act.say("No signal is forced; force those that belong to the set.", true);
    const drivers = new Set([...known.keys(), ...forced.map(({ driver }) => driver.id)]);
    for (const driver of drivers) {
      const values = forced.filter((signal) => signal.driver.id === driver).map((signal) => [signal.name, signal.isBool ? words.value({ ...signal, value: signal.live[0] }) : String(signal.live[0])]);
      if (!await watch.replace(driver, "set", known.get(driver) ?? null, values.length ? { name, values } : null)) return;
    }
    get("sets-name").value = "";
    await watch.look();
    act.say(`The set "${name}" is stored, with ${words.count(forced.length, "signal", "signals")}.`);
  }

  function show() {
    const now = all();
    get("sets").hidden = watch.files.size === 0;
    get("sets-none").hidden = now.size > 0;
    const text = JSON.stringify([...now]);
    if (text === shown) return;
    shown = text;
    get("sets-list").replaceChildren();
    for (const [name, parts] of now) {
      const row = make("li", "", get("sets-list"));
      const told = make("span", "", row);
      make("b", "", told, name);
      make("span", "note", told, ` ${parts.flatMap(([, { values }]) => values.map(([signal, value]) => `${signal} = ${value}`)).join(", ")}`);
      for (const [text, label, action] of [["Force", `Force the set ${name}`, force], ["Release", `Release the set ${name}`, release], ["×", `Remove the set ${name}`, remove]]) {
        const button = make("button", "", row, text);
        button.type = "button";
        button.setAttribute("aria-label", label);
        button.addEventListener("click", () => action(name, parts));
      }
    }
  }

  get("sets-new").addEventListener("submit", (event) => {
    event.preventDefault();
    store(get("sets-name").value.trim());
  });

  return {
    show,
    /** Sets what the page does: `say(text, isBad)`, `change(…)`, `isPast()`, `forced()`. */
    begin(actions) { act = actions; show(); },
  };
})();
