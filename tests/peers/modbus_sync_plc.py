#!/usr/bin/env python3
"""A PLC that takes part in virtual time by two variables and a clock alone, with pymodbus.

modbus_sync_plc.py HOST PORT STEPS SEED

It polls the remote I/O, and runs its program once for each new value of sync.go, after a random time. The last line
has the number of steps.
"""

import random
import sys
import time

from pymodbus.client import ModbusTcpClient


def double(registers):
    return registers[0] << 16 | registers[1]


def main():
    host, port, steps, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    delays = random.Random(seed)
    client = ModbusTcpClient(host, port=port, timeout=20)
    if not client.connect():
        sys.exit("modbus_sync_plc: failed: no connection")
    client.write_registers(0, [0, 0])
    last, count = 0, 0
    while count < steps:
        # sync.go, sync.time and the position in one request: they belong together.
        inputs = client.read_input_registers(0, count=5).registers
        go, millis, position = double(inputs), double(inputs[2:]), inputs[4]
        if go == last:
            continue
        if (go, millis) != (last + 1, 10 * count):
            sys.exit(f"modbus_sync_plc: failed: step {go} at {millis} ms after {last}")
        last, count = go, count + 1
        client.write_register(2, 0xFFFF)
        if delays.random() < 0.2:
            time.sleep(delays.random() / 300)
        client.write_register(2, (position + count) % 1000)
        # Answer when the outputs are written.
        client.write_registers(0, [go >> 16, go & 0xFFFF])
    # Runs until the run has ended: a PLC does not leave.
    print(f"modbus_sync_plc: ok steps={count}", flush=True)
    sys.stdin.read()


main()
