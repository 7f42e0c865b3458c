'use strict';

// The work of the page: it hears the state, and asks for changes.
(() => {
  const get = (id) => document.getElementById(id);
  const tray = get('chosen');
  const value = get('force-value');
  /** Without a word for this long, what is shown counts as old. The room says something every 2 s. */
  const PATIENCE = 5000;
  let mayChange = false;
  let chosen = null;
  let heard = 0;
  let state = null;

  // The token comes behind "#", which is sent to nobody, and leaves the address at once.
  const given = /^#token=([0-9a-f]+)$/.exec(location.hash);
  if (given) {
    sessionStorage.setItem('token', given[1]);
    history.replaceState(null, '', location.pathname);
  }

  function headers() {
    const token = sessionStorage.getItem('token');
    return token ? { Authorization: `Bearer ${token}` } : {};
  }

  function say(text, isBad = false) {
    get('status').textContent = text;
    get('status').classList.toggle('bad', isBad);
  }

  async function askAccess() {
    let text = 'read-only';
    let why = 'Read-only: open the address that the dispatcher printed, with its token, to change something.';
    try {
      const answer = await fetch('/access', { headers: headers() });
      const access = await answer.json();
      mayChange = access.may_change === true;
      if (mayChange) text = 'may change';
      if (!answer.ok) why = `Read-only: ${access.text}`;
    } catch {
      return;
    }
    get('access').textContent = text;
    get('access').classList.toggle('good', mayChange);
    document.body.classList.toggle('read-only', !mayChange);
    if (!mayChange) say(why);
    showChosen();
  }

  async function change(method, path, body, done) {
    try {
      const answer = await fetch(path, { method, body, headers: headers() });
      const said = await answer.json();
      if (answer.ok) say(done);
      else say(`ERR ${said.code} ${said.text}`, true);
      return answer.ok;
    } catch {
      say('The dispatcher does not answer; nothing was changed.', true);
      return false;
    }
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

  // Choosing: the first pin is held, the second one is its other end.

  function fits(pin, other) {
    return pin.isInput !== other.isInput && pin.isAnalog === other.isAnalog;
  }

  function choose(pin) {
    if (chosen && chosen !== pin.name && mayChange) {
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
    if (!pin) chosen = null;
    tray.hidden = !pin;
    board.clients.classList.toggle('choosing', Boolean(pin) && mayChange);
    for (const other of board.pins.values()) {
      other.element.setAttribute('aria-pressed', String(other === pin));
      other.element.classList.toggle('fit', Boolean(pin) && fits(pin, other));
      other.element.classList.toggle('unfit', Boolean(pin) && other !== pin && !fits(pin, other));
    }
    if (!pin) return;
    get('chosen-name').textContent = pin.name;
    get('chosen-tools').hidden = !mayChange;
    get('release').disabled = !pin.isForced;
    get('cut').disabled = !state.connections.some(({ input, output }) => input === pin.name || output === pin.name);
  }

  tray.addEventListener('submit', (event) => {
    event.preventDefault();
    const pin = board.pins.get(chosen);
    if (!pin) return;
    change('PUT', `/force/${pin.name}`, value.value, `${pin.name} is forced to ${value.value.trim()}.`);
  });
  get('release').addEventListener('click', () => {
    change('DELETE', `/force/${chosen}`, undefined, `${chosen} is released.`);
  });
  get('cut').addEventListener('click', () => cut(chosen, `Cut what was connected with ${chosen}.`));
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
    // By touch, only the jack is dragged: the rest of the box scrolls the page.
    const mayDrag = event.pointerType !== 'touch' || event.target.closest('.jack');
    if (!pin || !mayChange || !mayDrag || event.button !== 0) return;
    held = { pin, x: event.clientX, y: event.clientY };
    if (event.target.hasPointerCapture(event.pointerId)) event.target.releasePointerCapture(event.pointerId);
  });
  window.addEventListener('pointermove', (event) => {
    if (!held) return;
    if (!wasDragged && Math.hypot(event.clientX - held.x, event.clientY - held.y) < 6) return;
    wasDragged = true;
    board.drag(held.pin, event.clientX, event.clientY);
  });
  window.addEventListener('pointerup', (event) => {
    if (!held) return;
    const from = board.pins.get(held.pin.name);
    held = null;
    board.drop();
    if (!wasDragged) return;
    const to = pinAt(document.elementFromPoint(event.clientX, event.clientY));
    if (from && to && to !== from) connect(from, to);
    else say('The cable was dropped beside a channel.');
  });
  window.addEventListener('pointercancel', () => {
    held = null;
    board.drop();
  });
  board.clients.addEventListener('click', (event) => {
    // The click that ends a drag on its own pin is none.
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
    const isTyping = event.target === value;
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
      else if (pin) cut(pin.name, `Cut what was connected with ${pin.name}.`);
      else return;
      event.preventDefault();
    } else if (event.key === 'Enter' && group) {
      cutCable(group);
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

  // The state, as it comes.

  function count(number, one, many) {
    return `${number} ${number === 1 ? one : many}`;
  }

  function show(text) {
    state = JSON.parse(text);
    board.show(state);
    const asleep = state.connections.filter(({ awake }) => !awake).length;
    const waiting = asleep ? `, ${asleep} of them waiting` : '';
    get('counts').textContent = `${count(state.clients.length, 'client', 'clients')}, ${count(state.connections.length, 'cable', 'cables')}${waiting}`;
    get('empty').hidden = state.clients.length > 0;
    showChosen();
  }

  function setAge() {
    const isOld = performance.now() - heard > PATIENCE || source.readyState !== EventSource.OPEN;
    document.body.classList.toggle('is-old', isOld);
    get('link').textContent = isOld ? 'no connection' : 'live';
    get('link').className = isOld ? 'tag bad' : 'tag good';
    get('age').hidden = !isOld;
    if (!isOld) return;
    const seconds = Math.round((performance.now() - heard) / 1000);
    const text = state ? `No connection to the dispatcher. What is shown is ${seconds} s old.` : 'No connection to the dispatcher.';
    // The first words are announced; a clock that runs on would be announced again and again.
    if (get('age').hidden || get('age').dataset.at !== String(seconds)) get('age').textContent = text;
    get('age').dataset.at = String(seconds);
  }

  let source = null;

  function listen() {
    source = new EventSource('/events');
    source.onopen = () => {
      heard = performance.now();
      setAge();
      askAccess();
    };
    source.onmessage = (event) => {
      heard = performance.now();
      show(event.data);
      setAge();
    };
    source.addEventListener('beat', () => {
      heard = performance.now();
    });
    source.onerror = () => {
      setAge();
      // A refusal ends the source for good; a broken connection it restores itself.
      if (source.readyState === EventSource.CLOSED) setTimeout(listen, 1000);
    };
  }

  listen();
  setInterval(setAge, 500);
})();
