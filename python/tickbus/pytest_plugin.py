"""The plug-in for pytest: the fixtures ``plc`` and ``machine``, and the mark ``plc``.

The fixtures import the expensive modules, so that the plug-in costs nothing where no test uses it.
"""

from __future__ import annotations

import os
import re
import warnings
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from .testing import Plc

_MARK = (
    "plc(config, program=None, options=None, scan=None, step='1ms', machine=None, recording='on failure'):"
    " the PLC under test: the plant's driver.cfg, the program at its other end, and the machine in front of it"
)
_KEYS = ("config", "program", "options", "scan", "step", "machine", "recording")
_RECORDING = ("on failure", "always", "never")
_LONGEST = 200
"""The greatest length of a recording's name without its suffix, in bytes; file systems allow 255."""
_ATTEMPTS = 100


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds the option for the folder of recordings."""
    group = parser.getgroup("tickbus")
    text = "folder for the recordings and pages of failed tests of PLC programs (default: tickbus-reports)"
    group.addoption("--tickbus-reports", metavar="DIR", help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Registers the mark."""
    config.addinivalue_line("markers", _MARK)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[Any]) -> Iterator[None]:
    """Adds to a failure the tick at which it happened, and the files that are kept."""
    bench = getattr(item, "funcargs", {}).get("_plc_bench")
    if bench is not None and call.when == "call" and call.excinfo and not call.excinfo.errisinstance(pytest.skip.Exception):
        bench.failure = call.excinfo.value
        _note(bench.failure, f"the test stood at {bench.plc._where()}{bench.keep.told()}")
    return (yield)


def _note(error: BaseException, text: str) -> None:
    """Adds a note to the exception; before Python 3.11 only pytest shows it."""
    error.__notes__ = [*getattr(error, "__notes__", []), text]


@dataclass
class _Bench:
    """Everything that a test runs on."""

    plc: Plc
    machine: Any
    keep: _Keep
    failure: BaseException | None = None


@pytest.fixture
def plc(_plc_bench: _Bench) -> Plc:
    """The PLC under test, at tick 0, as specified by the test's mark ``plc``."""
    return _plc_bench.plc


@pytest.fixture
def machine(_plc_bench: _Bench) -> Any:
    """The machine that the PLC controls."""
    if _plc_bench.machine is None:
        raise pytest.UsageError("the test's mark plc names no machine; write machine=… there")
    return _plc_bench.machine


@pytest.fixture
def _plc_bench(request: pytest.FixtureRequest) -> Iterator[_Bench]:
    import tickbus

    from .testing import Plc

    setup = _setup(request)
    keep = _Keep(setup["recording"], request)
    config, fieldbus = _config(setup["config"], request), _fieldbus(setup)
    try:
        opened = tickbus.open(config, keep.table() | fieldbus)
    except tickbus.FieldbusError:
        keep.abandon()
        raise
    with opened as driver:
        machine = setup["machine"]
        bench = _Bench(Plc(driver, setup["step"]), machine() if isinstance(machine, type) else machine, keep)
        if bench.machine is not None:
            bench.plc.connect(bench.machine)
        yield bench
        unfinished = bench.plc._unfinished() if bench.failure is None else None
        statistics = driver.statistics()
    keep.finish(bench.failure or unfinished, statistics)
    if unfinished is not None:
        _note(unfinished, f"the test stood at {bench.plc._where()}{keep.told()}")
        raise unfinished


def _setup(request: pytest.FixtureRequest) -> dict[str, Any]:
    """The marks of the test, of its class and of its module together: the nearest one that has a key wins."""
    setup: dict[str, Any] = {"step": "1ms", "recording": "on failure"} | dict.fromkeys(("program", "options", "scan", "machine"))
    found: dict[str, Any] = {}
    for mark in request.node.iter_markers("plc"):
        stated = dict(mark.kwargs)
        if len(mark.args) == 1:
            stated.setdefault("config", mark.args[0])
        elif mark.args:
            raise pytest.UsageError("@pytest.mark.plc: only the driver.cfg may stand without its name")
        for key, value in stated.items():
            if key not in _KEYS:
                raise pytest.UsageError(f"@pytest.mark.plc has no {key!r}; it has {', '.join(_KEYS)}")
            found.setdefault(key, value)
    if "config" not in found:
        raise pytest.UsageError(
            "the fixture plc needs a driver.cfg; write @pytest.mark.plc(config=\"driver.cfg\", …) on the test or its class,"
            " or pytestmark = pytest.mark.plc(…) in its module"
        )
    setup |= found
    if setup["recording"] not in _RECORDING:
        raise pytest.UsageError(f"recording={setup['recording']!r}; expected one of {', '.join(map(repr, _RECORDING))}")
    return setup


def _config(name: str | Path, request: pytest.FixtureRequest) -> Path:
    """The driver.cfg beside the test, or else relative to where pytest was started, or to its root folder."""
    folders = (request.path.parent, request.config.invocation_params.dir, request.config.rootpath)
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    places = ", ".join(str(folder / name) for folder in dict.fromkeys(folders))
    raise pytest.UsageError(f"@pytest.mark.plc(config={str(name)!r}): there is none of the files {places}")


def _fieldbus(setup: dict[str, Any]) -> dict[str, Any]:
    """The table that puts the program at the other end, whatever bus driver.cfg names."""
    program, options, scan = setup["program"], setup["options"], setup["scan"]
    if program is None:
        if options or scan:
            raise pytest.UsageError("@pytest.mark.plc: options and scan are of a program; name it: program=…")
        return {"fieldbus": {"mode": "stepped"}}
    table = {"kind": "loopback", "role": "device", "mode": "stepped", "program": str(program)}
    if re.search(r"[/\\]|\.(so|dll|dylib)$", str(program)):
        # driver.cfg can be elsewhere.
        table["program"] = str(Path(program).resolve())
    if scan is not None:
        table["scan"] = scan
    if options:
        return {"fieldbus": table | {"program_options": {key: str(value) for key, value in options.items()}}}
    return {"fieldbus": table}


class _Keep:
    """Keeps the recording of a test."""

    def __init__(self, when: str, request: pytest.FixtureRequest) -> None:
        self._when = when
        self._title = request.node.name
        folder = request.config.getoption("--tickbus-reports") or request.config.rootpath / "tickbus-reports"
        name = re.sub(r"[^\w.\-]+", "-", request.node.nodeid.replace("::", ".").replace("/", ".")).strip("-")
        if len(os.fsencode(name)) > _LONGEST:
            name = f"{name[:40]}-{zlib.crc32(name.encode()):08x}"
        self._recording = Path(folder).resolve() / f"{name}.vcd"

    def table(self) -> dict[str, Any]:
        """Replaces driver.cfg's own table: tests must not write to the plant's recording."""
        if self._when == "never":
            return {"record": {"file": "none.vcd", "when": "never"}}
        self._reserve()
        return {"record": {"file": self._recording}}

    def _reserve(self) -> None:
        """Creates the file. Another process of the same run that keeps nothing can remove its folder meanwhile."""
        for _ in range(_ATTEMPTS):
            with suppress(FileNotFoundError, FileExistsError):
                self._recording.parent.mkdir(parents=True, exist_ok=True)
                self._recording.touch()
                return
        self._recording.parent.mkdir(parents=True, exist_ok=True)

    def abandon(self) -> None:
        """The driver was not opened. Files of an earlier run stay."""
        with suppress(OSError):
            if self._recording.stat().st_size == 0:
                self._drop()

    def _drop(self) -> None:
        self._recording.unlink(missing_ok=True)
        # The folder stays if it is not empty.
        with suppress(OSError):
            self._recording.parent.rmdir()

    def told(self) -> str:
        """The recording's path, if the test has failed."""
        if self._when == "never":
            return ""
        return f"; recording: {self._recording}; report: {self._recording.with_suffix('.html')}"

    def finish(self, failure: BaseException | None, statistics: dict[str, str]) -> None:
        """Keeps or deletes the recording, after the driver is closed."""
        import tickbus

        if self._when == "never":
            return
        if failure is None and self._when != "always":
            self._drop()
            return
        texts = {"What failed": str(failure)} if failure is not None else {}
        try:
            tickbus.report(self._recording, self._title, statistics, texts)
        except tickbus.FieldbusError as error:
            # The test's own failure matters more.
            warnings.warn(f"there is no page of the recording: {error}", stacklevel=1)
