"use strict";

// Below the picture on a phone: its push-buttons and switches as large buttons, and the forced signals, each with its release.

const pads = (() => {
  const { make, write } = elements;
  const box = document.getElementById("pads");
  const buttons = document.getElementById("pad-buttons");
  const forced = document.getElementById("pad-forced");
  /** The most forced signals that are listed; the alarm at the top counts all of them. */
  const MOST = 8;
  let act = {};
  let known = [];
  let key = "";

  /** Takes the controls of new pictures. */
  function prepare() {
    known = touch.controls.map((part) => {
      const it = make("button", "pad", null);
      it.type = "button";
      make("span", "lamp", it).setAttribute("aria-hidden", "true");
      make("span", "", it, part.signals[0].name);
      const mark = make("span", "tag", it);
      touch.bind(it, part);
      return { it, part, mark };
    });
    buttons.replaceChildren(...known.map(({ it }) => it));
    key = "";
  }

  function redraw() {
    if (!views.isPhone || views.now !== "machine") return;
    const own = new Set();
    for (const { it, part, mark } of known) {
      const [signal] = part.signals;
      own.add(signal);
      const isOn = String(plant.number(signal) > 0.5);
      const state = part.control.do === "switch" ? "aria-checked" : "aria-pressed";
      if (it.getAttribute(state) !== isOn) it.setAttribute(state, isOn);
      write(mark, signal.isForced ? "forced" : "");
    }
    const all = plant.signals.filter((signal) => plant.isForcedNow(signal) && !own.has(signal)).slice(0, MOST);
    const now = all.map(plant.keyOf).join("\n");
    if (now !== key) {
      key = now;
      const isLost = forced.contains(document.activeElement);
      forced.replaceChildren(...all.map(entry));
      if (isLost) (forced.querySelector("button") ?? views).focus();
    }
    all.forEach((signal, i) => write(forced.children[i].querySelector("b"), words.value({ ...signal, value: signal.live[0] }) + (signal.unit && ` ${signal.unit}`)));
    forced.hidden = !all.length;
    box.hidden = !known.length && !all.length;
  }

  function entry(signal) {
    const it = make("li", "", null);
    make("span", "", it, signal.name);
    make("b", "", it);
    const release = make("button", "", it, "Release");
    release.type = "button";
    release.setAttribute("aria-label", `Release ${signal.name}`);
    release.addEventListener("click", () => act.release(signal));
    return it;
  }

  return {
    prepare, redraw,
    /** Sets what the page does: `release(signal)`. */
    begin(actions) { act = actions; },
  };
})();
