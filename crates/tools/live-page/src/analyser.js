"use strict";

// The logic analyser: signals on one time axis, with two cursors, from the server's history.

const analyser = (() => {
  const { make, write } = elements;
  const get = (id) => document.getElementById(id);
  /** The heights of a signal, the least and the most, and of the axis, in pixels. */
  const [ROW, HIGHEST, AXIS] = [52, 130, 24];
  /** The most signals. */
  const ROOM = 24;
  /** The shortest time on the axis, in milliseconds. */
  const LEAST = 1e-5;
  /** The axis can always be as long as this, in milliseconds. */
  const LENGTHY = 60000;
  /** The time between two requests for what is new, in milliseconds. */
  const PERIOD = 100;
  /** The most changes that are kept per signal. */
  const MOST = 60000;
  /** An integer with more values than this is a curve. */
  const STATES = 16;
  /** Less than half a nanosecond, in milliseconds: times of two drivers are converted into each other, and rounded. */
  const TINY = 4e-7;
  const KIND = "application/x-tickbus-signal";
  /** Where this tab keeps the signals and the length of the axis for the next load of the page. */
  const STORE = "tickbus analyser";
  const plot = get("plot");
  const canvas = get("waves");
  let act = {};
  let tracks = [];
  let row = ROW;
  let colours = null;
  /** The length of the axis, and its end in the time of the bar's driver; without one it follows the present. */
  let span = 15000;
  let held = null;
  /** The second cursor: `{ ms, tick }`. The first one is the moment that the bar shows. */
  let second = null;
  /** The first cursor while it is on its way to the bar. */
  let pending = null;
  let shownMoment = null;
  let isSecond = false;
  let hasNews = false;
  /** True once the signals of the last load of the page are there again. */
  let isBegun = false;
  let asked = 0;
  const pointers = new Map();
  let gesture = null;

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours = null; hasNews = true; });

  // The axis.

  function view() {
    const end = held ?? plant.now(bar.lead);
    return { begin: end - span, end };
  }
  // Asked for in each frame, it would make the browser lay out the page once more.
  let plotWidth = 0;
  const width = () => Math.max(20, plotWidth - MARGIN);
  const timeAt = (x) => view().begin + x / width() * span;
  const first = () => pending?.ms ?? bar.moment?.ms ?? null;

  /** A length that the axis can have. */
  function fitting(length) {
    const { first, last } = bar.lead.past;
    return Math.min(Math.max(length, LEAST), Math.max((last - first) * 1.1, LENGTHY));
  }

  function look(begin, length) {
    const { past } = bar.lead;
    span = fitting(length);
    held = Math.min(Math.max(begin, past.first - span * 0.9) + span, plant.now(bar.lead) + span * 0.9);
    changed();
  }

  /** Makes the axis longer or shorter about a time; about its end if it follows the present. */
  function zoom(factor, about = first()) {
    if (!bar.lead?.past) return;
    const { begin, end } = view();
    const length = fitting(span * factor);
    if (held === null) span = length;
    else {
      const fixed = about !== null && about >= begin && about <= end ? about : (begin + end) / 2;
      look(fixed - (fixed - begin) * length / span, length);
    }
    changed();
  }

  function pan(share) {
    if (bar.lead?.past) look(view().begin + share * span, span);
  }

  function all() {
    if (!bar.lead?.past) return;
    const { isRecording, past: { first, last } } = bar.lead;
    const length = Math.max(last - first, isRecording ? LEAST : 1000);
    if (held === null && !isRecording) span = length;
    else look(first, length);
    changed();
  }

  function follow() {
    held = null;
    pending = null;
    if (bar.moment) bar.live();
    changed();
  }

  function changed() {
    hasNews = true;
    act.redraw();
  }

  window.addEventListener("pagehide", keep);

  // The signals.

  const trackOf = (signal) => ({ key: plant.keyOf(signal), signal, times: [], values: [], from: Infinity, until: -Infinity, isThin: false, states: null, mayBeStates: !signal.unit && !/REAL|TIME|BOOL/.test(signal.type) });

  function add(signal) {
    if (!signal) return act.say("Choose a signal first.", true);
    if (!signal.driver.past) return act.say(`${signal.name} has no recording in memory (history = 0 in [page]), and the analyser shows that.`, true);
    if (tracks.some(({ key }) => key === plant.keyOf(signal))) return act.say(`${signal.name} is on the axis already.`);
    if (tracks.length === ROOM) return act.say(`The axis has room for ${ROOM} signals; remove one first.`, true);
    if (!tracks.length) {
      held = null;
      if (bar.lead.isRecording) all();
      else if (bar.moment) look(bar.moment.ms - span / 2, span);
    }
    tracks.push(trackOf(signal));
    build();
    act.say(`${signal.name} is on the axis${["overview", "recording"].includes(views.now) ? "" : ", under Recording"}.`);
  }

  function remove(track) {
    const at = tracks.indexOf(track);
    tracks.splice(at, 1);
    if (!tracks.length) second = null;
    build();
    const next = tracks[Math.min(at, tracks.length - 1)];
    if (next) next.parts.remove.focus({ preventScroll: true });
    else views.focus();
  }

  /** Shares the height of the window among the signals, in the view that has nothing else. */
  function fit() {
    // On a phone the whole analyser scrolls, with rows of one height.
    const isAlone = views.now === "recording" && !views.isPhone;
    const free = (get("axis").clientHeight - AXIS) / tracks.length;
    row = isAlone ? Math.round(Math.min(HIGHEST, Math.max(ROW, free))) : ROW;
    for (const item of get("tracks").children) item.style.height = `${row}px`;
    changed();
  }

  function build() {
    get("analyser").hidden = !tracks.length;
    get("analyser").classList.toggle("is-empty", !tracks.length);
    get("tracks").replaceChildren(...tracks.map((track) => {
      const item = document.createElement("li");
      const name = make("button", "pick", item, track.signal.name);
      name.title = `${track.signal.name}: choose it`;
      name.addEventListener("click", () => list.select(track.signal));
      const values = make("span", "values", item);
      track.parts = { name, now: make("b", "", values), then: make("span", "then", values) };
      if (!track.signal.isBool) {
        const states = track.parts.states = make("button", "look", item, "⌇");
        states.addEventListener("click", () => {
          track.states = !isStates(track);
          changed();
        });
      }
      track.parts.remove = make("button", "remove", item, "×");
      track.parts.remove.setAttribute("aria-label", `Remove ${track.signal.name} from the axis`);
      track.parts.remove.addEventListener("click", () => remove(track));
      return item;
    }));
    // Without a signal on the axis it is in the view of the recording alone.
    if (tracks.length) get("plot-keys").before(get("trigger"));
    else get("no-tracks").append(get("trigger"));
    trigger.choices(tracks.map(({ signal }) => signal));
    fit();
    collect();
  }

  function keep() {
    const kept = tracks.map(({ key, states }) => ({ key, states }));
    sessionStorage.setItem(STORE, JSON.stringify({ tracks: kept, span }));
  }

  function kept() {
    try {
      return JSON.parse(sessionStorage.getItem(STORE)) ?? { tracks: [], span };
    } catch {
      return { tracks: [], span };
    }
  }

  /** After the signals were replaced. */
  function renew() {
    const known = new Map(plant.signals.map((signal) => [plant.keyOf(signal), signal]));
    const before = isBegun ? { tracks, span } : kept();
    isBegun ||= plant.signals.length > 0;
    ({ span } = before);
    tracks = before.tracks.filter(({ key }) => known.has(key)).map(({ key, states }) => ({ ...trackOf(known.get(key)), states }));
    [second, held, pending] = [null, null, null];
    build();
  }

  // What the server knows.

  const collect = room.every(PERIOD, async () => {
    if (!document.hidden && tracks.length && bar.lead?.past) await Promise.all(plant.drivers.map(collectOf));
  });

  async function collectOf(driver) {
    const { past } = driver;
    if (!past) return;
    const offset = bar.offset(driver);
    const { begin, end } = view();
    const [from, to] = [begin + offset, end + offset];
    const [late, anew] = [[], []];
    for (const track of tracks.filter(({ signal }) => signal.driver === driver)) {
      const isCoarse = track.isThin && track.until - track.from > 4 * span;
      const lacksBegin = track.from > Math.max(from, past.first) + 1e-6 || track.until < from;
      if (isCoarse || lacksBegin) anew.push(track);
      else if (track.until < Math.min(to, past.last)) late.push(track);
    }
    await Promise.all([ask(driver, anew, from - span / 2, to + span / 2), late.length && ask(driver, late, Math.min(...late.map(({ until }) => until)), to + span / 2)]);
  }

  async function ask(driver, group, from, to) {
    if (!group.length) return;
    const answer = await room.ask(`/trend/${driver.id}/${group.map(({ signal }) => signal.index).join(",")}/${from}/${to}`);
    if (!answer.ok) return;
    const news = await answer.json();
    asked += 1;
    for (const track of group) {
      const given = news.signals[track.signal.index];
      if (from < track.from || from > track.until || track.isThin && to - from > span * 1.5) Object.assign(track, { times: [], values: [], from, isThin: false });
      trend.merge(track, given, from);
      if (track.times.length > MOST) {
        track.times.splice(0, MOST / 4);
        track.values.splice(0, MOST / 4);
        track.from = track.times[0];
      }
      track.until = news.to_ms;
      track.isThin ||= given.is_thin === true;
    }
    changed();
  }

  // The cursors.

  /** True if the value changed there, from one that was valid. */
  const isEdge = ({ values }, i) => i > 0 && !Number.isNaN(values[i]) && !Number.isNaN(values[i - 1]);

  /** Where an edge of a track is: in the lead's time, and in its own driver's, since the lead may have no tick there. */
  function edgeOf({ times, signal: { driver } }, i) {
    const ms = times[i] - bar.offset(driver);
    return { ms, own: driver === bar.lead ? null : { driver, place: `at/${times[i]}`, ms } };
  }

  /** The edge nearest to the pointer, of the signal below it if it has one that near; else the pointer's time. */
  function snapped(event) {
    const time = timeAt(xOf(event));
    const own = tracks[Math.floor((event.clientY - plot.getBoundingClientRect().top) / row)];
    return nearest(own ? [own] : [], time) ?? nearest(tracks, time) ?? { ms: time };
  }

  /** The edge nearest to a time, if there is one within a few pixels. */
  function nearest(among, time) {
    let [best, least] = [null, 8 / width() * span];
    for (const track of among) {
      const offset = bar.offset(track.signal.driver);
      const at = indexAt(track.times, time + offset);
      for (const i of [at, at + 1]) {
        if (i >= track.times.length || !isEdge(track, i)) continue;
        const far = Math.abs(track.times[i] - offset - time);
        if (far < least) [best, least] = [edgeOf(track, i), far];
      }
    }
    return best;
  }

  /** Places a cursor at a time or an edge; the first one pauses the page there. */
  function put(isOther, at) {
    const { past } = bar.lead;
    const time = Math.min(Math.max(at.ms, past.first), past.last);
    if (isOther) return putSecond(`at/${time}`, time, Boolean(at.own));
    if (held === null) held = plant.now(bar.lead);
    pending = { ms: time, own: at.own };
    changed();
    return bar.show(`at/${time}`, false, at.own);
  }

  /** Places the second cursor at a tick of the lead, or if `isExact` at `ms`, where the edge of another driver is. */
  async function putSecond(place, ms = second?.ms, isExact = false) {
    if (held === null) held = plant.now(bar.lead);
    const own = second = { ms, tick: null };
    changed();
    try {
      const answer = await room.ask(`/history/${bar.lead.id}/${place}/since/${bar.moment?.tick ?? bar.lead.past.tick}`);
      if (!answer.ok || second !== own) return;
      const found = await answer.json();
      Object.assign(own, { ms: isExact ? own.ms : found.ms, tick: found.tick });
      changed();
    } catch {
      act.say("The second cursor was not placed: nobody answers.", true);
    }
  }

  /** Moves the current cursor to the next edge: of the chosen signal, or of all if it is not on the axis. */
  function toEdge(by) {
    const from = (isSecond ? second?.ms : first()) ?? view().end;
    const own = tracks.filter(({ signal }) => signal === list.chosen);
    let best = null;
    for (const track of own.length ? own : tracks) {
      const offset = bar.offset(track.signal.driver);
      let i = indexAt(track.times, from + offset + (by > 0 ? TINY : -TINY)) + (by > 0 ? 1 : 0);
      while (i >= 0 && i < track.times.length && !isEdge(track, i)) i += by;
      if (i < 0 || i >= track.times.length) continue;
      const edge = edgeOf(track, i);
      if (best === null || (edge.ms - best.ms) * by < 0) best = edge;
    }
    if (best === null) return act.say("There is no further edge in sight: show more time.", true);
    const { begin, end } = view();
    if (best.ms < begin || best.ms > end) look(best.ms - span / 2, span);
    put(isSecond, best);
  }

  function step(by) {
    if (!isSecond || !second) bar.step(by);
    else if (second.tick !== null) putSecond(by < 0 ? `tick/${second.tick - 1}` : `after/${second.tick}`);
  }

  function choose(isOther) {
    isSecond = isOther;
    get("cursor-1").setAttribute("aria-pressed", String(!isSecond));
    get("cursor-2").setAttribute("aria-pressed", String(isSecond));
    if (isSecond && !second && bar.lead?.past) put(true, { ms: first() ?? (view().begin + view().end) / 2 });
    changed();
  }

  /** After the bar has shown another moment, or the present. */
  function moved() {
    const now = bar.moment?.ms ?? null;
    if (now === null && shownMoment !== null) held = null;
    if (now !== null && tracks.length) {
      const { begin, end } = view();
      held ??= end;
      if (!gesture && (now < begin || now > held)) look(now - span / 2, span);
    }
    if (!gesture) pending = null;
    shownMoment = now;
    changed();
  }

  /** Stops the view at the tick of the trigger. */
  function stop(driver, found) {
    const time = found.ms - bar.offset(driver);
    if (tracks.length) {
      look(time - span / 2, span);
      pending = { ms: time };
    }
    bar.reach(driver, found, false);
  }

  // Drawing.

  /** True for whole numbers of which few differ: states, rather than a curve. */
  function isFew(values) {
    const few = new Set();
    for (const value of values) {
      if (Number.isNaN(value)) continue;
      if (!Number.isInteger(value) || few.add(value).size > STATES) return false;
    }
    return true;
  }

  const isStates = (track) => track.states ?? track.isFew;

  function valueText(track, value) {
    const shown = words.value({ ...track.signal, value: Number.isNaN(value) ? null : value });
    return track.signal.unit && !Number.isNaN(value) ? `${shown} ${track.signal.unit}` : shown;
  }

  function redraw() {
    if (!tracks.length || !bar.lead?.past || !(hasNews || held === null)) return;
    hasNews = false;
    colours ??= coloursAt(document.body);
    const { begin, end } = view();
    const [wide, high] = [width(), tracks.length * row];
    const ctx = context(canvas, wide + MARGIN, high + AXIS);
    run.begin = 0;
    const painted = { ctx, colours, left: 0, width: wide, isNarrow: false, from: begin, to: end };
    paintGrid(painted, high);
    tracks.forEach((track, i) => drawTrack({ ...painted }, track, i * row));
    drawCursor(ctx, first(), colours.cursor, "1", high);
    if (second) drawCursor(ctx, second.ms, colours.mark, "2", high);
    ctx.save();
    ctx.translate(0, high);
    paintAxis(painted, AXIS);
    ctx.restore();
    tell();
  }

  function drawTrack(painted, track, top) {
    const { ctx, width: wide } = painted;
    const { signal, times, values } = track;
    const offset = bar.offset(signal.driver);
    painted.from += offset;
    painted.to += offset;
    run.end = Math.min(painted.to, Math.max(track.until, held === null ? plant.now(signal.driver) : -Infinity));
    const [start, stop] = [Math.max(0, indexAt(times, painted.from)), indexAt(times, painted.to) + 1];
    const [high, low] = [top + 7, top + row - 8];
    ctx.save();
    ctx.beginPath();
    ctx.rect(0, top, wide, row);
    ctx.clip();
    ctx.save();
    ctx.translate(0, top);
    const seen = { times: times.slice(start, stop), values: values.slice(start, stop) };
    trend.paintUnknown(painted, seen, row - 1);
    ctx.restore();
    track.isFew = track.mayBeStates && isFew(seen.values);
    track.range = "";
    if (signal.isBool) {
      paintBool(painted, seen, high, low);
    } else if (isStates(track)) {
      paintSpans(painted, statesOf(track, seen), high - 1, low + 1);
    } else {
      let [least, most] = extremes(seen, 0, seen.values.length);
      if (least <= most) track.range = `${short(least, 4)} to ${short(most, 4)}`;
      if (!(least < most)) [least, most] = [least - 1, most + 1];
      paintReal(painted, { low: least, high: most }, seen, high, low);
      ctx.font = SMALL;
      ctx.textAlign = "left";
      ctx.textBaseline = "top";
      ctx.fillStyle = colours.soft;
      ctx.fillText(track.range, 4, top + 1);
    }
    ctx.restore();
    ctx.fillStyle = colours.rail;
    ctx.fillRect(0, top + row - 1, wide, 1);
  }

  /** The states of an integer, each with its value; the same value has the same colour. */
  function statesOf(track, { times, values }) {
    const spans = [];
    values.forEach((value, i) => {
      if (Number.isNaN(value)) return;
      const kind = ["idle", "step", "good"][Math.abs(Math.trunc(value)) % 3];
      spans.push([times[i], times[i + 1] ?? run.end, kind, words.value({ ...track.signal, value })]);
    });
    return spans;
  }

  function drawCursor(ctx, ms, colour, name, high) {
    const { begin, end } = view();
    if (ms === null || ms < begin || ms > end) return;
    const x = (ms - begin) / span * width();
    ctx.fillStyle = colour;
    ctx.fillRect(x - 0.75, 0, 1.5, high);
    ctx.font = SMALL;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    const left = Math.min(Math.max(x, 7), width() - 7);
    ctx.fillRect(left - 7, 0, 14, 14);
    ctx.fillStyle = colours.paper;
    ctx.fillText(name, left, 7.5);
  }

  /** The value at a time, as far as it is known. */
  function valueAt({ signal, times, values, from, until }, ms) {
    const time = ms + bar.offset(signal.driver);
    return time + TINY < from || time - TINY > until ? undefined : valueOf({ values }, indexAt(times, time + TINY));
  }

  /** Writes what the cursors read. */
  function tell() {
    const one = first();
    for (const track of tracks) {
      const { signal, parts } = track;
      const known = one === null ? undefined : valueAt(track, one);
      write(parts.now, known === undefined ? words.value(signal) + (signal.unit && signal.value !== null ? ` ${signal.unit}` : "") : valueText(track, known));
      const other = second ? valueAt(track, second.ms) : undefined;
      write(parts.then, second ? (other === undefined ? "–" : valueText(track, other)) : "");
      if (parts.states) {
        const label = `Show ${signal.name} as ${isStates(track) ? "a curve" : "states"}`;
        if (parts.states.title !== label) {
          parts.states.title = label;
          parts.states.setAttribute("aria-label", label);
          parts.states.textContent = isStates(track) ? "⌇" : "▭";
        }
      }
    }
    const told = [];
    const cursor = (name, ms, tick) => `${name}: ${words.moment(ms)}${tick === null ? "" : `, tick ${words.whole(tick)}`}`;
    const tick = pending === null ? bar.moment?.tick ?? null : null;
    if (one !== null) told.push(cursor("1", one, tick));
    if (second) told.push(cursor("2", second.ms, second.tick));
    if (one !== null && second) {
      const far = second.ms - one;
      const ms = far.toFixed(Math.abs(far) < 1 ? 6 : 3).replace("-", "−");
      const ticks = tick === null || second.tick === null ? "…" : words.count(second.tick - tick, "tick", "ticks").replace("-", "−");
      told.push(`distance ${ticks}, ${ms} ms`);
    }
    write(get("reading"), told.join(" · ") || "A click places the cursor.");
    get("follow").hidden = held === null;
    get("drop-cursor").hidden = !second;
  }

  // By pointer.

  function near(x, isTouch) {
    const { begin } = view();
    const far = isTouch ? 16 : 6;
    const isAt = (ms) => ms !== null && Math.abs((ms - begin) / span * width() - x) <= far;
    if (second && isAt(second.ms)) return "second";
    return isAt(first()) ? "first" : null;
  }

  const xOf = (event) => event.clientX - plot.getBoundingClientRect().left;

  plot.addEventListener("pointerdown", (event) => {
    if (event.button || !bar.lead?.past) return;
    plot.setPointerCapture(event.pointerId);
    const x = xOf(event);
    pointers.set(event.pointerId, x);
    const { begin } = view();
    gesture = pointers.size > 1
      ? { kind: "pinch", begin, span, from: [...pointers.values()] }
      : { kind: near(x, event.pointerType === "touch") ?? "tap", begin, span, from: [x] };
  });

  plot.addEventListener("pointermove", (event) => {
    if (!gesture || !pointers.has(event.pointerId)) return;
    const x = xOf(event);
    pointers.set(event.pointerId, x);
    if (gesture.kind === "pinch") {
      const [a, b] = [...pointers.values()];
      const [was, is] = [gesture.from, [a, b ?? a]];
      const length = Math.max(LEAST, gesture.span * Math.max(10, Math.abs(was[1] - was[0])) / Math.max(10, Math.abs(is[1] - is[0])));
      const fixed = gesture.begin + (was[0] + was[1]) / 2 / width() * gesture.span;
      look(fixed - (is[0] + is[1]) / 2 / width() * length, length);
    } else if (gesture.kind === "first" || gesture.kind === "second") {
      put(gesture.kind === "second", snapped(event));
    } else if (gesture.kind === "pan" || gesture.kind === "tap" && Math.abs(x - gesture.from[0]) > 5) {
      gesture.kind = "pan";
      look(gesture.begin - (x - gesture.from[0]) / width() * gesture.span, span);
    }
  });

  for (const name of ["pointerup", "pointercancel"]) {
    plot.addEventListener(name, (event) => {
      if (!pointers.delete(event.pointerId)) return;
      if (name === "pointerup" && gesture?.kind === "tap") put(isSecond || event.shiftKey, snapped(event));
      const isMoved = gesture?.kind === "first" && pending !== null;
      // The finger that stays after two does nothing.
      gesture = pointers.size ? { kind: "none" } : null;
      // To the tick itself.
      if (isMoved) put(false, pending);
    });
  }

  plot.addEventListener("wheel", (event) => {
    if (event.ctrlKey && !event.deltaY) return;
    event.preventDefault();
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) pan((event.deltaX || event.deltaY) / 1000);
    else zoom(1.0015 ** Math.max(-400, Math.min(400, event.deltaY * (event.deltaMode ? 30 : 1))), timeAt(xOf(event)));
  }, { passive: false });

  // By key.

  const keys = {
    ArrowLeft: (event) => (event.shiftKey ? toEdge(-1) : step(-1)),
    ArrowRight: (event) => (event.shiftKey ? toEdge(1) : step(1)),
    PageUp: () => pan(-0.5),
    PageDown: () => pan(0.5),
    "+": () => zoom(0.5),
    "-": () => zoom(2),
    0: all,
    1: () => choose(false),
    2: () => choose(true),
    Delete: dropSecond,
    Escape: () => views.focus(),
  };

  plot.addEventListener("keydown", (event) => {
    const action = keys[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey || !bar.lead?.past) return;
    event.preventDefault();
    event.stopPropagation();
    action(event);
  });

  function dropSecond() {
    second = null;
    choose(false);
  }

  const buttons = { "cursor-1": () => choose(false), "cursor-2": () => choose(true), "drop-cursor": dropSecond, "last-edge": () => toEdge(-1), "next-edge": () => toEdge(1), "zoom-in": () => zoom(0.5), "zoom-out": () => zoom(2), "zoom-all": all, follow };
  for (const [id, action] of Object.entries(buttons)) {
    get(id).addEventListener("click", () => {
      if (bar.lead?.past) action();
      // It may vanish with the next frame.
      requestAnimationFrame(() => { if (get(id).hidden) plot.focus({ preventScroll: true }); });
    });
  }

  // Signals are dragged from the list.

  let wanting = 0;
  get("window").addEventListener("dragstart", (event) => {
    const signal = event.target.closest?.(".row.signal")?.signal;
    if (!signal) return;
    event.dataTransfer.setData(KIND, plant.keyOf(signal));
    event.dataTransfer.setData("text/plain", signal.name);
    event.dataTransfer.effectAllowed = "copy";
    // A drag ends if the page changes while it begins.
    wanting = setTimeout(() => {
      get("analyser").hidden = false;
      get("analyser").classList.add("is-wanted");
    });
  });
  document.addEventListener("dragend", () => {
    clearTimeout(wanting);
    get("analyser").classList.remove("is-wanted");
    get("analyser").hidden = !tracks.length;
  });
  get("analyser").addEventListener("dragover", (event) => {
    if (!event.dataTransfer.types.includes(KIND)) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = "copy";
  });
  get("analyser").addEventListener("drop", (event) => {
    const key = event.dataTransfer.getData(KIND);
    if (!key) return;
    event.preventDefault();
    add(plant.signals.find((signal) => plant.keyOf(signal) === key));
  });

  const sizes = new ResizeObserver(() => {
    plotWidth = plot.clientWidth;
    if (tracks.length) fit();
  });
  for (const it of [plot, get("axis")]) sizes.observe(it);
  return {
    add, renew, redraw, moved, stop, follow, zoom, pan, all, toEdge,
    isMoving: () => tracks.length > 0 && held === null,
    /** Sets what the page does: `say(text, isBad)`, `redraw()`. */
    begin(actions) { act = actions; },
    get tracks() { return tracks; },
    get second() { return second; },
    /** For measurements: the time on the axis, and the number of answers. */
    get view() { return { ...view(), isHeld: held !== null }; },
    get asked() { return asked; },
  };
})();
