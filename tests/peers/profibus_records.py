"""Reads and writes the records of a PROFIBUS station; pyprofibus exchanges data meanwhile, and builds the telegrams.

profibus_records.py DEVICE BAUD ADDRESS GSD MODULE...

pyprofibus has no services for records: the data units below are this file's own, the telegrams, the access points and the
frame count bits around them are pyprofibus's. The station copies its 4 bytes of outputs to the inputs. Each line that is
printed is a request and its answer.
"""

import os
import sys
import tempfile
import time

import pyprofibus
from pyprofibus.dp import DpTelegram
from pyprofibus.fdl import FdlFCB, FdlTelegram, FdlTelegram_var

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
{modules}
output_size=4
input_size=4
diag_period=0
"""

LIMIT = 20


def open_master(device, baud, address, gsd, *modules):
    modules = "\n".join(f"module_{slot}={module}" for slot, module in enumerate(modules))
    text = CONF.format(device=device, baud=baud, address=address, gsd=gsd, modules=modules)
    with tempfile.NamedTemporaryFile("w", suffix=".conf", delete=False) as file:
        file.write(text)
    try:
        conf = pyprofibus.PbConf.fromFile(file.name)
    finally:
        os.unlink(file.name)
    master = conf.makeDPM()
    (slave,) = conf.slaveConfs
    description = slave.makeDpSlaveDesc()
    description.setUserPrmData(slave.gsd.getUserPrmData())
    master.addSlave(description)
    master.initialize()
    return master, description


def is_exchange(answer):
    return answer.sd != FdlTelegram.SC and not answer.dae and bool(answer.du)


class Station:
    def __init__(self, arguments):
        self.master, self.slave = open_master(*arguments)
        # Answers to the other masters' requests arrive here, too.
        self.master.fdlTrans.setRXFilter(None)
        self.fcb = FdlFCB(enable=True)
        self.number = 0

    def exchange(self):
        """Exchanges new data until they come back."""
        self.number = (self.number + 1) % 256
        sent = bytearray([self.number, 1, 2, 3])
        limit = time.monotonic() + LIMIT
        while True:
            self.slave.setMasterOutData(sent)
            self.master.run()
            if self.slave.getMasterInData() == sent:
                return
            if time.monotonic() > limit:
                sys.exit("no data come back")

    def send(self, ssap, dsap, data=b"", source=2):
        """Sends one telegram; returns the answer: "sc", "rs", "rr", or the octets of a data answer."""
        telegram = FdlTelegram_var(
            da=self.slave.slaveAddr,
            sa=source,
            fc=FdlTelegram.FC_REQ | FdlTelegram.FC_SRD_LO,
            dae=bytearray([dsap]),
            sae=bytearray([ssap]),
            du=bytearray(data),
        )
        fdl = self.master.fdlTrans
        fdl.send(self.fcb, telegram)
        limit = time.monotonic() + LIMIT
        while True:
            ok, answer = fdl.poll(0.1)
            # On a busy computer pyprofibus has repeated an exchange whose answer was late: that one has no access points.
            if ok and answer is not None and not is_exchange(answer):
                break
            if time.monotonic() > limit:
                sys.exit("no answer")
        self.fcb.handleReply()
        self.master.phy.releaseBus()
        if answer.sd == FdlTelegram.SC:
            return "sc"
        result = answer.fc & FdlTelegram.FC_RESFUNC_MASK
        names = {FdlTelegram.FC_RS: "rs", FdlTelegram.FC_RR: "rr"}
        if result in names:
            return names[result]
        if result != FdlTelegram.FC_DL or answer.dae != bytearray([ssap]) or answer.sae != bytearray([dsap]):
            sys.exit(f"a wrong answer: {answer}")
        return bytes(answer.du).hex()

    def ask(self, ssap, dsap, request, source=2):
        """Sends a request, and fetches its answer between exchanges of data."""
        request = bytes.fromhex(request)
        answer = self.send(ssap, dsap, request, source)
        if answer == "sc":
            self.exchange()
            answer = self.send(ssap, dsap, source=source)
        print(f"{request.hex()} {answer}")
        return answer


def main():
    station = Station(sys.argv[1:])
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
