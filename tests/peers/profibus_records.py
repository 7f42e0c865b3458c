"""Reads and writes the records of a PROFIBUS station; pyprofibus exchanges data meanwhile, and builds the telegrams.

profibus_records.py DEVICE BAUD ADDRESS GSD MODULE...

The station copies its 4 bytes of outputs to the inputs. Each line that is printed is a request and its answer.
"""

import sys

from profibus_station import Echo
from pyprofibus.dp import DpTelegram


def main():
    station = Echo(sys.argv[1:])
    station.exchange()
    ms1, ms2 = DpTelegram.SSAP_MS1, DpTelegram.SSAP_MS2
    server, manager = DpTelegram.DSAP_SERVER, DpTelegram.DSAP_RESOURCE_MAN
    # The owner.
    for request in [
        "5e010af0",
        "5f010a021234",
        "5e010af0",
        "5e010bf0",
        "5e010cf0",
        "5e050af0",
        "5f010a0112",
        "5f000a020102",
        "5f00ff040800fde8",
        "5e00ff44",
        "5f012f0a25010201100803b10000",
        "5e012ff0",
        "5f012f1080020101100104610000080141426666",
        "5e012ff0",
    ]:
        station.ask(ms1, server, request)
    # Other masters, two of which have a connection.
    initiate = "57000000006401000000000000020002" + "00000000"
    first = bytes.fromhex(station.ask(ms2, manager, initiate))[1]
    print(station.send(ms2, first))
    second = bytes.fromhex(station.ask(ms2, manager, initiate, 3))[1]
    print(station.send(ms2, second, source=3))
    station.ask(ms2, manager, initiate, 4)
    station.ask(ms2, first, "5e010af0")
    station.ask(ms2, second, "5f010a025678", 3)
    station.ask(ms2, first, "48")
    station.ask(ms2, first, "5101010101")
    station.ask(ms2, first, "580020")
    station.ask(ms2, first, "5e010af0")
    station.exchange()
    station.master.destroy()
    print("profibus_records: ok")


main()
