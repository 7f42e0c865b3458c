"use strict";

// The trigger of the analyser: it stops the view at the tick in which a signal does what was asked for.

const trigger = (() => {
  const get = (id) => document.getElementById(id);
  /** The time between two looks, in milliseconds. */
  const PERIOD = 100;
  /** Later than any tick, in milliseconds: a page in the background hears of no newer ones, and yet the trigger sees them. */
  const FAR = 1e12;
  /** By name: whether a change from one value to another is meant, and the words for it. A time without a value is NaN. */
  const CASES = {
    rises: { fits: (was, is) => is > was, done: "rose" },
    falls: { fits: (was, is) => is < was, done: "fell" },
    changes: { fits: (was, is) => !Number.isNaN(was) && !Number.isNaN(is), done: "changed" },
    above: { fits: (was, is, limit) => is > limit && !(was > limit), done: "went above", hasLimit: true },
    below: { fits: (was, is, limit) => is < limit && !(was < limit), done: "went below", hasLimit: true },
    equals: { fits: (was, is, limit) => is === limit && was !== limit, done: "became", hasLimit: true },
  };
  let act = {};
  let signals = [];
  /** What is waited for: `{ signal, name, limit, until, was }`; null while it is off. */
  let armed = null;

  const hasLimit = () => CASES[get("trigger-case").value].hasLimit === true;

  function show() {
    get("trigger-limit").hidden = !hasLimit();
    get("arm").setAttribute("aria-pressed", String(armed !== null));
    get("arm").textContent = armed ? "Waits – cancel" : "Wait for it";
    for (const id of ["trigger-signal", "trigger-case", "trigger-limit"]) get(id).disabled = armed !== null;
  }

  function disarm() {
    armed = null;
    show();
  }

  function arm() {
    const signal = signals.find((it) => plant.keyOf(it) === get("trigger-signal").value);
    if (!signal?.driver.past) return act.say("Put a signal on the axis first.", true);
    if (signal.driver.isRecording) return act.say("A recording has ended: go to its edges with “edge ▸”, or with “Jump to”.", true);
    const text = get("trigger-limit").value.trim().replace(",", ".").replace("−", "-");
    const bools = { TRUE: 1, FALSE: 0 };
    const limit = hasLimit() ? (bools[text.toUpperCase()] ?? (text === "" ? NaN : Number(text))) : 0;
    if (Number.isNaN(limit)) {
      get("trigger-limit").focus();
      return act.say(`"${text}" is not a number; write one such as 12.5.`, true);
    }
    armed = { signal, name: get("trigger-case").value, limit, until: signal.driver.past.last, was: NaN };
    act.follow();
    act.say("The view stops when it happens.");
    show();
  }

  /** Looks at all changes since the last look. */
  async function look() {
    const own = armed;
    // Of too many changes the server has the extremes alone: it is asked again, for shorter times.
    for (let to = FAR; own && armed === own;) {
      const { driver, index } = own.signal;
      const answer = await room.ask(`/trend/${driver.id}/${index}/${own.until}/${to}`);
      if (!answer.ok || armed !== own) return;
      const news = await answer.json();
      const given = news.signals[index];
      const next = given.ms.find((ms) => ms > own.until);
      if (given.is_thin && next < given.ms.at(-1)) {
        to = Math.max(next, given.ms[given.ms.length >> 2]);
        continue;
      }
      if (given.ms[0] > own.until) {
        act.say("Waits on; but the oldest changes have left the memory (history in [page]), and the signal may have done it among them.", true);
        own.was = NaN;
      }
      take(own, news.to_ms, given);
      if (to === FAR) return;
      to = FAR;
    }
  }

  function take(own, until, { ms, values }) {
    const { fits, done, hasLimit } = CASES[own.name];
    for (let i = 0; i < ms.length; i++) {
      const is = values[i] ?? NaN;
      if (ms[i] > own.until && fits(own.was, is, own.limit)) {
        disarm();
        act.stop(own.signal.driver, ms[i]);
        const unit = own.signal.unit ? ` ${own.signal.unit}` : "";
        const limit = hasLimit ? ` ${own.limit}${unit}` : "";
        return act.say(`${own.signal.name} ${done}${limit} at ${words.moment(ms[i])}; the view has stopped there.`);
      }
      own.was = is;
    }
    own.until = Math.max(own.until, until);
  }

  get("trigger-case").addEventListener("change", show);
  get("trigger").addEventListener("submit", (event) => {
    event.preventDefault();
    if (armed) disarm();
    else arm();
  });

  room.every(PERIOD, look);
  return {
    /** Sets what the page does: `say(text, isBad)`, `follow()`, `stop(driver, ms)`. */
    begin(actions) { act = actions; },
    /** The signals that it can wait for. */
    choices(given) {
      signals = given;
      if (armed) {
        armed.signal = signals.find((it) => plant.keyOf(it) === plant.keyOf(armed.signal)) ?? null;
        if (!armed.signal) {
          act.say("The trigger's signal has left the axis; it waits no more.", true);
          disarm();
        }
        // After a restart the time begins again.
        const last = armed?.signal.driver.past?.last ?? 0;
        if (armed && last < armed.until) Object.assign(armed, { until: last, was: NaN });
      }
      const chosen = get("trigger-signal").value;
      get("trigger-signal").replaceChildren(...signals.map((signal) => new Option(signal.name, plant.keyOf(signal))));
      if (signals.some((signal) => plant.keyOf(signal) === chosen)) get("trigger-signal").value = chosen;
      show();
    },
    get isArmed() { return armed !== null; },
  };
})();
