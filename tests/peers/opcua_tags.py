"""An OPC UA server of asyncua with folders to browse, for tests of the studio.

The only argument is JSON: {"url", "security", "folder"}, as for opcua_server.py. It prints "ready", and ends at the end of
stdin. In the folder Cell, Level counts up and Lamp toggles all the time.
"""

import asyncio
import gc
import json
import logging
import socket
import sys
import uuid
from pathlib import Path

from asyncua import Server, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID

URI = "urn:test:plc"
MANY = 2500


async def secure(server, folder):
    key, certificate = folder / "server.pem", folder / "server.der"
    await setup_self_signed_certificate(
        key, certificate, URI, socket.gethostname(),
        [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH],
        {"countryName": "EU", "stateOrProvinceName": "x", "localityName": "x", "organizationName": "ACME"},
    )
    await server.load_certificate(str(certificate))
    await server.load_private_key(str(key))


async def build(server):
    index = await server.register_namespace("urn:test:signals")
    cell = await server.nodes.objects.add_folder(ua.NodeId("Cell", index), "Cell")

    async def variable(name, kind, value, node=None, comment=""):
        node = node or ua.NodeId(f"Cell.{name}", index)
        made = await cell.add_variable(node, name, ua.Variant(value, kind))
        if comment:
            text = ua.Variant(ua.LocalizedText(comment), ua.VariantType.LocalizedText)
            await made.write_attribute(ua.AttributeIds.Description, ua.DataValue(text))
        return made

    level = await variable("Level", ua.VariantType.Int16, 0, comment="Of the tank, in <b>mm</b>")
    lamp = await variable("Lamp", ua.VariantType.Boolean, False)
    speed = await variable("Speed", ua.VariantType.Float, 1.5)
    await speed.set_writable()
    markup = "<img src=x onerror=alert(1)>"
    await (await variable(markup, ua.VariantType.Boolean, False, comment=markup)).set_writable()
    await variable("List", ua.VariantType.Int32, [1, 2, 3])
    await variable("Text", ua.VariantType.String, "on")
    await variable("Opaque", ua.VariantType.Int16, 1, node=ua.NodeId(uuid.UUID(int=7), index))

    def start(_parent):
        return []

    await cell.add_method(ua.NodeId("Cell.Start", index), "Start", start)
    inner = await cell.add_folder(ua.NodeId("Cell.Inner", index), "Inner")
    # The same name as above, and a way back.
    made = await inner.add_variable(ua.NodeId("Cell.Inner.Level", index), "Level", ua.Variant(3, ua.VariantType.UInt32))
    await made.set_writable()
    await inner.add_reference(cell, ua.ObjectIds.HasComponent, bidirectional=False)
    await inner.add_reference(server.nodes.objects, ua.ObjectIds.Organizes, bidirectional=False)
    many = await cell.add_folder(ua.NodeId("Cell.Many", index), "Many")
    for number in range(MANY):
        await many.add_variable(ua.NodeId(100000 + number, index), f"V{number}", ua.Variant(0, ua.VariantType.Int16))
    return level, lamp


async def main():
    gc.disable()
    asked = json.loads(sys.argv[1])
    server = Server()
    await server.init()
    gc.freeze()
    gc.enable()
    await server.set_application_uri(URI)
    server.set_endpoint(asked["url"])
    is_secure = asked["security"] != "None"
    policy = ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt if is_secure else ua.SecurityPolicyType.NoSecurity
    server.set_security_policy([policy])
    if is_secure:
        await secure(server, Path(asked["folder"]))
    level, lamp = await build(server)
    async with server:
        print("ready", flush=True)
        ended = asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        count = 0
        while not ended.done():
            count += 1
            await level.write_value(ua.Variant(count % 30000, ua.VariantType.Int16))
            await lamp.write_value(ua.Variant(count % 2 == 0, ua.VariantType.Boolean))
            await asyncio.sleep(0.05)


logging.disable(logging.CRITICAL)
asyncio.run(main())
