"""Access to the machine: processes and their resources, networks that can be cut off, small disks, detection of stalls."""

import os
import re
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path


def run(*command):
    """True if a command succeeds."""
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0


class Network:
    """Both ends of a line in separate network namespaces, with a cable between them; or this computer alone."""

    def __init__(self, name, has_namespaces):
        self.names = [f"{name}-{side}" for side in "dc"] if has_namespaces else None
        self.hosts = ["10.77.0.1", "10.77.0.2"] if has_namespaces else ["127.0.0.1"] * 2
        self.cable = [f"st{side}{name[-11:].replace('-', '')}"[:15] for side in "dc"]
        if not has_namespaces:
            return
        for own in self.names:
            subprocess.run(["ip", "netns", "add", own], check=True)
            self._in(own, "ip", "link", "set", "lo", "up")
        subprocess.run(["ip", "link", "add", self.cable[0], "type", "veth", "peer", "name", self.cable[1]], check=True)
        for own, end, host in zip(self.names, self.cable, self.hosts):
            subprocess.run(["ip", "link", "set", end, "netns", own], check=True)
            self._in(own, "ip", "address", "add", f"{host}/24", "dev", end)
            self._in(own, "ip", "link", "set", end, "up")

    def _in(self, own, *command):
        subprocess.run(["ip", "netns", "exec", own, *command], check=True)

    def prefix(self, end):
        """The prefix of a command that runs at an end."""
        return ["ip", "netns", "exec", self.names[end]] if self.names else []

    def cut(self, is_cut):
        """Pulls the cable, or plugs it in."""
        self._in(self.names[0], "ip", "link", "set", self.cable[0], "down" if is_cut else "up")

    def port(self):
        """A free port; in a separate namespace any will do."""
        if self.names:
            return 20030
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            return free.getsockname()[1]

    def close(self):
        for own in self.names or []:
            run("ip", "netns", "delete", own)


def has_namespaces():
    """True if this user may cut networks off here."""
    try:
        Network(f"storm-{os.getpid()}-try", True).close()
    except (OSError, subprocess.CalledProcessError):
        return False
    return True


class Disk:
    """A folder with little space."""

    def __init__(self, folder):
        folder.mkdir()
        self.folder = folder
        self.is_small = run("mount", "-t", "tmpfs", "-o", "size=64k", "storm", str(folder))

    def close(self):
        if self.is_small:
            run("umount", "--lazy", str(self.folder))


class Process:
    """A process of the storm; its output is in files."""

    def __init__(self, command, log, environment):
        self.log = log
        self.command = command
        self.started = time.monotonic_ns()
        self.ended = None
        self.asked = None
        with open(log, "wb") as out:
            self.child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=out, env=environment)

    def signal(self, number):
        if self.child.poll() is None:
            self.child.send_signal(number)

    def kill(self):
        self.signal(signal.SIGKILL)
        self.signal(signal.SIGCONT)
        self.child.wait()
        self.ended = self.ended or time.monotonic_ns()

    def terminate(self, seconds):
        """Asks the process to end; true if it ends within the time."""
        self.asked = time.monotonic_ns()
        self.signal(signal.SIGTERM)
        try:
            self.child.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        self.ended = time.monotonic_ns()
        return True

    def holds(self):
        """The process's system resources: descriptors by kind, threads by name, kilobytes. A JVM's own ones are left out."""
        folder = Path(f"/proc/{self.child.pid}")
        descriptors = {}
        for one in (folder / "fd").iterdir():
            try:
                kind = re.sub(r"[\d\[\]]+", "N", os.readlink(one).replace(" (deleted)", ""))
            except OSError:
                continue
            descriptors[kind] = descriptors.get(kind, 0) + 1
        threads = {}
        for one in (folder / "task").iterdir():
            try:
                name = (one / "comm").read_text().strip()
            except OSError:
                continue
            if not re.match(r"(GC|G1|C[12]|VM|Sweeper|Service|Signal|Notif|Common|Reference|Finalizer|Monitor|Java|Cleaner|Attach|process reaper)", name):
                threads[name] = threads.get(name, 0) + 1
        memory = re.search(r"RssAnon:\s+(\d+)", (folder / "status").read_text())
        return descriptors, threads, int(memory[1])


class Stalls(threading.Thread):
    """Detects when this whole machine stood still, or had no processor for its threads."""

    LEAST = 25_000_000

    def __init__(self):
        super().__init__(daemon=True)
        self.found = []
        self.start()

    def run(self):
        before = time.monotonic_ns()
        while True:
            time.sleep(0.004)
            now = time.monotonic_ns()
            if now - before > self.LEAST:
                self.found.append((before, now))
            before = now

    def longest(self, since, until):
        """The sum of the stalls that touch a span, in ns."""
        return sum(end - begin for begin, end in self.found if end >= since and begin <= until)
