//! asyncua and structures with arrays of structures, members that can be missing, and unions.

use serde_json::{Value, json};

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

fn sections() -> String {
    let places = SIGNALS.iter();
    let places = places.map(|(name, place, ..)| format!("\"{name}\" = \"{place}\"\n"));
    let signals = SIGNALS.iter().map(|(name, _, address, of_type)| {
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
    let mut device = Device::open_with(folder, "opcua-server", &keys, &sections());
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
