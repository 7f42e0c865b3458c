"""Answers per second of the socket bus and of a Modbus server, beside those of a bare echo, whatever platform they run on.

answers.py PLATFORM SECONDS ECHO -- COMMAND...

ECHO is the program of echo.c, and COMMAND starts the tickbus command; both are of the platform, and words before the command
(such as those of an emulator) also start the echo. Each line has a figure, in turns of the three, as a median of five.
"""

import pathlib
import re
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time

from round_trips import BYTES, Mirror

TURNS = 5
READ_ONE_REGISTER = struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0, 1)


def answers(port, request, length, seconds):
    """The number of answers of `length` bytes per second."""
    with socket.create_connection(("127.0.0.1", port), timeout=20) as line:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        count, begun = 0, time.perf_counter()
        while time.perf_counter() - begun < seconds:
            line.sendall(request)
            missing = length
            while missing > 0:
                piece = line.recv(missing)
                if not piece:
                    sys.exit("the peer has left")
                missing -= len(piece)
            count += 1
        return count / (time.perf_counter() - begun)


def echo(words, program, seconds):
    with subprocess.Popen([*words, program], stdout=subprocess.PIPE, text=True) as process:
        port = int(re.search(r":(\d+)", process.stdout.readline())[1])
        return answers(port, bytes(BYTES), BYTES, seconds)


def mirror(command, fieldbus, request, length, seconds):
    with tempfile.TemporaryDirectory() as folder:
        with Mirror(command, pathlib.Path(folder), fieldbus) as running:
            return answers(running.port, request, length, seconds)


def main():
    split = sys.argv.index("--")
    platform, seconds, program = sys.argv[1], float(sys.argv[2]), sys.argv[3]
    command = sys.argv[split + 1:]
    given = {"echo": [], "socket": [], "modbus": []}
    for _ in range(TURNS):
        given["echo"].append(echo(command[:-1], program, seconds))
        given["socket"].append(mirror(
            command, 'kind = "socket"\naddress = "127.0.0.1:0"\nsend = "reply"', bytes(BYTES), BYTES, seconds))
        given["modbus"].append(mirror(
            command, 'kind = "modbus-server"\naddress = "127.0.0.1:0"', READ_ONE_REGISTER, 11, seconds))
    for name, rates in given.items():
        print(f"{platform}.{name}.answers_per_s {statistics.median(rates):.0f}")
    for name in ("socket", "modbus"):
        ratio = statistics.median(rate / bare for rate, bare in zip(given[name], given["echo"]))
        print(f"{platform}.{name}.of_echo {ratio:.2f}")


if __name__ == "__main__":
    main()
