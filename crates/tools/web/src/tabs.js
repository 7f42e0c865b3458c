"use strict";

// The tabs in the head of a page, for a room that has several pages.

const tabs = (() => {
  /** Shows the pages of this room in the element `tabs`, unless there is only one. */
  async function show() {
    let pages = [];
    try {
      const answer = await room.ask("/tabs", {});
      if (answer.ok) pages = await answer.json();
    } catch {
      // Other requests report a server that does not answer.
      return;
    }
    const here = location.pathname + location.search;
    const current = pages.find(({ path }) => path === here) ?? pages.find(({ path }) => path.split("?")[0] === location.pathname);
    const links = pages.map((page) => {
      const link = Object.assign(document.createElement("a"), { href: page.path, textContent: page.name });
      if (page === current) link.setAttribute("aria-current", "page");
      return link;
    });
    const nav = document.getElementById("tabs");
    nav.hidden = links.length < 2;
    nav.replaceChildren(...links);
  }

  return { show };
})();
