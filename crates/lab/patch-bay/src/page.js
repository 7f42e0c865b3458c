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
  let state = null;

  function say(text, isBad = false) {
    get('status').textContent = text;
    get('status').classList.toggle('bad', isBad);
  }

  async function change(method, path, body, done) {
    const said = await room.change(method, room.base + path, body);
    if (said === null) say('The dispatcher does not answer; check the change when it is back.', true);
    else if (said.ok) say(done);
    else say(`ERR ${said.code} ${said.text}`, true);
    return said?.ok === true;
  }

  function connect(one, other) {
    const [input, output] = one.isInput ? [one, other] : [other, one];
    letGo();
    return change('PUT', `/patch/${input.name}`, output.name, `Connected ${output.name} with ${input.name}.`);
  }

  function cut(name, text) {
    if (!mayChange) {
      say('Read-only: nothing was cut.', true);
      return;
    }
    change('DELETE', `/patch/${name}`, undefined, text);
  }

  // Choosing: the first pin is kept, the second one is its other end.

  function fits(pin, other) {
    return pin.isInput !== other.isInput && pin.isAnalog === other.isAnalog;
  }

  function choose(pin) {
    if (chosen && isEnd && chosen !== pin.name && mayChange) {
      const first = board.pins.get(chosen);
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
    const pin = board.pins.get(chosen);
    if (chosen && !pin) {
      say(`${chosen} has gone.`);
      chosen = null;
    }
    tray.hidden = !pin;
    board.clients.classList.toggle('choosing', Boolean(pin) && isEnd && mayChange);
    for (const other of board.pins.values()) {
      board.setAttribute(other.element, 'aria-pressed', String(other === pin));
      other.element.classList.toggle('fit', Boolean(pin) && fits(pin, other));
      other.element.classList.toggle('unfit', Boolean(pin) && other !== pin && !fits(pin, other));
    }
    for (const wire of board.wires.values()) {
      wire.group.classList.toggle('of-chosen', Boolean(pin) && (wire.input === pin.name || wire.output === pin.name));
    }
    if (!pin) return;
    get('chosen-name').textContent = pin.name;
    get('chosen-tools').hidden = !mayChange;
    enable(get('release'), pin.isForced, pin);
    enable(get('cut'), state.connections.some(({ input, output }) => input === pin.name || output === pin.name), pin);
  }

  /** Disabling a focused button returns the focus to its channel. */
  function enable(button, isEnabled, pin) {
    const isLost = !isEnabled && document.activeElement === button;
    button.disabled = !isEnabled;
    if (isLost) pin.element.focus({ preventScroll: true });
  }

  /** After this call, the chosen channel is no longer the first end of a cable. */
  function endChoice() {
    isEnd = false;
    showChosen();
  }

  tray.addEventListener('submit', (event) => {
    event.preventDefault();
    const pin = board.pins.get(chosen);
    if (!pin) return;
    const number = value.value.trim().replace(',', '.');
    endChoice();
    change('PUT', `/force/${pin.name}`, number, `${pin.name} is forced to ${number}.`);
  });
  get('release').addEventListener('click', () => {
    endChoice();
    change('DELETE', `/force/${chosen}`, undefined, `${chosen} is released.`);
  });
  get('cut').addEventListener('click', () => {
    endChoice();
    cut(chosen, `Cut what was connected with ${chosen}.`);
  });
  get('let-go').addEventListener('click', () => {
    const pin = board.pins.get(chosen);
    letGo();
    say('');
    if (pin) pin.element.focus();
  });

  // The pointer: a click chooses, a drag connects.

  const pinAt = (node) => board.pins.get(node?.closest?.('.pin')?.dataset.pin);
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
    const pin = board.pins.get(held.name);
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
    const from = board.pins.get(held.name);
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

  function cutCable(group) {
    const wire = board.wires.get(group.dataset.input);
    if (!wire) return;
    cut(wire.input, `Cut the cable from ${wire.output} to ${wire.input}.`);
  }

  board.cables.addEventListener('click', (event) => {
    const group = event.target.closest('g.cable');
    if (group) cutCable(group);
  });

  window.addEventListener('keydown', (event) => {
    const isTyping = event.target === value || event.target === get('search');
    if (event.key === 'Escape' && held) {
      endDrag();
      return;
    }
    if (event.key === 'Escape' && chosen) {
      const pin = board.pins.get(chosen);
      letGo();
      say('Let go.');
      if (isTyping && pin) pin.element.focus();
      return;
    }
    if (isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
    const group = event.target.closest?.('g.cable');
    const pin = pinAt(event.target);
    if (event.key === 'Delete' || event.key === 'Backspace') {
      if (group) cutCable(group);
      else if (pin) {
        endChoice();
        cut(pin.name, `Cut what was connected with ${pin.name}.`);
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

  // Searching: other channels fade, and Enter goes to the first that fits.

  function search() {
    const text = get('search').value;
    const found = board.search(text);
    const told = text.trim() ? count(found.length, 'channel', 'channels') : '';
    if (get('found').textContent !== told) get('found').textContent = told;
    return found;
  }
  get('search').addEventListener('input', search);
  get('search').addEventListener('keydown', (event) => {
    if (event.key !== 'Enter') return;
    event.preventDefault();
    search()[0]?.element.focus();
  });

  // Incoming states.

  function count(number, one, many) {
    return `${number} ${number === 1 ? one : many}`;
  }

  const sayForced = head.alarm('forced', 'bad');

  function show(text) {
    state = JSON.parse(text);
    const forced = state.clients.flatMap(({ name, channels }) => channels.filter((it) => it.forced !== null).map((it) => `${name}:${it.channel} to ${it.forced}`));
    const further = forced.length > 3 ? ` and ${forced.length - 3} more` : '';
    sayForced(forced.length ? `${count(forced.length, 'channel is', 'channels are')} forced: ${forced.slice(0, 3).join(', ')}${further}` : '');
    board.show(state);
    search();
    if (held && !board.pins.has(held.name)) endDrag();
    const asleep = state.connections.filter(({ awake }) => !awake).length;
    const waiting = asleep ? `, ${asleep} of them waiting` : '';
    head.count(`${count(state.clients.length, 'client', 'clients')}, ${count(state.connections.length, 'cable', 'cables')}${waiting}`);
    get('empty').hidden = state.clients.length > 0;
    showChosen();
  }

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
