"""A LOGO! 8 by python-snap7's server, until stdin ends: data block 1 is its variable memory.

Its program: Q1 (V1064.0) is on until network input 1 (V0.0) says that the tank is full; AQ1 (VW1072) counts the starts of Q1.
"""

import logging
import struct
import sys
import threading

import snap7
from snap7.type import SrvArea

NI1, Q, AQ1 = 0, 1064, 1072

logging.disable(logging.CRITICAL)
memory = bytearray(1470)
server = snap7.server.Server(log=False)
server.register_area(SrvArea.DB, 1, memory)
server.start(int(sys.argv[1]))
print("ready", flush=True)
over = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
was_on, starts = 0, 0
while not over.wait(0.01):
    is_on = not memory[NI1] & 1
    starts += is_on and not was_on
    was_on = is_on
    memory[Q] = int(is_on)
    struct.pack_into(">h", memory, AQ1, starts)
server.stop()
