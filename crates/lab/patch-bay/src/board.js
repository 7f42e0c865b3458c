'use strict';

// Draws the board: boxes of clients, their pins, and the cables between them. page.js handles clicks and drags.
const board = (() => {
  const clients = document.getElementById('clients');
  const cables = document.getElementById('cables');
  const SVG = 'http://www.w3.org/2000/svg';
  /** Boxes by the names of their clients: { element, shape }. */
  const boxes = new Map();
  /** Pins by their names: { element, value, name, kind, isInput, isAnalog, isOn, connections }. */
  const pins = new Map();
  /** Cables by their inputs. */
  const wires = new Map();

  function element(kind, classes, text) {
    const made = document.createElement(kind);
    made.className = classes;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  function makePin(name, isHere, label) {
    const channel = name.slice(name.indexOf(':') + 1);
    const isInput = /^A?I/.test(channel);
    const isAnalog = channel.startsWith('A');
    const button = element('button', `pin ${isInput ? 'input' : 'output'}${isAnalog ? ' analog' : ''}`);
    button.type = 'button';
    button.dataset.pin = name;
    button.setAttribute('aria-pressed', 'false');
    const value = element('span', 'value');
    button.append(element('span', 'jack'), element('span', 'label', channel));
    if (label) {
      const called = element('span', 'called', label);
      called.title = label;
      button.append(called);
    }
    button.append(value);
    const pin = { element: button, text: value, name, label, channel, isInput, isAnalog, isHere, isOn: false, isForced: false };
    pins.set(name, pin);
    return button;
  }

  function makeBox(client, shape) {
    const box = element('section', client.isHere ? 'client' : 'client away');
    box.dataset.name = client.name;
    box.setAttribute('aria-label', client.name);
    const header = element('header', '');
    const role = client.role === 'VR' ? 'controller' : 'process';
    header.append(element('h2', '', client.name),
      element('p', '', client.isHere ? `${role} at ${client.address}` : 'not here; its cables wait'));
    const sides = element('div', 'sides');
    for (const isInput of [true, false]) {
      const list = element('ul', '');
      for (const { channel, label } of client.channels) {
        if (/^A?I/.test(channel) !== isInput) continue;
        const item = element('li', '');
        item.append(makePin(`${client.name}:${channel}`, client.isHere, label));
        list.append(item);
      }
      sides.append(list);
    }
    box.append(header, sides);
    return { element: box, shape };
  }

  /** All clients: connected ones, and those that only cables remember. */
  function everyone(state) {
    const all = state.clients.map((client) => ({ ...client, isHere: true }));
    const here = new Map(all.map((client) => [client.name, new Set(client.channels.map(({ channel }) => channel))]));
    const away = new Map();
    const missing = [];
    for (const { input, output } of state.connections) {
      for (const pin of [input, output]) {
        const [name, channel] = pin.split(':');
        const channels = here.get(name) ?? away.get(name) ?? new Set();
        if (channels.has(channel)) continue;
        channels.add(channel);
        if (!here.has(name)) away.set(name, channels);
        else missing.push([name, channel]);
      }
    }
    // A cable can remember a channel that its client no longer has.
    const byName = new Map(all.map((client) => [client.name, client]));
    for (const [name, channel] of missing) byName.get(name).channels.push({ channel, value: null, forced: null });
    for (const [name, channels] of away) {
      const list = [...channels].sort((one, other) => one.localeCompare(other, 'en', { numeric: true }));
      all.push({ name, isHere: false, channels: list.map((channel) => ({ channel, value: null, forced: null })) });
    }
    return all;
  }

  /** The level that inputs derive from a pin: on above 8 V, off below 5 V, unchanged in between. */
  function isOn(pin, value) {
    if (value === null) return false;
    const number = Number(value);
    if (pin.isAnalog) return Boolean(number);
    return number > 8 || (number >= 5 && pin.isOn);
  }

  function describe(pin, value, own, sources) {
    const called = pin.label ? `${pin.label}, ` : '';
    const parts = [`${called}${pin.name} ${pin.isAnalog ? 'analog' : 'digital'} ${pin.isInput ? 'input' : 'output'}`];
    parts.push(!pin.isHere ? 'not here' : value === null ? 'no value yet' : value);
    if (pin.isForced) parts.push(own === null ? 'forced' : `forced, its client says ${own}`);
    if (sources) parts.push(`connected with ${sources.join(' and ')}`);
    return parts.join(', ');
  }

  function show(state) {
    const focused = document.activeElement;
    const focusedPin = focused?.dataset?.pin;
    const focusedCable = focused?.closest?.('g.cable')?.dataset.input;
    const all = everyone(state);
    const names = new Set(all.map((client) => client.name));
    let isMoved = false;
    for (const [name, box] of boxes) {
      if (names.has(name)) continue;
      forget(name, box);
      isMoved = true;
    }
    all.forEach((client, place) => {
      const shape = JSON.stringify([client.isHere, client.role, client.address, client.channels.map((it) => [it.channel, it.label])]);
      let box = boxes.get(client.name);
      if (!box || box.shape !== shape) {
        if (box) forget(client.name, box);
        box = makeBox(client, shape);
        boxes.set(client.name, box);
        clients.insertBefore(box.element, clients.children[place] || null);
        isMoved = true;
      } else if (clients.children[place] !== box.element) {
        clients.insertBefore(box.element, clients.children[place] || null);
        isMoved = true;
      }
    });
    const partners = new Map();
    for (const { input, output } of state.connections) {
      partners.set(input, [output]);
      partners.set(output, [...(partners.get(output) || []), input]);
    }
    for (const client of all) {
      for (const { channel, value, forced } of client.channels) {
        const pin = pins.get(`${client.name}:${channel}`);
        const shown = forced ?? value;
        pin.isForced = forced !== null;
        pin.isOn = isOn(pin, shown);
        pin.value = shown;
        const own = pin.isForced && !pin.isInput && value !== forced ? value : null;
        const behind = own === null ? '' : ` (${own})`;
        setText(pin.text, pin.isForced ? `${forced} forced${behind}` : shown ?? '–');
        pin.element.classList.toggle('on', pin.isOn);
        pin.element.classList.toggle('forced', pin.isForced);
        setAttribute(pin.element, 'aria-label', describe(pin, shown, own, partners.get(pin.name)));
      }
    }
    showCables(state.connections, isMoved);
    // The focused element may have been moved or rebuilt; if its cable is gone, focus the input.
    const next = pins.get(focusedPin)?.element ?? wires.get(focusedCable)?.group ?? pins.get(focusedCable)?.element;
    if (next && document.activeElement !== next) next.focus({ preventScroll: true });
  }

  function setAttribute(node, name, text) {
    if (node.getAttribute(name) !== text) node.setAttribute(name, text);
  }

  function setText(node, text) {
    if (node.textContent !== text) node.textContent = text;
  }

  function forget(name, box) {
    box.element.remove();
    boxes.delete(name);
    for (const pin of pins.keys()) if (pin.startsWith(`${name}:`)) pins.delete(pin);
  }

  function showCables(connections, isMoved) {
    const inputs = new Set(connections.map(({ input }) => input));
    let isChanged = isMoved;
    for (const [input, wire] of wires) {
      if (inputs.has(input)) continue;
      wire.group.remove();
      wires.delete(input);
    }
    for (const { input, output, awake } of connections) {
      let wire = wires.get(input);
      if (!wire || wire.output !== output) {
        if (wire) wire.group.remove();
        wire = makeCable(input, output);
        isChanged = true;
      }
      const source = pins.get(output);
      const classes = wire.group.classList;
      classes.toggle('analog', source.isAnalog);
      classes.toggle('on', source.isOn);
      classes.toggle('asleep', !awake);
    }
    if (isChanged) draw();
  }

  function makeCable(input, output) {
    const group = document.createElementNS(SVG, 'g');
    group.setAttribute('class', 'cable');
    group.dataset.input = input;
    group.setAttribute('tabindex', '0');
    group.setAttribute('role', 'button');
    group.setAttribute('aria-label', `Cable from ${output} to ${input}; Delete cuts it`);
    const paths = ['wire', 'grip'].map((kind) => {
      const path = document.createElementNS(SVG, 'path');
      path.setAttribute('class', kind);
      group.append(path);
      return path;
    });
    cables.append(group);
    const wire = { group, paths, input, output };
    wires.set(input, wire);
    return wire;
  }

  /** The middle of a pin's jack, on the board. */
  function place(pin) {
    const origin = cables.getBoundingClientRect();
    const jack = pin.element.querySelector('.jack').getBoundingClientRect();
    return [jack.left + jack.width / 2 - origin.left, jack.top + jack.height / 2 - origin.top];
  }

  /** A cable that hangs from an output's right to an input's left; `low` is a height that it must pass. */
  function curve([x1, y1], [x2, y2], low) {
    const width = cables.clientWidth;
    const reach = Math.max(28, Math.min(120, Math.abs(x2 - x1) / 2));
    // A cable back to the left, to another row of boxes, would hook around its end.
    const sag = x2 > x1 ? Math.min(70, Math.hypot(x2 - x1, y2 - y1) / 7) : 0;
    const out = Math.min(x1 + reach, width + 14);
    const back = Math.max(x2 - reach, -14);
    // At the middle of a cubic curve, each end has an eighth of the weight.
    const [down, up] = low === undefined ? [y1 + sag, y2 + sag] : [0, 0].fill((8 * low - y1 - y2) / 6);
    return `M${x1},${y1} C${out},${down} ${back},${up} ${x2},${y2}`;
  }

  /** The height below the boxes of two pins if the cable goes back to the left in one row: otherwise it would cross them. */
  function below(source, sink) {
    const [from, to] = [source, sink].map((pin) => pin.element.closest('.client').getBoundingClientRect());
    const isBack = to.left <= from.left && to.top < from.bottom && from.top < to.bottom;
    return isBack ? Math.max(from.bottom, to.bottom) + 14 - cables.getBoundingClientRect().top : undefined;
  }

  function draw() {
    // Read the whole layout before writing anything, which would force a new layout.
    const lines = [...wires.values()].map(({ paths, input, output }) => {
      const [source, sink] = [pins.get(output), pins.get(input)];
      return [paths, curve(place(source), place(sink), below(source, sink))];
    });
    for (const [paths, line] of lines) for (const path of paths) setAttribute(path, 'd', line);
  }

  const loose = document.createElementNS(SVG, 'path');
  loose.setAttribute('class', 'pending');

  /** Draws the cable that is being dragged, from a pin to a point of the window. */
  function drag(pin, x, y) {
    const origin = cables.getBoundingClientRect();
    const from = place(pin);
    const to = [x - origin.left, y - origin.top];
    loose.setAttribute('d', pin.isInput ? curve(to, from) : curve(from, to));
    cables.append(loose);
  }

  /** Marks the channels whose client, channel or label has all words of `text`; returns them in the order of the page. */
  function search(text) {
    const words = text.toLowerCase().split(/\s+/).filter(Boolean);
    const found = [];
    for (const pin of pins.values()) {
      const names = `${pin.name} ${pin.label ?? ''}`.toLowerCase();
      const isFound = words.every((word) => names.includes(word));
      pin.element.classList.toggle('beside', !isFound);
      if (isFound && words.length) found.push(pin);
    }
    const isBefore = (one, other) => one.element.compareDocumentPosition(other.element) & Node.DOCUMENT_POSITION_FOLLOWING;
    return found.sort((one, other) => (isBefore(one, other) ? -1 : 1));
  }

  new ResizeObserver(draw).observe(clients);

  return { show, search, setAttribute, drag, drop: () => loose.remove(), pins, wires, clients, cables };
})();
