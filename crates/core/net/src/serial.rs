//! Serial ports, for the buses that run on them.

use std::fmt;
use std::io::{self, ErrorKind};
use std::path::Path;

use tickbus_base::os::{SerialEar, SerialLine, SerialPort, SerialSettings};
use tickbus_base::time::Clock;
use tickbus_base::toml_text::{Key, Shape, Value};

use crate::Error;

/// The longest name of a serial port, in characters.
const DEVICE_LIMIT: usize = 1000;

/// The key `device`, of a bus that needs a serial port.
pub const DEVICE_KEY: Key = Key::required(
    "device",
    Shape::Label(DEVICE_LIMIT),
    "The serial port, such as \"/dev/ttyUSB0\"",
);

/// Reads the system's name of a port.
pub fn read_device(value: &Value<'_>) -> Option<String> {
    let right = "name the serial port, such as \"/dev/ttyUSB0\" or \"COM3\"";
    value.label(DEVICE_LIMIT, right).map(str::to_owned)
}

/// Opens the port that the system calls `device`.
///
/// # Errors
///
/// The port does not exist, is not a serial port, or does not support the settings.
pub fn open(device: &str, settings: SerialSettings) -> Result<SerialPort, Error> {
    SerialPort::open(Path::new(device), settings).map_err(|error| no_port(device, settings, &error))
}

/// As [`open`], but the port marks characters that were damaged on the line, for [`Marks`](tickbus_base::os::Marks), and the port
/// is that of the clock's simulation, if there is one.
///
/// # Errors
///
/// As [`open`].
pub fn open_marking(
    device: &str,
    settings: SerialSettings,
    clock: &dyn Clock,
) -> Result<SerialLine, Error> {
    SerialLine::open(device, settings, clock.simulation())
        .map_err(|error| no_port(device, settings, &error))
}

/// As [`open_marking`], for a line that is only listened to.
///
/// # Errors
///
/// As [`open`].
pub fn listen(
    device: &str,
    settings: SerialSettings,
    clock: &dyn Clock,
) -> Result<SerialEar, Error> {
    SerialEar::open(device, settings, clock.simulation())
        .map_err(|error| no_port(device, settings, &error))
}

fn no_port(device: &str, settings: SerialSettings, error: &io::Error) -> Error {
    let right = match error.kind() {
        ErrorKind::NotFound if cfg!(windows) => {
            "plug it in, or correct \"device\"; the device manager shows what is there"
        }
        ErrorKind::NotFound => {
            "plug it in, or correct \"device\"; ls /dev/serial/by-id shows what is there"
        }
        ErrorKind::PermissionDenied => {
            "get the right to use it; on Debian and Ubuntu that is the group dialout"
        }
        ErrorKind::ResourceBusy => "end the other program that has it",
        _ if settings.rs485 => {
            "if its driver cannot switch the direction of RS-485, remove rs485 = true and take an adapter that \
             does so by itself"
        }
        _ => "check that it is a serial port that can be set so",
    };
    Error(format!(
        "cannot open {device} at {settings} ({error}); {right}"
    ))
}

/// The error when the serial port `device` is gone.
pub fn gone(device: &str, why: impl fmt::Display) -> Error {
    Error(format!(
        "the serial port {device} is gone ({why}); see whether it is still plugged in"
    ))
}
