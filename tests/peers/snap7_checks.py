"""Checks of what a server answered to a client of Snap7: a wrong answer ends the program with a message."""

import sys

try:
    from snap7.error import S7ProtocolError
except ImportError:
    # Snap7 in C has no error of its own.
    S7ProtocolError = RuntimeError


def equal(what, got, expected):
    if got != expected:
        sys.exit(f"{what}: {got!r} instead of {expected!r}")


def refused(what, call, words):
    try:
        call()
    except (RuntimeError, S7ProtocolError) as error:
        if words not in str(error):
            sys.exit(f"{what}: refused by {error!r}, not for {words!r}")
        return
    sys.exit(f"{what} was not refused")
