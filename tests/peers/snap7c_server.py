"""Snap7 in C as a CPU: data block 1 has the second word of data block 2 plus 1.

Lines of stdin are "run" and "stop"; when stdin ends, it prints the changed bytes of data block 2.
"""

import ctypes
import struct
import sys
import threading
import time

import snap7
from snap7.type import SrvArea

SIZE = 64
FILL = 0xEE
STATUS = {"run": 0x08, "stop": 0x04}

server = snap7.server.Server(log=False)
outputs, inputs = ((ctypes.c_uint8 * SIZE)(), (ctypes.c_uint8 * SIZE)(*[FILL] * SIZE))
server.register_area(SrvArea.DB, 1, outputs)
server.register_area(SrvArea.DB, 2, inputs)
server.start_to("127.0.0.1", int(sys.argv[1]))
server.set_cpu_status(STATUS["run"])
print("ready", flush=True)
over = threading.Event()


def follow():
    for line in sys.stdin:
        server.set_cpu_status(STATUS[line.strip()])
    over.set()


threading.Thread(target=follow, daemon=True).start()
while not over.wait(0.002):
    (value,) = struct.unpack_from(">h", inputs, 2)
    struct.pack_into(">h", outputs, 2, (value + 1) % 32768)
print("changed", *[index for index, byte in enumerate(inputs) if byte != FILL], flush=True)
server.stop()
