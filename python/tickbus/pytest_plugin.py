"""The plug-in for pytest: the fixtures ``plc`` and ``machine``, the mark ``plc``, and sweeps of faults.

The fixtures import the expensive modules, so that the plug-in costs nothing where no test uses it.
"""

from __future__ import annotations

import inspect
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
    from ._native import Sweep
    from .testing import Plc
    from .testing._sweep import Sweeping

_MARK = (
    "plc(config, program=None, options=None, scan=None, step='1ms', machine=None, recording='on failure'):"
    " the PLC under test: the plant's driver.cfg, the program at its other end, and the machine in front of it"
)
_SWEEP = "tickbus_sweep"
_SWEEP_MARK = f"{_SWEEP}(keys): tickbus.testing.sweep makes it"
_CELL = "_tickbus_cell"
"""The parameter of a run of a sweep."""
_SWEEPS = pytest.StashKey["list[Sweeping]"]()
_TOLD = pytest.StashKey["list[str]"]()
_ENDS = (pytest.fail.Exception, pytest.skip.Exception)
"""By these a scenario ends itself, beside assertions."""
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
    text = "accept all verdicts of the sweeps: write them to the files of accepted verdicts"
    group.addoption("--tickbus-accept", action="store_true", help=text)
    text = "of the sweeps make only the run with this name, or the runs whose names contain it"
    group.addoption("--tickbus-only", metavar="TEXT", default="", help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Registers the marks."""
    if config.getoption("--tickbus-accept") and config.getoption("dist", "no") != "no":
        raise pytest.UsageError("each process of pytest-xdist sees a part of the verdicts: accept them with -n 0")
    config.addinivalue_line("markers", _MARK)
    config.addinivalue_line("markers", _SWEEP_MARK)
    config.stash[_SWEEPS] = []
    config.stash[_TOLD] = []


@dataclass
class _Cell:
    """One run of a sweep; without a number, that without a fault."""

    sweep: Sweeping
    number: int | None = None
    failure: BaseException | None = None


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Makes a test of each run of a sweep. Which runs there are shows the one without a fault, which is made here."""
    mark = metafunc.definition.get_closest_marker(_SWEEP)
    if mark is None:
        return
    from .testing._sweep import Sweeping

    place = _Place(metafunc.definition)
    names = [place.path.stem, *([metafunc.cls.__name__] if metafunc.cls else []), metafunc.function.__name__]
    rewriting = metafunc.config.getoption("--tickbus-accept")
    node = metafunc.definition.nodeid
    sweeping = Sweeping(".".join(names), node, place.path.parent, mark.args[0], rewriting=rewriting)
    failure, chosen = None, []
    try:
        _survey(metafunc, place, sweeping)
        chosen = sweeping.chosen(metafunc.config.getoption("--tickbus-only"))
    except (Exception, *_ENDS) as error:
        failure = error
    metafunc.config.stash[_SWEEPS].append(sweeping)
    cells = [_Cell(sweeping, failure=failure), *(_Cell(sweeping, number) for number in chosen)]
    metafunc.fixturenames.append(_CELL)
    metafunc.parametrize(_CELL, cells, ids=["without a fault", *(sweeping.names[number] for number in chosen)])


def _survey(metafunc: pytest.Metafunc, place: _Place, sweeping: Sweeping) -> None:
    """The run without a fault."""
    import tickbus

    from .testing import Plc
    from .testing._sweep import Over

    wanted = set(inspect.signature(metafunc.function).parameters) - {"self"}
    if not wanted <= {"plc", "machine"}:
        others = ", ".join(sorted(wanted - {"plc", "machine"}))
        raise pytest.UsageError(f"a scenario that is swept takes plc and machine alone, and not {others}")
    own = {"plc", "machine", "_plc_bench"}
    for name, definitions in metafunc._arg2fixturedefs.items():
        if (name not in own or len(definitions) > 1) and own & set(definitions[-1].argnames):
            raise pytest.UsageError(f"the fixture {name} is no part of a scenario that is swept; do its work in the test")
    setup = _setup(place)
    if hasattr(setup["machine"], "step") and not isinstance(setup["machine"], type):
        raise pytest.UsageError("each run of a sweep has a new machine: name its class in the mark plc, machine=…, not an object")
    fresh = metafunc.cls() if metafunc.cls else None
    scenario = getattr(fresh, metafunc.function.__name__) if fresh else metafunc.function
    prepare = getattr(fresh, "setup_method", None)
    if prepare is not None:
        prepare(*[scenario][: len(inspect.signature(prepare).parameters)])
    quiet = {"record": {"file": "none.vcd", "when": "never"}}
    with tickbus.open(_config(setup["config"], place), quiet | _fieldbus(setup)) as driver:
        plc, machine = Plc(driver, setup["step"]), _made(setup["machine"])
        if machine is not None:
            plc.connect(machine)
        plc._run = sweeping.begin(driver, plc.step_ns, None)
        try:
            scenario(**{name: value for name, value in (("plc", plc), ("machine", machine)) if name in wanted})
        except Over:
            pass
        except (AssertionError, pytest.fail.Exception) as error:
            raise AssertionError(
                f"the scenario fails without a fault, so nothing was judged: {error}\nlet it pass as a test without @sweep first"
            ) from error
        else:
            with suppress(Over):
                plc._idle()
    sweeping.plan()


def _made(machine: Any) -> Any:
    return machine() if isinstance(machine, type) else machine


def _cell(item: pytest.Item) -> _Cell | None:
    """The run of a sweep that a test is."""
    callspec = getattr(item, "callspec", None)
    return callspec.params.get(_CELL) if callspec else None


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> object:
    """Makes a run of a sweep, and judges it."""
    cell = _cell(pyfuncitem)
    if cell is None:
        return None
    if cell.failure is not None:
        raise cell.failure
    if cell.number is None:
        return None
    from .testing._sweep import Over

    bench: Any = pyfuncitem.funcargs["_plc_bench"]
    plc = bench.plc
    wanted = inspect.signature(pyfuncitem.obj).parameters
    try:
        # Its own assertions do not count, either; the one that fails ends its actions.
        with suppress(AssertionError, *_ENDS):
            pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in wanted})
        plc._idle()
    except Over:
        pass
    cell.sweep.judge(cell.number)
    return True


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Accepts the verdicts of the sweeps, if that is wanted."""
    import tickbus

    if not session.config.getoption("--tickbus-accept"):
        return
    for sweeping in session.config.stash[_SWEEPS]:
        if not sweeping.names or sweeping.native is None:
            continue
        try:
            session.config.stash[_TOLD].append(f"accepted: {sweeping.native.accept()}")
        except tickbus.FieldbusError as error:
            session.config.stash[_TOLD].append(f"{sweeping.name}: {error}")
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Prints the matrices of the sweeps."""
    for sweeping in config.stash[_SWEEPS]:
        native = sweeping.native
        summary = native.summary() if native and sweeping.names else ""
        if native and summary and "runs=0 " not in summary:
            terminalreporter.section(f"sweep {sweeping.name}")
            terminalreporter.write(summary)
            page = _reports(config) / f"{sweeping.name}.html"
            if sweeping.has_failed:
                terminalreporter.write_line(_page(sweeping, native, page))
            else:
                # The page of an earlier run that has failed.
                with suppress(OSError):
                    page.unlink()
    for line in config.stash[_TOLD]:
        terminalreporter.write_line(line)


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


def _page(sweeping: Sweeping, native: Sweep, page: Path) -> str:
    """Writes the page of a sweep, and returns where it is."""
    import tickbus

    try:
        native.page(page, f'pytest "{sweeping.node}" --tickbus-only "{{}}"', sweeping.reports)
    except tickbus.FieldbusError as error:
        return f"no page: {error}"
    return f"page: {page}"


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

    place = _Place(request.node)
    setup = _setup(place)
    keep = _Keep(setup["recording"], request)
    config, fieldbus = _config(setup["config"], place), _fieldbus(setup)
    try:
        opened = tickbus.open(config, keep.table() | fieldbus)
    except tickbus.FieldbusError:
        keep.abandon()
        raise
    with opened as driver:
        bench = _Bench(Plc(driver, setup["step"]), _made(setup["machine"]), keep)
        if bench.machine is not None:
            bench.plc.connect(bench.machine)
        cell = _cell(request.node)
        if cell is not None and cell.number is not None:
            bench.plc._run = cell.sweep.begin(driver, bench.plc.step_ns, cell.number)
        yield bench
        unfinished = bench.plc._unfinished() if bench.failure is None else None
        statistics = driver.statistics()
    keep.finish(bench.failure or unfinished, statistics)
    if cell is not None and cell.number is not None and keep.page is not None:
        cell.sweep.reports[cell.number] = keep.page
    if unfinished is not None:
        _note(unfinished, f"the test stood at {bench.plc._where()}{keep.told()}")
        raise unfinished


class _Place:
    """Where a test is."""

    def __init__(self, node: pytest.Item) -> None:
        self.node, self.path, self.config = node, node.path, node.config


def _setup(place: _Place) -> dict[str, Any]:
    """The marks of the test, of its class and of its module together: the nearest one that has a key wins."""
    setup: dict[str, Any] = {"step": "1ms", "recording": "on failure"} | dict.fromkeys(("program", "options", "scan", "machine"))
    found: dict[str, Any] = {}
    for mark in place.node.iter_markers("plc"):
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


def _config(name: str | Path, place: _Place) -> Path:
    """The driver.cfg beside the test, or else relative to where pytest was started, or to its root folder."""
    folders = (place.path.parent, place.config.invocation_params.dir, place.config.rootpath)
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


def _reports(config: pytest.Config) -> Path:
    """The folder of recordings and pages."""
    return Path(config.getoption("--tickbus-reports") or config.rootpath / "tickbus-reports").resolve()


class _Keep:
    """Keeps the recording of a test."""

    def __init__(self, when: str, request: pytest.FixtureRequest) -> None:
        self._when = when
        self.page: Path | None = None
        """The page about the recording, once it is written."""
        self._title = request.node.name
        folder = _reports(request.config)
        name = re.sub(r"[^\w.\-]+", "-", request.node.nodeid.replace("::", ".").replace("/", ".")).strip("-")
        if len(os.fsencode(name)) > _LONGEST:
            name = f"{name[:40]}-{zlib.crc32(name.encode()):08x}"
        self._recording = folder / f"{name}.vcd"

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
            # The page is of an earlier run that has failed.
            self._recording.with_suffix(".html").unlink(missing_ok=True)
            self._drop()
            return
        texts = {"What failed": str(failure)} if failure is not None else {}
        try:
            self.page = Path(tickbus.report(self._recording, self._title, statistics, texts))
        except tickbus.FieldbusError as error:
            # The test's own failure matters more.
            warnings.warn(f"there is no page of the recording: {error}", stacklevel=1)
