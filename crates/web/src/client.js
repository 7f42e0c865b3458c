"use strict";

// What the scripts of every page of the room share: the token, asking, and listening to the newest state.

const room = (() => {
  /** Without a word for this long, what is shown counts as old. The room says something every second. */
  const PATIENCE = 2500;
  /** Without an answer for this long, nobody waits any more. */
  const LONGEST = 10000;
  let tell = {};
  /** What this tab listens to, with its token. */
  let mine = null;
  let isOpen = false;
  let heard = 0;

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

  function take({ event, isOpen: isNowOpen }) {
    if (event !== undefined) return hear(event);
    isOpen = isNowOpen;
    if (isOpen) askAccess();
    setAge();
  }

  /** What reads for this tab with this token: a worker for all tabs, or the tab itself. */
  function source(token) {
    const takeOwn = (message) => { if (token === mine?.token) take(message); };
    if (!window.SharedWorker) {
      const own = stream(token, takeOwn);
      // A hidden tab leaves its connection to others, unless it has forced something.
      return { look: own.connect, rest: () => { if (!token) own.stop(); }, leave: own.stop };
    }
    const { port } = new SharedWorker("/stream.js", { name: token });
    port.onmessage = ({ data }) => takeOwn(data);
    return { look: () => port.postMessage("look"), rest: () => port.postMessage("rest"), leave: () => port.postMessage("leave") };
  }

  function connect() {
    const token = sessionStorage.getItem("token") ?? "";
    if (token !== mine?.token) {
      mine?.from.leave();
      mine = { token, from: source(token) };
    }
    isOpen = false;
    if (document.hidden) mine.from.rest();
    else mine.from.look();
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
    document.addEventListener("visibilitychange", connect);
    window.addEventListener("pagehide", () => {
      mine.from.leave();
      mine = null;
    });
    window.addEventListener("pageshow", ({ persisted }) => { if (persisted) connect(); });
    connect();
    setInterval(setAge, 500);
  }

  return { ask, change, listen };
})();
