"use strict";

// The studio's controller: reads the file's state, hands edits over, and shows the line.

(() => {
  /** Between two questions about the file, in ms. */
  const PAUSE = 450;
  const get = (id) => document.getElementById(id);
  let file = null;
  let seen = "0";
  let mayEdit = false;
  let isClosed = false;
  /** The request for the state that is under way, and the one after it. */
  let reading = null;
  let next = null;
  /** When the last question was due, in ms. */
  let asked = 0;

  function say(text, isBad = false) {
    get("told").hidden = !text;
    get("told").textContent = text;
    get("told").classList.toggle("bad", isBad);
  }

  /** Reads the state as it is now or later: a request that is under way may have missed the last change. */
  function read() {
    if (!reading) {
      reading = ask().finally(() => { reading = null; });
      return reading;
    }
    next ??= reading.then(() => {
      next = null;
      return read();
    });
    return next;
  }

  async function ask() {
    try {
      const answer = await room.ask(`${running.base}/state/${seen}`, {});
      // Its driver has left the room.
      showClosed(answer.status === 404);
      if (answer.ok) {
        const state = await answer.json();
        if (state.state !== seen) take(state);
      } else if (isClosed) {
        say("This driver has been closed. Open it again, or choose another page.", true);
      } else {
        say((await answer.json()).text, true);
      }
    } catch {
      // The tag beside the title says that nobody answers.
    }
  }

  function showClosed(isNow) {
    if (isNow === isClosed) return;
    isClosed = isNow;
    // If it is opened again, its file is shown anew.
    seen = "0";
    document.querySelector("main").inert = isClosed;
    document.body.classList.toggle("is-closed", isClosed);
    head.showLink();
  }

  /** Puts a state together from the last one and what has changed since. */
  function whole(state) {
    const { since } = state;
    if (!since) return state;
    const { signals, at } = file.sheet;
    const { rows, text } = since;
    state.sheet.signals = [...signals.slice(0, rows.from), ...rows.new, ...signals.slice(rows.from + rows.gone)];
    state.sheet.at = { ...at, ...since.at.set };
    for (const name of since.at.gone) delete state.sheet.at[name];
    state.text = file.text.slice(0, text.from) + text.new + file.text.slice(text.from + text.gone);
    return state;
  }

  function take(news) {
    const state = whole(news);
    file = state;
    seen = state.state;
    running.keep(state.line);
    head.title(state.name, `${state.name} – tickbus studio`);
    get("path").textContent = state.path;
    const isSaved = state.unsaved === null;
    get("saved").textContent = state.isGone ? "gone" : isSaved ? "saved" : "not saved";
    get("saved").className = isSaved && !state.isGone ? "tag good" : "tag bad";
    get("saved").title = state.unsaved ?? "Every edit is written into the file at once";
    if (isSaved && state.isGone) say(`${state.name} is gone; the next edit writes it again.`, true);
    else if (!isSaved) say(`The file cannot be written: ${state.unsaved}. The edits are kept here, and written as soon as that works.`, true);
    else if (state.told) say(state.told);
    else say("");
    for (const [id, done] of [["undo", state.undo], ["redo", state.redo]]) {
      get(id).disabled = done === null || !mayEdit;
      get(id).title = done ?? "";
    }
    const checked = state.checked.mistakes;
    tags.show(state);
    if (state.sheet) {
      bus.show(state.sheet, checked);
      cells.show(state.sheet, checked);
    }
    document.body.classList.toggle("is-broken", state.broken !== null);
    if (state.broken !== null) {
      say(`The file is no TOML at the moment: ${state.broken}. Mend it in its text below.`, true);
      get("text-box").open = true;
    }
    showMistakes(checked, state.checked.notes);
    showDiff(state.diff);
    explore.show(state.explored, mayEdit, checked.length > 0 || state.broken !== null);
    refreshText();
    showLine();
  }

  /** Shows the new text, where it is seen: half a megabyte in a field takes a browser longer than all the rest. */
  function refreshText() {
    if (get("text-box").open && !isTextChanged()) showText();
  }

  /** True if the field of the text has something that was not applied. */
  const isTextChanged = () => get("text").value !== (get("text").dataset.was ?? "");

  function showText() {
    const text = get("text");
    text.value = file.text;
    // As the field has it: with other ends of lines, perhaps.
    text.dataset.was = text.value;
    text.dataset.version = file.version;
  }

  function showMistakes(mistakes, notes) {
    const items = mistakes.slice(0, 200).map(({ at, line, what, right }) => {
      const item = document.createElement("li");
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${line ? `line ${line}: ` : ""}${what}; ${right}`;
      button.addEventListener("click", () => go(at, line));
      item.append(button);
      return item;
    });
    for (const note of notes) items.push(Object.assign(document.createElement("li"), { className: "note", textContent: note }));
    get("mistakes").replaceChildren(...items);
    const count = mistakes.length;
    get("problems-title").textContent = count === 0 ? "Check: no mistakes" : `Check: ${words.count(count, "mistake", "mistakes")}`;
    get("problems").classList.toggle("bad", count > 0);
  }

  /** Goes to the place of a mistake. */
  function go(at, line) {
    const [table, place, key] = at;
    if (table === "signal" && typeof place === "number") return cells.go(place, key ?? "name");
    if (table === "fieldbus" && place === "at") {
      const index = file.sheet.signals.findIndex(({ name }) => name === key);
      if (index >= 0) return cells.go(index, "at");
    }
    if (bus.go(table, place)) return;
    get("text-box").open = true;
    refreshText();
    const lines = get("text").value.split("\n").slice(0, Math.max(0, line - 1));
    const start = lines.reduce((sum, it) => sum + it.length + 1, 0);
    get("text").focus();
    get("text").setSelectionRange(start, start);
  }

  function showDiff(diff) {
    const lines = diff.split("\n").filter((line) => line && !line.startsWith("---") && !line.startsWith("+++"));
    const spans = lines.map((line) => Object.assign(document.createElement("span"), {
      className: line.startsWith("+") ? "plus" : line.startsWith("-") ? "minus" : line.startsWith("@@") ? "place" : "",
      textContent: `${line}\n`,
    }));
    get("diff").replaceChildren(...spans);
    const count = (sign) => lines.filter((line) => line.startsWith(sign)).length;
    get("diff-count").textContent = lines.length ? `+${count("+")} −${count("-")}` : "none";
  }

  /** The lamp: what the machine's end of the line says of itself. */
  function showLine() {
    const driver = running.mine(plant.drivers);
    const line = driver?.line;
    const runs = file?.line.runs ?? false;
    get("start").textContent = runs ? (file.line.isOld ? "Restart with the changes" : "Restart") : "Start";
    const isExamined = file?.explored.busy === "examine";
    get("start").disabled = !mayEdit || isExamined || (file?.checked.mistakes.length ?? 1) > 0;
    get("start").title = isExamined ? "The line is examined at the moment" : "";
    get("stop").hidden = !runs;
    get("stop").disabled = !mayEdit;
    let state = "stopped";
    let reason = file?.line.refused ?? "";
    let lamp = "off";
    if (runs) {
      state = line?.state ?? "starting";
      reason = line?.reason ?? "";
      if (line?.state === "running") lamp = line.status === "stale" ? "bad" : "good";
      else lamp = line?.state === "failed" ? "bad" : "waits";
    } else if (reason) {
      lamp = "bad";
    } else if (file?.checked.mistakes.length) {
      reason = "Correct the mistakes, and then start.";
    }
    running.show(file?.line, mayEdit, file?.checked.mistakes.length ?? 1);
    if (file?.line.owner && file.line.refused) reason = `${file.line.refused}\n${reason}`;
    get("lamp").className = lamp;
    if (get("line-state").textContent !== state) get("line-state").textContent = state;
    if (get("line-reason").textContent !== reason) get("line-reason").textContent = reason;
  }

  function showValues() {
    const values = new Map();
    for (const signal of running.mine(plant.drivers)?.signals ?? []) values.set(signal.name, { text: `${words.value(signal)}${signal.unit ? ` ${signal.unit}` : ""}`, isStale: signal.isStale });
    cells.values(values);
  }

  /** The last request for a change: the next one waits for it, so that they arrive as they were made. */
  let last = Promise.resolve();
  let changes = 0;

  /** Requests a change of the file, and reads what came of it. */
  async function change(path, body = "") {
    changes += 1;
    const request = last.then(() => room.change("PUT", `${running.base}/${path}`, body));
    last = request.catch(() => {});
    const answer = await request;
    if (!answer?.ok) {
      // What the page shows in advance is not so.
      seen = "0";
      bus.forget();
    }
    await read();
    changes -= 1;
    if (answer === null) say("Nobody answers; the change may not have been made.", true);
    else if (!answer.ok) say(answer.text, true);
    return answer?.ok === true;
  }

  const edit = (what) => change("edit", JSON.stringify(what));

  /** Changes a key; in a list the table has to have the name `of`. */
  function set(at, was, to, of) {
    return edit({ set: { at, was, to, of } });
  }

  /** Changes a cell of the signal that had the name `of` when the cell was opened. */
  function setCell(index, key, was, to, of) {
    if (key === "at") return of ? set(["fieldbus", "at", of], was, to) : refuse("Name the signal first: its place in the device goes by that.");
    const signal = file.sheet?.signals[index];
    if (key === "name" && signal && (signal.name ?? "") === of) {
      // What is typed next is for the new name, which the place in the device follows.
      signal.name = to;
      const { at } = file.sheet;
      const isAlone = !file.sheet.signals.some((it) => it !== signal && [of, to].includes(it.name));
      if (to && isAlone && Object.hasOwn(at, of) && !Object.hasOwn(at, to)) {
        at[to] = at[of];
        delete at[of];
      }
    }
    return set(["signal", index, key], was, to, of);
  }

  /** Says why a change is not made, and shows what the file has. */
  async function refuse(why) {
    seen = "0";
    await read();
    say(why, true);
  }

  async function add(area) {
    const signals = file?.sheet?.signals ?? [];
    const index = cells.chosen >= 0 ? cells.chosen + 1 : signals.length;
    const present = new Set(signals.map(({ name }) => name));
    let number = signals.length + 1;
    while (present.has(`Signal ${number}`)) number += 1;
    const station = (signals[cells.chosen] ?? signals.at(-1))?.station;
    const given = [["name", `Signal ${number}`], ["address", file.sheet.next[station ?? ""][`${area}X`]]];
    if (station) given.push(["station", station]);
    if (await edit({ add: { list: "signal", index, cells: given } })) {
      cells.go(index, "name");
      cells.edit();
    }
  }

  async function move(by) {
    const index = cells.chosen;
    const to = index + by;
    const signals = file?.sheet?.signals ?? [];
    if (index < 0 || to < 0 || to >= signals.length) return;
    await edit({ move: { list: "signal", index, was: signals[index].name ?? "", to } });
  }

  /** Reads lists of tags one after the other, and says of each what came of it. */
  async function takeFiles(given) {
    const told = [];
    let isBad = false;
    for (const list of [...given]) {
      const isDone = await takeFile(list);
      isBad ||= !isDone;
      told.push(get("told").textContent);
    }
    if (told.length > 1) say(told.join("\n"), isBad);
  }

  /** Gives a signal the address of a tag. */
  async function give(index, tag) {
    const signal = file?.sheet?.signals[index];
    if (!signal?.name) return refuse("Name the signal first: its place in the device goes by that.");
    const { name } = signal;
    const was = Object.hasOwn(file.sheet.at, name) ? file.sheet.at[name] : "";
    if (!await set(["fieldbus", "at", name], was, tag.at)) return;
    const own = signal.type ?? { X: "BOOL", B: "BYTE", W: "WORD", D: "DWORD", L: "LWORD" }[signal.address?.[2]?.toUpperCase()];
    const alike = { BYTE: "USINT", WORD: "UINT", DWORD: "UDINT", LWORD: "ULINT" };
    const differs = own && (alike[own] ?? own) !== (alike[tag.dataType] ?? tag.dataType);
    say(`${name} is ${tag.at} now.${differs ? ` The tag is ${tag.dataType}, and the signal ${own}: correct its type and address.` : ""}`);
  }

  /** Adds signals for tags. */
  async function takeTags(list) {
    const signals = file?.sheet?.signals ?? [];
    const station = signals[cells.chosen]?.station ?? signals.at(-1)?.station ?? "";
    const isDone = await edit({ take: { tags: list, index: signals.length, station } });
    if (isDone) cells.reveal(file.sheet.signals.length - 1);
    return isDone;
  }

  async function takeFile(given) {
    const bytes = new Uint8Array(await given.arrayBuffer());
    let text = "";
    for (let at = 0; at < bytes.length; at += 0x8000) text += String.fromCharCode(...bytes.subarray(at, at + 0x8000));
    return change(`import/${encodeURIComponent(given.name)}`, btoa(text));
  }

  cells.begin({
    set: setCell,
    chosen: (text) => {
      get("cell-told").textContent = text;
      tags.choose(file?.sheet?.signals[cells.chosen]?.name);
    },
    mayEdit: () => mayEdit,
    hasPlaces: () => file?.checked.hasPlaces !== false || Object.keys(file.sheet.at).length > 0,
  });

  explore.begin(change);
  tags.begin({ ask: (id) => room.ask(`${running.base}/tags/${id}`, {}), take: takeTags, give, mayEdit: () => mayEdit, chosen: () => cells.chosen, leave: () => change("tags", "close") });
  get("undo").addEventListener("click", () => change("undo"));
  get("redo").addEventListener("click", () => change("redo"));
  get("start").addEventListener("click", () => change("line", "start"));
  get("stop").addEventListener("click", () => change("line", "stop"));
  get("take").addEventListener("click", () => change("line", "take"));
  get("add-input").addEventListener("click", () => add("I"));
  get("add-output").addEventListener("click", () => add("Q"));
  get("remove").addEventListener("click", () => {
    const signal = file?.sheet?.signals[cells.chosen];
    if (signal) edit({ remove: { list: "signal", index: cells.chosen, was: signal.name ?? "" } });
  });
  get("up").addEventListener("click", () => move(-1));
  get("down").addEventListener("click", () => move(1));
  get("filter").addEventListener("input", () => cells.filter(get("filter").value));
  get("apply").addEventListener("click", async () => {
    const text = get("text");
    const to = text.value;
    const isDone = await edit({ text: { was: Number(text.dataset.version), to } });
    // After a conflict the same text can be applied to what is shown now.
    text.dataset.version = file.version;
    if (isDone) text.dataset.was = to;
  });
  get("text-box").addEventListener("toggle", refreshText);
  get("text").addEventListener("keydown", (event) => {
    if (event.key === "Escape") showText();
  });
  get("import").addEventListener("click", () => get("import-file").click());
  get("import-file").addEventListener("change", async () => {
    await takeFiles(get("import-file").files);
    get("import-file").value = "";
  });
  window.addEventListener("dragover", (event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    document.body.classList.add("is-dropping");
  });
  window.addEventListener("dragleave", (event) => { if (!event.relatedTarget) document.body.classList.remove("is-dropping"); });
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("is-dropping");
    takeFiles(event.dataTransfer?.files ?? []);
  });
  window.addEventListener("keydown", (event) => {
    const isTyping = event.target.matches?.("input, textarea");
    if (!(event.ctrlKey || event.metaKey) || isTyping) return;
    const key = event.key.toLowerCase();
    if (key === "z" && !event.shiftKey) change("undo");
    else if (key === "y" || (key === "z" && event.shiftKey)) change("redo");
    else return;
    event.preventDefault();
  });

  let isDue = false;
  head.listen({
    // Its line is on the live page.
    page: "/",
    may: "may edit",
    mayNot: "Open the address that was printed, with its token: without it the studio shows nothing",
    lost: "No connection to the studio.",
    link: () => (isClosed ? ["closed", "bad"] : null),
    news(text) {
      const heard = plant.hear(text);
      if (!heard) return false;
      if (heard.isLine) showLine();
      if (isDue) return true;
      isDue = true;
      requestAnimationFrame(() => {
        isDue = false;
        showValues();
      });
      return true;
    },
    async access(isRight, refusal) {
      mayEdit = isRight;
      if (!isRight) return say(refusal || "Open the address that was printed, with its token: without it the studio shows nothing.", true);
      if (!file) {
        const answer = await room.ask(`${running.base}/schema`, {});
        bus.begin(await answer.json(), { set });
      }
      await read();
    },
    age(isOld) {
      // Each event of the line comes here as well, up to 60 times a second.
      const now = performance.now();
      if (isOld || !file || cells.isEditing || document.hidden || now - asked < PAUSE) return;
      asked = now;
      read();
    },
  });

  /** For tests. */
  window.tickbusStudio = {
    get file() { return file; },
    get isBusy() { return reading !== null || next !== null || changes > 0; },
  };
})();
