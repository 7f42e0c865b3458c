"""The tank of the README, with the package for Python as it is installed. Runs on any platform.

wheel.py README VERSION: opens the README's tank.cfg on virtual time, and fills the tank until its PLC closes the valve.
"""

import pathlib
import re
import struct
import sys
import tempfile

import tickbus

SCAN_SECONDS = 0.01
SECONDS = 20
OTHERS = (
    {"kind": "modbus-server", "address": "127.0.0.1:0"},
    {"kind": "opcua-client", "url": "opc.tcp://127.0.0.1:9", "node_pattern": "ns=1;s={name}"},
)


def tank_cfg(readme: pathlib.Path) -> str:
    """The tank.cfg of the README."""
    return re.search(r"```toml\n(.*?)```", readme.read_text(encoding="utf-8"), re.DOTALL)[1]


def lowest_and_highest(plc: tickbus.Driver) -> tuple[float, float]:
    """The level's limits in the second half of the run."""
    valve, low, level = plc["Valve"], plc["Level low"], plc["Level"]
    ticks = round(SECONDS / SCAN_SECONDS)
    mm, seen = 100.0, []
    for tick in range(ticks):
        plc.receive(tick * SCAN_SECONDS)
        mm += 2 if valve.value else -1
        low.value = mm < 150
        level.value = mm
        plc.send()
        if tick > ticks / 2:
            seen.append(level.value)
    return min(seen), max(seen)


def main(readme: str, version: str) -> None:
    """Fails if the tank is not kept at its level, or if a part of the extension module does not answer."""
    assert tickbus.__version__ == version, f"the version is {tickbus.__version__}, expected {version}"
    with tempfile.TemporaryDirectory() as folder:
        cfg = pathlib.Path(folder, "tank.cfg")
        cfg.write_text(tank_cfg(pathlib.Path(readme)), encoding="utf-8")
        recording = pathlib.Path(folder, "run.vcd")
        fieldbus = {"kind": "loopback", "program": "mirror", "mode": "stepped", "scan": "10ms"}
        with tickbus.open(cfg, {"fieldbus": fieldbus, "record": {"file": str(recording)}}) as plc:
            lowest, highest = lowest_and_highest(plc)
        assert 145 < lowest < 150 < highest < 155, f"the level was between {lowest} and {highest}"
        page = tickbus.report(recording)
        assert page.stat().st_size > 1000
        # A socket of the system; and OPC UA, which is built in only on request.
        for fieldbus in OTHERS:
            with tickbus.open(cfg, {"fieldbus": fieldbus}) as plc:
                plc.exchange()
    where = f"Python {sys.version.split()[0]}, {sys.platform}, {8 * struct.calcsize('P')} bit"
    print(f"wheel: ok version={tickbus.__version__} {where}: the level was between {lowest:.0f} and {highest:.0f} mm")


main(*sys.argv[1:])
