"""Runs a drive on PROFIdrive's telegram 1, as a program in a PLC does; pyprofibus exchanges the words.

profibus_drive.py DEVICE BAUD ADDRESS GSD MODULE

The drive's motor is too hot while 25 % of its speed is wanted. Each line that is printed is what the drive did.
"""

import struct
import sys
import time

from profibus_station import LIMIT, Station
from pyprofibus.dp import DpTelegram

WHOLE, HALF, QUARTER = 0x4000, 0x2000, 0x1000


class Drive(Station):
    words = (0, 0)

    def exchange(self):
        """Exchanges the words once; returns ZSW1 and NIST_A."""
        limit = time.monotonic() + LIMIT
        while True:
            self.slave.setMasterOutData(bytearray(struct.pack(">Hh", *self.words)))
            self.master.run()
            octets = self.slave.getMasterInData()
            if octets is not None:
                return struct.unpack(">Hh", bytes(octets))
            if time.monotonic() > limit:
                sys.exit("no data come back")

    def write(self, stw1, setpoint, mask, zsw1, speed=None):
        """Writes the words until ZSW1 has these bits, and the drive its speed; returns how long that takes."""
        self.words = (stw1, setpoint)
        begin = time.monotonic()
        while True:
            status, actual = self.exchange()
            if status & mask == zsw1 and speed in (None, actual):
                print(f"{stw1:04x} {setpoint}: {status:04x} {actual}")
                return time.monotonic() - begin
            if time.monotonic() - begin > LIMIT:
                sys.exit(f"{stw1:04x}: expected {zsw1:04x} of {mask:04x} and {speed}, but {status:04x} and {actual}")


def within(what, seconds, least, most):
    if not least <= seconds <= most:
        sys.exit(f"{what} took {seconds:.2f} s, expected {least} to {most}")


def main():
    drive = Drive(sys.argv[1:])
    drive.write(0x047F, HALF, 0x027F, 0x0270)  # ON from the beginning is no way out of S1
    drive.write(0x047E, HALF, 0x027F, 0x0231)
    drive.write(0x047F, HALF, 0x027F, 0x0237)
    within("the ramp up", drive.write(0x047F, HALF, 0x0107, 0x0107, HALF), 0.1, LIMIT)
    within("the next ramp", drive.write(0x047F, WHOLE, 0x0507, 0x0507, WHOLE), 0.45, LIMIT)
    within("OFF1", drive.write(0x047E, WHOLE, 0x007F, 0x0031, 0), 2.85, LIMIT)
    drive.write(0x047F, -HALF, 0x0107, 0x0107, -HALF)
    # A fault, which is acknowledged by an edge once its cause is gone.
    drive.write(0x047F, QUARTER, 0x004F, 0x0048)
    drive.write(0x04FE, QUARTER, 0x004F, 0x0048)
    drive.write(0x047E, 0, 0x00CF, 0x0048)  # no warning: a tick of the machine has seen these words
    drive.write(0x04FE, 0, 0x004F, 0x0001)
    drive.write(0x047E, WHOLE, 0x004F, 0x0001)
    drive.write(0x047F, WHOLE, 0x0107, 0x0107, WHOLE)
    # A quick stop, then switching on inhibited.
    within("OFF3", drive.write(0x047B, WHOLE, 0x007F, 0x0050, 0), 0.15, 2.5)
    drive.write(0x047F, WHOLE, 0x007F, 0x0070)
    ms1, server = DpTelegram.SSAP_MS1, DpTelegram.DSAP_SERVER
    addresses = ["100007d00000", "100004600000", "100208020000", "100208050000"]
    drive.ask(ms1, server, "5f002f1c" "01010104" + "".join(addresses))
    drive.ask(ms1, server, "5e002ff0")
    drive.master.destroy()
    print("profibus_drive: ok")


main()
