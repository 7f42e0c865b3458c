"use strict";

// The conditions of the analyser: the view stops at the next tick at which they begin to hold, or jumps to such a tick. The
// server looks for it, in every tick.

const trigger = (() => {
  const { write } = elements;
  const get = (id) => document.getElementById(id);
  const [field, insert] = [get("trigger-text"), get("trigger-insert")];
  /** The time between two looks, in milliseconds. */
  const PERIOD = 100;
  /** The most signals that are offered where none is on the axis. */
  const ROOM = 24;
  let act = {};
  let signals = [];
  /** The id of the driver whose condition was inserted last. */
  let near = null;
  /** What is waited for: `{ id, text, until }`, a driver's id and the last tick that was looked at; null while it is off. */
  let armed = null;

  const driverOf = (id) => plant.drivers.find((driver) => driver.id === id);

  function show() {
    get("arm").hidden = plant.drivers.some(({ isRecording }) => isRecording);
    get("arm").setAttribute("aria-pressed", String(armed !== null));
    get("arm").textContent = armed ? "Waits – cancel" : "Wait for it";
    field.readOnly = insert.disabled = armed !== null;
  }

  function disarm() {
    armed = null;
    show();
  }

  /** Shows what is wrong with the text, at its field. */
  function tell(text) {
    write(get("trigger-told"), text);
    field.setAttribute("aria-invalid", String(text !== ""));
    if (text) field.focus();
  }

  /** How much of a text is names of a driver's signals, in characters. */
  function share(driver, text) {
    const names = driver.signals.map(({ name }) => name).filter((name) => text.includes(name)).sort((a, b) => b.length - a.length);
    const rest = names.reduce((rest, name) => rest.replace(new RegExp(`(?<!\\S)${name.replace(/[\\^$.*+?()[\]{}|]/g, "\\$&")}(?=$|[ <>=!])`, "g"), ""), text);
    return text.length - rest.length;
  }

  /** The text, and the driver that it is about: the one whose names are most of it. */
  function wanted() {
    const text = field.value.trim();
    let [best, most] = [null, -1];
    for (const driver of new Set([driverOf(near), act.chosen()?.driver, bar.lead, ...plant.drivers])) {
      if (!driver?.past) continue;
      const own = share(driver, text);
      if (own > most) [best, most] = [driver, own];
    }
    return { driver: best, text };
  }

  async function next({ id, text, until }) {
    const answer = await room.ask(`/history/${id}/next/when/${until}/${encodeURIComponent(text)}`);
    return answer.ok ? answer.json() : { refused: await bar.refusal(answer) };
  }

  async function arm() {
    const { driver, text } = wanted();
    const own = { id: driver.id, text, until: driver.past.tick };
    const found = await next(own).catch(() => null);
    if (!found) return act.say("Nobody answers; wait until the page is live again.", true);
    if (found.refused) return act.say(found.refused, true);
    tell(found.wrong ?? "");
    if (found.wrong) return act.say("");
    armed = own;
    act.follow();
    act.say("The view stops when it happens.");
    show();
  }

  /** Looks at all ticks since the last look. */
  async function look() {
    const own = armed;
    const found = own && await next(own);
    if (!found || found.refused || armed !== own) return;
    const lost = "the oldest changes have left the memory (history in [page])";
    if (found.wrong) {
      disarm();
      act.say(`Nothing is waited for any more: ${found.wrong}`, true);
    } else if (found.tick !== null) {
      disarm();
      const driver = driverOf(own.id);
      // As the bar shows it.
      const at = words.moment(found.ms - bar.offset(driver));
      act.stop(driver, found);
      act.say(`${own.text}: at ${at}; the view has stopped there.${found.is_cut ? ` It may have happened before: ${lost}.` : ""}`, found.is_cut);
    } else {
      if (found.is_cut) act.say(`Waits on; but ${lost}, and it may have happened among them.`, true);
      // After a restart the ticks begin again.
      own.until = found.until < own.until ? 0 : found.until;
    }
  }

  /** Offers the conditions on the signals of the axis and the chosen one; without any, on the first ones of the list. */
  function offer() {
    const own = new Set([...signals, act.chosen()].filter((it) => it?.driver.past));
    const all = own.size ? [...own] : plant.signals.slice(0, ROOM);
    insert.replaceChildren(new Option("Insert…", ""), ...all.flatMap(({ name, isBool, driver }) => (isBool ? ["", "not ", " rises", " falls", " changes"] : [" changes", " > ", " < ", " == "]).map((it) => {
      const condition = it === "not " ? it + name : name + it;
      const option = new Option(condition);
      // The option's own text has single spaces only.
      Object.assign(option, { condition, driver: driver.id });
      return option;
    })));
  }

  insert.addEventListener("change", () => {
    const option = insert.selectedOptions[0];
    near = option.driver;
    field.value = (field.value.trim() ? `${field.value.trim()} and ` : "") + option.condition;
    insert.value = "";
    tell("");
    field.focus();
  });
  field.addEventListener("input", () => tell(""));
  get("trigger").addEventListener("submit", (event) => {
    event.preventDefault();
    if (armed) {
      disarm();
      act.say("");
    } else if (get("arm").hidden) bar.jump(true, "when");
    else arm();
  });

  room.every(PERIOD, look);
  return {
    wanted, tell, offer,
    /** Sets what the page does: `say(text, isBad)`, `follow()`, `stop(driver, { tick, ms })`, `chosen()`. */
    begin(actions) { act = actions; },
    /** The signals on the axis have changed, or all drivers were replaced. */
    choices(given) {
      signals = given;
      if (armed && !driverOf(armed.id)) {
        act.say("The driver has left the page; nothing is waited for any more.", true);
        armed = null;
      }
      offer();
      show();
    },
    get isArmed() { return armed !== null; },
  };
})();
