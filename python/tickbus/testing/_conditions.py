"""Conditions that a test expects or waits for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING

from ._watch import Watch, number

if TYPE_CHECKING:
    from ._plc import Plc


class Bound(ABC):
    """A condition on the signals of one PLC."""

    subject: str
    expected: str
    watches: tuple[Watch, ...] = ()

    @abstractmethod
    def holds(self) -> bool: ...

    @abstractmethod
    def seen(self) -> str: ...

    def failure(self, span: str) -> str:
        """The failure as a sentence; ``span`` is the time in which the condition should have held."""
        return f"{self.subject} is {self.seen()}, expected {self.expected}" + (f" {span}" if span else "")


class Condition(ABC):
    """A condition on signals; ``and_``, ``or_`` and ``negated`` join them, and so do ``&``, ``|`` and ``~``."""

    @abstractmethod
    def bind(self, plc: Plc) -> Bound:
        """Finds the signals; ``UnknownSignalError`` with the nearest name if one does not exist."""

    def and_(self, other: Condition) -> Condition:
        """Both hold in the same tick."""
        return _Both(self, other, True)

    def or_(self, other: Condition) -> Condition:
        """At least one of them holds."""
        return _Both(self, other, False)

    def negated(self) -> Condition:
        """The opposite."""
        return _Negated(self)

    __and__ = and_
    __or__ = or_
    __invert__ = negated

    def __bool__(self) -> bool:
        raise TypeError("a condition is neither true nor false by itself; write plc.expect(condition), or condition.and_(other)")


def on(signal: str) -> Condition:
    """The signal is on."""
    return _Value(signal, "on", lambda value: value != 0)


def off(signal: str) -> Condition:
    """The signal is off."""
    return _Value(signal, "off", lambda value: value == 0)


def is_(signal: str, value: float) -> Condition:
    """The signal has exactly this value, in its unit."""
    return _Value(signal, number(value), lambda seen: seen == value)


def near(signal: str, value: float, tolerance: float) -> Condition:
    """The signal is not farther from this value than the tolerance."""
    if not tolerance >= 0:
        raise ValueError(f"a tolerance of {tolerance}; expected 0 or more")
    return _Value(signal, f"{number(value)} ± {number(tolerance)}", lambda seen: abs(seen - value) <= tolerance)


def above(signal: str, limit: float) -> Condition:
    """The signal is greater than the limit."""
    return _Value(signal, f"above {number(limit)}", lambda seen: seen > limit)


def below(signal: str, limit: float) -> Condition:
    """The signal is less than the limit."""
    return _Value(signal, f"below {number(limit)}", lambda seen: seen < limit)


def rises(signal: str) -> Condition:
    """The signal has gone from off to on, at least once since this condition was handed to the ``Plc``."""
    return _Edge(signal, rising=True)


def falls(signal: str) -> Condition:
    """The signal has gone from on to off, at least once since this condition was handed to the ``Plc``."""
    return _Edge(signal, rising=False)


def nothing_swallowed(*signals: str) -> Condition:
    """No change came and went before the other side took a frame, since the test began: of these signals, whose swallowed changes are
    counted (docs/timing.md), or of all that are counted.
    """
    return _Unswallowed(signals)


def when(what: str, holds: Callable[[], object]) -> Condition:
    """Any other condition, such as the state of the machine's model. A failure names it by ``what``."""
    return _When(what, holds)


class _Value(Condition):
    def __init__(self, signal: str, expected: str, test: Callable[[float], bool]) -> None:
        self._signal, self._expected, self._test = signal, expected, test

    def bind(self, plc: Plc) -> Bound:
        watch, test = plc._watch(self._signal), self._test

        class OfValue(Bound):
            def holds(self) -> bool:
                return test(watch.signal.value)

            def seen(self) -> str:
                return watch.text()

        bound = OfValue()
        bound.subject, bound.expected, bound.watches = watch.quoted(), self._expected, (watch,)
        return bound


class _Edge(Condition):
    def __init__(self, signal: str, *, rising: bool) -> None:
        self._signal, self._rising = signal, rising

    def bind(self, plc: Plc) -> Bound:
        watch, rising = plc._watch(self._signal), self._rising
        before = watch.rises if rising else watch.falls

        class OfEdge(Bound):
            def _count(self) -> int:
                return (watch.rises if rising else watch.falls) - before

            def holds(self) -> bool:
                return self._count() != 0

            def seen(self) -> str:
                return f"{watch.text()} after {self._count()}" if self._count() else f"{watch.text()} without one"

        bound = OfEdge()
        bound.subject, bound.watches = watch.quoted(), (watch,)
        bound.expected = "a rising edge" if rising else "a falling edge"
        return bound


class _Unswallowed(Condition):
    def __init__(self, signals: tuple[str, ...]) -> None:
        self._signals = signals

    def bind(self, plc: Plc) -> Bound:
        for signal in self._signals:
            plc._watch(signal)
        return _BoundUnswallowed(plc, self._signals)


class _BoundUnswallowed(Bound):
    subject, expected = "what was swallowed", "nothing swallowed"

    def __init__(self, plc: Plc, signals: tuple[str, ...]) -> None:
        self._plc, self._signals = plc, signals

    @property
    def watches(self) -> tuple[Watch, ...]:  # type: ignore[override]
        return tuple(self._plc._watch(signal) for signal in [*self._plc._swallowed_of(self._signals)][:1])

    def holds(self) -> bool:
        return not self._plc._has_swallowed(self._signals)

    def seen(self) -> str:
        return "\n  ".join(self._plc._swallowed_of(self._signals).values())

    def failure(self, span: str) -> str:
        return f"expected nothing swallowed: {self.seen()}"


class _When(Condition):
    def __init__(self, what: str, holds: Callable[[], object]) -> None:
        self._what, self._holds = what, holds

    def bind(self, plc: Plc) -> Bound:
        holds = self._holds

        class OfWhen(Bound):
            def holds(self) -> bool:
                return bool(holds())

            def seen(self) -> str:
                return "true" if self.holds() else "false"

        bound = OfWhen()
        bound.subject, bound.expected = f'"{self._what}"', "true"
        return bound


class _Negated(Condition):
    def __init__(self, condition: Condition) -> None:
        self._condition = condition

    def bind(self, plc: Plc) -> Bound:
        inner = self._condition.bind(plc)

        class OfNegated(Bound):
            def holds(self) -> bool:
                return not inner.holds()

            def seen(self) -> str:
                return inner.seen()

        bound = OfNegated()
        bound.subject, bound.expected, bound.watches = inner.subject, f"not {inner.expected}", inner.watches
        return bound


class _Both(Condition):
    def __init__(self, one: Condition, other: Condition, every: bool) -> None:
        self._one, self._other, self._every = one, other, every

    def bind(self, plc: Plc) -> Bound:
        return _BoundBoth(self._one.bind(plc), self._other.bind(plc), self._every)


class _BoundBoth(Bound):
    def __init__(self, one: Bound, other: Bound, every: bool) -> None:
        self._parts, self._every = (one, other), every
        self.watches = tuple(dict.fromkeys(one.watches + other.watches))

    def holds(self) -> bool:
        held = (part.holds() for part in self._parts)
        return all(held) if self._every else any(held)

    def _told(self, tell: Callable[[Bound], str]) -> str:
        # Of two conditions that must both hold, only those that fail are reported.
        everything = self.holds() or not self._every
        wrong = [part for part in self._parts if everything or not part.holds()]
        return (" and " if self._every else " or ").join(map(tell, wrong))

    @property
    def subject(self) -> str:  # type: ignore[override]
        return self._told(lambda part: part.subject)

    @property
    def expected(self) -> str:  # type: ignore[override]
        return self._told(lambda part: part.expected)

    def seen(self) -> str:
        return self._told(lambda part: part.seen())
