"use strict";

// The bar of time: pauses the page, and shows any moment of the histories of the drivers, while the present goes on.

const bar = (() => {
  const { write } = elements;
  const get = (id) => document.getElementById(id);
  const range = get("scrub");
  const canvas = get("bands");
  /** The time between two looks at the outages and faults, in milliseconds. */
  const PERIOD = 1000;
  /** A time of one driver against another's that changes by so much has jumped, in milliseconds. */
  const JUMP = 1000;
  let act = {};
  /** The driver whose time the bar shows. */
  let lead = null;
  /** How much later another driver's time is than the lead's, by its id, in milliseconds. */
  let offsets = new Map();
  /** The moment that the lead shows: `{ ms, tick, isLost }`; null for the present. */
  let moment = null;
  /** The moment to show next, and whether one is on its way. */
  let wanted = null;
  let isBusy = false;
  let isDragged = false;
  /** True if it was told that moments have left the memory, which goes on in the same pause. */
  let isTold = false;
  /** The outages and faults of each driver, as `[driver, { outages, marks }]`. */
  let overviews = [];
  let looked = -Infinity;
  let colours = null;
  /** The width of the bands in pixels, and what they were painted from. */
  let width = 0;
  let painted = [];
  /** For measurements: how long the moments took from the request to the picture, in milliseconds. */
  const frames = [];

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours = null; });

  const path = (driver, rest) => `/history/${driver.id}/${rest}`;

  /** The place of the shown moment in another driver's time. */
  const placeIn = (driver) => `at/${moment.ms + (offsets.get(driver.id) ?? 0)}`;

  /**
   * How much later a driver's time is than the lead's, in milliseconds. It stays while both go on: their last ticks, by which
   * it is measured, come at other times. Of one that stands still it is what it was.
   */
  function lag(driver) {
    const now = driver.past.last - lead.past.last;
    const jumps = !(Math.abs(now - driver.lag) < JUMP);
    if (driver.lag === undefined || jumps && driver.past.speed > 0 && lead.past.speed > 0) driver.lag = now;
    return driver.lag;
  }

  /** Requests a moment of one driver, and shows it. */
  async function fetchOne(driver, place, isStep) {
    const since = driver.moment ? `/since/${driver.moment.tick}` : "";
    const answer = await room.ask(path(driver, place + since));
    if (!answer.ok) throw new Error((await answer.json()).text);
    const state = await answer.json();
    if (!plant.drivers.includes(driver)) return null;
    return () => plant.showPast(driver, state, isStep);
  }

  /**
   * Shows a moment of the lead: `at/MS`, `tick/NUMBER` or `after/NUMBER`, and `own` of another driver, `{ driver, place, ms }`:
   * the lead may have no tick at that time, `ms` in its own time. While one is on its way, the newest one waits.
   */
  async function show(place, isStep = false, own = null) {
    if (!lead) return;
    wanted = { place, isStep, own };
    if (isBusy) return;
    isBusy = true;
    if (!moment) {
      offsets = new Map(plant.drivers.filter(({ past }) => past).map((driver) => [driver.id, lag(driver)]));
    }
    try {
      await showWanted();
    } finally {
      isBusy = false;
    }
    if (wanted?.isLive) leave();
  }

  async function showWanted() {
    while (wanted && !wanted.isLive) {
      const { place, isStep, own } = wanted;
      wanted = null;
      const begun = performance.now();
      try {
        const first = await fetchOne(lead, place, isStep);
        if (!first || (wanted && wanted.isLive)) break;
        first();
        // Another driver's memory may reach further back than the lead's.
        moment = { ms: own?.ms ?? lead.moment.ms, tick: lead.moment.tick, isLost: own !== null };
        const others = plant.drivers.filter((driver) => driver !== lead && driver.past);
        const placeOf = (driver) => (driver === own?.driver ? own.place : placeIn(driver));
        for (const shown of await Promise.all(others.map((driver) => fetchOne(driver, placeOf(driver), isStep)))) shown?.();
      } catch (error) {
        act.say(`The past cannot be shown: ${error.message}`, true);
        break;
      }
      if (wanted?.isLive) break;
      act.shown();
      await new Promise((go) => requestAnimationFrame(go));
      frames.push(performance.now() - begun);
      if (frames.length > 1000) frames.shift();
    }
  }

  /** Returns to the present. */
  function live() {
    // A recording has no present; its end is the newest moment.
    if (lead?.isRecording) return show(`at/${lead.past.last}`);
    wanted = isBusy ? { isLive: true } : null;
    if (!isBusy) leave();
  }

  function leave() {
    wanted = null;
    moment = null;
    isTold = false;
    plant.showPresent();
    act.shown();
  }

  const pause = () => show(`at/${lead.past.last}`);

  /** Goes by single ticks. */
  function step(by) {
    if (!lead) return;
    const from = moment ? moment.tick : lead.past.tick;
    show(by < 0 ? `tick/${from - 1}` : `after/${from}`, true);
  }

  /** How much later a driver's time is than the lead's, in milliseconds. */
  const offset = (driver) => (driver === lead || !driver.past ? 0 : moment ? offsets.get(driver.id) ?? 0 : lag(driver));

  /** Shows a tick of a driver, `{ tick, ms }`; in the lead's time, if it is another driver's. */
  function reach(driver, found, isStep) {
    if (driver === lead) return show(`tick/${found.tick}`, isStep);
    const ms = found.ms - offset(driver);
    return show(`at/${ms}`, isStep, { driver, place: `tick/${found.tick}`, ms });
  }

  /** Why the server refuses a request. A request that is too long gets an answer without a reason. */
  async function refusal(answer) {
    const { text } = await answer.json().catch(() => ({}));
    return text ?? `The server refuses the request (status ${answer.status}); write a shorter condition.`;
  }

  /** Goes to the next outage, fault, change or condition, or to the last one. */
  async function jump(isForward, goal = get("goal").value) {
    if (!lead) return;
    const signal = act.chosen();
    if (goal === "signal" && !signal) return act.say("Choose the signal whose change you look for.", true);
    const when = goal === "when" ? act.when() : null;
    const isOfSignal = goal === "signal" || (goal !== "when" && signal?.driver.past);
    const driver = when?.driver ?? (isOfSignal ? signal.driver : lead);
    // The present is later than what the page has heard of.
    const from = driver.moment?.tick ?? Number.MAX_SAFE_INTEGER;
    const what = goal === "signal" ? signal.index : goal;
    const name = when ? `beginning of “${when.text}”` : goal === "signal" ? `change of ${signal.name}` : plant.drivers.length > 1 ? `${goal} of ${driver.name}` : goal;
    try {
      const answer = await room.ask(path(driver, `${isForward ? "next" : "last"}/${what}/${from}${when ? `/${encodeURIComponent(when.text)}` : ""}`));
      if (!answer.ok) return act.say(await refusal(answer), true);
      const found = await answer.json();
      if (when) act.wrong(found.wrong ?? "");
      if (found.wrong) return;
      if (found.tick === null) return act.say(`There is no ${isForward ? "later" : "earlier"} ${name} in the recorded time.`, true);
      act.say("");
      await reach(driver, found, true);
    } catch {
      act.say("Nobody answers; look at the values when the page is live again.", true);
    }
  }

  /** Saves the time before the shown moment. */
  async function save(ending) {
    const driver = act.chosen()?.driver ?? lead;
    if (!driver?.past) return;
    const until = driver.moment?.ms ?? driver.past.last;
    if (until < driver.past.first) return act.say("The moment that is shown has left the memory, so that nothing before it can be saved.", true);
    const span = Number(get("save-span").value);
    const from = span ? Math.max(driver.past.first, until - span) : driver.past.first;
    act.say("The file is being made.");
    try {
      // It may take longer than other requests.
      const answer = await fetch(path(driver, `save/${from}/${until}.${ending}`));
      if (!answer.ok) return act.say("The file was not made: it is too large. Choose a shorter time.", true);
      const link = document.createElement("a");
      link.href = URL.createObjectURL(await answer.blob());
      link.download = `${driver.name.replace(/[^\w.-]+/g, "_")}-${words.moment(until).replace(/[^\d.]/g, "")}s.${ending}`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60000);
      act.say(`Saved: ${link.download}, from ${words.moment(from)} to ${words.moment(until)} of ${driver.name}.`);
    } catch {
      act.say("The file was not made: nobody answers.", true);
    }
  }

  /** Looks at the outages and faults. */
  async function look() {
    if (!lead?.past || document.hidden || performance.now() - looked < PERIOD) return;
    looked = performance.now();
    const leader = lead;
    const found = plant.drivers.filter(({ past }) => past).map(async (driver) => {
      const answer = await room.ask(path(driver, "").slice(0, -1));
      return answer.ok ? [[driver, await answer.json()]] : [];
    });
    try {
      const now = (await Promise.all(found)).flat();
      if (leader === lead) overviews = now;
    } catch {
      // The page says if the server does not answer.
    }
  }

  /** Paints the bands, if they have changed. */
  function paint() {
    const { first, last } = lead.past;
    const now = [width, first, last, overviews, colours];
    if (colours && now.every((it, i) => it === painted[i])) return;
    colours ??= coloursAt(document.body);
    painted = [width, first, last, overviews, colours];
    const height = 10;
    const ctx = context(canvas, width, height);
    // As wide as the way of the handle.
    const x = (ms) => 8 + (ms - first) / (last - first || 1) * (width - 16);
    ctx.fillStyle = colours.idle;
    ctx.fillRect(x(first), 3, x(last) - x(first), 4);
    ctx.fillStyle = colours["stale-text"];
    for (const [driver, { outages }] of overviews) {
      const own = (ms) => ms - offset(driver);
      for (const [begin, end] of outages) {
        const [left, right] = [x(Math.max(first, own(begin))), x(Math.min(last, own(end ?? driver.past.last)))];
        if (right >= left) ctx.fillRect(left, 2, Math.max(2, right - left), 6);
      }
    }
    ctx.fillStyle = colours.bad;
    for (const [driver, { marks }] of overviews) {
      for (const { ms, begins } of marks) if (begins && ms - offset(driver) >= first) ctx.fillRect(x(ms - offset(driver)) - 1, 0, 2, height);
    }
  }

  // Asking for it in each frame would make the browser lay out the page once more.
  new ResizeObserver(([{ contentRect }]) => {
    ({ width } = contentRect);
    if (lead?.past) paint();
  }).observe(get("track"));

  /** Shows the state of the bar. */
  function redraw() {
    if (!plant.drivers.includes(lead)) {
      lead = plant.drivers.find(({ past }) => past) ?? null;
      if (moment) {
        leave();
        act.say("The drivers were opened again or have changed; the page is live again.");
      }
      overviews = [];
      looked = -Infinity;
    }
    lead ??= plant.drivers.find(({ past }) => past) ?? null;
    get("bar").hidden = !lead?.past;
    const isFile = Boolean(lead?.past && lead.isRecording);
    if (isFile && !moment && !isBusy) show(`at/${lead.past.last}`);
    document.body.classList.toggle("is-past", Boolean(moment) && !isFile);
    if (!lead?.past) return;
    const { first, last, isCut } = lead.past;
    range.min = first;
    range.max = last;
    const at = moment?.ms ?? last;
    if (!isDragged) range.value = at;
    const now = plant.now(lead);
    const ago = now - at;
    const span = words.span(Math.max(0, last - first));
    range.setAttribute("aria-valuetext", moment ? `${words.moment(at)}, tick ${moment.tick}` : "live");
    get("pause").hidden = Boolean(moment) || isFile;
    get("to-live").hidden = !moment || isFile;
    if (moment) write(get("to-live"), `Live: +${words.span(ago)}`);
    write(get("moment"), moment ? `${words.moment(at)}${isFile ? ` of ${words.moment(last)}` : ""} · tick ${words.whole(moment.tick)}` : isCut ? `the last ${span} kept` : `${span} recorded`);
    const chosen = act.chosen();
    write(get("goal-signal"), chosen ? `change of ${chosen.name}` : "change of a signal");
    if (moment && moment.ms < first && !moment.isLost) {
      moment.isLost = true;
      if (!isTold) act.say("The oldest moments have left the memory; the page shows the oldest that is left.");
      isTold = true;
      show("tick/0");
    }
    paint();
  }

  range.addEventListener("input", () => show(`at/${range.value}`));
  range.addEventListener("pointerdown", () => { isDragged = true; });
  for (const name of ["pointerup", "pointercancel", "change"]) range.addEventListener(name, () => { isDragged = false; });
  get("pause").addEventListener("click", () => {
    pause();
    range.focus();
  });
  get("to-live").addEventListener("click", () => {
    live();
    range.focus();
  });
  get("step-back").addEventListener("click", () => step(-1));
  get("step-forth").addEventListener("click", () => step(1));
  get("last-goal").addEventListener("click", () => jump(false));
  get("next-goal").addEventListener("click", () => jump(true));
  get("last-when").addEventListener("click", () => jump(false, "when"));
  get("next-when").addEventListener("click", () => jump(true, "when"));
  get("save").addEventListener("click", (event) => {
    const ending = event.target.closest("button")?.dataset.ending;
    if (ending) save(ending);
  });

  /** A key of the page; returns whether the bar has used it. */
  function key(event) {
    if (!lead?.past) return false;
    const isOwn = event.target === range;
    if (event.key === "ArrowLeft") step(-1);
    else if (event.key === "ArrowRight") step(1);
    else if (event.key === "p" || event.key === "P") {
      if (moment) live();
      else pause();
    } else if (isOwn && event.key === "Home") show(`at/${lead.past.first}`);
    else if (isOwn && event.key === "End") live();
    else return false;
    return true;
  }

  setInterval(look, PERIOD);
  return {
    redraw, key, show, live, step, jump, reach, offset, refusal, frames,
    /** Sets what the page does: `say(text, isBad)`, `shown()`, `chosen()`, `when()`, `wrong(text)`. */
    begin(actions) { act = actions; },
    get moment() { return moment; },
    /** The driver whose time the bar shows. */
    get lead() { return lead; },
  };
})();
