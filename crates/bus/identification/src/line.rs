//! The serial line in a driver.cfg.

use std::fmt;
use std::path::Path;

use tickbus_base::os::{Parity, SerialSettings};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, names};
use tickbus_fieldbus::CYCLE;
use tickbus_fieldbus::examine::Examination;
use tickbus_net::serial;

use crate::{CarrierType, Timing};

/// The rates of the readers' switches, in bits per second.
const RATES: [u32; 6] = [300, 600, 1200, 2400, 4800, 9600];

/// The characters of a question and its answer, for the carriers with the longest addresses.
const QUESTION: usize = 16;

/// The prefix of a device that this end creates.
const PSEUDO: &str = "pty:";

/// The keys of the line, for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    serial::DEVICE_KEY,
    Key::new(
        "baud",
        Shape::Numbers(&RATES),
        "Bits per second, as the reader's switches are set",
    )
    .or("9600"),
    Key::new(
        "carrier",
        Shape::Choice(&names(&CarrierType::ALL)),
        "The type of the code carriers",
    )
    .or("\"IDC-1K\""),
];

/// The line, and the carriers at its reader's heads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineOptions {
    /// The system's name of the serial port; or `pty:` and the name of the port to create.
    pub device: String,
    /// Bits per second.
    pub baud: u32,
    /// The type of the carriers.
    pub carriers: CarrierType,
}

impl LineOptions {
    /// Reads `device`, `baud` and `carrier`. Only with `may_make` may the device be a port to create.
    pub(crate) fn read(table: &mut Table<'_>, may_make: bool) -> Option<Self> {
        let device = table.require(
            "device",
            "name the serial port, such as device = \"/dev/ttyUSB0\"",
        );
        let baud = table.take("baud");
        let carriers = table.take("carrier");
        let device = device.and_then(|value| read_device(&value, may_make));
        let baud = baud.map_or(Some(RATES[5]), |value| read_baud(&value));
        let carriers = carriers.map_or(Some(CarrierType::default()), |value| {
            value.choice("carriers", &CarrierType::ALL)
        });
        Some(Self {
            device: device?,
            baud: baud?,
            carriers: carriers?,
        })
    }

    /// The port's settings.
    pub(crate) const fn settings(&self) -> SerialSettings {
        SerialSettings {
            baud: self.baud,
            parity: Parity::None,
            two_stop_bits: false,
            seven_bits: false,
            rs485: false,
        }
    }

    /// The timing with this time-out.
    pub(crate) const fn timing(&self, timeout: Nanos) -> Timing {
        Timing {
            baud: self.baud,
            timeout,
        }
    }

    /// The default bus cycle, for this many heads. Ten cycles must be longer than two rounds of questions.
    pub(crate) fn cycle(&self, heads: usize) -> Nanos {
        let round = self.timing(Nanos::ZERO).characters(QUESTION * heads);
        CYCLE.max(Nanos(round.0 / 4))
    }

    /// The name of the port that this end creates.
    pub(crate) fn made(&self) -> Option<&Path> {
        self.device.strip_prefix(PSEUDO).map(Path::new)
    }

    /// Examines the line as far as the port goes.
    pub(crate) fn examine(&self, examination: &mut Examination<'_>) {
        if let Some(link) = self.made() {
            let evidence = format!("{} is made when the driver starts", link.display());
            examination.ok("device", evidence);
        } else if examination
            .reach_serial(self.port(), self.settings())
            .is_none()
        {
            return;
        }
        examination.unexamined("what the other end says");
    }

    /// The name for opening the port.
    pub(crate) fn port(&self) -> &str {
        self.device.strip_prefix(PSEUDO).unwrap_or(&self.device)
    }
}

impl fmt::Display for LineOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.made() {
            Some(link) => write!(f, "a pseudo-terminal, {}", link.display())?,
            None => f.write_str(&self.device)?,
        }
        write!(f, " at {}", self.settings())
    }
}

fn read_device(value: &Value<'_>, may_make: bool) -> Option<String> {
    let device = serial::read_device(value)?;
    let Some(link) = device.strip_prefix(PSEUDO) else {
        return Some(device);
    };
    if !may_make {
        value.wrong(
            "a pseudo-terminal is made by the reader",
            format!("write the name that it gets there: device = \"{link}\""),
        );
        return None;
    }
    if !link.starts_with('/') {
        value.wrong(
            format!("\"{link}\" does not begin with a slash"),
            "write where the port is to be, such as device = \"pty:/tmp/reader\"",
        );
        return None;
    }
    Some(device)
}

fn read_baud(value: &Value<'_>) -> Option<u32> {
    let baud = value.whole(1..=i128::from(u32::MAX))?;
    let found = RATES.iter().find(|rate| i128::from(**rate) == baud);
    if found.is_none() {
        value.wrong(
            format!("{baud} is no rate of these readers"),
            "the rates are 300, 600, 1200, 2400, 4800, 9600",
        );
    }
    found.copied()
}
