"use strict";

// What the scripts of every page of the room share: the token, asking, and listening to the newest state.

const room = (() => {
  /** Without a word for this long, what is shown counts as old. The room says something every 2 s. */
  const PATIENCE = 5000;
  /** Without an answer for this long, nobody waits any more. */
  const LONGEST = 10000;
  let tell = () => {};
  let source = null;
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
    const isOpen = source?.readyState === EventSource.OPEN;
    // A connection may be lost without a word, as when a computer sleeps or changes its network.
    if (isOpen && now - Math.max(heard, begun) > PATIENCE) connect();
    tell.age(now - heard > PATIENCE || !isOpen, Math.round((now - heard) / 1000));
  }

  function connect() {
    source?.close();
    source = null;
    // A browser has few connections to one host for all of its tabs.
    if (document.hidden) return;
    begun = performance.now();
    source = new EventSource("/events");
    source.onopen = askAccess;
    source.onmessage = (event) => {
      heard = performance.now();
      tell.news(event.data);
      setAge();
    };
    source.addEventListener("beat", () => {
      heard = performance.now();
      setAge();
    });
    source.onerror = () => {
      setAge();
      // A refusal ends the source for good; a broken connection it restores itself.
      if (source?.readyState === EventSource.CLOSED) setTimeout(connectAgain, 1000);
    };
  }

  function connectAgain() {
    if (source?.readyState === EventSource.CLOSED) connect();
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
      askAccess();
    });
    document.addEventListener("visibilitychange", connect);
    connect();
    setInterval(setAge, 500);
  }

  return { ask, change, listen };
})();
