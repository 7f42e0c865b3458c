//! The file that maps variables of a run to values of a federation.

use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Mistakes, Table, load_text, parse_text};
use tickbus_image::signal::DataType;
use tickbus_virtual_time::{Declaration, Variable};

use crate::value::{Kind, Value};

/// The longest name in a federation, in characters.
pub(crate) const LONGEST: usize = 255;

/// The part of a mapping that differs between the engines.
pub trait Engine: Sized {
    /// The place of a value in the federation.
    type Key: std::fmt::Debug;
    /// The name of the file's table.
    const TABLE: &'static str;
    /// The key of the name in the federation.
    const NAME: &'static str;
    /// The engine must know the length of a step before the run does.
    const NEEDS_STEP: bool;

    /// Takes the keys that only this engine has.
    fn read(table: &mut Table<'_>) -> Option<Self>;

    /// Takes the keys that say where the value of a variable is in the federation.
    fn key(table: &mut Table<'_>, variable: Option<&str>) -> Option<Self::Key>;

    /// Checks that a variable of this type can be subscribed to.
    ///
    /// # Errors
    ///
    /// The engine has no such values.
    fn subscribes(_variable: &str, _data_type: DataType) -> Result<(), Mistake> {
        Ok(())
    }
}

/// The content of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping<E: Engine> {
    /// The name of the client in the run.
    pub client: String,
    /// The name in the federation.
    pub name: String,
    /// The virtual time between two steps of the client; `None`: the server's step.
    pub step: Option<Nanos>,
    /// The engine's own keys.
    pub engine: E,
    /// The variables that the federation gets.
    pub publish: Vec<Publish<E::Key>>,
    /// The variables that the federation writes.
    pub subscribe: Vec<Subscribe<E::Key>>,
}

/// A variable of the run that is published in the federation.
#[derive(Clone, Debug, PartialEq)]
pub struct Publish<K> {
    /// The variable.
    pub variable: String,
    /// The place of the publication.
    pub key: K,
    /// The type that the variable has.
    pub data_type: DataType,
}

/// A publication of the federation that is a variable of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct Subscribe<K> {
    /// The variable, and its type.
    pub variable: Variable,
    /// The place of the publication.
    pub key: K,
    /// The raw value until something is published.
    pub initial: u64,
}

impl<E: Engine> Mapping<E> {
    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// With every mistake in it.
    pub fn load(path: &Path) -> Result<Self, Mistakes> {
        Self::parse(&path.display().to_string(), &load_text(path)?)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    ///
    /// The same as for [`load`](Self::load).
    pub fn parse(file: &str, text: &str) -> Result<Self, Mistakes> {
        parse_text(file, text, |mut root| {
            let right = format!(
                "write a [{}] table with client, publish and subscribe",
                E::TABLE
            );
            let engine = root.require(E::TABLE, &*right);
            root.finish();
            read(engine?.table(&format!("[{}]", E::TABLE), &right)?)
        })
    }

    /// The declaration of the client.
    pub fn declaration(&self) -> Declaration {
        let subscribed = self.subscribe.iter().map(|one| one.variable.clone());
        Declaration {
            interval: self.step,
            writes: subscribed.collect(),
            reads: (self.publish.iter())
                .map(|one| one.variable.clone())
                .collect(),
            ..Declaration::new(self.client.clone())
        }
    }
}

fn read<E: Engine>(mut table: Table<'_>) -> Option<Mapping<E>> {
    let right = "write a name, such as \"grid\"";
    let client = table.require(
        "client",
        "add the name of this client in the run, such as client = \"grid\"",
    );
    let name = table.take(E::NAME);
    let step = if E::NEEDS_STEP {
        let right = "add the time between two steps, such as step = \"10ms\"";
        table.require("step", right).map(Some)
    } else {
        Some(table.take("step"))
    };
    let publish = table.take("publish");
    let subscribe = table.take("subscribe");
    let engine = E::read(&mut table);
    let (publish_tables, subscribe_tables) = (
        format!("[[{}.publish]]", E::TABLE),
        format!("[[{}.subscribe]]", E::TABLE),
    );
    table.require_one_of(
        &["publish", "subscribe"],
        format!(
            "add {publish_tables} tables with the variables that the federation reads, or {subscribe_tables} tables with \
             those that it writes"
        ),
    );
    let (collector, at) = (table.collector(), table.at());
    table.finish();
    let client = client.and_then(|value| value.label(LONGEST, right));
    let name = name.map_or(Some(client.unwrap_or_default()), |value| {
        value.label(LONGEST, right)
    });
    let step = step.and_then(|step| step.map_or(Some(None), |value| value.duration().map(Some)));
    let publish = publish.map(|value| value.tables(&publish_tables));
    let publish: Vec<Option<_>> = publish
        .into_iter()
        .flatten()
        .map(read_publish::<E>)
        .collect();
    let subscribe = subscribe.map(|value| value.tables(&subscribe_tables));
    let subscribe: Vec<Option<_>> = (subscribe.into_iter().flatten())
        .map(read_subscribe::<E>)
        .collect();
    let mapping = Mapping {
        client: client?.to_owned(),
        name: name?.to_owned(),
        step: step?,
        engine: engine?,
        publish: publish.into_iter().collect::<Option<_>>()?,
        subscribe: subscribe.into_iter().collect::<Option<_>>()?,
    };
    let checked = mapping.declaration().check();
    checked
        .map_err(|mistake| collector.collect(at, mistake))
        .ok()?;
    Some(mapping)
}

/// The keys of both kinds of tables: the variable, its place in the federation, and its type.
fn read_names<'a, E: Engine>(table: &mut Table<'a>) -> Option<(&'a str, E::Key, DataType)> {
    let right = "write the name of a variable of the run";
    let variable = table.require(
        "variable",
        "add the variable of the run, such as variable = \"level\"",
    );
    let variable = variable.and_then(|value| value.label(LONGEST, right));
    let key = E::key(table, variable);
    let types = DataType::ALL.map(|data_type| (data_type.name(), data_type));
    let data_type = table.require("type", "add the variable's type, such as type = \"LREAL\"");
    let data_type = data_type.and_then(|value| {
        if let Some("STRING" | "WSTRING") = value.as_text() {
            value.wrong(
                "a run has no texts",
                "leave the publication out, or publish a number",
            );
            return None;
        }
        value.choice("types", &types)
    });
    Some((variable?, key?, data_type?))
}

fn read_publish<E: Engine>(mut table: Table<'_>) -> Option<Publish<E::Key>> {
    let names = read_names::<E>(&mut table);
    table.finish();
    let (variable, key, data_type) = names?;
    Some(Publish {
        variable: variable.to_owned(),
        key,
        data_type,
    })
}

fn read_subscribe<E: Engine>(mut table: Table<'_>) -> Option<Subscribe<E::Key>> {
    let names = read_names::<E>(&mut table);
    let initial = table.take("initial");
    let (collector, at) = (table.collector(), table.at());
    table.finish();
    let (variable, key, data_type) = names?;
    E::subscribes(variable, data_type)
        .map_err(|mistake| collector.collect(at, mistake))
        .ok()?;
    let initial = initial.map_or(Some(0), |value| {
        let initial = match Kind::of(data_type) {
            Kind::Boolean => Value::Boolean(value.boolean()?),
            Kind::Double => Value::Double(value.number("write a number")?),
            Kind::Integer => {
                let whole = value.whole(i64::MIN.into()..=i64::MAX.into())?;
                Value::Integer(i64::try_from(whole).expect("in its range"))
            }
        };
        let raw = initial.raw(data_type);
        raw.map_err(|what| value.wrong(what, "write a value that the type has"))
            .ok()
    });
    Some(Subscribe {
        variable: Variable::new(variable, data_type),
        key,
        initial: initial?,
    })
}

#[cfg(test)]
mod tests {
    use tickbus_net::Address;

    use super::*;
    use crate::helics::{HelicsMapping, HelicsSettings};

    #[test]
    fn a_file_maps_variables_to_publications() {
        let text = "[helics]\nclient = \"grid\"\nstep = \"10ms\"\nbroker = \"127.0.0.1:23404\"\n\
            [[helics.publish]]\nvariable = \"valve\"\nkey = \"plc/valve\"\ntype = \"BOOL\"\n\
            [[helics.subscribe]]\nvariable = \"level\"\ntype = \"LREAL\"\ninitial = 0.5\n";
        let mapping = HelicsMapping::parse("grid.toml", text).expect("it is right");
        let expected = Mapping {
            client: "grid".to_owned(),
            name: "grid".to_owned(),
            step: Some(Nanos::from_millis(10)),
            engine: HelicsSettings {
                broker: Some(Address::local(23_404)),
                core: "zmq".to_owned(),
            },
            publish: vec![Publish {
                variable: "valve".to_owned(),
                key: "plc/valve".to_owned(),
                data_type: DataType::Bool,
            }],
            subscribe: vec![Subscribe {
                variable: Variable::new("level", DataType::Lreal),
                key: "level".to_owned(),
                initial: 0.5_f64.to_bits(),
            }],
        };
        assert_eq!(mapping, expected);
    }

    #[test]
    fn every_mistake_is_told_at_its_place() {
        let text = "[helics]\ncilent = \"grid\"\ncore = \"zmp\"\nbroker = \"127.0.0.1:0\"\n\
            [[helics.publish]]\nvariable = \"a\"\ntype = \"STRING\"\n\
            [[helics.subscribe]]\nvariable = \"b\"\ntype = \"REAL\"\n\
            [[helics.subscribe]]\nvariable = \"c\"\ntype = \"USINT\"\ninitial = 256\n";
        let told = HelicsMapping::parse("grid.toml", text).expect_err("it is wrong");
        let told = told.to_string();
        for part in [
            "grid.toml:2:1: unknown key \"cilent\" in [helics]; did you mean \"client\"?",
            "grid.toml:3:8: \"zmp\" is not one of the core types; did you mean \"zmq\"?",
            "grid.toml:4:10: port 0 cannot be connected to",
            "grid.toml:7:8: a run has no texts",
            "grid.toml:8:1: the variable \"b\" is a REAL",
            "grid.toml:14:11: 256 does not fit into its type USINT; write a value that the type has",
        ] {
            assert!(told.contains(part), "{part} in {told}");
        }
        let twice = "[helics]\nclient = \"grid\"\nsubscribe = [{ variable = \"a\", type = \"BOOL\" }, { variable = \"a\", \
            key = \"b\", type = \"BOOL\" }]\n";
        let told = HelicsMapping::parse("grid.toml", twice)
            .expect_err("twice")
            .to_string();
        assert!(told.contains("writes the variable \"a\" twice"), "{told}");
    }
}
