"""A PROFIBUS station at the end of pyprofibus: the exchange of data, and telegrams of any other service.

pyprofibus has no services for records: the data units are this file's own, the telegrams, the access points and the frame
count bits around them are pyprofibus's.
"""

import os
import sys
import tempfile
import time

import pyprofibus
from pyprofibus.dp import DpTelegram_SlaveDiag_Con
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
output_size={size}
input_size={size}
diag_period=0
"""

LIMIT = 20


def open_master(device, baud, address, gsd, *modules, size=4):
    """A master, and the description of its one slave, which has `size` octets in each direction."""
    modules = "\n".join(f"module_{slot}={module}" for slot, module in enumerate(modules))
    text = CONF.format(device=device, baud=baud, address=address, gsd=gsd, modules=modules, size=size)
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


def is_exchange(answer):
    return answer.sd != FdlTelegram.SC and not answer.dae and bool(answer.du)


class Station:
    """A station whose subclass says with `exchange` which data are exchanged between two telegrams of other services."""

    def __init__(self, arguments):
        self.master, self.slave = open_master(*arguments)
        # Answers to the other masters' requests arrive here, too.
        self.master.fdlTrans.setRXFilter(None)
        self.fcb = FdlFCB(enable=True)

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


class Echo(Station):
    """A station that copies its 4 bytes of outputs to the inputs."""

    first = number = 0

    def exchange(self):
        """Exchanges new data until they come back."""
        self.number = (self.number + 1) % 256
        sent = bytearray([self.first, self.number, 2, 3])
        limit = time.monotonic() + LIMIT
        while True:
            self.slave.setMasterOutData(sent)
            self.master.run()
            if self.slave.getMasterInData() == sent:
                return
            if time.monotonic() > limit:
                sys.exit("no data come back")
