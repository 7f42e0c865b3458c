"""A foreign client that reads %IW0 (the node "level" by OPC UA) until it has a value, and prints what it saw.

looks.py s7|modbus|opcua PORT LAST
"""

import asyncio
import sys
import time

KIND, PORT, LAST = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
LIMIT = time.monotonic() + 50
seen = []


def look(value):
    if not seen or seen[-1] != value:
        seen.append(value)
    return value == LAST or time.monotonic() > LIMIT


def connected(connect):
    while True:
        try:
            if connect() is not False:
                return
        except Exception:
            if time.monotonic() > LIMIT:
                raise
        time.sleep(0.01)


def s7():
    import snap7

    client = snap7.client.Client()
    connected(lambda: client.connect("127.0.0.1", 0, 1, PORT) and None)
    while not look(int.from_bytes(client.eb_read(0, 2), "big", signed=True)):
        time.sleep(0.002)
    client.disconnect()


def modbus():
    from pymodbus.client import ModbusTcpClient

    client = ModbusTcpClient("127.0.0.1", port=PORT)
    connected(client.connect)
    while not look(client.read_input_registers(0, count=1).registers[0]):
        time.sleep(0.002)
    client.close()


async def opcua():
    from asyncua import Client, ua

    while True:
        client = Client(f"opc.tcp://127.0.0.1:{PORT}")
        try:
            await client.connect()
            break
        except Exception:
            if time.monotonic() > LIMIT:
                raise
            await asyncio.sleep(0.01)
    index = await client.get_namespace_index("urn:tickbus:signals")
    level, speed = (client.get_node(f"ns={index};s={name}") for name in ("level", "speed"))
    # A client that writes is a PLC.
    await speed.write_value(ua.Variant(1, ua.VariantType.Int16))
    while not look(await level.read_value()):
        await asyncio.sleep(0.002)
    await client.disconnect()


if KIND == "opcua":
    asyncio.run(opcua())
else:
    {"s7": s7, "modbus": modbus}[KIND]()
print("seen", *seen, flush=True)
