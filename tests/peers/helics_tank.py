#!/usr/bin/env python3
"""A tank as a federate of HELICS, with the broker of the federation in its process.

helics_tank.py STEPS SECONDS [TYPE]

The first line has the port of the broker. At each time, the tank reads "plc/valve" and "plc/speed", and publishes its
level, the sum of the speeds as a TYPE (int), and whether it is full. It leaves after STEPS steps of SECONDS.
"""

import socket
import sys

import helics as h

CORE = "tcpss"


def main():
    steps, seconds = int(sys.argv[1]), float(sys.argv[2])
    kind = {"int": h.HELICS_DATA_TYPE_INT, "string": h.HELICS_DATA_TYPE_STRING}[sys.argv[3] if len(sys.argv) > 3 else "int"]
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    broker = h.helicsCreateBroker(CORE, "", f"--federates=2 --port={port} --loglevel=none")
    print(port, flush=True)
    info = h.helicsCreateFederateInfo()
    h.helicsFederateInfoSetCoreTypeFromString(info, CORE)
    h.helicsFederateInfoSetCoreInitString(
        info, f"--federates=1 --broker_address=127.0.0.1 --brokerport={port} --loglevel=none"
    )
    # Values that arrive do not end a request before its time.
    h.helicsFederateInfoSetFlagOption(info, h.HELICS_FLAG_UNINTERRUPTIBLE, True)
    tank = h.helicsCreateValueFederate("tank", info)
    level_out = h.helicsFederateRegisterGlobalPublication(tank, "tank/level", h.HELICS_DATA_TYPE_DOUBLE, "")
    sum_out = h.helicsFederateRegisterGlobalPublication(tank, "tank/sum", kind, "")
    full_out = h.helicsFederateRegisterGlobalPublication(tank, "tank/full", h.HELICS_DATA_TYPE_BOOLEAN, "")
    valve = h.helicsFederateRegisterSubscription(tank, "plc/valve", "")
    speed = h.helicsFederateRegisterSubscription(tank, "plc/speed", "")
    level, total = 0.5, 0
    try:
        h.helicsFederateEnterExecutingMode(tank)
        for step in range(steps):
            level += 0.002 if h.helicsInputGetBoolean(valve) else -0.001
            total += h.helicsInputGetInteger(speed)
            h.helicsPublicationPublishDouble(level_out, level)
            h.helicsPublicationPublishInteger(sum_out, total)
            h.helicsPublicationPublishBoolean(full_out, level > 0.6)
            wanted = (step + 1) * seconds
            granted = h.helicsFederateRequestTime(tank, wanted)
            if abs(granted - wanted) > 1e-10:
                sys.exit(f"helics_tank: granted {granted} for {wanted}")
        h.helicsFederateDisconnect(tank)
        print(f"left level={level!r} sum={total}", flush=True)
    except h.HelicsException as ended:
        print(f"ended: {ended}", flush=True)
    h.helicsBrokerDisconnect(broker)
    h.helicsCloseLibrary()


main()
