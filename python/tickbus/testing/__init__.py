"""Tests of PLC programs: the program and a model of the machine, tick by tick, on simulation time.

The plug-in for pytest comes with tickbus, and passes a ``Plc`` to tests as the fixture ``plc``::

    import pytest
    from tickbus.testing import off, on

    pytestmark = pytest.mark.plc(config="driver.cfg", program="rig", step="2ms", machine=Cell)

    def test_start_begins_a_run(plc):
        plc.await_(on("Ready lamp")).within("25s")
        plc.press("Start button")
        plc.await_(on("Running lamp")).within(40)
"""

from .._durations import minutes, ms, s, ticks
from ._conditions import Condition, above, below, falls, is_, near, nothing_swallowed, off, on, rises, when
from ._plc import Await, Expectation, Machine, Plc
from ._sweep import sweep

__all__ = [
    "Await",
    "Condition",
    "Expectation",
    "Machine",
    "Plc",
    "above",
    "below",
    "falls",
    "is_",
    "minutes",
    "ms",
    "near",
    "nothing_swallowed",
    "off",
    "on",
    "rises",
    "s",
    "sweep",
    "ticks",
    "when",
]
