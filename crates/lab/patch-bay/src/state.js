'use strict';

// The state of the laboratory as the page knows it: clients, channels, cables and places. Draws nothing.
const lab = (() => {
  /** Clients by their names: { name, isHere, role, address, shape, inputs, outputs }. */
  const clients = new Map();
  /**
   * Channels by their names: { name, client, channel, label, raw, isInput, isAnalog, isHere, value, isForced, isOn }.
   * `raw` is the client's own value and the forced one; `value` is what counts.
   */
  const pins = new Map();
  /** Cables by their inputs: { input, output, awake }. */
  const cables = new Map();
  /** The inputs of each connected output. */
  const fed = new Map();
  /** Places of boxes by the names of clients: { x, y, folded, group }. */
  const places = new Map();
  /** What this page alone has folded or unfolded, without the token. */
  const own = new Map();
  /** The clients of the dispatcher as it sent them. */
  let present = new Map();
  let waiting = [];
  let isKnown = false;

  const clientOf = (name) => name.slice(0, name.lastIndexOf(':'));

  function makePin(client, isHere, raw) {
    const isInput = /^A?I/.test(raw.channel);
    const name = `${client}:${raw.channel}`;
    const isAnalog = raw.channel.startsWith('A');
    const pin = { name, client, channel: raw.channel, label: raw.label ?? null, raw, isInput, isAnalog, isHere, isOn: false };
    pins.set(name, pin);
    rate(pin);
    return pin;
  }

  /** Derives the value that counts, and the level: on above 8 V, off below 5 V, unchanged in between. */
  function rate(pin) {
    pin.isForced = pin.raw.forced !== null;
    pin.value = pin.raw.forced ?? pin.raw.value;
    const number = Number(pin.value);
    if (pin.value === null) pin.isOn = false;
    else if (pin.isAnalog) pin.isOn = Boolean(number);
    else pin.isOn = number > 8 || (number >= 5 && pin.isOn);
  }

  /** All clients: connected ones, and those that only cables remember. */
  function everyone() {
    const all = Array.from(present.values(), (client) => ({ ...client, channels: [...client.channels], isHere: true }));
    const byName = new Map(all.map((client) => [client.name, client]));
    const known = new Map(all.map((client) => [client.name, new Set(client.channels.map(({ channel }) => channel))]));
    for (const { input, output } of cables.values()) {
      for (const pin of [input, output]) {
        const name = clientOf(pin);
        const channel = pin.slice(name.length + 1);
        if (!byName.has(name)) {
          const client = { name, isHere: false, channels: [] };
          all.push(client);
          byName.set(name, client);
          known.set(name, new Set());
        }
        // A cable can also remember a channel that its client no longer has.
        if (known.get(name).has(channel)) continue;
        known.get(name).add(channel);
        byName.get(name).channels.push({ channel, value: null, forced: null });
      }
    }
    for (const client of all) {
      if (!client.isHere) client.channels.sort((one, other) => one.channel.localeCompare(other.channel, 'en', { numeric: true }));
    }
    return all;
  }

  /** Takes over other clients and cables; returns the names of the clients that have to be drawn again. */
  function reshape() {
    const all = everyone();
    const names = new Set(all.map(({ name }) => name));
    const reshaped = new Set();
    for (const name of clients.keys()) if (!names.has(name)) forget(name);
    for (const { name, isHere, role, address, channels } of all) {
      const shape = JSON.stringify([isHere, role, address, channels.map((it) => [it.channel, it.label])]);
      const old = clients.get(name);
      if (old?.shape === shape) {
        for (const raw of channels) {
          const pin = pins.get(`${name}:${raw.channel}`);
          pin.raw = raw;
          rate(pin);
        }
        continue;
      }
      const levels = new Map();
      if (old) {
        for (const pin of [...old.inputs, ...old.outputs]) levels.set(pin.name, pin.isOn);
        forget(name);
      }
      const made = channels.map((raw) => makePin(name, isHere, raw));
      for (const pin of made) {
        pin.isOn = levels.get(pin.name) ?? pin.isOn;
        rate(pin);
      }
      const inputs = made.filter(({ isInput }) => isInput);
      clients.set(name, { name, isHere, role, address, shape, inputs, outputs: made.filter(({ isInput }) => !isInput) });
      reshaped.add(name);
    }
    fed.clear();
    for (const { input, output } of cables.values()) {
      if (!fed.has(output)) fed.set(output, []);
      fed.get(output).push(input);
    }
    return reshaped;
  }

  function forget(name) {
    const client = clients.get(name);
    clients.delete(name);
    for (const pin of [...client.inputs, ...client.outputs]) pins.delete(pin.name);
  }

  /**
   * Takes over an event. Returns { isOther, reshaped, changed, placed }: whether clients or cables are others, which clients
   * have another shape, which channels another value, and whether boxes have other places. Null without a whole state, and for that of another kind of page, which has the number of a run.
   */
  function take(event) {
    if (event.run !== undefined) return null;
    if (event.full) {
      present = new Map();
      cables.clear();
      places.clear();
      isKnown = true;
    } else if (!isKnown) return null;
    for (const name of event.gone ?? []) present.delete(name);
    for (const client of event.clients ?? []) present.set(client.name, client);
    for (const input of event.cut ?? []) cables.delete(input);
    for (const cable of event.connections ?? []) cables.set(cable.input, cable);
    for (const [name, place] of Object.entries(event.places ?? {})) places.set(name, place);
    const isOther = Boolean(event.full || event.gone || event.clients || event.cut || event.connections);
    const reshaped = isOther ? reshape() : new Set();
    const changed = isOther ? [...pins.values()] : [];
    for (const [name, values] of Object.entries(event.values ?? {})) {
      for (const [channel, value] of Object.entries(values)) {
        const pin = pins.get(`${name}:${channel}`);
        if (!pin) continue;
        [pin.raw.value, pin.raw.forced] = Array.isArray(value) ? value : [value, null];
        rate(pin);
        if (!isOther) changed.push(pin);
      }
    }
    for (const tell of waiting.splice(0)) tell();
    return { isOther, reshaped, changed, placed: Boolean(event.places) };
  }

  /** Waits for the next event, but not longer than `most` milliseconds. */
  const next = (most) => new Promise((done) => {
    waiting.push(done);
    setTimeout(done, most);
  });

  /** The cables of a channel. */
  function cablesOf(pin) {
    if (pin.isInput) return cables.has(pin.name) ? [cables.get(pin.name)] : [];
    return (fed.get(pin.name) ?? []).map((input) => cables.get(input));
  }

  const isFolded = (name) => own.get(name) ?? places.get(name)?.folded ?? false;

  /**
   * The path through all cascades: cables and channels upstream and downstream. `near` are the cables of the channel or cable
   * itself; a client passes on from any of its inputs to any of its outputs.
   */
  function path(name, isCable) {
    const near = new Set();
    const far = new Set();
    const start = pins.get(name);
    const ends = new Set([name]);
    const own = isCable ? [cables.get(name)].filter(Boolean) : start ? cablesOf(start) : [];
    for (const cable of own) near.add(cable.input);
    const follow = (first, isDown) => {
      const seen = new Set();
      const open = first.slice();
      while (open.length) {
        const client = clients.get(open.pop());
        if (!client || seen.has(client.name)) continue;
        seen.add(client.name);
        for (const pin of isDown ? client.outputs : client.inputs) {
          for (const { input, output } of cablesOf(pin)) {
            if (!near.has(input)) far.add(input);
            open.push(clientOf(isDown ? input : output));
          }
        }
      }
    };
    const isOutput = start && !start.isInput && !isCable;
    follow(own.length ? own.map(({ input }) => clientOf(input)) : isOutput ? [] : [clientOf(name)], true);
    follow(own.length ? own.map(({ output }) => clientOf(output)) : isOutput ? [clientOf(name)] : [], false);
    for (const input of [...near, ...far]) {
      ends.add(input);
      ends.add(cables.get(input).output);
    }
    return { near, far, ends };
  }

  return { clients, pins, cables, places, own, clientOf, take, next, cablesOf, isFolded, path, get isKnown() { return isKnown; } };
})();
