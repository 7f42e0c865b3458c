"""Many drivers that tick in one call."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING

from . import _native, _toml
from ._driver import Driver, opened
from ._native import Signal

if TYPE_CHECKING:
    from typing import Self


def open_vector(
    path: str | os.PathLike[str],
    num_envs: int,
    overlay: _toml.Tables | Callable[[int], _toml.Tables | None] | None = None,
) -> "DriverVector":
    """Open a driver.cfg ``num_envs`` times: a machine with its PLC in each place of a vectorised environment.

    ``overlay`` is as for ``open``, or a function that returns it for each place, from 0::

        tickbus.open_vector("tank.cfg", 1024, {"fieldbus": {"kind": "loopback", "program": "mirror", "mode": "stepped"}})
        tickbus.open_vector("tank.cfg", 8, lambda place: {"fieldbus": {"kind": "modbus-tcp-server", "port": 5020 + place}})

    If one of the drivers cannot be opened, all are closed, and its exception is raised.
    """
    if not 1 <= num_envs <= _native.MAX_DRIVERS:
        raise ValueError(f"num_envs is {num_envs}; expected 1 to {_native.MAX_DRIVERS}")
    block = _native.Block(num_envs)
    with contextlib.ExitStack() as stack:
        drivers = [
            stack.enter_context(opened(path, overlay(place) if callable(overlay) else overlay, block, place))
            for place in range(num_envs)
        ]
        stack.pop_all()
    return DriverVector(drivers)


class DriverVector(_native.DriverVector):
    """Many drivers that tick in one call; ``tickbus.open_vector`` opens them.

    ``numpy.asarray(plcs.slots)`` has a row for each driver and a column for each signal::

        plcs = tickbus.open_vector("tank.cfg", 1024)
        values = numpy.asarray(plcs.slots)
        valve, level = plcs.signal("Valve").slot, plcs.signal("Level").slot
        while training:
            plcs.receive(time)
            mm += numpy.where(values[:, valve], 2, -1)
            values[:, level] = mm
            plcs.send()

    The drivers tick one after the other, without the interpreter's lock. A driver that fails stops no other one: each call
    returns how many have failed, and ``statuses`` has the status of each. Each driver remains usable alone. Drivers that wait
    for each other, as two clients of one run on virtual time do, need a thread each.
    """

    __slots__ = ("_drivers",)
    _drivers: tuple[Driver, ...]

    def __new__(cls, drivers: Iterable[Driver]) -> Self:
        """Joins open drivers, each at most once."""
        drivers = tuple(drivers)
        if not 1 <= len(drivers) <= _native.MAX_DRIVERS:
            raise ValueError(f"there are {len(drivers)} drivers; expected 1 to {_native.MAX_DRIVERS}")
        seen = set()
        for driver in drivers:
            if not isinstance(driver, Driver):
                raise TypeError(f"a DriverVector has drivers, not {type(driver).__name__}")
            if id(driver) in seen:
                raise ValueError(f"{driver!r} is in the list twice; expected each driver once")
            seen.add(id(driver))
        vector = super().__new__(cls, list(drivers))
        vector._drivers = drivers
        return vector

    @property
    def drivers(self) -> tuple[Driver, ...]:
        """The drivers, in the order of the places."""
        return self._drivers

    def signal(self, name: str) -> Signal:
        """The signal of the first driver by its name: its ``slot`` is the column of all drivers."""
        return self._drivers[0].signal(name)

    def __len__(self) -> int:
        return len(self._drivers)

    def __getitem__(self, place: int) -> Driver:
        return self._drivers[place]

    def __iter__(self) -> Iterator[Driver]:
        return iter(self._drivers)

    def close(self) -> None:
        """Closes all drivers; if one cannot be closed, the others are closed anyway, and its exception is raised."""
        with contextlib.ExitStack() as stack:
            for driver in self._drivers:
                stack.callback(driver.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<DriverVector of {len(self)}: {self._drivers[0]!r}{', ...' if len(self) > 1 else ''}>"
