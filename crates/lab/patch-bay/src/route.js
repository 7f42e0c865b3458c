'use strict';

// Finds ways for cables around boxes, and keeps cables apart that do not come from the same output.
const route = (() => {
  /** The distance of a way from a box, and the smallest one. */
  const AWAY = 12;
  const CLOSE = 6;
  /** The distance of cables beside each other. */
  const STEP = 6;
  /** The detours that are tried. */
  const DETOURS = 60;
  const RADIUS = 8;

  /** True if a horizontal or vertical line comes too close to a box. */
  function isBlocked(boxes, x1, y1, x2, y2) {
    const [left, right] = x1 < x2 ? [x1, x2] : [x2, x1];
    const [top, bottom] = y1 < y2 ? [y1, y2] : [y2, y1];
    for (const box of boxes) {
      if (left < box.right + CLOSE && right > box.left - CLOSE && top < box.bottom + CLOSE && bottom > box.top - CLOSE) return true;
    }
    return false;
  }

  /** A way from an output's right to an input's left: a list of the segments between, [isVertical, place, side]. */
  function find(boxes, from, to) {
    const [x1, y1] = from;
    const [x2, y2] = to;
    const isFree = (...line) => !isBlocked(boxes, ...line);
    const out = x1 + AWAY;
    const back = x2 - AWAY;
    // One vertical line between the two. A short line from the channel to its lane touches only its own box.
    const lanes = [];
    if (back >= out) {
      lanes.push([out, 1], [back, -1]);
      for (const { left, right } of boxes) {
        if (right + AWAY > out && right + AWAY < back) lanes.push([right + AWAY, 1]);
        if (left - AWAY > out && left - AWAY < back) lanes.push([left - AWAY, -1]);
        if (lanes.length > DETOURS) break;
      }
    }
    for (const [x, side] of lanes) {
      const isReached = x === out || isFree(out, y1, x, y1);
      const isEnd = x === back || isFree(x, y2, back, y2);
      if (isReached && isEnd && isFree(x, y1, x, y2)) return [[true, x, side]];
    }
    // Out, to a corridor above or below the boxes, and back.
    const corridors = [];
    const length = (y) => Math.abs(y - y1) + Math.abs(y - y2);
    for (const { top, bottom } of boxes) corridors.push([top - AWAY, -1], [bottom + AWAY, 1]);
    corridors.sort((one, other) => length(one[0]) - length(other[0]));
    let best = corridors[0] ?? [Math.max(y1, y2) + 40, 1];
    for (const corridor of corridors.slice(0, DETOURS)) {
      const y = corridor[0];
      if (isFree(out, y1, out, y) && isFree(out, y, back, y) && isFree(back, y, back, y2)) {
        best = corridor;
        break;
      }
    }
    return [[true, out, 1], [false, ...best], [true, back, -1]];
  }

  /** Assigns tracks to the nets in one lane: nets that overlap get different ones, and those before others smaller ones. */
  function tracks(nets, isBefore) {
    const done = new Map();
    const visit = (net, stack) => {
      if (done.has(net) || stack.has(net)) return;
      stack.add(net);
      for (const other of nets) if (other !== net && isBefore(other, net)) visit(other, stack);
      let track = 0;
      for (const [other, its] of done) if (isBefore(other, net)) track = Math.max(track, its + 1);
      const isTaken = () => {
        for (const [other, its] of done) if (its === track && other.low < net.high + 8 && net.low < other.high + 8) return true;
        return false;
      };
      while (isTaken()) track += 1;
      done.set(net, track);
    };
    for (const net of nets) visit(net, new Set());
    return done;
  }

  /** Moves segments of different outputs that lie on each other apart; `room` is the space for that. */
  function spread(ways, isVertical, room) {
    const lanes = new Map();
    for (const way of ways) {
      way.segments.forEach((segment, at) => {
        if (segment[0] !== isVertical) return;
        const key = `${Math.round(segment[1])} ${segment[2]}`;
        if (!lanes.has(key)) lanes.set(key, new Map());
        const lane = lanes.get(key);
        const [one, other] = extent(way, at);
        const net = lane.get(way.output) ?? { low: Infinity, high: -Infinity, starts: [], ends: [], segments: [] };
        lane.set(way.output, net);
        net.low = Math.min(net.low, one, other);
        net.high = Math.max(net.high, one, other);
        net.starts.push(one);
        net.ends.push(other);
        net.segments.push(segment);
      });
    }
    const meets = (list, others) => list.some((one) => others.some((other) => Math.abs(one - other) < 4));
    for (const lane of lanes.values()) {
      const nets = [...lane.values()].sort((one, other) => one.low - other.low);
      const side = nets[0].segments[0][2];
      // A line to the lane must not lie on another one that leaves it at the same height.
      const isBefore = isVertical
        ? (one, other) => (side > 0 ? meets(one.starts, other.ends) : meets(one.ends, other.starts))
        : () => false;
      const most = Math.max(1, Math.floor(room / STEP) + 1);
      for (const [net, track] of tracks(nets, isBefore)) {
        for (const segment of net.segments) segment[1] += side * STEP * (track % most);
      }
    }
  }

  /** Where a segment begins and ends, along its own direction. */
  function extent({ from, to, segments }, at) {
    const along = segments[at][0] ? 1 : 0;
    const before = at === 0 ? from[along] : segments[at - 1][1];
    const after = at === segments.length - 1 ? to[along] : segments[at + 1][1];
    return [before, after];
  }

  function points({ from, to, segments }) {
    const list = [from];
    segments.forEach(([isVertical, place], at) => {
      const [before, after] = extent({ from, to, segments }, at);
      for (const along of [before, after]) list.push(isVertical ? [place, along] : [along, place]);
    });
    list.push(to);
    return list.filter((point, at) => at === 0 || point[0] !== list[at - 1][0] || point[1] !== list[at - 1][1]);
  }

  /** A line through points, with round corners. */
  function line(list) {
    let text = `M${list[0].join()}`;
    for (let at = 1; at < list.length - 1; at += 1) {
      const [before, corner, after] = [list[at - 1], list[at], list[at + 1]];
      const cut = (other) => {
        const [dx, dy] = [other[0] - corner[0], other[1] - corner[1]];
        const length = Math.hypot(dx, dy);
        const part = Math.min(RADIUS, length / 2) / length;
        return [corner[0] + dx * part, corner[1] + dy * part].map((it) => Math.round(it * 10) / 10).join();
      };
      text += ` L${cut(before)} Q${corner.join()} ${cut(after)}`;
    }
    return `${text} L${list.at(-1).join()}`;
  }

  /**
   * Lines for cables [{ key, output, from, to }] around boxes [{ left, top, right, bottom }]; `beside` and `between` are the
   * space for cables beside a box and between boxes.
   */
  function all(boxes, cables, { beside, between }) {
    const ways = cables.map((cable) => ({ ...cable, segments: find(boxes, cable.from, cable.to) }));
    spread(ways, false, between);
    spread(ways, true, beside);
    return new Map(ways.map((way) => [way.key, line(points(way))]));
  }

  /** The line of a cable that is being dragged. */
  const loose = ([x1, y1], [x2, y2]) => {
    const reach = Math.max(28, Math.min(120, Math.abs(x2 - x1) / 2));
    return `M${x1},${y1} C${x1 + reach},${y1} ${x2 - reach},${y2} ${x2},${y2}`;
  };

  return { all, loose };
})();
