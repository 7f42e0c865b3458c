#!/usr/bin/env python3
"""Takes the pictures of tools/pictures: starts the programs, drives a headless Chromium by WebDriver, and keeps the PNGs small.

    pictures.py WORK IMAGES [NAME...]

WORK/demo has the demo, as tools/demo lays it out; tickbus is on the PATH.
"""

import base64
import json
import os
import queue
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import png

ENTER = "\ue007"
PATIENCE = 120

MOST_BYTES = 60_000


class Program:
    """A process, and the lines that it prints."""

    def __init__(self, *command, folder=None, **environment):
        self.process = subprocess.Popen(
            [str(word) for word in command], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env={**os.environ, **environment},
        )
        self.lines = queue.Queue()
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            self.lines.put(line.rstrip())
        self.lines.put(None)

    def after(self, words):
        """The rest of the next line with these words."""
        seen = []
        while (line := self.lines.get(timeout=PATIENCE)) is not None:
            seen.append(line)
            if words in line:
                return line.partition(words)[2]
        sys.exit(f"pictures: {self.process.args[0]} never says \"{words}\", but\n" + "\n".join(seen))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


class Browser:
    def __init__(self):
        self.driver = Program("chromedriver", "--port=0")
        self.address = "http://127.0.0.1:" + self.driver.after("started successfully on port ").rstrip(".")
        arguments = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars"]
        wanted = {"goog:chromeOptions": {"args": arguments}, "timeouts": {"script": PATIENCE * 1000}}
        session = self.call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        self.path = f"/session/{session['sessionId']}"

    def call(self, method, path, body=None):
        data = json.dumps(body or {}).encode() if method == "POST" else None
        request = urllib.request.Request(self.address + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            sys.exit(f"pictures: {path}: {json.load(error)['value']['message']}")

    def post(self, command, body):
        return self.call("POST", f"{self.path}/{command}", body)

    def devtools(self, command, **parameters):
        return self.post("goog/cdp/execute", {"cmd": command, "params": parameters})

    def look(self, width, height, scheme="light", scale=1):
        """The window in CSS pixels, of which the picture has `scale` times as many."""
        self.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=False)
        self.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def go(self, url):
        # From elsewhere: a change of the token alone would load nothing.
        self.post("url", {"url": "about:blank"})
        self.post("url", {"url": url})

    def run(self, body):
        script = f"const done = arguments[arguments.length - 1]; (async () => {{ {body} }})().then(done, (error) => done('' + error));"
        return self.post("execute/async", {"script": script, "args": []})

    def wait(self, condition):
        self.run(f"while (!({condition})) await new Promise((go) => requestAnimationFrame(go));")

    def keys(self, keys):
        strokes = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self.post("actions", {"actions": [{"type": "key", "id": "keys", "actions": strokes}]})

    def shoot(self):
        return base64.b64decode(self.devtools("Page.captureScreenshot")["data"])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.call("DELETE", self.path)
        self.driver.__exit__()


class Album:
    """The pictures that are asked for."""

    def __init__(self, images, names):
        self.images, self.names, self.shots = images, names, {}

    def wants(self, *names):
        return not self.names or any(name in self.names for name in names)

    def add(self, name, shot):
        if self.wants(name):
            self.shots[name] = shot

    def save(self):
        """Later, since it takes seconds, in which the programs continue."""
        for name, shot in self.shots.items():
            small, how = png.small(shot, MOST_BYTES)
            (self.images / f"{name}.png").write_bytes(small)
            print(f"pictures: {name}.png bytes={len(small)} of {len(shot)} {how}", flush=True)


def trends(browser, *names):
    for name in names:
        browser.run(f"list.select(plant.signals.find((it) => it.name === {json.dumps(name)}));")
        browser.run("document.getElementById('trend').click()")
    browser.run("list.select(null); document.getElementById('list').scrollTop = 1e6")
    # The button at a trend changes how far back all of them go.
    button = "document.querySelector('.row.trend:not([hidden]) button')"
    browser.wait(button)
    browser.run(f"for (let n = 0; n < 9 && {button}.textContent !== '15 s'; n++) {{ {button}.click(); await new Promise((go) => setTimeout(go, 300)); }}")


def force(browser, method, name, *value):
    body = ", ".join(json.dumps(word) for word in value)
    browser.run(f"await room.change('{method}', `/force/${{plant.drivers[0].id}}/${{encodeURIComponent({json.dumps(name)})}}`, {body})")


def demo(browser, album, work):
    """The rig under its PLC, the same while the PLC is dead, and the report about the run."""
    folder = work / "demo"
    files = {"drivers": folder / "DeviceDriver", "control": folder / "simulator/rig.table", "plc": shutil.which("tickbus"),
             "report": work / "report.txt", "recording": folder / "run.vcd"}
    with Program(
        "java", "--enable-native-access=ALL-UNNAMED", "-cp", f"{folder}/simulator/*", "tickbus.machines.rig.Demo",
        *(word for key, value in files.items() for word in (f"--{key}", value)), TICKBUS_LOG="error",
    ) as program:
        url = program.after("live page at ")
        program.after("phase recover")
        if album.wants("live-page-outage"):
            browser.look(1280, 820, "dark", scale=0.75)
            browser.go(url)
            program.after("kills the PLC")
            program.after("fail-safe values are delivered")
            album.add("live-page-outage", browser.shoot())
        if album.wants("live-page"):
            program.after("step 5: ")
            browser.look(1280, 820)
            browser.go(url)
            browser.wait("document.querySelector('.picture > div > div')?.shadowRoot")
            trends(browser, "LA2 position", "LA1 position")
            # A moment ago, with the bar of time.
            browser.run("document.getElementById('pause').click()")
            browser.wait("bar.moment")
            browser.run("const range = document.getElementById('scrub'); range.value -= 2500; range.dispatchEvent(new Event('input'))")
            browser.wait("document.getElementById('to-live').textContent.includes('+')")
            time.sleep(0.5)
            album.add("live-page", browser.shoot())
        if album.wants("report"):
            program.after("demo: ok")
            browser.look(1280, 900)
            browser.go((work / "report.html").resolve().as_uri())
            album.add("report", browser.shoot())


def studio(browser, album, work):
    """A driver.cfg whose line runs, with an address that another signal has."""
    folder = work / "plant/line3"
    folder.mkdir(parents=True)
    file = folder / "driver.cfg"
    shutil.copyfile("driver.cfg", file)
    with Program("tickbus", "studio", "--page", "127.0.0.1:0", file) as program:
        browser.look(1240, 617)
        browser.go(program.after("studio: ").rpartition(" at ")[2])
        browser.wait("document.querySelector('#settings select') !== null")
        browser.run("document.getElementById('start').click()")
        browser.wait("document.getElementById('line-reason').textContent.includes('listening')")
        with Program("tickbus", "plc", "rig", "--config", file):
            browser.wait("document.getElementById('line-state').textContent === 'running'")
            browser.run("cells.go(4, 'address')")
            browser.keys(f"{ENTER}%QX1.3{ENTER}")
            browser.wait("document.querySelectorAll('#mistakes li').length === 1 && !tickbusStudio.isBusy")
            browser.run("cells.go(4, 'address'); document.getElementById('path').textContent = '/plant/line3/driver.cfg'")
            time.sleep(1)
            album.add("studio", browser.shoot())


def two_tanks(browser, album, work):
    """The level control of the sample solution, after it was switched on."""
    folder, program = work / "tanks", work / "two-tanks.so"
    subprocess.run(["tickbus", "machine", "two-tanks", "--to", folder], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["plc/build", "plc/machines/two-tanks.st", program], check=True, stdout=subprocess.DEVNULL)
    file = folder / "driver.cfg"
    file.write_text(file.read_text().replace('kind = "modbus-server"', 'kind = "socket"\naddress = "127.0.0.1:0"'))
    with Program("tickbus", "machine", folder, "--page", "127.0.0.1:0") as machine:
        url = machine.after("page at ")
        address = machine.after("listening on ")
        with Program("tickbus", "plc", program, "--config", file, "--address", address):
            browser.look(1400, 664, scale=0.75)
            browser.go(url)
            browser.wait("document.getElementById('access').textContent === 'may force'")
            for name in ("Control switch", "Start button"):
                force(browser, "PUT", name, "1")
            time.sleep(1)
            for name in ("Start button", "Control switch"):
                force(browser, "DELETE", name)
            # Both valves open, the pump on, and water in both tanks.
            value = "((name) => plant.signals.find((it) => it.name === name).value)"
            browser.wait(f"{value}('Pump') && {value}('Valve 1') && {value}('Level 1') > 55 && {value}('Level 2') > 30")
            album.add("machine-two-tanks", browser.shoot())


def patch_bay(browser, album, work):
    """Two controllers and two processes in a laboratory, a fifth client that has left, and one output forced."""
    with Program("tickbus", "dispatch", "--listen", "127.0.0.1:0", "--page", "127.0.0.1:0", "--patch", work / "patch.toml") as program:
        host, _, port = program.after("listening on ").rpartition(":")
        url = program.after("page at ")

        def join(line):
            client = socket.create_connection((host, int(port)), timeout=PATIENCE).makefile("rw", newline="\r\n")
            say(client, f"{line} V=2", "END")
            return client

        def say(client, line, answer):
            client.write(line + "\n")
            client.flush()
            while not client.readline().startswith(answer):
                pass

        tank, board = join("VP TANK Q04 I03 AQ01"), join("VP SWITCHES Q04 I04")
        one, two, fan = join("VR LOGO1 Q04 I04 AI01"), join("VR LOGO2 Q02 I04"), join("VP FAN Q01 I01")
        say(one, "CONNECT I1:SWITCHES:Q1 I2:SWITCHES:Q2 I3:TANK:Q1 Q1:TANK:I1 AI1:TANK:AQ1 Q2:FAN:I1", "OK CONNECT")
        say(two, "CONNECT I1:LOGO1:Q3 I2:TANK:Q2 Q1:SWITCHES:I1 Q2:SWITCHES:I2", "OK CONNECT")
        fan.close()
        for client, values in ((tank, "Q1=24 Q2=0 AQ1=7.25"), (board, "Q1=24 Q2=0"), (one, "Q1=24 Q3=24"), (two, "Q1=24 Q2=0")):
            client.write(f"P {values}\n")
            client.flush()
        browser.look(1180, 800)
        browser.go(url)
        browser.wait("document.getElementById('access').textContent === 'may change'")
        browser.wait("document.querySelector('[data-pin=\"LOGO1:AI1\"] .value')?.textContent === '7.25'")
        browser.run("document.querySelector('[data-pin=\"TANK:Q4\"]').click()")
        browser.keys("f")
        browser.run("document.getElementById('force-value').select()")
        browser.keys(f"24{ENTER}")
        browser.wait("document.querySelector('[data-pin=\"TANK:Q4\"] .value').textContent === '24 forced'")
        album.add("patch-bay", browser.shoot())


def petri_page(browser, album, _work):
    """The net of the transport in the cell, twenty seconds after the start, when pallets have been stuck."""
    with Program("tools/demo-cell", "--page", "127.0.0.1:0", BUILT="yes") as program:
        browser.look(1470, 850)
        browser.go(program.after("nets: live at "))
        transport = "[...document.querySelectorAll('#choice button')].find((it) => it.textContent.startsWith('transport'))"
        browser.wait(transport)
        time.sleep(20)
        browser.run(f"{transport}.click()")
        time.sleep(1)
        album.add("petri-page", browser.shoot())


def main():
    work, images, *names = sys.argv[1:]
    album, work = Album(Path(images), names), Path(work)
    known = {"live-page": demo, "live-page-outage": demo, "report": demo, "studio": studio, "machine-two-tanks": two_tanks,
             "patch-bay": patch_bay, "petri-page": petri_page}
    for name in names:
        if name not in known:
            sys.exit(f"pictures: there is no picture \"{name}\"; there are {', '.join(known)}")
    has_iec2c = shutil.which(os.environ.get("IEC2C", "iec2c"))
    with Browser() as browser:
        for make in dict.fromkeys(known.values()):
            if album.wants(*(name for name, maker in known.items() if maker is make)) and (make is not two_tanks or has_iec2c):
                make(browser, album, work)
    album.save()


main()
