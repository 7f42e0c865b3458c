"""Your simulated machine, on the PLC's fieldbus.

``open`` a driver.cfg, take its signals by name, and exchange at every step of your simulation::

    import tickbus

    with tickbus.open("tank.cfg") as plc:
        valve, level = plc["Valve"], plc["Level"]
        mm = 100.0
        for turn in plc.every("10ms"):          # by the computer's clock
            plc.receive(turn.time)              # Status.FRESH, UNCHANGED or STALE
            mm += 2 if valve.value else -1      # your machine
            level.value = mm
            plc.send()

Directions are the PLC's: a simulated machine writes ``%I`` and reads ``%Q``. ``tickbus.testing`` tests PLC programs with pytest.
"""

from ._driver import Driver, Fault, Turn, open, report
from ._errors import FieldbusError, MissingFileError, UnknownSignalError
from ._native import Event, Signal, __version__
from ._status import Status
from ._vector import DriverVector, open_vector

__all__ = [
    "Driver",
    "DriverVector",
    "Event",
    "Fault",
    "FieldbusError",
    "MissingFileError",
    "Signal",
    "Status",
    "Turn",
    "UnknownSignalError",
    "__version__",
    "open",
    "open_vector",
    "report",
]
