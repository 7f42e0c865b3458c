"""python-snap7's server as a CPU: data block 1 has the value of data block 2 plus 1, until stdin ends."""

import logging
import struct
import sys
import threading

import snap7
from snap7.type import SrvArea

SIZE = 600

logging.disable(logging.CRITICAL)
server = snap7.server.Server(log=False)
outputs, inputs = bytearray(SIZE), bytearray(SIZE)
server.register_area(SrvArea.DB, 1, outputs)
server.register_area(SrvArea.DB, 2, inputs)
server.start(int(sys.argv[1]))
print("ready", flush=True)
over = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
while not over.wait(0.002):
    for place in (2, SIZE - 2):
        (value,) = struct.unpack_from(">h", inputs, place)
        struct.pack_into(">h", outputs, place, (value + 1) % 32768)
server.stop()
