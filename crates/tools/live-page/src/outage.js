"use strict";

// The way from the PLC to the machine as a picture: what is broken, since when, what to do, and the last events.

const outage = (() => {
  const { make, write } = elements;
  const MARKS = { good: "✓", bad: "✕", unknown: "?" };
  const shown = new Set();

  /** The names of the boxes; the driver's own end is the last one. */
  function names(driver) {
    if (driver.role === "controller") return ["Machine", "Cable", "Driver", "PLC program"];
    return ["PLC", "Cable", "Driver", driver.role === "observer" ? "Program" : "Machine"];
  }

  /** Makes the picture of a driver's line; a run on virtual time and a recording have none. */
  function card(driver, parent) {
    if (driver.isRun || driver.isRecording) return null;
    const row = make("ol", "way", parent);
    row.setAttribute("aria-label", "The way to the machine");
    const boxes = names(driver).map((name) => {
      const it = make("li", "", row);
      const mark = make("span", "mark", it);
      mark.setAttribute("aria-hidden", "true");
      make("strong", "", it, name);
      return { it, mark, text: make("span", "note", it) };
    });
    const told = make("p", "told", parent);
    told.setAttribute("role", "status");
    // It counts every second: nothing to read aloud each time.
    const next = make("p", "note next", parent);
    next.setAttribute("role", "timer");
    const more = make("details", "events", parent);
    make("summary", "", more, "Last events");
    return { driver, boxes, told, next, more, list: make("ol", "", more), line: null, key: "" };
  }

  /** The line as it failed, while another attempt is under way: the picture does not change with each attempt. */
  function beneath(line) {
    const before = line.events.filter(({ kind }) => !kind.startsWith("fault")).at(-2);
    const isRetry = line.state === "opening" && line.cause === "waiting" && before?.kind === "failed";
    return isRetry ? { ...line, state: "failed", cause: before.cause, reason: before.text } : line;
  }

  /** Which box is broken, what is said there, what has happened and what to do. */
  function diagnose(driver, line) {
    const [peer, , , own] = names(driver);
    const the = peer === "PLC" ? "The PLC" : "The machine";
    const them = `the ${peer === "PLC" ? "PLC" : "machine"}`;
    // A line with several stations may have several.
    const [address] = (line.address ?? "").split(" ");
    const port = /:(\d+)$/.exec(address)?.[1];
    const check = line.end === "client"
      ? `Start ${them}, or look with “tickbus doctor”.`
      : `Look at cable, switch and ${peer}; “tickbus doctor” looks at each step.`;
    if (plant.isSilent(line)) return { at: 3, word: "does not tick", what: `The ${own === "Machine" ? "simulation" : "program"} does not tick`, act: "Look at the program: it waits, hangs or has ended.", isOwn: true };
    if (line.state === "running" && line.status !== "stale") return null;
    switch (line.cause) {
      case "injected": return { at: 1, word: "fault injected", what: "An injected fault holds the line down", act: "End the fault, or wait until it is over." };
      case "defect": case "hung": return { at: 2, word: line.cause, what: "The driver is stuck", act: "Close the driver and open it again; the reason is above." };
      case "closed": case "not-opened": return { at: 2, word: "closed", what: "The driver is not open", act: "Start the simulation." };
      case "stopped": return { at: 0, word: "in STOP", what: `${the} does not run its program`, act: `Switch ${them} to RUN.` };
      case "frozen": return { at: 0, word: "frozen", what: `${the} sends the same values again and again`, act: "Look whether its program runs, and sets its life sign." };
      case "left": return { at: 0, word: "has left", isApart: true, what: `${the} has closed the connection`, act: line.end === "client" ? check : "Nothing to do here if it restarts; it may connect again at any time." };
      case "refused": return { at: 0, word: "refuses", what: `${the} refuses what the driver asks for`, act: "Compare its settings with driver.cfg; “tickbus doctor” names the difference." };
      case "protocol": return { at: 0, word: "not understood", what: `${the} does not keep to the protocol`, act: "Is it the right device, port and kind of bus? “tickbus doctor” looks." };
    }
    if (line.end === "server" && line.state === "failed") return { at: 2, word: "cannot listen", what: "The driver cannot listen", act: "Correct the address in driver.cfg, or end the program that has the port." };
    if (line.state === "opening" && line.end === "server") {
      if (line.has_run) return { at: 0, word: "not here", isApart: true, what: line.cause === "waiting" ? `${the} has not come back yet` : `The connection with ${them} broke`, act: `Look at cable and ${peer}; ${them} may connect again at any time.` };
      const where = port ? ` to port ${port}` : "";
      const isNear = /^(127\.|localhost|\[::1\])/.test(address);
      const host = /^(0\.0\.0\.0|\[::\])/.test(address) || !address ? "the address of this computer" : address.replace(/:\d+$/, "");
      const enter = `Enter ${host}${port ? ` and port ${port}` : ""} as server in the PLC (in its I/O scanner, for example).`;
      const near = isNear ? " Only programs on this computer reach this address: for a PLC on the network write 0.0.0.0 into driver.cfg." : "";
      return { at: 0, word: "has not come yet", isApart: true, what: `No ${peer === "PLC" ? "PLC" : "machine"} has connected${where} yet`, act: peer === "PLC" ? enter + near : "Start it." };
    }
    if (line.end === "client" && line.cause === "link") {
      return { at: 0, word: "no reply", isApart: true, what: `Nothing answers${address ? ` at ${address}` : ""}`, act: check };
    }
    if (line.cause === "silent" || line.status === "stale" && line.state === "running") return { at: 1, word: "silent", what: `Nothing comes from ${them} any more`, act: check };
    if (line.state === "opening") return { at: 1, word: "not up yet", what: "The line is not up yet", act: check };
    return { at: 1, word: "broken", what: "The line is broken", act: check };
  }

  /** What an event was, for people. */
  function eventName(event, before) {
    switch (event.kind) {
      case "running": return "connected";
      case "stale": return event.cause === "silent" ? "silent" : event.cause;
      case "failed": return event.times > 1 ? `${event.times} tries failed` : before?.kind === "opening" ? "try failed" : "lost";
      case "opening": return event.cause !== "waiting" ? "lost" : before?.kind === "failed" ? "retry" : "waiting";
      case "closed": return "closed";
      case "settings": return "changed settings";
      case "fault": return "fault injected";
      default: return "fault over";
    }
  }

  /** The time of something that happened `ago` milliseconds before the line was told. */
  function clock(own, ago) {
    const { driver, line } = own;
    // A line opens before the first tick.
    if (line.isPast) return words.moment(Math.max(0, driver.moment.ms - ago));
    // To the second, so that the same moment always has the same text.
    return new Date(own.heard - ago).toLocaleTimeString("en-GB");
  }

  /** How long ago the trouble began: the first event after the line last ran, since retries are the same trouble. */
  function begun(line) {
    const events = line.events.filter(({ kind }) => !/^(fault|settings)/.test(kind));
    const up = events.findLastIndex(({ kind }) => kind === "running");
    return events[up + 1]?.first_ms ?? line.since_ms;
  }

  function showNext(own) {
    const { line, next } = own;
    const left = line?.next_ms === undefined || line.isPast ? NaN : line.next_ms - (performance.now() - line.heard);
    next.hidden = Number.isNaN(left);
    write(next, left > 0 ? `Next try in ${Math.ceil(left / 1000)} s` : "Trying now");
  }

  function showEvents(own) {
    const { line, list } = own;
    own.more.hidden = !line.events.length;
    const rows = line.events.map((event, i) => {
      const before = line.events.slice(0, i).findLast(({ kind }) => !/^(fault|settings)/.test(kind));
      return [clock(own, event.ago_ms), eventName(event, before), event.text];
    }).reverse();
    const key = JSON.stringify(rows);
    if (own.key === key) return;
    own.key = key;
    list.replaceChildren();
    for (const [time, name, text] of rows) {
      const it = make("li", "", list);
      make("time", "", it, time);
      make("strong", "", it, name);
      make("span", "note", it, text);
    }
  }

  /** Shows the line of a driver, which is another object after each connection, at the moment that the page shows. */
  function show(own, line, driver) {
    if (!own) return;
    own.driver = driver;
    if (line.heard !== own.line?.heard) own.heard = Date.now();
    own.line = { ...line, events: line.events ?? [] };
    line = own.line;
    const wrong = diagnose(own.driver, beneath(line));
    own.boxes.forEach(({ it, mark, text }, i) => {
      // Of what lies behind the break nothing is known, nor of the cable to a PLC that is not there.
      const isKnown = !wrong || i > wrong.at && !(wrong.isApart && i === 1) || wrong.isOwn;
      const look = i === wrong?.at ? "bad" : isKnown ? "good" : "unknown";
      it.className = look;
      write(mark, MARKS[look]);
      write(text, look === "bad" ? wrong.word : look === "good" ? "works" : "not known");
    });
    own.told.hidden = !wrong;
    const since = wrong ? clock(own, wrong.isOwn ? line.silence_ms : begun(line)) : "";
    // The text stays the same during an outage, so that it is read aloud once.
    if (!line.isPast && wrong?.what !== own.what) Object.assign(own, { what: wrong?.what, since });
    if (wrong) write(own.told, `${wrong.what}, since ${line.isPast ? since : own.since}. ${wrong.act}`);
    else write(own.told, "");
    // Once open, it stays as the viewer has it.
    if (wrong && !own.wasWrong && !own.more.open) own.more.open = matchMedia("(min-width: 641px)").matches;
    own.wasWrong = Boolean(wrong);
    showNext(own);
    showEvents(own);
    shown.add(own);
  }

  setInterval(() => {
    for (const own of shown) {
      if (!own.told.isConnected) shown.delete(own);
      else if (!document.body.classList.contains("is-old")) showNext(own);
    }
  }, 250);

  return { card, show };
})();
