"""The IVI protocol implemented a second time, from the reader's manual alone: our own cross-check, not third-party.

ivi.py client DEVICE      asks the reader there for everything, and says so when all answers were right
ivi.py reader DEVICE      is a reader with an IDC-1K before head 1, until its standard input ends

The carrier before head 1 is expected to begin with the octets 03 01 02 03, and to have the number 0A011C3E.
"""

import select
import sys
import time

import serial

ETX = 3


def telegram(text):
    return text + bytes([sum(text) % 256, ETX])


class Client:
    def __init__(self, device):
        self.port = serial.Serial(device, 9600, timeout=20)

    def tell(self, text):
        self.port.write(telegram(text))

    def take(self, text):
        """Reads the expected answer, with its checksum."""
        expected = telegram(text)
        found = self.port.read(len(expected))
        if found != expected:
            raise SystemExit(f"ivi: expected {expected.hex()}, and got {found.hex()}")

    def ask(self, text, answer):
        self.tell(text)
        self.take(answer)

    def run(self):
        self.ask(b"q", b"q")
        self.ask(b"d4", b"d")
        self.ask(b"c", b"c00")
        self.ask(b"b", b"b")
        # A simulation puts the carrier there, which is slower than a serial port.
        limit = time.monotonic() + 20
        while True:
            self.tell(b"w10001")
            head = self.port.read(3)
            if head != b"w03":
                break
            self.port.read(2)
            if time.monotonic() > limit:
                raise SystemExit("ivi: no carrier has come")
        rest = head + self.port.read(3)
        assert rest == telegram(b"w00\x03"), rest.hex()
        self.ask(b"w10004", b"w00\x03\x01\x02\x03")
        self.ask(b"wx0002", b"w001\x03\x01")
        self.ask(b"k17D03\x03\x03\x04", b"k00")
        self.ask(b"w17D03", b"w00\x03\x03\x04")
        self.ask(b"kx0001\x03", b"k001")
        page = b"\x03\x01\x02\x03" + bytes(28)
        self.ask(b"a1", b"a00" + page)
        self.ask(b"l1000", b"l00" + page)
        self.ask(b"l1003", b"l00" + bytes(29) + b"\x03\x03\x04")
        self.ask(b"l1004", b"l09")
        self.ask(b"m1000" + page, b"m0D")
        self.ask(b"i1", b"i00\x0a\x01\x1c\x3e")
        self.ask(b"h1", b"h00")
        self.ask(b"w18001", b"w09")
        self.ask(b"w20001", b"w02")
        self.ask(b"w00001", b"w00")
        self.port.write(b"w10001\x00\x03")
        self.take(b"w06")
        self.tell(b"W10001")
        for _ in range(3):
            self.take(b"W00\x03")
        self.tell(b"q")
        # More octets can be on their way.
        found = self.port.read(3)
        while found == b"W00":
            self.port.read(3)
            found = self.port.read(3)
        assert found == telegram(b"q"), found.hex()
        self.tell(b"v")
        assert self.port.read(3) == b"v00"
        print("ivi: ok, all answers were right")


class Reader:
    def __init__(self, device):
        self.port = serial.Serial(device, 9600, timeout=5)
        self.octets = bytearray(b"\x03\x01\x02\x03" + bytes(124))

    def answer(self, command):
        first = chr(command[0])
        if first in "qd":
            return command[:1]
        if first not in "wk":
            return command[:1] + b"01"
        if command[1:2] != b"1":
            return command[:1] + b"02"
        start, count = int(command[2:4], 16), int(command[4:6], 16)
        if count == 0 or start + count > 128:
            return command[:1] + b"09"
        if first == "w":
            return b"w00" + self.octets[start : start + count]
        self.octets[start : start + count] = command[6 : 6 + count]
        return b"k00"

    def command(self):
        """Reads one command without its end; None if it was damaged."""
        text = self.port.read(1)
        text += self.port.read({"w": 5, "k": 5, "d": 1}.get(text.decode("latin-1"), 0))
        if text[:1] == b"k":
            text += self.port.read(int(text[4:6], 16))
        end = self.port.read(2)
        return text if text + end == telegram(text) else None

    def run(self):
        print("ivi: ready", flush=True)
        while True:
            ready, _, _ = select.select([self.port, sys.stdin], [], [])
            if sys.stdin in ready:
                return
            command = self.command()
            if command:
                self.port.write(telegram(bytes(self.answer(command))))


if __name__ == "__main__":
    {"client": Client, "reader": Reader}[sys.argv[1]](sys.argv[2]).run()
