"""The types, checked by mypy."""

import sys
from pathlib import Path

import pytest

import tickbus

SIMULATION = """
from pathlib import Path
import tickbus
from tickbus.testing import Plc, on, s

with tickbus.open(Path("tank.cfg"), {"fieldbus": {"kind": "loopback"}}) as plc:
    status: tickbus.Status = plc.receive(0.5)
    level: tickbus.Signal = plc["Level"]
    level.value = level.value + 1
    plc.send()
    view: memoryview[float] = plc.slots
    plc.exchange(ns=3)
with tickbus.open_vector("tank.cfg", 4, lambda place: {"fieldbus": {"kind": "mailbox"}}) as plcs:
    failed: int = plcs.exchange([0.5] * 4) + plcs.receive(ns=3) + plcs.reset([True] * 4)
    column: int = plcs.signal("Level").slot
    first: tickbus.Driver = plcs[0]
    codes: memoryview[int] = plcs.statuses

def test(plc: Plc) -> None:
    ticks: int = plc.await_(on("Run")).within(3, s)
"""

WRONG = """
import tickbus

plc = tickbus.open(3)
plc["Level"].value = "high"
plc.exchange("now")
plc["Level"].vaule
plc.inject(3)
"""


def mypy(*arguments: str) -> tuple[str, int]:
    api = pytest.importorskip("mypy.api", reason="there is no mypy")
    told, _, code = api.run([*arguments, "--no-incremental", "--cache-dir=/dev/null"])
    return told, code


def test_the_package_and_a_simulation_have_right_types(tmp_path: Path) -> None:
    simulation, wrong = tmp_path / "simulation.py", tmp_path / "wrong.py"
    simulation.write_text(SIMULATION)
    wrong.write_text(WRONG)
    told, _ = mypy("--strict", "--python-executable", sys.executable, str(simulation), str(wrong), str(Path(tickbus.__file__).parent))
    lines = [line for line in told.splitlines() if ": error: " in line]
    assert [line.split(":")[1] for line in lines] == ["4", "5", "6", "7", "8"], told
    assert all("wrong.py" in line for line in lines), told
