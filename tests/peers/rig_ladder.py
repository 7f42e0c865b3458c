#!/usr/bin/env python3
"""The rig's program in ladder, run by the soft PLC pyrung as a Modbus client.

    rig_ladder.py --address 127.0.0.1:1502

crates/machines/programs/src/rig/mod.rs describes the program, and docs/ARCHITECTURE.md why it also exists in ladder. The PLC reads
the machine's %I as input registers 0 to 3 and writes its %Q as holding registers 0 to 3: with kind = "modbus-server",
driver.cfg needs no other change. It runs until a signal ends it, and prints each change of its phase to standard output.
"""

import argparse
import signal
import sys
import time

from pyrung import (
    And,
    Bool,
    Block,
    Int,
    ModbusAddress,
    ModbusTcpTarget,
    Or,
    PLC,
    Program,
    RegisterType,
    Timer,
    TagType,
    branch,
    calc,
    copy,
    latch,
    on_delay,
    out,
    pack_bits,
    receive,
    reset,
    rise,
    rung,
    send,
    system,
    unpack_to_bits,
)

SCAN = 0.010

INITIALISE, HOME, READY, RUN, ABORT, RECOVER, FINALISE, PARKED = range(8)
PHASES = ["initialise", "home", "ready", "run", "abort", "recover", "finalise", "parked"]

IDLE, ACKNOWLEDGE, CLEAR, LIFTS, LET_GO, WHEELS, FETCH, BRING, DONE, FAILED = range(10)

# The command word of each step of the cycle.
WORDS = [0x0001, 0x0024, 0x000C, 0x0080, 0x3C34, 0x343C]

# For the phases with a lamp: the lamp's bit in the high byte of the register, the phase in its low byte.
LAMPS = {READY: 0x0100, RUN: 0x0200, ABORT: 0x0400, PARKED: 0x0800}

# Registers of the machine: its feedback, and its commands.
Told = Block("Told", TagType.WORD, 1, 4)
Say = Block("Say", TagType.WORD, 1, 4)
# Bit n of a register is number n + 1 of its block.
Status = Block("Status", TagType.BOOL, 1, 16)
Panel = Block("Panel", TagType.BOOL, 1, 16)
Pattern = Block("Pattern", TagType.BOOL, 1, 16)
Command = Block("Command", TagType.BOOL, 1, 16)

Complete = [Status[number] for number in range(1, 7)]
Package1, Package2, Home1, Home2, NotOk = (Status[number] for number in range(12, 17))
Start, Stop, Reset, Bottom1, Bottom2 = (Panel[number] for number in range(9, 14))
# Bits of the command word.
IM1_INDEX, IM1_JOG, LA1_RUN, LA1_LOW, LA1_HIGH, SC1 = range(1, 7)
IM2_INDEX, IM2_JOG = 8, 9
LA2_RUN, LA2_UP, SC2, LAMP = range(11, 15)
ACK = 16

Reading, Read, ReadFailed = Bool("Reading"), Bool("Read"), Bool("ReadFailed")
Writing, Written, WriteFailed = Bool("Writing"), Bool("Written"), Bool("WriteFailed")
ReadCode, WriteCode = Int("ReadCode"), Int("WriteCode")

Phase, Next, Homing, HomingWas = Int("Phase"), Int("Next"), Int("Homing"), Int("HomingWas")
Step, Cycles = Int("Step"), Int("Cycles")
Heard, Alive, AtBottom, Running, Homes = Bool("Heard"), Bool("Alive"), Bool("AtBottom"), Bool("Running"), Bool("Homes")
StepDone, CycleDone, Jam = Bool("StepDone"), Bool("CycleDone"), Bool("Jam")
Jogged, Fetches, Unreferenced, Settled = Bool("Jogged"), Bool("Fetches"), Bool("Unreferenced"), Bool("Settled")
Lower1, Lower2, Held1, Held2 = Bool("Lower1"), Bool("Lower2"), Bool("Held1"), Bool("Held2")
StopWanted, WasRunning, FaultStands = Bool("StopWanted"), Bool("WasRunning"), Bool("FaultStands")

Silence, Overdue, Beam1, Beam2 = (Timer.clone(name) for name in ["Silence", "Overdue", "Beam1", "Beam2"])
AckTime, ClearTime, LiftsTime, Landed = (Timer.clone(name) for name in ["AckTime", "ClearTime", "LiftsTime", "Landed"])
LetGoTime, WheelsTime, Centred, Crept = (Timer.clone(name) for name in ["LetGoTime", "WheelsTime", "Centred", "Crept"])
FetchTime, BringTime, Brought = (Timer.clone(name) for name in ["FetchTime", "BringTime", "Brought"])


def from_machine(machine):
    with rung():
        receive(target=machine, remote_start=ModbusAddress(0, RegisterType.INPUT), dest=Told.select(1, 4),
                receiving=Reading, success=Read, error=ReadFailed, exception_response=ReadCode)
    with rung():
        unpack_to_bits(Told[1], Status.select(1, 16))
        unpack_to_bits(Told[2], Panel.select(1, 16))
    with rung(Read):
        latch(Heard)
    with rung(~Read):
        on_delay(Silence, 500)
    with rung(Heard, ~Silence.Done):
        out(Alive)
    with rung(Bottom1, Bottom2):
        out(AtBottom)


def cycle():
    with rung(Phase == RUN):
        out(Running)
    with rung(~Running):
        copy(1, Step)
    # The step's own "complete" turns the drum; in the scan after that the next step is the active one.
    with rung(Running, Or(*(And(Step == number + 1, complete) for number, complete in enumerate(Complete)))):
        out(StepDone)
    with rung(StepDone, Step == 6):
        out(CycleDone)
    with rung(StepDone):
        calc(Step + 1, Step)
    with rung(CycleDone):
        copy(1, Step)
        calc(Cycles + 1, Cycles)
    for number, word in enumerate(WORDS):
        with rung(Step == number + 1):
            copy(word, Say[1])
    with rung():
        unpack_to_bits(Say[1], Pattern.select(1, 16))
    with rung(Running, ~StepDone):
        on_delay(Overdue, 5000)
    # A beam that is interrupted for longer than this is a jam.
    with rung(Running, Package1):
        on_delay(Beam1, 1500)
    with rung(Running, Package2):
        on_delay(Beam2, 1500)
    with rung(Or(Beam1.Done, Beam2.Done)):
        out(Jam)


def homing():
    with rung():
        copy(Homing, HomingWas)
    with rung(Homing == WHEELS, Or(~Home1, ~Home2)):
        latch(Jogged)
    for condition, timer, milliseconds in [
        (And(Homing == ACKNOWLEDGE), AckTime, 100),
        (And(Homing == CLEAR), ClearTime, 2000),
        (And(Homing == LIFTS), LiftsTime, 10000),
        (And(Homing == LIFTS, AtBottom), Landed, 300),
        (And(Homing == LET_GO), LetGoTime, 1000),
        (And(Homing == WHEELS), WheelsTime, 10000),
        (And(Homing == WHEELS, Home1, Home2), Centred, 300),
        (And(Homing == WHEELS, Home1, Home2), Crept, 1500),
        (And(Homing == FETCH), FetchTime, 5000),
        (And(Homing == BRING), BringTime, 5000),
        (And(Homing == BRING, Bottom1), Brought, 300),
    ]:
        with rung(condition):
            on_delay(timer, milliseconds)
    # A wheel that was jogged creeps onto its index position: longer if lift 1 goes through the wheels next.
    with rung(Centred.Done, Or(~Jogged, ~Fetches, Crept.Done)):
        out(Settled)

    def goes(before, after, *conditions):
        # The first rung whose conditions hold decides.
        with rung(HomingWas == before, Homing == before, *conditions):
            copy(after, Homing)

    goes(ACKNOWLEDGE, CLEAR, AckTime.Done)
    goes(CLEAR, LIFTS, ~NotOk)
    goes(CLEAR, FAILED, ClearTime.Done)
    goes(LIFTS, FAILED, NotOk, Unreferenced)
    # A referenced drive at rest in mid-path refuses to go further than its bottom stop. Acknowledging clears its reference,
    # and then it makes a reference run.
    goes(LIFTS, ACKNOWLEDGE, NotOk)
    with rung(HomingWas == LIFTS, Homing == ACKNOWLEDGE):
        latch(Unreferenced)
    goes(LIFTS, LET_GO, Landed.Done)
    goes(LIFTS, FAILED, LiftsTime.Done)
    goes(LET_GO, FAILED, NotOk)
    goes(LET_GO, WHEELS, LetGoTime.Done)
    goes(WHEELS, FAILED, Or(NotOk, ~AtBottom))
    goes(WHEELS, FETCH, Settled, Fetches)
    goes(WHEELS, DONE, Settled)
    goes(WHEELS, FAILED, WheelsTime.Done)
    goes(FETCH, FAILED, NotOk)
    goes(FETCH, BRING, Complete[1])
    goes(FETCH, FAILED, FetchTime.Done)
    goes(BRING, FAILED, NotOk)
    goes(BRING, DONE, Brought.Done)
    goes(BRING, FAILED, BringTime.Done)
    # A lift that is already at its bottom is left alone. Any other keeps running after its switch, to the stop.
    with rung(Homing == LIFTS, Or(Lower1, ~Bottom1)):
        out(Lower1)
    with rung(Homing == LIFTS, Or(Lower2, ~Bottom2)):
        out(Lower2)


def phases():
    with rung():
        copy(Phase, Next)
    with rung(Alive, rise(Stop), Phase != PARKED):
        latch(StopWanted)
    with rung(Or(Phase == HOME, Phase == RECOVER, Phase == FINALISE)):
        out(Homes)

    def goes(before, after, *conditions):
        with rung(Alive, Phase == before, Next == before, *conditions):
            copy(after, Next)

    goes(INITIALISE, ABORT, FaultStands)
    goes(INITIALISE, HOME)
    for phase in [HOME, RECOVER, FINALISE]:
        goes(phase, ABORT, Homing == FAILED)
    goes(FINALISE, PARKED, Homing == DONE)
    for phase in [HOME, RECOVER]:
        goes(phase, FINALISE, Homing == DONE, StopWanted)
        goes(phase, RUN, Homing == DONE, WasRunning)
        goes(phase, READY, Homing == DONE)
    goes(READY, ABORT, NotOk)
    goes(READY, FINALISE, StopWanted)
    goes(READY, RUN, rise(Start))
    goes(RUN, ABORT, Or(NotOk, Jam, Overdue.Done))
    goes(RUN, FINALISE, CycleDone, StopWanted)
    goes(ABORT, RECOVER, rise(Reset))
    goes(PARKED, HOME, rise(Start))
    with rung(~Alive):
        copy(INITIALISE, Next)

    with rung(Next == RUN):
        latch(WasRunning)
    # Every turn needs both lifts at their bottom switches, except indexing wheel 2: it goes under lift 2.
    with rung(Next == RUN, Or(And(Step == 1, ~AtBottom), And(Step == 4, ~Bottom2))):
        copy(ABORT, Next)

    with rung(Next != Phase):
        copy(IDLE, Homing)
        reset(Lower1)
        reset(Lower2)
        with branch(Or(Next == HOME, Next == RECOVER)):
            reset(Unreferenced)
            latch(Fetches)
            reset(Jogged)
        with branch(Or(Next == HOME, Next == RECOVER), NotOk):
            latch(Unreferenced)
        with branch(Or(Next == RECOVER, And(Next == HOME, NotOk))):
            copy(ACKNOWLEDGE, Homing)
        with branch(Next == HOME, ~NotOk):
            copy(LIFTS, Homing)
        with branch(Next == ABORT):
            latch(FaultStands)
        with branch(Next == RECOVER):
            reset(FaultStands)
        with branch(Next == FINALISE):
            reset(WasRunning)
            copy(LIFTS, Homing)
            reset(Unreferenced)
            reset(Fetches)
            reset(Jogged)
        with branch(Next == PARKED):
            reset(StopWanted)
    with rung():
        copy(Next, Phase)


def to_machine(machine):
    with rung(Or(Phase == HOME, Phase == RECOVER, Phase == FINALISE)):
        out(Homes)
    with rung(Phase == RUN):
        out(Running)
    # A suction cup that holds something keeps holding it through abort and initialise, until the lifts are down. A program
    # that was just switched on assumes that both hold something.
    with rung(system.sys.first_scan):
        latch(Held1)
        latch(Held2)
    for held, bit in [(Held1, SC1), (Held2, SC2)]:
        with rung(Running, Pattern[bit]):
            latch(held)
        with rung(Or(And(Running, ~Pattern[bit]), Phase == READY, Phase == PARKED,
                     And(Homes, Or(Homing == LET_GO, Homing == WHEELS, Homing == DONE)))):
            reset(held)
    with rung(Homes, Or(Homing == FETCH, Homing == BRING)):
        latch(Held1)
        reset(Held2)
    lowers1 = And(Homes, Lower1)
    fetches, brings = And(Homes, Homing == FETCH), And(Homes, Homing == BRING)
    turns = And(Homes, Homing == WHEELS, AtBottom)
    for bit, other in {
        IM1_INDEX: None,
        IM1_JOG: And(turns, ~Home1),
        LA1_RUN: Or(lowers1, fetches, brings),
        LA1_LOW: Or(lowers1, brings),
        LA1_HIGH: Or(lowers1, brings),
        SC1: And(Held1),
        IM2_INDEX: None,
        IM2_JOG: And(turns, ~Home2),
        LA2_RUN: And(Homes, Lower2),
        LA2_UP: None,
        SC2: And(Held2),
        LAMP: None,
        ACK: And(Homes, Homing == ACKNOWLEDGE),
    }.items():
        pattern = And(Running, Pattern[bit])
        with rung(pattern if other is None else Or(pattern, other)):
            out(Command[bit])
    with rung():
        pack_bits(Command.select(1, 16), Say[1])
        copy(0, Say[3])
        copy(Cycles, Say[4])
    for phase in range(8):
        with rung(Phase == phase):
            copy(LAMPS.get(phase, 0) + phase, Say[2])
    with rung(Running):
        copy(Step, Say[3])
    # Command the machine only while its data are alive: without them the program sends nothing.
    with rung(Alive):
        send(target=machine, remote_start=ModbusAddress(0), source=Say.select(1, 4),
             sending=Writing, success=Written, error=WriteFailed, exception_response=WriteCode)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--address", default="127.0.0.1:1502", help="where the machine's driver listens")
    host, port = arguments.parse_args().address.rsplit(":", 1)
    machine = ModbusTcpTarget("machine", host.strip("[]"), int(port))
    with Program() as logic:
        from_machine(machine)
        cycle()
        homing()
        phases()
        to_machine(machine)
    plc = PLC(logic, realtime=True, history=1000, cache=100)
    ends = []
    for number in [signal.SIGINT, signal.SIGTERM]:
        signal.signal(number, lambda *_: ends.append(True))
    shown, due = None, time.monotonic()
    while not ends:
        tags = plc.step().tags
        now = (tags["Phase"], tags["Cycles"])
        if now != shown:
            shown = now
            print(f"rig_ladder: phase={PHASES[now[0]]} cycles={now[1]}", flush=True)
        due = max(due + SCAN, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
