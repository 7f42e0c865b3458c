"""Drives a Modbus server with pymodbus: every function, and requests that the server must refuse.

modbus_client.py tcp|udp|rtu-over-tcp HOST PORT | modbus_client.py rtu|ascii DEVICE

The server has 64 bytes each way and brings each byte of %Q back on the byte of %I at the same offset; with RTU and ASCII
it is unit 1. The last line has the number of checks.
"""

import sys
import time

from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient, ModbusUdpClient

checks = 0


def check(what, given, expected):
    global checks
    checks += 1
    if given != expected:
        sys.exit(f"{what}: {given}, expected {expected}")


def refused(what, response, exception):
    check(what, (response.isError(), getattr(response, "exception_code", None)), (True, exception))


def wait(what, read, expected):
    """Values that the PLC writes come back through the machine's tick."""
    limit = time.monotonic() + 10
    while (given := read()) != expected and time.monotonic() < limit:
        pass
    check(what, given, expected)


def functions(client):
    """Every function, with the values that it reads and writes."""
    check("write registers", client.write_registers(0, [0x1234, 0xABCD, 7]).isError(), False)
    check("read holding", client.read_holding_registers(0, count=4).registers, [0x1234, 0xABCD, 7, 0])
    wait("read input", lambda: client.read_input_registers(0, count=3).registers, [0x1234, 0xABCD, 7])
    check("write register", client.write_register(31, 0x8001).isError(), False)
    check("read back", client.read_holding_registers(31, count=1).registers, [0x8001])
    # Bit n is bit n mod 8 of byte n / 8; register 31 is bytes 62 and 63.
    check("read coils", client.read_coils(496, count=16).bits, [False] * 7 + [True] + [True] + [False] * 7)
    check("write coil", client.write_coil(497, True).isError(), False)
    check("coil in register", client.read_holding_registers(31, count=1).registers, [0x8201])
    pattern = [True, False, True, True, False, False, True, True, True, False, True]
    check("write coils", client.write_coils(101, pattern).isError(), False)
    check("coils back", client.read_coils(101, count=11).bits[:11], pattern)
    wait("discrete inputs", lambda: client.read_discrete_inputs(101, count=11).bits[:11], pattern)
    check("mask", client.mask_write_register(address=2, and_mask=0xF2, or_mask=0x25).isError(), False)
    check("masked", client.read_holding_registers(2, count=1).registers, [(7 & 0xF2) | (0x25 & ~0xF2)])
    both = client.readwrite_registers(
        read_address=3, read_count=4, write_address=4, values=[11, 12])
    check("read and write", both.registers, [0, 11, 12, both.registers[3]])
    identity = client.read_device_information(read_code=1).information
    check("identity", identity, {0: b"tickbus", 1: b"Cell 4", 2: b""})
    one = client.read_device_information(read_code=4, object_id=1).information
    check("one object", one, {1: b"Cell 4"})


def refusals(client):
    """Requests that the standard refuses, and their exceptions."""
    refused("holding beyond", client.read_holding_registers(31, count=2), 2)
    refused("input beyond", client.read_input_registers(32, count=1), 2)
    refused("coils beyond", client.read_coils(505, count=8), 2)
    refused("discrete beyond", client.read_discrete_inputs(512, count=1), 2)
    refused("last address", client.read_holding_registers(65535, count=1), 2)
    refused("write beyond", client.write_registers(31, [1, 2]), 2)
    refused("coil beyond", client.write_coil(512, True), 2)
    refused("mask beyond", client.mask_write_register(address=32), 2)
    refused("function 7", client.read_exception_status(), 1)
    if sys.argv[1] in ("tcp", "udp"):
        refused("function 8", client.diag_query_data(b"\0\0"), 1)
    refused("function 17", client.report_device_id(), 1)
    refused("function 24", client.read_fifo_queue(address=0), 1)
    refused("object", client.read_device_information(read_code=4, object_id=9), 2)
    check("nothing was written", client.read_holding_registers(31, count=1).registers, [0x8201])


def diagnostics(client):
    """Counters and events, which servers on serial lines have."""
    check("query", client.diag_query_data(b"\xa5\x37").message, b"\xa5\x37")
    check("clear", client.diag_clear_counters().isError(), False)
    check("bus messages", client.diag_read_bus_message_count().message, 1)
    refused("a coil beyond", client.read_coils(512, count=1), 2)
    check("exceptions", client.diag_read_bus_exception_error_count().message, 1)
    check("messages", client.diag_read_device_message_count().message, 4)
    check("damaged", client.diag_read_bus_comm_error_count().message, 0)
    check("overruns", client.diag_read_bus_char_overrun_count().message, 0)
    check("busy", client.diag_read_device_busy_count().message, 0)
    check("register", client.diag_read_diagnostic_register().message, 0)
    counter = client.diag_get_comm_event_counter()
    check("events", (counter.isError(), counter.count), (False, 7))
    # Neither has an answer: the unit only listens, and a restart ends that.
    client.diag_force_listen_only(no_response_expected=True)
    # Only silence ends a telegram of RTU.
    time.sleep(0.3)
    client.diag_restart_communication(0, no_response_expected=True)
    time.sleep(0.3)
    check("it answers again", client.read_coils(0, count=1).isError(), False)
    check("no responses", client.diag_read_device_no_response_count().message, 0)
    log = client.diag_get_comm_event_log()
    check("log", (log.event_count, log.message_count, log.events[:6]), (2, 3, [0x80, 0x40, 0x80, 0x40, 0x80, 0x00]))
    check("overrun", client.diag_clear_overrun_counter().isError(), False)


def floats(client):
    """REALs in the word orders that pymodbus knows."""
    kind = client.DATATYPE.FLOAT32
    registers = client.convert_to_registers(1234.5, kind, word_order="big")
    client.write_registers(10, registers)
    registers = client.convert_to_registers(-0.125, kind, word_order="little")
    client.write_registers(12, registers)


def main():
    if sys.argv[1] in ("tcp", "udp"):
        kind = ModbusTcpClient if sys.argv[1] == "tcp" else ModbusUdpClient
        client = kind(sys.argv[2], port=int(sys.argv[3]), retries=0)
        check("connect", client.connect(), True)
        for unit in (0, 1, 17, 255):
            given = client.read_holding_registers(0, count=1, device_id=unit)
            check(f"unit {unit}", (given.isError(), given.dev_id), (False, unit))
    else:
        if sys.argv[1] == "rtu":
            client = ModbusSerialClient(sys.argv[2], baudrate=115200, parity="N", stopbits=1, retries=0)
        elif sys.argv[1] == "ascii":
            # A pseudo-terminal has no characters of seven bits, and no parity.
            client = ModbusSerialClient(
                sys.argv[2], framer=FramerType.ASCII, baudrate=115200, retries=0)
        else:
            client = ModbusTcpClient(sys.argv[2], port=int(sys.argv[3]), framer=FramerType.RTU, retries=0)
        check("open", client.connect(), True)
        client.write_register(20, 4711, device_id=0, no_response_expected=True)
        # The turnaround delay that the specification asks of a client after a broadcast, 100 to 200 ms, and more for a
        # server that an emulator runs.
        time.sleep(0.5)
        check("broadcast", client.read_holding_registers(20, count=1).registers, [4711])
    functions(client)
    refusals(client)
    if sys.argv[1] not in ("tcp", "udp"):
        diagnostics(client)
    floats(client)
    client.close()
    print(f"modbus_client: ok checks={checks}")


main()
