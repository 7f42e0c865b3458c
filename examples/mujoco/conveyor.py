#!/usr/bin/env python3
"""A conveyor with a pusher and a light barrier, simulated by MuJoCo, as remote I/O of a PLC.

    conveyor.py [--config conveyor.cfg] [--picture conveyor.png] [--seconds 30]

It listens for the PLC, such as conveyor_plc.py, and ends when all boxes are in the bin. Like a PLC it runs by the computer's
clock.
"""

import argparse
import sys
import time
from pathlib import Path

import mujoco

import tickbus

HERE = Path(__file__).parent
BELT_SPEED = 0.4  # m/s
STROKE = 0.5  # m
WIDTH = 0.44  # m, of the belt with its fences; objects beyond it do not interrupt the light barrier
PITCH = 0.2  # m: the pattern of the belt repeats


def simulate(plc, model, data, seconds, watch):
    """Runs until all boxes are in the bin or the time is over; returns how many are in it."""
    run, push = plc["Belt run"], plc["Pusher out"]
    barrier, home, out = plc["Light barrier"], plc["Pusher is home"], plc["Pusher is out"]
    boxes = [data.body(i) for i in range(model.nbody) if model.body(i).name.startswith("box")]
    began = time.monotonic()
    while data.time < seconds:
        plc.receive(data.time)
        data.actuator("belt").ctrl = BELT_SPEED * run.value
        data.actuator("pusher").ctrl = STROKE * push.value
        mujoco.mj_step(model, data)
        if data.joint("belt").qpos > PITCH:
            data.joint("belt").qpos -= PITCH
        barrier.value = not 0 <= data.sensor("barrier").data[0] < WIDTH
        home.value = data.sensor("pusher").data[0] < 0.02
        out.value = data.sensor("pusher").data[0] > STROKE - 0.02
        plc.send()
        watch(push.value)
        inside = sum(box.xpos[2] < -0.3 for box in boxes)
        if inside == len(boxes):
            break
        # A PLC's clock neither waits for a simulation nor runs ahead of it.
        time.sleep(max(0.0, began + data.time - time.monotonic()))
    return inside


class Camera:
    """Takes the picture in the middle of the second push, when one box is already in the bin."""

    def __init__(self, model, data, file):
        self.model, self.data, self.file = model, data, file
        self.renderer = mujoco.Renderer(model, 540, 960) if file else None
        self.pushes, self.was_pushing = 0, False

    def watch(self, pushing):
        self.pushes += pushing and not self.was_pushing
        self.was_pushing = pushing
        if self.file and self.pushes == 2 and self.data.sensor("pusher").data[0] > 0.75 * STROKE:
            self.renderer.update_scene(self.data, "side")
            write_png(self.file, self.renderer.render())
            self.file = None


def write_png(file, pixels):
    """Encodes a picture of rows, columns and three colours as PNG."""
    import struct
    import zlib

    height, width, _ = pixels.shape
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    parts = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows, 9)),
        (b"IEND", b""),
    ]
    chunks = (struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in parts)
    Path(file).write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", default=HERE / "conveyor.cfg")
    parser.add_argument("--picture", metavar="FILE", help="draw one, off screen; MUJOCO_GL=egl or osmesa where there is no display")
    parser.add_argument("--seconds", type=float, default=30.0, help="the longest run")
    arguments = parser.parse_args()
    model = mujoco.MjModel.from_xml_path(str(HERE / "conveyor.xml"))
    data = mujoco.MjData(model)
    camera = Camera(model, data, arguments.picture)
    with tickbus.open(arguments.config) as plc:
        print(f"conveyor: listening on {address(plc)}", flush=True)
        # Nothing moves before the PLC is there.
        plc["Light barrier"].value = plc["Pusher is home"].value = True
        while plc.exchange() is tickbus.Status.STALE or not plc["Belt run"].value:
            time.sleep(0.01)
        inside = simulate(plc, model, data, arguments.seconds, camera.watch)
    boxes = sum(model.body(i).name.startswith("box") for i in range(model.nbody))
    print(f"conveyor: {'ok' if inside == boxes else 'FAILED'} boxes={inside} of={boxes} seconds={data.time:.1f}")
    return 0 if inside == boxes else 1


def address(plc):
    """The driver's address, as soon as it listens."""
    while "address" not in (statistics := plc.statistics()):
        time.sleep(0.01)
    return statistics["address"]


if __name__ == "__main__":
    sys.exit(main())
