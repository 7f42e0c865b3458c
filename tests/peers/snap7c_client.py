"""The client of Snap7 in C against a tickbus server: tests/foreign/s7.rs describes the image."""

import datetime
import struct
import sys
from ctypes import POINTER, c_uint8, cast, create_string_buffer, pointer

import snap7
from snap7.type import Area, Block, S7DataItem
from snap7_checks import equal, refused

client = snap7.client.Client()
client.connect("127.0.0.1", 0, 1, int(sys.argv[1]))
equal("pdu", client.get_pdu_length(), 480)
equal("inputs", bytes(client.eb_read(0, 8)), bytes([1, 0, 0xFF, 0xFE]) + struct.pack(">f", 1.5))
equal("DB2", bytes(client.db_get(2)[:6]), b"\xff\xfe" + struct.pack(">f", 1.5))
client.db_write(1, 2, bytearray(struct.pack(">h", 1234)))
client.db_write(1, 0, bytearray(b"\x01"))
client.write_area(Area.PA, 0, 4, bytearray(struct.pack(">f", 2.5)))
equal("outputs", bytes(client.ab_read(0, 8)), bytes([1, 0]) + struct.pack(">hf", 1234, 2.5))
client.mb_write(10, 3, bytearray(b"abc"))
equal("flags", bytes(client.mb_read(9, 5)), b"\0abc\0")
refused("DB 9", lambda: client.db_read(9, 0, 1), "not")
refused("counters", lambda: client.read_area(Area.CT, 0, 0, 1), "not")

# Several items in one job.
items = (S7DataItem * 2)()
buffers = [create_string_buffer(2), create_string_buffer(4)]
for item, buffer, (area, block, start) in zip(items, buffers, ((Area.DB, 1, 2), (Area.PE, 0, 4))):
    item.Area, item.WordLen, item.DBNumber = area.value, 2, block
    item.Start, item.Amount = start, len(buffer)
    item.pData = cast(pointer(buffer), POINTER(c_uint8))
client.read_multi_vars(items)
equal("items", [buffer.raw for buffer in buffers], [struct.pack(">h", 1234), struct.pack(">f", 1.5)])

equal("state", client.get_cpu_state(), "S7CpuStatusRun")
equal("module", client.get_cpu_info().ModuleName, b"Test rig")
equal("order code", client.get_order_code().OrderCode.strip(), b"tickbus")
equal("protection", client.get_protection().sch_schal, 1)
equal("longest unit", client.get_cp_info().MaxPduLength, 960)
age = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None) - client.get_plc_datetime()
equal("the clock is right", abs(age) < datetime.timedelta(hours=1), True)
equal("blocks", client.list_blocks().DBCount, 2)
equal("length of DB 2", client.get_block_info(Block.DB, 2).MC7Size, 6)
for number, index in ((0x0019, 0), (0x0074, 0), (0x0131, 3), (0x0132, 1), (0x0424, 0)):
    client.read_szl(number, index)
equal("stop is refused", client.plc_stop() != 0, True)
client.disconnect()
print("snap7c_client: ok")
