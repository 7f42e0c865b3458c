"""Fixtures and helpers shared by the tests."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import tickbus

pytest_plugins = ["pytester"]

ROOT = Path(__file__).resolve().parents[2]

SIGNALS = """
[[signal]]
name    = "Start"
address = "%IX0.0"
latch   = "rising"

[[signal]]
name    = "Height"
address = "%IW2"
type    = "INT"
unit    = "mm"
scale   = { raw = [0, 27648], value = [0.0, 500.0] }

[[signal]]
name    = "Parts"
address = "%IW4"

[[signal]]
name    = "whole"
address = "%IL8"
type    = "LINT"

[[signal]]
name    = "natural"
address = "%IL16"

[[signal]]
name    = "Run"
address = "%QX0.0"
latch   = "rising"

[[signal]]
name      = "Speed"
address   = "%QW2"
type      = "INT"
unit      = "mm"
scale     = { raw = [0, 27648], value = [0.0, 500.0] }
fail_safe = 7.5

[[signal]]
name    = "Parts back"
address = "%QW4"

[[signal]]
name    = "whole back"
address = "%QL8"
type    = "LINT"

[[signal]]
name    = "natural back"
address = "%QL16"
"""

MIRROR = """
[driver]
id   = 7
name = "Line"

[fieldbus]
kind    = "loopback"
program = "mirror"
mode    = "stepped"
scan    = "2ms"
"""


def root(*parts: str) -> Path:
    """A file of the project."""
    return ROOT.joinpath(*parts)


@pytest.fixture
def virtual_run(tmp_path: Path) -> Iterator[Callable[[int], Callable[..., Path]]]:
    """Starts a run of 200 ms on virtual time for a number of clients; makes a client's driver.cfg from its id and role."""
    command = root("target", "release", "tickbus")
    if not command.exists():
        pytest.skip("there is no target/release/tickbus")
    servers = []

    def start(clients: int) -> Callable[..., Path]:
        sync = tmp_path / "sync.toml"
        sync.write_text(f'[sync]\nstep = "2ms"\nclients = {clients}\nlisten = "127.0.0.1:0"\nuntil = "200ms"\n')
        servers.append(subprocess.Popen([command, "sync", sync], stdout=subprocess.PIPE, text=True))
        address = servers[-1].stdout.readline().split("listening on ")[1].strip()

        def cfg(number: int, role: str, signals: str = SIGNALS) -> Path:
            file = tmp_path / f"{role}.cfg"
            head = f'[driver]\nid = {number}\nname = "{role}"\n[fieldbus]\nkind = "sdsp"\naddress = "{address}"\nrole = "{role}"\n'
            file.write_text(head + signals)
            return file

        return cfg

    yield start
    for server in servers:
        server.terminate()
        server.communicate(timeout=30)


@pytest.fixture
def line_cfg(tmp_path: Path) -> Path:
    """A driver.cfg whose PLC copies every %I to the %Q of the same address."""
    file = tmp_path / "line.cfg"
    file.write_text(MIRROR + SIGNALS)
    return file


@pytest.fixture
def line(line_cfg: Path) -> Iterator[tickbus.Driver]:
    """The same driver, open."""
    with tickbus.open(line_cfg) as driver:
        yield driver


@pytest.fixture(autouse=True)
def no_unexpected_warning(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """As tools/test does for Java: states of a line and injected faults are expected, other warnings in the log are not."""
    yield
    told = capfd.readouterr()
    sys.stdout.write(told.out)
    sys.stderr.write(told.err)
    warnings = (line for line in told.err.splitlines() if re.search(r"^\[\S+ (WARN|ERROR) +tickbus", line))
    unexpected = [line for line in warnings if not re.search(r'" is (opening|stale|failed): |": injected fault "', line)]
    assert not unexpected


@pytest.fixture
def python(tmp_path: Path) -> Callable[..., Any]:
    """Runs a program in a separate Python process, which must not crash."""
    def run(program: str, *arguments: Any) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-X", "faulthandler", "-c", program, *map(str, arguments)]
        return subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, timeout=60, env=os.environ | {"TICKBUS_LOG": "warn"}
        )

    return run
