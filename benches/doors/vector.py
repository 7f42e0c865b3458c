#!/usr/bin/env python3
"""Measures 1,024 stepped drivers that tick in one call, beside a call for each; resets, beside closing and opening again; and
the steps of Gymnasium's VectorEnv in examples/gymnasium.

    vector.py FILE RIG-FILE GYMNASIUM-FOLDER

Prints lines for tools/bench-table.
"""

import statistics
import sys
import time

import tickbus

ROUNDS = 15
ENVS = 1024
TICKS = 50
RESETS = 200
STEPS = 100
RIG = {"fieldbus": {"kind": "loopback", "program": "rig", "mode": "stepped"}}


def median(count, work):
    """The median of the rates of `work`, which does `count` things."""
    rates = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        work()
        rates.append(count / (time.perf_counter() - begin))
    return statistics.median(rates)


def ticks(file):
    with tickbus.open_vector(file, ENVS, {"fieldbus": {"mode": "stepped"}}) as plcs:
        now = 0

        def together():
            nonlocal now
            for _ in range(TICKS):
                now += 1_000_000
                assert plcs.exchange(ns=now) == 0

        def one_by_one():
            nonlocal now
            for _ in range(TICKS):
                now += 1_000_000
                for plc in plcs:
                    plc.exchange(ns=now)

        print(f"rust doors.vector.exchange {median(ENVS * TICKS, together):.0f}")
        print(f"rust doors.vector.loop {median(ENVS * TICKS, one_by_one):.0f}")

        def resets():
            assert plcs.reset() == 0

        print(f"rust doors.vector.reset_us {1e6 / median(ENVS, resets):.2f}")


def reset(name, file, overlay):
    with tickbus.open(file, overlay) as plc:

        def resets():
            for tick in range(RESETS):
                plc.exchange(ns=0)
                plc.reset()

        print(f"rust doors.reset.{name}_us {1e6 / median(RESETS, resets):.1f}")

    def opens():
        for _ in range(RESETS):
            with tickbus.open(file, overlay) as plc:
                plc.exchange(ns=0)

    print(f"rust doors.reset.{name}_open_us {1e6 / median(RESETS, opens):.1f}")


def gymnasium(folder):
    sys.path.insert(0, folder)
    try:
        import tanks
    except ImportError as error:
        print(f"bench: {error}, so no VectorEnv is measured", file=sys.stderr)
        return
    envs = tanks.TanksVectorEnv(ENVS)
    observed, _ = envs.reset(seed=1)

    def steps():
        nonlocal observed
        for _ in range(STEPS):
            observed, *_ = envs.step((observed[:, :1] / tanks.FULL) ** 0.5)

    print(f"rust doors.vector.gymnasium {median(ENVS * STEPS, steps):.0f}")
    envs.close()


ticks(sys.argv[1])
reset("mirror", sys.argv[1], {"fieldbus": {"mode": "stepped"}})
reset("rig", sys.argv[2], RIG)
gymnasium(sys.argv[3])
