"""Foreign code in helper processes: a plug-in and an FMU that crash, on any platform.

helpers.py PLATFORM COMPILER -- COMMAND...

COMMAND starts the tickbus command of the platform, COMPILER compiles C for it. The last line has the counts.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import zipfile

ROOT = pathlib.Path(__file__).parent.parent.parent
SECONDS = 60

SIGNALS = """
[[signal]]
name = "out"
address = "%QW0"

[[signal]]
name = "in"
address = "%IW0"
"""


class Platform:
    """The command and the compiler of a platform."""

    def __init__(self, name, compiler, command):
        self.name, self.compiler, self.command = name, compiler, command
        self.is_windows = name == "windows"

    def library(self, source, to):
        """Compiles a source of this repository as a shared library."""
        # What not every Windows has goes into the file.
        own = ["-static", "-lpthread"] if self.is_windows else ["-fPIC"]
        call = [*self.compiler, "-O1", "-shared", "-I", str(ROOT / "include"), "-o", str(to), str(ROOT / source), *own]
        subprocess.run(call, check=True)

    def run(self, folder, *arguments):
        """The output of a command that ends by itself."""
        ran = subprocess.run(
            [*self.command, *arguments], cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False,
        )
        return ran.stdout + ran.stderr

    def fmu(self, folder, source, name):
        """An FMU 2.0 of the tank's interface."""
        tuple_ = "win64" if self.is_windows else "linux64"
        library = folder / ("tank.dll" if self.is_windows else "tank.so")
        self.library(source, library)
        with zipfile.ZipFile(folder / name, "w") as archive:
            archive.write(ROOT / "examples/fmu-tank/fmi2.xml", "modelDescription.xml")
            archive.write(library, f"binaries/{tuple_}/{library.name}")


def expect(what, told, *patterns):
    for pattern in patterns:
        if not re.search(pattern, told):
            sys.exit(f"{what}: nothing like {pattern!r} in\n{told}")


def a_plug_in_that_crashes_is_started_again(platform, folder):
    library = folder / ("misbehave.dll" if platform.is_windows else "libmisbehave.so")
    platform.library("tests/plugins/misbehave.c", library)
    helper = ""
    if platform.name == "arm64":
        # The system cannot start a program of another processor alone.
        wrapper = folder / "helper"
        wrapper.write_text(f"#!/bin/sh\nexec {' '.join(platform.command)} \"$@\"\n")
        wrapper.chmod(0o755)
        helper = "helper = 'helper'\n"
    (folder / "plugin.cfg").write_text(
        f"[driver]\nid = 1\nname = \"Card\"\n[fieldbus]\nkind = \"plugin\"\nlibrary = '{library.name}'\nisolated = true\n"
        # Before a process in Wine has crashed, Wine's debugger tells of it, for more than a second on a busy computer.
        f"{helper}reconnect = [\"100ms\"]\ncall_timeout = \"20s\"\n"
        "options = { exchange = \"crash\", good = 5, once = 'once' }\n" + SIGNALS
    )
    told = platform.run(folder, "mirror", "plugin.cfg", "--duration", "10s", "--stats")
    cause = "an access to memory that is not its own"
    expect("plug-in", told, rf"its helper process was ended by .*{cause}.* in tickbus_exchange", "plugin.helpers=2",
           "mirror: running", "mirror: ok")


def an_fmu_runs_in_a_helper(platform, folder):
    platform.fmu(folder, "examples/fmu-tank/tank.c", "tank.fmu")
    for name in ["tank.cfg", "tank.toml"]:
        (folder / name).write_bytes((ROOT / "examples/fmu-tank" / name).read_bytes())
    for options in [[], ["--isolated"]]:
        told = platform.run(folder, "run", "tank.fmu", "--config", "tank.cfg", "--map", "tank.toml",
                            "--duration", "10s", *options)
        expect(f"FMU {options}", told, "run: ok ticks=1000 time=10s stale=0")


def main():
    split = sys.argv.index("--")
    platform = Platform(sys.argv[1], sys.argv[2].split(), sys.argv[split + 1:])
    checks = [a_plug_in_that_crashes_is_started_again]
    # The FMUs of this repository say that they are for x86-64.
    if platform.name != "arm64":
        checks.append(an_fmu_runs_in_a_helper)
    for check in checks:
        with tempfile.TemporaryDirectory(prefix="tickbus ") as folder:
            check(platform, pathlib.Path(folder))
            print(f"{check.__name__}: ok")
    print(f"test result: ok. {len(checks)} passed; 0 failed; 0 ignored; 0 measured; 0 filtered out")


if __name__ == "__main__":
    main()
