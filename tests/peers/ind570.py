"""Reads a weighing terminal METTLER TOLEDO IND570 as a program in a PLC does, with pyprofibus as the master.

ind570.py DEVICE BAUD ADDRESS GSD MODULE

The decoding is that of the manual (IND570 PLC Interface Manual, 30205335, tables B-1 to B-4): one message slot in floating
point format. The last line has the weight.
"""

import struct
import sys
import time

from profibus_station import open_master

PATIENCE = 20
GROSS, NET, TARE, TAKE_TARE, CLEAR_TARE = 10, 11, 12, 61, 62


class Terminal:
    def __init__(self, arguments):
        self.master, self.slave = open_master(*arguments, size=8)

    def exchange(self, command, value=0.0):
        """The indicator, the acknowledgement, the weight and net mode; None if the data are not valid."""
        self.slave.setMasterOutData(bytearray(struct.pack(">HHf", 0, command, value)))
        self.master.run()
        octets = self.slave.getMasterInData()
        if octets is None:
            return None
        response, weight, status = struct.unpack(">HfH", bytes(octets))
        is_whole = bool(response & 1 << 13) == bool(status & 1 << 14)
        if not status & 1 << 15 or not is_whole:
            return None
        return response >> 8 & 0x1F, response >> 14, round(weight, 3), bool(status & 1 << 13)

    def until(self, what, command, done):
        limit = time.monotonic() + PATIENCE
        while True:
            seen = self.exchange(command)
            if seen is not None and done(*seen):
                return seen
            if time.monotonic() > limit:
                sys.exit(f"in vain until {what}: {seen}")

    def command(self, command, indicator=None):
        """A command, acknowledged, and none afterwards, as the manual has it."""
        seen = self.until(
            f"command {command} is acknowledged",
            command,
            lambda told, ack, _weight, _net: ack and indicator in (None, told),
        )
        self.until("nothing is acknowledged", 0, lambda _told, ack, _weight, _net: not ack)
        return seen


def main():
    terminal = Terminal(sys.argv[1:6])
    weight = terminal.command(GROSS, 0)[2]
    assert weight == 51.67, weight
    terminal.command(TAKE_TARE)
    assert terminal.command(NET, 1)[3], "a tare makes it net"
    terminal.command(TARE, 2)
    terminal.command(CLEAR_TARE)
    assert not terminal.command(GROSS, 0)[3]
    terminal.master.destroy()
    print(f"ind570: ok weight={weight}")


main()
