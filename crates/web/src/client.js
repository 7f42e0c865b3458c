"use strict";

// What the scripts of every page of the room share: the token, asking, and listening to the newest state.

const room = (() => {
  /** Without a word for this long, what is shown counts as old. The room says something every 2 s. */
  const PATIENCE = 5000;
  /** Without an answer for this long, nobody waits any more. */
  const LONGEST = 10000;
  /** The pause before the next attempt to listen. */
  const PAUSE = 1000;
  let tell = {};
  /** The connection that is listened to; whoever ends it makes it another one. */
  let line = null;
  let isOpen = false;
  let heard = 0;
  /** When it was listened for the first time, or again. */
  let begun = 0;

  /** The token comes behind "#", which is sent to nobody, and leaves the address at once. */
  function takeToken() {
    const given = /^#token=([0-9a-f]+)$/.exec(location.hash);
    if (!given) return;
    sessionStorage.setItem("token", given[1]);
    history.replaceState(null, "", location.pathname);
  }

  function headers() {
    const token = sessionStorage.getItem("token");
    return token ? { Authorization: `Bearer ${token}` } : {};
  }

  const ask = (path, options) => fetch(path, { ...options, headers: headers(), signal: AbortSignal.timeout(LONGEST) });

  async function askAccess() {
    try {
      const answer = await ask("/access");
      const access = await answer.json();
      tell.access(access.may_change === true, answer.ok ? "" : access.text);
    } catch {
      // Whoever does not answer is missed elsewhere.
    }
  }

  /** Asks for a change: `{ ok, code, text }`, or null if nobody answers. */
  async function change(method, path, body) {
    try {
      const answer = await ask(path, { method, body });
      return { ok: answer.ok, ...await answer.json() };
    } catch {
      return null;
    }
  }

  function setAge() {
    const now = performance.now();
    // A connection may be lost without a word, as when a computer sleeps or changes its network.
    if (now - Math.max(heard, begun) > PATIENCE) connect();
    tell.age(now - heard > PATIENCE || !isOpen, Math.round((now - heard) / 1000));
  }

  /** One server-sent event. */
  function hear(event) {
    heard = performance.now();
    const data = /^data: ?([^\n]*)$/m.exec(event);
    try {
      if (data && !event.startsWith("event: beat")) tell.news(data[1]);
    } catch (error) {
      // A defect of the page does not end the connection.
      reportError(error);
    }
    setAge();
  }

  /** Reads events until the connection ends. An EventSource would do it, but cannot send a token. */
  async function read(mine) {
    const answer = await fetch("/events", { headers: headers(), signal: mine.signal });
    if (!answer.ok) return;
    isOpen = true;
    askAccess();
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    let parts = [];
    for (;;) {
      const { done, value } = await reader.read();
      if (done || line !== mine) return;
      // The end of an event may come in two pieces.
      let text = parts.at(-1)?.endsWith("\n") ? parts.pop() + value : value;
      for (let end; (end = text.indexOf("\n\n")) >= 0; text = text.slice(end + 2)) {
        hear(parts.join("") + text.slice(0, end));
        parts = [];
      }
      if (text) parts.push(text);
    }
  }

  async function connect() {
    line?.abort();
    const mine = new AbortController();
    line = mine;
    isOpen = false;
    // A browser has few connections to one host for all of its tabs. Whoever has the token is still there, though, and what
    // was forced stays so.
    if (document.hidden && !sessionStorage.getItem("token")) return;
    begun = performance.now();
    try {
      await read(mine);
    } catch {
      // It broke, or was never there: it is tried again.
    }
    if (line !== mine) return;
    isOpen = false;
    setAge();
    setTimeout(() => { if (line === mine) connect(); }, PAUSE);
  }

  /**
   * Listens for good. `news` gets each event as text; `access` whether changes are allowed and, if a token was refused, why;
   * `age` twice a second whether what is shown is old, and by how many seconds.
   */
  function listen(listener) {
    tell = listener;
    takeToken();
    // Another token that is put into the address of this tab loads nothing.
    window.addEventListener("hashchange", () => {
      takeToken();
      connect();
    });
    document.addEventListener("visibilitychange", () => {
      if (!isOpen || !sessionStorage.getItem("token")) connect();
    });
    connect();
    setInterval(setAge, 500);
  }

  return { ask, change, listen };
})();
