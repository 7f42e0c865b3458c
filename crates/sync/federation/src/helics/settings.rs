//! The keys of a mapping that only HELICS has.

use tickbus_base::Mistake;
use tickbus_base::toml_text::Table;
use tickbus_image::signal::DataType;
use tickbus_net::Address;

use crate::mapping::{Engine, LONGEST, Mapping};

/// A mapping for HELICS; the name in the federation is the federate's.
pub type HelicsMapping = Mapping<HelicsSettings>;

/// Where the federation is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HelicsSettings {
    /// The broker; `None`: the one that the engine finds.
    pub broker: Option<Address>,
    /// The engine's transport, such as `zmq`.
    pub core: String,
}

/// The transports of HELICS.
const CORES: [&str; 8] = [
    "zmq", "zmqss", "tcp", "tcpss", "udp", "ipc", "mpi", "inproc",
];

impl Engine for HelicsSettings {
    type Key = String;
    const TABLE: &'static str = "helics";
    const NAME: &'static str = "federate";
    const NEEDS_STEP: bool = false;

    fn read(table: &mut Table<'_>) -> Option<Self> {
        let broker = table.take("broker");
        let core = table.take("core");
        let broker = broker.map_or(Some(None), |value| Address::read_dialled(&value).map(Some));
        let core = core.map_or(Some("zmq"), |value| {
            value.choice("core types", &CORES.map(|core| (core, core)))
        });
        Some(Self {
            broker: broker?,
            core: core?.to_owned(),
        })
    }

    fn key(table: &mut Table<'_>, variable: Option<&str>) -> Option<String> {
        let right = "write the key of the publication, such as \"tank/level\"";
        match table.take("key") {
            Some(value) => value.label(LONGEST, right).map(str::to_owned),
            None => variable.map(str::to_owned),
        }
    }

    fn subscribes(variable: &str, data_type: DataType) -> Result<(), Mistake> {
        if data_type != DataType::Real {
            return Ok(());
        }
        Err(Mistake::new(
            format!(
                "the variable \"{variable}\" is a REAL, and a publication has all 64 bits of a number"
            ),
            "write type = \"LREAL\": no value is rounded then",
        ))
    }
}
