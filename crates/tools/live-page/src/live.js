"use strict";

// The page's controller: receives events, shows them, and requests forced values.

(() => {
  const { write } = elements;
  const get = (id) => document.getElementById(id);
  const forceValue = get("force-value");
  let mayForce = false;
  let isOld = true;
  let counts = { forced: 0, failSafe: 0 };
  /** For measurements: when the first signals were painted, in milliseconds since the request for the page. */
  let painted = 0;

  function say(text, isBad = false) {
    get("status").textContent = text;
    get("status").classList.toggle("bad", isBad);
  }

  /** True if the page shows a file, and nothing runs. */
  const isRecording = () => plant.drivers.some((driver) => driver.isRecording);

  // Forcing.

  const pathOf = (signal) => `/force/${signal.driver.id}/${encodeURIComponent(signal.name)}`;

  async function change(method, path, body, done) {
    const answer = await room.change(method, path, body);
    if (answer === null) say("Nobody answers; look at the values when the page is live again.", true);
    else if (answer.ok) say(done);
    else say(answer.text, true);
    return answer?.ok === true;
  }

  /** True, with the reason, while the page shows the past: a force would act on another moment than the one seen. */
  function isPast() {
    if (!bar.moment) return false;
    say("You look at the past, and a force acts on the present: press Live first.", true);
    return true;
  }

  /** Forces a signal, in the chosen way. */
  function force(signal, text) {
    if (!signal || isPast()) return;
    const value = text.trim().replace(",", ".").replace("−", "-");
    const shown = `${value}${signal.unit ? ` ${signal.unit}` : ""}`;
    const time = get("force-time").value.trim().replace(",", ".");
    const [suffix, done] = {
      hold: ["", `${signal.name} is forced to ${shown}.`],
      once: [" once", `${signal.name} was ${shown} for one tick.`],
      pulse: [` for ${time}`, `${signal.name} is forced to ${shown} for ${time}.`],
      ramp: [` within ${time}`, `${signal.name} goes to ${shown} within ${time}, and is held there.`],
    }[get("force-way").value];
    change("PUT", pathOf(signal), value + suffix, done);
  }

  function release(signal, isQuiet = false) {
    if (!signal || !mayForce) return;
    change("DELETE", pathOf(signal), undefined, isQuiet ? "" : `${signal.name} is released${bar.moment ? " now; the page shows the past" : ""}.`);
  }

  /** True if a signal can be forced now; says why if not. */
  function canForce(signal) {
    if (isRecording()) {
      say("Nothing can be forced: the page shows a recording.", true);
    } else if (!mayForce) {
      say("Read-only: open the address that was printed, with its token, to force a signal.", true);
    } else if (!signal.isWritable) {
      const why = signal.driver.isRun ? "that would change the run" : "the program only observes this bus";
      say(`${signal.name} cannot be forced: ${why}.`, true);
    } else {
      return !isPast();
    }
    return false;
  }

  /** Opens the tools that force the chosen signal. */
  function edit(signal) {
    if (!signal) {
      say("Choose a signal first.", true);
    } else if (!canForce(signal)) {
      // Nothing to type.
    } else if (signal.isBool) {
      get(plant.number(signal) > 0.5 ? "force-false" : "force-true").focus();
    } else {
      forceValue.focus();
      forceValue.select();
    }
  }

  function showChosen(signal) {
    get("chosen").hidden = !signal;
    if (!signal) return;
    const isNew = get("chosen").dataset.key !== plant.keyOf(signal);
    get("chosen").dataset.key = plant.keyOf(signal);
    write(get("chosen-name"), signal.name);
    const ways = { I: "to the PLC", Q: "from the PLC" };
    const facts = [signal.comment, signal.address, signal.type, ways[signal.direction] ?? `written by ${signal.driver.stations[signal.station]}`].filter(Boolean);
    if (signal.latch) facts.push(`latch ${signal.latch}`);
    if (signal.reply) facts.push(`reply: ${signal.reply}`);
    if (plant.drivers.length > 1) facts.push(signal.driver.name);
    write(get("chosen-facts"), facts.join(" · "));
    get("chosen-tools").hidden = !mayForce || !signal.isWritable;
    get("force-ramp").disabled = signal.isBool;
    if (signal.isBool && get("force-way").value === "ramp") get("force-way").value = "hold";
    get("force-time-of").hidden = !["pulse", "ramp"].includes(get("force-way").value);
    write(get("force-time-word"), get("force-way").value === "ramp" ? "within" : "for");
    get("force-bool").hidden = !signal.isBool;
    get("force-number").hidden = signal.isBool;
    write(get("force-unit"), signal.unit);
    const isPinned = watch.placeOf(signal) >= 0;
    write(get("pin"), isPinned ? "Unpin" : "Pin");
    get("pin").setAttribute("aria-pressed", String(isPinned));
    get("pin-order").hidden = !isPinned;
    get("format-of").hidden = signal.isBool;
    if (document.activeElement !== get("format")) get("format").value = watch.formatOf(signal);
    write(get("trend"), signal.isOpen ? "Close trend" : "Trend");
    if (isNew) {
      // To the last digit: confirming it unchanged holds the current value.
      forceValue.value = signal.value === null || signal.isBool ? "" : String(signal.value);
      if (!/^Read-only/.test(get("status").textContent)) say("");
    }
    const isForced = plant.isForcedNow(signal);
    const isLost = !isForced && document.activeElement === get("release");
    get("release").disabled = !isForced;
    if (isLost) views.focus();
  }

  line.begin((...order) => {
    if (order[0] === "DELETE" || !isPast()) change(...order);
  });
  bar.begin({
    say,
    chosen: () => list.chosen,
    when: trigger.wanted,
    wrong(text) {
      trigger.tell(text);
      if (!get("trigger-text").checkVisibility()) say(text && `${text}. The condition is written under Recording.`, true);
    },
    shown() {
      line.show();
      if (list.kind === "forced" || list.kind === "failsafe") list.choose();
      trend.collect();
      sparks.moved();
      analyser.moved();
      head.showLink();
      redraw();
    },
  });
  list.begin({
    chosen(signal) {
      showChosen(signal);
      touch.show();
      trigger.offer();
    },
    force: edit,
    release,
    analyse,
  });
  watch.begin({
    say,
    changed() {
      sets.show();
      list.choose();
      if (list.chosen) showChosen(list.chosen);
    },
    opened: (hasPins) => { if (hasPins !== (list.kind === "pinned")) choose(hasPins ? "pinned" : "all"); },
  });
  sets.begin({
    say, change, isPast,
    forced: () => plant.signals.filter(plant.isForcedNow),
  });
  touch.begin({
    say, canForce, change, pathOf, release,
    force: edit,
    listAll() {
      get("filter").value = "";
      list.filter("");
      choose("all");
    },
  });
  pads.begin({ release });
  analyser.begin({ say, redraw });
  trigger.begin({ say, follow: analyser.follow, stop: analyser.stop, chosen: () => list.chosen });

  get("chosen").addEventListener("submit", (event) => {
    event.preventDefault();
    if (list.chosen && !list.chosen.isBool) force(list.chosen, forceValue.value);
  });
  get("force-way").addEventListener("change", () => showChosen(list.chosen));
  get("force-true").addEventListener("click", () => force(list.chosen, "TRUE"));
  get("force-false").addEventListener("click", () => force(list.chosen, "FALSE"));
  get("release").addEventListener("click", () => release(list.chosen));
  get("trend").addEventListener("click", () => {
    if (list.chosen) list.toggle(list.chosen);
    if (list.chosen?.isOpen) views.reveal("signals");
    showChosen(list.chosen);
  });
  get("analyse").addEventListener("click", () => analyse(list.chosen));
  get("pin").addEventListener("click", () => watch.pin(list.chosen));
  get("pin-up").addEventListener("click", () => list.moveOne(list.chosen, -1));
  get("pin-down").addEventListener("click", () => list.moveOne(list.chosen, 1));
  get("format").addEventListener("change", () => watch.setFormat(list.chosen, get("format").value));
  get("let-go").addEventListener("click", () => {
    list.select(null);
    say("");
    views.focus();
  });

  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const isTyping = event.target.matches?.("input:not([type=range]), select");
    const isTray = get("tray").contains(event.target);
    if (event.key === "Escape" && isTray) {
      views.focus();
    } else if (event.key === "Escape" && event.target === get("filter")) {
      get("filter").value = "";
      list.filter("");
      views.focus();
    } else if (isTyping) {
      return;
    } else if (bar.key(event)) {
      // The bar of time has used it.
    } else if (event.key === "/") {
      views.reveal("signals");
      get("filter").focus();
      get("filter").select();
    } else if (isTray && list.chosen?.isBool && mayForce && (event.key === "1" || event.key === "0")) {
      force(list.chosen, event.key === "1" ? "TRUE" : "FALSE");
    } else if (isTray && event.key === "Delete") {
      release(list.chosen);
    } else {
      return;
    }
    event.preventDefault();
  });

  // Which signals are listed.

  get("filter").addEventListener("input", () => list.filter(get("filter").value));

  function choose(kind) {
    for (const button of get("kinds").children) button.setAttribute("aria-pressed", String(button.dataset.kind === kind));
    list.show(kind);
  }

  get("kinds").addEventListener("click", (event) => {
    const kind = event.target.closest("button")?.dataset.kind;
    if (kind) choose(kind);
  });
  function showAll(kind) {
    get("filter").value = "";
    list.filter("");
    choose(kind);
    views.reveal("signals");
    get("signals").scrollIntoView({ block: "nearest" });
  }

  document.querySelector(".skip").addEventListener("click", () => views.reveal("signals"));
  get("no-tracks").addEventListener("click", (event) => {
    if (!event.target.closest("a")) return;
    event.preventDefault();
    views.reveal("signals");
  });
  // Events.

  const sayForced = head.alarm("forced", "bad", [
    ["show-forced", "Show", () => showAll("forced")],
    ["release-all", "Release all", () => change("DELETE", "/force", undefined, "All signals are released.")],
  ]);
  const sayFailSafe = head.alarm("failsafe", "stale", [["show-failsafe", "Show", () => showAll("failsafe")]]);

  /** Alarms that nobody may overlook. */
  function alarm() {
    const now = { forced: 0, failSafe: 0 };
    const names = [];
    for (const signal of plant.signals) {
      if (plant.isForcedNow(signal)) {
        now.forced += 1;
        const [value] = signal.live;
        if (names.length < 3) names.push(`${signal.name} to ${words.value({ ...signal, value })}${signal.unit ? ` ${signal.unit}` : ""}`);
      } else if (plant.isFailSafeNow(signal)) {
        now.failSafe += 1;
      }
    }
    get("release-all").hidden = !mayForce;
    const further = now.forced > names.length ? ` and ${now.forced - names.length} more` : "";
    sayForced(now.forced ? `${words.count(now.forced, "signal is", "signals are")} forced: ${names.join(", ")}${further}` : "");
    const down = plant.drivers.filter(({ line }) => line && (line.status === "stale" || line.state !== "running"));
    // The view of the line has the reasons itself. The number of an error is for the log.
    const told = views.now === "line" ? [] : down.map(({ name, line: { reason } }) => (plant.drivers.length > 1 ? `${name}: ` : "") + reason.replace(/ \(os error \d+\)/, ""));
    const safe = now.failSafe ? `${words.count(now.failSafe, "signal has its", "signals have their")} fail-safe ${now.failSafe === 1 ? "value" : "values"}` : "";
    get("show-failsafe").hidden = now.failSafe === 0;
    sayFailSafe([safe, told.join("; ")].filter(Boolean).join(": "));
    const isOther = now.forced !== counts.forced || now.failSafe !== counts.failSafe;
    counts = now;
    if (isOther && (list.kind === "forced" || list.kind === "failsafe")) list.choose();
  }

  /** Puts a signal onto the axis, and keeps its row in sight. */
  function analyse(signal) {
    analyser.add(signal);
    // The axis may have taken the place of the signal's row.
    if (signal && signal === list.chosen) list.find(signal, false);
  }

  function renew() {
    const names = plant.drivers.map(({ name }) => name);
    head.title(names.join(" · ") || "tickbus", `${names.join(" · ") || "No driver"} – tickbus`);
    head.count(plant.drivers.length > 1 ? `${plant.drivers.length} drivers` : "");
    // The variables of a run have no address and no direction, and cannot be forced.
    document.body.classList.toggle("only-runs", plant.drivers.length > 0 && plant.drivers.every((driver) => driver.isRun));
    document.body.classList.toggle("is-recording", isRecording());
    get("watch-folder").hidden = get("watch-folder").disabled = !plant.signals.some(({ folder }) => folder);
    list.renew();
    watch.look();
    analyser.renew();
    pictures.load();
    if (!painted) requestAnimationFrame(() => requestAnimationFrame(() => { painted = performance.now(); }));
  }

  let isDue = false;
  /** Redraws after an event, and continuously while something moves. */
  function redraw() {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      views.redraw();
      list.draw();
      alarm();
      pads.redraw();
      bar.redraw();
      analyser.redraw();
      if (list.chosen) showChosen(list.chosen);
      const moves = !isOld && pictures.move();
      touch.show();
      // The bar counts on in the past.
      if (!isOld && (moves || list.isMoving() || analyser.isMoving() || bar.moment)) redraw();
    });
  }

  views.begin({
    shown() {
      if (views.now === "signals" && list.chosen) list.find(list.chosen);
      list.redraw();
      touch.show();
      redraw();
    },
  });

  head.listen({
    may: "may force",
    mayNot: "Open the address that was printed, with its token, to force a signal",
    lost: "No connection to the simulation.",
    tabs: views.tabs,
    link: () => (isRecording() ? ["recording", ""] : bar.moment ? ["paused", "stale"] : null),
    news(text) {
      const heard = plant.hear(text);
      if (!heard) return false;
      if (heard.isOther) renew();
      if (heard.isLine) line.show();
      redraw();
      return true;
    },
    access(isRight, refusal) {
      mayForce = isRight;
      watch.access(isRight);
      if (refusal) say(`Read-only: ${refusal}`);
      else if (get("status").textContent.startsWith("Read-only")) say("");
      redraw();
    },
    age(isNowOld) {
      isOld = isNowOld;
      touch.link(isOld);
      if (!isOld) redraw();
    },
  });

  /** For measurements and tests. */
  window.tickbusPage = {
    get painted() { return painted; },
    get drawn() { return { ...list.drawn }; },
    value: (name) => plant.signals.find((signal) => signal.name === name)?.value,
    signal: (name) => {
      const signal = plant.signals.find((it) => it.name === name);
      return signal && { value: signal.value, raw: signal.raw, edges: signal.edges, isForced: signal.isForced, isFailSafe: signal.isFailSafe, isStale: signal.isStale };
    },
  };
})();
