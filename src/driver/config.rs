//! The driver.cfg of one driver, read whole.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::layout;
use crate::config::{Collector, Mistakes, Table, Value, read_text};
use crate::fieldbus::{Options, Role};
use crate::signal::{Addressing, SignalTable, Station, section};
use crate::time::Nanos;

/// Waits between attempts to reach the peer again, where a driver.cfg states none.
const RECONNECT: [Nanos; 6] = [
    Nanos::from_secs(1),
    Nanos::from_secs(2),
    Nanos::from_secs(4),
    Nanos::from_secs(8),
    Nanos::from_secs(15),
    Nanos::from_secs(30),
];

/// The least age at which data become stale, where a driver.cfg states none.
const LEAST_MAX_AGE: Nanos = Nanos::from_millis(250);

/// The longest name of a driver, in characters.
const NAME_LIMIT: usize = 120;

/// The most waits in `reconnect`.
const RECONNECT_LIMIT: usize = 100;

/// All that a driver.cfg says, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The file that it came from.
    pub path: PathBuf,
    /// The driver's id, unique among the drivers of a folder; positive.
    pub id: i32,
    /// The driver's name, for people.
    pub name: String,
    /// Which end of the bus it is.
    pub role: Role,
    /// Its stations and signals.
    pub table: SignalTable,
    /// Cycle times and time-outs.
    pub timing: Timing,
    /// What the bus itself needs to know.
    pub bus: Options,
}

/// Cycle times and time-outs of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The bus cycle; `None` leaves it to the bus. Positive.
    pub cycle: Option<Nanos>,
    /// Data from the peer that are older than this are stale. Positive.
    pub max_age: Nanos,
    /// A simulation that has not ticked for longer than this has stopped; `None` never says so.
    pub watchdog: Option<Nanos>,
    /// Waits between attempts to reach the peer again; the last one repeats. Never empty, all
    /// positive.
    pub reconnect: Vec<Nanos>,
}

impl Config {
    /// Reads the driver.cfg at `path`.
    ///
    /// # Errors
    ///
    /// When the file cannot be read or is no text, or with every mistake that it has.
    pub fn load(path: &Path) -> Result<Self, Mistakes> {
        let file = path.display().to_string();
        let refused = |what: String, right: &str| Mistakes::of_file(&file, what, right);
        if path.is_dir() {
            let right = "name the configuration file in it, such as driver.cfg";
            return Err(refused("this is a directory".to_owned(), right));
        }
        let bytes = std::fs::read(path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => refused(
                "there is no such file".to_owned(),
                "check the path and the name",
            ),
            ErrorKind::PermissionDenied => refused(
                "this file may not be read".to_owned(),
                "check its permissions",
            ),
            _ => refused(
                format!("this file cannot be read: {error}"),
                "check the path and the disk",
            ),
        })?;
        match String::from_utf8(bytes) {
            Ok(text) => Self::parse(&file, &text),
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                let bytes = error.into_bytes();
                // What precedes the odd byte is enough to say where it stands.
                let before = String::from_utf8_lossy(&bytes[..at]);
                let collector = Collector::new(&file, &before);
                collector.report(
                    at,
                    format!("the byte 0x{:02X} is no UTF-8 text", bytes[at]),
                    "save the file as UTF-8",
                );
                Err(collector.finish().expect("one mistake was reported"))
            }
        }
    }

    /// Reads the text of a driver.cfg; `file_name` is what its mistakes call it.
    ///
    /// # Errors
    ///
    /// With every mistake in the text.
    pub fn parse(file_name: &str, text: &str) -> Result<Self, Mistakes> {
        let mut collector = Collector::new(file_name, text);
        let config = read_text(&mut collector, text, |root| {
            read(Path::new(file_name), root)
        });
        match collector.finish() {
            Some(mistakes) => Err(mistakes),
            None => Ok(config.expect("what is not read has a mistake")),
        }
    }
}

fn read(path: &Path, mut root: Table<'_>) -> Option<Config> {
    let driver = root.require("driver", "write a [driver] table with id and name");
    let fieldbus = root.require("fieldbus", "write a [fieldbus] table with the kind of bus");
    let stations = root.take("station");
    let signals = root.take("signal");

    let driver = driver
        .and_then(|value| value.table("[driver]"))
        .map(read_driver);
    let addressing = driver
        .as_ref()
        .map_or(Addressing::Bytes, |driver| driver.addressing);
    let fieldbus = fieldbus
        .and_then(|value| value.table("[fieldbus]"))
        .map(read_fieldbus);
    let declared = stations.map(|value| value.tables("[[station]]"));
    let signals = signals
        .map(|value| value.tables("[[signal]]"))
        .unwrap_or_default();
    if signals.len() > layout::SIGNAL_LIMIT {
        signals[layout::SIGNAL_LIMIT].wrong(
            format!("there are {} signals", signals.len()),
            format!("a driver has at most {}", layout::SIGNAL_LIMIT),
        );
        root.finish();
        return None;
    }
    let sections: Vec<_> = signals
        .into_iter()
        .filter_map(|table| section::read(table, addressing))
        .collect();
    let sizes = fieldbus
        .as_ref()
        .map(|fieldbus| fieldbus.sizes.clone())
        .unwrap_or_default();
    let table = layout::lay_out(sections, declared, sizes);
    let empty = |station: &Station| station.input_bytes + station.output_bytes == 0;
    if table
        .as_ref()
        .is_some_and(|table| table.stations.iter().all(empty))
    {
        root.lacks(
            "signal",
            "write a [[signal]] section with name and address for each signal",
        );
    }
    root.finish();

    let (driver, fieldbus) = (driver?, fieldbus?);
    Some(Config {
        path: path.to_owned(),
        id: driver.id?,
        name: driver.name?,
        role: fieldbus.role,
        table: table?,
        timing: fieldbus.timing?,
        bus: fieldbus.bus?,
    })
}

struct DriverTable {
    id: Option<i32>,
    name: Option<String>,
    addressing: Addressing,
}

fn read_driver(mut table: Table<'_>) -> DriverTable {
    let id = table.require(
        "id",
        "write a number that no other driver has, such as id = 4711",
    );
    let name = table.require("name", "give the driver a name for people");
    let addressing = table.take("addressing");
    table.finish();
    let choices = [("bytes", Addressing::Bytes), ("iec", Addressing::Elements)];
    DriverTable {
        id: id
            .and_then(|value| value.whole(1..=i32::MAX.into()))
            .and_then(|id| i32::try_from(id).ok()),
        name: name
            .and_then(|value| value.label(NAME_LIMIT, "give the driver a name for people"))
            .map(str::to_owned),
        addressing: addressing
            .and_then(|value| value.choice("ways of addressing", &choices))
            .unwrap_or_default(),
    }
}

struct FieldbusTable<'a> {
    role: Role,
    timing: Option<Timing>,
    sizes: layout::Sizes<'a>,
    bus: Option<Options>,
}

fn read_fieldbus(mut table: Table<'_>) -> FieldbusTable<'_> {
    let kind = table.require("kind", "write the kind of bus, such as kind = \"loopback\"");
    let role = table.take("role");
    let timing = read_timing(&mut table);
    let sizes = layout::Sizes::take(&mut table);
    let role = role
        .and_then(|value| value.choice("roles", &Role::ALL.map(|role| (role.name(), role))))
        .unwrap_or_default();
    let bus = match kind {
        Some(kind) => Options::read(&kind, role, table),
        None => {
            // Which keys a bus knows cannot be told without its kind; a misspelt one can.
            table.finish_open();
            None
        }
    };
    FieldbusTable {
        role,
        timing,
        sizes,
        bus,
    }
}

fn read_timing(table: &mut Table<'_>) -> Option<Timing> {
    let [cycle, max_age, watchdog] = ["cycle", "max_age", "watchdog"].map(|key| table.take(key));
    let reconnect = table.take("reconnect");
    let span = |value: &Option<Value<'_>>| match value {
        None => Some(None),
        Some(value) => value.duration().map(Some),
    };
    let spans = (span(&cycle), span(&max_age), span(&watchdog));
    let reconnect = match reconnect {
        None => Some(RECONNECT.to_vec()),
        Some(value) => read_reconnect(&value),
    };
    let (cycle, stated, watchdog) = (spans.0?, spans.1?, spans.2?);
    if let (Some(cycle), Some(stated), Some(value)) = (cycle, stated, &max_age)
        && stated < cycle
    {
        value.wrong(
            format!("\"max_age\" is {stated}, shorter than one bus cycle of {cycle}"),
            "write some cycles, or all data are stale",
        );
    }
    let ten_cycles = Nanos(cycle.unwrap_or_default().0.saturating_mul(10));
    let max_age = stated.unwrap_or(ten_cycles.max(LEAST_MAX_AGE));
    Some(Timing {
        cycle,
        max_age,
        watchdog,
        reconnect: reconnect?,
    })
}

fn read_reconnect(value: &Value<'_>) -> Option<Vec<Nanos>> {
    const SHAPE: &str = "write a list of durations, such as [\"1s\", \"2s\", \"5s\"]";
    let list = value.list(SHAPE)?;
    if list.is_empty() || list.len() > RECONNECT_LIMIT {
        value.wrong(
            format!("\"reconnect\" has {} elements", list.len()),
            format!("write 1 to {RECONNECT_LIMIT} durations, such as [\"1s\", \"2s\", \"5s\"]"),
        );
        return None;
    }
    let spans: Vec<Option<Nanos>> = list.iter().map(Value::duration).collect();
    spans.into_iter().collect()
}
