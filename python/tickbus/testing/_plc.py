"""The PLC under test, from outside."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, Union

from .. import _durations
from .._driver import Driver, Fault
from .._durations import Unit
from .._native import Signal
from ._conditions import Bound, Condition
from ._sweep import Over, Run
from ._watch import Watch

if TYPE_CHECKING:
    from typing import TypeAlias

_PRESS = "200ms"
"""How long a button is pressed: about as long as a finger does, and longer than any scan."""

Duration: TypeAlias = Union[float, str]


class Machine(Protocol):
    """A model of the machine, as detailed as the tests need. Two methods are optional: ``connect(plc)`` is called once before the
    first tick. ``fault(name, value)`` is called when a fault of kind ``model`` begins, and with 0.0 when it ends; ``faults`` has
    the names of these faults."""

    def step(self, plc: Plc, time: float) -> object:
        """One tick: reads the PLC's commands, moves on, sets the sensors. ``time`` is the time at its end, in seconds."""


class Plc:
    """The PLC under test: set its inputs, read its outputs, let time pass.

    In each tick the machine takes a step with the PLC's commands, the PLC gets the sensors and all forced values, is scanned
    if a scan is due, and returns its outputs. Between two calls time stands still.
    """

    def __init__(self, driver: Driver, step: str = "1ms") -> None:
        self.step_ns = _durations.parse(step)
        """The simulation time of a tick."""
        if self.step_ns == 0:
            raise ValueError(f'step = "{step}": a tick takes more than no time; write such as "2ms"')
        self._driver = driver
        self._slots = driver.slots
        self._seen = self._slots.tobytes()
        self._watches = {signal.name: Watch(signal) for signal in driver.signals}
        self._machines: list[Callable[[Plc, float], object]] = []
        self._model_faults: dict[str, Callable[[str, float], object]] = {}
        self._forced: dict[str, float] = {}
        self._standing: list[tuple[Bound, int]] = []
        self._open: list[Await] = []
        self._swallowed: dict[str, int] = {}
        """The tick at which changes of a signal were swallowed first."""
        self._ticks = 0
        self._in_step = False
        self._run: Run | None = None
        """Sees every tick of a run of a sweep."""

    def connect(self, machine: Machine | Callable[[Plc, float], object]) -> Plc:
        """Connect another machine: an object with ``step(plc, time)``, or a function."""
        step = getattr(machine, "step", machine)
        if not callable(step):
            raise TypeError(f"{machine!r} is no machine: it has no method step(plc, time)")
        connect = getattr(machine, "connect", None)
        if connect is not None:
            connect(self)
        faults = getattr(machine, "faults", ())
        if isinstance(faults, str):
            raise TypeError(f"the faults of {machine!r} are a list of names, not one text")
        for name in faults:
            if name in self._model_faults:
                raise ValueError(f'two faults of the machines are called "{name}"; give each a name of its own')
            self._model_faults[name] = machine.fault  # type: ignore[union-attr]
        if self._model_faults:
            self._driver.declare_faults(self._model_faults)
        self._machines.append(step)
        return self

    # Signals

    def signal(self, name: str) -> Signal:
        """A signal's handle, which is faster than the name in a machine that uses the signal at every tick."""
        return self._watch(name).signal

    @property
    def signals(self) -> tuple[Signal, ...]:
        """All signals, in the order of driver.cfg."""
        return self._driver.signals

    def set(self, signal: str, value: float) -> Plc:
        """Set an input of the PLC (``%I``), to be sent with the next tick. A machine that also sets it overwrites it: see ``force``."""
        self.signal(signal).value = value
        return self

    def force(self, signal: str, value: float) -> Plc:
        """Force an input of the PLC to a value, whatever the machine sets, until ``release``."""
        self.set(signal, value)
        self._forced[signal] = value
        return self

    def release(self, signal: str) -> Plc:
        """End ``force``. The signal keeps its value until the machine or the test sets another."""
        self._watch(signal)
        self._forced.pop(signal, None)
        return self

    def press(self, button: str) -> Plc:
        """Press a push button: force the signal on, let 200 ms pass, and release it."""
        return self.force(button, True).run(_PRESS).release(button).set(button, False)

    def get(self, signal: str) -> float:
        """The value at the end of the last tick, in the signal's unit."""
        return self.signal(signal).value

    def is_on(self, signal: str) -> bool:
        """True if the signal is on."""
        return self.get(signal) != 0

    def rises(self, signal: str) -> int:
        """How often the signal has gone on since the test began, as seen from tick to tick."""
        return self._watch(signal).rises

    def falls(self, signal: str) -> int:
        """How often the signal has gone off since the test began, as seen from tick to tick."""
        return self._watch(signal).falls

    def statistics(self) -> dict[str, str]:
        """The counters of the driver and of the PLC's program."""
        return self._driver.statistics()

    # Faults

    def inject(self, fault: str = "", /, **keys: Any) -> Fault:
        """Inject a fault, as ``Driver.inject``: ``plc.inject(kind="stuck", signal="LA1 bottom", value=False)``."""
        return self._driver.inject(fault, **keys)

    def faults(self) -> list[Fault]:
        """The faults of driver.cfg and the injected ones."""
        return self._driver.faults()

    # Time

    def tick(self, count: int = 1) -> Plc:
        """Let some ticks pass."""
        if count < 0:
            raise ValueError(f"{count} ticks; time does not run backwards")
        for _ in range(count):
            self._step()
        return self

    def run(self, duration: Duration, unit: Unit | None = None) -> Plc:
        """Let simulation time pass: ``run("1.5s")``, ``run(1.5, s)``; rounded up to whole ticks."""
        return self.tick(-(-self._nanos(duration, unit) // self.step_ns))

    @property
    def ticks(self) -> int:
        """The number of ticks so far."""
        return self._ticks

    @property
    def time(self) -> float:
        """The simulation time so far, in seconds."""
        return self.time_ns / 1e9

    @property
    def time_ns(self) -> int:
        """The simulation time so far, in nanoseconds."""
        return self._ticks * self.step_ns

    def _step(self) -> None:
        if self._in_step:
            raise RuntimeError(
                "a machine must not let time pass in its own step; set signals there, and let the test tick"
            )
        self._in_step = True
        is_over = False
        try:
            nanos = self.time_ns + self.step_ns
            for step in self._machines:
                step(self, nanos / 1e9)
            for signal, value in self._forced.items():
                self._watches[signal].signal.value = value
            if self._run is None:
                self._driver.exchange(ns=nanos)
            else:
                is_over = self._run.exchange(nanos)
            if self._model_faults:
                for name, value in self._driver.model_faults():
                    self._model_faults[name](name, value)
        finally:
            self._in_step = False
        self._ticks += 1
        seen = self._slots.tobytes()
        if seen != self._seen:
            self._seen = seen
            for watch in self._watches.values():
                watch.look(self._ticks)
        if self._driver._swallowed():
            for signal in self._driver.swallowed():
                self._swallowed.setdefault(signal, self._ticks)
        for bound, since in self._standing:
            self._check(bound, f"at every tick since tick {since}")
        if is_over:
            raise Over

    # Expectations

    def expect(self, condition: Condition) -> Expectation:
        """Fail unless the condition holds now; ``.during("5s")`` watches it for a while."""
        bound = condition.bind(self)
        self._check(bound, "")
        return Expectation(self, bound)

    def always(self, condition: Condition) -> Plc:
        """Require the condition at the end of every tick from now on."""
        bound = condition.bind(self)
        self._check(bound, f"at every tick since tick {self._ticks}")
        if self._is_strict:
            self._standing.append((bound, self._ticks))
        return self

    def never(self, condition: Condition) -> Plc:
        """Forbid the condition at the end of every tick from now on."""
        return self.always(condition.negated())

    def await_(self, condition: Condition) -> Await:
        """Wait for a condition: ``plc.await_(on("Ready lamp")).within("25s")``. Without a limit the test fails."""
        waiting = Await(self, condition.bind(self))
        self._open.append(waiting)
        return waiting

    # For the plug-in

    def _watch(self, name: str) -> Watch:
        watch = self._watches.get(name)
        # For an unknown name, the driver's error has the nearest one.
        return watch if watch is not None else self._watches[self._driver.signal(name).name]

    def _where(self, tick: int | None = None) -> str:
        tick = self._ticks if tick is None else tick
        return f"tick {tick} ({_durations.text(tick * self.step_ns)})"

    def _has_swallowed(self, signals: tuple[str, ...]) -> bool:
        return any(signal in self._swallowed for signal in signals or self._swallowed)

    def _swallowed_of(self, signals: tuple[str, ...]) -> dict[str, str]:
        """The signals whose changes were swallowed, of these or of all if there are none, and what to do about each."""
        found = self._driver.swallowed().items()
        first = self._swallowed
        return {
            signal: f"{told}; the first at {self._where(first.get(signal))}"
            for signal, told in found
            if not signals or signal in signals
        }

    def _span(self, count: int) -> str:
        return f"{count} {'tick' if count == 1 else 'ticks'} ({_durations.text(count * self.step_ns)})"

    def _nanos(self, amount: Duration, unit: Unit | None) -> int:
        if isinstance(amount, str):
            if unit is not None:
                raise TypeError(f'"{amount}" has its unit already')
            return _durations.parse(amount)
        if unit is None:
            raise TypeError(f'{amount} of what? Write a duration, such as "1.5s", or name the unit: {amount}, s')
        nanos = round(amount * (self.step_ns if unit.nanos is None else unit.nanos))
        if nanos < 0:
            raise ValueError(f"{amount} {unit}; time does not run backwards")
        return nanos

    @property
    def _is_strict(self) -> bool:
        """True if expectations count and waits have their limits; under the fault of a sweep they do not."""
        return self._run is None or self._run.is_strict

    def _idle(self) -> None:
        """The scenario of a sweep is done: ticks on until the run is over."""
        assert self._run is not None
        self._standing.clear()
        is_over = self._run.idle()
        while not is_over:
            self.tick()

    def _check(self, bound: Bound, span: str) -> None:
        if self._is_strict and not bound.holds():
            raise self._failure(bound, span)

    def _failure(self, bound: Bound, span: str) -> AssertionError:
        text = f"{self._where()}: {bound.failure(span)}"
        return AssertionError("\n  ".join([text, *(watch.history(self.step_ns) for watch in bound.watches)]))

    def _unfinished(self) -> AssertionError | None:
        """The failure of a test that waited without a limit."""
        return self._open[0]._unlimited() if self._open else None


class Await:
    """A wait that needs its limit: ``plc.await_(on("Running lamp")).within(40)``."""

    def __init__(self, plc: Plc, bound: Bound) -> None:
        self._plc, self._bound = plc, bound

    def within(self, limit: Duration, unit: Unit | None = None) -> int:
        """Let ticks pass until the condition holds, none if it already does; returns the number of ticks.

        The limit is a number of ticks, ``within(40)`` or ``within(40, ticks)``, or simulation time, ``within("3s")`` or ``within(3, s)``.
        """
        plc = self._plc
        plc._open.remove(self)
        if isinstance(limit, str) or unit is not None and unit.nanos is not None:
            most = plc._nanos(limit, unit) // plc.step_ns
            if most < 1:
                text = limit if isinstance(limit, str) else f"{limit} {unit}"
                raise ValueError(
                    f"a limit of {text} is shorter than one tick of {_durations.text(plc.step_ns)}; give it more time,"
                    " or use expect(…)"
                )
        else:
            most = int(limit)
            if most < 1 or most != limit:
                raise ValueError(f"a limit of {limit} ticks; give it a whole number, at least 1, or use expect(…)")
        begin = plc.ticks
        while not self._bound.holds():
            if plc._is_strict and plc.ticks - begin == most:
                raise plc._failure(self._bound, f"within {plc._span(most)} of tick {begin}")
            plc.tick()
        return plc.ticks - begin

    def _unlimited(self) -> AssertionError:
        what = f"{self._bound.subject} {self._bound.expected}"
        return AssertionError(f"await_({what}) was given no limit, so that it never waited; add .within(…)")


class Expectation:
    """A condition that holds now, and can be required to keep holding: ``plc.expect(off("Not OK")).during("5s")``."""

    def __init__(self, plc: Plc, bound: Bound) -> None:
        self._plc, self._bound = plc, bound

    def during(self, span: Duration, unit: Unit | None = None) -> Plc:
        """Let ticks or simulation time pass, and fail at the end of the first tick in which the condition does not hold."""
        plc = self._plc
        if not isinstance(span, str) and (unit is None or unit.nanos is None):
            count = int(span)
            if count < 0 or count != span:
                raise ValueError(f"a span of {span} ticks; give it a whole number, at least 0, or a duration such as \"1.5s\"")
        else:
            count = -(-plc._nanos(span, unit) // plc.step_ns)
        begin = plc.ticks
        for _ in range(count):
            plc.tick()
            plc._check(self._bound, f"for {plc._span(count)} from tick {begin}")
        return plc
