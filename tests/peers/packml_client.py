"""Leads a machine through the states of PackML, by the names of OPC 30050 alone.

packml_client.py URL

Every node is found by browse names from the type PackMLBaseObjectType on; no node id of the machine is known here.
"""

import asyncio
import logging
import sys
import time

from asyncua import Client, ua

PACKML = "http://opcfoundation.org/UA/PackML/"
PATIENCE = 20
# Numbers of ISA-TR88.00.02.
STATES = (
    "Undefined Clearing Stopped Starting Idle Suspended Execute Stopping Aborting Aborted Holding Held Unholding "
    "Suspending Unsuspending Resetting Completing Complete"
).split()
# A command, and where it ends: each of the ten, and a stop in the middle.
COURSE = [
    ("Clear", "Stopped"), ("Reset", "Idle"), ("Start", "Execute"), ("Hold", "Held"), ("Unhold", "Execute"),
    ("Suspend", "Suspended"), ("Unsuspend", "Execute"), ("ToComplete", "Complete"), ("Reset", "Idle"),
    ("Start", "Execute"), ("Stop", "Stopped"), ("Abort", "Aborted"), ("Clear", "Stopped"),
]


async def machine_of(client, index):
    """The first object of the type."""
    for top in await client.nodes.objects.get_children():
        if await top.read_type_definition() == ua.NodeId(6, index):
            return top
    sys.exit("there is no machine of the type PackMLBaseObjectType")


async def until(what, read):
    limit = time.monotonic() + PATIENCE
    while not await read():
        if time.monotonic() > limit:
            sys.exit(f"in vain until {what}")


async def main():
    async with Client(sys.argv[1], timeout=10) as client:
        index = await client.get_namespace_index(PACKML)
        machine = await machine_of(client, index)

        def path(*names):
            return machine.get_child([name if ":" in name else f"{index}:{name}" for name in names])

        tag = await path("TagID")
        assert await tag.read_value() == "FIL1"
        top = await path("BaseStateMachine")
        middle = await path("BaseStateMachine", "MachineState")
        inner = await path("BaseStateMachine", "MachineState", "ExecuteState")
        number = await inner.get_child(["0:CurrentState", "0:Number"])
        speed, asked = await path("Status", "CurMachSpeed"), await path("Status", "MachSpeed")

        async def state():
            return STATES[await number.read_value()]

        async def ends(wanted):
            return await state() == wanted

        async def has_speed(wanted):
            return await speed.read_value() == wanted

        await until("it is aborted", lambda: ends("Aborted"))
        await asked.write_value(ua.DataValue(ua.Variant(30.0, ua.VariantType.Float)))

        for command, wanted in COURSE:
            on = {"Abort": top, "Clear": top, "Stop": middle}.get(command, inner)
            if command == "Reset" and await ends("Stopped"):
                on = middle
            await on.call_method(f"{index}:{command}")
            await until(f"{command} ends in {wanted}", lambda: ends(wanted))
            if command == "Start":
                await until("it has its speed", lambda: has_speed(30.0))
        await until("it stands", lambda: has_speed(0.0))
        # A command that the state does not allow changes nothing.
        await inner.call_method(f"{index}:Start")
        await asyncio.sleep(0.2)
        assert await state() == "Stopped"
        refused = "nothing"
        try:
            await number.write_value(ua.DataValue(ua.Variant(6, ua.VariantType.UInt32)))
        except ua.UaStatusCodeError as error:
            refused = type(error).__name__
        assert refused == "BadUserAccessDenied", refused
    print(f"packml_client: ok commands={len(COURSE)}")


logging.disable(logging.CRITICAL)
asyncio.run(main())
