"use strict";

// The tags of the PLC: a tree whose folders are asked for when they are opened. All texts of the PLC are shown as text.

const tags = (() => {
  /** The id of the outermost folder, as OPC UA has it: a reference back to it leads in a circle. */
  const OUTERMOST = "i=85";
  const TYPE = "application/x-tickbus-tag";
  const get = (id) => document.getElementById(id);
  let tell = {};
  /** The roots of the tree. */
  let roots = [];
  /** The item that has the focus, or would have it. */
  let current = null;
  /** What is dragged at present. */
  let dragged = [];
  /** The signals that the addresses have. */
  let placed = new Map();
  /** The number of the last look at the PLC: answers to an earlier one are too late. */
  let turn = 0;

  function make(kind, properties, ...children) {
    const element = Object.assign(document.createElement(kind), properties);
    element.append(...children);
    return element;
  }

  const canBe = ({ tag }) => tag.at !== null;
  const all = (list = roots) => list.flatMap((item) => [item, ...(item.isOpen ? all(item.children ?? []) : [])]);
  const marked = () => all().filter((item) => item.isMarked);

  /** Asks for a folder until the PLC has answered; null if somebody has begun to browse again meanwhile. */
  async function ask(id) {
    const mine = turn;
    try {
      for (;;) {
        const answer = await tell.ask(encodeURIComponent(id));
        const found = await answer.json();
        if (mine !== turn) return null;
        if (!answer.ok) return { error: found.text };
        if (!found.waits) return found;
      }
    } catch {
      return mine === turn ? { error: "the studio does not answer; see whether it runs" } : null;
    }
  }

  /** Many servers repeat the name as the comment. */
  const commentOf = ({ name, comment }) => (comment === name ? "" : comment);

  function itemOf(tag, parent) {
    let isAbove = tag.id === OUTERMOST;
    for (let item = parent; item; item = item.parent) isAbove ||= item.tag.id === tag.id;
    const shown = isAbove ? { ...tag, opens: false, why: "this folder is open above" } : tag;
    const item = { tag: shown, parent, children: null, isOpen: false, isLoading: false, isMarked: false, note: "" };
    const level = parent ? Number(parent.element.getAttribute("aria-level")) + 1 : 1;
    const { name, type, access, at, id, why } = shown;
    const sign = make("span", { className: "sign", textContent: shown.opens ? "▸" : "" });
    sign.setAttribute("aria-hidden", "true");
    const first = make("span", { className: "tag-name", textContent: name || id });
    const facts = make("span", { className: "tag-facts", textContent: [type, access].filter(Boolean).join(" · ") });
    const second = make("span", { className: "tag-more", textContent: [commentOf(shown), at ?? id, why].filter(Boolean).join(" · ") });
    item.element = make("li", { tabIndex: -1, draggable: canBe(item), className: canBe(item) ? "can-be" : "" }, sign, first, facts, second, make("span", { className: "tag-is" }), make("span", { className: "tag-note" }));
    item.element.setAttribute("role", "treeitem");
    item.element.setAttribute("aria-level", String(level));
    item.element.style.setProperty("--level", level);
    if (shown.opens) item.element.setAttribute("aria-expanded", "false");
    if (canBe(item)) item.element.setAttribute("aria-selected", "false");
    item.element.addEventListener("click", () => {
      focus(item);
      if (canBe(item)) mark(item);
      else toggle(item);
    });
    item.element.addEventListener("dblclick", () => { if (canBe(item) && item.tag.opens) toggle(item); });
    item.element.addEventListener("dragstart", (event) => {
      dragged = item.isMarked ? marked() : [item];
      event.dataTransfer.setData(TYPE, "");
      event.dataTransfer.effectAllowed = "copy";
    });
    item.element.addEventListener("dragend", () => { dragged = []; });
    showPlace(item);
    return item;
  }

  /** Which signal has the tag already. */
  function showPlace(item) {
    const name = placed.get(item.tag.at);
    item.element.querySelector(".tag-is").textContent = name === undefined ? "" : `is ${name}`;
  }

  function showNote(item, text) {
    item.note = text;
    item.element.querySelector(".tag-note").textContent = text;
  }

  function focus(item) {
    if (current) current.element.tabIndex = -1;
    current = item;
    item.element.tabIndex = 0;
    item.element.focus({ preventScroll: false });
  }

  function mark(item, isMarked = !item.isMarked) {
    item.isMarked = isMarked && canBe(item);
    item.element.setAttribute("aria-selected", String(item.isMarked));
    showButtons();
  }

  function showButtons() {
    const count = marked().length;
    get("add-tags").textContent = count > 1 ? `Add ${count}` : "Add";
    get("add-tags").disabled = !tell.mayEdit() || count === 0;
    get("browse").textContent = roots.length ? "Browse again" : "Browse";
  }

  function close(item) {
    for (const inner of item.isOpen ? all(item.children) : []) inner.element.remove();
    item.isOpen = false;
    item.element.setAttribute("aria-expanded", "false");
    item.element.firstChild.textContent = "▸";
  }

  async function open(item) {
    if (!item.tag.opens || item.isOpen || item.isLoading) return;
    item.isLoading = true;
    showNote(item, "asking the PLC …");
    const found = await ask(item.tag.id);
    item.isLoading = false;
    if (!found) return;
    if (found.error !== undefined) {
      showNote(item, found.error);
      return;
    }
    item.children = found.tags.map((tag) => itemOf(tag, item));
    showNote(item, found.told || (item.children.length ? "" : "there is nothing in it"));
    item.isOpen = true;
    item.element.setAttribute("aria-expanded", "true");
    item.element.firstChild.textContent = "▾";
    item.element.after(...item.children.map(({ element }) => element));
  }

  function toggle(item) {
    if (item.isOpen) close(item);
    else open(item);
  }

  async function browse() {
    turn += 1;
    roots = [];
    current = null;
    get("tree").replaceChildren();
    get("tags-keys").hidden = true;
    get("leave-plc").hidden = false;
    get("tags-told").className = "note";
    get("tags-told").textContent = "asking the PLC …";
    showButtons();
    const found = await ask("");
    if (!found) return;
    get("tags-told").className = found.error === undefined ? "note" : "note bad";
    get("tags-told").textContent = found.error ?? found.told;
    if (found.error !== undefined) return;
    roots = found.tags.map((tag) => itemOf(tag, null));
    if (!roots.length) get("tags-told").textContent = "The PLC shows nothing to this user.";
    get("tree").replaceChildren(...roots.map(({ element }) => element));
    get("tags-keys").hidden = false;
    if (roots.length) {
      current = roots[0];
      current.element.tabIndex = 0;
    }
    showButtons();
  }

  function leave() {
    turn += 1;
    roots = [];
    current = null;
    get("tree").replaceChildren();
    get("tags-told").textContent = "";
    get("tags-keys").hidden = true;
    get("leave-plc").hidden = true;
    showButtons();
    tell.leave();
  }

  const taken = ({ tag, parent }) => ({ name: tag.name, within: parent?.tag.name ?? "", comment: commentOf(tag), at: tag.at, data_type: tag.dataType, area: get("tags-area").value || tag.area });

  async function add(items) {
    const list = items.filter(canBe);
    if (!list.length || !tell.mayEdit()) return;
    if (await tell.take(list.map(taken))) for (const item of list) mark(item, false);
  }

  function key(event) {
    const item = current;
    if (!item || event.altKey || event.metaKey) return;
    const list = all();
    const at = list.indexOf(item);
    const go = (to) => { if (list[to]) focus(list[to]); };
    if (event.key === "ArrowDown") go(at + 1);
    else if (event.key === "ArrowUp") go(at - 1);
    else if (event.key === "Home") go(0);
    else if (event.key === "End") go(list.length - 1);
    else if (event.key === "ArrowRight") { if (item.isOpen) go(at + 1); else open(item); }
    else if (event.key === "ArrowLeft") { if (item.isOpen) close(item); else if (item.parent) focus(item.parent); }
    else if (event.key === " ") { if (canBe(item)) mark(item); }
    else if (event.key === "Enter" && !canBe(item)) toggle(item);
    else if (event.key === "Enter" && (event.ctrlKey || tell.chosen() < 0)) add(item.isMarked ? marked() : [item]);
    else if (event.key === "Enter") { if (tell.mayEdit()) tell.give(tell.chosen(), item.tag); }
    else return;
    event.preventDefault();
  }

  /** A tag that is dropped on a row is that signal's; elsewhere in the table it becomes a signal. */
  function beTarget(element) {
    const rowOf = (event) => event.target.closest?.("#rows > .row");
    const unmark = () => { for (const row of element.querySelectorAll(".is-target")) row.classList.remove("is-target"); };
    element.addEventListener("dragover", (event) => {
      if (!dragged.length) return;
      event.preventDefault();
      event.dataTransfer.dropEffect = "copy";
      unmark();
      if (dragged.length === 1) rowOf(event)?.classList.add("is-target");
    });
    element.addEventListener("dragleave", unmark);
    element.addEventListener("drop", (event) => {
      if (!dragged.length) return;
      event.preventDefault();
      unmark();
      const row = rowOf(event);
      const items = dragged;
      dragged = [];
      if (!tell.mayEdit()) return;
      if (row && items.length === 1) tell.give(Number(row.dataset.index), items[0].tag);
      else add(items);
    });
  }

  return {
    begin(listener) {
      tell = listener;
      get("browse").addEventListener("click", browse);
      get("leave-plc").addEventListener("click", leave);
      get("add-tags").addEventListener("click", () => add(marked()));
      get("tree").addEventListener("keydown", key);
      beTarget(get("grid"));
    },
    /** Shows which tags are signals already. */
    show({ browses, sheet }) {
      get("tags").hidden = !browses;
      placed = new Map(Object.entries(sheet?.at ?? {}).map(([name, at]) => [at, name]));
      for (const item of all()) showPlace(item);
      showButtons();
    },
    /** The name of the chosen signal has changed, or another one is chosen. */
    choose(name) {
      get("tags-chosen").textContent = name || "none";
    },
  };
})();
