"""Reads nets in the formats of other tools, and counts what they can do.

usage: petri_dialects.py LIMIT FILE...

One line for each file: markings, firings and deadlocks, or "more" if there are more markings than LIMIT, or "refused" with
the reason. Nothing here comes from the library in Java: the formats are read as their tools describe them. Delays are left
out, as in an analysis.
"""

import re
import sys
import xml.etree.ElementTree as ElementTree
from collections import deque


class Refused(Exception):
    pass


class Net:
    def __init__(self):
        self.marking = {}
        self.capacity = {}
        self.takes = {}
        self.puts = {}
        self.least = {}
        self.below = {}

    def place(self, name, tokens=0):
        self.marking[name] = self.marking.get(name, 0) + tokens

    def transition(self, name):
        for table in (self.takes, self.puts, self.least, self.below):
            table.setdefault(name, {})

    def arc(self, table, transition, place, weight):
        self.place(place)
        self.transition(transition)
        row = table[transition]
        row[place] = row.get(place, 0) + weight

    def explore(self, limit):
        index = {name: number for number, name in enumerate(self.marking)}
        rules = []
        for one in self.takes:
            change = {}
            for place, weight in self.takes[one].items():
                change[index[place]] = change.get(index[place], 0) - weight
            for place, weight in self.puts[one].items():
                change[index[place]] = change.get(index[place], 0) + weight
            least = {index[place]: weight for place, weight in self.least[one].items()}
            for place, weight in self.takes[one].items():
                least[index[place]] = max(least.get(index[place], 0), weight)
            most = {index[place]: weight - 1 for place, weight in self.below[one].items()}
            for place, capacity in self.capacity.items():
                gain = change.get(index[place], 0)
                if gain > 0:
                    most[index[place]] = min(most.get(index[place], capacity - gain), capacity - gain)
            rules.append((list(least.items()), list(most.items()), [item for item in change.items() if item[1]]))
        first = tuple(self.marking.values())
        seen = {first}
        queue = deque(seen)
        firings = deadlocks = 0
        while queue:
            marking = queue.popleft()
            before = firings
            for least, most, change in rules:
                if any(marking[p] < n for p, n in least) or any(marking[p] > n for p, n in most):
                    continue
                firings += 1
                after = list(marking)
                for p, n in change:
                    after[p] += n
                after = tuple(after)
                if after not in seen:
                    if len(seen) == limit:
                        return "more"
                    seen.add(after)
                    queue.append(after)
            deadlocks += firings == before
        return f"{len(seen)} {firings} {deadlocks}"


def local(element):
    return element.tag.rsplit("}", 1)[-1]


def child(element, name):
    return next((one for one in element if local(one) == name), None)


def text(element, name):
    """The text of a label, with <text> or <value> or none of them."""
    label = child(element, name)
    if label is None:
        return None
    for inner in ("text", "value"):
        if child(label, inner) is not None:
            return (child(label, inner).text or "").strip()
    return label.get("value") or (label.text or "").strip() or None


def count(words, otherwise):
    if not words:
        return otherwise
    parts = words.split(",")
    if len(parts) > 2:
        raise Refused(f"colours {words}")
    return int(parts[-1])


def untimed(interval):
    if not re.match(r"\[0,inf\)(:\d+)?$", interval.replace(" ", "")):
        raise Refused(f"interval {interval}")


def pnml(path):
    root = ElementTree.parse(path).getroot()
    if any(local(one) in ("declaration", "module", "shared-place", "shared-transition", "transportArc") for one in root.iter()):
        raise Refused("no place/transition net")
    nets = [one for one in root if local(one) == "net" and one.get("active") != "false"]
    if len(nets) != 1:
        raise Refused(f"{len(nets)} nets")
    kinds = {}
    refers = {}
    arcs = []
    net = Net()

    def walk(element):
        for one in element:
            kind = local(one)
            if kind in ("place", "transition"):
                name = one.get("id")
                kinds[name] = kind
                if kind == "transition":
                    if child(one, "player") is not None or one.get("guard"):
                        raise Refused("a game, or a net with data")
                    net.transition(name)
                    continue
                if child(one, "type") is not None or one.get("invariant", "< inf").replace(" ", "") != "<inf":
                    raise Refused("colours or ages")
                net.place(name, count(text(one, "initialMarking") or one.get("initialMarking"), 0))
                capacity = int(text(one, "capacity") or 0)
                for own in one:
                    if local(own) == "toolspecific" and own.get("tool") == "tickbus" and child(own, "capacity") is not None:
                        capacity = int(child(own, "capacity").text)
                if capacity:
                    net.capacity[name] = capacity
            elif kind in ("referencePlace", "referenceTransition"):
                refers[one.get("id")] = one.get("ref")
            elif kind in ("arc", "inputArc", "outputArc", "inhibitorArc"):
                arcs.append(one)
            elif kind == "page":
                walk(one)

    walk(nets[0])
    for arc in arcs:
        ends = []
        for end in ("source", "target"):
            name = arc.get(end)
            while name in refers:
                name = refers[name]
            ends.append(name)
        source, target = ends
        given = arc.get("inscription")
        if given and given[0] in "[(":
            untimed(given)
            given = None
        weight = count(arc.get("weight") or text(arc, "inscription") or given, 1)
        named = {arc.get("type"), text(arc, "type"), text(arc, "arctype")}
        named |= {"inhibitor"} if local(arc) == "inhibitorArc" else set()
        named -= {None, "normal", "timed", "transport"}
        if not named <= {"inhibitor", "tapnInhibitor", "test", "read"}:
            raise Refused(f"arcs {named}")
        if kinds[source] == "transition":
            net.arc(net.puts, source, target, weight)
        elif named & {"inhibitor", "tapnInhibitor"}:
            net.arc(net.below, target, source, weight)
        elif named:
            net.arc(net.least, target, source, weight)
        else:
            net.arc(net.takes, target, source, weight)
    return net


def lola(path):
    words = open(path, encoding="utf-8", errors="replace").read()
    words = re.sub(r"\{.*?\}|/\*.*?\*/|//[^\n]*", " ", words, flags=re.S)
    words = words.split("FORMULA")[0]
    match = re.match(r"\s*PLACE(.*?)\bMARKING\b([^;]*);(.*)$", words, flags=re.S)
    if not match:
        raise Refused("no place/transition net")
    net = Net()

    def entries(part):
        for entry in part.split(","):
            if entry.strip():
                name, _, number = entry.partition(":")
                if name.strip() not in net.marking:
                    raise Refused(f"no place {name}")
                yield name.strip(), int(number or 1)

    for group in match[1].split(";"):
        for name in re.sub(r"^\s*SAFE\s*\d*\s*:", "", group).split(","):
            if name.strip():
                if name.strip() in net.marking:
                    raise Refused(f"place {name} twice")
                net.place(name.strip())
    for name, number in entries(match[2]):
        net.place(name, number)
    rest = match[3]
    while rest.strip():
        one = re.match(r"\s*TRANSITION\s+(\S+)(?:\s+(?:STRONG|WEAK)\s+FAIR)?\s+CONSUME([^;]*);\s*PRODUCE([^;]*);", rest)
        if not one or one[1] in net.takes:
            raise Refused(f"no transition: {rest.strip()[:20]}")
        net.transition(one[1])
        for table, part in ((net.takes, one[2]), (net.puts, one[3])):
            for name, number in entries(part):
                if number:
                    net.arc(table, one[1], name, number)
        rest = rest[one.end():]
    return net


def tina(path):
    lines = open(path, encoding="utf-8", errors="replace").read().split("\n")
    words = "\n".join(line for line in lines if not line.lstrip().startswith("#"))
    pattern = r"\{(?:\\.|[^\\}])*\}|->|[\]\[][0-9]+,(?:w|[0-9]+)[\]\[]|\([0-9]+[KM]?\)|[*?!]-?[0-9]+[KM]?|:|[<>]|[^\s\]\[():*?!<>{}#]+"
    tokens = re.findall(pattern, words)
    if not tokens:
        raise Refused("empty")
    net = Net()
    position = 0

    def number(word):
        return int(word.rstrip("KM")) * {"K": 1000, "M": 1000000}.get(word[-1], 1)

    def name():
        nonlocal position
        position += 1
        word = tokens[position - 1]
        return re.sub(r"\\(.)", r"\1", word[1:-1]) if word[0] == "{" else word

    while position < len(tokens):
        word = name()
        if word in ("net", "lb", "nt"):
            for _ in range({"net": 1, "lb": 2, "nt": 3}[word]):
                name()
            continue
        if word not in ("tr", "pl"):
            raise Refused(f"'{word}'")
        this = name()
        net.transition(this) if word == "tr" else net.place(this)
        arrow = False
        while position < len(tokens) and tokens[position] not in ("net", "lb", "nt", "tr", "pl", "pr"):
            token = tokens[position]
            if token == ":":
                position += 2
            elif token[0] in "[]":
                position += 1
            elif token[0] == "(":
                net.place(this, number(token[1:-1]))
                position += 1
            elif token == "->":
                arrow = True
                position += 1
            else:
                other = name()
                kind, weight = "*", 1
                if position < len(tokens) and tokens[position][0] in "*?!":
                    match = re.match(r"([*?!]-?)(.*)", tokens[position])
                    kind, weight = match[1], number(match[2])
                    position += 1
                place, transition = (other, this) if word == "tr" else (this, other)
                if arrow == (word == "tr"):
                    net.arc(net.puts, transition, place, weight)
                elif kind in ("*", "?", "?-"):
                    net.arc({"*": net.takes, "?": net.least, "?-": net.below}[kind], transition, place, weight)
                else:
                    raise Refused(f"arc {kind}")
    return net


def main():
    limit = int(sys.argv[1])
    for path in sys.argv[2:]:
        try:
            with open(path, "rb") as file:
                beginning = file.read(4000).lstrip()
            if path.endswith(".lola") or beginning.startswith(b"PLACE"):
                net = lola(path)
            else:
                net = tina(path) if path.endswith(".net") else pnml(path)
            answer = net.explore(limit)
        except (Refused, ElementTree.ParseError, ValueError, KeyError, IndexError) as wrong:
            answer = " ".join(f"refused {type(wrong).__name__} {wrong}".split())
        print(answer, flush=True)


main()
