'use strict';

// Moves, folds and groups boxes, by pointer and keyboard.
const layout = (() => {
  const get = (id) => document.getElementById(id);
  /** Boxes are placed on this grid; an arrow key moves one by two steps. */
  const GRID = 10;
  /** After this time without an arrow key, the place is kept. */
  const REST = 500;
  const chosen = new Set();
  let mayChange = () => false;
  let say = () => {};
  let held = null;
  let wasDragged = false;
  let timer = null;

  const titleOf = (node) => node?.closest?.('.title')?.closest('.client').dataset.name;
  const onGrid = (number) => Math.round(number / GRID) * GRID;

  /** The boxes that move together with one: the chosen ones, if it is among them. */
  const together = (name) => (chosen.has(name) ? [...chosen] : [name]).filter((it) => lab.places.has(it));

  /** Moves boxes together: at an edge all of them stop, and their distances stay. */
  function move(names, dx, dy, from = (name) => lab.places.get(name)) {
    const all = names.filter((name) => lab.places.has(name)).map((name) => [name, from(name)]);
    if (!all.length) return;
    const by = (key, wanted) => {
      const first = all[0][1][key];
      return Math.max(onGrid(first + wanted) - first, -Math.min(...all.map(([, place]) => place[key])));
    };
    const [right, down] = [by('x', dx), by('y', dy)];
    for (const [name, { x, y }] of all) board.dragged.set(name, { x: x + right, y: y + down });
    board.place();
  }

  /** Keeps the places of the boxes that were moved. */
  async function keep() {
    clearTimeout(timer);
    timer = null;
    const moved = [...board.dragged];
    if (!moved.length) return;
    const what = moved.length === 1 ? moved[0][0] : `${moved.length} boxes`;
    await changes.place(`Moved ${what}.`, moved);
    for (const [name, place] of moved) if (board.dragged.get(name) === place) board.dragged.delete(name);
    board.place();
  }

  function fold(names, folded) {
    if (!mayChange()) {
      // Without the token only this page changes.
      for (const name of names) lab.own.set(name, folded);
      board.show({ isOther: true, reshaped: new Set(), changed: [], placed: true });
      return;
    }
    for (const name of names) lab.own.delete(name);
    const what = names.length === 1 ? names[0] : `${names.length} boxes`;
    const facts = names.filter((name) => lab.places.has(name)).map((name) => [name, { folded }]);
    changes.place(`${folded ? 'Folded' : 'Unfolded'} ${what}.`, facts);
    board.show({ isOther: true, reshaped: new Set(), changed: [], placed: true });
  }

  /** Unfolds a box on this page alone, to show something in it. */
  function reveal(name) {
    if (!lab.isFolded(name)) return;
    lab.own.set(name, false);
    board.show({ isOther: true, reshaped: new Set(), changed: [], placed: true });
  }

  function toggle(name) {
    if (!chosen.delete(name)) chosen.add(name);
    showChosen();
    say(chosen.size ? `${chosen.size === 1 ? '1 box is' : `${chosen.size} boxes are`} chosen.` : '');
  }

  function letGo() {
    chosen.clear();
    showChosen();
  }

  function showChosen() {
    for (const name of chosen) if (!board.boxes.has(name)) chosen.delete(name);
    for (const [name, { element }] of board.boxes) element.classList.toggle('picked', chosen.has(name));
    get('grouping').hidden = !chosen.size;
    if (chosen.size) get('grouping-count').textContent = chosen.size === 1 ? [...chosen][0] : `${chosen.size} boxes`;
  }

  // The pointer: a drag moves, a click folds, a click with Shift chooses.

  function begin(event, names) {
    wasDragged = false;
    if (!mayChange() || board.narrow.matches || event.button !== 0 || !names.length) return;
    held = { names, pointer: event.pointerId, x: event.pageX, y: event.pageY, left: get('board').scrollLeft };
  }
  board.clients.addEventListener('pointerdown', (event) => {
    const name = titleOf(event.target) ?? event.target.closest?.('.client > header')?.parentNode.dataset.name;
    if (name) begin(event, together(name));
  });
  board.frames.addEventListener('pointerdown', (event) => {
    const group = event.target.closest('.frame')?.dataset.group;
    if (group) begin(event, board.groups().get(group) ?? []);
  });
  window.addEventListener('pointermove', (event) => {
    if (held?.pointer !== event.pointerId) return;
    if (event.buttons === 0) {
      end();
      return;
    }
    const [dx, dy] = [event.pageX - held.x, event.pageY - held.y];
    if (!wasDragged && Math.hypot(dx, dy) < 6) return;
    wasDragged = true;
    move(held.names, dx + get('board').scrollLeft - held.left, dy);
  });
  function end() {
    held = null;
    keep();
  }
  window.addEventListener('pointerup', (event) => { if (held?.pointer === event.pointerId) end(); });
  window.addEventListener('pointercancel', (event) => {
    if (held?.pointer !== event.pointerId) return;
    board.dragged.clear();
    board.place();
    held = null;
  });
  board.clients.addEventListener('click', (event) => {
    const name = titleOf(event.target);
    if (!name || (wasDragged && event.detail > 0)) return;
    if (event.shiftKey) toggle(name);
    else fold([name], !lab.isFolded(name));
  });
  board.frames.addEventListener('click', (event) => {
    const group = event.target.closest('.frame')?.dataset.group;
    if (!group || (wasDragged && event.detail > 0)) return;
    chosen.clear();
    for (const name of board.groups().get(group) ?? []) chosen.add(name);
    get('group-name').value = group;
    showChosen();
    say(`The group ${group} is chosen.`);
  });

  const ARROWS = { ArrowLeft: [-2, 0], ArrowRight: [2, 0], ArrowUp: [0, -2], ArrowDown: [0, 2] };
  board.clients.addEventListener('keydown', (event) => {
    const name = titleOf(event.target);
    if (!name || event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = ARROWS[event.key];
    if (arrow && mayChange() && !board.narrow.matches) {
      const step = GRID * (event.shiftKey ? 4 : 1);
      move(together(name), arrow[0] * step, arrow[1] * step, (it) => board.dragged.get(it) ?? lab.places.get(it));
      clearTimeout(timer);
      timer = setTimeout(keep, REST);
      event.preventDefault();
    } else if (event.key.toLowerCase() === 'g') {
      toggle(name);
      event.preventDefault();
    }
  });

  // Groups.

  get('grouping').addEventListener('submit', (event) => {
    event.preventDefault();
    const group = get('group-name').value.trim();
    if (!group) {
      say('A group needs a name.', true);
      get('group-name').focus();
      return;
    }
    changes.place(`Grouped ${chosen.size === 1 ? '1 box' : `${chosen.size} boxes`} as ${group}.`, [...chosen].map((name) => [name, { group }]));
    letGo();
  });
  get('ungroup').addEventListener('click', () => {
    changes.place('Took the boxes out of their group.', [...chosen].map((name) => [name, { group: null }]));
    letGo();
  });
  get('fold-chosen').addEventListener('click', () => fold([...chosen], true));
  get('unfold-chosen').addEventListener('click', () => fold([...chosen], false));
  get('let-boxes-go').addEventListener('click', letGo);
  get('arrange').addEventListener('click', changes.arrange);
  get('fold-all').addEventListener('click', () => {
    const names = [...board.boxes.keys()];
    fold(names, names.some((name) => !lab.isFolded(name)));
  });

  return {
    reveal, letGo, showChosen,
    /** Keeps what arrow keys have moved, without waiting for a further key. */
    flush() { if (timer !== null) keep(); },
    listen(may, tell) {
      mayChange = may;
      say = tell;
    },
    get isChosen() { return chosen.size > 0; },
  };
})();
