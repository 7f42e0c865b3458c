"use strict";

// The views of the page: the overview, or one thing at a time over the whole window. The address has the view behind "#", and
// the list of signals, if it has a name: `#signals&list=NAME`. Each view has a tab in the head.

const views = (() => {
  /** A phone, upright or on its side, has room for one thing at a time. */
  const phone = matchMedia("(max-width: 700px), (max-height: 479px)");
  let act = { shown() {} };
  /** The view that the address asks for, the one that is shown, and all that have a tab. */
  let asked = "";
  let now = "";
  let offered = "";

  const has = {
    overview: () => !phone.matches,
    machine: () => plant.drivers.some(({ picture }) => picture),
    signals: () => true,
    line: () => true,
    recording: () => plant.drivers.some(({ past }) => past),
  };

  const NAMES = Object.keys(has);
  const fragmentOf = (view) => (view === "overview" ? "" : `#${view}`);
  const viewOf = (fragment) => fragment.slice(1) || "overview";

  const parts = () => location.hash.slice(1).split("&");
  const listPart = () => parts().find((part) => part.startsWith("list="));

  function addressOf(view, list) {
    const fragment = [fragmentOf(view).slice(1), list].filter(Boolean).join("&");
    return location.pathname + location.search + (fragment && `#${fragment}`);
  }

  const usual = () => (has.overview() ? "overview" : has.machine() ? "machine" : "signals");

  /** Takes the view from the address; what else is behind "#" belongs to other scripts. */
  function read() {
    const [first] = parts();
    if (NAMES.includes(first)) asked = first;
    else if (first === "") asked = "";
    else if (first.startsWith("list=")) asked = phone.matches ? "signals" : "";
    redraw();
  }

  /** Shows the view that the address asks for, if the page has it. */
  function redraw() {
    const view = has[asked]?.() ? asked : usual();
    const shown = NAMES.filter((name) => has[name]()).join();
    if (view === now && shown === offered) return;
    const isOther = view !== now;
    [now, offered] = [view, shown];
    head.mark();
    if (isOther) change();
  }

  /** Lays the page out for another view. */
  function change() {
    document.body.dataset.view = now;
    document.body.classList.toggle("is-single", now !== "overview");
    document.getElementById("times").role = now === "recording" ? "main" : null;
    document.getElementById("left").scrollTop = 0;
    if (now === "line") for (const events of document.querySelectorAll(".events")) events.open = true;
    // The focus must not stay on what is no longer shown.
    if (document.activeElement?.checkVisibility() === false) focus();
    act.shown();
  }

  function go(view) {
    asked = view;
    history.pushState(null, "", addressOf(view, listPart()));
    redraw();
  }

  /** Gives the focus to the list, or to the tab of a view without it. */
  function focus() {
    const own = document.getElementById("list");
    const to = own.checkVisibility() ? own : document.querySelector("#tabs [aria-current]");
    to?.focus({ preventScroll: true });
  }

  window.addEventListener("popstate", read);
  // The browser looks for an element with the name of the view, and takes the focus away.
  window.addEventListener("hashchange", () => { if (document.activeElement === document.body) focus(); });
  phone.addEventListener("change", redraw);
  /** On a phone the rows come first, and the tools of the list are folded. */
  const fold = () => { document.getElementById("watch-fold").open = !phone.matches; };
  phone.addEventListener("change", fold);
  fold();

  return {
    redraw, focus,
    /** The tabs of the head. */
    tabs: {
      now: () => fragmentOf(now),
      has: (fragment) => has[viewOf(fragment)]?.() ?? true,
      go(fragment) {
        const view = viewOf(fragment);
        // A view that was asked for and is empty now would come back by itself.
        if (view !== now || (asked && asked !== view)) go(view);
      },
    },
    /** The name of the list in the address; null without one. */
    get list() {
      try {
        return decodeURIComponent(listPart()?.slice("list=".length) ?? "") || null;
      } catch {
        return null;
      }
    },
    set list(name) { history.replaceState(null, "", addressOf(asked, name && `list=${encodeURIComponent(name)}`)); },
    /** Shows a view, unless the overview shows it already. */
    reveal(view) { if (now !== "overview" && now !== view) go(view); },
    /** Sets what the page does after another view is shown. */
    begin(actions) {
      act = actions;
      read();
    },
    get now() { return now; },
    get isPhone() { return phone.matches; },
  };
})();
