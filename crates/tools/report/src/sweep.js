"use strict";

const all = (selector, within = document) => [...within.querySelectorAll(selector)];
const element = (id) => document.getElementById(id);

/** The tables: of each its rows, and of each row its runs in their columns. */
const kinds = all(".kind").map((box) => ({
  box,
  rows: all("tbody tr", box).map((line) => ({
    line,
    subject: line.cells[0].textContent.toLowerCase(),
    runs: [...line.cells].slice(1).map((cell) => cell.querySelector(".run")),
  })),
}));

const isShown = (run) => run && !run.closest("tr").hidden && !run.parentElement.classList.contains("dim");

/** Hides rows and tables in which no run passes the filter, and dims the other runs. */
function filter() {
  const words = new Set(all(".legend input:checked").map((box) => box.value));
  const [text, onlyRed] = [element("signal").value.trim().toLowerCase(), element("red").checked];
  let [shown, total] = [0, 0];
  for (const { box, rows } of kinds) {
    let isEmpty = true;
    for (const { line, subject, runs } of rows) {
      const isWanted = subject.includes(text);
      let some = false;
      for (const run of runs) {
        if (!run) continue;
        const wanted = isWanted && words.has(run.dataset.word) && (!onlyRed || run.classList.contains("red"));
        run.parentElement.classList.toggle("dim", !wanted);
        some ||= wanted;
        shown += wanted;
        total += 1;
      }
      line.hidden = !some;
      isEmpty &&= !some;
    }
    box.hidden = isEmpty;
    const entry = rows.flatMap(({ runs }) => runs).find(isShown);
    if (entry && !isShown(box.querySelector(".run[tabindex='0']"))) enter(box, entry);
  }
  element("count").textContent = `${shown} of ${total} runs`;
}

/** Lets Tab reach this run of a table; the arrow keys lead to the others. */
function enter(box, run) {
  for (const other of all(".run[tabindex='0']", box)) other.tabIndex = -1;
  run.tabIndex = 0;
}

const panel = document.createElement("aside");
panel.className = "panel";
panel.hidden = true;
panel.setAttribute("aria-label", "The chosen run");
panel.setAttribute("aria-live", "polite");
document.body.append(panel);
let chosen = null;

function paragraph(...parts) {
  const line = document.createElement("p");
  line.append(...parts);
  panel.append(line);
}

function made(name, text) {
  const part = document.createElement(name);
  part.textContent = text;
  return part;
}

/** Shows a run's words, the command that repeats it, and its report. */
function choose(run) {
  if (run === chosen) return;
  chosen?.classList.remove("chosen");
  chosen = run;
  panel.hidden = !run;
  panel.replaceChildren();
  if (!run) return;
  run.classList.add("chosen");
  const { again } = run.closest(".sweep").dataset;
  const { why } = run.closest("tr").dataset;
  paragraph(made("b", run.dataset.name), `: ${run.title}`);
  if (run.classList.contains("accepted")) paragraph(`Accepted: ${why ?? "no reason is written"}`);
  paragraph("Again: ", made("code", again.replace("{}", () => run.dataset.name)));
  if (run.href) paragraph("The cell opens the report about the recording of this run.");
}

/** The next run that is shown, in this direction. */
function next({ rows }, from, down, right) {
  let row = rows.findIndex(({ runs }) => runs.includes(from));
  let column = rows[row].runs.indexOf(from);
  for (;;) {
    [row, column] = [row + down, column + right];
    const run = rows[row]?.runs[column];
    if (run === undefined) return null;
    if (isShown(run)) return run;
  }
}

const steps = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

for (const kind of kinds) {
  const { box, rows } = kind;
  for (const { runs } of rows) for (const run of runs) if (run) run.tabIndex = -1;
  const run = ({ target }) => target.closest(".run");
  box.addEventListener("focusin", (event) => {
    if (!run(event)) return;
    enter(box, run(event));
    choose(run(event));
  });
  box.addEventListener("click", (event) => run(event) && choose(run(event)));
  box.addEventListener("keydown", (event) => {
    const step = steps[event.key];
    if (event.key === "Escape") choose(null);
    if (!step || !run(event) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    next(kind, run(event), ...step)?.focus();
  });
}
for (const input of all(".legend input, #signal, #red")) input.addEventListener("input", filter);
filter();
