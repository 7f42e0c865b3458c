"""The same rig, the same PLC program and the same inputs give the same recording, byte for byte, through each door."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import tickbus

from conftest import root

DOORS = Path(__file__).with_name("doors")
TICKS = 5000

# In addition to the rig's signals, one of each other kind.
MORE = """
[[signal]]
name    = "scaled"
address = "%IW8"
type    = "INT"
scale   = { raw = [0, 27648], value = [0.0, 500.0] }

[[signal]]
name    = "real"
address = "%ID12"
type    = "REAL"

[[signal]]
name    = "whole"
address = "%IL16"
type    = "LINT"

[[signal]]
name    = "natural"
address = "%IL24"
"""


class Rig:
    """The rig's driver.cfg, and the folder of the recordings."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.config = folder / "driver.cfg"
        self.config.write_text(root("driver.cfg").read_text() + MORE)

    def tables(self, door: str) -> str:
        return (
            '[fieldbus]\nkind = "loopback"\nprogram = "rig"\nmode = "stepped"\nscan = "10ms"\n'
            f'[record]\nfile = "{self.folder / door}.vcd"\n'
        )

    def run(self, door: str, command: list[str | Path]) -> bytes:
        result = subprocess.run(
            [*command, self.config, self.tables(door), str(TICKS)],
            cwd=self.folder,
            capture_output=True,
            text=True,
            env=os.environ | {"LD_LIBRARY_PATH": str(root("target", "release"))},
        )
        assert result.returncode == 0, result.stderr
        return self.recording(door)

    def recording(self, door: str) -> bytes:
        return (self.folder / f"{door}.vcd").read_bytes()


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Rig:
    return Rig(tmp_path_factory.mktemp("doors"))


@pytest.fixture(scope="module")
def by_python(rig: Rig) -> bytes:
    """The recording of the run through Python."""
    mask = 2**64 - 1
    seed = 1
    with tickbus.open(rig.config, rig.tables("python")) as plc:
        written = [signal for signal in plc.signals if signal.is_written]
        for tick in range(1, TICKS + 1):
            if tick % 2:
                plc.receive(ns=tick * 2_000_000)
            for signal in written:
                seed = (seed * 6364136223846793005 + 1442695040888963407) & mask
                if seed >> 58:
                    continue
                if signal.is_integer_slot:
                    signal.value = seed - 2**64 if signal.type == "LINT" and seed >> 63 else seed
                elif signal.type == "BOOL":
                    signal.value = seed >> 40 & 1
                else:
                    signal.value = (seed >> 20 & 0xFFFFFF) / 16 - 1000
            if tick % 2:
                plc.send()
            else:
                plc.exchange(tick * 0.002)
    recording = rig.recording("python")
    # Enough to prove that the machine has moved.
    assert len(recording) > 100_000
    return recording


def library() -> Path:
    file = root("target", "release", "libtickbus.so")
    if not file.exists():
        pytest.skip("there is no target/release/libtickbus.so (tools/build makes it)")
    return file


def program(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"there is no {name}")
    return found


def test_a_run_through_c_leaves_the_same_recording(rig, by_python):
    command = [program("cc"), "-std=c99", "-O1", "-I", root("include"), DOORS / "doors.c", library(), "-o", rig.folder / "doors"]
    subprocess.run(command, check=True)
    assert rig.run("c", [rig.folder / "doors"]) == by_python


def test_a_run_through_java_leaves_the_same_recording(rig, by_python):
    jars = sorted(root("java", "tickbus", "target").glob("tickbus-[0-9].[0-9].[0-9].jar"))
    if not jars:
        pytest.skip("there is no tickbus.jar (tools/build makes it)")
    native = f"-Dtickbus.library={library()}"
    assert rig.run("java", [program("java"), native, "-cp", jars[0], DOORS / "Doors.java"]) == by_python


def compiled(folder: Path, source: Path) -> list[str | Path]:
    """The command of a program in C#."""
    mono = program("mono")
    file = folder / f"{source.stem}.exe"
    subprocess.run([program("mcs"), "-nologo", "-warnaserror", f"-out:{file}", source], check=True)
    return [mono, file]


def test_a_run_through_c_sharp_leaves_the_same_recording(rig, by_python):
    library()
    assert rig.run("csharp", compiled(rig.folder, DOORS / "Doors.cs")) == by_python


def test_the_example_in_c_sharp_runs_a_tank(tmp_path):
    library()
    config = tmp_path / "tank.cfg"
    text = root("examples", "tank.cfg").read_text()
    before, rest = text.split("[fieldbus]")
    signals = rest[rest.index("[[signal]]") :]
    config.write_text(f'{before}[fieldbus]\nkind = "loopback"\nprogram = "mirror"\nmode = "stepped"\n{signals}')
    command = compiled(tmp_path, root("examples", "csharp", "Tank.cs"))
    environment = os.environ | {"LD_LIBRARY_PATH": str(root("target", "release"))}
    result = subprocess.run([*command, config], capture_output=True, text=True, env=environment)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert len(lines) == 10
    # The mirror opens the valve below 150 mm, a scan later, so the level stays there.
    assert all(145 < float(line[3:].split()[0]) < 155 for line in lines[2:]), result.stdout
    result = subprocess.run([*command, "nothing.cfg"], cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert result.returncode == 1
    assert result.stderr.startswith("tank: BAD_CONFIG (-4): "), result.stderr
