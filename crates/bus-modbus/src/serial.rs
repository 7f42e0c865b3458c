//! Serial ports, for both ends.

use std::io::ErrorKind;
use std::path::Path;

use tickbus_base::os::SerialPort;
use tickbus_fieldbus::BusError;

use super::line::Serial;

/// Opens the port of a line.
///
/// # Errors
///
/// It does not exist, is not a serial port, or does not support the settings.
pub(super) fn open(line: &Serial) -> Result<SerialPort, BusError> {
    SerialPort::open(Path::new(&line.device), line.settings).map_err(|error| {
        let right = match error.kind() {
            ErrorKind::NotFound => {
                "plug it in, or correct \"device\"; ls /dev/serial/by-id shows what is there"
            }
            ErrorKind::PermissionDenied => {
                "get the right to use it; on Debian and Ubuntu that is the group dialout"
            }
            ErrorKind::ResourceBusy => "end the other program that has it",
            _ if line.settings.rs485 => {
                "if its driver cannot switch the direction of RS-485, remove rs485 = true and take an adapter that \
                 does so by itself"
            }
            _ => "check that it is a serial port that can be set so",
        };
        BusError::Link(format!(
            "cannot open {} at {} ({error}); {right}",
            line.device, line.settings
        ))
    })
}
