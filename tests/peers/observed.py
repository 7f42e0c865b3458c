"""A PLC that is observed: a foreign server that counts the writes of its clients.

observed.py s7|modbus|opcua PORT

It prints "ready", does what each line of stdin says, and answers the line with "writes N", the count so far:
    LEVEL SPEED    %IW0 and %QW2 get these values, inside the server
    write          a foreign client connects, and writes %QW2
    count          nothing
"""

import asyncio
import logging
import sys

KIND, PORT = sys.argv[1], int(sys.argv[2])
HOST = "127.0.0.1"
writes = 0


def count():
    global writes
    writes += 1


def big(value):
    return value.to_bytes(2, "big", signed=True)


class S7:
    async def start(self):
        import snap7
        from snap7.type import SrvArea

        class Counting(snap7.server.Server):
            def _handle_write_area(self, *arguments):
                count()
                return super()._handle_write_area(*arguments)

        self.snap7, self.server = snap7, Counting(log=False)
        self.inputs, self.outputs = bytearray(16), bytearray(16)
        self.server.register_area(SrvArea.PE, 0, self.inputs)
        self.server.register_area(SrvArea.PA, 0, self.outputs)
        self.server.start(PORT)

    async def set(self, level, speed):
        self.inputs[0:2], self.outputs[2:4] = big(level), big(speed)

    async def write(self):
        client = self.snap7.client.Client()
        client.connect(HOST, 0, 1, PORT)
        client.ab_write(2, bytearray(big(7)))
        client.disconnect()

    async def stop(self):
        self.server.stop()


class Modbus:
    async def start(self):
        from pymodbus.datastore import ModbusDeviceContext, ModbusSequentialDataBlock, ModbusServerContext
        from pymodbus.server import ModbusTcpServer

        def seen(is_sent, pdu):
            if not is_sent and pdu.function_code in (5, 6, 15, 16, 22, 23):
                count()
            return pdu

        device = ModbusDeviceContext(
            ir=ModbusSequentialDataBlock(1, [0] * 16),
            hr=ModbusSequentialDataBlock(1, [0] * 16),
        )
        self.server = ModbusTcpServer(
            ModbusServerContext(devices=device), address=(HOST, PORT), trace_pdu=seen)
        await self.server.serve_forever(background=True)

    async def set(self, level, speed):
        await self.server.async_setValues(0, 4, 0, [level % 65536])
        await self.server.async_setValues(0, 3, 1, [speed % 65536])

    async def write(self):
        from pymodbus.client import AsyncModbusTcpClient

        client = AsyncModbusTcpClient(HOST, port=PORT)
        await client.connect()
        await client.write_register(1, 7)
        client.close()

    async def stop(self):
        await self.server.shutdown()


class OpcUa:
    async def start(self):
        from asyncua import Server, ua
        from asyncua.server.internal_session import InternalSession

        self.ua, self.server = ua, Server()
        await self.server.init()
        self.server.set_endpoint(f"opc.tcp://{HOST}:{PORT}")
        self.server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        await self.server.register_namespace("urn:test:signals")
        for name in ("level", "speed"):
            node = await self.server.nodes.objects.add_variable(self.node(name), name, self.value(0))
            await node.set_writable()
        write = InternalSession.write

        async def counted(session, params):
            # The server itself writes through a session, too.
            if session.external:
                count()
            return await write(session, params)

        InternalSession.write = counted
        await self.server.start()

    def node(self, name):
        return self.ua.NodeId(name, 2)

    def value(self, value):
        return self.ua.Variant(value, self.ua.VariantType.Int16)

    async def set(self, level, speed):
        for name, value in (("level", level), ("speed", speed)):
            await self.server.write_attribute_value(self.node(name), self.ua.DataValue(self.value(value)))

    async def write(self):
        from asyncua import Client

        async with Client(f"opc.tcp://{HOST}:{PORT}") as client:
            await client.get_node(self.node("speed")).write_value(self.value(7))

    async def stop(self):
        await self.server.stop()


async def main():
    server = {"s7": S7, "modbus": Modbus, "opcua": OpcUa}[KIND]()
    await server.start()
    print("ready", flush=True)
    while line := await asyncio.get_running_loop().run_in_executor(None, sys.stdin.readline):
        if line == "write\n":
            await server.write()
        elif line != "count\n":
            await server.set(*map(int, line.split()))
        print(f"writes {writes}", flush=True)
    await server.stop()


logging.disable(logging.CRITICAL)
asyncio.run(main())
