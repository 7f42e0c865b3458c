#!/usr/bin/env python3
"""Measures the transitions that SNAKES fires per second, in the net of 100 places of java/bench's PetriBench.

Prints "rust petri.snakes RATE", in the form of the other benches.
"""

import time

from snakes.nets import PetriNet, Place, Transition, Value, dot

MACHINES = 50
SECONDS = 3.0


def main():
    net = PetriNet("machines")
    for i in range(MACHINES):
        net.add_place(Place(f"idle{i}", [dot]))
        net.add_place(Place(f"busy{i}", []))
        for name, source, target in ((f"start{i}", "idle", "busy"), (f"end{i}", "busy", "idle")):
            net.add_transition(Transition(name))
            net.add_input(f"{source}{i}", name, Value(dot))
            net.add_output(f"{target}{i}", name, Value(dot))
    fired, start = 0, time.perf_counter()
    while time.perf_counter() - start < SECONDS:
        for i in range(MACHINES):
            for name in (f"start{i}", f"end{i}"):
                transition = net.transition(name)
                transition.fire(transition.modes()[0])
                fired += 1
    print(f"rust petri.snakes {fired / (time.perf_counter() - start):.0f}")


main()
