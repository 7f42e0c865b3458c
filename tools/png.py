"""Makes a PNG small by giving it at most 256 colours, of which the frequent ones stay what they are."""

import struct
import subprocess
import tempfile
import zlib
from pathlib import Path
from shutil import which

COLOURS = (256, 192, 128, 64)
"""Tried in this order. Half of them are the most frequent colours themselves; the others share the rest."""


def chunks(data):
    place = 8
    while place < len(data):
        length, kind = struct.unpack(">I4s", data[place:place + 8])
        yield kind, data[place + 8:place + 8 + length]
        place += 12 + length


def paeth(left, up, corner):
    a, b, c = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
    return left if a <= b and a <= c else up if b <= c else corner


def rows(data):
    """Width, and the rows of a PNG with 8 bits a channel, each as RGB."""
    packed = b""
    for kind, content in chunks(data):
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", content[:10])
            if depth != 8 or colour not in (2, 6):
                raise ValueError(f"a PNG of depth {depth} and colour type {colour} is not expected from a browser")
        elif kind == b"IDAT":
            packed += content
    size = 3 if colour == 2 else 4
    stride, raw, before, found = width * size, zlib.decompress(packed), bytearray(width * size), []
    for y in range(height):
        place = y * (stride + 1)
        line = bytearray(raw[place + 1:place + 1 + stride])
        how = raw[place]
        for x in range(stride if how else 0):
            left = line[x - size] if x >= size else 0
            corner = before[x - size] if x >= size else 0
            line[x] = line[x] + (0, left, before[x], (left + before[x]) // 2, paeth(left, before[x], corner))[how] & 255
        before = line
        found.append(bytes(line) if size == 3 else b"".join(bytes(line[x:x + 3]) for x in range(0, stride, 4)))
    return width, found


def encoded(width, lines, table):
    """A PNG of rows with a number in the table of colours for each pixel."""
    # Unfiltered: neighbouring numbers mean nothing.
    packed = zlib.compress(b"".join(b"\0" + line for line in lines), 9)
    head = struct.pack(">IIBBBBB", width, len(lines), 8, 3, 0, 0, 0)
    parts = ((b"IHDR", head), (b"PLTE", table), (b"IDAT", packed), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content)) for kind, content in parts
    )


def recompressed(data):
    """The same picture by advpng, which takes more time than zlib."""
    if not which("advpng"):
        return data
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "it.png"
        file.write_bytes(data)
        subprocess.run(["advpng", "-z", "-4", "-q", file], check=True)
        return min(data, file.read_bytes(), key=len)


def palette(counts, most):
    """A colour for each colour: the frequent ones themselves, the others by median cut, weighted by how often they are."""
    ranked = sorted(counts, key=counts.get, reverse=True)
    chosen = {colour: colour for colour in ranked[:most // 2 if len(ranked) > most else most]}
    boxes = [ranked[len(chosen):]] if len(ranked) > len(chosen) else []
    while boxes and len(boxes) < most - most // 2:
        def spread(box):
            return max((max(c[i] for c in box) - min(c[i] for c in box), i) for i in range(3)) if len(box) > 1 else (0, 0)
        widest = max(range(len(boxes)), key=lambda place: spread(boxes[place])[0] * sum(counts[c] for c in boxes[place]) ** 0.25)
        box = boxes[widest]
        if len(box) < 2:
            break
        channel = spread(box)[1]
        box.sort(key=lambda colour: colour[channel])
        half, seen, place = sum(counts[c] for c in box) / 2, 0, 0
        for place, colour in enumerate(box[:-1], 1):
            seen += counts[colour]
            if seen >= half:
                break
        boxes[widest:widest + 1] = [box[:place], box[place:]]
    for box in boxes:
        whole = sum(counts[c] for c in box)
        mean = bytes(round(sum(c[i] * counts[c] for c in box) / whole) for i in range(3))
        chosen.update(dict.fromkeys(box, mean))
    return chosen


def small(data, most):
    """The picture in at most this many bytes, if it can be; and how."""
    width, lines = rows(data)
    counts = {}
    for line in lines:
        for x in range(0, len(line), 3):
            colour = line[x:x + 3]
            counts[colour] = counts.get(colour, 0) + 1
    for colours in COLOURS:
        chosen = palette(counts, colours)
        table = sorted(set(chosen.values()))
        number = {colour: table.index(to) for colour, to in chosen.items()}
        indexed = [bytes(number[line[x:x + 3]] for x in range(0, len(line), 3)) for line in lines]
        found = recompressed(encoded(width, indexed, b"".join(table)))
        if len(found) <= most:
            break
    return found, f"colours={len(table)} of {len(counts)}"
