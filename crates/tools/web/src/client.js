"use strict";

// Shared by the scripts of every page of the room: the token, requests, and listening to the newest state.

const room = (() => {
  /** Without a message for this long, the displayed state counts as old. The room sends one every second. */
  const PATIENCE = 2500;
  /** The time-out of a request. */
  const LONGEST = 10000;
  /** The path of this page, which its own requests begin with; empty for the first page of the room. */
  const base = location.pathname.replace(/\/$/, "");
  /** The page whose state is shown. */
  let page = base || "/";
  let tell = {};
  /** The event source of this tab, and its token. */
  let mine = null;
  let isOpen = false;
  let heard = 0;
  /** True after the first state. */
  let isKnown = false;
  /** True if the page has taken the newest state. */
  let isTaken = false;

  /** Takes the token from behind "#", which browsers never send, and removes it from the address at once; true if there was one. */
  function takeToken() {
    const given = /^#token=([0-9a-f]+)$/.exec(location.hash);
    if (!given) return false;
    sessionStorage.setItem("token", given[1]);
    history.replaceState(null, "", location.pathname + location.search);
    return true;
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
      // Other requests report a server that does not answer.
    }
  }

  /** Requests a change: returns `{ ok, code, text }`, or null without an answer. */
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
    tell.age(now - heard > PATIENCE || !isOpen, Math.round((now - heard) / 1000), isKnown);
  }

  /** Hands a state to the page. If it is that of another kind of page, its program has the address of this one now. */
  function takeState(data) {
    isTaken = false;
    isTaken = tell.news(data) !== false;
    // Not before the first state: a page that fits nothing is not loaded again and again.
    if (!isTaken && isKnown && !tell.page) location.reload();
    isKnown ||= isTaken;
  }

  function take(message) {
    if (message.isOpen !== undefined) {
      isOpen = message.isOpen;
      if (isOpen) askAccess();
    } else if (message.tabs) {
      tell.tabs?.(message.tabs);
      return;
    } else if (message.page === page) {
      try {
        if (message.data) takeState(message.data);
        if (isTaken) heard = performance.now();
      } catch (error) {
        // A defect of the page does not end the connection.
        reportError(error);
      }
    }
    setAge();
  }

  /** The reader for this tab and token: a worker for all tabs, or the tab itself. */
  function source(token) {
    const takeOwn = (message) => { if (token === mine?.token) take(message); };
    if (!window.SharedWorker) {
      const own = stream(token, takeOwn);
      // A hidden tab frees its connection for other tabs, unless it has a token and may have forced something.
      return { look: () => own.connect([page]), rest: () => (token ? own.connect([]) : own.stop()), leave: own.stop };
    }
    const { port } = new SharedWorker("/stream.js", { name: token });
    port.onmessage = ({ data }) => takeOwn(data);
    return { look: () => port.postMessage({ look: page }), rest: () => port.postMessage({}), leave: () => port.postMessage("leave") };
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
   * Listens forever. `news` gets each state as text, of this page or of `page`, and returns false for that of another kind of
   * page; `tabs` the list of the room's tabs, as text;
   * `access` whether changes are allowed and, if a token was refused, why;
   * `age` twice a second whether the displayed state is old, by how many seconds, and if there is any.
   */
  function listen(listener) {
    tell = listener;
    page = listener.page ?? page;
    takeToken();
    // A new token in the address of this tab does not reload the page.
    window.addEventListener("hashchange", () => {
      if (takeToken()) connect();
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

  /**
   * Does `work`, which asks the server, every `period` milliseconds, and never twice at a time. Returns a function that does it
   * at once. What gets no answer is asked again the next time: the page says if the server does not answer.
   */
  function every(period, work) {
    let isBusy = false;
    async function now() {
      if (isBusy) return;
      isBusy = true;
      await work().catch(() => {});
      isBusy = false;
    }
    setInterval(now, period);
    return now;
  }

  return { ask, base, change, every, listen };
})();
