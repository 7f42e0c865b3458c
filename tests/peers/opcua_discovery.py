"""Two OPC UA servers of asyncua, for a test of tickbus find: the second registers with the first, as with a discovery server.

It prints their ports, and ends at the end of stdin.
"""

import asyncio
import socket
import sys

from asyncua import Server


async def server(port, name):
    made = Server()
    await made.init()
    made.set_endpoint(f"opc.tcp://127.0.0.1:{port}/{name}")
    made.set_server_name(name)
    await made.set_application_uri(f"urn:test:{name}")
    return made


def free_ports():
    with socket.socket() as first, socket.socket() as second:
        for each in (first, second):
            each.bind(("127.0.0.1", 0))
        return first.getsockname()[1], second.getsockname()[1]


async def main():
    own, other = free_ports()
    async with await server(own, "discovery"), await server(other, "press") as press:
        await press.register_to_discovery(f"opc.tcp://127.0.0.1:{own}/discovery", 60)
        print(own, other, flush=True)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


asyncio.run(main())
