"""The exceptions."""

from __future__ import annotations

from ._status import Status


class FieldbusError(Exception):
    """The driver refused or could not do something; the message says what happened and what to do."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(code, message)
        self.status = Status(code)
        self.message = message

    @property
    def code(self) -> int:
        """The status code, below zero."""
        return self.status.value

    def __str__(self) -> str:
        return self.message


class MissingFileError(FieldbusError, FileNotFoundError):
    """There is no driver.cfg with this name. Also a ``FileNotFoundError``."""


class UnknownSignalError(FieldbusError, KeyError):
    """No signal of the driver has this name; the message has the nearest one. Also a ``KeyError``."""
