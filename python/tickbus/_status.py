"""The status codes: those of every binding of tickbus."""

from __future__ import annotations

from enum import IntEnum

from . import _native

_TABLE = {code: (text, remedy) for code, _name, text, remedy in _native.STATUS_TABLE}


class Status(IntEnum):
    """The result of a tick, or the reason of a ``FieldbusError``. Below zero: the call failed."""

    FRESH = 0
    """A new bus cycle has arrived since the last exchange, even if nothing changed in it."""
    UNCHANGED = 1
    """The link lives, but no new bus cycle has arrived since the last exchange."""
    STALE = 2
    """The PLC has been silent for longer than ``max_age``; the fail-safe values are delivered."""
    NOT_OPEN = -1
    """No driver was opened here, or it was opened by the process that forked this one."""
    BUSY = -2
    """Another thread is using the driver at this moment."""
    CLOSED = -3
    """The driver was closed."""
    BAD_CONFIG = -4
    """driver.cfg has mistakes; the message lists them all."""
    BUS_FAILED = -5
    """The fieldbus could not be opened, or failed for good."""
    UNSUPPORTED = -6
    """This build or platform cannot do what driver.cfg asks for."""
    TOO_MANY_DRIVERS = -7
    """All places for drivers in this process are taken."""
    INTERNAL = -8
    """The driver has a defect, and stays in this state until closed."""
    LIBRARY = -9
    """The native library cannot be loaded. (In Python an ``ImportError`` reports this.)"""
    BAD_ARGUMENT = -10
    """An argument is invalid."""

    @property
    def text(self) -> str:
        """The meaning, as one clause."""
        return _TABLE[self.value][0]

    @property
    def remedy(self) -> str:
        """The remedy, as one clause."""
        return _TABLE[self.value][1]
