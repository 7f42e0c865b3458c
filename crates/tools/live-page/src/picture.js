"use strict";

// The machines' pictures. The server has sanitised each one and parsed its bindings into `data-tb`, a list of `{ do, signal,
// edges, map }`; see `mapped` below for maps.

const pictures = (() => {
  const box = document.getElementById("pictures");
  const NAMESPACE = "http://www.w3.org/2000/svg";
  let all = [];
  let generation = 0;
  /** The longest step of an animation, in milliseconds, so that a page that was in the background does not jump. */
  const LONGEST = 200;
  let last = 0;

  async function load() {
    const mine = ++generation;
    const wanted = plant.drivers.filter(({ picture }) => picture);
    document.getElementById("machine").hidden = wanted.length === 0;
    document.body.classList.toggle("has-picture", wanted.length > 0);
    const loaded = await Promise.all(wanted.map(one));
    if (mine !== generation) return;
    all = loaded.filter(Boolean);
    box.replaceChildren(...all.map(({ element }) => element));
    for (const picture of all) prepare(picture);
    touch.prepare(all);
    pads.prepare();
    move();
  }

  async function one(driver) {
    try {
      const [drawing, notes] = await Promise.all([room.ask(`/picture/${driver.id}.svg`), room.ask(`/picture/${driver.id}.json`)]);
      const told = notes.ok ? await notes.json() : { left_out: [], mistakes: [] };
      const element = document.createElement("figure");
      element.className = "picture";
      const frame = document.createElement("div");
      element.append(frame);
      tell(element, "warn", "This picture has mistakes: what they are about does not move.", told.mistakes);
      tell(element, "note", "Left out of this picture:", told.left_out);
      if (!drawing.ok) {
        const text = document.createElement("p");
        text.className = "note";
        text.textContent = (await drawing.json()).text;
        frame.append(text);
        return { driver, element, movers: [], root: null };
      }
      // The page's policy allows the parsed picture no styles but the page's own: rename them, and add them in another way
      // below.
      const text = (await drawing.text()).replace(/<(\/?)style\b/g, "<$1styles");
      const root = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
      if (root.namespaceURI !== NAMESPACE) return null;
      const title = root.querySelector(":scope > title")?.textContent;
      if (!root.hasAttribute("viewBox") && root.width.baseVal.value) {
        root.setAttribute("viewBox", `0 0 ${root.width.baseVal.value} ${root.height.baseVal.value}`);
      }
      const { width, height } = root.viewBox.baseVal ?? {};
      if (width && height) element.style.setProperty("--ratio", width / height);
      root.setAttribute("role", "img");
      root.setAttribute("aria-label", title || `The machine of ${driver.name}`);
      // A picture's gradient names and styles must not affect the page, so it lives in a shadow root within its frame.
      const host = document.createElement("div");
      frame.append(host);
      const shadow = host.attachShadow({ mode: "open" });
      const sheet = new CSSStyleSheet();
      const styles = Array.from(root.querySelectorAll("styles"), (style) => style.textContent);
      for (const style of root.querySelectorAll("styles")) style.remove();
      sheet.replaceSync(`${styles.join("\n")}\nsvg:root, :host > svg { display: block; width: 100%; height: auto; max-height: var(--picture-height, none); }`);
      shadow.adoptedStyleSheets = [sheet];
      shadow.append(document.importNode(root, true));
      const notice = document.createElement("p");
      notice.className = "stale-notice";
      notice.textContent = "Not live: parts of this picture show fail-safe or stale values.";
      notice.hidden = true;
      frame.append(notice);
      return { driver, element, root: shadow.firstElementChild, movers: [], notice };
    } catch {
      return null;
    }
  }

  function tell(element, className, title, list) {
    if (!list?.length) return;
    const details = document.createElement("details");
    details.className = className;
    const summary = document.createElement("summary");
    summary.textContent = `${title} ${list.length}`;
    const items = document.createElement("ul");
    for (const text of list) {
      const item = document.createElement("li");
      item.textContent = text;
      items.append(item);
    }
    details.append(summary, items);
    details.open = className === "warn";
    element.append(details);
  }

  /** Finds the moving elements, and their original positions, before anything is hidden. */
  function prepare(picture) {
    if (!picture.root) return;
    for (const element of picture.root.querySelectorAll("[data-tb]")) {
      const bindings = JSON.parse(element.dataset.tb);
      const signals = bindings.map(({ signal }) => picture.driver.byName.get(signal) ?? null);
      if (element === picture.root) continue;
      // A copy, because the element's own matrix changes with its transforms.
      const base = picture.root.createSVGMatrix().multiply(element.transform?.baseVal.consolidate()?.matrix ?? picture.root.createSVGMatrix());
      let area = { x: 0, y: 0, width: 0, height: 0 };
      try {
        area = element.getBBox();
      } catch {
        // An element within a definition has no position.
      }
      picture.movers.push({
        element, bindings, signals, base, area,
        pivot: (element.dataset.tbPivot ?? "").split(" ").filter(Boolean).map(Number),
        smooth: Number(element.dataset.tbSmooth ?? 0) * 1000,
        was: {}, moving: {}, spun: 0,
      });
    }
  }

  /**
   * The result of a value: the value itself without a map; by `{ factor, offset }`; or by the first of `{ cases: [[from, to,
   * out], …] }` whose range contains it, where a null `from` means "else" and an `out` of two values interpolates. For
   * numbers beyond all ranges the nearest end counts. `undefined`: as drawn.
   */
  function mapped(map, value) {
    if (!map) return value;
    if (map.factor !== undefined) return value * map.factor + map.offset;
    let near = null;
    for (const [from, to, out] of map.cases) {
      if (from === null) return Array.isArray(out) ? out[0] : out;
      const [low, high] = from < to ? [from, to] : [to, from];
      const clamped = Math.min(high, Math.max(low, value));
      const found = Array.isArray(out) ? between(out, to === from ? 1 : (clamped - from) / (to - from)) : out;
      if (value >= low && value <= high) return found;
      const distance = Math.abs(clamped - value);
      if (Array.isArray(out) && (near === null || distance < near.distance)) near = { distance, found };
    }
    return near?.found;
  }

  function between([from, to], share) {
    if (typeof from === "number") return from + (to - from) * share;
    const parts = [from, to].map((colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16)));
    return `rgb(${parts[0].map((part, i) => Math.round(part + (parts[1][i] - part) * share)).join(", ")})`;
  }

  /** A text with the value in place of `{}` (formatted as in the list), or of `{0.00}` with that number of decimals. */
  const filled = (pattern, signal, value) => pattern.replace(/\{(0(?:\.0*)?)?\}/g, (_, digits) => {
    if (digits === undefined && !signal) return String(value);
    if (digits === undefined) return signal.unit ? `${words.value(signal)} ${signal.unit}` : words.value(signal);
    return value.toFixed((digits.split(".")[1] ?? "").length).replace("-", "−");
  });

  /** The current value of a moving property: it reaches a new target at constant speed within the drawing's time. */
  function eased(mover, what, target, now) {
    if (!mover.smooth || !Number.isFinite(target) || plant.isPast) return target;
    const way = mover.moving[what] ??= { from: target, to: target, begin: now - mover.smooth };
    const at = () => way.from + (way.to - way.from) * Math.min(1, (now - way.begin) / mover.smooth);
    if (way.to !== target) Object.assign(way, { from: at(), to: target, begin: now });
    if (now - way.begin < mover.smooth) isBusy = true;
    return at();
  }

  let isBusy = false;

  /** Updates the pictures from the signals. Returns whether something still moves. */
  function move() {
    const now = performance.now();
    // What spins stands still in a moment of the past, and what moves slowly is where it is.
    const passed = plant.isPast ? 0 : Math.min(LONGEST, now - last);
    last = now;
    isBusy = false;
    for (const { driver, movers, root, element, notice } of all) {
      if (!root) continue;
      for (const mover of movers) moveOne(driver, mover, root, now, passed);
      const isStale = movers.some(({ signals }) => signals.some((signal) => signal && (signal.isStale || signal.isFailSafe) && !signal.isForced));
      element.classList.toggle("is-stale", isStale);
      notice.hidden = !isStale;
    }
    return isBusy;
  }

  function moveOne(driver, mover, root, now, passed) {
    const place = { x: 0, y: 0, turn: 0, scale: 1, width: 1, height: 1 };
    let isPlaced = false;
    mover.bindings.forEach((binding, i) => {
      const signal = mover.signals[i];
      // Edges are only counted with a latch.
      const value = signal === null ? ofBus(driver, binding.signal) : binding.edges ? signal.edges ?? NaN : plant.number(signal);
      if (Number.isNaN(value)) return;
      const out = mapped(binding.map, value);
      switch (binding.do) {
        case "show":
        case "hide": {
          const isThere = binding.map ? out !== undefined : value !== 0;
          style(mover, "display", isThere === (binding.do === "show") ? "inline" : "none");
          break;
        }
        case "fill":
        case "stroke":
          style(mover, binding.do, out ?? null);
          break;
        case "opacity":
          style(mover, "opacity", out === undefined ? null : String(Math.min(1, Math.max(0, out))));
          break;
        case "text":
          say(mover, filled(binding.map && out !== undefined ? String(out) : "{}", binding.edges ? null : signal, value));
          break;
        case "press":
        case "switch":
          break;
        case "spin":
          mover.spun = (mover.spun + (out ?? 0) * passed / 1000) % 360;
          place.turn += mover.spun;
          if (out && !plant.isPast) isBusy = true;
          isPlaced = true;
          break;
        default: {
          const target = out === undefined ? place[binding.do] : eased(mover, binding.do, out, now);
          place[binding.do] = binding.do === "turn" ? place.turn + target : target;
          isPlaced = true;
        }
      }
    });
    if (!isPlaced) return;
    const transform = matrix(mover, place, root);
    if (mover.was.transform === transform) return;
    mover.was.transform = transform;
    mover.element.setAttribute("transform", transform);
  }

  /** An element's matrix: moved, and turned and scaled about its middle or the drawing's pivot. */
  function matrix({ base, area, pivot }, { x, y, turn, scale, width, height }, root) {
    const point = root.createSVGPoint();
    [point.x, point.y] = pivot.length === 2 ? pivot : [area.x + area.width / 2, area.y + area.height / 2];
    const centre = point.matrixTransform(base);
    let to = root.createSVGMatrix().translate(centre.x + x, centre.y + y).rotate(turn).scale(scale).translate(-centre.x, -centre.y).multiply(base);
    // A level rises from the bottom of the drawn shape, and a bar grows from its left.
    if (width !== 1 || height !== 1) {
      const [left, bottom] = [area.x, area.y + area.height];
      to = to.translate(left, bottom).scaleNonUniform(Math.max(0, width), Math.max(0, height)).translate(-left, -bottom);
    }
    return `matrix(${[to.a, to.b, to.c, to.d, to.e, to.f].map((it) => Number(it.toFixed(4))).join(" ")})`;
  }

  function ofBus(driver, name) {
    const line = plant.lineOf(driver);
    if (!line) return NaN;
    if (name === "bus.age") return Math.max(...line.stations.map(({ age_ms: age }) => age ?? NaN));
    if (name !== "bus.status") return NaN;
    return { fresh: 0, unchanged: 1, stale: 2 }[line.status] ?? NaN;
  }

  /** Sets a property, which overrides the drawing and its style sheet; null removes it. */
  function style(mover, name, value) {
    if (mover.was[name] === value) return;
    mover.was[name] = value;
    if (value === null) mover.element.style.removeProperty(name);
    else mover.element.style.setProperty(name, value);
  }

  function say(mover, text) {
    if (mover.was.text === text) return;
    mover.was.text = text;
    // Inkscape writes each line of a text as a span with its own position.
    const line = mover.element.querySelector("tspan") ?? mover.element;
    line.textContent = text;
  }

  return { load, move, get all() { return all; } };
})();
