'use strict';

// Changes of the laboratory that this page requests, and their history.
const changes = (() => {
  /** How long the page waits for the state after a change, in milliseconds. */
  const PATIENCE = 1500;
  const LONGEST = 200;
  let say = () => {};
  let done = [];
  let undone = [];
  let isBusy = false;

  /** Sends one request; returns whether it was carried out. */
  async function send(method, path, body) {
    const said = await room.change(method, room.base + path, body);
    if (said === null) say('The dispatcher does not answer; check the change when it is back.', true);
    else if (!said.ok) say(`ERR ${said.code} ${said.text}`, true);
    return said?.ok === true;
  }

  // A step is a list of facts: { kind, name, before, after }. The kinds are "cable", by inputs; "force", by channels; "place",
  // by clients.

  function now({ kind, name }) {
    if (kind === 'cable') return lab.cables.get(name)?.output ?? null;
    if (kind === 'force') return lab.pins.get(name)?.raw.forced ?? null;
    return lab.places.get(name) ?? null;
  }

  function isSame(kind, one, other) {
    if (one === null || other === null || kind === 'cable') return one === other;
    if (kind === 'force') return Number(one) === Number(other);
    return ['x', 'y', 'folded', 'group'].every((key) => one[key] === other[key]);
  }

  /** A sentence about the first fact that somebody else has changed; undefined if all are as they should be. */
  function foreign(facts, side) {
    for (const fact of facts) {
      const present = now(fact);
      if (isSame(fact.kind, present, fact[side])) continue;
      if (fact.kind === 'cable') return `${fact.name} is ${present ? `connected with ${present}` : 'not connected'} now`;
      if (fact.kind === 'force') return `${fact.name} is ${present === null ? 'not forced' : `forced to ${present}`} now`;
      return `the box ${fact.name} is elsewhere now`;
    }
    return undefined;
  }

  async function make(facts, side) {
    const places = {};
    for (const fact of facts) {
      const { kind, name } = fact;
      const wanted = fact[side];
      const path = `/${kind === 'cable' ? 'patch' : 'force'}/${name}`;
      if (kind === 'place') places[name] = wanted;
      else if (!await (wanted === null ? send('DELETE', path) : send('PUT', path, wanted))) return false;
    }
    return !Object.keys(places).length || send('PUT', '/layout', JSON.stringify(places));
  }

  function remember(text, facts) {
    if (!facts.length) return;
    done.push({ text, facts });
    done = done.slice(-LONGEST);
    undone = [];
  }

  /** Makes a step, and keeps it. Facts without `before` have the present one. */
  async function step(text, facts) {
    for (const fact of facts) fact.before ??= now(fact);
    const isMade = await make(facts, 'after');
    if (isMade) {
      remember(text, facts);
      say(text);
    }
    return isMade;
  }

  /** Undoes or repeats the last step, unless somebody else has changed the same meanwhile. */
  async function turn(from, to, [here, there], word) {
    if (isBusy) return;
    const last = from.at(-1);
    if (!last) {
      say(`Nothing to ${word}.`);
      return;
    }
    isBusy = true;
    const end = performance.now() + PATIENCE;
    let why = foreign(last.facts, here);
    // The state after the last change may still be on its way.
    while (why && performance.now() < end) {
      await lab.next(100);
      why = foreign(last.facts, here);
    }
    const facts = word === 'undo' ? last.facts.slice().reverse() : last.facts;
    if (why) {
      say(`Cannot ${word} "${last.text.replace(/\.$/, '')}": ${why}, because somebody else has changed it. Nothing was changed.`, true);
      from.pop();
    } else if (await make(facts, there)) {
      from.pop();
      to.push(last);
      say(`${word === 'undo' ? 'Undone' : 'Repeated'}: ${last.text}`);
    }
    isBusy = false;
  }

  const connect = (input, output) => step(`Connected ${output} with ${input}.`, [{ kind: 'cable', name: input, before: null, after: output }]);

  /** Cuts cables, all of one channel or a single one. */
  async function cut(cables, path, text) {
    const facts = cables.map(({ input, output }) => ({ kind: 'cable', name: input, before: output, after: null }));
    if (!await send('DELETE', `/patch/${path}`)) return false;
    remember(text, facts);
    say(text);
    return true;
  }

  const force = (name, value) => step(`${name} is forced to ${value}.`, [{ kind: 'force', name, after: value }]);
  const release = (name) => step(`${name} is released.`, [{ kind: 'force', name, after: null }]);

  /** Gives boxes other places: [name, { x, y, folded, group }], each with what changes. */
  function place(text, list) {
    const facts = list.map(([name, wanted]) => ({ kind: 'place', name, after: { ...lab.places.get(name), ...wanted } }));
    return step(text, facts.filter(({ name, after }) => !isSame('place', lab.places.get(name) ?? null, after)));
  }

  async function arrange() {
    const before = new Map(lab.places);
    if (!await send('PUT', '/layout/arranged')) return;
    await lab.next(PATIENCE);
    const facts = [];
    for (const [name, after] of lab.places) {
      const was = before.get(name);
      if (was && !isSame('place', was, after)) facts.push({ kind: 'place', name, before: was, after });
    }
    remember('Arranged all boxes.', facts);
    say('Arranged all boxes.');
  }

  return {
    connect, cut, force, release, place, arrange,
    undo: () => turn(done, undone, ['after', 'before'], 'undo'),
    redo: () => turn(undone, done, ['before', 'after'], 'redo'),
    listen: (tell) => { say = tell; },
  };
})();
