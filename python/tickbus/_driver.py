"""An open driver."""

from __future__ import annotations

import atexit
import contextlib
import itertools
import os
import re
import signal
import threading
import time
import warnings
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from . import _durations, _native, _toml
from ._errors import FieldbusError, MissingFileError
from ._status import Status

if TYPE_CHECKING:
    from typing import Self

_ENTRY = re.compile(r"((?:[^=\\]|\\.)+)=(.*)")


def open(path: str | os.PathLike[str], overlay: _toml.Tables | None = None) -> "Driver":
    """Open the driver that a driver.cfg describes, and start its fieldbus.

    Returns at once, whether or not the PLC is there: until it is, ticks return ``Status.STALE``.

    ``overlay`` replaces tables of the file, for example to put the plant's own signals on another bus::

        tickbus.open("plant.cfg", {"fieldbus": {"kind": "loopback", "program": "mirror", "mode": "stepped"},
                                   "record": {"file": "run.vcd"}})

    The overlay is a mapping of such tables, or the same as a text in TOML. Raises ``FieldbusError`` with
    ``Status.BAD_CONFIG`` and every mistake at its line and column, or with the reason why the bus cannot be opened;
    ``MissingFileError`` if there is no such file.
    """
    return opened(path, overlay)


def opened(
    path: str | os.PathLike[str], overlay: _toml.Tables | None, block: _native.Block | None = None, row: int = 0
) -> "Driver":
    """Opens a driver, with its values in a row of ``block`` if there is one."""
    try:
        return Driver(os.fspath(path), _toml.document(overlay) if overlay is not None else "", block, row)
    except FieldbusError as error:
        if error.status is Status.BAD_CONFIG and not Path(path).exists():
            raise MissingFileError(error.code, error.message) from None
        raise


class Turn(NamedTuple):
    """One turn of a loop over ``Driver.every``."""

    time: float
    """When the turn was due, in seconds since the loop began: the simulation's time, if it keeps pace with the clock."""
    lag: float
    """How late the turn begins, in seconds."""
    missed: int
    """How many turns before this one were skipped, since they could not begin before the next one was due."""


def _turns(period: int, now: Callable[[], int], sleep: Callable[[float], None]) -> Iterator[Turn]:
    begin, number = now(), 0
    while True:
        wait = begin + number * period - now()
        if wait > 0:
            sleep(wait / 10**9)
            continue
        missed = -wait // period
        number += missed
        lag = -wait - missed * period
        yield Turn(number * period / 10**9, lag / 10**9, missed)
        number += 1


class Driver(_native.Driver):
    """One open driver: a simulation's end of a PLC's fieldbus. ``tickbus.open`` makes it.

    A tick is either ``receive()``, the model, ``send()``, or one ``exchange()``. The first way answers within the tick;
    ``exchange()`` sends first and then receives, so that an answer goes out with the next tick. Neither waits for the bus,
    except on a stepped one; while it waits there, the interpreter's lock is released.

    One thread at a time uses a driver. A call that meets a tick of another thread waits for it, at most 2 s; then it raises
    ``FieldbusError`` with ``Status.BUSY``.
    """

    __slots__ = ("__weakref__", "_fault_names")

    def __init__(self, path: str, overlay: str = "", block: _native.Block | None = None, row: int = 0) -> None:
        self._fault_names: list[str] = []
        _open.add(self)
        _close_when_terminated()

    def every(self, period: str) -> Iterator[Turn]:
        """Pace a loop by the computer's clock: one turn per period, such as ``"10ms"``, until the driver is closed or the
        run is over::

            for turn in plc.every("10ms"):
                plc.receive(turn.time)
                ...
                plc.send()

        A late turn does not delay the next one. Missed turns, as on a busy computer, are skipped: a burst would only carry
        outdated values. ``turn.lag`` and ``turn.missed`` report both.
        """
        nanos = _durations.parse(period)
        if nanos == 0:
            raise ValueError(f'"{period}" is no period; write a duration above 0, such as "10ms"')
        turns = _turns(nanos, time.monotonic_ns, time.sleep)
        return itertools.takewhile(lambda turn: not (self.closed or self.is_over), turns)

    def statistics(self) -> dict[str, str]:
        """The state of the line and all counters, by key: docs/statistics.md explains them."""
        entries = filter(None, map(_ENTRY.fullmatch, self._statistics().splitlines()))
        return {re.sub(r"\\(.)", r"\1", entry[1]): entry[2] for entry in entries}

    def swallowed(self) -> dict[str, str]:
        """The signals whose changes came and went before the other side took a frame (docs/timing.md): by the signal's name, how
        often, between which steps, and what to do.
        """
        lines = (line.split("\t", 1) for line in self._swallowed().splitlines())
        return {self.signals[int(signal)].name: told for signal, told in lines}

    def inject(self, fault: str = "", /, **keys: Any) -> "Fault":
        """Inject a fault, such as a stuck signal or a broken line. It can begin with the next tick.

        The keys are those of a ``[[fault]]`` section of driver.cfg, and durations are texts::

            plc.inject(kind="stuck", signal="LA1 bottom", value=True, at="2s")
            plc.inject(kind="link-down", for_="500ms")

        For a key that is a Python keyword, append an underscore: ``for_``, ``while_``. A text in TOML is also accepted.
        """
        keys = {name.removesuffix("_"): value for name, value in keys.items()}
        if not isinstance(fault, str):
            raise TypeError(f"a fault is a text in TOML, or keys such as kind='stuck', not {type(fault).__name__}")
        number = self._inject(fault + "\n" + _toml.section(keys))
        return next(fault for fault in self.faults() if fault.id == number)

    def declare_faults(self, names: Iterable[str]) -> None:
        """Name the faults that the simulation's model can have, before the first tick: those that a fault of kind
        ``model`` can name. Raises ``FieldbusError`` with the nearest name if a fault in driver.cfg has another one."""
        if isinstance(names, str):
            raise TypeError("the faults of a model are a list of names, not one text")
        declared = list(names)
        self._declare_faults(declared)
        self._fault_names = declared

    def model_faults(self) -> list[tuple[str, float]]:
        """The faults of the model that have begun or ended since the last call, as (name, value); 0.0 is off::

            plc.declare_faults(["leak"])
            ...
            plc.receive(time)
            for name, value in plc.model_faults():
                tank.leak = value
        """
        return [(self._fault_names[at], value) for at, value in self._model_faults()]

    def faults(self) -> list["Fault"]:
        """The faults in driver.cfg and the injected ones; some that ended long ago may be missing."""
        return [Fault(self, *line.split("\t")) for line in self._faults().split("\n") if line]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if not self.closed:
            warnings.warn(f"unclosed driver {self!r}", ResourceWarning, stacklevel=2, source=self)
            self.close()


class Fault:
    """An injected fault, made by ``Driver.inject``. In a ``with`` statement it ends with the block."""

    def __init__(self, driver: Driver, id: str, state: str, begun: str, kind: str, name: str, what: str) -> None:
        self._driver = driver
        self.id = int(id)
        """The fault's number, from 1."""
        self.kind = kind
        """The fault's kind, such as ``link-down``."""
        self.name = name
        """The fault's given name, or one derived from its effect."""
        self.what = what
        """The fault's effect, for people."""
        self._last = (state, begun)

    def _now(self) -> tuple[str, str]:
        for line in filter(None, self._driver._faults().split("\n")):
            number, state, begun, *_ = line.split("\t")
            if int(number) == self.id:
                self._last = (state, begun)
                return self._last
        # The fault ended so long ago that the driver has forgotten it.
        self._last = ("over", self._last[1])
        return self._last

    @property
    def state(self) -> Literal["waiting", "active", "over"]:
        """``waiting``: not begun, or can begin again; ``active``; ``over``: for good. As of the last tick."""
        return self._now()[0]  # type: ignore[return-value]

    @property
    def is_active(self) -> bool:
        """True if the fault has its effect, as of the last tick."""
        return self.state == "active"

    @property
    def begun(self) -> int:
        """How often the fault has begun."""
        return int(self._now()[1])

    def end(self) -> None:
        """End the fault at the next tick, which has the true values again."""
        self._driver._end_fault(self.id)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._driver.closed:
            self.end()

    def __repr__(self) -> str:
        return f"<Fault {self.id} '{self.name}' ({self.kind}): {self.what}>"


def report(
    recording: str | os.PathLike[str],
    title: str = "",
    statistics: Mapping[str, str] | None = None,
    texts: Mapping[str, str] | None = None,
) -> Path:
    """Make an HTML page from a recording: a chart of all signals, faults, states of the line.

    ``recording`` is the VCD or CSV file that a ``[record]`` table named; its driver must be closed. The page is written
    beside it; returns its path. ``statistics`` are those of the driver, ``texts`` are shown under their headings. Raises
    ``FieldbusError`` with ``Status.BAD_ARGUMENT`` if the recording cannot be read.
    """
    escaped = ((re.sub(r"([=\\])", r"\\\1", key), value) for key, value in (statistics or {}).items())
    lines = "".join(f"{key}={value}\n" for key, value in escaped)
    return Path(_native.report(Path(recording), title or Path(recording).stem, lines, list((texts or {}).items())))


_open: weakref.WeakSet[Driver] = weakref.WeakSet()

# The signals that end a process by default; Windows has none.
_TERMINATIONS = (signal.SIGTERM, signal.SIGHUP) if os.name == "posix" else ()


@atexit.register
def _close_all() -> None:
    """Closes all open drivers, so that their recordings are complete."""
    for driver in list(_open):
        try:
            driver.close()
        except FieldbusError as error:
            # Another thread is in a tick, and the process ends.
            if error.status is not Status.BUSY:
                raise


def _terminated(number: int, _frame: FrameType | None) -> None:
    """Closes all open drivers, and then ends the process as an unhandled signal would."""
    signal.signal(number, signal.SIG_DFL)
    try:
        _close_all()
    finally:
        os.kill(os.getpid(), number)


def _close_when_terminated() -> None:
    """Closes the drivers on a termination signal that the program does not handle, before the signal ends the process."""
    for number in _TERMINATIONS:
        if signal.getsignal(number) is signal.SIG_DFL:
            # Only the main thread can set handlers; a program that opens its drivers elsewhere handles signals itself.
            with contextlib.suppress(ValueError):
                signal.signal(number, _terminated)


# The signal masks of the threads that are in a fork.
_forking = threading.local()


def _before_fork() -> None:
    """Holds termination signals back: the interpreter of a child forgets those that arrive before it has set itself up."""
    _forking.mask = signal.pthread_sigmask(signal.SIG_BLOCK, _TERMINATIONS)


def _after_fork() -> None:
    """Lets termination signals through again."""
    signal.pthread_sigmask(signal.SIG_SETMASK, _forking.mask)


def _after_fork_in_child() -> None:
    """Leaves the parent's drivers to the parent, and has termination signals end the child at once, as before ``open``."""
    _native.forked()
    for number in _TERMINATIONS:
        if signal.getsignal(number) is _terminated:
            signal.signal(number, signal.SIG_DFL)
    _after_fork()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_fork, after_in_parent=_after_fork, after_in_child=_after_fork_in_child)
