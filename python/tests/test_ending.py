"""The outputs that a controller leaves at a third-party device, however its process ends."""

import signal
import socket
import subprocess
import sys

import pytest

CONFIG = """
[driver]
id   = 1
name = "cell"

[fieldbus]
kind    = "socket"
role    = "controller"
address = "127.0.0.1:{port}"
cycle   = "1ms"
max_age = "20s"

[[signal]]
name      = "motor"
address   = "%QB0"
fail_safe = 7
"""

PROGRAM = """
import signal, sys
import tickbus

def run(line):
    line["motor"].value = 1
    line.exchange()
    sys.stdin.readline()

how = sys.argv[2]
if how == "handled":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(3))
if how == "forgotten":
    line = tickbus.open(sys.argv[1])
    run(line)
else:
    with tickbus.open(sys.argv[1]) as line:
        run(line)
        if how == "raises":
            raise RuntimeError("a mistake of the program")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("how", "number", "code"),
    [
        ("block", None, 0),
        ("raises", None, 1),
        ("forgotten", None, 0),
        ("handled", signal.SIGTERM, 3),
        ("killed", signal.SIGTERM, -signal.SIGTERM),
        ("killed", getattr(signal, "SIGHUP", None), -1),
    ],
)
def test_a_controller_leaves_its_fail_safe_value_however_its_process_ends(tmp_path, how, number, code):
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(60)
        config = tmp_path / "cell.cfg"
        config.write_text(CONFIG.format(port=server.getsockname()[1]))
        command = [sys.executable, "-c", PROGRAM, str(config), how]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
            device, _ = server.accept()
            device.settimeout(60)
            while device.recv(1) != b"\1":
                pass
            if number is None:
                program.stdin.write("\n")
                program.stdin.flush()
            else:
                program.send_signal(number)
            last = b"\1"
            while records := device.recv(4096):
                last = records[-1:]
            device.close()
            _, errors = program.communicate(timeout=60)
    assert (last, program.returncode) == (b"\7", code), errors
