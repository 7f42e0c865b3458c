"use strict";

// The line of each driver: its state in the words of the log, its stations, faults, times and counters.

const line = (() => {
  const { make, write } = elements;
  const box = document.getElementById("drivers");
  let cards = new Map();
  /** Requests a change: `(method, path, body, done)`. */
  let change = () => {};

  /** The colour of a state. */
  const colour = { running: "good", stale: "stale", failed: "bad", opening: "stale", closed: "gap" };

  function card(driver) {
    const it = make("article", "driver", box);
    const head = make("header", "", it);
    const state = make("span", "tag", head);
    const name = make("h3", "", head, driver.name);
    make("span", "note", head, `${driver.kind}, ${driver.role}`);
    const reason = make("p", "reason", it);
    // Beside the picture, which says it without chatter, only a run's reason is read aloud.
    if (driver.isRun) reason.setAttribute("role", "status");
    const since = make("p", "note since", it);
    const way = outage.card(driver, it);
    const faults = make("ul", "faults", it);
    const model = modelFaults(driver, it);
    const facts = make("dl", "facts", it);
    const stations = make("table", "stations", make("div", "wide", it));
    const more = make("details", "", it);
    make("summary", "", more, "Times, counters and what the bus knows");
    const times = make("table", "times", make("div", "wide", more));
    const texts = make("table", "texts", make("div", "wide", more));
    const counters = make("table", "counters", make("div", "wide", more));
    return { it, state, name, reason, since, way, faults, model, facts, stations, more, times, texts, counters };
  }

  /** The tools that give the simulation's model one of its faults. */
  function modelFaults(driver, parent) {
    const form = make("form", "tools model", parent);
    const label = make("label", "", form, "Fault of the model ");
    const name = make("select", "", label);
    const value = make("input", "", make("label", "", form, "value "));
    value.type = "text";
    value.inputMode = "decimal";
    value.size = 6;
    value.value = "1";
    make("button", "", form, "Inject");
    const end = make("button", "", form, "End");
    end.type = "button";
    const path = () => `/fault/${driver.id}/${encodeURIComponent(name.value)}`;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const number = value.value.trim().replace(",", ".");
      change("PUT", path(), number, `${name.value} is ${number}.`);
    });
    end.addEventListener("click", () => change("DELETE", path(), undefined, `${name.value} is over.`));
    form.hidden = true;
    return { form, name, key: "" };
  }

  function showModelFaults({ model }, names) {
    model.form.hidden = !names.length;
    const key = names.join("\n");
    if (model.key === key) return;
    model.key = key;
    model.name.replaceChildren(...names.map((name) => new Option(name)));
  }

  /** Fills a table with rows of cells, and touches only cells that differ. */
  function fill(table, head, rows) {
    const shape = `${rows.length}/${rows[0]?.length ?? 0}`;
    if (table.dataset.shape !== shape) {
      table.dataset.shape = shape;
      table.replaceChildren();
      table.hidden = rows.length === 0;
      if (!rows.length) return;
      if (head.length) {
        const titles = make("tr", "", make("thead", "", table));
        head.forEach((title, i) => make("th", i ? "n" : "", titles, title).setAttribute("scope", "col"));
      }
      const body = make("tbody", "", table);
      for (const cells of rows) {
        const row = make("tr", "", body);
        cells.forEach((_, i) => {
          const cell = make(i ? "td" : "th", i ? "n" : "", row);
          if (!i) cell.setAttribute("scope", "row");
        });
      }
    }
    rows.forEach((cells, i) => cells.forEach((cell, j) => write(table.tBodies[0].rows[i].cells[j], cell)));
  }

  const figures = (number) => (Number.isInteger(number) ? words.whole(number) : String(number));
  const byName = ([a], [b]) => (a < b ? -1 : 1);

  function facts(card, line) {
    const times = line.times ?? {};
    const shown = (line.facts ?? []).map(([title, value]) => [title, value, ""]);
    const age = Math.max(-1, ...line.stations.map((station) => station.age_ms ?? -1));
    if (age >= 0) shown.push(["Age of data", words.span(age), line.stations.some(({ stale }) => stale) ? "warn" : "good"]);
    if (times.exchange?.count) shown.push(["Exchange, p50", words.fine(times.exchange.p50_us), ""]);
    if (times.bus_cycle?.count) shown.push(["Bus cycle, p50", words.fine(times.bus_cycle.p50_us), ""]);
    if (line.tick) shown.push(["Ticks", figures(line.tick), plant.isSilent(line) ? "bad" : ""]);
    if (card.facts.children.length !== shown.length) {
      card.facts.replaceChildren();
      for (const [title] of shown) {
        const it = make("div", "", card.facts);
        make("dt", "", it, title);
        make("dd", "", it);
      }
    }
    shown.forEach(([title, value, look], i) => {
      const it = card.facts.children[i];
      write(it.children[0], title);
      write(it.children[1], value);
      it.className = look;
    });
  }

  function faults(card, list) {
    const key = JSON.stringify(list);
    if (card.faults.dataset.key === key) return;
    card.faults.dataset.key = key;
    card.faults.hidden = !list.length;
    card.faults.replaceChildren();
    for (const fault of list) {
      const it = make("li", "", card.faults);
      make("span", fault.phase === "active" ? "tag fault" : "tag", it, fault.phase);
      make("span", "", it, ` ${fault.name.startsWith("forced: ") ? fault.what : `${fault.name || fault.kind}: ${fault.what}`}`);
    }
  }

  /** Milliseconds since the line was last heard of, for figures that count on between messages. */
  const since = (line) => line.since_ms + (line.isPast ? 0 : performance.now() - line.heard);

  function show() {
    if (cards.size !== plant.drivers.length || plant.drivers.some(({ id }) => !cards.has(id))) {
      box.replaceChildren();
      cards = new Map(plant.drivers.map((driver) => [driver.id, card(driver)]));
    }
    for (const driver of plant.drivers) {
      const line = plant.lineOf(driver);
      const own = cards.get(driver.id);
      if (!line) continue;
      // A line can run with stale data while the PLC is in STOP.
      const isStale = line.status === "stale" && line.state === "running";
      const state = isStale ? "stale" : line.state;
      write(own.name, driver.name);
      write(own.state, state);
      own.state.className = `tag ${colour[state] ?? ""}`;
      own.it.classList.toggle("trouble", state !== "running");
      write(own.reason, line.reason || "no reason known");
      write(own.since, `${line.since_ms === undefined ? "" : `for ${words.span(since(line))}, `}cause ${line.cause}, data ${line.status}${plant.isSilent(line) ? `; the simulation has not ticked for ${words.span(line.silence_ms)}` : ""}`);
      outage.show(own.way, line, driver);
      if (driver.isRecording) write(own.since, `data ${line.status}`);
      // A forced value that was released is no longer worth a row.
      faults(own, (line.faults ?? []).filter(({ name, phase }) => phase !== "over" || !name.startsWith("forced: ")));
      showModelFaults(own, line.model_faults ?? []);
      facts(own, line);
      const { isRun } = driver;
      const several = line.stations.length > 1 || isRun ? line.stations : [];
      if (isRun) fill(own.stations, ["Client", "State", "Reason"], several.map((it) => [it.name, it.state, it.reason]));
      else fill(own.stations, ["Station", "State", "Age", "Reason"], several.map((it) => [it.name, it.stale ? "stale" : it.state, words.span(it.age_ms), it.reason ?? ""]));
      if (!own.more.open) continue;
      const times = Object.entries(line.times ?? {}).filter(([, it]) => it.count);
      fill(own.times, ["Time", "p50", "p99", "max", "count"], times.sort(byName).map(([name, it]) => [name.replaceAll("_", " "), words.fine(it.p50_us), words.fine(it.p99_us), words.fine(it.max_us), figures(it.count)]));
      fill(own.texts, [], Object.entries(line.texts ?? {}).sort(byName));
      fill(own.counters, ["Counter", "so far"], Object.entries(line.counters ?? {}).sort(byName).map(([name, it]) => [name, figures(it)]));
    }
  }

  /** Sets the way to change something. */
  function begin(way) {
    change = way;
  }

  box.addEventListener("toggle", show, true);
  return { begin, show };
})();
