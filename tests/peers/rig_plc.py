"""The PLC of a bottle rig, whose process image is in a Modbus server: pymodbus as the client.

rig_plc.py PORT CYCLES

%Q is in the holding registers from 0 on, %I in those from 1024 on. In each cycle lift 2 goes up, wheel 2 turns, and the lift
goes down again. The last line has the number of cycles.
"""

import sys
import time

from pymodbus.client import ModbusTcpClient

IM2_INDEX, LA2_RUN, LA2_UP, SC2 = 1 << 7, 1 << 10, 1 << 11, 1 << 12
# Register 1024 is the status word; the buttons and switches are in the high byte of the next one.
WHEEL_TURNED, LIFT_UP, LIFT_DOWN = (0, 1 << 3), (0, 1 << 4), (1, 1 << 12)


def main():
    client = ModbusTcpClient("127.0.0.1", port=int(sys.argv[1]))
    client.connect()

    def wait(until):
        register, bit = until
        limit = time.monotonic() + 20
        while not client.read_holding_registers(1024, count=2).registers[register] & bit:
            if time.monotonic() > limit:
                sys.exit(f"rig_plc: nothing comes in register {1024 + register}, bit {bit:#x}")
            time.sleep(0.01)

    def command(word):
        client.write_register(0, word)

    cycles = int(sys.argv[2])
    wait(LIFT_DOWN)
    for _ in range(cycles):
        command(LA2_RUN | LA2_UP)
        wait(LIFT_UP)
        command(SC2)
        time.sleep(0.2)
        command(SC2 | IM2_INDEX)
        wait(WHEEL_TURNED)
        command(SC2)
        time.sleep(0.2)
        command(SC2 | LA2_RUN)
        wait(LIFT_DOWN)
        command(0)
        time.sleep(0.4)
    client.close()
    print(f"rig_plc: ok cycles={cycles}")


main()
