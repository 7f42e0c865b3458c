"""The worked examples, run with their programs: Gymnasium, MuJoCo, SimPy, and a third-party soft PLC."""

import os
import re
import subprocess
import sys
import threading
import zlib
from dataclasses import dataclass
from pathlib import Path

import pytest

from conftest import root

PYRUNG = root("target", "peers", "pyrung", "bin", "python")


@dataclass
class Run:
    """Runs the conveyor."""

    told: str
    picture: Path | None
    without_picture: str


def backend() -> tuple[str | None, str]:
    """Whether and how MuJoCo can draw without a display."""
    why = ""
    for name in ("egl", "osmesa"):
        probe = [sys.executable, "-c", "import mujoco; mujoco.GLContext(64, 64).make_current()"]
        result = subprocess.run(probe, env=os.environ | {"MUJOCO_GL": name}, capture_output=True, text=True)
        if result.returncode == 0:
            return name, ""
        why = (result.stderr.strip().splitlines() or ["it crashed"])[-1]
    return None, f"MuJoCo cannot draw without a display here (libegl1 with libgl1-mesa-dri, or libosmesa6): {why}"


@pytest.fixture(scope="module")
def conveyor(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """MuJoCo's conveyor driven by the PLC in ladder, over Modbus."""
    pytest.importorskip("mujoco", reason="there is no MuJoCo")
    if not PYRUNG.exists():
        pytest.skip("there is no pyrung (tools/peers installs it)")
    folder = tmp_path_factory.mktemp("conveyor")
    config = folder / "conveyor.cfg"
    config.write_text(root("examples", "mujoco", "conveyor.cfg").read_text().replace(":1502", ":0"))
    name, why = backend()
    picture = folder / "conveyor.png" if name else None
    command = [sys.executable, root("examples", "mujoco", "conveyor.py"), "--config", config, "--seconds", "60"]
    environment = os.environ | ({"MUJOCO_GL": name} if name else {})
    if picture:
        command += ["--picture", picture]
    simulation = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    giving_up = threading.Timer(120, simulation.kill)
    giving_up.start()
    plc = None
    try:
        address = simulation.stdout.readline().split("listening on ")[1].strip()
        ladder = [PYRUNG, root("examples", "mujoco", "conveyor_plc.py"), "--address", address]
        plc = subprocess.Popen(ladder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        told = simulation.stdout.read()
    finally:
        giving_up.cancel()
        for process in filter(None, (simulation, plc)):
            process.terminate()
            process.wait(30)
        simulation.stdout.close()
    return Run(told, picture, why)


def test_the_conveyor_of_mujoco_pushes_all_boxes_into_the_bin(conveyor):
    assert re.fullmatch(r"conveyor: ok boxes=3 of=3 seconds=\d+\.\d\n", conveyor.told), conveyor.told


def test_the_conveyor_is_drawn(conveyor):
    if conveyor.picture is None:
        pytest.skip(conveyor.without_picture)
    data = conveyor.picture.read_bytes()
    assert data.startswith(b"\x89PNG") and data[16:24] == bytes([0, 0, 3, 192, 0, 0, 2, 28])
    pixels = zlib.decompress(data[data.index(b"IDAT") + 4 : -16])
    # The bin is blue, the boxes are brown, the belt is dark.
    colours = {tuple(channel >> 5 for channel in pixels[at : at + 3]) for at in range(1, len(pixels) - 3, 999)}
    assert len(colours) > 10, colours


def test_the_buffer_of_simpy_is_kept_by_the_plc(tmp_path):
    pytest.importorskip("simpy", reason="there is no SimPy")

    def run(*more):
        command = [sys.executable, root("examples", "simpy", "buffer.py"), "--hours", "1", *more]
        result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        return result.stdout, dict(re.findall(r"(\w+)=([\d.]+)", result.stdout))

    told, numbers = run("--seed", "3")
    assert told.startswith("buffer: ok ")
    # One part is on its way when the buffer is full.
    assert int(numbers["longest"]) <= int(numbers["limit"]) + 1
    assert run("--seed", "3")[0] == told
    assert int(run("--seed", "3", "--without-plc")[1]["longest"]) > int(numbers["limit"]) + 1


def test_the_tanks_of_gymnasium_are_refilled_by_their_plcs(tmp_path):
    pytest.importorskip("gymnasium", reason="there is no Gymnasium")

    def run(*more):
        command = [sys.executable, "-W", "error", root("examples", "gymnasium", "tanks.py"), "--envs", "64", "--steps", "1500", *more]
        result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        assert result.stdout.startswith("tanks: ok envs=64 "), result.stdout
        return dict(re.findall(r"(episodes|reward)=([\d.-]+)", result.stdout))

    first = run()
    # Without its PLC a tank gives 350 mm at most.
    assert float(first["reward"]) > 1000
    assert int(first["episodes"]) == 64
    assert run() == first
    assert run("--seed", "2") != first


def test_the_machine_that_tickbus_new_writes_meets_its_plc(tmp_path: Path) -> None:
    """The PLC opens the valve, because the level is low at first."""
    command = root("target", "release", "tickbus")
    if not command.exists():
        pytest.skip("there is no target/release/tickbus")
    new = [command, "new", tmp_path / "m", "--plc", "none", "--simulator", "python"]
    subprocess.run(new, check=True, stdout=subprocess.DEVNULL)
    with subprocess.Popen([sys.executable, "machine.py"], cwd=tmp_path / "m", stdout=subprocess.PIPE, text=True) as machine:
        try:
            assert machine.stdout is not None
            assert any("valve True" in line for line in machine.stdout)
        finally:
            machine.kill()
