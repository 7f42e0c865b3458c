"""Runs one line of the storm: its two ends as processes of the built artefacts, their misfortunes, and the judge."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import judge
import logs
from machine import Disk, Network, Process, Stalls
from plan import CONTROLLER, DEVICE, FAIL_SAFE, MS, ROLES, SECOND, driver_cfg, patch

HERE = Path(__file__).parent
# The ends must recover from faults within this time, which includes pauses between attempts to connect, and a JVM's start.
LIVELY = 16.0
# The permitted growth of a process's memory until the end, in kilobytes: languages keep memory that is not tickbus's.
MEMORY = {"java": 64_000, "python": 6_000, "fmu": 12_000, "c": 3_000, "command": 3_000}


class Artefacts:
    """The programs of the ends: the output of tools/dist, and the environments of tools/python and tools/peers."""

    def __init__(self, product, folder):
        self.folder = folder
        made = product / "target/dist"
        zipped = next(made.glob("tickbus-[0-9]*/DeviceDriver"), made)
        in_c = next(made.glob("tickbus-c-[0-9]*/include"), made).parent
        self.command, self.library = zipped / "tickbus", in_c / "lib/libtickbus.so"
        self.jar = next(zipped.glob("device-drivers-*.jar"), None)
        self.python = product / "target/python/environment/bin/python"
        self.fmpy = product / "target/peers/fmi/bin/python"
        self.programs = []
        link = ["-L", self.library.parent, "-ltickbus", f"-Wl,-rpath,{self.library.parent}"]
        if self._make("cc", "-Wall", "-Wextra", "-Werror", "-I", in_c / "include", HERE / "end.c", *link, "-o", folder / "end"):
            self.programs.append("c")
        if self.python.exists():
            self.programs.append("python")
        if self.jar and self._make("javac", "-cp", self.jar, "-d", folder, HERE / "End.java"):
            self.programs.append("java")
        if self.fmpy.exists() and self.library.exists():
            self.programs.append("fmu")
        if self.command.exists():
            self.programs.append("command")

    def without_opcua(self):
        """The programs whose library was built without OPC UA."""
        config = self.folder / "opcua.cfg"
        config.write_text(
            '[driver]\nid = 1\nname = "probe"\n[fieldbus]\nkind = "opcua-client"\nurl = "opc.tcp://127.0.0.1:1"\nsecurity = "None"\n'
            '[[signal]]\nname = "signal"\naddress = "%QX0.0"\n'
        )
        python = ["-c", "import sys, tickbus; tickbus.open(sys.argv[1])", config]
        own = [config, self.folder / "ticks", 1, "I", 1, 1, 1, 0, 0, 0]
        probes = {"command": [self.command, "mirror", config, "--duration", "1ms"], "python": [self.python, *python]}
        probes |= {"c": [self.folder / "end", *own], "java": ["java", "-cp", f"{self.jar}:{self.folder}", "End", *own]}
        without = set()
        for program, command in probes.items():
            if program in self.programs:
                done = subprocess.run(list(map(str, command)), capture_output=True, text=True, cwd=self.folder)
                if "is not in this build" in done.stderr:
                    # An FMU has the same library as C.
                    without |= {"c", "fmu"} if program == "c" else {program}
        return without

    @staticmethod
    def _make(*command):
        try:
            return subprocess.run(list(map(str, command))).returncode == 0
        except FileNotFoundError:
            return False

    def start(self, plan, end, config, log, life, is_first):
        """The command of an end."""
        own = plan.ends[end]
        if own.program == "command":
            scan = f"{own.period}ns"
            return [self.command, "mirror", config, "--tick", scan] if end == DEVICE else [
                self.command, "plc", "mirror", "--config", config, "--scan", scan
            ]
        program = {
            "c": [self.folder / "end"],
            "python": [self.python, HERE / "end.py"],
            "java": ["java", "-Xmx48m", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1", "-cp", f"{self.jar}:{self.folder}", "End"],
            "fmu": [self.fmpy, HERE / "fmu.py"],
        }[own.program]
        pause = [own.pause_at, own.pause] if is_first else [0, 0]
        numbers = [plan.stations, own.period, own.pulse_every, int(own.halves), *pause]
        return [*program, config, log, life, "IQ"[end], *numbers]


class Line:
    """A running line."""

    def __init__(self, plan, artefacts, folder, has_namespaces):
        self.plan, self.artefacts, self.folder = plan, artefacts, folder
        self.stalls = Stalls()
        self.findings, self.lives, self.story = [], [], []
        self.processes, self.cuts, self.depth = {}, [], 0
        self.second = {}
        self.dispatcher = None
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        self.network = Network(f"storm-{os.getpid()}", has_namespaces)
        self.disk = Disk(folder / "disk") if plan.small_disk else None
        self.configs, self.recordings = [], []
        server = plan.server()
        host = self.network.hosts[DEVICE if server is None else server]
        self.address = f"{host}:{self.network.port()}"
        for end in (DEVICE, CONTROLLER):
            config = folder / f"{ROLES[end]}.cfg"
            place = self.disk.folder if self.disk else folder
            recording = place / f"{ROLES[end]}.csv" if plan.records[end] else None
            self.recordings.append(recording)
            config.write_text(driver_cfg(plan, end, self.address, recording))
            self.configs.append(config)
            if plan.ends[end].program == "fmu":
                self.export(config)

    def export(self, config):
        out = config.with_suffix(".fmu")
        command = [self.artefacts.command, "export", config, "--for", "fmi3", "--library", self.artefacts.library, "--out", out]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            self.findings.append(f"export: {done.stderr}")

    def start_dispatcher(self):
        """The server between both ends; it runs on the device's side."""
        command = [self.artefacts.command, "dispatch", "--listen", self.address, "--patch", self.folder / "patch.toml"]
        command = [*self.network.prefix(DEVICE), *map(str, command)]
        log = self.folder / f"dispatcher-{len(self.story)}.log"
        self.dispatcher = Process(command, log, os.environ)

    def tell(self, what):
        self.story.append((time.monotonic_ns(), what))

    def start(self, end, is_second=False):
        """Starts a process of an end, which is another life."""
        number = len(self.lives) + 1
        life = judge.Life(end, number, is_second=is_second)
        life.program = self.plan.ends[end].program
        life.path = self.folder / f"{ROLES[end]}-{number}.ticks"
        is_first = not any(other.end == end for other in self.lives)
        command = self.artefacts.start(self.plan, end, self.configs[end], life.path, number, is_first)
        command = [*self.network.prefix(end), *map(str, command)]
        environment = {**os.environ, "TMPDIR": str(self.folder)}
        life.process = Process(command, self.folder / f"{ROLES[end]}-{number}.log", environment)
        life.born = life.process.started
        self.lives.append(life)
        (self.second if is_second else self.processes)[end] = life
        self.tell(f"{ROLES[end]} life {number} starts{' as a second one' if is_second else ''}")
        return life

    def over(self, end, is_killed, of=None):
        """Ends the process of an end."""
        of = self.processes if of is None else of
        life = of.pop(end, None)
        if life is None:
            return
        self.resume(life, is_all=True)
        if is_killed:
            life.ended = time.monotonic_ns()
            life.process.kill()
        else:
            self.terminate(life)
        self.tell(f"{ROLES[end]} life {life.number} {'is killed' if is_killed else 'has ended'}")

    def terminate(self, life):
        was = life.process.child.poll()
        is_over = life.process.terminate(8.0)
        life.ended, life.closed = life.process.ended or time.monotonic_ns(), is_over
        if not is_over:
            self.findings.append(f"close: {ROLES[life.end]} life {life.number} still runs 8 s after SIGTERM")
            life.process.kill()
            return
        code = life.process.child.returncode
        # A second process may have been refused, and have ended with an error; its log is judged.
        is_refused = life.is_second and code in (1, 3)
        if not is_refused and (was is not None or code not in (0, -15, 143)):
            self.findings.append(f"died: {ROLES[life.end]} life {life.number}, with {code}")

    def suspend(self, life):
        """Misfortunes can overlap: a process continues when the last one is over."""
        life.process.signal(signal.SIGSTOP)
        if not life.suspended:
            life.downs.append((time.monotonic_ns(), None))
        life.suspended += 1

    def resume(self, life, is_all=False):
        life.suspended = 0 if is_all else max(0, life.suspended - 1)
        if life.downs and life.downs[-1][1] is None and not life.suspended:
            life.downs[-1] = (life.downs[-1][0], time.monotonic_ns())
            life.process.signal(signal.SIGCONT)

    def cut(self, is_cut):
        self.depth += 1 if is_cut else -1
        if is_cut and self.depth == 1:
            self.network.cut(True)
            self.cuts.append((time.monotonic_ns(), None))
        elif not is_cut and not self.depth:
            self.cuts[-1] = (self.cuts[-1][0], time.monotonic_ns())
            self.network.cut(False)

    def begin(self, event):
        self.tell(f"begins: {event}")
        life = self.processes.get(event.end)
        if event.what == "stopped" and life:
            self.suspend(life)
        elif event.what in ("killed", "terminated"):
            self.over(event.end, event.what == "killed")
        elif event.what == "cut":
            self.cut(True)
        elif event.what == "dispatcher killed":
            self.dispatcher.kill()
        elif event.what == "dispatcher stopped":
            self.dispatcher.signal(signal.SIGSTOP)
        elif event.what == "second" and event.end not in self.second:
            self.start(event.end, is_second=True)

    def finish(self, event):
        life = self.processes.get(event.end)
        if event.what == "stopped" and life:
            self.resume(life)
        elif event.what in ("killed", "terminated") and not life:
            # A second process can have taken its port and its recording meanwhile.
            self.over(event.end, True, self.second)
            self.start(event.end)
        elif event.what == "cut":
            self.cut(False)
        elif event.what == "dispatcher killed" and self.dispatcher.ended:
            self.start_dispatcher()
        elif event.what == "dispatcher stopped":
            self.dispatcher.signal(signal.SIGCONT)
        elif event.what == "second":
            self.over(event.end, int(event.span * 1000) % 2 == 0, self.second)
        self.tell(f"over: {event}")

    def is_lively(self):
        """True if both ends have valid values of each other."""
        for end in (DEVICE, CONTROLLER):
            life = self.processes.get(end)
            if self.plan.ends[end].program == "command":
                continue
            try:
                with open(life.path, "rb") as file:
                    file.seek(max(0, file.seek(0, os.SEEK_END) - 2000))
                    words = file.read().splitlines()[-2].split()
            except (OSError, IndexError, AttributeError):
                return False
            if len(words) < 8 or int(words[4]) == judge.STALE or int(words[7]) == FAIL_SAFE or int(words[1]) < time.monotonic_ns() - SECOND:
                return False
        return True

    def until_lively(self, when):
        until = time.monotonic() + LIVELY
        while not self.is_lively():
            if time.monotonic() > until:
                self.findings.append(f"liveness: {when} the ends have no values of each other for {LIVELY:g} s")
                return False
            time.sleep(0.05)
        return True

    def run(self):
        try:
            self.live()
        finally:
            for life in self.lives:
                life.process.kill()
            if self.dispatcher:
                self.dispatcher.kill()
            self.network.close()
            for recording in self.recordings:
                # Move it off the small disk, which is removed in a moment.
                if recording and recording.exists():
                    shutil.copy(recording, self.folder / f"kept-{recording.name}")
            if self.disk:
                self.disk.close()
        self.tell("is judged")
        return self.judged()

    def live(self):
        if self.plan.bus == "dispatcher":
            (self.folder / "patch.toml").write_text(patch())
            self.start_dispatcher()
        for end in (DEVICE, CONTROLLER):
            self.start(end)
        if not self.until_lively("at first"):
            return
        time.sleep(1.5)
        survivors = {end: (life, life.process.holds()) for end, life in self.processes.items()}
        began = time.monotonic()
        turns = [(event.at, self.begin, event) for event in self.plan.events]
        turns += [(event.at + event.span, self.finish, event) for event in self.plan.events]
        for at, turn, event in sorted(turns, key=lambda each: each[0]):
            time.sleep(max(0, began + at - time.monotonic()))
            turn(event)
        time.sleep(max(0, began + self.plan.span - time.monotonic()))
        if self.until_lively("in the end"):
            time.sleep(3)
            for life, before in survivors.values():
                if life in self.processes.values():
                    self.leaks(life, before)
        for end in (CONTROLLER, DEVICE):
            self.over(end, False)
            time.sleep(self.plan.max_age / SECOND + 0.5)

    def leaks(self, life, before):
        until = time.monotonic() + 4
        while True:
            descriptors, threads, memory = life.process.holds()
            if (descriptors, threads) == before[:2] or time.monotonic() > until:
                break
            time.sleep(0.2)
        # This end does not learn that a peer ended while the network was cut: its connection stays until it times out.
        lost = sum(
            any(begin <= (other.ended or 0) and (end is None or other.ended <= end) for begin, end in self.cuts)
            for other in self.lives
            if other.end != life.end
        )
        descriptors["socket:N"] = descriptors.get("socket:N", 0) - lost
        for what, now, then in (("descriptors", descriptors, before[0]), ("threads", threads, before[1])):
            more = {kind: (then.get(kind, 0), count) for kind, count in now.items() if count > then.get(kind, 0)}
            if more:
                self.findings.append(f"leak: {ROLES[life.end]} life {life.number} has more {what} (before, now): {more}")
        if memory - before[2] > MEMORY[life.program]:
            self.findings.append(f"leak: {ROLES[life.end]} life {life.number} has {memory} kB, before {before[2]}")

    def judged(self):
        for begin, end in self.cuts:
            for life in self.lives:
                if life.process.started <= (end or begin):
                    life.downs.append((begin, end))
        for life in self.lives:
            life.ticks = judge.read(life.path, self.plan.stations)
        # A dataclass with lists has no hash: lives are distinguished by identity.
        one = judge.Judge(self.plan, self.lives, self.stalls)
        self.findings += one.judge()
        for end, recording in enumerate(self.recordings):
            kept = recording and self.folder / f"kept-{recording.name}"
            if kept and kept.exists():
                self.findings += judge.recording(kept, {life.number: life for life in self.lives}.get, self.plan, end)
        befallen = {event.what for event in self.plan.events} | ({"paused"} if any(end.pause for end in self.plan.ends) else set())
        befallen |= {"stalled"} if any(until - since > self.plan.max_age // 4 for since, until in self.stalls.found) else set()
        befallen |= {"small disk"} if self.disk and any(self.plan.records) else set()
        for life in self.lives:
            text = life.process.log.read_text(errors="replace")
            name = f"{ROLES[life.end]} life {life.number} ({life.program})"
            self.findings += [f"log: {name}: {line}" for line in logs.unexplained(text, befallen)]
        (self.folder / "story.txt").write_text(
            f"{self.plan}\n" + "".join(f"{at} {what}\n" for at, what in self.story) + "".join(f"FOUND {one}\n" for one in self.findings)
        )
        return {"findings": self.findings, "judged": one.judged, "ticks": sum(len(life.ticks) for life in self.lives)}
