'use strict';

// The board as a table: a row for each input, a column for each output, and a mark for each cable. Only the visible part
// is in the document.
const matrix = (() => {
  const grid = document.getElementById('matrix');
  const sheet = document.getElementById('matrix-sheet');
  /** The sizes of a cell, of the column with the inputs, and of the row with the outputs; page.css has the same. */
  const CELL = 28;
  const side = () => (board.narrow.matches ? 130 : 240);
  const HEAD = 170;
  /** Cells beyond the visible ones that are drawn. */
  const SPARE = 4;
  let rows = [];
  let columns = [];
  let at = { row: 0, column: 0 };
  let range = '';
  let words = '';
  /** Drawn cells: { element, input, output }, and drawn heads of rows. */
  let cells = [];
  let heads = [];
  let toggle = () => {};

  const make = (parent, role, className, text) => {
    const it = board.element('div', className, text);
    it.setAttribute('role', role);
    parent.append(it);
    return it;
  };
  const shown = (pin) => `${pin.name}${pin.label ? ` ${pin.label}` : ''}`;

  /** The channels that have all words; all of them if none has. */
  function matching(pins) {
    const list = words.split(/\s+/).filter(Boolean);
    const found = pins.filter((pin) => list.every((word) => shown(pin).toLowerCase().includes(word)));
    return found.length ? found : pins;
  }

  /** Takes over the channels. */
  function list() {
    const [row, column] = [rows[at.row]?.name, columns[at.column]?.name];
    const all = [...lab.clients.values()];
    rows = matching(all.flatMap(({ inputs }) => inputs));
    columns = matching(all.flatMap(({ outputs }) => outputs));
    // The current cell stays with its channels. Without one of them there is none (-1) until an arrow key is pressed.
    const find = (pins, name, before) => (name === undefined ? before : pins.findIndex((pin) => pin.name === name));
    at = { row: find(rows, row, at.row), column: find(columns, column, at.column) };
    grid.setAttribute('aria-rowcount', rows.length + 1);
    grid.setAttribute('aria-colcount', columns.length + 1);
    sheet.style.setProperty('width', `${side() + columns.length * CELL}px`);
    sheet.style.setProperty('height', `${HEAD + rows.length * CELL}px`);
    range = '';
    draw();
  }

  const isFirst = (pins, place) => place === 0 || pins[place - 1].client !== pins[place].client;

  function draw() {
    if (grid.hidden) return;
    const { scrollLeft, scrollTop, clientWidth, clientHeight } = grid;
    const span = (scroll, size, count) => [Math.max(0, Math.floor(scroll / CELL) - SPARE), Math.min(count, Math.ceil((scroll + size) / CELL) + SPARE)];
    const [top, bottom] = span(scrollTop, clientHeight, rows.length);
    const [left, right] = span(scrollLeft, clientWidth, columns.length);
    const wanted = [top, bottom, left, right].join();
    if (wanted !== range) {
      range = wanted;
      build(top, bottom, left, right);
    }
    paint();
  }

  function build(top, bottom, left, right) {
    cells = [];
    heads = [];
    sheet.replaceChildren();
    const first = make(sheet, 'row', 'matrix-head');
    first.setAttribute('aria-rowindex', 1);
    const corner = make(first, 'columnheader', 'matrix-corner', 'inputs ↓  outputs →');
    corner.setAttribute('aria-colindex', 1);
    for (let column = left; column < right; column += 1) {
      const pin = columns[column];
      const head = make(first, 'columnheader', `column${isFirst(columns, column) ? ' first' : ''}`);
      head.append(board.element('span', '', shown(pin)));
      head.title = shown(pin);
      head.setAttribute('aria-colindex', column + 2);
      head.dataset.column = column;
      head.style.setProperty('left', `${side() + column * CELL}px`);
    }
    for (let row = top; row < bottom; row += 1) {
      const input = rows[row];
      const line = make(sheet, 'row', `matrix-row${isFirst(rows, row) ? ' first' : ''}`);
      line.setAttribute('aria-rowindex', row + 2);
      line.style.setProperty('top', `${HEAD + row * CELL}px`);
      const head = make(line, 'rowheader', 'row-head');
      head.setAttribute('aria-colindex', 1);
      head.dataset.row = row;
      head.title = shown(input);
      head.append(board.element('span', 'name', shown(input)), ' ');
      const value = board.element('span', 'value');
      head.append(value);
      heads.push({ value, input });
      for (let column = left; column < right; column += 1) {
        const output = columns[column];
        const cell = make(line, 'gridcell', `cell${isFirst(columns, column) ? ' first' : ''}`);
        cell.id = `cell-${row}-${column}`;
        cell.dataset.row = row;
        cell.dataset.column = column;
        cell.setAttribute('aria-colindex', column + 2);
        cell.style.setProperty('left', `${side() + column * CELL}px`);
        cell.classList.toggle('unfit', input.isAnalog !== output.isAnalog);
        cells.push({ element: cell, input, output });
      }
    }
  }

  function paint() {
    for (const { value, input } of heads) board.setText(value, `${input.value ?? '–'}${input.isForced ? ' forced' : ''}`);
    for (const { element, input, output } of cells) {
      const cable = lab.cables.get(input.name);
      const isHere = cable?.output === output.name;
      board.setText(element, isHere ? '●' : '');
      element.classList.toggle('on', isHere && output.isOn);
      element.classList.toggle('asleep', isHere && !cable.awake);
      const state = isHere ? (cable.awake ? 'connected' : 'connected, waits for its client') : element.classList.contains('unfit') ? 'digital and analog' : 'not connected';
      board.setAttribute(element, 'aria-label', `${input.name} from ${output.name}: ${state}`);
      board.setAttribute(element, 'title', `${shown(output)} → ${shown(input)}: ${state}`);
      const isCurrent = Number(element.dataset.row) === at.row && Number(element.dataset.column) === at.column;
      element.classList.toggle('current', isCurrent);
    }
    for (const head of sheet.querySelectorAll('.column')) head.classList.toggle('current', Number(head.dataset.column) === at.column);
    for (const head of sheet.querySelectorAll('.row-head')) head.classList.toggle('current', Number(head.dataset.row) === at.row);
    board.setAttribute(grid, 'aria-activedescendant', document.getElementById(`cell-${at.row}-${at.column}`) ? `cell-${at.row}-${at.column}` : '');
  }

  /** Goes to a cell and brings it into view. */
  function go(row, column) {
    at = { row: Math.max(0, Math.min(rows.length - 1, row)), column: Math.max(0, Math.min(columns.length - 1, column)) };
    const into = (scroll, size, head, place) => Math.min(place * CELL, Math.max(scroll, (place + 1) * CELL + head - size));
    grid.scrollTop = into(grid.scrollTop, grid.clientHeight, HEAD, at.row);
    grid.scrollLeft = into(grid.scrollLeft, grid.clientWidth, side(), at.column);
    draw();
  }

  grid.addEventListener('scroll', () => requestAnimationFrame(draw));
  grid.addEventListener('click', (event) => {
    const cell = event.target.closest('.cell');
    if (!cell) return;
    go(Number(cell.dataset.row), Number(cell.dataset.column));
    toggle(rows[at.row], columns[at.column]);
  });
  grid.addEventListener('keydown', (event) => {
    if (event.altKey || event.metaKey) return;
    const page = Math.max(1, Math.floor((grid.clientHeight - HEAD) / CELL) - 1);
    const { row, column } = at;
    const places = {
      ArrowUp: [row - 1, column], ArrowDown: [row + 1, column], ArrowLeft: [row, column - 1], ArrowRight: [row, column + 1],
      PageUp: [row - page, column], PageDown: [row + page, column],
      Home: [event.ctrlKey ? 0 : row, 0], End: [event.ctrlKey ? rows.length : row, columns.length],
    };
    const place = places[event.key];
    if (place) go(...place);
    else if (event.key === ' ' || event.key === 'Enter') toggle(rows[row], columns[column]);
    else if (event.key === 'Delete' && lab.cables.get(rows[row]?.name)?.output === columns[column]?.name) toggle(rows[row], columns[column]);
    else return;
    event.preventDefault();
  });
  new ResizeObserver(draw).observe(grid);

  return {
    /** Shows the table, or what `lab.take` has returned. */
    show({ isOther }) {
      if (grid.hidden) return;
      if (isOther) list();
      else paint();
    },
    search(text) {
      words = text.toLowerCase();
      if (!grid.hidden) list();
    },
    /** `work` connects an input with an output, or cuts their cable. */
    listen(work) { toggle = work; },
    open(isOpen) {
      grid.hidden = !isOpen;
      if (isOpen) list();
    },
  };
})();
