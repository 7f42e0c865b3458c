"""Builds tickbus with every mutation of mutants.toml as a switch, and runs simulated worlds until they find each of them.

With --random COUNT it changes that many random lines of image, fieldbus, driver and the buses (always the same ones), and
runs the tests of the crate on each change, those of the buses and of whole drivers, and then the worlds.
"""

import argparse
import functools
import json
import os
import shutil
import subprocess
import sys
import threading
import time
import tomllib
from pathlib import Path

import chance

HERE = Path(__file__).parent
ROOT = HERE.parents[3]
OUT = Path(os.environ.get("MUTANTS_OUT", ROOT / "target" / "mutants"))
TREE = OUT / "tree"
BUILT = OUT / "target"
PROFILE = ["--profile", "bench", "--config", "tests/profile.toml", "--config", "profile.bench.opt-level=1"]
SWITCH = """
/// Returns true if this run is that of the mutation with this number.
pub fn mutant(number: u32) -> bool {
    static CHOSEN: std::sync::LazyLock<u32> = std::sync::LazyLock::new(|| {
        std::env::var("TICKBUS_MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0)
    });
    *CHOSEN == number
}
"""
# Tests of whole drivers that need no program of a third party.
WHOLE = {"it": ["loopback::", "faults::", "record::", "ending::"], "log": [], "profibus": []}
# Crates whose lines are changed at random.
CRATES = ["image", "fieldbus", "driver", "bus-socket", "bus-modbus", "bus-s7", "bus-profibus"]
# Crates whose tests run if neither the tests above nor worlds have found a change.
FURTHER = ["axis", "binding", "bus-dispatcher", "bus-hilscher", "bus-interbus", "bus-plugin", "plc", "record"]


def write_tree(texts):
    """Copies the files tracked by git, with these changes. Unchanged files keep their times, and are not recompiled."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
    names = set(filter(None, listed.decode().split("\0")))
    for path in TREE.rglob("*.rs"):
        # Otherwise a module that has moved would exist twice.
        if str(path.relative_to(TREE)) not in names:
            path.unlink()
    for name in sorted(names):
        source, target = ROOT / name, TREE / name
        if not source.is_file():
            continue
        wanted = texts[name].encode() if name in texts else source.read_bytes()
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.exists() or target.read_bytes() != wanted:
            target.write_bytes(wanted)
            shutil.copymode(source, target)


def cargo(command, arguments):
    environment = dict(os.environ, CARGO_TARGET_DIR=str(BUILT), CARGO_INCREMENTAL="0")
    line = ["cargo", command, "--locked", *PROFILE, *arguments]
    return subprocess.run(line, cwd=TREE, env=environment, capture_output=True, text=True)


def put_back(mutants, texts):
    """Each mutation as a switch, numbered from 1."""
    stale = []
    for number, mutant in enumerate(mutants, 1):
        file = mutant["file"]
        text = texts.setdefault(file, (ROOT / file).read_text())
        if text.count(mutant["old"]) != 1:
            stale.append(f"{mutant['name']}: \"old\" occurs {text.count(mutant['old'])} times in {file}")
        new = mutant["new"].replace("MUTANT", f"tickbus_base::mutant({number})")
        texts[file] = text.replace(mutant["old"], new)
    if stale:
        sys.exit("mutants: change mutants.toml as the code has changed:\n" + "\n".join(stale))


def by_worlds(number, seconds):
    """Returns how long fresh worlds take to find a mutation, the promise that it breaks, and the seed. If only a rare world
    finds the mutation, the worlds of the corpus do, which make test also runs."""
    took, found, seed = fresh(number, seconds)
    return (took, found, seed) if found else corpus(number)


def fresh(number, seconds):
    """Returns how long fresh worlds take to find a mutation, the promise that it breaks, and the seed."""
    binary = BUILT / "release" / "worlds"
    begun = time.monotonic()
    process = subprocess.Popen(
        [binary, "100000", str(seconds)], env=chosen(number), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    # A mutation can make a thread run forever, so that no world ends.
    patience = threading.Timer(seconds + 60, process.kill)
    patience.start()
    promise, took, last = None, 0.0, ""
    for line in process.stdout:
        last = line
        if line.startswith("  seed"):
            seed = line.split(";")[0].split()[1]
            # A failure that also happens without the mutation does not count.
            if is_whole(binary, seed):
                patience.cancel()
                process.kill()
                process.wait()
                return took, promise, seed
            print(f"mutants: {seed} breaks a promise without any mutation", flush=True)
        elif not line.startswith((" ", "worlds=")):
            promise, took = line.split(":")[0], time.monotonic() - begun
    is_late = not patience.is_alive()
    patience.cancel()
    took = time.monotonic() - begun
    if process.wait() not in (0, 1):
        return took, "hangs" if is_late else "panics", ""
    return took, None, last.split()[0]


def corpus(number):
    """Like fresh(), with the worlds that once broke a promise."""
    begun = time.monotonic()
    seed = ""
    for seed in (HERE.parent / "corpus.txt").read_text().splitlines():
        if seed.startswith("#"):
            continue
        run = [BUILT / "release" / "worlds", seed]
        try:
            done = subprocess.run(run, env=chosen(number), capture_output=True, text=True, check=False, timeout=120)
        except subprocess.TimeoutExpired:
            return time.monotonic() - begun, "corpus: hangs", seed
        if done.returncode:
            verdict = [line for line in done.stdout.splitlines() if line.startswith("worlds: failed ")]
            promise = verdict[-1].split(": ")[1].split(" ", 2)[-1] if verdict else "panics"
            return time.monotonic() - begun, f"corpus: {promise}", seed
    return time.monotonic() - begun, None, seed


def chosen(number):
    return dict(os.environ, TICKBUS_MUTANT=str(number))


@functools.cache
def is_whole(binary, seed):
    return subprocess.run([binary, seed], env=chosen(0), capture_output=True, check=False).returncode == 0


def known(names, seconds):
    mutants = tomllib.loads((HERE / "mutants.toml").read_text())["mutant"]
    texts = {}
    put_back(mutants, texts)
    build(texts, ["-p", "tickbus-worlds"])
    left = []
    for number, mutant in enumerate(mutants, 1):
        if names and mutant["name"] not in names:
            continue
        took, found, seed = by_worlds(number, seconds)
        print(f"{mutant['name']:22} {took:6.1f} s  {found or 'NOT FOUND':14} {seed}", flush=True)
        if not found:
            left.append(mutant["name"])
    count = len(names) or len(mutants)
    print(f"mutants: found={count - len(left)} of={count} not_found={','.join(left) or '-'}")
    return 1 if left else 0


def by_chance(count, seconds):
    files = {}
    for crate in CRATES:
        folder = ROOT / "crates" / (crate.replace("bus-", "bus/") if crate.startswith("bus-") else f"core/{crate}")
        for path in sorted((folder / "src").rglob("*.rs")):
            if "test" not in str(path.relative_to(folder)):
                files[str(path.relative_to(ROOT))] = path.read_text()
    # Some changes do not compile.
    changes = chance.drawn(files, count * 2, lambda index: f"tickbus_base::mutant({index + 1})")
    packages = [word for crate in CRATES for word in ("-p", f"tickbus-{crate}")]
    changes = compiling(files, changes, ["--keep-going", *packages])[:count]
    texts = changed(files, changes)
    build(texts, ["-p", "tickbus-worlds"])
    whole = [word for name in WHOLE for word in ("--test", name)]
    roots = [(*program, WHOLE[program[1]]) for program in test_programs(["-p", "tickbus", *whole])]
    tests = [(*program, []) for program in test_programs(["--lib", "--tests", *packages])] + roots
    further = [word for crate in FURTHER for word in ("-p", f"tickbus-{crate}")]
    rest = [(*program, []) for program in test_programs(["--lib", "--tests", *further])]
    rest += [(folder, name, binary, []) for folder, name, binary, parts in roots if parts]
    # A program that fails here without any change judges none.
    broken = [test for test in tests + rest if by_tests([test], "", 0)]
    tests, rest = ([test for test in some if test not in broken] for some in (tests, rest))
    names = [f"{folder.name}/{name}" for folder, name, _, _ in broken]
    print(f"mutants: tests={len(tests) + len(rest)} left_out={','.join(names) or '-'}", flush=True)
    killed = 0
    for change in changes:
        crate = change["file"].split("/")[2]
        begun = time.monotonic()
        verdict, seed = by_tests(tests, crate, change["number"]), ""
        took = time.monotonic() - begun
        if not verdict:
            took, verdict, seed = by_worlds(change["number"], seconds)
        if not verdict:
            verdict, seed = by_tests(rest, crate, change["number"]), ""
        killed += bool(verdict)
        place = f"{change['file'].removeprefix('crates/')}:{change['line'] + 1}"
        print(f"{place}: {change['what'][:60]}\n    {took:6.1f} s  {verdict or 'LIVES'} {seed}", flush=True)
    print(f"mutants: killed={killed} of={len(changes)}")
    return 0


def compiling(files, changes, arguments):
    """Returns the changes that compile. The compiler names the lines of the others."""
    while True:
        base = "crates/core/base/src/lib.rs"
        texts = changed(files, changes)
        texts[base] = (ROOT / base).read_text() + SWITCH
        write_tree(texts)
        checked = cargo("check", ["--message-format", "json", *arguments])
        wrong = set()
        for message in map(json.loads, checked.stdout.splitlines()):
            message = message.get("message", {})
            if isinstance(message, dict) and message.get("level") == "error":
                wrong |= {(span["file_name"], span["line_start"] - 1) for span in message["spans"]}
        left = [change for change in changes if (change["file"], change["line"]) not in wrong]
        if checked.returncode == 0:
            return changes
        if len(left) == len(changes):
            sys.exit(f"mutants: they do not compile:\n{checked.stderr[-4000:]}")
        changes = left


def changed(files, changes):
    """Returns the texts of the files with these changes. Each change keeps its number."""
    texts = {}
    for change in changes:
        lines = texts.setdefault(change["file"], files[change["file"]].split("\n"))
        lines[change["line"]] = change["new"]
    return {name: "\n".join(lines) for name, lines in texts.items()}


def test_programs(arguments):
    """The folder of the package, the name and the file of each test program."""
    built = cargo("test", ["--no-run", "--message-format", "json", *arguments])
    if built.returncode:
        sys.exit(f"mutants: the tests do not compile:\n{built.stderr[-4000:]}")
    found = []
    for message in map(json.loads, built.stdout.splitlines()):
        if message.get("executable") and message["profile"]["test"]:
            found.append((Path(message["manifest_path"]).parent, message["target"]["name"], message["executable"]))
    return found


def by_tests(tests, crate, number):
    """The test program that finds a change, its own crate's first."""
    for folder, name, binary, parts in sorted(tests, key=lambda test: test[0].name != crate):
        try:
            done = subprocess.run([binary, "-q", *parts], cwd=folder, env=chosen(number), capture_output=True, timeout=180, check=False)
        except subprocess.TimeoutExpired:
            return f"{folder.name} {name} hangs"
        if done.returncode:
            return f"{folder.name} {name}"
    return None


def build(texts, arguments):
    base = "crates/core/base/src/lib.rs"
    texts[base] = (ROOT / base).read_text() + SWITCH
    write_tree(texts)
    built = cargo("build", arguments)
    if built.returncode:
        sys.exit(f"mutants: they do not compile:\n{built.stderr[-4000:]}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="tools/mutants", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="some of the mutations; all by default")
    parser.add_argument("--seconds", type=int, default=300, help="how long worlds look for each")
    parser.add_argument("--random", type=int, metavar="COUNT", help="this many random changes instead")
    arguments = parser.parse_args()
    if arguments.random:
        sys.exit(by_chance(arguments.random, arguments.seconds))
    sys.exit(known(arguments.names, arguments.seconds))
