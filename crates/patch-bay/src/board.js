'use strict';

// Draws the board: boxes of clients, their pins, and the cables between them. What happens when one is touched is
// page.js's work.
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

  function makePin(name, isHere) {
    const channel = name.slice(name.indexOf(':') + 1);
    const isInput = /^A?I/.test(channel);
    const isAnalog = channel.startsWith('A');
    const button = element('button', `pin ${isInput ? 'input' : 'output'}${isAnalog ? ' analog' : ''}`);
    button.type = 'button';
    button.dataset.pin = name;
    button.setAttribute('aria-pressed', 'false');
    const value = element('span', 'value');
    button.append(element('span', 'jack'), element('span', 'label', channel), value);
    const pin = { element: button, text: value, name, channel, isInput, isAnalog, isHere, isOn: false, isForced: false };
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
      for (const { channel } of client.channels) {
        if (/^A?I/.test(channel) !== isInput) continue;
        const item = element('li', '');
        item.append(makePin(`${client.name}:${channel}`, client.isHere));
        list.append(item);
      }
      sides.append(list);
    }
    box.append(header, sides);
    return { element: box, shape };
  }

  /** All clients: those that are here, and those that only cables remember. */
  function everyone(state) {
    const all = state.clients.map((client) => ({ ...client, isHere: true }));
    const here = new Set(all.map((client) => client.name));
    const away = new Map();
    for (const { input, output } of state.connections) {
      for (const pin of [input, output]) {
        const [name, channel] = pin.split(':');
        if (here.has(name)) continue;
        if (!away.has(name)) away.set(name, new Set());
        away.get(name).add(channel);
      }
    }
    for (const [name, channels] of away) {
      const list = [...channels].sort((one, other) => one.localeCompare(other, 'en', { numeric: true }));
      all.push({ name, isHere: false, channels: list.map((channel) => ({ channel, value: null, forced: null })) });
    }
    // A cable may remember a channel that its client no longer has.
    for (const client of all) {
      const has = new Set(client.channels.map(({ channel }) => channel));
      for (const { input, output } of state.connections) {
        for (const pin of [input, output]) {
          const [name, channel] = pin.split(':');
          if (name === client.name && !has.has(channel)) {
            has.add(channel);
            client.channels.push({ channel, value: null, forced: null });
          }
        }
      }
    }
    return all;
  }

  /** What the inputs of a pin get: volts above 8 are on, below 5 off, and between them it stays. */
  function isOn(pin, value) {
    if (value === null) return false;
    const number = Number(value);
    if (pin.isAnalog) return number !== 0;
    return number > 8 || (number >= 5 && pin.isOn);
  }

  function describe(pin, value, sources) {
    const parts = [`${pin.name} ${pin.isAnalog ? 'analog' : 'digital'} ${pin.isInput ? 'input' : 'output'}`];
    parts.push(!pin.isHere ? 'not here' : value === null ? 'no value yet' : value);
    if (pin.isForced) parts.push('forced');
    if (sources) parts.push(`connected with ${sources.join(' and ')}`);
    return parts.join(', ');
  }

  function show(state) {
    const all = everyone(state);
    const names = new Set(all.map((client) => client.name));
    let isMoved = false;
    for (const [name, box] of boxes) {
      if (names.has(name)) continue;
      forget(name, box);
      isMoved = true;
    }
    all.forEach((client, place) => {
      const shape = JSON.stringify([client.isHere, client.role, client.address, client.channels.map((it) => it.channel)]);
      let box = boxes.get(client.name);
      if (!box || box.shape !== shape) {
        const focused = box && box.element.contains(document.activeElement) && document.activeElement.dataset.pin;
        if (box) forget(client.name, box);
        box = makeBox(client, shape);
        boxes.set(client.name, box);
        clients.insertBefore(box.element, clients.children[place] || null);
        if (focused && pins.has(focused)) pins.get(focused).element.focus();
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
        const own = pin.isForced && !pin.isInput && value !== null && value !== forced ? ` (${value})` : '';
        setText(pin.text, pin.isForced ? `${forced} forced${own}` : shown ?? '–');
        pin.element.classList.toggle('on', pin.isOn);
        pin.element.classList.toggle('forced', pin.isForced);
        const label = describe(pin, shown, partners.get(pin.name));
        if (pin.element.getAttribute('aria-label') !== label) pin.element.setAttribute('aria-label', label);
      }
    }
    showCables(state.connections, isMoved);
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
      wire.group.setAttribute('class',
        `cable${source.isAnalog ? ' analog' : ''}${source.isOn ? ' on' : ''}${awake ? '' : ' asleep'}`);
    }
    if (isChanged) draw();
  }

  function makeCable(input, output) {
    const group = document.createElementNS(SVG, 'g');
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

  /** A cable that hangs from an output, on its right, to an input, on its left. */
  function curve([x1, y1], [x2, y2]) {
    const width = cables.clientWidth;
    const reach = Math.max(28, Math.min(120, Math.abs(x2 - x1) / 2));
    const sag = Math.min(40, Math.hypot(x2 - x1, y2 - y1) / 8);
    const out = Math.min(x1 + reach, width + 14);
    const back = Math.max(x2 - reach, -14);
    return `M${x1},${y1} C${out},${y1 + sag} ${back},${y2 + sag} ${x2},${y2}`;
  }

  function draw() {
    for (const { paths, input, output } of wires.values()) {
      const line = curve(place(pins.get(output)), place(pins.get(input)));
      for (const path of paths) path.setAttribute('d', line);
    }
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

  new ResizeObserver(draw).observe(clients);

  return { show, drag, drop: () => loose.remove(), pins, wires, clients, cables };
})();
