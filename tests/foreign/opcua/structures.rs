//! asyncua and structures with arrays of structures, members that can be missing, and unions.

use serde_json::{Value, json};
use tickbus::signal::Slot;

use super::device::{Device, Peer};
use crate::harness::Absent;

/// The signals in the variables of tests/peers/axes.NodeSet2.xml: name, place, address, type.
const SIGNALS: &[(&str, &str, &str, &str)] = &[
    ("x 1", "ns=2;i=6005.Points[1].X", "%ID0", "REAL"),
    ("other y", "ns=2;i=6005.Others[1].Y", "%ID4", "REAL"),
    ("limit", "ns=2;i=6007.Limit", "%ID8", "REAL"),
    ("kind", "ns=2;i=6009.SwitchField", "%ID12", "UDINT"),
    ("whole", "ns=2;i=6009.Whole", "%IW16", "INT"),
    ("real", "ns=2;i=6009.Real", "%ID20", "REAL"),
    ("next y", "ns=2;i=6006.Points[0].Y", "%QD0", "REAL"),
    ("next limit", "ns=2;i=6008.Limit", "%QD4", "REAL"),
    ("next x", "ns=2;i=6008.Place.X", "%QD8", "REAL"),
    ("next real", "ns=2;i=6010.Real", "%QD12", "REAL"),
];

fn sections(signals: &[(&str, &str, &str, &str)]) -> String {
    let places = signals.iter();
    let places = places.map(|(name, place, ..)| format!("\"{name}\" = \"{place}\"\n"));
    let signals = signals.iter().map(|(name, _, address, of_type)| {
        format!("[[signal]]\nname = \"{name}\"\naddress = \"{address}\"\ntype = \"{of_type}\"\n")
    });
    format!(
        "[fieldbus.at]\n{}{}",
        places.collect::<String>(),
        signals.collect::<String>()
    )
}

/// Writes members of a structure; returns the status.
#[track_caller]
fn write(client: &mut Peer, node: &str, members: &Value) -> Value {
    client.ask(&json!({"structure": node, "set": members}))["status"].take()
}

pub(super) fn reach_every_member() -> Result<(), Absent> {
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/axes.NodeSet2.xml");
    let keys = format!(
        "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true\ncycle = \"5ms\"\nnodeset = {model:?}\n"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let mut device = Device::open_with(folder, "opcua-server", &keys, &sections(SIGNALS));
    let url = format!("opc.tcp://{}", device.address());
    let mut client = Peer::ready("opcua_client.py", &json!({"url": url}))?;
    for (signal, value) in [
        ("x 1", 1.5),
        ("other y", 2.5),
        ("limit", 3.5),
        ("kind", 1.0),
        ("whole", 7.0),
        ("real", 8.5),
    ] {
        device.end.set(signal, value);
    }
    device.end.tick();

    let read =
        |client: &mut Peer, node: &str| client.ask(&json!({"structure": node}))["value"].take();
    let point = |x: f64, y: f64| json!({"X": x, "Y": y});
    assert_eq!(
        read(&mut client, "ns=2;i=6005"),
        json!({"Number": 0, "Points": [point(0.0, 0.0), point(1.5, 0.0)], "Others": [point(0.0, 0.0), point(0.0, 2.5)]})
    );
    let recipe = read(&mut client, "ns=2;i=6007");
    let of_recipe = ["Number", "Limit", "Comment", "Place"].map(|member| recipe[member].clone());
    assert_eq!(of_recipe, [json!(0), json!(3.5), Value::Null, Value::Null]);
    let selected = |client: &mut Peer, node: &str| {
        let setting = read(client, node);
        (setting["Encoding"].clone(), setting["Value"].clone())
    };
    assert_eq!(selected(&mut client, "ns=2;i=6009"), (json!(1), json!(7)));
    device.end.set("kind", 2.0);
    device.end.tick();
    assert_eq!(selected(&mut client, "ns=2;i=6009"), (json!(2), json!(8.5)));
    for number in [0.0, 9.0] {
        device.end.set("kind", number);
        device.end.tick();
        let none = selected(&mut client, "ns=2;i=6009").0;
        assert_eq!(none, json!(0), "{number} selects no member");
    }

    let of_point = |x: f64, y: f64| json!({"of": "Point", "X": x, "Y": y});
    let route = json!({"Number": 3, "Points": [of_point(1.0, 4.5), of_point(2.0, 0.0)], "Others": [of_point(5.0, 6.0)]});
    assert_eq!(write(&mut client, "ns=2;i=6006", &route), "Good");
    device.until("the element's member", |end| end.get("next y") == 4.5);
    assert_eq!(
        read(&mut client, "ns=2;i=6006"),
        json!({"Number": 3, "Points": [point(1.0, 4.5), point(2.0, 0.0)], "Others": [point(5.0, 6.0)]})
    );
    let short = json!({"Points": [of_point(1.0, 9.5)]});
    assert_eq!(write(&mut client, "ns=2;i=6006", &short), "BadTypeMismatch");

    // A member with a signal that is left out keeps its value.
    let recipe = json!({"Number": 3, "Limit": 1.5, "Comment": "fast", "Place": null});
    assert_eq!(write(&mut client, "ns=2;i=6008", &recipe), "Good");
    device.until("the member", |end| end.get("next limit") == 1.5);
    let recipe = json!({"Limit": null, "Comment": null, "Place": of_point(2.5, 0.0)});
    assert_eq!(write(&mut client, "ns=2;i=6008", &recipe), "Good");
    device.until("the other member", |end| end.get("next x") == 2.5);
    assert_eq!(device.end.get("next limit"), 1.5);
    let recipe = read(&mut client, "ns=2;i=6008");
    assert_eq!(
        (&recipe["Limit"], &recipe["Comment"], &recipe["Place"]),
        (&json!(1.5), &Value::Null, &point(2.5, 0.0))
    );

    assert_eq!(
        write(&mut client, "ns=2;i=6010", &json!({"Real": 6.5})),
        "Good"
    );
    device.until("the union's member", |end| end.get("next real") == 6.5);
    assert_eq!(
        write(
            &mut client,
            "ns=2;i=6010",
            &json!({"Place": of_point(1.0, 2.0)})
        ),
        "Good"
    );
    assert_eq!(
        selected(&mut client, "ns=2;i=6010"),
        (json!(3), point(1.0, 2.0))
    );
    assert_eq!(device.end.get("next real"), 6.5);
    Ok(())
}

/// The signals of the machine in tests/peers/moulding.NodeSet2.xml.
const MOULDING: &[(&str, &str, &str, &str)] = &[
    (
        "status",
        "nsu=http://acme.example/moulding/;s=IMM.Job.Status",
        "%ID0",
        "DINT",
    ),
    (
        "good",
        "nsu=http://acme.example/moulding/;s=IMM.Job.Good",
        "%IL8",
        "ULINT",
    ),
    (
        "cycle",
        "nsu=http://acme.example/moulding/;s=IMM.Job.LastCycle",
        "%IL16",
        "LREAL",
    ),
    (
        "p 0",
        "nsu=http://acme.example/moulding/;s=IMM.Zone.PID[0].P",
        "%QL0",
        "LREAL",
    ),
    (
        "d 1",
        "nsu=http://acme.example/moulding/;s=IMM.Zone.PID[1].D",
        "%QL8",
        "LREAL",
    ),
];

/// A machine of Euromap 77 by the public models, which no registry has: `UA_NODESETS` names a checkout of them.
pub(super) fn make_a_moulding_machine() -> Result<(), Absent> {
    let Some(models) = std::env::var_os("UA_NODESETS").map(std::path::PathBuf::from) else {
        return Err(Absent(
            "UA_NODESETS does not name a checkout of the OPC Foundation's UA-Nodeset".to_owned(),
        ));
    };
    let files = [
        "DI/Opc.Ua.Di.NodeSet2.xml",
        "PlasticsRubber/GeneralTypes/1.03/Opc.Ua.PlasticsRubber.GeneralTypes.NodeSet2.xml",
        "PlasticsRubber/IMM2MES/1.01/Opc.Ua.PlasticsRubber.IMM2MES.NodeSet2.xml",
    ];
    let mut files: Vec<_> = files.iter().map(|file| models.join(file)).collect();
    let own = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/moulding.NodeSet2.xml"
    );
    files.push(own.into());
    let keys = format!(
        "address = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true\ncycle = \"5ms\"\nnodeset = {files:?}\n"
    );
    let start = "\n[[signal]]\nname = \"start\"\naddress = \"%QX16.0\"\nlatch = \"rising\"\n";
    let sections = sections(MOULDING).replacen(
        "[[signal]]",
        "\"start\" = \"nsu=http://acme.example/moulding/;s=IMM.Job.Start\"\n[[signal]]",
        1,
    );
    let folder = tempfile::tempdir().expect("a folder");
    let sections = format!("{sections}{start}");
    let mut device = Device::open_with(folder, "opcua-server", &keys, &sections);
    let url = format!("opc.tcp://{}", device.address());
    let mut client = Peer::ready("opcua_client.py", &json!({"url": url}))?;
    device.end.set("status", 6.0);
    let good = MOULDING.iter().position(|(name, ..)| *name == "good");
    device.end.slots[good.expect("a signal")] = Slot::from_unsigned(1234);
    device.end.set("cycle", 18_500.0);
    device.end.tick();
    let names = client.ask(&json!({"names": true}));
    let names = names["namespaces"].as_array().expect("a list");
    let at = |uri: &str| {
        names
            .iter()
            .position(|name| name == uri)
            .expect("a namespace")
    };
    let (own, general) = (
        at("http://acme.example/moulding/"),
        at("http://opcfoundation.org/UA/PlasticsRubber/GeneralTypes/"),
    );
    let nodes = client.ask(&json!({"nodes": true}));
    let zone = format!("ns={own};s=IMM.Zone.PID");
    assert_eq!(nodes["nodes"][&zone], format!("{general}:PIDParameters"));
    for (name, value) in [
        ("Status", json!(6)),
        ("Good", json!(1234)),
        ("LastCycle", json!(18_500.0)),
    ] {
        let read = client.ask(&json!({"read": format!("ns={own};s=IMM.Job.{name}")}));
        assert_eq!(read["value"], value, "{name}");
    }
    let pid = |p: f64, d: f64| json!({"of": "PIDParametersDataType", "P": p, "I": 0.0, "D": d});
    let both = json!([pid(1.5, 0.0), pid(0.0, 2.5)]);
    assert_eq!(write(&mut client, &zone, &both), "Good");
    device.until("both members", |end| {
        (end.get("p 0"), end.get("d 1")) == (1.5, 2.5)
    });
    let read = client.ask(&json!({"structure": zone}));
    assert_eq!(read["value"][1], json!({"P": 0.0, "I": 0.0, "D": 2.5}));
    let call =
        json!({"call": [format!("ns={own};s=IMM.Job"), format!("ns={own};s=IMM.Job.Start")]});
    assert_eq!(client.ask(&call)["status"], "Good");
    device.until("the start", |end| end.get("start") == 1.0);
    Ok(())
}
