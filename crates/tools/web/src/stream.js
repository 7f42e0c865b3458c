"use strict";

// The events of the room for all tabs of a browser, which has only six connections to one host. In a shared worker this
// script reads one stream per token and passes each event to every tab; a browser without such workers runs it in each tab.

/** Reads the events of the room, with a token or without. `tell` gets `{ isOpen }` and `{ event }`. */
function stream(token, tell) {
  /** Without a message for this long the connection is given up. The room sends one every second. */
  const PATIENCE = 5000;
  /** The pause before the next attempt to listen. */
  const PAUSE = 1000;
  /** The current connection; replacing it ends the old one. */
  let line = null;
  /** When the last message came, or the connection began. */
  let heard = 0;

  /** Reads events until the connection ends. An EventSource could do it, but cannot send a token. */
  async function read(mine) {
    const headers = token ? { Authorization: `Bearer ${token}` } : {};
    const answer = await fetch("/events", { headers, signal: mine.signal });
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
        tell({ event: parts.join("") + text.slice(0, end) });
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

  /** Connects, or reconnects: the first event has the complete state. */
  async function connect() {
    stop();
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
  return { connect, stop };
}

if (typeof document === "undefined") {
  /** The tabs, and whether each is visible: hidden ones get no events, so that none pile up there. */
  const tabs = new Map();
  const shared = stream(self.name, (message) => {
    for (const [tab, looks] of tabs) if (looks) tab.postMessage(message);
  });
  self.onconnect = ({ ports: [tab] }) => {
    tab.onmessage = ({ data }) => {
      if (data === "leave") {
        tabs.delete(tab);
        tab.close();
      } else {
        tabs.set(tab, data === "look");
      }
      const someLook = Array.from(tabs.values()).some(Boolean);
      if (data === "look") shared.connect();
      // While tabs with the token are open, values that they forced stay forced.
      else if (!tabs.size || (!someLook && !self.name)) shared.stop();
    };
  };
}
