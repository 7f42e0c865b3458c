// Unpacking in the background, printing, and the start of the page.

const BETWEEN = 40;
let wanted = [];
let isUnpacking = false;

/** Requests signals for display: they come before all others. */
function want(numbers) {
  wanted = numbers.concat(wanted.filter((number) => !numbers.includes(number)));
  unpackAll();
}

/** Unpacks one signal after another, with pauses for the browser. */
async function unpackAll() {
  if (isUnpacking) return;
  isUnpacking = true;
  let rested = performance.now();
  while (wanted.length) {
    await load(wanted.shift());
    if (performance.now() - rested > BETWEEN || !wanted.length) {
      redraw();
      await new Promise((go) => setTimeout(go));
      rested = performance.now();
    }
  }
  isUnpacking = false;
}

// Paper does not scroll: print all rows, cut into pieces that fit on a page, over the visible range.
const ROWS_ON_PAPER = 160;
const PIECE = 230;

function paper() {
  const box = element("paper");
  box.replaceChildren();
  const own = coloursAt(box);
  const some = rows.slice(0, ROWS_ON_PAPER);
  const [width, left] = [1000, 230];
  for (let i = 0; i < some.length;) {
    const piece = [];
    let height = 26;
    while (i < some.length && height < PIECE) {
      height += some[i].spans ? 30 : 36;
      piece.push(some[i++]);
    }
    const sheet = document.createElement("canvas");
    const ctx = context(sheet, width, height, 2);
    sheet.removeAttribute("style");
    const painted = { ctx, colours: own, left, width: width - left - MARGIN, isNarrow: false, ...view };
    paintAxis(painted, 26);
    ctx.translate(0, 26);
    paintGrid(painted, height - 26);
    let top = 0;
    for (const row of piece) {
      paintRow(painted, row, top, row.spans ? 30 : 36, "");
      top += row.spans ? 30 : 36;
    }
    box.append(sheet);
  }
  if (rows.length > some.length) {
    const note = document.createElement("p");
    note.textContent = `${rows.length - some.length} more signals are not printed; filter for those you need.`;
    box.append(note);
  }
}

// Steps that are folded on the screen are printed.
const folded = () => document.querySelectorAll("#steps details");

window.addEventListener("beforeprint", () => {
  paper();
  for (const part of folded()) {
    part.dataset.was = part.open;
    part.open = true;
  }
});
window.addEventListener("afterprint", () => {
  element("paper").replaceChildren();
  for (const part of folded()) part.open = part.dataset.was === "true";
});

function begin() {
  if (!canUnpack) {
    const note = document.createElement("p");
    note.className = "note";
    note.textContent = "This browser is too old to unpack the chart (it lacks DecompressionStream; browsers have it since 2023). All else on this page is complete.";
    element("chart").after(note);
    return;
  }
  element("chart").hidden = false;
  const theme = matchMedia("(prefers-color-scheme: dark)");
  theme.addEventListener("change", () => {
    colours = null;
    redraw();
  });
  element("filter").addEventListener("input", choose);
  element("active").addEventListener("change", choose);
  new ResizeObserver(layOut).observe(element("chart"));
  window.addEventListener("resize", layOut);
  choose();
  want(run.signals.map((_, number) => number));
}

/** The data, for other programs: a signal's name, times in nanoseconds of simulation time, and values. */
window.tickbusReport = {
  signals: run.signals.map(({ name }) => name),
  async changes(number) {
    await load(number);
    const { data, failure } = run.signals[number];
    if (!data) throw new Error(failure);
    const [start, unit] = [BigInt(run.begin), BigInt(run.unit)];
    return {
      times: Array.from(data.times, (time) => String(start + BigInt(time) * unit)),
      values: Array.from(data.times, (_, index) => valueOf(data, index)),
    };
  },
  view: () => ({ ...view }),
  drawn: () => drawn,
  isIdle: () => !isUnpacking && !isDue,
};

begin();
