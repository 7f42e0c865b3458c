'use strict';

// Draws the board: boxes of clients, their channels, frames of groups, and the cables between them.
const board = (() => {
  const clients = document.getElementById('clients');
  const cables = document.getElementById('cables');
  const frames = document.getElementById('frames');
  const sheet = document.getElementById('sheet');
  const SVG = 'http://www.w3.org/2000/svg';
  /** On a narrow screen boxes are in one column. */
  const narrow = matchMedia('(max-width: 640px)');
  /** The space around all boxes. */
  const MARGIN = { x: 54, y: 56 };
  /** Boxes by the names of their clients: { element, title, isFolded, pins }. */
  const boxes = new Map();
  /** Drawn channels by their names: { element, text }. */
  const drawn = new Map();
  /** Drawn cables by their inputs: { group, paths, input, output }. */
  const wires = new Map();
  /** Boxes that are being dragged: their places. */
  const dragged = new Map();
  let words = [];
  let isDue = false;

  function element(kind, classes, text) {
    const made = document.createElement(kind);
    made.className = classes;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  function setAttribute(node, name, text) {
    if (node.getAttribute(name) !== text) node.setAttribute(name, text);
  }

  function setText(node, text) {
    if (node.textContent !== text) node.textContent = text;
  }

  function makePin(pin) {
    const button = element('button', `pin ${pin.isInput ? 'input' : 'output'}${pin.isAnalog ? ' analog' : ''}`);
    button.type = 'button';
    button.dataset.pin = pin.name;
    button.setAttribute('aria-pressed', 'false');
    const value = element('span', 'value');
    // The blanks keep the words apart for those who listen.
    button.append(element('span', 'jack'), element('span', 'label', pin.channel), ' ');
    if (pin.label) {
      const called = element('span', 'called', pin.label);
      called.title = pin.label;
      button.append(called, ' ');
    }
    button.append(value);
    drawn.set(pin.name, { element: button, text: value });
    return button;
  }

  function makeBox(client) {
    const isFolded = lab.isFolded(client.name);
    const box = element('section', client.isHere ? 'client' : 'client away');
    const pins = [...client.inputs, ...client.outputs];
    box.classList.toggle('named', pins.some(({ label }) => label));
    box.classList.toggle('folded', isFolded);
    box.dataset.name = client.name;
    box.setAttribute('aria-label', client.name);
    const header = element('header', '');
    const role = client.role === 'VR' ? 'controller' : 'process';
    const title = element('button', 'title', client.name);
    title.type = 'button';
    title.setAttribute('aria-expanded', String(!isFolded));
    title.setAttribute('aria-describedby', 'title-help');
    const heading = element('h2', '');
    heading.append(title);
    header.append(heading, element('p', '', client.isHere ? `${role} at ${client.address}` : 'not here; its cables wait'));
    box.append(header);
    if (!isFolded) {
      const sides = element('div', 'sides');
      for (const side of [client.inputs, client.outputs]) {
        const list = element('ul', '');
        for (const pin of side) {
          const item = element('li', '');
          item.append(makePin(pin));
          list.append(item);
        }
        sides.append(list);
      }
      box.append(sides);
    }
    return { element: box, title, isFolded, pins };
  }

  function forget(name) {
    const box = boxes.get(name);
    if (!box) return;
    box.element.remove();
    boxes.delete(name);
    for (const pin of box.pins) drawn.delete(pin.name);
  }

  function describe(pin, text) {
    const parts = [`${pin.channel}${pin.label ? ` ${pin.label}` : ''} ${text}`];
    parts.push(`${pin.isAnalog ? 'analog' : 'digital'} ${pin.isInput ? 'input' : 'output'} of ${pin.client}`);
    if (!pin.isHere) parts.push('not here');
    else if (pin.value === null) parts.push('no value yet');
    const partners = lab.cablesOf(pin).map(({ input, output }) => (pin.isInput ? output : input));
    if (partners.length) parts.push(`connected with ${partners.join(' and ')}`);
    return parts.join(', ');
  }

  function paint(pin) {
    const shown = drawn.get(pin.name);
    if (!shown) return;
    const own = pin.isForced && !pin.isInput && pin.raw.value !== pin.raw.forced && pin.raw.value !== null ? pin.raw.value : null;
    const text = pin.isForced ? `${pin.value} forced${own === null ? '' : ` (${own})`}` : pin.value ?? '–';
    setText(shown.text, text);
    shown.element.classList.toggle('on', pin.isOn);
    shown.element.classList.toggle('forced', pin.isForced);
    shown.element.classList.toggle('beside', !isFound(pin));
    setAttribute(shown.element, 'aria-label', describe(pin, text));
  }

  /** Shows what `lab.take` has returned. */
  function show({ isOther, reshaped, changed, placed }) {
    const focused = document.activeElement;
    const focusedPin = focused?.dataset?.pin;
    const focusedBox = focused?.closest?.('.client')?.dataset.name;
    const isTitle = focused?.classList?.contains('title');
    const focusedCable = focused?.closest?.('g.cable')?.dataset.input;
    if (isOther || placed) {
      for (const name of boxes.keys()) if (!lab.clients.has(name)) forget(name);
      let before = null;
      for (const client of lab.clients.values()) {
        let box = boxes.get(client.name);
        if (!box || reshaped.has(client.name) || box.isFolded !== lab.isFolded(client.name)) {
          forget(client.name);
          box = makeBox(client);
          boxes.set(client.name, box);
          for (const pin of box.pins) paint(pin);
        }
        const next = before ? before.element.nextSibling : clients.firstChild;
        if (next !== box.element) clients.insertBefore(box.element, next);
        before = box;
      }
      place();
      showCables();
    }
    for (const pin of changed) {
      paint(pin);
      if (!isOther && !pin.isInput) for (const { input } of lab.cablesOf(pin)) wires.get(input)?.group.classList.toggle('on', pin.isOn);
    }
    // The focused element may have been rebuilt; if its cable is gone, focus the input.
    const again = drawn.get(focusedPin)?.element ?? (isTitle ? boxes.get(focusedBox)?.title : undefined)
      ?? wires.get(focusedCable)?.group ?? drawn.get(focusedCable)?.element;
    if (again && document.activeElement !== again) again.focus({ preventScroll: true });
  }

  /** Puts the boxes to their places. */
  function place() {
    for (const [name, box] of boxes) {
      const at = dragged.get(name) ?? lab.places.get(name) ?? { x: 0, y: 0 };
      box.element.style.setProperty('left', `${at.x + MARGIN.x}px`);
      box.element.style.setProperty('top', `${at.y + MARGIN.y}px`);
    }
    drawSoon();
  }

  function showCables() {
    for (const [input, wire] of wires) {
      if (lab.cables.get(input)?.output === wire.output) continue;
      wire.group.remove();
      wires.delete(input);
    }
    for (const { input, output, awake } of lab.cables.values()) {
      const wire = wires.get(input) ?? makeCable(input, output);
      const source = lab.pins.get(output);
      const classes = wire.group.classList;
      classes.toggle('analog', source.isAnalog);
      classes.toggle('on', source.isOn);
      classes.toggle('asleep', !awake);
    }
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

  /** The rectangles of all boxes on the sheet. */
  function rectangles() {
    const all = new Map();
    for (const [name, { element: box }] of boxes) {
      const { offsetLeft: left, offsetTop: top, offsetWidth: width, offsetHeight: height } = box;
      all.set(name, { left, top, right: left + width, bottom: top + height });
    }
    return all;
  }

  /** The middle of a channel's jack on the sheet; that of a folded box is in its header. */
  function end(pin, box) {
    const shown = drawn.get(pin.name)?.element;
    const y = shown ? box.top + shown.offsetTop + shown.offsetHeight / 2 : (box.top + box.bottom) / 2;
    return [pin.isInput ? box.left : box.right, Math.round(y)];
  }

  /** Draws cables and frames with the next frame of the screen. */
  function drawSoon() {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      draw();
    });
  }

  function draw() {
    if (!sheet.offsetParent) return;
    // Read the whole layout before writing anything, which would force a new layout.
    const all = rectangles();
    const list = [];
    const names = drawFrames(all);
    for (const { input, output } of wires.values()) {
      const [source, sink] = [lab.pins.get(output), lab.pins.get(input)];
      const [one, other] = [all.get(source.client), all.get(sink.client)];
      list.push({ key: input, output, from: end(source, one), to: end(sink, other) });
    }
    const room = narrow.matches ? { beside: 0, between: 6 } : { beside: 48, between: 12 };
    const lines = route.all([...all.values(), ...names], list, room);
    for (const [input, line] of lines) for (const path of wires.get(input).paths) setAttribute(path, 'd', line);
    let [right, bottom] = [0, 0];
    for (const box of all.values()) {
      right = Math.max(right, box.right);
      bottom = Math.max(bottom, box.bottom);
    }
    sheet.style.setProperty('--width', `${right + MARGIN.x}px`);
    sheet.style.setProperty('--height', `${bottom + MARGIN.y}px`);
  }

  /** The members of each group. */
  function groups() {
    const all = new Map();
    for (const name of boxes.keys()) {
      const group = lab.places.get(name)?.group;
      if (group) all.set(group, [...all.get(group) ?? [], name]);
    }
    return all;
  }

  /** Draws the frames of groups; returns the rectangles of their names, which cables must not cross. */
  function drawFrames(all) {
    const names = [];
    const wanted = narrow.matches ? new Map() : groups();
    for (const frame of [...frames.children]) if (!wanted.has(frame.dataset.group)) frame.remove();
    for (const [group, members] of wanted) {
      let frame = [...frames.children].find((it) => it.dataset.group === group);
      if (!frame) {
        frame = element('div', 'frame');
        frame.dataset.group = group;
        const name = element('button', 'frame-name', group);
        name.type = 'button';
        frame.append(name);
        frames.append(frame);
      }
      const its = members.map((name) => all.get(name));
      const [left, top] = ['left', 'top'].map((side) => Math.min(...its.map((box) => box[side])));
      const [right, bottom] = ['right', 'bottom'].map((side) => Math.max(...its.map((box) => box[side])));
      const set = (key, value) => frame.style.setProperty(key, `${value}px`);
      set('left', left - 10);
      set('top', top - 22);
      set('width', right - left + 20);
      set('height', bottom - top + 32);
      names.push({ left, top: top - 32, right: left + frame.firstChild.offsetWidth, bottom: top - 10 });
    }
    return names;
  }

  const loose = document.createElementNS(SVG, 'path');
  loose.setAttribute('class', 'pending');

  /** Draws the cable that is being dragged, from a channel to a point of the window. */
  function drag(pin, x, y) {
    const origin = cables.getBoundingClientRect();
    const from = end(pin, rectangles().get(pin.client));
    const to = [x - origin.left, y - origin.top];
    loose.setAttribute('d', pin.isInput ? route.loose(to, from) : route.loose(from, to));
    cables.append(loose);
  }

  function isFound(pin) {
    const names = `${pin.name} ${pin.label ?? ''}`.toLowerCase();
    return words.every((word) => names.includes(word));
  }

  /** Marks the channels whose client, channel or label has all words of `text`; returns them in the order of the page. */
  function search(text) {
    words = text.toLowerCase().split(/\s+/).filter(Boolean);
    const found = [];
    for (const client of lab.clients.values()) {
      let some = false;
      for (const pin of [...client.inputs, ...client.outputs]) {
        const isHit = isFound(pin);
        some ||= isHit;
        drawn.get(pin.name)?.element.classList.toggle('beside', !isHit);
        if (isHit && words.length) found.push(pin);
      }
      boxes.get(client.name)?.element.classList.toggle('nothing', !some);
    }
    return found;
  }

  /** Shows the path of a channel or cable, and dims the rest; without a name it shows everything. */
  function trace(name, isCable) {
    board.traced = name;
    const path = name ? lab.path(name, isCable) : null;
    sheet.classList.toggle('tracing', Boolean(path?.near.size));
    for (const [input, { group }] of wires) {
      group.classList.toggle('near', Boolean(path?.near.has(input)));
      group.classList.toggle('far', Boolean(path?.far.has(input)));
    }
    for (const [pin, { element: button }] of drawn) button.classList.toggle('on-path', Boolean(path?.ends.has(pin)));
    const passed = new Set(Array.from(path?.ends ?? [], lab.clientOf));
    for (const [client, { element: box }] of boxes) box.classList.toggle('on-path', passed.has(client));
  }

  new ResizeObserver(drawSoon).observe(sheet);
  narrow.addEventListener('change', drawSoon);

  return { show, place, search, trace, setAttribute, setText, element, drag, dragged, groups, rectangles, drop: () => loose.remove(), drawn, wires, boxes, clients, cables, frames, narrow, draw: drawSoon, traced: null };
})();
