"use strict";

// The events of the room for all tabs of a browser, which has only six connections to one host. In a shared worker this
// script reads one stream per token, of the pages that are visible in some tab, and passes each event to the tabs of its page;
// a browser without such workers runs it in each tab.

/**
 * Reads the events of the room, with a token or without. `tell` gets `{ isOpen }`, `{ tabs }` with the list of the room's tabs,
 * and `{ page, data }` with the state of a page; without data, the state is still the same.
 */
function stream(token, tell) {
  /** Without a message for this long the connection is given up. The room sends one every second. */
  const PATIENCE = 5000;
  /** The pause before the next attempt to listen. */
  const PAUSE = 1000;
  /** The current connection; replacing it ends the old one. */
  let line = null;
  /** The paths of the pages that it asks for. */
  let pages = [];
  /** When the last message came, or the connection began. */
  let heard = 0;

  /** Handles one server-sent event: a line with its name, and one with its data. */
  function hear(event) {
    const end = event.indexOf("\n");
    const name = event.slice("event: ".length, end);
    const data = event.slice(end + "\ndata: ".length);
    if (name === "tabs") tell({ tabs: data });
    else if (name === "beat") tell({ page: data });
    else tell({ page: name, data });
  }

  /** Reads events until the connection ends. An EventSource could do it, but cannot send a token. */
  async function read(mine) {
    const headers = token ? { Authorization: `Bearer ${token}` } : {};
    // Without any page the room still knows that the browser is there.
    const asked = (pages.length ? pages : [""]).map((page) => `page=${encodeURIComponent(page)}`);
    const answer = await fetch(`/events?${asked.join("&")}`, { headers, signal: mine.signal });
    if (!answer.ok || line !== mine) return;
    tell({ isOpen: true });
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    let parts = [];
    for (;;) {
      const { done, value } = await reader.read();
      if (done || line !== mine) return;
      heard = performance.now();
      // The end of an event can arrive in two pieces.
      let text = parts.at(-1)?.endsWith("\n") ? parts.pop() + value : value;
      for (let end; (end = text.indexOf("\n\n")) >= 0; text = text.slice(end + 2)) {
        hear(parts.join("") + text.slice(0, end));
        parts = [];
      }
      if (text) parts.push(text);
    }
  }

  /** Ends the connection. */
  function stop() {
    line?.abort();
    line = null;
  }

  /** Connects, or reconnects: the first event of each page has its complete state. */
  async function connect(wanted = pages) {
    stop();
    pages = wanted;
    const mine = new AbortController();
    line = mine;
    heard = performance.now();
    try {
      await read(mine);
    } catch {
      // The connection broke, or was refused: a later attempt follows.
    }
    if (line !== mine) return;
    tell({ isOpen: false });
    setTimeout(() => { if (line === mine) connect(); }, PAUSE);
  }

  // A connection can be lost silently, as when a computer sleeps or changes its network.
  setInterval(() => { if (line && performance.now() - heard > PATIENCE) connect(); }, 500);
  return { connect, stop, get pages() { return line ? pages : null; } };
}

if (typeof document === "undefined") {
  /** The page of each tab, or null for a hidden tab, which gets no events, so that none pile up there. */
  const tabs = new Map();
  const shared = stream(self.name, (message) => {
    for (const [tab, page] of tabs) if (page !== null && (message.page ?? page) === page) tab.postMessage(message);
  });
  self.onconnect = ({ ports: [tab] }) => {
    tab.onmessage = ({ data }) => {
      if (data === "leave") {
        tabs.delete(tab);
        tab.close();
      } else {
        tabs.set(tab, data.look ?? null);
      }
      const pages = [...new Set(tabs.values())].filter((page) => page !== null).sort();
      // While tabs with the token are open, values that they forced stay forced.
      if (!tabs.size || (!pages.length && !self.name)) shared.stop();
      // A tab that looks from now on needs the complete state.
      else if (data.look || shared.pages?.join() !== pages.join()) shared.connect(pages);
    };
  };
}
