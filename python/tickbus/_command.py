"""The ``tickbus`` command, which runs in the interpreter's process."""

import os
import signal
import sys

from ._native import command


def main() -> int:
    """Run the command with the arguments of the process, and return its exit code."""
    # The command decides what Ctrl-C does: the interpreter would only note it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    program = os.path.abspath(sys.argv[0])
    if os.name == "nt" and not program.endswith((".exe", ".py")):
        program += ".exe"
    if program.endswith(".py") or not os.access(program, os.X_OK):
        # python -m tickbus
        program = "tickbus"
    else:
        # For the processes in which plug-ins and FMUs run: the program of this process is the interpreter.
        os.environ.setdefault("TICKBUS_HELPER", program)
    return command([program, *sys.argv[1:]])
