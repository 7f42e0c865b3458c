"use strict";

// The views of the page: the overview, or one thing at a time over the whole window. The address has the view behind "#".

const views = (() => {
  /** A phone, upright or on its side, has room for one thing at a time. */
  const phone = matchMedia("(max-width: 700px), (max-height: 479px)");
  const nav = document.getElementById("views");
  const links = [...nav.children];
  const NAMES = links.map(({ dataset }) => dataset.view);
  let act = { shown() {} };
  /** The view that the address asks for, and the one that is shown. */
  let asked = "";
  let now = "";

  const has = {
    overview: () => !phone.matches,
    machine: () => plant.drivers.some(({ picture }) => picture),
    signals: () => true,
    line: () => true,
    recording: () => plant.drivers.some(({ past }) => past),
  };

  const usual = () => (has.overview() ? "overview" : has.machine() ? "machine" : "signals");

  /** Takes the view from the address; what else is behind "#" belongs to other scripts. */
  function read() {
    const hash = location.hash.slice(1);
    if (NAMES.includes(hash)) asked = hash;
    else if (hash === "") asked = "";
    else if (hash.startsWith("list=")) asked = phone.matches ? "signals" : "";
    redraw();
  }

  /** Shows the view that the address asks for, if the page has it. */
  function redraw() {
    for (const link of links) {
      const isHidden = !has[link.dataset.view]();
      if (link.hidden !== isHidden) link.hidden = isHidden;
    }
    const view = has[asked]?.() ? asked : usual();
    if (view === now) return;
    now = view;
    document.body.dataset.view = view;
    document.body.classList.toggle("is-single", view !== "overview");
    for (const link of links) {
      if (link.dataset.view === view) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    document.getElementById("times").role = view === "recording" ? "main" : null;
    document.getElementById("left").scrollTop = 0;
    if (view === "line") for (const events of document.querySelectorAll(".events")) events.open = true;
    // The focus must not stay on what is no longer shown.
    if (document.activeElement?.checkVisibility() === false) focus();
    act.shown();
  }

  function go(view) {
    asked = view;
    const path = location.pathname + location.search;
    history.pushState(null, "", view === "overview" ? path : `${path}#${view}`);
    redraw();
  }

  /** Gives the focus to the list, or to the tab of a view without it. */
  function focus() {
    const own = document.getElementById("list");
    const to = own.checkVisibility() ? own : links.find(({ dataset }) => dataset.view === now);
    to.focus({ preventScroll: true });
  }

  nav.addEventListener("click", (event) => {
    const view = event.target.closest("a")?.dataset.view;
    if (!view || event.ctrlKey || event.metaKey || event.shiftKey) return;
    // Following the link itself would take the focus from it.
    event.preventDefault();
    if (view !== now) go(view);
  });
  window.addEventListener("popstate", read);
  phone.addEventListener("change", redraw);
  /** On a phone the rows come first, and the tools of the list are folded. */
  const fold = () => { document.getElementById("watch-fold").open = !phone.matches; };
  phone.addEventListener("change", fold);
  fold();

  return {
    redraw, focus,
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
