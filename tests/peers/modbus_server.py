"""A Modbus server by pymodbus, with all four tables.

modbus_server.py tcp|udp|rtu-over-tcp HOST PORT | modbus_server.py rtu|ascii DEVICE | modbus_server.py tls HOST PORT FOLDER

With TLS the folder has server.pem, server.key, and ca.pem for the certificates of clients.

Input register n is 7 n, discrete input n is on where n is a multiple of 3; coils and holding registers are zero.
"""

import asyncio
import ssl
import sys

from pymodbus import FramerType, ModbusDeviceIdentification
from pymodbus.datastore import ModbusDeviceContext, ModbusSequentialDataBlock, ModbusServerContext
from pymodbus.server import ModbusSerialServer, ModbusTcpServer, ModbusTlsServer, ModbusUdpServer


async def main():
    device = ModbusDeviceContext(
        di=ModbusSequentialDataBlock(1, [number % 3 == 0 for number in range(4096)]),
        co=ModbusSequentialDataBlock(1, [False] * 4096),
        ir=ModbusSequentialDataBlock(1, [7 * number % 65536 for number in range(2048)]),
        hr=ModbusSequentialDataBlock(1, [0] * 2048),
    )
    context = ModbusServerContext(devices=device)
    identity = ModbusDeviceIdentification(
        info_name={"VendorName": "ACME", "ProductCode": "PLC 7", "MajorMinorRevision": "1.2"})
    if sys.argv[1] == "udp":
        server = ModbusUdpServer(context, identity=identity, address=(sys.argv[2], int(sys.argv[3])))
    elif sys.argv[1] == "tls":
        folder = sys.argv[4]
        secured = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=f"{folder}/ca.pem")
        secured.verify_mode = ssl.CERT_REQUIRED
        secured.load_cert_chain(f"{folder}/server.pem", f"{folder}/server.key")
        server = ModbusTlsServer(
            context, identity=identity, sslctx=secured, address=(sys.argv[2], int(sys.argv[3])))
    elif sys.argv[1] == "ascii":
        # A pseudo-terminal has no characters of seven bits, and no parity.
        server = ModbusSerialServer(
            context, identity=identity, framer=FramerType.ASCII, port=sys.argv[2], baudrate=115200)
    elif sys.argv[1] != "rtu":
        framer = FramerType.SOCKET if sys.argv[1] == "tcp" else FramerType.RTU
        server = ModbusTcpServer(
            context, identity=identity, framer=framer, address=(sys.argv[2], int(sys.argv[3])))
    else:
        server = ModbusSerialServer(
            context, identity=identity, framer=FramerType.RTU, port=sys.argv[2], baudrate=115200, parity="N")
    await server.serve_forever(background=True)
    print("modbus_server: ready", flush=True)
    # Runs until the parent process closes stdin.
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    await server.shutdown()


asyncio.run(main())
