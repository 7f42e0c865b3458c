"use strict";

// Touching the pictures: a part tells its signal, is found in the list, opens its trend and is forced; push-buttons are held,
// and switches stay. By mouse, finger and keyboard.

const touch = (() => {
  /** The shortest time for which a button is pressed, in milliseconds, so that a slow PLC sees a short tap. */
  const SHORTEST = 200;
  /** The time after which the page has heard of a press, or of its release by another page, in milliseconds. */
  const SETTLED = 2000;
  const KINDS = { press: "push-button", switch: "switch" };
  let act = {};
  /** All pictures, each `{ root, frame, marks, tip, parts }`, and the part by its element. */
  let sheets = [];
  let partOf = new Map();
  /** The part below the pointer, and the one with the focus. */
  let hovered = null;
  let focused = null;
  /** The pressed buttons by their paths: `{ signal, part, by, since, sent, isPressed, isSettled, isLeft }`, and the paths whose release has not arrived. */
  const held = new Map();
  const owed = new Set();
  let isOld = true;

  /** Takes new pictures, after their moving parts are known. */
  function prepare(pictures) {
    letGoAll();
    hovered = focused = null;
    partOf = new Map();
    sheets = pictures.filter(({ root }) => root).map(prepareOne);
  }

  function prepareOne({ root, element, movers }) {
    const frame = element.firstElementChild;
    const marks = document.createElement("div");
    marks.className = "marks";
    const tip = document.createElement("p");
    tip.className = "tip";
    tip.hidden = true;
    // What is read aloud is the label of the part.
    for (const it of [marks, tip]) it.setAttribute("aria-hidden", "true");
    frame.append(marks, tip);
    const sheet = { root, frame, marks, tip, parts: [], drawn: [] };
    for (const { element: drawn, bindings, signals } of movers) {
      const own = [...new Set(signals.filter(Boolean))];
      if (!own.length || drawn.closest("defs, clipPath, mask, pattern, marker, symbol")) continue;
      // What is within a control belongs to it.
      const outer = partOf.get(drawn.parentNode.closest?.(".tb-control"));
      if (outer) {
        outer.signals = [...new Set([...outer.signals, ...own])];
        continue;
      }
      const at = bindings.findIndex((binding, i) => KINDS[binding.do] && signals[i]);
      const control = at < 0 ? null : bindings[at];
      if (control) own.sort((a, b) => (b === signals[at]) - (a === signals[at]));
      const part = { sheet, element: drawn, signals: own, control, key: `${control?.do} ${own.map(plant.keyOf)}` };
      sheet.parts.push(part);
      partOf.set(drawn, part);
      // Controls are reached by Tab, and the other parts from the picture, by arrow keys.
      drawn.setAttribute("tabindex", control ? "0" : "-1");
      drawn.setAttribute("role", control?.do === "switch" ? "switch" : "button");
      drawn.classList.add("tb-part");
      if (control) drawn.classList.add("tb-control");
      label(part);
    }
    // A button has no buttons in it, for a screen reader.
    for (const { element: drawn, control } of sheet.parts) if (!control && drawn.querySelector(".tb-part")) drawn.setAttribute("role", "group");
    if (!sheet.parts.length) return sheet;
    root.setAttribute("role", "group");
    root.setAttribute("tabindex", "0");
    root.setAttribute("aria-description", "Arrow keys go from part to part");
    const style = new CSSStyleSheet();
    style.replaceSync(`
      :host > svg:focus, .tb-part:focus { outline: none; }
      .tb-part { cursor: pointer; touch-action: manipulation; }
      .tb-control { touch-action: none; user-select: none; -webkit-user-select: none; }
    `);
    const shadow = root.getRootNode();
    shadow.adoptedStyleSheets = [...shadow.adoptedStyleSheets, style];
    listen(sheet);
    return sheet;
  }

  /** The innermost part that contains an element of a picture. */
  function partAt(element) {
    for (let it = element; it instanceof Element; it = it.parentNode) {
      if (partOf.has(it)) return partOf.get(it);
    }
    return null;
  }

  // What a part says.

  const valueOf = (signal) => `${words.value(signal)}${signal.unit && signal.value !== null ? ` ${signal.unit}` : ""}`;
  const stateOf = (signal) => (signal.isForced ? ", forced" : signal.isFailSafe ? ", fail-safe" : signal.isStale ? ", stale" : "");
  const textOf = (part) => part.signals.map((signal) => `${signal.name}: ${valueOf(signal)}${stateOf(signal)}`).join(" · ");

  /** What is written in a part. */
  const caption = (element) => Array.from(element.matches("text") ? [element] : element.querySelectorAll("text"), (it) => it.textContent.trim()).join(" ");

  function label(part) {
    const [first] = part.signals;
    const drawn = caption(part.element);
    let text = part.control ? `${first.name}, ${KINDS[part.control.do]}` : textOf(part);
    if (part.control && !text.toLowerCase().includes(drawn.toLowerCase())) text = `${drawn}: ${text}`;
    // What is written in a part that moves is its name already.
    if (part.text !== text) part.element.setAttribute(drawn && !part.control ? "aria-description" : "aria-label", part.text = text);
    const isOn = String(plant.number(first) > 0.5);
    if (part.control?.do !== "switch" || part.isOn === isOn) return;
    part.element.setAttribute("aria-checked", part.isOn = isOn);
  }

  // Finding a signal in the list, from a part and back.

  function find(part) {
    const { signals } = part;
    // Touched again, a part goes on to its next signal.
    const signal = signals[(signals.indexOf(list.chosen) + 1) % signals.length];
    reveal(signal, part);
  }

  /** Selects a signal in the list, which shows all signals if it did not show this one. A control does not move the page. */
  function reveal(signal, { control }) {
    if (list.find(signal, !control)) return;
    act.listAll();
    list.find(signal, !control);
  }

  /** The chosen signal, if it is one of the part, or else its first; it is chosen. */
  function chosenOf(part) {
    const signal = part.signals.includes(list.chosen) ? list.chosen : part.signals[0];
    if (signal !== list.chosen) reveal(signal, part);
    return signal;
  }

  function openTrend(part) {
    const signal = chosenOf(part);
    views.reveal("signals");
    list.toggle(signal);
    reveal(signal, part);
  }

  // Push-buttons and switches.

  /** Presses a button: `by` is the pointer or the key that holds it. */
  async function press(part, by, isQuiet = false) {
    const signal = part.signals[0];
    const path = act.pathOf(signal);
    if (!isQuiet) reveal(signal, part);
    const before = held.get(path);
    // A button that is about to be let go is pressed after that.
    if (before?.isLeft) before.next = { part, by, isQuiet };
    if (before || !act.canForce(signal)) return;
    if (isOld) return act.say("No connection: nothing can be pressed.", true);
    const to = signal.isBool ? (part.control.to > 0.5 ? "TRUE" : "FALSE") : String(part.control.to);
    owed.delete(path);
    const one = { signal, part, by, isQuiet, since: performance.now(), sent: room.change("PUT", path, to) };
    held.set(path, one);
    show();
    const answer = await one.sent;
    // Without an answer the press may have arrived, and is released.
    one.isPressed = answer?.ok === true;
    if (one.isPressed && isQuiet) act.say("");
    else if (one.isPressed) act.say(`${signal.name} is ${one.isLeft ? "let go" : "pressed"}.`);
    else if (answer) act.say(answer.text, true);
    if (!one.isPressed) return letGo(path);
    // Before, the mark can be that of the press before, and it may come and go without being drawn.
    setTimeout(() => {
      one.isSettled = true;
      show();
    }, SETTLED);
  }

  /** Lets go of a button, not before its press has arrived and a slow PLC has seen it. */
  async function letGo(path, why = "") {
    const one = held.get(path);
    if (!one || one.isLeft) return;
    const told = why || (one.isQuiet ? "" : `${one.signal.name} is let go.`);
    one.isLeft = true;
    show();
    const answer = await one.sent;
    const left = one.since + SHORTEST - performance.now();
    if (answer?.ok && left > 0) await new Promise((done) => { setTimeout(done, left); });
    // What was refused is not held.
    if (answer === null || answer.ok) {
      owed.add(path);
      await pay(path, told);
    }
    held.delete(path);
    show();
    if (one.next) press(one.next.part, one.next.by, one.next.isQuiet);
  }

  /** Releases; without an answer it is tried again when the page is live. */
  async function pay(path, done) {
    const answer = await room.change("DELETE", path);
    if (answer === null) return act.say("Nobody answers: a button is let go when the page is live again.", true);
    owed.delete(path);
    act.say(answer.ok ? done : answer.text, !answer.ok);
  }

  function letGoAll(isMine = () => true) {
    for (const [path, one] of held) {
      if (one.next && isMine(one.next)) one.next = null;
      if (isMine(one)) letGo(path);
    }
  }

  /** Leaves the page: nothing can be awaited any more. */
  function leave() {
    for (const path of new Set([...held.keys(), ...owed])) room.ask(path, { method: "DELETE", keepalive: true }).catch(() => {});
    letGoAll();
  }

  /** Presses a button shortly, for a screen reader, which has no key or pointer to hold. */
  function tap(part, isQuiet) {
    press(part, "tap", isQuiet);
    letGoAll(({ by }) => by === "tap");
  }

  /** Turns a switch: a forced one goes back to what the machine makes it, another is forced to the opposite. */
  function turn(part, isQuiet = false) {
    const signal = part.signals[0];
    if (!isQuiet) reveal(signal, part);
    if (!act.canForce(signal)) return;
    if (plant.isForcedNow(signal)) return act.release(signal, isQuiet);
    const to = plant.measured(signal) > 0.5 ? "FALSE" : "TRUE";
    act.change("PUT", act.pathOf(signal), to, isQuiet ? "" : `${signal.name} is turned to ${to}.`);
  }

  // Pointer and keys.

  function listen(sheet) {
    const { root, frame } = sheet;
    const on = (name, action) => root.addEventListener(name, (event) => action(event, partAt(event.target)));
    on("pointerover", (_, part) => { hovered = part; show(); });
    root.addEventListener("pointerleave", () => { hovered = null; show(); });
    on("pointerdown", (event, part) => {
      if (part?.control?.do !== "press" || event.button !== 0) return;
      part.element.focus({ preventScroll: true });
      part.element.setPointerCapture(event.pointerId);
      event.preventDefault();
      press(part, event.pointerId);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      on(end, (event) => letGoAll(({ by }) => by === event.pointerId));
    }
    on("click", (event, part) => {
      if (!part) return;
      if (part.control?.do === "press") {
        if (!event.detail) tap(part);
      } else if (part.control) turn(part);
      else if (event.detail < 2) find(part);
    });
    on("dblclick", (_, part) => { if (part && !part.control) openTrend(part); });
    on("contextmenu", (event, part) => { if (part?.control) event.preventDefault(); });
    on("focusin", (_, part) => { focused = part; show(); });
    on("focusout", (_, part) => {
      focused = null;
      letGoAll((one) => one.part === part);
      show();
    });
    on("keyup", (event) => letGoAll(({ by }) => by === event.key));
    on("keydown", (event, part) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !key(sheet, event, part)) return;
      event.preventDefault();
      // The bar of time has the same arrows.
      event.stopPropagation();
    });
    // The notice of stale data stands below the drawing, so that it hides no button.
    frame.classList.toggle("has-controls", sheet.parts.some(({ control }) => control));
  }

  /** Makes a button outside of the picture do what a control of it does. Its place must not move while it is pressed. */
  function bind(button, part) {
    const mine = (one) => one.part === part;
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    if (part.control.do === "switch") {
      button.setAttribute("role", "switch");
      button.addEventListener("click", () => turn(part, true));
      return;
    }
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      // The focus moves before the press: the end of the one on the button in the picture would end this press as well.
      event.preventDefault();
      button.focus({ preventScroll: true });
      button.setPointerCapture(event.pointerId);
      press(part, event.pointerId, true);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      button.addEventListener(end, (event) => letGoAll(({ by }) => by === event.pointerId));
    }
    button.addEventListener("click", ({ detail }) => { if (!detail) tap(part, true); });
    button.addEventListener("keydown", (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) press(part, event.key, true);
    });
    button.addEventListener("keyup", ({ key }) => letGoAll(({ by }) => by === key));
    button.addEventListener("blur", () => letGoAll(mine));
  }

  /** Uses a key; returns whether it did. */
  function key(sheet, event, part) {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (step) return go(sheet, part, step);
    if (!part) return false;
    const isEnter = event.key === "Enter";
    if (isEnter || event.key === " ") {
      if (event.repeat) return true;
      if (part.control?.do === "press") press(part, event.key);
      else if (part.control) turn(part);
      else if (isEnter) openTrend(part);
      else find(part);
    } else if (event.key === "t" || event.key === "T") {
      openTrend(part);
    } else if (event.key === "f" || event.key === "F") {
      act.force(chosenOf(part));
    } else if (event.key === "Delete" || event.key === "Backspace") {
      act.release(chosenOf(part));
    } else if (event.key === "Escape") {
      letGoAll();
      sheet.root.focus({ preventScroll: true });
    } else {
      return false;
    }
    return true;
  }

  /** Goes to the next part that can be seen; of the parts of one signal, to the first. */
  function go({ parts, root }, from, step) {
    const seen = new Set();
    const stops = parts.filter((part) => {
      if (part !== from && (seen.has(part.key) || part.key === from?.key || !isSeen(part.element))) return false;
      seen.add(part.key);
      return true;
    });
    if (!stops.length) return true;
    const at = stops.indexOf(from);
    const next = at < 0 ? (step > 0 ? 0 : stops.length - 1) : (at + step + stops.length) % stops.length;
    (stops[next]?.element ?? root).focus({ preventScroll: true });
    return true;
  }

  function isSeen(element) {
    const { width, height } = element.getBoundingClientRect();
    return width > 0 || height > 0;
  }

  // What is drawn over a picture.

  /** Draws the marks and the words at the parts, where these are now. */
  function show() {
    if (bar.moment && held.size) letGoAll();
    for (const [path, one] of held) {
      // Released here as well: the mark may be older than the press.
      if (one.isSettled && !plant.isForcedNow(one.signal) && !one.isLeft) letGo(path, `${one.signal.name} was let go by another page.`);
    }
    for (const sheet of sheets) showOne(sheet);
  }

  function showOne(sheet) {
    const wanted = [];
    const pressed = new Set(Array.from(held.values(), ({ part, isLeft }) => (isLeft ? null : part)));
    for (const part of sheet.parts) {
      if (part.control) label(part);
      const isChosen = list.chosen !== null && part.signals.includes(list.chosen);
      const classes = [isChosen && "chosen", part === focused && "focused", pressed.has(part) && "pressed"].filter(Boolean);
      if (classes.length) wanted.push([part.element, classes.join(" ")]);
    }
    if (focused?.sheet === sheet && !focused.control) label(focused);
    if (sheet.root.getRootNode().activeElement === sheet.root) wanted.push([sheet.root, "focused"]);
    while (sheet.drawn.length < wanted.length) {
      const mark = document.createElement("div");
      sheet.marks.append(mark);
      sheet.drawn.push(mark);
    }
    const about = [hovered, focused].find((part) => part?.sheet === sheet) ?? null;
    sheet.tip.hidden = !about;
    if (!about && !wanted.length) {
      for (const mark of sheet.drawn) mark.hidden = true;
      return;
    }
    const frame = sheet.frame.getBoundingClientRect();
    const left = frame.left + sheet.frame.clientLeft;
    const top = frame.top + sheet.frame.clientTop;
    sheet.drawn.forEach((mark, i) => {
      const box = wanted[i]?.[0].getBoundingClientRect();
      mark.hidden = !box || (box.width === 0 && box.height === 0);
      if (mark.hidden) return;
      mark.className = wanted[i][1];
      const inset = wanted[i][0] === sheet.root ? 4 : -3;
      mark.style.transform = `translate(${box.left - left + inset}px, ${box.top - top + inset}px)`;
      mark.style.width = `${box.width - 2 * inset}px`;
      mark.style.height = `${box.height - 2 * inset}px`;
    });
    if (about) tell(sheet, about, left, top);
  }

  const HINTS = { press: "hold to press", switch: "turns" };

  function tell({ tip, frame }, part, left, top) {
    const text = part.control ? `${textOf(part)} – ${HINTS[part.control.do]}` : textOf(part);
    elements.write(tip, text);
    const box = part.element.getBoundingClientRect();
    const x = Math.max(4, Math.min(box.left - left, frame.clientWidth - tip.offsetWidth - 4));
    const above = box.top - top - tip.offsetHeight - 6;
    const y = above >= 4 ? above : Math.min(box.bottom - top + 6, frame.clientHeight - tip.offsetHeight - 4);
    tip.style.transform = `translate(${x}px, ${y}px)`;
  }

  window.addEventListener("blur", () => letGoAll());
  window.addEventListener("pagehide", leave);
  document.addEventListener("visibilitychange", () => { if (document.hidden) letGoAll(); });
  window.addEventListener("resize", () => show());

  return {
    prepare, show, bind,
    /** The push-buttons and switches of all pictures, each once. */
    get controls() {
      const parts = sheets.flatMap(({ parts }) => parts.filter(({ control }) => control));
      return parts.filter(({ key }, i) => parts.findIndex((other) => other.key === key) === i);
    },
    /** Sets what the page does for a part: `say`, `canForce`, `change`, `pathOf`, `release`, `force`, `listAll`. */
    begin(actions) { act = actions; },
    /** Notes whether the page is without a connection, on which every button is let go. */
    link(isNowOld) {
      const isBack = isOld && !isNowOld;
      isOld = isNowOld;
      if (isOld) letGoAll();
      if (isBack) for (const path of owed) pay(path, "A button is let go.");
    },
  };
})();
