"""The storm: the built artefacts as ends of lines, from outside, under misfortunes that a seed draws. See README.md.

    storm.py [--minutes N] [--seed S] [--jobs N] [--product FOLDER] [--buses A,B] [--programs A,B]
    storm.py --line SEED ...      repeats one line, with its story
"""

import argparse
import collections
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from line import Artefacts, Line
from machine import has_namespaces
from plan import BUSES, PROGRAMS, draw

ROOT = Path(__file__).resolve().parents[2]

ENDINGS = (signal.SIGINT, signal.SIGTERM)


def options():
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--seed", default=str(int(time.time())))
    parser.add_argument("--jobs", type=int, default=max(1, os.cpu_count() or 1))
    parser.add_argument("--product", type=Path, default=ROOT)
    parser.add_argument("--out", type=Path, default=ROOT / "target/storm")
    parser.add_argument("--buses", default=",".join(BUSES))
    parser.add_argument("--programs", default=",".join(PROGRAMS))
    parser.add_argument("--without-opcua", help="programs whose library was built without it; found if not stated")
    parser.add_argument("--line")
    return parser.parse_args()


def one_line(given, seed, artefacts, namespaces):
    programs = [program for program in artefacts.programs if program in given.programs.split(",")]
    plan = draw(seed, programs, given.buses.split(","), given.without_opcua.split(","), namespaces)
    folder = given.out / seed
    print(plan, flush=True)
    result = Line(plan, artefacts, folder, namespaces).run()
    if not result["findings"]:
        shutil.rmtree(folder, ignore_errors=True)
    print(*(f"  {line}" for line in result["findings"]), sep="\n")
    Path(f"{folder}.json").write_text(json.dumps({"plan": str(plan), "names": plan.names(), **result}))


def command(given, seed):
    """The command that runs a line in a separate process: so it is measured separately, and can be repeated alone."""
    return [
        sys.executable, __file__, "--line", seed, "--product", str(given.product), "--out", str(given.out),
        "--buses", given.buses, "--programs", given.programs, "--without-opcua", given.without_opcua,
    ]


def storm(given):
    running = {}
    try:
        return storm_on(given, running)
    finally:
        # Ending a line also removes its network, its disk and its processes.
        for process in running.values():
            process.terminate()
        for process in running.values():
            process.wait()


def storm_on(given, running):
    print(f"storm: seed {given.seed}, {given.minutes:g} min, {given.jobs} lines at a time; kept: {given.out}")
    met, findings, totals = collections.Counter(), [], collections.Counter()
    began = minute = time.monotonic()
    number = 0
    while True:
        passed = time.monotonic() - began
        while len(running) < given.jobs and passed < given.minutes * 60:
            number += 1
            seed = f"{given.seed}.{number}"
            running[seed] = subprocess.Popen(command(given, seed), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for seed, process in list(running.items()):
            if process.poll() is None:
                continue
            del running[seed]
            _, trouble = process.communicate()
            told = given.out / f"{seed}.json"
            if process.returncode or not told.exists():
                findings.append(seed)
                print(f"FOUND {seed}: the storm itself failed\n{trouble}", flush=True)
                continue
            result = json.loads(told.read_text())
            told.unlink()
            totals.update({"lines": 1, "ticks": result["ticks"], **result["judged"]})
            ends, *others = result["names"]
            met.update((ends, other) for other in others or ["quiet"])
            if result["findings"]:
                findings.append(seed)
                print(f"FOUND {result['plan']}")
                print(*(f"  {line[:300]}" for line in result["findings"][:8]), sep="\n")
                print(f"  {len(result['findings'])} in all; again: {' '.join(command(given, seed)[1:])}", flush=True)
        if time.monotonic() - minute > 60 or not running:
            minute = time.monotonic()
            print(f"storm: {passed / 60:.0f} min, {dict(totals)}, {len(findings)} lines with findings", flush=True)
            if not running and passed >= given.minutes * 60:
                break
        time.sleep(0.1)
    table(met)
    print(f"storm: {'failed' if findings else 'ok'} seed={given.seed} lines={totals['lines']} findings={len(findings)}")
    return 1 if findings else 0


def table(met):
    """The combinations of ends with buses and misfortunes, in lines."""
    columns = sorted({column for _, column in met})
    rows = sorted({row for row, _ in met})
    print("".ljust(18) + " ".join(columns))
    for row in rows:
        print(row.ljust(18) + " ".join(str(met[row, column] or "-").rjust(len(column)) for column in columns))


def end(number, _):
    """Ends the storm: undoes its changes to the machine, undisturbed by a second signal."""
    for ending in ENDINGS:
        signal.signal(ending, signal.SIG_IGN)
    sys.exit(128 + number)


def main():
    for ending in ENDINGS:
        signal.signal(ending, end)
    given = options()
    given.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        artefacts = Artefacts(given.product, Path(folder))
        if given.without_opcua is None:
            given.without_opcua = ",".join(sorted(artefacts.without_opcua()))
        if given.line:
            one_line(given, given.line, artefacts, has_namespaces())
            return 0
        lacking = sorted(set(PROGRAMS) - set(artefacts.programs))
        for what, is_lacking in (
            (f"ends that are not built: {', '.join(lacking)}", lacking),
            (f"without OPC UA: {given.without_opcua}", given.without_opcua),
            ("this user may make no network namespaces here: nothing is cut off", not has_namespaces()),
        ):
            if is_lacking:
                print(f"storm: {what}")
        return storm(given)


if __name__ == "__main__":
    sys.exit(main())
