//! The JSON schema of driver.cfg, with which editors complete and check the file while it is written.
//!
//! The readers of a driver.cfg declare their keys ([`Key`]), and each [kind of bus](tickbus_fieldbus::BusKind) declares
//! its own. A schema cannot express every rule: `tickbus check` has the last word.

mod shape;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use tickbus_base::toml_text::{Key, Shape, TableKind};
use tickbus_driver_cfg::Kinds;
use tickbus_driver_cfg::keys::{FIELDBUS, FILE, KindKeys, STATION, STATION_LIMIT};
use tickbus_fieldbus::faults::{FAULT_KINDS, FORMER_FAULT_KINDS};
use tickbus_reply::{REPLY_KINDS, one_of};

use shape::{described, table};

/// The key of `[fieldbus]` that all kinds have and that depends on the kind.
const EVENTS: [Key; 2] = {
    const DOC: &str = "true: every change of a received signal is an event";
    const WRITES: &str =
        "true: every change of a received signal is an event; \"writes\": every write";
    [
        Key::new("events", Shape::Boolean, DOC).or("false"),
        Key::new(
            "events",
            Shape::Any(&[Shape::Boolean, Shape::Choice(&["writes"])]),
            WRITES,
        )
        .or("false"),
    ]
};

/// Returns the JSON schema (draft 7) of a driver.cfg that can name these kinds of bus.
pub fn schema(kinds: &Kinds) -> Value {
    let kinds = kinds.keys();
    let names: Vec<&str> = kinds.iter().map(|kind| kind.name).collect();
    let of_bus: Vec<Vec<Key>> = kinds.iter().map(own_keys).collect();
    let of_station: Vec<Vec<Key>> = kinds
        .iter()
        .map(|kind| kind.station_keys.to_vec())
        .collect();
    let (bus, station) = (
        Shared::new(FIELDBUS, &of_bus),
        Shared::new(STATION, &of_station),
    );
    let mut properties: Map<String, Value> = FILE
        .iter()
        .map(|key| (key.name.to_owned(), described(key)))
        .collect();
    let former = FORMER_FAULT_KINDS.iter().flat_map(|(before, name)| {
        let kinds = FAULT_KINDS.into_iter().filter(|kind| kind.name == *name);
        kinds.map(|kind| TableKind {
            name: before,
            ..kind
        })
    });
    let faults: Vec<TableKind> = FAULT_KINDS.into_iter().chain(former).collect();
    let fault = &mut properties["fault"]["items"];
    fault["properties"]["kind"]["enum"] = faults.iter().map(|kind| kind.name).collect();
    fault["allOf"] = rules_of(&faults, |_| Vec::new());
    let one_of_reply = |kind: &TableKind| {
        let groups = one_of(kind.name).iter();
        groups.map(|(keys, _)| keys.to_vec()).collect()
    };
    properties["reply"]["items"]["allOf"] = rules_of(&REPLY_KINDS, one_of_reply);
    let mut fieldbus = bus.open_table("The bus, and this end of it");
    fieldbus["properties"]["kind"] = json!({ "description": "The kind of bus", "enum": names });
    fieldbus["required"] = json!(["kind"]);
    properties.insert("fieldbus".to_owned(), fieldbus);
    let mut each = station.open_table("A station of the bus");
    each["required"] = json!(["name"]);
    properties.insert(
        "station".to_owned(),
        json!({
            "description": "The stations, for a driver with several",
            "type": "array",
            "items": each,
            "maxItems": STATION_LIMIT,
        }),
    );
    let rules = kinds.iter().zip(of_bus.iter().zip(&of_station));
    let rules = rules.map(|(kind, (of_bus, of_station))| {
        let mut fieldbus = bus.closed_table(of_bus, kind.one_of);
        fieldbus["properties"]["kind"] = json!(true);
        let then = json!({
            "fieldbus": fieldbus,
            "station": { "items": station.closed_table(of_station, &[]) },
        });
        let named =
            json!({ "properties": { "kind": { "const": kind.name } }, "required": ["kind"] });
        json!({
            "if": { "properties": { "fieldbus": named }, "required": ["fieldbus"] },
            "then": { "properties": then },
        })
    });
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "driver.cfg",
        "description": "One driver of tickbus: a device or a controller on a bus, and its signals",
        "type": "object",
        "allOf": rules.collect::<Value>(),
        "properties": properties,
        "required": ["driver", "fieldbus"],
        "additionalProperties": false,
    })
}

/// Returns the keys of a kind in `[fieldbus]`.
fn own_keys(kind: &KindKeys) -> Vec<Key> {
    let mut keys = kind.keys.concat();
    keys.push(EVENTS[usize::from(kind.learns_of_writes)]);
    keys
}

/// The keys of a table that all kinds of bus have, together with those of which each kind has its own.
struct Shared {
    /// The keys that all kinds have.
    common: Vec<Key>,
    /// The schema of each key. A key that differs between kinds has its descriptions alone: its shape is in the rules
    /// of the kinds, so that a mistake is reported once.
    schemas: BTreeMap<&'static str, Value>,
}

impl Shared {
    fn new(common: &[&[Key]], of_kinds: &[Vec<Key>]) -> Self {
        let common = common.concat();
        let mut all: BTreeMap<&str, Vec<Value>> = BTreeMap::new();
        for key in common.iter().chain(of_kinds.iter().flatten()) {
            let (schemas, schema) = (all.entry(key.name).or_default(), described(key));
            if !schemas.contains(&schema) {
                schemas.push(schema);
            }
        }
        let merged = all
            .into_iter()
            .map(|(name, mut schemas)| match schemas.len() {
                1 => (name, schemas.remove(0)),
                _ => (name, json!({ "description": descriptions(&schemas) })),
            });
        Self {
            common,
            schemas: merged.collect(),
        }
    }

    /// Returns the table with the keys of all kinds, which an editor offers.
    fn open_table(&self, doc: &str) -> Value {
        json!({ "description": doc, "type": "object", "properties": self.schemas })
    }

    /// Returns the table with the keys of one kind, and no others.
    fn closed_table(&self, own: &[Key], one_of: &[&str]) -> Value {
        let mut closed = table(own, one_of);
        let Some(properties) = closed["properties"].as_object_mut() else {
            return closed;
        };
        for key in &self.common {
            properties.insert(key.name.to_owned(), json!(true));
        }
        for (name, schema) in properties {
            if self.schemas.get(name.as_str()) == Some(schema) {
                *schema = json!(true);
            }
        }
        closed
    }
}

/// Returns the different descriptions of one key.
fn descriptions(schemas: &[Value]) -> String {
    let mut all: Vec<&str> = Vec::new();
    for text in schemas
        .iter()
        .filter_map(|schema| schema["description"].as_str())
    {
        if !all.contains(&text) {
            all.push(text);
        }
    }
    all.join(" | ")
}

/// Returns the rules for the keys of each kind of tables; `one_of` has groups of keys of which a kind needs one.
fn rules_of(kinds: &[TableKind], one_of: impl Fn(&TableKind) -> Vec<Vec<&'static str>>) -> Value {
    let rules = kinds.iter().map(|kind| {
        let mut rule = kind_rule(kind, kinds);
        let groups = one_of(kind);
        if !groups.is_empty() {
            let groups = groups.into_iter().map(|keys| {
                let any = keys.into_iter().map(|key| json!({ "required": [key] }));
                json!({ "anyOf": any.collect::<Value>() })
            });
            rule["then"]["allOf"] = groups.collect();
        }
        rule
    });
    rules.collect()
}

/// Returns the rule for the keys of one kind of tables, of all these kinds.
fn kind_rule(kind: &TableKind, kinds: &[TableKind]) -> Value {
    let others = kinds.iter().flat_map(TableKind::keys);
    let foreign = others.filter(|key| kind.keys().all(|own| own != *key));
    let mut properties: Map<String, Value> =
        foreign.map(|key| (key.to_owned(), json!(false))).collect();
    for key in kind.required {
        properties.insert(key.name.to_owned(), shape::of(&key.shape));
    }
    let name = kind.needs_name.then_some("name");
    let required = kind.required.iter().map(|key| key.name);
    let required: Vec<&str> = required.chain(name).collect();
    json!({
        "if": { "properties": { "kind": { "const": kind.name } }, "required": ["kind"] },
        "then": { "properties": properties, "required": required },
    })
}
