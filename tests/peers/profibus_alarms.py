"""Reads the alarms of a PROFIBUS station and acknowledges them; pyprofibus exchanges data and reads the diagnoses.

profibus_alarms.py DEVICE BAUD ADDRESS GSD MODULE

The station copies its 4 bytes of outputs to the inputs, and raises two process alarms while the first one is above 100, and
a diagnosis alarm while it is above 200. Each line that is printed is a diagnosis, or an acknowledgement and its answer.
"""

import sys
import time

from profibus_station import LIMIT, Echo, note_diagnoses
from pyprofibus.dp import DpTelegram

HEAD = 12  # digits of the standard's part


class Alarms(Echo):
    def __init__(self, arguments):
        self.diagnoses = note_diagnoses()
        super().__init__(arguments)
        # DPV1, with alarms of processes and diagnoses, one of each type at a time.
        self.slave.setUserPrmData(bytearray([0x80, 0x60, 0x00]))
        self.seen = 0

    def alarm(self):
        """Exchanges data until the diagnosis has another alarm."""
        limit = time.monotonic() + LIMIT
        while True:
            self.exchange()
            while self.seen < len(self.diagnoses):
                told = self.diagnoses[self.seen]
                self.seen += 1
                if len(told) > HEAD:
                    print(f"{told[:2]} {told[HEAD:]}")
                    return
            if time.monotonic() > limit:
                sys.exit("no alarm")

    def none(self):
        for _ in range(20):
            self.exchange()
        if any(len(told) > HEAD for told in self.diagnoses[self.seen :]):
            sys.exit(f"an alarm that nobody awaits: {self.diagnoses}")

    def acknowledge(self, sap, request):
        self.ask(DpTelegram.SSAP_MS1, sap, request)


def main():
    station = Alarms(sys.argv[1:])
    server, alarms = DpTelegram.DSAP_SERVER, DpTelegram.DSAP_ALARM
    station.exchange()
    station.first = 150
    station.alarm()
    station.none()
    station.acknowledge(server, "5c010208")
    station.none()
    station.acknowledge(server, "5c010200")
    station.alarm()
    station.first = 250
    station.alarm()
    station.acknowledge(alarms, "5c020200")
    station.first = 1
    station.none()
    station.acknowledge(alarms, "5c030101")
    station.alarm()
    station.acknowledge(alarms, "5c030102")
    station.acknowledge(alarms, "5c030102")
    station.none()
    station.master.destroy()
    print("profibus_alarms: ok")


main()
