#!/usr/bin/env python3
"""As modbus_sync_plc.py, with asyncua.

opcua_sync_plc.py HOST PORT STEPS SEED
"""

import asyncio
import random
import sys

from asyncua import Client, ua


async def main():
    host, port, steps, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    delays = random.Random(seed)
    async with Client(f"opc.tcp://{host}:{port}", timeout=20) as client:
        inputs = [client.get_node(f"ns=2;s={name}") for name in ("sync.go", "sync.time", "position")]
        speed, done = (client.get_node(f"ns=2;s={name}") for name in ("speed", "sync.done"))

        async def write(node, value, kind):
            await node.write_value(ua.DataValue(ua.Variant(value, kind)))

        await write(done, 0, ua.VariantType.UInt32)
        last, count = 0, 0
        while count < steps:
            # sync.go, sync.time and the position in one request: they belong together.
            values = [value.Value for value in await client.uaclient.read_attributes(
                [node.nodeid for node in inputs], ua.AttributeIds.Value)]
            # The values are bad until the first step.
            if any(value is None or value.Value is None for value in values):
                continue
            go, millis, position = (value.Value for value in values)
            if go == last:
                continue
            if (go, millis) != (last + 1, 10 * count):
                sys.exit(f"opcua_sync_plc: failed: step {go} at {millis} ms after {last}")
            last, count = go, count + 1
            await write(speed, -1, ua.VariantType.Int16)
            if delays.random() < 0.2:
                await asyncio.sleep(delays.random() / 300)
            await write(speed, (position + count) % 1000, ua.VariantType.Int16)
            # Answer when the outputs are written.
            await write(done, go, ua.VariantType.UInt32)
        # Runs until the run has ended: a PLC does not leave.
        print(f"opcua_sync_plc: ok steps={count}", flush=True)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


asyncio.run(main())
