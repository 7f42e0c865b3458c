//! The schema and the readers accept the same files, as far as a schema can tell.

mod probes;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use jsonschema::Validator;
use serde_json::{Value, json};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Key, Mistakes, Shape};
use tickbus_driver_cfg::Config;
use tickbus_driver_cfg::keys::{FIELDBUS, FILE, STATION};
use tickbus_fieldbus::faults::FAULT_KINDS;
use tickbus_kinds::KINDS;
use tickbus_reply::REPLY_KINDS;

use super::{own_keys, schema};

fn validator() -> Validator {
    jsonschema::validator_for(&schema(&KINDS)).expect("a valid schema")
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..")
}

/// Each driver.cfg in a folder of the repository, and in the folders in it.
fn files(folder: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![repository().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "cfg") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

fn read(text: &str) -> Result<Config, Mistakes> {
    Config::parse("driver.cfg", text, &KINDS)
}

/// A mistake that a schema can see: an unknown or missing key, a wrong type, a number out of its range, a wrong name.
fn is_structural(mistake: &Mistake) -> bool {
    const TYPES: [&str; 9] = [
        " is a text",
        " is a whole number",
        " is a number with a fraction",
        " is a boolean",
        " is a date or time",
        " is a list of tables",
        " is a list",
        " is a table",
        " is a single table",
    ];
    let Mistake { what, right } = mistake;
    // The type of a signal decides which values it has, and the bus which codes of errors there are.
    let decided = ["\"value\" is ", "\"fail_safe\" is ", "\"code\" is "];
    if decided.iter().any(|key| what.starts_with(key))
        || what.contains(" is not one of the codes of errors")
    {
        return false;
    }
    // With several stations some buses need a key in each: a rule between keys.
    let is_for_several = ["unit", "head"]
        .iter()
        .any(|key| what.ends_with(&format!(" has no \"{key}\"")));
    let is_for_several = is_for_several
        || what.ends_with(", and others have")
        || what.ends_with(", and [fieldbus.at] places nothing of its station");
    what.starts_with("unknown key ")
        || (what.contains(" has no \"") && !is_for_several)
        || TYPES.iter().any(|kind| what.ends_with(kind))
        || right.starts_with("write a whole number from ")
        || what.contains(" is not one of the ")
        || (what.starts_with("bus kind ") && what.ends_with(" is unknown"))
        || what.ends_with(" is no type of IEC 61131-3")
        || what.ends_with(" is empty")
        || what.contains(" has blanks around it")
        || (what.contains(" is longer than ") && what.contains(" characters"))
}

#[test]
fn every_right_file_passes() {
    let validator = validator();
    let mut passed = 0;
    for folder in [
        "tests/right",
        "tests/export",
        "tests/fmi",
        "examples",
        "plc",
    ] {
        for file in files(folder) {
            let text = fs::read_to_string(&file).expect("a text");
            if read(&text).is_err() {
                // The file of a bus that this repository only has as an example.
                continue;
            }
            let document: Value = toml::from_str(&text).expect("TOML");
            let errors: Vec<String> = validator
                .iter_errors(&document)
                .map(|error| format!("{}: {error}", error.instance_path()))
                .collect();
            assert_eq!(errors, [""; 0], "{}", file.display());
            passed += 1;
        }
    }
    assert!(passed > 30, "{passed} files are there");
}

#[test]
fn every_file_with_a_structural_mistake_fails() {
    let validator = validator();
    let mut failed = 0;
    for file in files("tests/wrong") {
        let text = fs::read_to_string(&file).expect("a text");
        let Ok(document) = toml::from_str::<Value>(&text) else {
            continue;
        };
        let mistakes = read(&text).err();
        let mistakes = mistakes.iter().flatten();
        let structural: Vec<&Mistake> = mistakes
            .map(|found| &found.mistake)
            .filter(|mistake| is_structural(mistake))
            .collect();
        if !structural.is_empty() {
            assert!(
                !validator.is_valid(&document),
                "{}: {structural:?}",
                file.display()
            );
            failed += 1;
        }
    }
    assert!(failed > 50, "{failed} files are there");
}

/// Tables that the right files do not have.
const MORE: &str = r#"
[driver]
id = 1
name = "More"
[fieldbus]
kind = "loopback"
link = "x"
alive = { signal = "A", within = "1s" }
heartbeat = [{ signal = "B", every = "1s" }]
[record]
file = "run.vcd"
[page]
[[signal]]
name = "A"
address = "%QW0"
scale = { raw = [0, 10], value = [0, 1] }
[[signal]]
name = "B"
address = "%IW0"
[[axis]]
name = "X"
command_offset = 100
feedback_offset = 100
[[fault]]
kind = "link-down"
[[fault]]
kind = "invert"
signal = "B"
[[fault]]
kind = "offset"
signal = "B"
by = 1
[[fault]]
kind = "delay"
by = "1s"
[[fault]]
kind = "values-late"
by = "1s"
[[fault]]
kind = "duplicate"
"#;

/// Tables `[fieldbus]`, and what follows them, that the right files do not have.
const BUSES: [&str; 7] = [
    "kind = \"profibus-device\"\ndevice = \"/dev/ttyS0\"\naddress = 3\nident = 0x80E0\n\
     [[fault]]\nkind = \"diagnosis\"\nslot = 1\nchannel = 0\n",
    // Over TCP: with RTU a unit has a smaller range.
    "kind = \"s7-server\"\n\
     [[fault]]\nkind = \"answer-late\"\nby = \"1s\"\n\
     [[fault]]\nkind = \"answer-error\"\ncode = 5\n\
     [[fault]]\nkind = \"answer-wrong\"\nhow = \"unit\"\n",
    "kind = \"modbus-server\"\nidentity = {}\nreserved = [{ at = \"400001\" }, { at = \"100001\", count = 8 }]\nat = { A = \"400009\" }\n\
     diagnostics = true\nexception_status = \"100001\"\nqueues = [\"400001\"]\nfiles = [1]\n\
     tls = { certificate_file = \"a\", private_key_file = \"b\", ca_file = \"c\", write_roles = [\"d\"] }\n",
    "kind = \"modbus-client\"\ninputs = [{ at = \"offset:0\" }]\noutputs = [{ at = \"offset:500\" }]\n\
     tls = { certificate_file = \"a\", private_key_file = \"b\", ca_file = \"c\", server_name = \"d\" }\n",
    "kind = \"opcua-server\"\nanonymous = true\n",
    "kind = \"plugin\"\nlibrary = \"x.so\"\n",
    "kind = \"ivi-client\"\ndevice = \"/dev/ttyS0\"\nrole = \"controller\"\n\
     [[station]]\nname = \"Station\"\ninput_bytes = 10\noutput_bytes = 10\n",
];

/// Returns a driver.cfg with this `[fieldbus]`.
fn on_bus(fieldbus: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\n{fieldbus}\
         [[signal]]\nname = \"A\"\naddress = \"%IW0\"\n"
    )
}

/// The tables of a document with their keys: each with its JSON pointer and a name for all tables of its sort.
fn tables(document: &Value) -> Vec<Table> {
    let kind = document["fieldbus"]["kind"].as_str().expect("a kind");
    let kinds = KINDS.keys();
    let of_bus = kinds.iter().find(|keys| keys.name == kind).expect(kind);
    let fieldbus = [FIELDBUS.concat(), own_keys(of_bus)].concat();
    let station = [&STATION.concat(), of_bus.station_keys].concat();
    let mut found = Vec::new();
    walk("", "", document, FILE, &mut found);
    found.remove(0);
    let name = format!("fieldbus of {kind}");
    walk(
        "/fieldbus",
        &name,
        &document["fieldbus"],
        &fieldbus,
        &mut found,
    );
    if let Some(first) = document.pointer("/station/0") {
        let name = format!("station of {kind}");
        walk("/station/0", &name, first, &station, &mut found);
    }
    found
}

#[derive(Debug)]
struct Table {
    pointer: String,
    name: String,
    keys: Vec<Key>,
}

fn walk(pointer: &str, name: &str, value: &Value, keys: &[Key], found: &mut Vec<Table>) {
    found.push(Table {
        pointer: pointer.to_owned(),
        name: name.to_owned(),
        keys: keys.to_vec(),
    });
    for key in keys {
        let (pointer, name) = (
            format!("{pointer}/{}", key.name),
            format!("{name}/{}", key.name),
        );
        if let Some(inner) = value.get(key.name) {
            enter(&pointer, &name, inner, &key.shape, found);
        }
    }
}

fn enter(pointer: &str, name: &str, value: &Value, shape: &Shape, found: &mut Vec<Table>) {
    match (shape, value) {
        (Shape::Table(keys), Value::Object(_)) if ["/fault", "/reply"].contains(&name) => {
            let kind = value["kind"].as_str().expect("a kind");
            walk(pointer, &format!("{name} of {kind}"), value, keys, found);
        }
        (Shape::Table(keys), Value::Object(_)) => walk(pointer, name, value, keys, found),
        (Shape::List(element, ..), Value::Array(list)) => {
            for (index, value) in list.iter().enumerate() {
                enter(&format!("{pointer}/{index}"), name, value, element, found);
            }
        }
        (Shape::Any(shapes), _) => {
            for shape in *shapes {
                enter(pointer, name, value, shape, found);
            }
        }
        _ => {}
    }
}

/// The names of the tables that a key with this shape can have, in the tests above.
fn declared(name: &str, shape: &Shape, names: &mut BTreeSet<String>) {
    match shape {
        Shape::Table(keys) => {
            names.insert(name.to_owned());
            for key in *keys {
                declared(&format!("{name}/{}", key.name), &key.shape, names);
            }
        }
        Shape::List(element, ..) => declared(name, element, names),
        Shape::Any(shapes) => shapes.iter().for_each(|shape| declared(name, shape, names)),
        _ => {}
    }
}

/// Right documents that have each table of a driver.cfg at least once.
fn documents() -> Vec<Value> {
    let files = files("tests/right").into_iter();
    let texts = files.map(|file| fs::read_to_string(file).expect("a text"));
    let of_buses = BUSES.iter().map(|fieldbus| on_bus(fieldbus));
    let texts = std::iter::once(MORE.to_owned())
        .chain(of_buses)
        .chain(texts);
    let mut documents: Vec<Value> = texts
        .map(|text| toml::from_str(&text).expect("TOML"))
        .collect();
    for document in &mut documents {
        // The writer of TOML has no larger numbers.
        for signal in document["signal"].as_array_mut().into_iter().flatten() {
            if signal["fail_safe"].as_u64() > Some(i64::MAX.unsigned_abs()) {
                signal["fail_safe"] = json!(1);
            }
        }
        for fault in document["fault"].as_array_mut().into_iter().flatten() {
            if fault["value"].as_u64() > Some(i64::MAX.unsigned_abs()) {
                fault["value"] = json!(1);
            }
        }
        strip_nulls(document);
        // A station on each bus, where the file is still right with one.
        if document.get("station").is_none() {
            let mut with = document.clone();
            with["station"] = json!([{ "name": "Station" }]);
            if read(&written(&with)).is_ok() {
                *document = with;
            }
        }
    }
    documents
}

/// Indexing a JSON value to change it makes what does not exist.
fn strip_nulls(value: &mut Value) {
    match value {
        Value::Object(entries) => {
            entries.retain(|_, value| !value.is_null());
            entries.values_mut().for_each(strip_nulls);
        }
        Value::Array(list) => list.iter_mut().for_each(strip_nulls),
        _ => {}
    }
}

fn written(document: &Value) -> String {
    toml::to_string(document).expect("TOML")
}

/// For each table of a right document: its reader takes the declared keys and no others, refuses a wrong value of each,
/// and has the declared default.
#[test]
fn the_readers_take_what_their_keys_declare() {
    let validator = validator();
    let mut seen = BTreeSet::new();
    for document in documents() {
        assert_eq!(read(&written(&document)).map(drop), Ok(()), "{document:#}");
        for table in tables(&document) {
            if seen.insert(table.name.clone()) {
                probes::check(&validator, &document, &table);
            }
        }
    }
    let mut names: BTreeSet<String> = BTreeSet::new();
    for key in FILE {
        declared(&format!("/{}", key.name), &key.shape, &mut names);
    }
    names.remove("/fault");
    names.extend(FAULT_KINDS.map(|kind| format!("/fault of {}", kind.name)));
    names.remove("/reply");
    for (kind, key) in [
        ("integrator", "flows"),
        ("rule", "ramp"),
        ("track", "exits"),
        ("track", "places"),
        ("track", "sensors"),
    ] {
        names.remove(&format!("/reply/{key}"));
        names.insert(format!("/reply of {kind}/{key}"));
    }
    names.extend(REPLY_KINDS.map(|kind| format!("/reply of {}", kind.name)));
    for kind in KINDS.keys() {
        let name = format!("fieldbus of {}", kind.name);
        names.insert(name.clone());
        for key in FIELDBUS.concat().iter().chain(&own_keys(&kind)) {
            // The keys that all buses have are seen on one of them.
            let mut inner = BTreeSet::new();
            declared(&format!("{name}/{}", key.name), &key.shape, &mut inner);
            let is_common = ["alive", "heartbeat"].contains(&key.name);
            names.extend(
                inner
                    .into_iter()
                    .filter(|_| !is_common || kind.name == "loopback"),
            );
        }
        if !kind.station_keys.is_empty() {
            names.insert(format!("station of {}", kind.name));
        }
    }
    let unseen: Vec<&String> = names.difference(&seen).collect();
    assert_eq!(unseen, [""; 0], "no document has these tables");
}
