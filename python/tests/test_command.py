"""The ``tickbus`` command of the wheel, as pip puts it on the PATH, and as ``python -m tickbus``."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import tickbus

SCRIPT = Path(sys.executable).with_name("tickbus.exe" if os.name == "nt" else "tickbus")

TANK = """
[driver]
id   = 1
name = "Tank"
[fieldbus]
kind = "modbus-server"
address = "127.0.0.1:0"
[[signal]]
name = "Valve"
address = "%QX0.0"
"""


@pytest.fixture(params=["module", "script"])
def command(request: pytest.FixtureRequest) -> Iterator[list[str]]:
    """The two ways to call it."""
    if request.param == "module":
        yield [sys.executable, "-m", "tickbus"]
    elif SCRIPT.exists():
        yield [str(SCRIPT)]
    else:
        pytest.skip("this environment has no scripts: tools/python installs the wheel without them")


def run(command: list[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*command, *arguments], capture_output=True, text=True, timeout=60, check=False)


def test_it_is_the_command_of_the_same_version(command: list[str]) -> None:
    assert run(command, "--version").stdout.startswith(f"tickbus {tickbus.__version__}")
    listed = json.loads(run(command, "machine", "list", "--json").stdout)
    assert "bottle-rig" in [machine["name"] for machine in listed["machines"]]


def test_its_exit_codes_are_those_of_the_command(command: list[str], tmp_path: Path) -> None:
    tank = tmp_path / "tank.cfg"
    tank.write_text(TANK)
    assert run(command, "check", str(tank)).returncode == 0
    assert run(command, "--help").returncode == 0
    tank.write_text(TANK.replace("modbus-server", "modbus-sever"))
    wrong = run(command, "check", str(tank))
    assert (wrong.returncode, wrong.stdout) == (1, "")
    assert 'did you mean "modbus-server"?' in wrong.stderr
    misspelt = run(command, "chek")
    assert misspelt.returncode == 2
    assert "check" in misspelt.stderr


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_machine_runs_and_ends_cleanly_by_a_signal(command: list[str], number: signal.Signals) -> None:
    ports = ["--address", "127.0.0.1:0", "--page", "127.0.0.1:0"]
    with subprocess.Popen([*command, "machine", "two-tanks", *ports], stdout=subprocess.PIPE, text=True) as machine:
        assert machine.stdout
        told = ""
        while "listening on 127.0.0.1:" not in told:
            line = machine.stdout.readline()
            assert line, told
            told += line
        assert re.search(r"page at http://127\.0\.0\.1:\d+/", told)
        machine.send_signal(number)
        told = machine.communicate(timeout=30)[0]
    assert machine.returncode == 0, told
    assert told.splitlines()[-1].startswith("machine: ok ")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals")
def test_ctrl_c_ends_a_command_that_does_not_wait_for_it(command: list[str]) -> None:
    # It reads the end of a pipe that nobody closes.
    with subprocess.Popen([*command, "import", "/dev/stdin"], stdin=subprocess.PIPE, stderr=subprocess.PIPE) as reading:
        with pytest.raises(subprocess.TimeoutExpired):
            reading.wait(1)
        reading.send_signal(signal.SIGINT)
        reading.communicate(timeout=30)
    assert reading.returncode in (-signal.SIGINT, 130)


def test_a_reader_that_is_gone_is_no_error(command: list[str]) -> None:
    run_and_close = f"{' '.join(map(repr, command))} --help | head -n 1"
    done = subprocess.run(["bash", "-c", run_and_close], capture_output=True, text=True, timeout=60, check=False)
    assert "Traceback" not in done.stderr
    assert done.stderr == ""


def test_new_writes_the_name_of_the_command_that_made_the_folder(command: list[str], tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    made = run(command, "new", str(folder), "--plc", "modbus", "--simulator", "python", "--address", "127.0.0.1:0")
    assert made.returncode == 0, made.stderr
    readme = (folder / "README.md").read_text()
    called = "tickbus" if command[-1] == "tickbus" else command[0]
    assert f"`{called} check driver.cfg`" in readme
    assert run(command, "check", str(folder / "driver.cfg")).returncode == 0
