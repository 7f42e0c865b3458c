"use strict";

// The head that all pages of a room have: title, tabs, connection, access, counts, and the lines of alarms.

const head = (() => {
  const make = (tag, id, given = {}) => Object.assign(document.createElement(tag), { id, ...given });
  /** Writes a text, if another one is there: the same text again would be read aloud again. */
  function write(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }
  const top = document.getElementById("top");
  const title = make("h1", "title", { textContent: document.title });
  const nav = make("nav", "tabs", { ariaLabel: "Pages", hidden: true });
  const link = make("span", "link", { className: "tag stale", role: "status", textContent: "connecting" });
  const access = make("span", "access", { className: "tag" });
  const counts = make("span", "counts", { className: "note" });
  const age = make("p", "age", { className: "alarm bad", role: "alert", hidden: true });
  const lost = make("span", "");
  // Read aloud once, and not again with each second.
  const since = make("span", "age-since", { ariaHidden: "true" });
  const alarms = make("div", "alarms");
  /** The page's own words: see `listen`. */
  let words = {};
  let isOld = true;
  /** The list of tabs, as the room gave it. */
  let known = "";
  /** The path of each tab. */
  let paths = [];

  const state = make("p", "", { className: "state" });
  state.append(link, " ", access, " ", counts);
  age.append(lost, " ", since);
  alarms.append(age);
  top.prepend(title, nav, state);
  top.append(alarms);

  const here = room.base || "/";
  /** True for a tab of this page; a page with several tabs has one for each fragment of its address. */
  const same = (path) => path.split("#")[0] === here;

  /** Marks the tab of this page. */
  function mark() {
    // The path of the only studio leads to the studio of a driver, too.
    const near = (path) => path !== "/" && here !== "/" && (`${path}/`.startsWith(`${here}/`) || `${here}/`.startsWith(`${path}/`));
    const fragment = words.tabs?.now() ?? location.hash;
    const current = paths.find((path) => path === here + fragment) ?? paths.find(same) ?? paths.find(near);
    for (const [i, tab] of [...nav.children].entries()) {
      tab.hidden = words.tabs !== undefined && same(paths[i]) && !words.tabs.has(paths[i].slice(here.length));
      if (paths[i] === current) tab.setAttribute("aria-current", "page");
      else tab.removeAttribute("aria-current");
    }
    // On a phone the row of tabs scrolls.
    const tab = nav.querySelector("[aria-current]");
    const end = nav.scrollLeft + nav.clientWidth;
    if (tab && (tab.offsetLeft < nav.scrollLeft || tab.offsetLeft + tab.offsetWidth > end)) nav.scrollLeft = tab.offsetLeft - (nav.clientWidth - tab.offsetWidth) / 2;
  }

  function showTabs(text) {
    if (text === known) return;
    known = text;
    const pages = JSON.parse(text);
    paths = pages.map(({ path }) => path);
    nav.replaceChildren(...pages.map(({ path, name, wide }) => make("a", "", { href: path, textContent: name, className: wide ? "only-wide" : "" })));
    // The only tab is the way out of a page that has left.
    nav.hidden = pages.length === 0 || (pages.length === 1 && same(paths[0]));
    mark();
  }

  nav.addEventListener("click", (event) => {
    const path = paths[[...nav.children].indexOf(event.target.closest("a"))];
    if (!path || !words.tabs || !same(path) || event.ctrlKey || event.metaKey || event.shiftKey) return;
    // Following the link itself would take the focus from it.
    event.preventDefault();
    words.tabs.go(path.slice(here.length));
  });

  /** Shows the connection: by the page's own words while it is there. */
  function showLink() {
    const [text, kind] = isOld ? ["no connection", "bad"] : words.link?.() ?? ["live", "good"];
    write(link, text);
    link.className = `tag ${kind}`;
  }

  /**
   * Makes a line for an alarm that nobody may overlook, of the kind "bad" or "stale", with `[id, name, act]` for each of its
   * buttons. The returned function shows a text on it, or hides it without one.
   */
  function alarm(id, kind, buttons = []) {
    const line = make("div", id, { className: `alarm ${kind}`, hidden: true });
    const text = make("span", `${id}-text`);
    line.append(text, ...buttons.map(([button, name, act]) => {
      const it = make("button", button, { type: "button", textContent: name });
      it.addEventListener("click", act);
      return it;
    }));
    alarms.append(line);
    return (told) => {
      line.hidden = !told;
      write(text, told);
    };
  }

  /**
   * Listens to the room as `room.listen` does, and shows the connection and the access in the head. The page gives its words:
   * `may` for access with the token and `mayNot` for the way to get it, `lost` for a lost connection, and `link`, if it has
   * other states than "live". A page with several tabs has `tabs`: `now()` is the fragment of the address of the one that is
   * shown, `has(fragment)` is false for one that is empty, and `go(fragment)` shows one.
   */
  function listen(listener) {
    words = listener;
    room.listen({
      ...listener,
      tabs: showTabs,
      access(isRight, refusal) {
        write(access, isRight ? words.may : "read-only");
        access.classList.toggle("good", isRight);
        access.title = isRight ? "" : words.mayNot;
        document.body.classList.toggle("read-only", !isRight);
        listener.access(isRight, refusal);
      },
      age(isNowOld, seconds, isKnown) {
        isOld = isNowOld;
        document.body.classList.toggle("is-old", isOld);
        showLink();
        age.hidden = !isOld;
        write(lost, words.lost);
        if (isOld) write(since, isKnown ? `What is shown is ${seconds} s old.` : "");
        listener.age?.(isOld);
      },
    });
  }

  for (const event of ["hashchange", "resize"]) window.addEventListener(event, mark);

  return {
    alarm,
    count: (text) => write(counts, text),
    listen,
    /** Marks the tab that is shown. */
    mark,
    showLink,
    /** Writes the title of the page, and that of the browser's tab. */
    title(text, ofTab) {
      write(title, text);
      document.title = ofTab;
    },
  };
})();
