"""Durations, as driver.cfg writes them, "2ms", and in whole nanoseconds."""

from __future__ import annotations

import re
from decimal import Decimal

_FORM = re.compile(r"(\d+(?:\.\d+)?)\s*(ns|us|ms|s|min|h)")
_UNITS = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9, "min": 60 * 10**9, "h": 3600 * 10**9}


def parse(text: str) -> int:
    """Nanoseconds, 0 or more; ``ValueError`` if the text is not a duration."""
    match = _FORM.fullmatch(text.strip())
    if match is None:
        raise ValueError(
            f'"{text}" is no duration; write a number and a unit, such as "10ms" (units: {", ".join(_UNITS)})'
        )
    nanos = Decimal(match[1]) * _UNITS[match[2]]
    if nanos >= 2**63:
        raise ValueError(f'"{text}" is longer than 292 years; write a shorter duration')
    return int(nanos)


def text(nanos: int) -> str:
    """The duration with a suitable unit: ``2ms``, ``1.5s``."""
    for unit in ("s", "ms", "us"):
        if nanos >= _UNITS[unit]:
            return f"{(Decimal(nanos) / _UNITS[unit]).normalize():f}{unit}"
    return f"{nanos}ns" if nanos else "0s"


class Unit:
    """The unit of ``within`` or ``during``: ``ticks``, or a unit of simulation time."""

    def __init__(self, name: str, nanos: int | None) -> None:
        self.name = name
        self.nanos = nanos
        """None for ticks."""

    def __repr__(self) -> str:
        return self.name


ticks = Unit("ticks", None)
ms = Unit("ms", _UNITS["ms"])
s = Unit("s", _UNITS["s"])
minutes = Unit("min", _UNITS["min"])
