'use strict';

// Changes of the laboratory that this page requests, and their history.
const changes = (() => {
  /** How long the page waits for the state after a change, in milliseconds. */
  const PATIENCE = 1500;
  const LONGEST = 200;
  let say = () => {};
  const LOST = 'The dispatcher does not answer; check the change when it is back.';
  const done = [];
  const undone = [];
  let running = Promise.resolve();

  /** Changes are made one after the other, so that Undo knows the last one. */
  function queue(work) {
    running = running.catch(() => {}).then(work);
    return running;
  }

  /** Sends one request; returns why it was not carried out, or null. */
  async function send(method, path, body) {
    const said = await room.change(method, room.base + path, body);
    if (said === null) return LOST;
    return said.ok ? null : `ERR ${said.code} ${said.text}`;
  }

  // A step is a list of facts: { kind, name, before, after }. The kinds are "cable", by inputs; "force", by channels; "place",
  // by clients.

  const KEYS = ['x', 'y', 'folded', 'group'];

  function now({ kind, name }) {
    if (kind === 'cable') return lab.cables.get(name)?.output ?? null;
    if (kind === 'force') return lab.pins.get(name)?.raw.forced ?? null;
    return lab.places.get(name) ?? null;
  }

  function isSame(kind, one, other) {
    if (one === null || other === null || kind === 'cable') return one === other;
    if (kind === 'force') return Number(one) === Number(other);
    return KEYS.every((key) => one[key] === other[key]);
  }

  /** The part of a place that a fact changes, as it is on one side. */
  function part({ before, after }, wanted) {
    return Object.fromEntries(KEYS.filter((key) => before?.[key] !== after?.[key]).map((key) => [key, wanted?.[key] ?? null]));
  }

  /** A sentence about the first fact that has changed since; undefined if all are as they should be. */
  function foreign(facts, side) {
    for (const fact of facts) {
      const present = now(fact);
      const isPlace = fact.kind === 'place' && present;
      if (isPlace ? isSame('place', part(fact, present), part(fact, fact[side])) : isSame(fact.kind, present, fact[side])) continue;
      if (fact.kind === 'cable') return `${fact.name} is ${present ? `connected with ${present}` : 'not connected'} now`;
      if (fact.kind === 'force') return `${fact.name} is ${present === null ? 'not forced' : `forced to ${present}`} now`;
      return `the box ${fact.name} is elsewhere now`;
    }
    return undefined;
  }

  /** Makes facts; returns the made ones, and why another one was not made. */
  async function make(facts, side) {
    const made = [];
    const moved = [];
    const places = Object.create(null);
    let why = null;
    for (const fact of facts) {
      const { kind, name } = fact;
      const wanted = fact[side];
      if (kind === 'place') {
        places[name] = part(fact, wanted);
        moved.push(fact);
        continue;
      }
      const path = `/${kind === 'cable' ? 'patch' : 'force'}/${name}`;
      const refusal = await (wanted === null ? send('DELETE', path) : send('PUT', path, wanted));
      if (refusal === null) made.push(fact);
      why ??= refusal;
    }
    if (moved.length) {
      const refusal = await send('PUT', '/layout', JSON.stringify(places));
      why ??= refusal;
      if (refusal === null) {
        made.push(...moved);
        // The next change begins here, even if the event with these places comes later.
        for (const [name, place] of Object.entries(places)) lab.places.set(name, { ...lab.places.get(name), ...place });
      }
    }
    return { made, why };
  }

  /** Tells what was done, and what was not. */
  function report(text, made, why) {
    if (why === null) say(text);
    else say(made.length ? `${text.replace(/\.$/, '')}, but ${why}` : why, true);
  }

  function remember(text, facts) {
    if (!facts.length) return;
    done.push({ text, facts });
    if (done.length > LONGEST) done.shift();
    undone.length = 0;
  }

  /** Makes a step, and keeps it. Facts without `before` have the present one. */
  async function carryOut(text, facts) {
    for (const fact of facts) fact.before ??= now(fact);
    const { made, why } = await make(facts, 'after');
    remember(text, made);
    report(text, made, why);
    return why === null;
  }
  const step = (text, facts) => queue(() => carryOut(text, facts));

  /** Undoes or repeats the last step, unless the same has changed meanwhile: by somebody else, or because a client left. */
  const turn = (from, to, [here, there], word) => queue(async () => {
    const last = from.pop();
    if (!last) {
      say(`Nothing to ${word}.`);
      return;
    }
    const end = performance.now() + PATIENCE;
    let other = foreign(last.facts, here);
    // The state after the last change may still be on its way.
    while (other && performance.now() < end) {
      await lab.next(100);
      other = foreign(last.facts, here);
    }
    if (other) {
      say(`Cannot ${word} "${last.text.replace(/\.$/, '')}": ${other}. Nothing was changed.`, true);
      return;
    }
    const { made, why } = await make(word === 'undo' ? last.facts.slice().reverse() : last.facts, there);
    // What was refused can be done later, as when its client is back.
    for (const [list, isMade] of [[to, true], [from, false]]) {
      const facts = last.facts.filter((fact) => made.includes(fact) === isMade);
      if (facts.length) list.push({ text: last.text, facts });
    }
    report(`${word === 'undo' ? 'Undone' : 'Repeated'}: ${last.text}`, made, why);
  });

  const connect = (input, output) => step(`Connected ${output} with ${input}.`, [{ kind: 'cable', name: input, before: null, after: output }]);

  /** Cuts cables, all of one channel or a single one. */
  const cut = (cables, path, text) => queue(async () => {
    const facts = cables.map(({ input, output }) => ({ kind: 'cable', name: input, before: output, after: null }));
    const why = await send('DELETE', `/patch/${path}`);
    if (why === null) remember(text, facts);
    report(text, [], why);
  });

  const force = (name, value) => step(`${name} is forced to ${value}.`, [{ kind: 'force', name, after: value }]);
  const release = (name) => step(`${name} is released.`, [{ kind: 'force', name, after: null }]);

  /** Gives boxes other places: [name, { x, y, folded, group }], each with what changes. */
  const place = (text, list) => queue(() => {
    const facts = list.map(([name, wanted]) => {
      const before = lab.places.get(name) ?? null;
      return { kind: 'place', name, before, after: { ...before, ...wanted } };
    });
    return carryOut(text, facts.filter(({ before, after }) => !isSame('place', before, after)));
  });

  const arrange = () => queue(async () => {
    const before = new Map(lab.places);
    const why = await send('PUT', '/layout/arranged');
    if (why !== null) {
      say(why, true);
      return;
    }
    await lab.next(PATIENCE);
    const facts = [];
    for (const [name, after] of lab.places) {
      const was = before.get(name);
      if (was && !isSame('place', was, after)) facts.push({ kind: 'place', name, before: was, after });
    }
    remember('Arranged all boxes.', facts);
    say('Arranged all boxes.');
  });

  return {
    connect, cut, force, release, place, arrange,
    undo: () => turn(done, undone, ['after', 'before'], 'undo'),
    redo: () => turn(undone, done, ['before', 'after'], 'redo'),
    listen: (tell) => { say = tell; },
  };
})();
