"""python-snap7's client against a tickbus server: tests/foreign/s7.rs describes the image."""

import datetime
import struct
import sys

import snap7
from snap7.type import Area, Block, WordLen
from snap7_checks import equal, refused

client = snap7.client.Client()
client.connect("127.0.0.1", 0, 1, int(sys.argv[1]))
equal("pdu", client.get_pdu_length(), 480)

# Reads the inputs, and a data block over a part of them.
equal("inputs", bytes(client.eb_read(0, 8)), bytes([1, 0, 0xFF, 0xFE]) + struct.pack(">f", 1.5))
equal("DB2", bytes(client.db_read(2, 0, 6)), b"\xff\xfe" + struct.pack(">f", 1.5))
equal("a bit", list(client.read_area(Area.PE, 0, 0, 1, WordLen.Bit)), [1])
equal("an INT", client.db_read_int(2, 0), -2)
equal("a REAL", list(client.read_area(Area.PE, 0, 4, 1, WordLen.Real)), list(struct.pack(">f", 1.5)))

# Writes data block 1, which is the outputs.
equal("fail-safe", bytes(client.ab_read(2, 2)), b"\xff\xff")
client.db_write(1, 2, bytearray(struct.pack(">h", 1234)))
client.db_write_bool(1, 0, 0, True)
client.db_write_real(1, 4, 2.5)
equal("outputs", bytes(client.ab_read(0, 8)), bytes([1, 0]) + struct.pack(">hf", 1234, 2.5))
client.mb_write(10, 3, bytearray(b"abc"))
equal("flags", bytes(client.mb_read(9, 5)), b"\0abc\0")

# Several items in one job, of odd lengths.
items = [
    {"area": Area.DB, "db_number": 1, "start": 2, "size": 2},
    {"area": Area.PE, "db_number": 0, "start": 0, "size": 3},
    {"area": Area.PA, "db_number": 0, "start": 0, "size": 1},
]
code, read = client.read_multi_vars(items)
equal("code", code, 0)
equal("items", [bytes(one) for one in read], [struct.pack(">h", 1234), b"\x01\0\xff", b"\x01"])

# Impossible requests return the protocol's own codes.
refused("DB 9", lambda: client.db_read(9, 0, 1), "0x0a")
refused("DB 1 beyond its end", lambda: client.db_read(1, 7, 2), "0x05")
refused("writing an input", lambda: client.eb_write(0, 1, bytearray(b"x")), "")
refused("DB 2 is of inputs", lambda: client.db_write(2, 0, bytearray(b"x")), "")
refused("stop", client.plc_stop, "not implemented")
refused("start", client.plc_hot_start, "not implemented")
refused("upload", lambda: client.upload(1), "not implemented")
refused("setting the clock", client.set_plc_system_datetime, "not implemented")
refused("an unknown list", lambda: client.read_szl(0x00A0), "unavailable")

# The identity of the CPU.
equal("state", client.get_cpu_state(), "S7CpuStatusRun")
order = client.get_order_code()
equal("order code", order.OrderCode, b"tickbus")
info = client.get_cpu_info()
equal("module", info.ModuleName, b"Test rig")
equal("station", info.ASName, b"Test rig")
equal("type", info.ModuleTypeName, b"tickbus, a simulated machine")
lists = client.read_szl_list()
equal("lists", lists[:4], struct.pack(">HH", 2, 11))
for number in (0x0011, 0x0019, 0x001C, 0x0074, 0x0131, 0x0132, 0x0232, 0x0424):
    if struct.pack(">H", number) not in lists:
        sys.exit(f"list {number:04x} is not in the list of lists")
    client.read_szl(number, {0x0131: 1, 0x0132: 4, 0x0232: 4}.get(number, 0))
state = client.read_szl(0x0424)
equal("RUN", bytes(b & 0xFF for b in state.Data[: state.Header.LengthDR])[7], 8)
age = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None) - client.get_plc_datetime()
equal("the clock is right", abs(age) < datetime.timedelta(hours=1), True)
blocks = client.list_blocks()
equal("blocks", (blocks.DBCount, blocks.OBCount), (2, 0))
equal("data blocks", client.list_blocks_of_type(Block.DB, 10), [1, 2])
block = client.get_block_info(Block.DB, 2)
equal("length of DB 2", block.MC7Size, 6)
refused("block info of DB 9", lambda: client.get_block_info(Block.DB, 9), "not found")

# Again, after a new connection with the smallest and the largest units.
client.disconnect()
for asked, agreed in ((240, 240), (960, 960)):
    client = snap7.client.Client()
    client.pdu_length = asked
    client.connect("127.0.0.1", 0, 2, int(sys.argv[1]))
    equal("pdu", client.get_pdu_length(), agreed)
    client.read_szl(0x001C)
    equal("module", client.get_cpu_info().ModuleName, b"Test rig")
    client.disconnect()
print("snap7_client: ok")
