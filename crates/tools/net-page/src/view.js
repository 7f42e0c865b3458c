"use strict";

// The shown net: its drawing with tokens, and its tables.

const netView = (() => {
  const { make, write } = elements;
  const { DISABLED, DELAYED, HELD, seconds, value } = nets;
  const get = (id) => document.getElementById(id);
  const SVG = "http://www.w3.org/2000/svg";
  /** How long a transition that has fired is marked, in milliseconds. */
  const FLASH = 1200;
  /** A table of thousands of rows helps nobody. */
  const MOST_ROWS = 500;
  const NAMES = ["", "delayed", "held back", "ready"];

  /** Adds a table's rows of a name and a value; returns the cells of the values. */
  function rows(details, names) {
    const body = details.querySelector("tbody");
    body.replaceChildren();
    details.hidden = names.length === 0;
    return names.slice(0, MOST_ROWS).map((name) => {
      const row = make("tr", "", body);
      make("th", "", row, name).scope = "row";
      return make("td", "n", row);
    });
  }

  /** Shows a net, in place of the one before. */
  class View {
    constructor(net) {
      this.net = net;
      const { layout } = net;
      write(get("net-title"), net.name);
      // The server has checked it as XML, so it is read as XML.
      const drawing = new DOMParser().parseFromString(layout.svg, "image/svg+xml").documentElement;
      // As a picture it would hide its transitions, which the user can choose here, from screen readers.
      drawing.setAttribute("role", "group");
      get("drawing").replaceChildren(document.importNode(drawing, true));
      get("drawing").setAttribute("aria-label", `Drawing of ${net.name}`);
      this.places = this.nodes("place");
      this.transitions = this.nodes("transition");
      this.tokens = [];
      this.young = [];
      this.phases = [];
      this.fired = null;
      this.flashes = new Map();
      this.placeCells = rows(get("places"), layout.places);
      const reads = new Set(layout.transitions.flatMap((one) => one.parts).map((one) => one.input));
      // Inputs that conditions name are shown beside the transitions.
      const isNamed = layout.inputs.some((name) => reads.has(name));
      this.inputCells = rows(get("inputs"), isNamed ? [] : layout.inputs);
      this.outputCells = rows(get("outputs"), layout.outputs);
      get("transitions").tBodies[0].replaceChildren();
      this.rows = layout.transitions.slice(0, MOST_ROWS).map((one, t) => this.row(one, t));
      this.transitions.forEach((node, t) => {
        node.tabIndex = 0;
        node.setAttribute("role", "button");
        node.setAttribute("aria-label", `transition ${layout.transitions[t].name}`);
        const choose = () => this.choose(t, this.rows[t]?.row);
        node.addEventListener("click", choose);
        node.addEventListener("keydown", (event) => {
          if (event.key !== "Enter" && event.key !== " ") return;
          event.preventDefault();
          choose();
        });
      });
    }

    /** The drawn places or transitions, by their numbers. */
    nodes(kind) {
      const found = [];
      for (const node of get("drawing").querySelectorAll(`[data-${kind}]`)) found[Number(node.dataset[kind])] = node;
      return found;
    }

    row(one, t) {
      const row = make("tr", "", get("transitions").tBodies[0]);
      const head = make("th", "name", row);
      head.scope = "row";
      const button = make("button", "", head, one.name);
      button.type = "button";
      button.addEventListener("click", () => this.choose(t, this.transitions[t]));
      const phase = make("td", "phase", row);
      const waits = make("td", "", row);
      const parts = one.parts.map((part) => {
        const chip = make("span", "part", waits, `${part.text} `);
        return { chip, is: make("span", "is", chip), part };
      });
      return { row, phase, parts, fired: make("td", "n", row), last: make("td", "n", row) };
    }

    /** Marks a transition in drawing and table, and scrolls to it in the other one of the two. */
    choose(t, other) {
      const isChosen = this.rows[t]?.row.classList.contains("chosen");
      this.rows.forEach(({ row }, i) => row.classList.toggle("chosen", i === t && !isChosen));
      this.transitions.forEach((node, i) => node.classList.toggle("net-chosen", i === t && !isChosen));
      if (!isChosen) other?.scrollIntoView({ block: "nearest", inline: "nearest" });
    }

    place(p, count, young) {
      if (count === this.tokens[p] && young === this.young[p]) return;
      this.tokens[p] = count;
      this.young[p] = young;
      if (this.placeCells[p]) write(this.placeCells[p], young > 0 ? `${count}, ${young} too young` : String(count));
      this.places[p]?.classList.toggle("net-young", young > 0);
      const group = this.places[p]?.querySelector(".net-tokens");
      if (!group) return;
      group.replaceChildren();
      const draw = (tag, attributes) => {
        const node = document.createElementNS(SVG, tag);
        for (const [name, set] of Object.entries(attributes)) node.setAttribute(name, set);
        group.append(node);
        return node;
      };
      const dots = count === 0 ? [] : this.net.set.dots[count];
      if (!dots) draw("text", { class: "net-number", y: 4 }).textContent = String(count);
      for (let i = 0; i < dots?.length; i += 2) draw("circle", { class: "net-dot", r: 3.2, cx: dots[i], cy: dots[i + 1] });
    }

    phase(t, phase) {
      if (phase === this.phases[t]) return;
      this.phases[t] = phase;
      this.rows[t]?.row.classList.toggle("enabled", phase !== DISABLED);
      const node = this.transitions[t];
      if (!node) return;
      node.classList.toggle("net-enabled", phase !== DISABLED);
      node.classList.toggle("net-delayed", phase === DELAYED);
      node.classList.toggle("net-held", phase === HELD);
      const { name } = this.net.layout.transitions[t];
      node.setAttribute("aria-label", `transition ${name}${phase === DISABLED ? "" : `, ${NAMES[phase]}`}`);
    }

    flash(t, isOn) {
      this.transitions[t]?.classList.toggle("net-fired", isOn);
      this.rows[t]?.row.classList.toggle("fired", isOn);
    }

    /** Shows the present state of the net. */
    update(now) {
      const { net, net: { state } } = this;
      const [words, kind] = net.mark();
      write(get("net-mark"), words);
      get("net-mark").className = `tag ${kind}`;
      get("net-stop").hidden = !state?.stop;
      write(get("net-stop"), state?.stop ?? "");
      get("net-old").hidden = !net.isStill;
      document.body.classList.toggle("is-still", Boolean(net.isStill));
      if (net.isStill) write(get("net-old"), `Not scanned for ${(net.age / 1000).toFixed(0)} s: this is how it was then.`);
      if (!state) return write(get("net-facts"), "nobody has scanned it since this page looks");
      state.tokens.forEach((count, p) => this.place(p, count, state.young[p] ?? 0));
      net.layout.transitions.forEach((one, t) => {
        const phase = Number(state.phases[t]);
        this.phase(t, phase);
        if (this.fired && state.fired[t] > this.fired[t]) {
          this.flashes.set(t, now + FLASH);
          this.flash(t, true);
        }
        const row = this.rows[t];
        if (!row) return;
        const isDue = phase === DELAYED && t in state.due;
        write(row.phase, isDue ? `in ${seconds(Math.max(0, state.due[t] - state.us), 1)}` : NAMES[phase]);
        write(row.fired, String(state.fired[t]));
        write(row.last, state.last[t] === null ? "" : seconds(state.last[t]));
        const failed = phase === HELD ? one.parts.indexOf(net.partOf(t)) : -1;
        row.parts.forEach(({ chip, is, part }, i) => {
          write(is, net.valueOf(part));
          chip.classList.toggle("holds-back", i === failed);
          chip.classList.toggle("holds", i < failed);
        });
      });
      this.fired = state.fired;
      this.outputCells.forEach((cell, i) => write(cell, value(state.out[i])));
      this.inputCells.forEach((cell, i) => write(cell, value(state.in[i])));
      const total = state.fired.reduce((sum, count) => sum + count, 0);
      write(get("net-facts"), `time ${seconds(state.us)}, scan ${state.scans}, ${total} firings`);
    }

    /** Ends what has been marked for long enough. */
    fade(now) {
      for (const [t, end] of this.flashes) {
        if (now < end) continue;
        this.flashes.delete(t);
        this.flash(t, false);
      }
    }
  }

  return { View };
})();
