"""Clients of others drive `tickbus mirror` from this computer, whatever platform it runs on.

round_trips.py PLATFORM COUNT OUTPUT -- COMMAND...

COMMAND starts the tickbus command of the platform. For each of Modbus, S7 and the socket bus, a mirror is started on a free
port, and COUNT values are written and waited for. Then pymodbus tries each function of Modbus (tests/peers/modbus_client.py),
over TCP and over a serial line: two pseudo-terminals, of which Windows sees one as COM5. The last line has the counts; the
figures are appended to the file OUTPUT.
"""

import os
import pathlib
import re
import select
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import tty

import snap7
from pymodbus.client import ModbusTcpClient

PEERS = pathlib.Path(__file__).parent.parent / "peers"
BYTES = 64
SECONDS = 60


def driver_cfg(fieldbus):
    signals = "".join(
        f'[[signal]]\nname = "{letter} {byte}"\naddress = "%{letter}B{byte}"\n'
        for letter in "IQ" for byte in range(BYTES)
    )
    return (
        f'[driver]\nid = 1\nname = "Cell 4"\n[fieldbus]\n{fieldbus}\nmax_age = "1h"\n'
        f"input_bytes = {BYTES}\noutput_bytes = {BYTES}\n{signals}"
    )


class Mirror:
    """A running mirror."""

    def __init__(self, command, folder, fieldbus):
        file = folder / "driver.cfg"
        file.write_text(driver_cfg(fieldbus))
        # Paths of this computer are paths of Wine too, on its drive Z.
        self.process = subprocess.Popen(
            [*command, "mirror", str(file), "--duration", f"{SECONDS}s"],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )
        self.said = ""
        while True:
            line = self.process.stdout.readline()
            self.said += line
            found = re.search(r"127\.0\.0\.1:([1-9]\d*)", line)
            if found or "listening on" in line:
                self.port = int(found[1]) if found else None
                break
            if not line:
                sys.exit(f"the mirror does not say where it listens: {self.said}")

    def __enter__(self):
        return self

    def __exit__(self, failure, *_):
        # Ctrl-C, which `timeout` passes on; SIGTERM would end only one thread of a program in Wine.
        self.process.send_signal(signal.SIGINT)
        try:
            self.said += self.process.communicate(timeout=SECONDS)[0]
        except subprocess.TimeoutExpired:
            self.process.kill()
            sys.exit(f"Ctrl-C does not end the mirror: {self.said}")
        if failure is None and (self.process.returncode != 0 or "mirror: ok" not in self.said):
            sys.exit(f"the mirror ended with code {self.process.returncode}: {self.said}")


def round_trips(count, write, read):
    """The times in milliseconds until each of `count` values came back."""
    times = []
    for number in range(1, count + 1):
        value = number % 251 + 1
        begun = time.perf_counter()
        write(value)
        while read() != value:
            if time.perf_counter() - begun > 10:
                sys.exit(f"value {value} did not come back within 10 s")
        times.append((time.perf_counter() - begun) * 1000)
    return times


def modbus(port, count):
    client = ModbusTcpClient("127.0.0.1", port=port, retries=0)
    if not client.connect():
        sys.exit("pymodbus cannot connect")
    times = round_trips(
        count,
        lambda value: client.write_register(0, value),
        lambda: client.read_input_registers(0, count=1).registers[0],
    )
    client.close()
    return times


def s7(port, count):
    client = snap7.client.Client()
    client.connect("127.0.0.1", 0, 1, port)
    times = round_trips(
        count,
        lambda value: client.ab_write(0, bytearray([value])),
        lambda: client.eb_read(0, 1)[0],
    )
    client.disconnect()
    return times


def records(port, count):
    with socket.create_connection(("127.0.0.1", port), timeout=20) as line:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sent = bytearray(BYTES)

        def write(value):
            sent[0] = value

        def read():
            line.sendall(sent)
            answer = b""
            while len(answer) < BYTES:
                piece = line.recv(BYTES - len(answer))
                if not piece:
                    sys.exit("the machine has left")
                answer += piece
            return answer[0]

        return round_trips(count, write, read)


class SerialLine:
    """Two pseudo-terminals, and a thread that carries bytes between their far ends."""

    def __init__(self):
        ends = [os.openpty() for _ in range(2)]
        self.far = [far for far, _ in ends]
        self.near = [near for _, near in ends]
        for near in self.near:
            tty.setraw(near)
        self.names = [os.ttyname(near) for near in self.near]
        threading.Thread(target=self.carry, daemon=True).start()

    def carry(self):
        while True:
            for ready in select.select(self.far, [], [])[0]:
                other = self.far[1 - self.far.index(ready)]
                os.write(other, os.read(ready, 4096))


def pymodbus_tries_everything(*arguments):
    told = subprocess.run(
        [sys.executable, str(PEERS / "modbus_client.py"), *arguments],
        capture_output=True, text=True, check=False, timeout=SECONDS,
    )
    if told.returncode != 0:
        sys.exit(f"modbus_client.py: {told.stdout}{told.stderr}")
    print(told.stdout.strip())


def over_a_serial_line(platform, command, folder):
    line = SerialLine()
    device, silence = line.names[0], ""
    if platform == "windows":
        # As for an adapter that hands over its bytes in pieces.
        device, silence = "COM5", 'silence = "20ms"\n'
        link = pathlib.Path(os.environ["WINEPREFIX"]) / "dosdevices" / "com5"
        link.unlink(missing_ok=True)
        link.symlink_to(line.names[0])
    settings = f'kind = "modbus-server"\ndevice = "{device}"\nbaud = 115200\nparity = "none"\n{silence}unit = 1'
    with Mirror(command, folder, settings):
        pymodbus_tries_everything("rtu", line.names[1])


def main():
    split = sys.argv.index("--")
    platform, count, output = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    command = sys.argv[split + 1:]
    passed = 0
    for name, fieldbus, drive in [
        ("modbus", 'kind = "modbus-server"\naddress = "127.0.0.1:0"', modbus),
        ("s7", 'kind = "s7-server"\naddress = "127.0.0.1:0"', s7),
        ("socket", 'kind = "socket"\naddress = "127.0.0.1:0"\nsend = "reply"', records),
    ]:
        with tempfile.TemporaryDirectory(prefix="tickbus ä ") as folder:
            with Mirror(command, pathlib.Path(folder), fieldbus) as mirror:
                times = drive(mirror.port, count)
                if name == "modbus":
                    pymodbus_tries_everything("tcp", "127.0.0.1", str(mirror.port))
                    passed += 1
        p50 = statistics.median(times)
        print(f"{name}: {count} of {count} values came back, half of them within {p50:.2f} ms")
        with open(output, "a", encoding="utf-8") as figures:
            figures.write(f"{platform}.{name}.p50_ms {p50:.3f}\n")
        passed += 1
    skipped = 0
    if platform == "arm64":
        print("test over_a_serial_line ... ignored, QEMU does not set serial ports")
        skipped += 1
    else:
        with tempfile.TemporaryDirectory() as folder:
            over_a_serial_line(platform, command, pathlib.Path(folder))
        passed += 1
    print(f"test result: ok. {passed} passed; 0 failed; {skipped} ignored; 0 measured; 0 filtered out")


if __name__ == "__main__":
    main()
