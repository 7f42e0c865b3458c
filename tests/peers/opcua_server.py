"""An OPC UA server of asyncua, for tests of tickbus as its client.

The only argument is JSON: {"url", "security": ["None", …], "folder", "user", "password", "nodes": {name: [type, value]},
"denied": [name, …]}; clients cannot read nodes that are denied.
It prints "ready" on stdout, then obeys a line of JSON from stdin at a time, and answers each with one:
    {"set": {name: value}}           writes good values
    {"status": {name: "Bad…"}}       writes the last value again, with that status
    {"get": name}                    {"value": …}
    {"state": number}                the server's reported state
    {"stop": true}                   and at the end of stdin
"""

import asyncio
import gc
import json
import logging
import socket
import sys
from pathlib import Path

from asyncua import Server, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.server.user_managers import UserManager
from asyncua.crypto.permission_rules import User, UserRole
from cryptography.x509.oid import ExtendedKeyUsageOID

URI = "urn:test:plc"
POLICIES = {
    "None": ua.SecurityPolicyType.NoSecurity,
    "Basic256Sha256": ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    "Basic256Sha256 Sign": ua.SecurityPolicyType.Basic256Sha256_Sign,
    "Aes128_Sha256_RsaOaep": ua.SecurityPolicyType.Aes128Sha256RsaOaep_SignAndEncrypt,
    "Aes256_Sha256_RsaPss": ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
}


class OneUser(UserManager):
    def __init__(self, user, password):
        self.known = (user, password)

    def get_user(self, iserver, username=None, password=None, certificate=None):
        if isinstance(password, bytes):
            password = password.decode()
        return User(role=UserRole.User) if (username, password) == self.known else None


async def lines():
    loop = asyncio.get_running_loop()
    while True:
        line = await loop.run_in_executor(None, sys.stdin.readline)
        if not line:
            return
        yield json.loads(line)


async def main():
    # The standard's thousands of nodes are never garbage, and without a search for it they are created in half the time.
    gc.disable()
    asked = json.loads(sys.argv[1])
    manager = OneUser(asked["user"], asked["password"]) if asked.get("user") else None
    server = Server(user_manager=manager)
    await server.init()
    gc.freeze()
    gc.enable()
    await server.set_application_uri(URI)
    await server.set_build_info("urn:test", "ACME", "ACME PLC", "1", "1", ua.uatypes.datetime.now())
    server.set_endpoint(asked["url"])
    server.set_security_policy([POLICIES[name] for name in asked["security"]])
    if asked["security"] != ["None"]:
        folder = Path(asked["folder"])
        key, certificate = folder / "server.pem", folder / "server.der"
        await setup_self_signed_certificate(
            key, certificate, URI, socket.gethostname(),
            [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH],
            {"countryName": "EU", "stateOrProvinceName": "x", "localityName": "x",
             "organizationName": "ACME"},
        )
        await server.load_certificate(str(certificate))
        await server.load_private_key(str(key))
    await server.register_namespace("urn:test:signals")
    nodes, kinds, values = {}, {}, {}
    for name, (kind, value) in asked["nodes"].items():
        kinds[name] = getattr(ua.VariantType, kind)
        values[name] = value
        node = await server.nodes.objects.add_variable(
            ua.NodeId(name, 2), name, ua.Variant(value, kinds[name])
        )
        await node.set_writable()
        if name in asked.get("denied", []):
            for attribute in (ua.AttributeIds.AccessLevel, ua.AttributeIds.UserAccessLevel):
                await node.unset_attr_bit(attribute, ua.AccessLevel.CurrentRead)
        nodes[name] = node
    async with server:
        print("ready", flush=True)
        async for line in lines():
            answer = {}
            for name, value in line.get("set", {}).items():
                await nodes[name].write_value(ua.Variant(value, kinds[name]))
                values[name] = value
            for name, status in line.get("status", {}).items():
                value = ua.DataValue(
                    ua.Variant(values[name], kinds[name]),
                    StatusCode=ua.StatusCode(getattr(ua.StatusCodes, status)),
                )
                await server.write_attribute_value(nodes[name].nodeid, value)
            if "state" in line:
                state = server.get_node(ua.NodeId(ua.ObjectIds.Server_ServerStatus_State))
                await state.write_value(ua.Variant(line["state"], ua.VariantType.Int32))
            if "get" in line:
                answer["value"] = await nodes[line["get"]].read_value()
            if "stop" in line:
                return
            print(json.dumps(answer), flush=True)


logging.disable(logging.CRITICAL)
asyncio.run(main())
