#!/usr/bin/env python3
"""A queue in front of a machine, simulated by SimPy, with a PLC that stops the feeder while the queue is full.

    buffer.py [--hours 8] [--limit 5] [--seed 1] [--config buffer.cfg] [--without-plc]

The PLC's program is scanned every 10 ms of the simulation's time, so that hours take seconds, and the same seed gives the
same run. The feeder learns of a full buffer at the PLC's next scan, as in the plant.
"""

import argparse
import random
import sys
from pathlib import Path

import simpy

import tickbus

HERE = Path(__file__).parent
FEED = 8.0  # s, from part to part on average
WORK = 7.5  # s, for a part on average
LOOK = 0.05  # s, between two exchanges


class Cell:
    """Feeder, buffer and machine."""

    def __init__(self, env, limit, seed):
        self.env, self.limit = env, limit
        self.random = random.Random(seed)
        self.buffer = simpy.Store(env)
        self.stopped = False
        self.made = self.longest = 0
        self.waited = 0.0
        env.process(self.feed())
        env.process(self.work())

    @property
    def is_full(self):
        return len(self.buffer.items) >= self.limit

    def feed(self):
        while True:
            yield self.env.timeout(self.random.expovariate(1 / FEED))
            while self.stopped:
                yield self.env.timeout(LOOK)
            yield self.buffer.put(self.env.now)
            self.longest = max(self.longest, len(self.buffer.items))

    def work(self):
        while True:
            came = yield self.buffer.get()
            self.waited += self.env.now - came
            yield self.env.timeout(self.random.expovariate(1 / WORK))
            self.made += 1


def fieldbus(env, cell, plc):
    """The PLC, as a further process of the simulation."""
    stop, full = plc["Feeder stop"], plc["Buffer full"]
    while True:
        plc.receive(env.now)
        cell.stopped = stop.value
        full.value = cell.is_full
        plc.send()
        yield env.timeout(LOOK)


def run(hours, limit, seed, plc):
    """Runs the cell for this many hours and returns it."""
    env = simpy.Environment()
    cell = Cell(env, limit, seed)
    if plc is not None:
        env.process(fieldbus(env, cell, plc))
    env.run(until=3600 * hours)
    return cell


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--limit", type=int, default=5, help="parts that the buffer holds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--config", default=HERE / "buffer.cfg")
    parser.add_argument("--without-plc", action="store_true", help="nobody stops the feeder")
    arguments = parser.parse_args()
    if arguments.without_plc:
        cell = run(arguments.hours, arguments.limit, arguments.seed, None)
    else:
        with tickbus.open(arguments.config) as plc:
            cell = run(arguments.hours, arguments.limit, arguments.seed, plc)
    wait = cell.waited / max(1, cell.made)
    print(f"buffer: ok made={cell.made} longest={cell.longest} limit={arguments.limit} wait_s={wait:.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
