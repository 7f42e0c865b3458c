"""Steps per second of an empty co-simulation in HELICS, over its default core (zmq), each federate a process.

helics_steps.py FEDERATES SECONDS prints one number.
"""

import multiprocessing
import sys
import time

import helics


def federate(name, seconds, answer):
    info = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
    helics.helicsFederateInfoSetCoreInitString(info, "--federates=1 --loglevel=no_print")
    helics.helicsFederateInfoSetTimeProperty(info, helics.helics_property_time_period, 1.0)
    # So that it waits for the others, as those in lock-step do, although there are no data.
    helics.helicsFederateInfoSetFlagOption(info, helics.helics_flag_uninterruptible, True)
    fed = helics.helicsCreateValueFederate(name, info)
    helics.helicsFederateRegisterGlobalPublication(fed, name, helics.helics_data_type_double, "")
    for other in names:
        if other != name:
            helics.helicsFederateRegisterSubscription(fed, other, "")
    helics.helicsFederateEnterExecutingMode(fed)
    steps, until = 0, None
    granted = 0.0
    # The first decides when it is enough; the limit is far enough ahead that none has passed it.
    while granted < limit.value:
        granted = helics.helicsFederateRequestTime(fed, granted + 1.0)
        if answer is not None:
            steps += 1
            now = time.perf_counter()
            if steps == 100:
                begun, until = now, now + seconds
            if until is not None and now >= until and limit.value > 1e9:
                answer.put((steps - 100) / (now - begun))
                limit.value = granted + 2000
    helics.helicsFederateDestroy(fed)


def main():
    global names, limit
    count, seconds = int(sys.argv[1]), float(sys.argv[2])
    names = [f"c{at}" for at in range(count)]
    limit = multiprocessing.Value("d", 1e12)
    answer = multiprocessing.Queue()
    context = multiprocessing.get_context("fork")
    children = [
        context.Process(target=federate, args=(name, seconds, answer if at == 0 else None))
        for at, name in enumerate(names)
    ]
    for child in children:
        child.start()
    # After the others were forked: the library has threads from now on.
    broker = helics.helicsCreateBroker("zmq", "lockstep", f"--federates={count} --loglevel=no_print")
    rate = answer.get(timeout=60)
    for child in children:
        child.join(timeout=30)
        if child.is_alive():
            child.kill()
    helics.helicsBrokerDisconnect(broker)
    helics.helicsCloseLibrary()
    print(f"{rate:.0f}")


if __name__ == "__main__":
    main()
