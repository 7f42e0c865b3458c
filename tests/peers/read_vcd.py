"""Reads a recording with third-party readers: VCD with the packages vcdvcd and pyvcd, CSV with Python's own module.

usage: read_vcd.py RUN.vcd RUN.csv

Both are recordings of the same run, so that every value of every tick must be the same in both.
"""

import csv
import re
import struct
import sys

from vcd.reader import tokenize
from vcdvcd import VCDVCD


def legal(name):
    """A name as VCD allows it; see docs/recording.md."""
    name = re.sub(r"[^A-Za-z0-9]", "_", name)
    return name if re.match(r"[A-Za-z_]", name) else "_" + name


def number(text, kind, size):
    """The value of a variable as a number."""
    if kind == "real":
        return float(text)
    if text == "x":
        return float("nan")
    value = int(text, 2)
    if kind == "integer" and value >> (int(size) - 1) and len(text) == int(size):
        value -= 1 << int(size)
    return value


def same(one, two):
    """True if two numbers are the same to the last bit."""
    if isinstance(one, int):
        return one == int(two)
    return struct.pack("d", one) == struct.pack("d", float(two)) or (one != one and two.lower() == "nan")


def strict(path):
    """Reads with pyvcd, which follows the standard strictly; returns the number of value changes."""
    with open(path, "rb") as file:
        return sum(token.kind.name.startswith("CHANGE_") for token in tokenize(file))


def main(vcd_path, csv_path):
    assert strict(vcd_path) > 0
    vcd = VCDVCD(vcd_path)
    assert int(vcd.timescale["magnitude"]) == 1 and vcd.timescale["unit"] == "ns", vcd.timescale
    variables = {}
    for reference in vcd.signals:
        name = reference.split(".")[-1].split("[")[0]
        assert name not in variables, f"{name} is there twice"
        variables[name] = vcd[reference]
    with open(csv_path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    columns = [name for name in rows[0] if name != "bus.time_ns"]
    compared = 0
    for column in columns:
        short = {"bus.tick": "tick", "bus.status": "status", "bus.dropped": "dropped"}.get(column, column)
        variable = variables.pop(legal(short))
        for row in rows:
            value = number(variable[int(row["bus.time_ns"])], variable.var_type, variable.size)
            assert same(value, row[column]), f"tick {row['bus.tick']}: {column} is {value} in VCD, {row[column]} in CSV"
            compared += 1
    assert not variables, f"only in VCD: {sorted(variables)}"
    print(f"read_vcd: ok ticks={len(rows)} variables={len(columns)} values={compared}")


if __name__ == "__main__":
    main(*sys.argv[1:])
