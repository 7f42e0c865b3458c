"""Drives a PROFIBUS station with pyprofibus, which also reads the station's GSD file.

profibus_master.py DEVICE BAUD ADDRESS GSD MODULE [SECONDS]

The station has 4 bytes each way and copies the outputs to the inputs. The last line has the number of exchanges, and the
diagnoses that the station sent while data were exchanged, without repetitions. With SECONDS it only counts the exchanges in
that time, whatever comes back.
"""

import os
import sys
import tempfile
import time

import pyprofibus
from pyprofibus.dp import DpTelegram_SlaveDiag_Con

CONF = """
[PROFIBUS]
debug=0
[PHY]
type=serial
dev={device}
baud={baud}
[DP]
master_class=1
master_addr=2
[SLAVE_0]
name=station
addr={address}
gsd={gsd}
sync_mode=0
freeze_mode=0
group_mask=1
watchdog_ms=5000
module_0={module}
output_size={size}
input_size={size}
diag_period=0
"""


def open_master(arguments, size=4):
    device, baud, address, gsd, module = arguments
    with tempfile.NamedTemporaryFile("w", suffix=".conf", delete=False) as file:
        file.write(CONF.format(device=device, baud=baud, address=address, gsd=gsd, module=module, size=size))
    try:
        conf = pyprofibus.PbConf.fromFile(file.name)
    finally:
        os.unlink(file.name)
    master = conf.makeDPM()
    slaves = []
    for slave in conf.slaveConfs:
        description = slave.makeDpSlaveDesc()
        description.setUserPrmData(slave.gsd.getUserPrmData())
        master.addSlave(description)
        slaves.append(description)
    master.initialize()
    return master, slaves[0]


def note_diagnoses():
    """Records the diagnoses where the telegrams arrive, because pyprofibus keeps only the standard part."""
    seen = []
    read = DpTelegram_SlaveDiag_Con.fromFdlTelegram.__func__

    def note(cls, telegram):
        octets = bytes(telegram.du).hex()
        # Before that the station is not ready.
        if not telegram.du[0] & 0x02 and octets not in seen[-1:]:
            seen.append(octets)
        return read(cls, telegram)

    DpTelegram_SlaveDiag_Con.fromFdlTelegram = classmethod(note)
    return seen


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
    master, slave = open_master(sys.argv[1:6])
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
