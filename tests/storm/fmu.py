"""An end of a line of the storm: the product's own FMU in FMPy. README.md in this folder describes its arguments and its
output. The FMU, PATH.fmu, contains its driver.cfg, which also lies beside it as PATH.cfg."""

import os
import shutil
import signal
import sys
import time
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave

path, log, life, area, stations, period, pulse_every, _halves, pause_at, pause = sys.argv[1:]
life, stations, period, pulse_every, pause_at, pause = map(int, (life, stations, period, pulse_every, pause_at, pause))
is_input = area == "I"
out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
fmu = str(Path(path).with_suffix(".fmu"))
description = read_model_description(fmu)
references = {variable.name: variable.valueReference for variable in description.modelVariables}
folder = extract(fmu)
slave = FMU3Slave(
    guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier, unzipDirectory=folder, instanceName="end"
)


def told(_environment, status, _category, message):
    if status:
        print(message.decode(), file=sys.stderr, flush=True)


def leave(_number, _frame):
    global is_over
    is_over = True


def of(name, side):
    return [references[f"{name}{side}{station}"] for station in range(stations)]


def signed(number):
    return (number & 0xFFFF ^ 0x8000) - 0x8000


is_over = False
signal.signal(signal.SIGTERM, leave)
slave.instantiate(logMessage=told)
# The program paces itself by the clock.
slave.setFloat64([references["pace"]], [0.0])
slave.enterInitializationMode()
slave.exitInitializationMode()
other = "Q" if is_input else "I"
to = {name: of(name, area) for name in ("stamp", "pulse", "level", "whole", "real")}
read = {name: of(name, other) for name in ("stamp", "level", "whole", "real")}
edges = [references[f"pulse{other}{station}.edges"] for station in range(stations)]
tick, due, simulated = 0, time.monotonic_ns(), 0.0
while not is_over:
    tick += 1
    due = max(due + period, time.monotonic_ns() - period)
    time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
    numbers = [life << 48 | is_input << 44 | station << 40 | tick for station in range(stations)]
    mixed = [number * 0x9E3779B97F4A7C15 & 0xFFFFFFFFFFFFFFFF for number in numbers]
    slave.setUInt64(to["stamp"], numbers)
    slave.setBoolean(to["pulse"], [tick % pulse_every == 0] * stations)
    slave.setBoolean(to["level"], [bool(number >> 63) for number in mixed])
    slave.setInt16(to["whole"], [signed(number >> 32) for number in mixed])
    slave.setFloat64(to["real"], [signed(number >> 16) / 2 for number in mixed])
    began = time.monotonic_ns()
    slave.doStep(simulated, period / 1e9)
    ended = time.monotonic_ns()
    simulated += period / 1e9
    (age,) = slave.getFloat64([references["bus.age"]])
    (status,), (sequence,) = slave.getInt64([references["bus.status"]]), slave.getUInt64([references["bus.sequence"]])
    line = [tick, began, ended, ended, status, round(age * 1e9), sequence]
    columns = [slave.getUInt64(read["stamp"]), slave.getBoolean(read["level"]), slave.getUInt32(edges)]
    columns += [slave.getInt16(read["whole"]), slave.getFloat64(read["real"])]
    for stamp, level, edge, whole, real in zip(*columns):
        line += [stamp, int(level), edge, whole, real]
    os.write(out, (" ".join(map(str, line)) + "\n").encode())
    if tick == pause_at:
        time.sleep(pause / 1e9)
slave.terminate()
slave.freeInstance()
shutil.rmtree(folder, ignore_errors=True)
