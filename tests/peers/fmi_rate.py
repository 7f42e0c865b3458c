#!/usr/bin/env python3
"""Measures FMPy's steps per second with an FMU of tickbus, beside another FMU whose steps do next to nothing.

    fmi_rate.py VERSION OURS.fmu OTHER.fmu

Measured by turns, so that both have the same machine. Prints "rust fmi.NAME RATE", in the form of the other benches.
"""

import statistics
import sys
import tempfile
import time

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

ROUNDS, STEPS, STEP = 15, 20_000, 0.001


class Run:
    def __init__(self, path):
        description = read_model_description(path)
        is_two = description.fmiVersion == "2.0"
        self.slave = (FMU2Slave if is_two else FMU3Slave)(
            guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier, unzipDirectory=extract(path), instanceName="it"
        )
        self.slave.instantiate()
        if is_two:
            self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.time = 0.0

    def rate(self):
        step, now = self.slave.doStep, self.time
        start = time.perf_counter()
        for _ in range(STEPS):
            step(now, STEP)
            now += STEP
        spent = time.perf_counter() - start
        self.time = now
        return STEPS / spent


version, ours, other = sys.argv[1:]
# FMPy leaves what it extracts, 50 MB each.
with tempfile.TemporaryDirectory() as tempfile.tempdir:
    runs = [Run(ours), Run(other)]
    rates = [[run.rate() for run in runs] for _ in range(ROUNDS)]
for name, column in (("ours", 0), ("other", 1)):
    print(f"rust fmi.{version}.{name} {statistics.median(rate[column] for rate in rates):.0f}")
print(f"rust fmi.{version}.ratio {statistics.median(a / b for a, b in rates):.3f}")
