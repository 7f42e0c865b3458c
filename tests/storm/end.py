"""An end of a line of the storm, in Python. README.md in this folder describes its arguments and its output."""

import os
import sys
import time

import tickbus

path, log, life, area, stations, period, pulse_every, halves, pause_at, pause = sys.argv[1:]
life, stations, period, pulse_every, pause_at, pause = map(int, (life, stations, period, pulse_every, pause_at, pause))
is_input, halves = area == "I", halves == "1"
out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
NAMES = ("stamp", "pulse", "level", "whole", "real")


def signed(number):
    return (number & 0xFFFF ^ 0x8000) - 0x8000


# SIGTERM ends the process; the package must close the driver.
with tickbus.open(path) as plc:
    written = [[plc[f"{name}{area}{station}"] for name in NAMES] for station in range(stations)]
    read = [[plc[f"{name}{'Q' if is_input else 'I'}{station}"] for name in NAMES] for station in range(stations)]
    tick, due = 0, time.monotonic_ns()
    while True:
        tick += 1
        due = max(due + period, time.monotonic_ns() - period)
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        began = time.monotonic_ns()
        if halves:
            status = plc.receive()
            received = time.monotonic_ns()
        for station, (stamp, pulse, level, whole, real) in enumerate(written):
            number = life << 48 | is_input << 44 | station << 40 | tick
            mixed = number * 0x9E3779B97F4A7C15 & 0xFFFFFFFFFFFFFFFF
            stamp.value = number
            pulse.value = tick % pulse_every == 0
            level.value = mixed >> 63
            whole.value = signed(mixed >> 32)
            real.value = signed(mixed >> 16) / 2
        if halves:
            plc.send()
        else:
            status = plc.exchange()
        ended = time.monotonic_ns()
        line = [tick, began, received if halves else ended, ended, int(status), round(min(plc.age, 9e9) * 1e9), plc.sequence]
        for stamp, pulse, level, whole, real in read:
            line += [stamp.value, int(level.value), pulse.edges, whole.value, real.value]
        os.write(out, (" ".join(map(str, line)) + "\n").encode())
        if tick == pause_at:
            time.sleep(pause / 1e9)
