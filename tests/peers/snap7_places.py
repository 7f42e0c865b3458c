"""python-snap7's client against a tickbus server with [fieldbus.at]: tests/foreign/s7.rs describes the places."""

import struct
import sys

import snap7
from snap7.type import Area, Block
from snap7_checks import equal, refused

client = snap7.client.Client()
client.connect("127.0.0.1", 0, 2, int(sys.argv[1]))

# What the simulation writes, in two data blocks and the flags.
equal("position", bytes(client.db_read(10, 4, 2)), struct.pack(">h", -2))
equal("pressure", client.db_read_real(65535, 1000), 1.5)
equal("sensor", list(client.mb_read(100, 1)), [8])
refused("writing the position", lambda: client.db_write(10, 4, bytearray(2)), "")
refused("writing over it", lambda: client.db_write(10, 0, bytearray(100)), "")

# What it reads, with its neighbours.
client.db_write(10, 20, bytearray(struct.pack(">h", 1234)))
client.db_write(10, 22, bytearray(b"xy"))
client.db_write_bool(500, 0, 7, True)
client.write_area(Area.PA, 0, 8, bytearray(struct.pack(">f", 2.5)))
equal("speed", bytes(client.db_read(10, 20, 4)), struct.pack(">h", 1234) + b"xy")
equal("run", list(client.db_read(500, 0, 1)), [0x80])

# The whole block, and beyond it.
equal("DB10", bytes(client.db_read(10, 0, 100)), b"\0\0\0\0\xff\xfe" + bytes(14) + b"\x04\xd2xy" + bytes(76))
refused("beyond DB10", lambda: client.db_read(10, 99, 2), "0x05")
refused("DB11", lambda: client.db_read(11, 0, 1), "0x0a")
refused("an input", lambda: client.eb_read(0, 1), "0x05")

# Two items of one job.
items = [
    {"area": Area.DB, "db_number": 65535, "start": 1000, "size": 4},
    {"area": Area.PA, "db_number": 0, "start": 8, "size": 4},
]
code, read = client.read_multi_vars(items)
equal("items", (code, [bytes(one) for one in read]), (0, [struct.pack(">f", 1.5), struct.pack(">f", 2.5)]))

# The name of the device.
order = client.get_order_code()
equal("order code", order.OrderCode, b"6ES7 315-2EH14-0AB0")
equal("firmware", (order.V1, order.V2, order.V3), (3, 2, 6))
info = client.get_cpu_info()
equal("module", info.ModuleName, b"PLC_1")
equal("system", info.ASName, b"S7-300 station_1")
equal("type", info.ModuleTypeName, b"CPU 315-2 PN/DP")
equal("serial", info.SerialNumber, b"S C-X4U421302009")
equal("copyright", info.Copyright, b"Original Siemens Equipment")
equal("data blocks", client.list_blocks_of_type(Block.DB, 10), [10, 500, 65535])
equal("length of DB 10", client.get_block_info(Block.DB, 10).MC7Size, 100)
client.disconnect()
print("snap7_places: ok")
