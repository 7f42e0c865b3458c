#!/usr/bin/env python3
"""A PLC for the conveyor, in ladder: the soft PLC pyrung, as a Modbus client.

    conveyor_plc.py --address 127.0.0.1:1502

When a box interrupts the light barrier, the belt stops, and the pusher pushes the box into the bin.
The machine's %I are input register 0, its %Q holding register 0. Runs until a signal ends it.
"""

import argparse
import signal
import time

from pyrung import (
    PLC,
    Block,
    Bool,
    Int,
    ModbusAddress,
    ModbusTcpTarget,
    Program,
    RegisterType,
    TagType,
    latch,
    out,
    pack_bits,
    receive,
    reset,
    rung,
    send,
    unpack_to_bits,
)

SCAN = 0.010

Told, Say = Block("Told", TagType.WORD, 1, 1), Block("Say", TagType.WORD, 1, 1)
# Bit n of a register is number n + 1 of its block.
Inputs, Outputs = Block("Inputs", TagType.BOOL, 1, 16), Block("Outputs", TagType.BOOL, 1, 16)
Barrier, IsHome, IsOut = Inputs[1], Inputs[2], Inputs[3]
BeltRun, PusherOut = Outputs[1], Outputs[2]

Reading, Read, ReadFailed, ReadCode = Bool("Reading"), Bool("Read"), Bool("ReadFailed"), Int("ReadCode")
Writing, Written, WriteFailed, WriteCode = Bool("Writing"), Bool("Written"), Bool("WriteFailed"), Int("WriteCode")
Heard, Pushing, Returning = Bool("Heard"), Bool("Pushing"), Bool("Returning")


def ladder(machine):
    """The program."""
    with rung():
        receive(target=machine, remote_start=ModbusAddress(0, RegisterType.INPUT), dest=Told.select(1, 1),
                receiving=Reading, success=Read, error=ReadFailed, exception_response=ReadCode)
    with rung():
        unpack_to_bits(Told[1], Inputs.select(1, 16))
    with rung(Read):
        latch(Heard)
    # Interrupted: there is a box before the pusher.
    with rung(Heard, ~Barrier, ~Pushing, ~Returning):
        latch(Pushing)
    with rung(Pushing, IsOut):
        reset(Pushing)
        latch(Returning)
    with rung(Returning, IsHome):
        reset(Returning)
    with rung(Pushing):
        out(PusherOut)
    with rung(Heard, IsHome, ~Pushing, ~Returning):
        out(BeltRun)
    with rung():
        pack_bits(Outputs.select(1, 16), Say[1])
    with rung(Heard):
        send(target=machine, remote_start=ModbusAddress(0), source=Say.select(1, 1),
             sending=Writing, success=Written, error=WriteFailed, exception_response=WriteCode)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--address", default="127.0.0.1:1502", help="where the machine listens")
    host, port = parser.parse_args().address.rsplit(":", 1)
    with Program() as logic:
        ladder(ModbusTcpTarget("machine", host.strip("[]"), int(port)))
    plc = PLC(logic, realtime=True, history=1000, cache=100)
    ends = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ends.append(True))
    due = time.monotonic()
    while not ends:
        plc.step()
        due = max(due + SCAN, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    main()
