"use strict";

// The nets as the page knows them, and which of them the others wait for.

const nets = (() => {
  /** Nets that were not scanned for this long are shown as standing still. */
  const STILL = 1500;
  /** A net that has fired so recently runs, in microseconds. */
  const RUNS = 1_000_000;
  const DISABLED = 0, DELAYED = 1, HELD = 2, READY = 3;

  /** One net of one program. */
  class Net {
    constructor(set, number, layout) {
      Object.assign(this, { set, number, layout, name: layout.name, state: null, age: 0 });
      this.id = `${set.id}/${number}`;
    }

    /** The state, and how old it is in milliseconds. */
    take(state, age) {
      this.state = state;
      this.age = state ? state.age + age : 0;
      this.isStill = this.age > STILL;
      const fired = state ? state.last.filter((at) => at !== null) : [];
      /** For how long nothing has fired, in microseconds. */
      this.quiet = state ? state.us - (fired.length ? Math.max(...fired) : 0) : 0;
      /** The transitions that are held back. */
      this.held = state ? this.layout.transitions.map((_, t) => t).filter((t) => state.phases[t] === String(HELD)) : [];
    }

    /** The part of its condition that holds the transition back; undefined if it is not known. */
    partOf(t) {
      const parts = this.layout.transitions[t]?.parts ?? [];
      // Of a condition in code the page only knows that it does not hold.
      return parts[this.state.failed[t] ?? (parts.length === 1 ? 0 : -1)];
    }

    /** The other net that a transition waits for. */
    blockerOf(t) {
      const part = this.partOf(t);
      return part?.net === undefined || part.net === this.name ? undefined : this.set.byName.get(part.net);
    }

    /** The other nets that this one waits for. */
    waitsFor() {
      return this.mark()[0] === "waits" ? this.held.map((t) => this.blockerOf(t)).filter(Boolean) : [];
    }

    /** The value of what a part of a condition tests, as text. */
    valueOf(part) {
      if (part.input !== undefined) {
        const i = this.layout.inputs.indexOf(part.input);
        return i < 0 ? "" : value(this.state.in[i]);
      }
      const other = this.set.byName.get(part.net);
      const p = part.place === undefined || !other?.state ? -1 : other.layout.places.indexOf(part.place);
      return p < 0 ? "" : String(other.state.tokens[p]);
    }

    /** The condition of the net in one or two words, and the class of its tag. */
    mark() {
      const state = this.state;
      if (!state || state.scans === 0) return ["not scanned yet", ""];
      if (state.stop) return ["stopped", "bad"];
      if (this.isStill) return ["stands still", ""];
      if (state.phases.includes(String(READY)) || this.quiet < RUNS) return ["runs", "good"];
      if (state.phases.includes(String(DELAYED))) return ["delayed", "good"];
      return [this.held.length ? "waits" : "nothing enabled", "stale"];
    }

    /** What the net waits for, and for how long; empty if it does not wait. */
    why() {
      if (this.state?.stop) return this.state.stop;
      if (this.mark()[0] !== "waits") return "";
      // A transition that another net holds back says more than one for an event that may never come, such as a stop.
      const t = this.held.find((one) => this.blockerOf(one)) ?? this.held[0];
      const part = this.partOf(t);
      const { name } = this.layout.transitions[t];
      const what = part ? `${part.text} (${this.valueOf(part) || "not so"})` : "its condition";
      return `${seconds(this.quiet, 0)}: ${name} waits for ${what}`;
    }
  }

  function seconds(us, decimals = 3) {
    return us === null ? "–" : `${(us / 1e6).toFixed(decimals)} s`;
  }

  function value(number) {
    if (number === null) return "not a number";
    return Number.isInteger(number) ? String(number) : String(Number(number.toPrecision(6)));
  }

  /** The number of nets that wait for this one, also through others. */
  function waiters(net, all) {
    const found = new Set([net]);
    // Each that is found can be waited for, too.
    for (const one of found) for (const other of all) if (other.waitsFor().includes(one)) found.add(other);
    return found.size - 1;
  }

  /**
   * The net to look at: one that has stopped; or where nothing has happened for a while, of the nets that wait for no other one
   * that which most others wait for, and of those the one that has waited longest. Null while the nets run.
   */
  function cause(all, patience) {
    const stopped = all.find((net) => net.state?.stop);
    if (stopped) return stopped;
    const scanned = all.filter((net) => net.state?.scans && !net.isStill);
    const waiting = scanned.filter((net) => net.mark()[0] === "waits");
    const isQuiet = scanned.every((net) => net.quiet > patience && net.mark()[0] !== "delayed");
    if (!waiting.length || !isQuiet) return null;
    const roots = waiting.filter((net) => !net.waitsFor().length);
    // Without any, the nets wait for each other in a circle.
    return (roots.length ? roots : waiting).reduce((best, net) => {
      const more = waiters(net, waiting) - waiters(best, waiting);
      return more > 0 || (more === 0 && net.quiet > best.quiet) ? net : best;
    });
  }

  return { DISABLED, DELAYED, HELD, READY, Net, cause, seconds, value };
})();
