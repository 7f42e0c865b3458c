"""The recent history of a signal, for failure messages."""

from __future__ import annotations

import math
from collections import deque
from decimal import Decimal

from .. import _durations
from .._native import Signal

_KEPT = 8


def number(value: float) -> str:
    """A number for people: no exponent if it is short, no fraction if it is whole."""
    if isinstance(value, int):
        return str(int(value))
    plain = math.isfinite(value) and abs(value) < 1e15 and (value == 0 or abs(value) >= 1e-6)
    return f"{Decimal(repr(value)).normalize():f}" if plain else repr(value)


class Watch:
    """A signal, its edges since the test began, and its last changes."""

    def __init__(self, signal: Signal) -> None:
        self.signal = signal
        self.rises = 0
        self.falls = 0
        self._value = signal.value
        self._changes = 0
        self._last: deque[tuple[int, float, float]] = deque(maxlen=_KEPT)

    def look(self, tick: int) -> None:
        now = self.signal.value
        if now == self._value:
            return
        self._last.append((tick, self._value, now))
        self._changes += 1
        if self._value == 0:
            self.rises += 1
        elif now == 0:
            self.falls += 1
        self._value = now

    def text(self, value: float | None = None) -> str:
        """The current or given value, for people."""
        if value is None:
            value = self.signal.value
        if self.signal.type == "BOOL":
            return "on" if value else "off"
        return number(value) + (f" {self.signal.unit}" if self.signal.unit else "")

    def quoted(self) -> str:
        return f"'{self.signal.name}'"

    def history(self, step_ns: int) -> str:
        """The last changes, as one line."""
        head = f"last changes of {self.quoted()} ({self.signal.address}): "
        if not self._last:
            return f"{head}none, it is {self.text()} since the test began"
        text = head + ("… " if self._changes > _KEPT else "") + self.text(self._last[0][1])
        for tick, _before, after in self._last:
            text += f" → {self.text(after)} at tick {tick} ({_durations.text(tick * step_ns)})"
        return text
