#!/usr/bin/env python3
"""A stand-in for a third-party PLC: the controller's end of a socket bus, with the standard library alone.

    plc.py HOST PORT RECORDS

It sends RECORDS records, each with another speed, and waits for the answer to each. The machine copies the speed to `copy`
and doubles it in `position`, sooner or later: the program continues with the next speed when the answer has both. The last
line has the result.
"""

import socket
import struct
import sys

# Big-endian, as the addresses of crates/core/conformance/src/rig.rs say:
# %QX0.0 run, %QW2 speed, %QW4 echo; %IX0.0 sensor, %IW2 position, %IW4 copy.
OUTPUTS = struct.Struct(">Bxhh")
INPUTS = struct.Struct(">Bxhh")


def receive(connection, size):
    """Reads exactly `size` bytes, however TCP splits them."""
    data = b""
    while len(data) < size:
        piece = connection.recv(size - len(data))
        if not piece:
            sys.exit(f"plc.py: failed: the machine left after {len(data)} of {size} bytes")
        data += piece
    return data


def main():
    host, port, records = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    sent = 0
    with socket.create_connection((host, port), timeout=20) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for number in range(1, records + 1):
            speed = -number * 7
            while True:
                connection.sendall(OUTPUTS.pack(number % 2, speed, number))
                sent += 1
                sensor, position, copy = INPUTS.unpack(receive(connection, INPUTS.size))
                if copy == speed:
                    break
            if (sensor, position) != (number % 2, speed * 2):
                sys.exit(f"plc.py: failed: sensor {sensor}, position {position} at speed {speed}")
    print(f"plc.py: ok records={sent}")


if __name__ == "__main__":
    main()
