"use strict";

// A line that a simulation owns: it takes the changes of the file, and what it cannot take is said before.

const running = (() => {
  const get = (id) => document.getElementById(id);

  /**
   * The number of the driver: from the page's address, or else from the first state. The page keeps to it, because another
   * driver that joins the room may become the first.
   */
  let driver = /^\/studio\/of\/([^/]+)/.exec(location.pathname)?.[1] ?? null;

  /** Keeps to the driver whose file the page shows. */
  function keep(line) {
    if (!driver && line.owner) driver = String(line.owner.id);
  }

  /** The driver of this file, of those on the live page. */
  const mine = (drivers) => (driver ? drivers.find(({ id }) => String(id) === driver) : drivers[0]);

  /** Shows what the line can take of the file; does nothing for a line of the studio's own. */
  function show(line, mayEdit, mistakes) {
    const owner = line?.owner;
    document.body.classList.toggle("is-owned", owner !== undefined);
    if (!owner) return;
    const restart = owner.restart;
    get("take").disabled = !mayEdit || !line.isOld || restart.length > 0 || mistakes > 0;
    let told = "The line has the settings of the file.";
    if (mistakes > 0) told = "The file has mistakes; the line keeps its settings.";
    else if (restart.length > 0) told = "The simulation must be restarted for these changes; the line keeps its settings:";
    else if (line.isOld) told = "The file has other settings than the line.";
    if (get("taken").textContent !== told) get("taken").textContent = told;
    const items = mistakes > 0 ? [] : restart;
    get("restart").hidden = items.length === 0;
    get("restart").replaceChildren(...items.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  }

  return {
    /** Where the requests for the file go. */
    get base() { return driver ? `/studio/of/${driver}` : "/studio"; },
    keep,
    mine,
    show,
  };
})();
