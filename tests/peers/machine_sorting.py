"""A PLC of pymodbus for the training machine "sorting": starts the belt, and pushes the first tall part into the chute.

machine_sorting.py HOST PORT
"""

import sys
import time

from pymodbus.client import ModbusTcpClient

BELT, PUSHER_OUT = 0, 1
PART_AT_ENTRY, TALL_PART, PART_AT_PUSHER, PUSHER_IS_OUT, PUSHER_IS_IN = range(2, 7)
TALL_IN_CHUTE = 2

client = ModbusTcpClient(sys.argv[1], port=int(sys.argv[2]))
if not client.connect():
    sys.exit("no connection")
limit = time.monotonic() + 50


def write(coil, value):
    if client.write_coil(coil, value).isError():
        sys.exit(f"coil {coil} is refused")


def wait(what, number):
    while True:
        inputs = client.read_discrete_inputs(0, count=16).bits
        if inputs[number]:
            return inputs
        if time.monotonic() > limit:
            sys.exit(f"no {what}")
        # A PLC writes its outputs in each cycle.
        write(BELT, True)


write(BELT, True)
inputs = wait("part at the entry", PART_AT_ENTRY)
if not inputs[TALL_PART]:
    sys.exit("the first part is tall, and was not seen as one")
wait("part at the pusher", PART_AT_PUSHER)
write(PUSHER_OUT, True)
wait("pusher that is out", PUSHER_IS_OUT)
write(PUSHER_OUT, False)
wait("pusher that is in", PUSHER_IS_IN)
tall, short = client.read_input_registers(TALL_IN_CHUTE, count=2).registers
write(BELT, False)
client.close()
print(f"machine_sorting.py: ok tall={tall} short={short}")
