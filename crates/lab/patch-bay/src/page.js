'use strict';

// The page's controller: receives the state, and requests changes.
(() => {
  const get = (id) => document.getElementById(id);
  const tray = get('chosen');
  const value = get('force-value');
  let mayChange = false;
  let chosen = null;
  /** True if choosing another channel connects it to the chosen one; false after forcing, releasing or cutting. */
  let isEnd = false;

  function say(text, isBad = false) {
    get('status').textContent = text;
    get('status').classList.toggle('bad', isBad);
  }

  function connect(one, other) {
    const [input, output] = one.isInput ? [one, other] : [other, one];
    letGo();
    return changes.connect(input.name, output.name);
  }

  function cut(name, cables, text) {
    if (mayChange) changes.cut(cables, name, text);
    else say('Read-only: nothing was cut.', true);
  }

  // Choosing: the first pin is kept, the second one is its other end.

  function fits(pin, other) {
    return pin.isInput !== other.isInput && pin.isAnalog === other.isAnalog;
  }

  function choose(pin) {
    if (chosen && isEnd && chosen !== pin.name && mayChange) {
      const first = lab.pins.get(chosen);
      if (first) {
        connect(first, pin);
        return;
      }
    }
    if (chosen === pin.name) {
      letGo();
      say('');
      return;
    }
    chosen = pin.name;
    isEnd = true;
    value.value = pin.value ?? '';
    const target = pin.isInput ? 'an output' : 'an input';
    say(mayChange ? `${pin.name} is chosen. Choose ${target} to connect it.` : `${pin.name}: ${pin.value ?? 'no value yet'}.`);
    showChosen();
  }

  function letGo() {
    chosen = null;
    showChosen();
  }

  function showChosen() {
    const pin = lab.pins.get(chosen);
    if (chosen && !pin) {
      say(`${chosen} has gone.`);
      chosen = null;
    }
    tray.hidden = !pin;
    board.clients.classList.toggle('choosing', Boolean(pin) && isEnd && mayChange);
    for (const [name, { element }] of board.drawn) {
      const other = lab.pins.get(name);
      board.setAttribute(element, 'aria-pressed', String(other === pin));
      element.classList.toggle('fit', Boolean(pin) && fits(pin, other));
      element.classList.toggle('unfit', Boolean(pin) && other !== pin && !fits(pin, other));
    }
    for (const wire of board.wires.values()) {
      wire.group.classList.toggle('of-chosen', Boolean(pin) && (wire.input === pin.name || wire.output === pin.name));
    }
    if (!pin) return;
    get('chosen-name').textContent = pin.name;
    get('chosen-tools').hidden = !mayChange;
    enable(get('release'), pin.isForced, pin);
    enable(get('cut'), lab.cablesOf(pin).length > 0, pin);
  }

  /** Disabling a focused button returns the focus to its channel. */
  function enable(button, isEnabled, pin) {
    const isLost = !isEnabled && document.activeElement === button;
    button.disabled = !isEnabled;
    if (isLost) focusOn(pin);
  }

  const focusOn = (pin) => board.drawn.get(pin.name)?.element.focus({ preventScroll: true });

  /** After this call, the chosen channel is no longer the first end of a cable. */
  function endChoice() {
    isEnd = false;
    showChosen();
  }

  tray.addEventListener('submit', (event) => {
    event.preventDefault();
    const pin = lab.pins.get(chosen);
    if (!pin) return;
    const number = value.value.trim().replace(',', '.');
    endChoice();
    changes.force(pin.name, number);
  });
  get('release').addEventListener('click', () => {
    endChoice();
    changes.release(chosen);
  });
  get('cut').addEventListener('click', () => {
    endChoice();
    cutAll(lab.pins.get(chosen));
  });
  get('let-go').addEventListener('click', () => {
    const pin = lab.pins.get(chosen);
    letGo();
    say('');
    if (pin) focusOn(pin);
  });

  // The pointer: a click chooses, a drag connects.

  /** Cuts all cables of a channel. */
  const cutAll = (pin) => cut(pin.name, lab.cablesOf(pin), `Cut what was connected with ${pin.name}.`);

  const pinAt = (node) => lab.pins.get(node?.closest?.('.pin')?.dataset.pin);
  let held = null;
  let wasDragged = false;

  board.clients.addEventListener('pointerdown', (event) => {
    const pin = pinAt(event.target);
    wasDragged = false;
    // By touch, only the jack can be dragged: the rest of the box scrolls the page.
    const mayDrag = event.pointerType !== 'touch' || event.target.closest('.jack');
    if (!pin || !mayChange || !mayDrag || event.button !== 0) return;
    held = { name: pin.name, pointer: event.pointerId, x: event.clientX, y: event.clientY };
    if (event.target.hasPointerCapture(event.pointerId)) event.target.releasePointerCapture(event.pointerId);
  });
  function endDrag() {
    held = null;
    board.drop();
  }

  window.addEventListener('pointermove', (event) => {
    if (held?.pointer !== event.pointerId) return;
    const pin = lab.pins.get(held.name);
    // The button was released outside of the window, or the client has gone.
    if (event.buttons === 0 || !pin) {
      endDrag();
      return;
    }
    if (!wasDragged && Math.hypot(event.clientX - held.x, event.clientY - held.y) < 6) return;
    wasDragged = true;
    board.drag(pin, event.clientX, event.clientY);
  });
  window.addEventListener('pointerup', (event) => {
    if (held?.pointer !== event.pointerId) return;
    const from = lab.pins.get(held.name);
    endDrag();
    if (!wasDragged) return;
    const to = pinAt(document.elementFromPoint(event.clientX, event.clientY));
    if (from && to && to !== from) connect(from, to);
    else say('The cable was dropped beside a channel.');
  });
  window.addEventListener('pointercancel', (event) => {
    if (held?.pointer === event.pointerId) endDrag();
  });
  window.addEventListener('blur', endDrag);
  board.clients.addEventListener('click', (event) => {
    // Ignore the click that ends a drag on its own pin.
    if (wasDragged && event.detail > 0) return;
    const pin = pinAt(event.target);
    if (pin) choose(pin);
  });

  const cutCableOf = (cable) => cut(cable.input, [cable], `Cut the cable from ${cable.output} to ${cable.input}.`);

  function cutCable(group) {
    const cable = lab.cables.get(group.dataset.input);
    if (cable) cutCableOf(cable);
  }

  board.cables.addEventListener('click', (event) => {
    const group = event.target.closest('g.cable');
    if (group) cutCable(group);
  });

  window.addEventListener('keydown', (event) => {
    const isTyping = event.target.matches('input');
    if (event.key === 'Escape' && held) {
      endDrag();
      return;
    }
    if (event.key === 'Escape' && chosen) {
      const pin = lab.pins.get(chosen);
      letGo();
      say('Let go.');
      if (isTyping && pin) focusOn(pin);
      return;
    }
    if (event.key === 'Escape' && layout.isChosen) {
      layout.letGo();
      return;
    }
    if (isTyping || event.altKey) return;
    if (event.ctrlKey || event.metaKey) {
      const key = event.key.toLowerCase();
      if (key === 'y' || (key === 'z' && event.shiftKey)) turn(changes.redo);
      else if (key === 'z') turn(changes.undo);
      else return;
      event.preventDefault();
      return;
    }
    const group = event.target.closest?.('g.cable');
    const pin = pinAt(event.target);
    if (event.key === 'Delete' || event.key === 'Backspace') {
      if (group) cutCable(group);
      else if (pin) {
        endChoice();
        cutAll(pin);
      } else return;
      event.preventDefault();
    } else if ((event.key === 'Enter' || event.key === ' ') && group) {
      cutCable(group);
      event.preventDefault();
    } else if (event.key.toLowerCase() === 'f' && (pin || chosen) && mayChange) {
      if (pin && chosen !== pin.name) {
        letGo();
        choose(pin);
      }
      value.focus();
      value.select();
      event.preventDefault();
    }
  });

  function turn(work) {
    if (!mayChange) {
      say('Read-only: nothing was changed.', true);
      return;
    }
    layout.flush();
    work();
  }
  get('undo').addEventListener('click', () => turn(changes.undo));
  get('redo').addEventListener('click', () => turn(changes.redo));

  // The path of the channel or cable under the pointer, or else of the one with the focus.

  function trace(node) {
    const pin = pinAt(node);
    const group = node?.closest?.('g.cable');
    const name = pin?.name ?? group?.dataset.input ?? null;
    if (name !== board.traced) board.trace(name, Boolean(group));
  }
  /** While an end for a cable is looked for, the focus dims nothing. */
  const traceFocus = () => trace(chosen ? null : document.activeElement);
  for (const part of [board.clients, board.cables]) {
    part.addEventListener('pointerover', (event) => { if (event.pointerType !== 'touch' && !held) trace(event.target); });
    part.addEventListener('pointerleave', traceFocus);
  }
  // Not at the SVG: with such a listener, Chromium gives it a place in the order of Tab.
  get('sheet').addEventListener('focusin', traceFocus);
  get('sheet').addEventListener('focusout', () => trace(null));

  // Searching: other channels fade, and Enter goes from hit to hit.

  let hit = -1;

  function search() {
    const text = get('search').value;
    const found = board.search(text);
    const told = text.trim() ? count(found.length, 'channel', 'channels') : '';
    board.setText(get('found'), told);
    return found;
  }
  get('search').addEventListener('input', () => {
    hit = -1;
    markHit(null);
    search();
    matrix.search(get('search').value);
  });

  function markHit(pin) {
    for (const marked of document.querySelectorAll('.pin.hit')) marked.classList.remove('hit');
    const element = pin && board.drawn.get(pin.name)?.element;
    element?.classList.add('hit');
    element?.scrollIntoView({ block: 'center', inline: 'center', behavior: 'instant' });
    return element;
  }
  get('search').addEventListener('keydown', (event) => {
    if (event.key === 'ArrowDown') {
      document.querySelector('.pin.hit')?.focus();
      event.preventDefault();
    }
    if (event.key !== 'Enter') return;
    event.preventDefault();
    const found = search();
    if (!found.length) return;
    hit = (hit + (event.shiftKey ? found.length - 1 : 1) + (hit < 0 && event.shiftKey ? 1 : 0)) % found.length;
    const pin = found[hit];
    layout.reveal(pin.client);
    markHit(pin);
    board.setText(get('found'), `${hit + 1} of ${found.length}: ${pin.name}${pin.label ? ` ${pin.label}` : ''}`);
  });

  // Boxes or a table.

  function view(asMatrix) {
    for (const [id, isIt] of [['as-boxes', !asMatrix], ['as-matrix', asMatrix]]) get(id).setAttribute('aria-pressed', String(isIt));
    get('board').hidden = asMatrix;
    get('board-help').hidden = asMatrix;
    get('matrix-help').hidden = !asMatrix;
    matrix.open(asMatrix);
    if (asMatrix) letGo();
    else board.draw();
  }
  get('as-boxes').addEventListener('click', () => view(false));
  get('as-matrix').addEventListener('click', () => view(true));
  matrix.listen((input, output) => {
    if (!input || !output) return;
    const cable = lab.cables.get(input.name);
    if (cable?.output === output.name) cutCableOf(cable);
    else if (mayChange) changes.connect(input.name, output.name);
    else say('Read-only: nothing was connected.', true);
  });

  // Incoming events.

  function count(number, one, many) {
    return `${number} ${number === 1 ? one : many}`;
  }

  const sayForced = head.alarm('forced', 'bad');

  function showForced() {
    const forced = [...lab.pins.values()].filter((pin) => pin.isForced).map((pin) => `${pin.name} to ${pin.raw.forced}`);
    const further = forced.length > 3 ? ` and ${forced.length - 3} more` : '';
    sayForced(forced.length ? `${count(forced.length, 'channel is', 'channels are')} forced: ${forced.slice(0, 3).join(', ')}${further}` : '');
  }

  function show(text) {
    const taken = lab.take(JSON.parse(text));
    if (!taken) return false;
    board.show(taken);
    matrix.show(taken);
    showForced();
    if (held && !lab.pins.has(held.name)) endDrag();
    if (taken.isOther || taken.placed) {
      const cables = [...lab.cables.values()];
      const here = [...lab.clients.values()].filter(({ isHere }) => isHere).length;
      const asleep = cables.filter(({ awake }) => !awake).length;
      const waiting = asleep ? `, ${asleep} of them waiting` : '';
      head.count(`${count(here, 'client', 'clients')}, ${count(cables.length, 'cable', 'cables')}${waiting}`);
      get('empty').hidden = lab.clients.size > 0;
      layout.showChosen();
      if (hit < 0) search();
      if (board.traced) board.trace(null);
      showChosen();
    } else if (chosen && taken.changed.some(({ name }) => name === chosen)) {
      showChosen();
    }
    return true;
  }

  changes.listen(say);
  layout.listen(() => mayChange, say);
  head.listen({
    may: 'may change',
    mayNot: 'Open the address that the dispatcher printed, with its token, to change something',
    lost: 'No connection to the dispatcher.',
    news: show,
    access(isRight, refusal) {
      mayChange = isRight;
      const why = refusal || 'open the address that the dispatcher printed, with its token, to change something.';
      if (!mayChange) say(`Read-only: ${why}`);
      else if (get('status').textContent.startsWith('Read-only')) say('');
      showChosen();
    },
  });
})();
