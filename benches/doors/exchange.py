#!/usr/bin/env python3
"""Measures exchanges from Python, beside calls of an empty C function by ctypes; and MuJoCo's steps with an exchange in each.

    exchange.py FILE EMPTY-LIBRARY CONVEYOR-XML

Prints lines for tools/bench-table.
"""

import ctypes
import statistics
import sys
import time

import numpy

import tickbus

ROUNDS = 15
CALLS = 100_000
STEPS = 1500


def rate(work, count):
    """Calls per second."""
    begin = time.perf_counter()
    work(count)
    return count / (time.perf_counter() - begin)


def compared(count, **work):
    """The medians of their rates, measured by turns, so that the machine's load affects all of them."""
    rates = {name: [] for name in work}
    for _ in range(ROUNDS):
        for name, one in work.items():
            rates[name].append(rate(one, count))
    return {name: statistics.median(found) for name, found in rates.items()}


def exchanges(file, library):
    empty = ctypes.CDLL(library).empty

    def by_ctypes(count):
        for _ in range(count):
            empty()

    with tickbus.open(file) as free, tickbus.open(file, {"fieldbus": {"mode": "stepped"}}) as stepped:
        values, exchange = numpy.asarray(free.slots), free.exchange

        def by_python(count):
            for _ in range(count):
                exchange()

        def with_numpy(count):
            for tick in range(count):
                values[tick & 15] = tick & 1
                exchange()

        signals = [signal for signal in free.signals if signal.is_written]

        def with_signals(count):
            for tick in range(count):
                signals[tick & 15].value = tick & 1
                exchange()

        now, by_time = 0, stepped.exchange

        def in_steps(count):
            nonlocal now
            for _ in range(count):
                now += 1_000_000
                by_time(ns=now)

        found = compared(CALLS, ctypes=by_ctypes, free=by_python, numpy=with_numpy, signals=with_signals, stepped=in_steps)
    for name, figure in found.items():
        print(f"rust doors.python.{name} {figure:.0f}")
    print(f"rust doors.python.ratio {found['free'] / found['ctypes']:.3f}")


def physics(file, model_file):
    try:
        import mujoco
    except ImportError:
        print("bench: there is no MuJoCo to compare with", file=sys.stderr)
        return
    model = mujoco.MjModel.from_xml_path(model_file)
    data = mujoco.MjData(model)

    def alone(count):
        mujoco.mj_resetData(model, data)
        for _ in range(count):
            mujoco.mj_step(model, data)

    with tickbus.open(file) as plc:
        run, position = plc["out 0"], plc["in 0"]

        def with_plc(count):
            mujoco.mj_resetData(model, data)
            for _ in range(count):
                plc.receive(data.time)
                data.ctrl[0] = run.value
                mujoco.mj_step(model, data)
                position.value = data.qpos[0] > 1
                plc.send()

        found = compared(STEPS, alone=alone, plc=with_plc)
    print(f"rust doors.mujoco.alone {found['alone']:.0f}")
    print(f"rust doors.mujoco.plc {found['plc']:.0f}")
    print(f"rust doors.mujoco.ratio {found['plc'] / found['alone']:.3f}")


exchanges(*sys.argv[1:3])
physics(sys.argv[1], sys.argv[3])
