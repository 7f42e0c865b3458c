//! The file that maps variables of a run to values of a federation.

use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Mistakes, Table, load_text, read_text};
use tickbus_image::signal::DataType;
use tickbus_net::Address;
use tickbus_virtual_time::{Declaration, Variable};

use crate::value::{Kind, Value};

/// The longest name in a federation, in characters.
const LONGEST: usize = 255;

/// The content of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    /// The name of the client in the run.
    pub client: String,
    /// The name in the federation.
    pub federate: String,
    /// The virtual time between two requests; `None`: the server's step.
    pub step: Option<Nanos>,
    /// The broker; `None`: the one that the engine finds.
    pub broker: Option<Address>,
    /// The engine's transport, such as `zmq`.
    pub core: String,
    /// The variables that the federation gets.
    pub publish: Vec<Publish>,
    /// The variables that the federation writes.
    pub subscribe: Vec<Subscribe>,
}

/// A variable of the run that is published in the federation.
#[derive(Clone, Debug, PartialEq)]
pub struct Publish {
    /// The variable.
    pub variable: String,
    /// The key of the publication.
    pub key: String,
    /// The type that the variable has.
    pub data_type: DataType,
}

/// A publication of the federation that is a variable of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct Subscribe {
    /// The variable, and its type.
    pub variable: Variable,
    /// The key of the publication.
    pub key: String,
    /// The raw value until something is published.
    pub initial: u64,
}

/// The transports of HELICS.
const CORES: [&str; 8] = [
    "zmq", "zmqss", "tcp", "tcpss", "udp", "ipc", "mpi", "inproc",
];

impl Mapping {
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
        let mut collector = Collector::new(file, text);
        let read = read_text(&mut collector, text, |mut root| {
            let right = "write a [helics] table with client, publish and subscribe";
            let helics = root.require("helics", right);
            root.finish();
            read(helics?.table("[helics]", right)?)
        });
        match collector.finish() {
            Some(mistakes) => Err(mistakes),
            None => Ok(read.expect("what is not read has a mistake")),
        }
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

fn read(mut table: Table<'_>) -> Option<Mapping> {
    let name = "write a name, such as \"grid\"";
    let client = table.require(
        "client",
        "add the name of this client in the run, such as client = \"grid\"",
    );
    let federate = table.take("federate");
    let step = table.take("step");
    let broker = table.take("broker");
    let core = table.take("core");
    let publish = table.take("publish");
    let subscribe = table.take("subscribe");
    table.require_one_of(
        &["publish", "subscribe"],
        "add [[helics.publish]] tables with the variables that the federation reads, or [[helics.subscribe]] tables with \
         those that it writes",
    );
    let (collector, at) = (table.collector(), table.at());
    table.finish();
    let client = client.and_then(|value| value.label(LONGEST, name));
    let federate = federate.map_or(Some(client.unwrap_or_default()), |value| {
        value.label(LONGEST, name)
    });
    let step = step.map_or(Some(None), |value| value.duration().map(Some));
    let broker = broker.map_or(Some(None), |value| Address::read_dialled(&value).map(Some));
    let core = core.map_or(Some("zmq"), |value| {
        value.choice("core types", &CORES.map(|core| (core, core)))
    });
    let publish = publish.map(|value| value.tables("[[helics.publish]]"));
    let publish: Vec<Option<Publish>> = publish.into_iter().flatten().map(read_publish).collect();
    let subscribe = subscribe.map(|value| value.tables("[[helics.subscribe]]"));
    let subscribe: Vec<Option<Subscribe>> = (subscribe.into_iter().flatten())
        .map(read_subscribe)
        .collect();
    let mapping = Mapping {
        client: client?.to_owned(),
        federate: federate?.to_owned(),
        step: step?,
        broker: broker?,
        core: core?.to_owned(),
        publish: publish.into_iter().collect::<Option<_>>()?,
        subscribe: subscribe.into_iter().collect::<Option<_>>()?,
    };
    let checked = mapping.declaration().check();
    checked
        .map_err(|mistake| collector.collect(at, mistake))
        .ok()?;
    Some(mapping)
}

/// The keys of both kinds of tables: variable, key and type.
fn read_names<'a>(table: &mut Table<'a>) -> Option<(&'a str, &'a str, DataType)> {
    let right = "write the name of a variable of the run";
    let variable = table.require(
        "variable",
        "add the variable of the run, such as variable = \"level\"",
    );
    let key = table.take("key");
    let types = DataType::ALL.map(|data_type| (data_type.name(), data_type));
    let data_type = table.require("type", "add the variable's type, such as type = \"LREAL\"");
    let variable = variable.and_then(|value| value.label(LONGEST, right));
    let key = key.map_or(variable, |value| {
        value.label(
            LONGEST,
            "write the key of the publication, such as \"tank/level\"",
        )
    });
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

fn read_publish(mut table: Table<'_>) -> Option<Publish> {
    let names = read_names(&mut table);
    table.finish();
    let (variable, key, data_type) = names?;
    Some(Publish {
        variable: variable.to_owned(),
        key: key.to_owned(),
        data_type,
    })
}

fn read_subscribe(mut table: Table<'_>) -> Option<Subscribe> {
    let names = read_names(&mut table);
    let initial = table.take("initial");
    let (collector, at) = (table.collector(), table.at());
    table.finish();
    let (variable, key, data_type) = names?;
    if data_type == DataType::Real {
        collector.report(
            at,
            format!("the variable \"{variable}\" is a REAL, and a publication has all 64 bits of a number"),
            "write type = \"LREAL\": no value is rounded then",
        );
        return None;
    }
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
        key: key.to_owned(),
        initial: initial?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_maps_variables_to_publications() {
        let text = "[helics]\nclient = \"grid\"\nstep = \"10ms\"\nbroker = \"127.0.0.1:23404\"\n\
            [[helics.publish]]\nvariable = \"valve\"\nkey = \"plc/valve\"\ntype = \"BOOL\"\n\
            [[helics.subscribe]]\nvariable = \"level\"\ntype = \"LREAL\"\ninitial = 0.5\n";
        let mapping = Mapping::parse("grid.toml", text).expect("it is right");
        let expected = Mapping {
            client: "grid".to_owned(),
            federate: "grid".to_owned(),
            step: Some(Nanos::from_millis(10)),
            broker: Some(Address::local(23_404)),
            core: "zmq".to_owned(),
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
        let told = Mapping::parse("grid.toml", text).expect_err("it is wrong");
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
        let told = Mapping::parse("grid.toml", twice)
            .expect_err("twice")
            .to_string();
        assert!(told.contains("writes the variable \"a\" twice"), "{told}");
    }
}
