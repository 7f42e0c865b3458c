"""Drives a PROFIBUS station with pyprofibus, which also reads the station's GSD file.

profibus_master.py DEVICE BAUD ADDRESS GSD MODULE [SECONDS]

The station has 4 bytes each way and copies the outputs to the inputs. The last line has the number of exchanges, and the
diagnoses that the station sent while data were exchanged, without repetitions. With SECONDS it only counts the exchanges in
that time, whatever comes back.
"""

import sys
import time

from profibus_station import note_diagnoses, open_master


def count(master, slave, seconds):
    exchanges, end = 0, None
    while end is None or time.monotonic() < end:
        slave.setMasterOutData(bytearray([1, 2, 3, 4]))
        master.run()
        exchanges += slave.getMasterInData() is not None
        if end is None and exchanges:
            end = time.monotonic() + seconds
    print(f"profibus_master: ok exchanges={exchanges}")


def main():
    diagnoses = note_diagnoses()
    master, slave = open_master(*sys.argv[1:6])
    if len(sys.argv) > 6:
        return count(master, slave, float(sys.argv[6]))
    exchanges = 0
    for number in range(1, 201):
        sent = bytearray([number, 255 - number, 0x10, number ^ 0x55])
        limit = time.monotonic() + 20
        while True:
            # pyprofibus sends them once.
            slave.setMasterOutData(sent)
            master.run()
            came = slave.getMasterInData()
            exchanges += came is not None
            if came == sent:
                break
            if time.monotonic() > limit:
                sys.exit(f"{came} came back of {sent}")
    master.destroy()
    print(f"profibus_master: ok exchanges={exchanges} diagnoses={','.join(diagnoses)}")


if __name__ == "__main__":
    main()
