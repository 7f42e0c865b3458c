"""An ADAM-6050 by pymodbus with a tank at its terminals: adam.py HOST PORT, until stdin ends.

Coils 1 to 12 are the digital inputs, coils 17 to 22 the digital outputs; elements behind them are refused. The pump at output 0 fills
the tank, which runs empty without it; the float switch at input 0 is on from full to empty.
"""

import asyncio
import sys

from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

FULL = 20
UNIT, READ, WRITE = 1, 1, 15


async def tank(server):
    level = 0
    while True:
        await asyncio.sleep(0.01)
        (pump,) = await server.async_getValues(UNIT, READ, 16, 1)
        level = min(max(level + (1 if pump else -1), 0), FULL)
        if level in (0, FULL):
            await server.async_setValues(UNIT, WRITE, 0, [level == FULL])


async def main():
    # pymodbus wants an element in each table.
    bits, words = ([SimData(65535, datatype=kind)] for kind in (DataType.BITS, DataType.REGISTERS))
    inputs, outputs = (SimData(at, values=[False] * count, datatype=DataType.BITS) for at, count in ((0, 12), (16, 6)))
    device = SimDevice(UNIT, simdata=([inputs, outputs], bits, words, words))
    server = ModbusTcpServer(device, address=(sys.argv[1], int(sys.argv[2])))
    await server.serve_forever(background=True)
    running = asyncio.create_task(tank(server))
    print("modbus_server: ready", flush=True)
    # Runs until the parent process closes stdin.
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    running.cancel()
    await server.shutdown()


asyncio.run(main())
