"use strict";

// The page's controller: receives the states of the nets, lists them, and shows one. The page changes nothing.
(() => {
  const { make, write } = elements;
  const get = (id) => document.getElementById(id);
  /** Nets in which nothing has fired for this long wait, in microseconds. */
  const PATIENCE = 3_000_000;
  /** The pause before a layout that did not come is asked for again, in milliseconds. */
  const PAUSE = 1000;
  /** The programs with nets on this page, by their numbers. */
  let sets = new Map();
  /** The page of the process that these numbers are from. */
  let run = null;
  let view = null;
  let isHeld = false;
  let latest = null;
  /** What holds for all nets of a scan, such as that the line is stale. */
  const sayNote = head.alarm("line-note", "stale");
  /** The layouts that are being fetched. */
  const asked = new Set();

  const all = () => [...sets.values()].flatMap((set) => set.nets);

  /** Takes the nets of a program: `layout` is what the program has handed over. */
  function build({ id, title }, layout) {
    const set = { id, title, dots: layout.dots, nets: [], byName: new Map() };
    set.nets = layout.nets.map((net, number) => new nets.Net(set, number, net));
    set.byName = new Map(set.nets.map((net) => [net.name, net]));
    sets.set(id, set);
    sets = new Map([...sets].sort(([one], [other]) => one - other));
    list();
  }

  /** Makes the list of nets. */
  function list() {
    const focused = all().find((net) => net.entry?.button === document.activeElement);
    get("sets").replaceChildren();
    for (const set of sets.values()) {
      if (sets.size > 1) make("h3", "", get("sets"), set.title);
      const items = make("ul", "", get("sets"));
      for (const net of set.nets) {
        const button = make("button", "", make("li", "", items));
        button.type = "button";
        make("span", "name", button, net.name);
        net.entry = { button, tag: make("span", "tag", button), why: make("span", "why", button) };
        button.addEventListener("click", () => {
          get("follow").checked = false;
          choose(net);
          update();
        });
      }
    }
    const title = sets.size === 1 ? sets.values().next().value.title : "Petri nets";
    head.title(title, title);
    get("choice").hidden = all().length < 2;
    markChosen();
    focused?.entry.button.focus({ preventScroll: true });
  }

  function markChosen() {
    for (const net of all()) {
      if (net === view?.net) net.entry.button.setAttribute("aria-current", "true");
      else net.entry.button.removeAttribute("aria-current");
    }
  }

  function choose(net) {
    view = new netView.View(net);
    markChosen();
  }

  /** Shows the present states. */
  function update() {
    const every = all();
    get("main").hidden = every.length === 0;
    const open = latest?.sets ?? [];
    get("none").hidden = every.length > 0 || latest === null || open.length > 0;
    get("undrawn").hidden = !open.length || open.some(({ drawn }) => drawn);
    if (!every.length) return;
    const cause = nets.cause(every, PATIENCE);
    for (const net of every) {
      const [words, kind] = net.mark();
      const { button, tag, why } = net.entry;
      write(tag, words);
      tag.className = `tag ${kind}`;
      write(why, net.why());
      button.classList.toggle("is-cause", net === cause && every.length > 1);
    }
    const scanned = every.find((net) => net.state?.scans && !net.isStill);
    if (!view || !every.includes(view.net)) choose(cause ?? scanned ?? every[0]);
    else if (get("follow").checked && cause && cause !== view.net) choose(cause);
    // A net that is scanned says more than one that is not.
    else if (get("follow").checked && scanned && !view.net.state) choose(scanned);
    view.update(performance.now());
    const note = every.map((net) => net.state?.note).find(Boolean) ?? "";
    sayNote(note);
    document.body.dataset.shown = String(Number(document.body.dataset.shown ?? 0) + 1);
  }

  async function fetchLayout(one) {
    const key = `${run}/${one.id}`;
    if (asked.has(key)) return;
    asked.add(key);
    const here = run;
    let layout = null;
    try {
      // A large layout takes its time.
      const answer = await fetch(`${room.base}/layout/${one.id}`, { signal: AbortSignal.timeout(60000) });
      if (answer.ok) layout = await answer.json();
    } catch {
      // It is asked for again.
    }
    if (layout) {
      asked.delete(key);
      // Another process may have started meanwhile.
      if (here === run) build(one, layout);
      display(latest);
      return;
    }
    setTimeout(() => {
      asked.delete(key);
      if (!isHeld || !view) display(latest);
    }, PAUSE);
  }

  function display(state) {
    if (state.run !== run) {
      // Another process has started, perhaps with other nets.
      run = state.run;
      sets = new Map();
      view = null;
    }
    const gone = [...sets.keys()].filter((id) => !state.sets.some((set) => set.id === id));
    gone.forEach((id) => sets.delete(id));
    if (gone.length) list();
    for (const one of state.sets) {
      const set = sets.get(one.id);
      if (set) set.nets.forEach((net, i) => net.take(one.nets?.[i] ?? null, one.age * 1000));
      else if (one.drawn) fetchLayout(one);
    }
    update();
  }

  get("hold").addEventListener("click", () => {
    isHeld = !isHeld;
    get("hold").setAttribute("aria-pressed", String(isHeld));
    if (!isHeld && latest) display(latest);
    head.showLink();
  });
  get("full").addEventListener("click", () => {
    const isFull = document.body.classList.toggle("is-full");
    get("full").setAttribute("aria-pressed", String(isFull));
  });
  setInterval(() => view?.fade(performance.now()), 200);
  head.listen({
    may: "only shows",
    mayNot: "",
    lost: "No connection to the nets.",
    link: () => (isHeld ? ["held still", "stale"] : null),
    news(text) {
      const state = JSON.parse(text);
      if (!state.sets) return false;
      latest = state;
      if (!isHeld || latest.run !== run) display(latest);
      return true;
    },
    access() {},
  });
})();
