'use strict';

// Receives the state of the nets and shows it. The page changes nothing.
(() => {
  const get = (id) => document.getElementById(id);
  const SVG = 'http://www.w3.org/2000/svg';
  /** Without a message for this long, the displayed state counts as old. The server sends one twice a second. */
  const PATIENCE = 2500;
  /** Nets that were not scanned for this long are shown as standing still. */
  const STILL = 1500;
  const AGAIN = 1000;
  const FLASH = 1200;
  /** A table of thousands of rows helps nobody. */
  const MOST_ROWS = 500;
  const DISABLED = 0, DELAYED = 1, HELD = 2, READY = 3;
  const NAMES = ['', 'waits', 'held back', 'ready'];

  let views = [];
  let byName = new Map();
  let dots = [];
  let run = null;
  let source = null;
  let heard = 0;
  let isHeld = false;
  let latest = null;

  function text(node, value) {
    if (node.textContent !== value) node.textContent = value;
  }

  function show(node, message) {
    node.hidden = message === '';
    text(node, message);
  }

  function seconds(us, decimals = 3) {
    return us === null ? '–' : `${(us / 1e6).toFixed(decimals)} s`;
  }

  function value(number) {
    if (number === null) return 'not a number';
    return Number.isInteger(number) ? String(number) : String(Number(number.toPrecision(6)));
  }

  function make(kind, classes, content = '') {
    const node = document.createElement(kind);
    if (classes) node.className = classes;
    node.textContent = content;
    return node;
  }

  /** Adds a table's rows of a name and a value; returns the cells of the values. */
  function rows(details, names) {
    const body = details.querySelector('tbody');
    details.hidden = names.length === 0;
    return names.slice(0, MOST_ROWS).map((name) => {
      const row = make('tr');
      const head = make('th', '', name);
      head.scope = 'row';
      const cell = make('td', 'n');
      row.append(head, cell);
      body.append(row);
      return cell;
    });
  }

  class View {
    constructor(net, number) {
      this.net = net;
      const part = get('net').content.cloneNode(true);
      this.section = part.querySelector('section');
      this.find = (selector) => this.section.querySelector(selector);
      this.section.id = `net-${number}`;
      this.title = this.find('h2');
      this.title.textContent = net.name;
      this.title.id = `title-${number}`;
      this.section.setAttribute('aria-labelledby', this.title.id);
      this.mark = make('span', 'tag');
      this.title.append(this.mark);
      const drawing = this.find('.drawing');
      drawing.setAttribute('aria-label', `Drawing of ${net.name}`);
      drawing.innerHTML = net.svg;
      // As a picture it would hide its transitions, which the user can choose here, from screen readers.
      drawing.querySelector('svg').setAttribute('role', 'group');
      this.places = this.nodes('net-place', 'place');
      this.transitions = this.nodes('net-transition', 'transition');
      this.tokens = net.places.map(() => null);
      this.young = net.places.map(() => 0);
      this.phases = net.transitions.map(() => '');
      this.fired = null;
      this.flashes = new Map();
      this.placeCells = rows(this.find('.places'), net.places);
      const reads = new Set(net.transitions.flatMap((one) => one.parts ?? []).map((one) => one.input));
      // Inputs that conditions name are shown beside the transitions.
      const isNamed = net.inputs.some((name) => reads.has(name));
      this.inputCells = rows(this.find('.inputs'), isNamed ? [] : net.inputs);
      this.outputCells = rows(this.find('.outputs'), net.outputs);
      this.rows = net.transitions.slice(0, MOST_ROWS).map((one, t) => this.row(one, t));
      this.transitions.forEach((node, t) => {
        node.tabIndex = 0;
        node.setAttribute('role', 'button');
        node.setAttribute('aria-label', `transition ${net.transitions[t].name}`);
        node.addEventListener('click', () => this.choose(t, this.rows[t]?.row));
        node.addEventListener('keydown', (event) => {
          if (event.key !== 'Enter' && event.key !== ' ') return;
          event.preventDefault();
          this.choose(t, this.rows[t]?.row);
        });
      });
      get('nets').append(part);
    }

    nodes(kind, key) {
      const found = [];
      for (const node of this.section.querySelectorAll(`.${kind}`)) found[Number(node.dataset[key])] = node;
      return found;
    }

    row(one, t) {
      const row = make('tr');
      const head = make('th', 'name');
      head.scope = 'row';
      const button = make('button', '', one.name);
      button.type = 'button';
      button.addEventListener('click', () => this.choose(t, this.transitions[t]));
      head.append(button);
      const phase = make('td', 'phase');
      const waits = make('td');
      const parts = (one.parts ?? []).map((part) => {
        const chip = make('span', 'part', `${part.text} `);
        const is = make('span', 'is');
        chip.append(is);
        waits.append(chip);
        return { chip, is, part, input: part.input === undefined ? -1 : this.net.inputs.indexOf(part.input) };
      });
      const fired = make('td', 'n');
      const last = make('td', 'n');
      row.append(head, phase, waits, fired, last);
      this.find('.transitions tbody').append(row);
      return { row, phase, parts, fired, last };
    }

    /** Marks a transition in drawing and table, and scrolls to it in the other one of the two. */
    choose(t, other) {
      const isChosen = this.rows[t]?.row.classList.contains('chosen');
      this.rows.forEach(({ row }, i) => row.classList.toggle('chosen', i === t && !isChosen));
      this.transitions.forEach((node, i) => node.classList.toggle('net-chosen', i === t && !isChosen));
      if (!isChosen) other?.scrollIntoView({ block: 'nearest', inline: 'nearest' });
    }

    place(p, count, young) {
      if (count === this.tokens[p] && young === this.young[p]) return;
      this.tokens[p] = count;
      this.young[p] = young;
      const node = this.places[p];
      const group = node.querySelector('.net-tokens');
      group.replaceChildren();
      if (count >= dots.length) {
        const number = document.createElementNS(SVG, 'text');
        number.setAttribute('class', 'net-number');
        number.setAttribute('y', '4');
        number.textContent = String(count);
        group.append(number);
      } else {
        for (let i = 0; i < dots[count].length; i += 2) {
          const dot = document.createElementNS(SVG, 'circle');
          dot.setAttribute('class', 'net-dot');
          dot.setAttribute('r', '3.2');
          dot.setAttribute('cx', dots[count][i]);
          dot.setAttribute('cy', dots[count][i + 1]);
          group.append(dot);
        }
      }
      node.classList.toggle('net-young', young > 0);
      if (this.placeCells[p]) text(this.placeCells[p], young > 0 ? `${count}, ${young} too young` : String(count));
    }

    phase(t, phase) {
      if (phase === this.phases[t]) return;
      this.phases[t] = phase;
      const classes = this.transitions[t].classList;
      classes.toggle('net-enabled', phase !== DISABLED);
      classes.toggle('net-delayed', phase === DELAYED);
      classes.toggle('net-held', phase === HELD);
      this.transitions[t].setAttribute('aria-label',
        `transition ${this.net.transitions[t].name}${phase === DISABLED ? '' : `, ${NAMES[phase]}`}`);
      this.rows[t]?.row.classList.toggle('enabled', phase !== DISABLED);
    }

    flash(t, isOn) {
      this.transitions[t].classList.toggle('net-fired', isOn);
      this.rows[t]?.row.classList.toggle('fired', isOn);
    }

    update(state, now) {
      const net = this.net;
      state.tokens.forEach((count, p) => this.place(p, count, state.young[p] ?? 0));
      for (let t = 0; t < net.transitions.length; t++) {
        const phase = Number(state.phases[t]);
        this.phase(t, phase);
        if (this.fired && state.fired[t] > this.fired[t]) {
          this.flashes.set(t, now + FLASH);
          this.flash(t, true);
        }
        const row = this.rows[t];
        if (!row) continue;
        let what = NAMES[phase];
        if (phase === DELAYED) what = t in state.due ? `in ${seconds(Math.max(0, state.due[t] - state.us), 1)}` : 'waits';
        text(row.phase, what);
        text(row.fired, String(state.fired[t]));
        text(row.last, state.last[t] === null ? '' : seconds(state.last[t]));
        // Of a condition in code the page only knows that it does not hold.
        const failed = phase === HELD ? state.failed[t] ?? (row.parts.length === 1 ? 0 : -1) : -1;
        row.parts.forEach((one, i) => this.part(one, i, failed, state));
      }
      this.fired = state.fired;
      this.outputCells.forEach((cell, i) => text(cell, value(state.out[i])));
      this.inputCells.forEach((cell, i) => text(cell, value(state.in[i])));
      const total = state.fired.reduce((sum, count) => sum + count, 0);
      text(this.find('.facts-line'), `time ${seconds(state.us)}, scan ${state.scans}, ${total} firings`);
      show(this.find('.stopped'), state.stop);
      const isStill = state.age !== null && state.age > STILL;
      show(this.find('.age'), isStill ? `Not scanned for ${(state.age / 1000).toFixed(0)} s: this is how it was then.` : '');
      text(this.mark, state.stop ? 'stopped' : state.scans === 0 ? 'not scanned yet' : isStill ? 'stands still' : 'runs');
      this.mark.className = `tag ${state.stop ? 'bad' : state.scans === 0 || isStill ? 'stale' : 'good'}`;
    }

    part({ chip, is, part, input }, i, failed, state) {
      let shown = '';
      if (input >= 0) shown = value(state.in[input]);
      else if (part.place !== undefined) {
        const other = byName.get(part.net);
        const p = other ? other.net.places.indexOf(part.place) : -1;
        if (p >= 0) shown = String(other.tokens[p] ?? 0);
      }
      text(is, shown);
      chip.classList.toggle('holds-back', i === failed);
      chip.classList.toggle('holds', failed >= 0 && i < failed);
    }

    unknown() {
      text(this.mark, 'not scanned yet');
      this.mark.className = 'tag stale';
      text(this.find('.facts-line'), 'nobody has scanned it since this page looks');
    }

    /** Ends what has been highlighted for long enough. */
    fade(now) {
      for (const [t, end] of this.flashes) {
        if (now < end) continue;
        this.flashes.delete(t);
        this.flash(t, false);
      }
    }
  }

  function build(layout) {
    run = layout.run;
    dots = layout.dots;
    document.title = layout.title;
    text(get('title'), layout.title);
    get('nets').replaceChildren();
    views = layout.nets.map((net, number) => new View(net, number));
    byName = new Map(views.map((view) => [view.net.name, view]));
    const jump = get('jump');
    jump.replaceChildren();
    jump.hidden = views.length < 2;
    views.forEach((view) => {
      const link = make('a', '', view.net.name);
      link.href = `#${view.section.id}`;
      jump.append(link);
    });
  }

  function display(state) {
    const now = performance.now();
    let note = '';
    // First the markings of all nets, because conditions look at places of other nets.
    state.nets.forEach((one, i) => one?.tokens.forEach((count, p) => views[i].place(p, count, one.young[p] ?? 0)));
    state.nets.forEach((one, i) => {
      if (!one) {
        views[i].unknown();
        return;
      }
      views[i].update(one, now);
      note = one.note || note;
    });
    show(get('note'), note);
    document.body.dataset.shown = String(Number(document.body.dataset.shown ?? 0) + 1);
  }

  function say(words, kind) {
    text(get('link'), words);
    get('link').className = `tag ${kind}`;
  }

  async function take(state) {
    heard = performance.now();
    latest = state;
    if (state.run !== run) {
      // Another server has started, perhaps with other nets.
      const answer = await fetch('/nets', { signal: AbortSignal.timeout(30000) });
      if (!answer.ok) throw new Error('no nets');
      const layout = await answer.json();
      if (layout.run !== state.run) return;
      build(layout);
      display(state);
    } else if (!isHeld) {
      display(state);
    }
    say(isHeld ? 'held still' : 'live', isHeld ? 'stale' : 'good');
    markOld();
  }

  function markOld() {
    const silent = performance.now() - heard;
    const isOld = heard > 0 && silent > PATIENCE;
    document.body.classList.toggle('is-old', isOld);
    show(get('old'), isOld ? `Nothing heard for ${Math.round(silent / 1000)} s: this is how it was then.` : '');
  }

  function lost() {
    source?.close();
    source = null;
    say('no connection, trying again', 'stale');
    setTimeout(connect, AGAIN);
  }

  function connect() {
    const mine = new EventSource('/events');
    source = mine;
    let isBusy = false;
    mine.onmessage = async (event) => {
      // One at a time: other states arrive while the nets are fetched.
      if (isBusy || mine !== source) return;
      isBusy = true;
      try {
        await take(JSON.parse(event.data));
      } catch {
        if (mine === source) lost();
      } finally {
        isBusy = false;
      }
    };
    mine.onerror = () => {
      if (mine === source) lost();
    };
  }

  get('hold').addEventListener('click', () => {
    isHeld = !isHeld;
    get('hold').setAttribute('aria-pressed', String(isHeld));
    if (!isHeld && latest && latest.run === run) display(latest);
    if (source) say(isHeld ? 'held still' : 'live', isHeld ? 'stale' : 'good');
  });
  get('fit').addEventListener('click', () => {
    const isFit = document.body.classList.toggle('fit');
    get('fit').setAttribute('aria-pressed', String(isFit));
  });
  setInterval(() => {
    const now = performance.now();
    views.forEach((view) => view.fade(now));
    markOld();
  }, 200);
  connect();
})();
