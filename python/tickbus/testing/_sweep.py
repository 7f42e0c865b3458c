"""Sweeps of faults: a scenario, run again with each fault at each moment."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from .. import _toml
from .._driver import Driver
from .._native import Sweep

Scenario = TypeVar("Scenario", bound=Callable[..., Any])


def sweep(keys: str = "", /, **more: Any) -> Callable[[Scenario], Scenario]:
    """Make a sweep of a test function, which is the scenario of a normal run and takes ``plc``, or ``plc`` and ``machine``::

        @sweep(moments="Step", told="Fault lamp", within="12s", never={"too low": ["Step == 3", "LA1 position < 170"]})
        def test_one_cycle(plc):
            plc.await_(on("Ready lamp")).within("25s")
            plc.press("Start button")
            plc.await_(is_("Cycles", 1)).within("20s")

    The keys are those of ``[sweep]`` in a test file but for ``scenario``, also as a text. Each fault at each moment is a test,
    such as ``test_one_cycle[LA1 bottom stuck-on @ Step 3]``. Under a fault the function's expectations do not count, and its
    waits have no limit.
    """
    import pytest

    return pytest.mark.tickbus_sweep(keys + _toml.section(more))


class Over(BaseException):
    """The run is judged: ends the scenario, wherever it is."""


class Sweeping:
    """The sweep of one test function."""

    def __init__(self, name: str, node: str, folder: Path, keys: str, *, rewriting: bool) -> None:
        self.name, self.node = name, node
        self.rewriting = rewriting
        self.names: list[str] = []
        self.reports: dict[int, PathLike[str]] = {}
        """The pages about the recordings of the runs that have failed."""
        self.has_failed = False
        self._folder, self._keys = folder, keys
        self.native: Sweep | None = None

    def begin(self, driver: Driver, step_ns: int, cell: int | None) -> Run:
        """A run on a driver that has just been opened: that of a cell, or that without a fault."""
        if self.native is None:
            self.native = Sweep(driver, self.name, self._folder, self._keys, step_ns)
        self.native.begin(driver, cell)
        return Run(self.native, driver, is_strict=cell is None)

    def plan(self) -> None:
        """The run without a fault is over: lists the others."""
        assert self.native is not None
        self.names = self.native.plan(self.rewriting)

    def chosen(self, only: str) -> list[int]:
        """The runs that are made: the one with exactly this name, or all whose names contain it."""
        chosen = [number for number, name in enumerate(self.names) if only in name]
        if not chosen:
            raise ValueError(f'no run of the sweep {self.name} has "{only}" in its name; the first one is "{self.names[0]}"')
        return [self.names.index(only)] if only in self.names else chosen

    def judge(self, cell: int) -> None:
        """Fails unless the verdict of a run is right or accepted."""
        assert self.native is not None
        result = self.native.result(cell)
        if result is None:
            raise RuntimeError("the run ended before it was judged")
        passes, what = result
        if not passes and not self.rewriting:
            self.has_failed = True
            raise AssertionError(what)


class Run:
    """What a ``Plc`` asks at every tick of a run."""

    def __init__(self, native: Sweep, driver: Driver, *, is_strict: bool) -> None:
        self._native, self._driver = native, driver
        self.is_strict = is_strict
        """True if the expectations of the scenario count."""

    def exchange(self, ns: int) -> bool:
        return self._native.exchange(self._driver, ns)

    def idle(self) -> bool:
        return self._native.idle(self._driver)
