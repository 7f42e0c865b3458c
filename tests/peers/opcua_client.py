"""An OPC UA client of asyncua, for tests of tickbus as its server.

The only argument is JSON: {"url", "security": "Policy,Mode,own.der,own.pem,server.der" or null, "uri", "user",
"password", "certificate"}; with "certificate" it only makes a certificate in that folder. It prints "ready" when it
has a session, or "refused WHY", then obeys a line of JSON from stdin at a time, and answers each with one:
    {"browse": true}                 {"tree": {folder: [names]}}
    {"read": node}                   {"value", "type", "status", "source"}
    {"write": {node: [type, value]}} {"statuses": […]}, all in one Write
    {"subscribe": [nodes, interval, queue]}  {}
    {"changes": node}                {"values": […]} since the last time
    {"items": true}                  {"ids", "handles"} of that subscription, by the server's method
    {"properties": node}             {name: value as text}
    {"status": true}                 {"start", "time"}, of the structure ServerStatus, in seconds
    {"endpoints": true}              {"urls": […]}, as the server announces them
    {"nodes": true}                  {"nodes": {node id: browse name}} of namespaces from 2 on
    {"names": true}                  {"namespaces", "application", "build"}, as the server names itself
    {"timed": node}                  {"millis"}: how long a Read took
    {"call": [object, method]}       {"status"}
    {"compare": file, "namespace": uri}  {"nodes", "differ": [texts]}: asyncua's own import of the file beside the server
    {"structure": node, "set": {member: value}}  {"value", "status"}: a structure as JSON, by the server's definitions;
                                     with "set" it is written with these members; {"of": name, member: value} is a
                                     structure of that name, and a list of them is a whole array
    {"range": [node, range, type, values]}   {"status"} of a Write with an IndexRange; null values read: {"value"}
    {"stop": true}                   and at the end of stdin
"""

import asyncio
import dataclasses
import json
import logging
import socket
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

from asyncua import Client, Server, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID


class Changes:
    def __init__(self):
        self.of = {}

    def datachange_notification(self, node, value, data):
        self.of.setdefault(node.nodeid.Identifier, []).append(value)


async def make_certificate(folder, uri):
    folder = Path(folder)
    await setup_self_signed_certificate(
        folder / "client.pem", folder / "client.der", uri, socket.gethostname(),
        [ExtendedKeyUsageOID.CLIENT_AUTH],
        {"countryName": "EU", "stateOrProvinceName": "x", "localityName": "x", "organizationName": "ACME"},
    )


def made(value):
    """A value with its structures."""
    if isinstance(value, list):
        return [made(one) for one in value]
    if isinstance(value, dict):
        return getattr(ua, value["of"])(**{name: made(one) for name, one in value.items() if name != "of"})
    return value


ATTRIBUTES = [ua.AttributeIds.NodeClass, ua.AttributeIds.BrowseName, ua.AttributeIds.DisplayName]


async def facts(node):
    """The attributes of a node, and its references."""
    values = [(await node.read_attribute(attribute)).Value.Value for attribute in ATTRIBUTES]
    return values, await node.get_references()


async def imported(file, uri):
    """asyncua's own import of a NodeSet file: its namespaces, and of each node of `uri` its facts."""
    server = Server()
    await server.init()
    await server.import_xml(file)
    index = await server.get_namespace_index(uri)
    # asyncua adds some nodes of its own.
    listed = {element.get("NodeId") for element in ElementTree.parse(file).getroot()} - {None}
    listed = {ua.NodeId.from_string(id) for id in listed}
    listed = {(id.Identifier, id.NodeIdType) for id in listed if id.NamespaceIndex == 1}
    ids = [id for id in list(server.iserver.aspace._nodes) if id.NamespaceIndex == index]
    ids = [id for id in ids if (id.Identifier, id.NodeIdType) in listed]
    return await server.get_namespace_array(), {id: await facts(server.get_node(id)) for id in ids}


async def compare(client, file, uri):
    """Reads every node of the file's namespace from the server, and from asyncua's own import of the file."""
    # In a thread: the import takes seconds, and the client's session must be kept meanwhile.
    own_uris, own = await asyncio.to_thread(lambda: asyncio.run(imported(file, uri)))
    uris = await client.get_namespace_array()
    there, differ = uris.index(uri), []

    def theirs(index):
        return uris.index(own_uris[index]) if index else 0

    def same(references, change):
        def one(id):
            return change(id.NamespaceIndex), str(id.Identifier)

        return {(one(r.ReferenceTypeId), r.IsForward, one(r.NodeId)) for r in references}

    for id, (mine, references) in own.items():
        try:
            other = client.get_node(ua.NodeId(id.Identifier, there, id.NodeIdType))
            found, found_references = await facts(other)
        except Exception as error:
            differ.append(f"{id.to_string()}: {type(error).__name__} {error}")
            continue
        name, text = mine[1], mine[2].Text
        expected = (mine[0], theirs(name.NamespaceIndex), name.Name, text)
        got = (found[0], found[1].NamespaceIndex, found[1].Name, found[2].Text)
        if expected != got:
            differ.append(f"{id.to_string()}: {expected} and {got}")
        only = same(references, theirs) ^ same(found_references, lambda index: index)
        if only:
            differ.append(f"{id.to_string()} references: {sorted(map(str, only))[:4]}")
    return {"nodes": len(own), "differ": differ}


async def lines():
    loop = asyncio.get_running_loop()
    while True:
        line = await loop.run_in_executor(None, sys.stdin.readline)
        if not line:
            return
        yield json.loads(line)


async def serve(client):
    changes, subscription, structures = Changes(), None, False

    def identifier(name):
        return ua.NodeId.from_string(name) if name.startswith("ns=") else ua.NodeId(name, 2)

    def node(name):
        standard = getattr(ua.ObjectIds, name, None)
        return client.get_node(ua.NodeId(standard) if standard else identifier(name))

    async for line in lines():
        answer = {}
        if "browse" in line:
            tree = {}
            for top in await client.nodes.objects.get_children():
                if top.nodeid.NamespaceIndex == 2:
                    for child in [top] + await top.get_children():
                        name = (await child.read_browse_name()).Name
                        below = [(await one.read_browse_name()).Name for one in await child.get_children()]
                        if below:
                            tree[name] = below
            answer["tree"] = tree
        if "read" in line:
            value = await node(line["read"]).read_data_value(raise_on_bad_status=False)
            answer = {
                "value": value.Value.Value if value.Value else None,
                "type": value.Value.VariantType.name if value.Value else None,
                "status": value.StatusCode.name,
                "source": value.SourceTimestamp is not None,
            }
        if "write" in line:
            names = list(line["write"])
            values = [
                ua.DataValue(ua.Variant(value, getattr(ua.VariantType, kind)))
                for kind, value in line["write"].values()
            ]
            statuses = await client.uaclient.write_attributes(
                [identifier(name) for name in names], values
            )
            answer["statuses"] = [status.name for status in statuses]
        if "subscribe" in line:
            names, interval, queue = line["subscribe"]
            subscription = await client.create_subscription(interval, changes)
            await subscription.subscribe_data_change(
                [node(name) for name in names], queuesize=queue, sampling_interval=0
            )
        if "changes" in line:
            answer["values"] = changes.of.pop(node(line["changes"]).nodeid.Identifier, [])
        if "items" in line:
            asked = ua.Variant(subscription.subscription_id, ua.VariantType.UInt32)
            method = ua.NodeId(ua.ObjectIds.Server_GetMonitoredItems)
            answer["ids"], answer["handles"] = await node("Server").call_method(method, asked)
        if "properties" in line:
            for one in await node(line["properties"]).get_properties():
                answer[(await one.read_browse_name()).Name] = str(await one.read_value())
        if "status" in line:
            status = await client.get_node(ua.NodeId(ua.ObjectIds.Server_ServerStatus)).read_value()
            answer = {"start": status.StartTime.timestamp(), "time": status.CurrentTime.timestamp()}
        if "endpoints" in line:
            answer["urls"] = [one.EndpointUrl for one in await client.get_endpoints()]
        if "nodes" in line:
            found, to_do = {}, [client.nodes.objects]
            while to_do:
                for child in await to_do.pop().get_children():
                    if child.nodeid.NamespaceIndex > 1:
                        name = await child.read_browse_name()
                        found[child.nodeid.to_string()] = f"{name.NamespaceIndex}:{name.Name}"
                        to_do.append(child)
            answer["nodes"] = found
        if "names" in line:
            status = await client.get_node(ua.NodeId(ua.ObjectIds.Server_ServerStatus)).read_value()
            server = (await client.get_endpoints())[0].Server
            answer = {
                "namespaces": await client.get_namespace_array(),
                "application": [server.ApplicationName.Text, server.ApplicationUri, server.ProductUri],
                "build": [
                    status.BuildInfo.ManufacturerName, status.BuildInfo.ProductName,
                    status.BuildInfo.SoftwareVersion, status.BuildInfo.BuildNumber,
                ],
            }
        if "call" in line:
            on, method = line["call"]
            try:
                await node(on).call_method(ua.NodeId.from_string(method))
                answer["status"] = "Good"
            except ua.UaError as error:
                answer["status"] = type(error).__name__
        if "compare" in line:
            answer = await compare(client, line["compare"], line["namespace"])
        if "structure" in line:
            if not structures:
                await client.load_data_type_definitions()
                structures = True
            one = node(line["structure"])
            value = (await one.read_data_value(raise_on_bad_status=False)).Value.Value
            if value is None and not isinstance(line.get("set"), list):
                value = ua.extension_objects_by_datatype[await one.read_data_type()]()
            members = line.get("set", {})
            if isinstance(members, list):
                value, members = made(members), {}
            for path, new in members.items():
                *way, last = path.split(".")
                inner = value
                for name in way:
                    inner = getattr(inner, name)
                setattr(inner, last, made(new))
            if "set" in line:
                wrote = await client.uaclient.write_attributes([one.nodeid], [ua.DataValue(value)])
                answer["status"] = wrote[0].name
            is_list = isinstance(value, list)
            answer["value"] = list(map(dataclasses.asdict, value)) if is_list else dataclasses.asdict(value)
        if "range" in line:
            name, part, kind, values = line["range"]
            if values is None:
                wanted = ua.ReadValueId(identifier(name), ua.AttributeIds.Value, part)
                asked = ua.ReadParameters(NodesToRead=[wanted])
                answer["value"] = (await client.uaclient.read(asked))[0].Value.Value
            else:
                value = ua.Variant(values, getattr(ua.VariantType, kind))
                one = ua.WriteValue(identifier(name), ua.AttributeIds.Value, part, ua.DataValue(value))
                wrote = await client.uaclient.write(ua.WriteParameters(NodesToWrite=[one]))
                answer["status"] = wrote[0].name
        if "timed" in line:
            begin = time.monotonic()
            await client.uaclient.read_attributes([identifier(line["timed"])], ua.AttributeIds.Value)
            answer["millis"] = (time.monotonic() - begin) * 1000
        if "stop" in line:
            return
        print(json.dumps(answer, default=str), flush=True)


async def main():
    asked = json.loads(sys.argv[1])
    if asked.get("certificate"):
        await make_certificate(asked["certificate"], asked["uri"])
        print("ready", flush=True)
        return
    client = Client(asked["url"], timeout=5)
    if asked.get("uri"):
        client.application_uri = asked["uri"]
    if asked.get("user"):
        client.set_user(asked["user"])
        client.set_password(asked["password"])
    try:
        if asked.get("security"):
            await client.set_security_string(asked["security"])
        await client.connect()
    except Exception as error:
        print(f"refused {type(error).__name__} {error}".replace("\n", " "), flush=True)
        return
    print("ready", flush=True)
    try:
        await serve(client)
    finally:
        await client.disconnect()


logging.disable(logging.CRITICAL)
asyncio.run(main())
