//! asyncua as a client of a server with the node ids and the names of a real device, and of one whose answers are late.

use serde_json::json;

use super::device::{Device, Peer};
use crate::harness::Absent;

const OPEN: &str = r#"address = "127.0.0.1:0"
security = "None"
anonymous = true
cycle = "5ms"
namespaces = ["http://opcfoundation.org/UA/DI/", "http://acme.example/press/"]
identity = { application = "Press 7", uri = "urn:acme:press:7", manufacturer = "ACME", product = "PX", product_uri = "urn:acme:px", version = "2.1", build = "77" }

[fieldbus.at]
run         = "ns=4;s=Press.Run"
speed       = "nsu=http://acme.example/press/;i=6001"
torque      = "ns=3;i=6002"
sensor      = "ns=4;i=6001"
position    = "ns=3;s=Press;Position"
temperature = "nsu=http://acme.example/oven/;i=1"
count       = "ns=2;i=7"
"#;

fn open() -> Result<(Device, Peer), Absent> {
    let device = Device::open("opcua-server", OPEN);
    let url = format!("opc.tcp://{}", device.address());
    let client = Peer::ready("opcua_client.py", &json!({"url": url}))?;
    Ok((device, client))
}

pub(super) fn finds_a_device() -> Result<(), Absent> {
    let (mut device, mut client) = open()?;
    let names = client.ask(&json!({"names": true}));
    assert_eq!(
        names["namespaces"].as_array().expect("a list")[1..],
        [
            "urn:acme:press:7",
            "http://opcfoundation.org/UA/DI/",
            "http://acme.example/press/",
            "urn:tickbus:namespace:4",
            "http://acme.example/oven/",
            "urn:tickbus:signals"
        ]
    );
    assert_eq!(
        names["application"],
        json!(["Press 7", "urn:acme:press:7", "urn:acme:px"])
    );
    assert_eq!(names["build"], json!(["ACME", "PX", "2.1", "77"]));

    let nodes = client.ask(&json!({"nodes": true}));
    for (node, name) in [
        ("ns=4;s=Press.Run", "4:run"),
        ("ns=3;i=6001", "3:speed"),
        ("ns=3;i=6002", "3:torque"),
        ("ns=4;i=6001", "4:sensor"),
        ("ns=3;s=Press;Position", "3:position"),
        ("ns=6;s=position.scaled", "6:Scaled"),
        ("ns=5;i=1", "5:temperature"),
        ("ns=2;i=7", "2:count"),
    ] {
        assert_eq!(nodes["nodes"][node], name, "{node} of {nodes}");
    }
    let unit = client.ask(&json!({"properties": "ns=5;i=1"}));
    assert!(
        unit["EngineeringUnits"].to_string().contains("°C"),
        "{unit}"
    );
    let range = client.ask(&json!({"properties": "ns=6;s=position.scaled"}));
    assert!(
        range["EURange"].to_string().contains("High=276.48"),
        "{range}"
    );

    device.end.set("position", 138.24);
    device.end.tick();
    let read = client.ask(&json!({"read": "ns=3;s=Press;Position"}));
    assert_eq!(
        (&read["value"], &read["type"]),
        (&json!(13824), &json!("Int16"))
    );
    let wrote = client.ask(&json!({"write": {
        "ns=3;i=6001": ["Int16", 77], "ns=3;i=6002": ["Float", 1.5], "ns=4;s=Press.Run": ["Boolean", true],
        "ns=4;i=6001": ["Boolean", true], "ns=3;i=6003": ["Int16", 1], "ns=2;s=speed": ["Int16", 1],
    }}));
    // In the order of their names.
    // In the order of the node ids.
    assert_eq!(
        wrote["statuses"],
        json!([
            "BadNodeIdUnknown",
            "Good",
            "Good",
            "BadNodeIdUnknown",
            "BadUserAccessDenied",
            "Good"
        ])
    );
    device.until("all of them", |end| {
        (end.get("speed"), end.get("torque"), end.get("run")) == (77.0, 1.5, 1.0)
    });
    let unknown = client.ask(&json!({"read": "ns=77;i=1"}));
    assert_eq!(unknown["status"], "BadNodeIdUnknown");
    Ok(())
}

/// How long Reads take, in milliseconds: the median of some.
fn millis(client: &mut Peer) -> f64 {
    let mut took: Vec<f64> = (0..15)
        .map(|_| {
            client.ask(&json!({"timed": "ns=4;i=6001"}))["millis"]
                .as_f64()
                .expect("a number")
        })
        .collect();
    took.sort_by(f64::total_cmp);
    took[took.len() / 2]
}

pub(super) fn meets_faults() -> Result<(), Absent> {
    let (mut device, mut client) = open()?;
    device.end.set("count", 5.0);
    device.end.tick();
    let read = |client: &mut Peer| client.ask(&json!({"read": "ns=2;i=7"}))["status"].take();
    let write = |client: &mut Peer| {
        client.ask(&json!({"write": {"ns=3;i=6001": ["Int16", 9]}}))["statuses"][0].take()
    };
    let inject = |device: &mut Device, fault: &str| {
        let fault = device.end.driver.inject_text(fault).expect("a right fault");
        device.end.tick();
        fault
    };
    let busy = inject(
        &mut device,
        "kind = \"answer-error\"\ncode = \"BadTooManyOperations\"\nfunction = 5",
    );
    assert_eq!(read(&mut client), "Good");
    assert_eq!(write(&mut client), "BadTooManyOperations");
    assert!(device.end.driver.end_fault(busy));
    let broken = inject(
        &mut device,
        "kind = \"answer-error\"\ncode = 0x808B0000\nfunction = 4",
    );
    assert_eq!(read(&mut client), "BadDeviceFailure");
    assert!(device.end.driver.end_fault(broken));
    device.end.tick();
    assert_eq!(
        device.end.get("speed"),
        -1.0,
        "what was refused has no effect"
    );
    assert_eq!(
        (read(&mut client), write(&mut client)),
        (json!("Good"), json!("Good"))
    );
    device.until("it is there", |end| end.get("speed") == 9.0);

    let usual = millis(&mut client);
    let late = inject(&mut device, "kind = \"answer-late\"\nby = \"150ms\"");
    let by = millis(&mut client) - usual;
    assert!((140.0..400.0).contains(&by), "{by}");
    assert!(device.end.driver.end_fault(late));
    device.end.tick();
    assert!(millis(&mut client) < 140.0);
    let counted = device.end.statistic("fault.answers");
    assert!(counted.parse::<u32>().expect("a number") >= 17, "{counted}");
    Ok(())
}

/// The signals of the model in tests/peers/press.NodeSet2.xml.
const PRESS: &str = r#"
[fieldbus.at]
force    = "nsu=http://acme.example/press/;i=6001"
setpoint = "ns=2;i=6003"
start    = "nsu=http://acme.example/press/;i=7001"

[[signal]]
name    = "force"
address = "%ID0"
type    = "REAL"

[[signal]]
name    = "setpoint"
address = "%QW0"
type    = "INT"

[[signal]]
name    = "start"
address = "%QX2.0"
latch   = "rising"
"#;

pub(super) fn has_an_address_space() -> Result<(), Absent> {
    let model = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/press.NodeSet2.xml"
    );
    let keys = format!(
        "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true\ncycle = \"5ms\"\nnodeset = {model:?}\n"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let mut device = Device::open_with(folder, "opcua-server", &keys, PRESS);
    let url = format!("opc.tcp://{}", device.address());
    let mut client = Peer::ready("opcua_client.py", &json!({"url": url}))?;
    let nodes = client.ask(&json!({"nodes": true}));
    assert_eq!(
        nodes["nodes"],
        json!({
            "ns=2;s=Press": "2:Press", "ns=2;i=6001": "2:Force", "ns=2;i=6002": "0:EURange",
            "ns=2;i=6003": "2:Setpoint", "ns=2;i=6004": "2:SerialNumber", "ns=2;i=7001": "2:Start",
            "ns=2;i=7002": "2:Stop",
        })
    );
    let like = json!({"compare": model, "namespace": "http://acme.example/press/"});
    let differ = client.ask(&like);
    assert_eq!(differ, json!({"nodes": 9, "differ": []}));
    let range = client.ask(&json!({"properties": "ns=2;i=6001"}));
    assert!(range["EURange"].to_string().contains("High=250"), "{range}");
    let serial = client.ask(&json!({"read": "ns=2;i=6004"}));
    assert_eq!(serial["value"], "P-7");

    device.end.set("force", 7.5);
    device.end.tick();
    let force = client.ask(&json!({"read": "ns=2;i=6001"}));
    assert_eq!(
        (&force["value"], &force["type"]),
        (&json!(7.5), &json!("Float"))
    );
    let wrote = client.ask(&json!({"write": {
        "ns=2;i=6001": ["Float", 1.0], "ns=2;i=6003": ["Int16", 9], "ns=2;i=6004": ["String", "x"],
    }}));
    assert_eq!(
        wrote["statuses"],
        json!(["BadUserAccessDenied", "Good", "BadNotWritable"])
    );
    device.until("it is there", |end| end.get("setpoint") == 9.0);

    for _ in 0..3 {
        device.end.tick();
        assert_eq!(
            client.ask(&json!({"call": ["ns=2;s=Press", "ns=2;i=7001"]}))["status"],
            "Good"
        );
        device.until("a pulse", |end| end.get("start") == 1.0);
        device.until("its end", |end| end.get("start") == 0.0);
    }
    let stop = client.ask(&json!({"call": ["ns=2;s=Press", "ns=2;i=7002"]}));
    assert_eq!(stop["status"], "BadNotImplemented");
    Ok(())
}

/// The signals in the variables of tests/peers/axes.NodeSet2.xml.
const AXES: &str = r#"
[fieldbus.at]
"force 0"   = "ns=2;i=6001[0]"
"force 2"   = "ns=2;i=6001[2]"
"set 1"     = "ns=2;s=Axes.Setpoints[1]"
"set 2"     = "ns=2;s=Axes.Setpoints[2]"
"on"        = "ns=2;i=6003.Enabled"
"x"         = "ns=2;i=6003.Place.X"
"speed 1"   = "ns=2;i=6003.Speeds[1]"
"mode"      = "ns=2;i=6003.Mode"
"target on" = "nsu=http://acme.example/axes/;i=6004.Enabled"
"target y"  = "nsu=http://acme.example/axes/;i=6004.Place.Y"

[[signal]]
name    = "force 0"
address = "%ID0"
type    = "REAL"

[[signal]]
name    = "force 2"
address = "%ID4"
type    = "REAL"

[[signal]]
name    = "on"
address = "%IX8.0"

[[signal]]
name    = "x"
address = "%ID12"
type    = "REAL"

[[signal]]
name    = "speed 1"
address = "%IW16"
type    = "INT"

[[signal]]
name    = "mode"
address = "%ID20"
type    = "DINT"

[[signal]]
name    = "set 1"
address = "%QW0"
type    = "INT"

[[signal]]
name    = "set 2"
address = "%QW2"
type    = "INT"

[[signal]]
name    = "target on"
address = "%QX4.0"

[[signal]]
name    = "target y"
address = "%QD8"
type    = "REAL"
"#;

pub(super) fn has_arrays_and_structures() -> Result<(), Absent> {
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/axes.NodeSet2.xml");
    let keys = format!(
        "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true\ncycle = \"5ms\"\nnodeset = {model:?}\n"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let mut device = Device::open_with(folder, "opcua-server", &keys, AXES);
    let url = format!("opc.tcp://{}", device.address());
    let mut client = Peer::ready("opcua_client.py", &json!({"url": url}))?;

    for (signal, value) in [
        ("force 0", 1.5),
        ("force 2", 2.5),
        ("on", 1.0),
        ("x", 4.25),
        ("speed 1", 7.0),
        ("mode", 1.0),
    ] {
        device.end.set(signal, value);
    }
    device.end.tick();
    let forces = client.ask(&json!({"read": "ns=2;i=6001"}));
    assert_eq!(
        (&forces["value"], &forces["type"], &forces["status"]),
        (&json!([1.5, 0.0, 2.5]), &json!("Float"), &json!("Good"))
    );
    let part = client.ask(&json!({"range": ["ns=2;i=6001", "1:2", "Float", null]}));
    assert_eq!(part["value"], json!([0.0, 2.5]));
    let actual = client.ask(&json!({"structure": "ns=2;i=6003"}));
    assert_eq!(
        actual["value"],
        json!({
            "Mode": 1, "Enabled": true, "Name": null, "Place": {"X": 4.25, "Y": 0.0}, "Speeds": [0, 7, 0]
        })
    );
    client.ask(&json!({"subscribe": [["ns=2;i=6001"], 10, 1]}));
    device.end.set("force 0", 3.5);
    device.end.set("force 2", 4.5);
    device.end.tick();
    device.until("the change", |_| {
        let told = client.ask(&json!({"changes": "ns=2;i=6001"}));
        let told = told["values"].as_array().expect("a list").clone();
        told.contains(&json!([3.5, 0.0, 4.5]))
    });

    let write = |client: &mut Peer, values: &serde_json::Value| {
        let write = json!({"write": {"ns=2;s=Axes.Setpoints": ["Int16", values]}});
        client.ask(&write)["statuses"][0].take()
    };
    assert_eq!(write(&mut client, &json!([1, 22, 33, 4])), "Good");
    device.until("both elements", |end| {
        (end.get("set 1"), end.get("set 2")) == (22.0, 33.0)
    });
    assert_eq!(write(&mut client, &json!([1, 2, 3])), "BadTypeMismatch");
    let range = |client: &mut Peer, part: &str, values: &serde_json::Value| {
        let range = json!({"range": ["ns=2;s=Axes.Setpoints", part, "Int16", values]});
        client.ask(&range)["status"].take()
    };
    assert_eq!(range(&mut client, "2:3", &json!([44, 55])), "Good");
    device.until("one of them", |end| {
        (end.get("set 1"), end.get("set 2")) == (22.0, 44.0)
    });
    assert_eq!(
        range(&mut client, "3:4", &json!([1, 2])),
        "BadIndexRangeNoData"
    );
    let all = client.ask(&json!({"read": "ns=2;s=Axes.Setpoints"}));
    assert_eq!(all["value"], json!([1, 22, 44, 55]));
    assert_eq!(
        client.ask(&json!({"write": {"ns=2;i=6001": ["Float", [1.0, 2.0, 3.0]]}}))["statuses"][0],
        "BadUserAccessDenied"
    );

    let target = json!({"structure": "ns=2;i=6004", "set": {"Enabled": true, "Place.Y": 2.5, "Name": "A", "Speeds": [1, 2, 3]}});
    assert_eq!(client.ask(&target)["status"], "Good");
    device.until("both members", |end| {
        (end.get("target on"), end.get("target y")) == (1.0, 2.5)
    });
    let target = client.ask(&json!({"structure": "ns=2;i=6004"}));
    assert_eq!(target["value"]["Name"], "A");
    Ok(())
}
