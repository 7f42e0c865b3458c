#!/usr/bin/env python3
"""Explores nets with SNAKES, for comparison with the Petri net library in Java.

    petri_oracle.py FILE LIMIT

FILE has lines of words: "net NUMBER", "place NAME TOKENS", "transition NAME", "arc KIND PLACE TRANSITION WEIGHT" with the
kinds INPUT, OUTPUT, TEST and INHIBITOR. For each net one line is printed: its number and "more than LIMIT", or markings,
firings, deadlocks, home states, the live transitions (+ between them, - if none) and the bounds of the places.
"""

import sys

from snakes.nets import Inhibitor, MultiArc, PetriNet, Place, StateGraph, Test, Transition, Value, dot

ALWAYS = "always marked"


class Net:
    def __init__(self, number):
        self.number = number
        self.net = PetriNet(number)
        self.places = []
        self.transitions = []
        self.arcs = []

    def finish(self):
        # SNAKES never fires a transition without an input arc: here it tests a place that is always marked.
        self.net.add_place(Place(ALWAYS, [dot]))
        with_input = {transition for kind, _, transition, _ in self.arcs if kind != "OUTPUT"}
        for transition in self.transitions:
            if transition not in with_input:
                self.net.add_input(ALWAYS, transition, Test(Value(dot)))
        for kind, place, transition, weight in self.arcs:
            tokens = [Value(dot)] * weight
            label = tokens[0] if weight == 1 else MultiArc(tokens)
            if kind == "OUTPUT":
                self.net.add_output(place, transition, label)
            elif kind == "INPUT":
                self.net.add_input(place, transition, label)
            elif kind == "TEST":
                self.net.add_input(place, transition, Test(label))
            else:
                self.net.add_input(place, transition, Inhibitor(label))


def read(path):
    nets = []
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words[0] == "net":
                nets.append(Net(words[1]))
            elif words[0] == "place":
                nets[-1].places.append(words[1])
                nets[-1].net.add_place(Place(words[1], [dot] * int(words[2])))
            elif words[0] == "transition":
                nets[-1].transitions.append(words[1])
                nets[-1].net.add_transition(Transition(words[1]))
            else:
                nets[-1].arcs.append((words[1], words[2], words[3], int(words[4])))
    for net in nets:
        net.finish()
    return nets


def reach(successors, start):
    seen = {start}
    todo = [start]
    while todo:
        for target, _ in successors[todo.pop()]:
            if target not in seen:
                seen.add(target)
                todo.append(target)
    return seen


def explore(net, limit):
    graph = StateGraph(net.net)
    successors = {}
    bounds = dict.fromkeys(net.places, 0)
    for state in graph:
        if len(graph) > limit:
            return f"more than {limit}"
        graph.goto(state)
        for place in net.places:
            bounds[place] = max(bounds[place], len(graph.net.place(place).tokens))
        successors[state] = {(target, transition.name) for target, transition, _ in graph.successors()}
    reached = {state: reach(successors, state) for state in successors}
    home = set.intersection(*reached.values())
    firing = {state: {name for one in reached[state] for _, name in successors[one]} for state in successors}
    live = [name for name in net.transitions if all(name in names for names in firing.values())]
    edges = sum(len(all_of_it) for all_of_it in successors.values())
    dead = sum(not all_of_it for all_of_it in successors.values())
    sizes = " ".join(str(bounds[place]) for place in net.places)
    return f"{len(successors)} {edges} {dead} {len(home)} {'+'.join(live) or '-'} {sizes}"


def main():
    for net in read(sys.argv[1]):
        print(net.number, explore(net, int(sys.argv[2])))


if __name__ == "__main__":
    main()
