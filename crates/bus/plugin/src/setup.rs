//! The data that a library needs to open its bus.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Options;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusSetup, CYCLE, Cycles, Role};

/// The smallest default time-out of an exchange.
const LEAST_TIMEOUT: Nanos = Nanos::from_millis(10);

/// One station's frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Station {
    /// The name; empty for a single station.
    pub name: String,
    /// Bytes that the station sends.
    pub tx: u32,
    /// Bytes that the station receives.
    pub rx: u32,
}

/// The data that a library needs to open its bus, and the library's file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setup {
    /// The library's file, absolute. It need not be UTF-8, as a path would have to be to be sent.
    pub library: OsString,
    /// The driver's name.
    pub name: String,
    /// The folder of the driver.cfg.
    pub directory: String,
    /// The end of the bus that this is.
    #[serde(with = "Sent")]
    pub role: Role,
    /// The library's own options, as key-value pairs without NUL.
    pub options: Vec<(String, String)>,
    /// The stations, in order; at least one.
    pub stations: Vec<Station>,
    /// The time-out of an exchange in milliseconds; at least 1.
    pub timeout_ms: u32,
    /// The bus cycle in nanoseconds.
    pub cycle_ns: u64,
    /// The age at which data are stale, in nanoseconds.
    pub max_age_ns: u64,
}

/// [`Role`] as it is sent.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Role")]
enum Sent {
    Device,
    Controller,
    Observer,
}

impl Setup {
    pub(super) fn new(options: &Options, library: PathBuf, line: &BusSetup<'_>) -> Self {
        let (tx, rx) = line.role.areas();
        let size = |bytes: usize| u32::try_from(bytes).expect("an image is far below 4 GiB");
        let stations = line.table.stations.iter();
        let stations = stations.map(|station| Station {
            name: station.name.clone(),
            tx: size(station.bytes(tx)),
            rx: size(station.bytes(rx)),
        });
        let cycle = line.cycle.unwrap_or(CYCLE);
        let timeout = options.timeout.unwrap_or(cycle.max(LEAST_TIMEOUT));
        let millis = u32::try_from((timeout.0 + 999_999) / 1_000_000);
        let nanos = |span: Nanos| u64::try_from(span.0).unwrap_or(0);
        Self {
            library: library.into(),
            name: line.name.to_owned(),
            directory: line.folder.to_string_lossy().into_owned(),
            role: line.role,
            options: options.options.clone(),
            stations: stations.collect(),
            timeout_ms: millis.unwrap_or(u32::MAX),
            cycle_ns: nanos(cycle),
            max_age_ns: nanos(line.max_age),
        }
    }

    /// Bytes sent by one exchange.
    pub(super) fn tx(&self) -> usize {
        let bytes = self.stations.iter().map(|station| station.tx as usize);
        bytes.sum()
    }

    /// Bytes received by one exchange.
    pub(super) fn rx(&self) -> usize {
        let bytes = self.stations.iter().map(|station| station.rx as usize);
        bytes.sum()
    }

    /// The pacing of exchanges.
    pub(super) fn cycles(&self) -> Cycles {
        Cycles {
            cycle: Nanos(i64::try_from(self.cycle_ns).unwrap_or(i64::MAX)),
            timeout: self.timeout(),
            slow: "plugin.slow_calls",
        }
    }

    pub(super) fn timeout(&self) -> Nanos {
        Nanos::from_millis(self.timeout_ms.into())
    }

    /// The library's file name, for messages.
    pub(super) fn library_name(&self) -> String {
        let file = Path::new(&self.library);
        let name = file.file_name().unwrap_or(&self.library);
        name.to_string_lossy().into_owned()
    }
}
