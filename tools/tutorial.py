#!/usr/bin/env python3
"""Follows tutorials word by word, each in an empty folder: writes their files, runs their commands, compares what they print.

    tutorial.py [--work FOLDER] [--path FOLDER]... [--python ENVIRONMENT]... [--limit SECONDS] PAGE.md...

Blocks of a page, by the words behind the three backquotes:

    LANGUAGE FILE           the whole file FILE
    console                 "$ COMMAND" lines, each with all that it prints; the command must end
    console terminal N      the last command continues to run in terminal N beside what follows. A later block of the
                            terminal has what it prints from then on; "^C" in it presses Ctrl-C
    ... first-bit           the block whose end is the first bit at the other end; LIMIT seconds are permitted up to there
    LANGUAGE not-run        is not run: the page tells the reader so

"…" stands for anything in a line, and as a line of its own for any lines. Other blocks are refused. The last line of each
page is its verdict, with the seconds from the first command to the first bit. A page that says "<!-- needs: NAME … -->" gets
the first of the Python environments that has the modules among these names, and is skipped, with the reason, where a command
or a module is missing.

Ports in tutorials are fixed. Where Linux permits that, each page has a network of its own, and all run at once.
"""

import argparse
import difflib
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

PATIENCE = 60.0
"""Seconds that a command has to print what the page says."""

FENCE = re.compile(r"^```(.*)$")
COMMENT = re.compile(r"^<!-- needs: (.*) -->$")
WILD = "…"
INSIDE = "TICKBUS_TUTORIAL_INSIDE"
NOT_AT_A_DESK = {"CI", "BUILD_NUMBER", "FORCE_COLOR", "PY_COLORS"}
"""Variables by which programs print otherwise than at the reader's desk: pytest, for one, shortens no line on a CI server."""


class Wrong(Exception):
    """The page and the programs differ."""


class Block:
    def __init__(self, line, words):
        self.line, self.words, self.text = line, words, []


def blocks(page):
    """All fenced blocks of a page, and the names that it needs."""
    found, inside, needs = [], None, []
    for number, line in enumerate(page.read_text().splitlines(), 1):
        fence = FENCE.match(line)
        if fence and inside:
            found.append(inside)
            inside = None
        elif fence:
            inside = Block(number, fence.group(1).split())
        elif inside:
            inside.text.append(line)
        elif COMMENT.match(line):
            needs += COMMENT.match(line).group(1).split()
    if inside:
        raise Wrong(f"line {inside.line}: the block does not end")
    return found, needs


def pattern(lines):
    """What matches all of these lines, with … for what varies."""
    parts = []
    for line in lines:
        if line.strip() == WILD:
            parts.append(r"(?:[^\n]*\n)*?")
        else:
            parts.append(r"[^\n]*?".join(map(re.escape, line.rstrip().split(WILD))) + r"[ \t]*\n")
    return "".join(parts)


def difference(expected, seen):
    return "\n".join(difflib.unified_diff(expected, seen.splitlines(), "the page", "printed", lineterm="", n=9))


class Command:
    """A command in a process group of its own, and what it has printed."""

    def __init__(self, text, folder, environment):
        self.text, self.seen, self.begun = text, "", 0
        self.process = subprocess.Popen(
            ["bash", "-c", text], cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, start_new_session=True,
        )
        self.changed = threading.Condition()
        self.ended = False
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        while data := os.read(self.process.stdout.fileno(), 65536):
            with self.changed:
                self.seen += data.decode(errors="replace")
                self.changed.notify_all()
        self.process.wait()
        with self.changed:
            self.ended = True
            self.changed.notify_all()

    def finish(self, expected):
        """Waits for the end; all that was printed must match."""
        with self.changed:
            if not self.changed.wait_for(lambda: self.ended, PATIENCE):
                self.stop()
                raise Wrong(f"$ {self.text}\ndoes not end; it printed\n{self.seen[self.begun:]}")
            rest = self.seen[self.begun:]
        if rest and not rest.endswith("\n"):
            rest += "\n"
        if not re.fullmatch(pattern(expected), rest):
            raise Wrong(f"$ {self.text}\nprints something else:\n{difference(expected, rest)}")

    def reach(self, expected):
        """Waits until these lines were printed, behind those of the block before."""
        wanted = re.compile(r"(?:^|(?<=\n))" + pattern(expected))
        with self.changed:
            found = lambda: wanted.search(self.seen, self.begun)
            self.changed.wait_for(lambda: found() or self.ended, PATIENCE)
            match = found()
            if not match:
                state = "ended, and" if self.ended else "runs, but"
                raise Wrong(f"$ {self.text}\n{state} did not print this:\n{difference(expected, self.seen[self.begun:])}")
            self.begun = match.end()

    def press(self):
        os.killpg(self.process.pid, signal.SIGINT)

    def stop(self):
        for number in (signal.SIGINT, signal.SIGKILL):
            if self.ended:
                return
            try:
                os.killpg(self.process.pid, number)
            except ProcessLookupError:
                return
            self.reader.join(5)


class Tutorial:
    def __init__(self, page, folder, environment):
        self.page, self.folder, self.environment = page, folder, environment
        self.terminals, self.commands, self.files, self.unrun = {}, 0, 0, 0
        self.first_command = self.first_bit = None

    def follow(self, all_blocks):
        try:
            for block in all_blocks:
                try:
                    self.one(block)
                except Wrong as wrong:
                    raise Wrong(f"{self.page}:{block.line}: {wrong}") from None
        finally:
            for command in self.terminals.values():
                command.stop()
        if not self.first_bit:
            raise Wrong(f"{self.page}: no block says first-bit")

    def one(self, block):
        words = [word for word in block.words if word != "first-bit"]
        if words[1:] == ["not-run"]:
            self.unrun += 1
        elif words == ["console"]:
            self.console(block.text)
        elif words[:2] == ["console", "terminal"] and len(words) == 3:
            self.terminal(words[2], block.text)
        elif len(words) == 2:
            file = self.folder / words[1]
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text("\n".join(block.text) + "\n")
            self.files += 1
        else:
            raise Wrong(f"\"```{' '.join(block.words)}\" is neither a file nor a console; if it is not to be run, mark it: not-run")
        if "first-bit" in block.words:
            self.first_bit = time.monotonic() - self.first_command

    def start(self, text):
        self.first_command = self.first_command or time.monotonic()
        self.commands += 1
        return Command(text, self.folder, self.environment)

    @staticmethod
    def split(text):
        """The commands of a block, each with the lines behind it; those before the first belong to no command."""
        parts = [(None, [])]
        for line in text:
            if line.startswith("$ "):
                parts.append((line[2:], []))
            else:
                parts[-1][1].append(line)
        return parts

    def console(self, text):
        (_, before), *commands = self.split(text)
        if before or not commands:
            raise Wrong("a console begins with \"$ \" and a command")
        for command, expected in commands:
            self.start(command).finish(expected)

    def terminal(self, name, text):
        (_, before), *commands = self.split(text)
        if before:
            if name not in self.terminals:
                raise Wrong(f"nothing runs in terminal {name}")
            self.shown(self.terminals[name], before)
        for place, (command, expected) in enumerate(commands, 1):
            started = self.start(command)
            if place == len(commands):
                self.terminals[name] = started
                started.reach(expected)
            else:
                started.finish(expected)

    @staticmethod
    def shown(command, lines):
        if "^C" in lines:
            place = lines.index("^C")
            if lines[:place]:
                command.reach(lines[:place])
            with command.changed:
                command.begun = len(command.seen)
            command.press()
            command.finish([WILD, *lines[place + 1:]])
        else:
            command.reach(lines)


def is_command(name, environment):
    named = environment.get("IEC2C", name) if name == "iec2c" else name
    return shutil.which(named, path=environment["PATH"]) is not None


def lacking(modules, environment):
    """The first of these Python modules that cannot be imported."""
    for name in modules:
        if subprocess.run(["python3", "-c", f"import {name}"], env=environment, stderr=subprocess.DEVNULL).returncode:
            return name
    return None


def furnished(needs, environment, pythons):
    """The environment with a Python that has what the page needs, and the name that is missing, if one is."""
    modules = [name for name in needs if not is_command(name, environment)]
    first = None
    for folder in [*pythons, None]:
        tried = environment if folder is None else {**environment, "PATH": f"{folder.resolve()}/bin:{environment['PATH']}"}
        lack = lacking([name for name in modules if not is_command(name, tried)], tried)
        if lack is None:
            return tried, None
        first = first or lack
    return environment, first


def follow(page, asked):
    """Follows one page, and prints its verdict; false if the page is wrong."""
    environment = {
        **{name: value for name, value in os.environ.items() if name not in NOT_AT_A_DESK},
        "LC_ALL": "C.UTF-8", "COLUMNS": "80", "PYTHONUNBUFFERED": "1", "PYTHONDONTWRITEBYTECODE": "1",
        "TICKBUS_HOME": str(Path(__file__).resolve().parents[1]),
        "PATH": ":".join([*(str(folder.resolve()) for folder in asked.path), os.environ["PATH"]]),
    }
    folder = (asked.work / page.stem).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    begun = time.monotonic()
    try:
        all_blocks, needs = blocks(page)
        environment, lack = furnished(needs, environment, asked.python)
        if lack:
            print(f"tutorial: skipped: {page} needs {lack}", flush=True)
            return True
        tutorial = Tutorial(page, folder, environment)
        tutorial.follow(all_blocks)
        if tutorial.first_bit > asked.limit:
            raise Wrong(f"{page}: the first bit comes after {tutorial.first_bit:.1f} s; the limit is {asked.limit:.0f} s")
    except Wrong as wrong:
        print(f"{wrong}\ntutorial: {page}: failed", flush=True)
        return False
    print(f"tutorial: {page}: ok first_bit={tutorial.first_bit:.1f}s all={time.monotonic() - begun:.1f}s "
          f"commands={tutorial.commands} files={tutorial.files} not_run={tutorial.unrun}", flush=True)
    return True


def own_network():
    """The command that runs another one in a network of its own, with a loopback and nothing else; empty if it cannot be."""
    command = ["unshare", "-rn", "sh", "-c", "ip link set lo up && exec \"$@\"", "sh"]
    if not shutil.which("unshare") or not shutil.which("ip"):
        return []
    return [] if subprocess.run([*command, "true"], stderr=subprocess.DEVNULL).returncode else command


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--work", type=Path, default=Path("target/test/tutorials"))
    parser.add_argument("--path", type=Path, action="append", default=[])
    parser.add_argument("--python", type=Path, action="append", default=[])
    parser.add_argument("--limit", type=float, default=60.0)
    parser.add_argument("pages", type=Path, nargs="+")
    asked = parser.parse_args()
    network = [] if os.environ.get(INSIDE) else own_network()
    if not network:
        sys.exit(not all([follow(page, asked) for page in asked.pages]))
    options = sys.argv[1:len(sys.argv) - len(asked.pages)]
    environment = {**os.environ, INSIDE: "yes"}
    running = [
        subprocess.Popen([*network, sys.executable, __file__, *options, str(page)], env=environment, stdout=subprocess.PIPE)
        for page in asked.pages
    ]
    for one in running:
        sys.stdout.write(one.communicate()[0].decode())
    sys.exit(any(one.returncode for one in running))


main()
