//! asyncua as a client of the server: which clients count as peers, and which are admitted.

use serde_json::{Value, json};
use tickbus::fieldbus::LinkState;

use tickbus_conformance::rig::logged;

use super::device::{Device, Peer};
use crate::harness::Absent;

const OPEN: &str =
    "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true\ncycle = \"5ms\"";

/// Two machines behind one server.
const STATIONS: &str = r#"
[[station]]
name = "A"

[[station]]
name = "B"

[[signal]]
name      = "A speed"
station   = "A"
address   = "%QW0"
type      = "INT"
scale     = { raw = [0, 100], value = [0.0, 10.0] }
fail_safe = -1

[[signal]]
name      = "B speed"
station   = "B"
address   = "%QW0"
type      = "INT"
fail_safe = -1
"#;

fn client(device: &Device) -> Result<Peer, Absent> {
    let url = format!("opc.tcp://{}", device.address());
    Peer::ready("opcua_client.py", &json!({"url": url}))
}

fn status(client: &mut Peer, node: &str) -> Value {
    client.ask(&json!({"read": node}))["status"].take()
}

/// Two PLCs write one station each, and one dies: only its station's data grow old.
pub(super) fn ages_apart() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut device = Device::open_with(folder, "opcua-server", OPEN, STATIONS);
    let (mut one, mut other) = (client(&device)?, client(&device)?);
    for (client, node) in [(&mut one, "A speed"), (&mut other, "B speed")] {
        client.ask(&json!({"write": {node: ["Int16", 70]}}));
        // A value just written by a client has good quality, however long there had been silence.
        for _ in 0..20 {
            assert_eq!(status(client, node), json!("Good"));
        }
    }
    device.until("both values", |end| {
        end.get("A speed") == 7.0 && end.get("B speed") == 70.0
    });
    // The written value also appears in engineering units.
    let scaled = one.ask(&json!({"read": "A speed.scaled"}));
    assert_eq!(
        (&scaled["value"], &scaled["status"]),
        (&json!(7.0), &json!("Good"))
    );
    one.child.kill().expect("it lived");
    device.until("its station alone is stale", |end| {
        assert_eq!(status(&mut other, "B speed"), json!("Good"));
        assert_eq!(end.get("B speed"), 70.0, "its writer is there");
        end.get("A speed") == -1.0
    });
    device.until("its node says so", |_| {
        status(&mut other, "A speed") == json!("UncertainLastUsableValue")
    });
    let mut third = client(&device)?;
    third.ask(&json!({"write": {"A speed": ["Int16", 80]}}));
    for _ in 0..20 {
        assert_eq!(status(&mut third, "A speed"), json!("Good"));
    }
    device.until("the value", |end| end.get("A speed") == 8.0);
    Ok(())
}

/// However many items others leave behind, a client that only reads stays connected. The server is recreated
/// when no client is connected, and new clients do not notice.
pub(super) fn undisturbed() -> Result<(), Absent> {
    let mut device = Device::open("opcua-server", OPEN);
    let mut reader = client(&device)?;
    let read = |reader: &mut Peer| {
        assert!(status(reader, "position").is_string(), "an answer");
    };
    read(&mut reader);
    for _ in 0..3 {
        let mut visitor = client(&device)?;
        let nodes = ["sensor", "position", "temperature", "count"].repeat(15);
        visitor.ask(&json!({"subscribe": [nodes, 10, 1]}));
        read(&mut reader);
        drop(visitor);
        (0..50).for_each(|_| read(&mut reader));
    }
    let begun = |device: &Device| {
        let statistics = device.end.driver.statistics();
        statistics.contains("opcua.begun_anew=")
    };
    assert!(!begun(&device), "while somebody is there");
    drop(reader);
    let mut rounds = 0;
    while !begun(&device) {
        // Clients that connect at this moment are served, by the old or the new server.
        let mut newcomer = client(&device)?;
        read(&mut newcomer);
        rounds += 1;
        assert!(rounds < 500, "{}", device.end.driver.statistics());
    }
    let mut newcomer = client(&device)?;
    newcomer.ask(&json!({"subscribe": [["sensor"], 10, 10]}));
    device.end.set("sensor", 1.0);
    device.until("the change is reported", |_| {
        let values = newcomer.ask(&json!({"changes": "sensor"}))["values"].take();
        values
            .as_array()
            .is_some_and(|list| list.contains(&json!(true)))
    });
    Ok(())
}

/// The structure `ServerStatus`, and the announced URLs.
pub(super) fn tells_of_itself() -> Result<(), Absent> {
    let device = Device::open(
        "opcua-server",
        &format!("{OPEN}\nhost = \"plc-side.example\""),
    );
    let mut client = client(&device)?;
    let read = |client: &mut Peer| {
        let status = client.ask(&json!({"status": true}));
        let number = |key: &str| status[key].as_f64().expect("seconds");
        (number("start"), number("time"))
    };
    let (start, first) = read(&mut client);
    assert!(first >= start, "{first} {start}");
    while read(&mut client).1 <= first {}
    let urls = client.ask(&json!({"endpoints": true}))["urls"].take();
    let port = device.address().port();
    assert_eq!(urls, json!([format!("opc.tcp://plc-side.example:{port}/")]));
    let mut value = |node: &str| client.ask(&json!({"read": node}))["value"].take();
    let (namespaces, servers) = (value("Server_NamespaceArray"), value("Server_ServerArray"));
    assert_eq!(namespaces[0], json!("http://opcfoundation.org/UA/"));
    assert_eq!(namespaces[1], servers[0], "its own URI");
    assert_eq!(namespaces[2], json!("urn:tickbus:signals"));
    for (node, right) in [
        ("Server_ServerStatus_State", json!(0)),
        (
            "Server_ServerStatus_BuildInfo_ProductName",
            json!("tickbus"),
        ),
        (
            "Server_ServerCapabilities_OperationLimits_MaxNodesPerRead",
            json!(10_000),
        ),
        (
            "HistoryServerCapabilities_AccessHistoryDataCapability",
            json!(false),
        ),
    ] {
        assert_eq!(value(node), right, "{node}");
    }
    Ok(())
}

/// A subscriber receives the server's time again and again, and the server returns its items by the standard method.
pub(super) fn tells_the_time() -> Result<(), Absent> {
    const TIME: &str = "Server_ServerStatus_CurrentTime";
    let mut device = Device::open("opcua-server", OPEN);
    let mut client = client(&device)?;
    client.ask(&json!({"subscribe": [[TIME, "position"], 10, 1]}));
    let items = client.ask(&json!({"items": true}));
    for list in ["ids", "handles"] {
        assert_eq!(items[list].as_array().map(Vec::len), Some(2), "{items}");
    }
    let mut times = Vec::new();
    device.until("three times", |_| {
        let values = client.ask(&json!({"changes": TIME}))["values"].take();
        times.extend(
            values
                .as_array()
                .into_iter()
                .flatten()
                .map(Value::to_string),
        );
        times.len() > 2
    });
    assert!(times.is_sorted_by(|one, next| one < next), "{times:?}");
    Ok(())
}

/// A client with a trusted certificate that claims to be another application than the certificate's.
pub(super) fn impostor() -> Result<(), Absent> {
    logged::expect("a client with an unknown certificate was turned away");
    logged::expect("a client gets no values, as its certificate is not its own");
    let folder = tempfile::tempdir().expect("a folder");
    let made = json!({"certificate": folder.path(), "uri": "urn:test:client"});
    drop(Peer::ready("opcua_client.py", &made)?);
    let mut device = Device::open(
        "opcua-server",
        "address = \"127.0.0.1:0\"\nanonymous = true\ncycle = \"5ms\"",
    );
    device.end.tick();
    let url = format!("opc.tcp://{}", device.address());
    let own = folder.path().join("client");
    let security = format!(
        "Basic256Sha256,SignAndEncrypt,{0}.der,{0}.pem,{1}",
        own.display(),
        device.pki().join("own/tickbus-7.der").display()
    );
    let asked = |uri: &str| json!({"url": url, "uri": uri, "security": security});
    let trusted = device.pki().join("trusted");
    let (_, refused) = Peer::start("opcua_client.py", &asked("urn:test:client"))?;
    assert!(refused.starts_with("refused"), "{refused}");
    for file in std::fs::read_dir(device.pki().join("rejected")).expect("a folder") {
        let file = file.expect("a file");
        std::fs::rename(file.path(), trusted.join(file.file_name())).expect("it is there");
    }

    let mut client = Peer::ready("opcua_client.py", &asked("urn:somebody:else"))?;
    let refused = json!("BadCertificateUriInvalid");
    assert_eq!(status(&mut client, "position"), refused);
    let written = client.ask(&json!({"write": {"speed": ["Int16", 5]}}));
    assert_eq!(written["statuses"], json!([refused]));
    assert_eq!(device.end.link().state, LinkState::Opening, "no peer");
    assert_eq!(device.end.statistic("opcua.refused_applications"), "1");
    drop(client);

    let mut client = Peer::ready("opcua_client.py", &asked("urn:test:client"))?;
    device.end.tick();
    assert_eq!(status(&mut client, "position"), json!("Good"));
    client.ask(&json!({"write": {"speed": ["Int16", 6]}}));
    device.until("the value", |end| end.get("speed") == 6.0);
    Ok(())
}
