//! Serial ports.

use std::fmt;

use crate::time::Nanos;

/// The parity bit of each character.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parity {
    /// Even parity.
    Even,
    /// Odd parity.
    Odd,
    /// No parity bit.
    None,
}

/// Settings of a serial port; never with flow control.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SerialSettings {
    /// Bits per second.
    pub baud: u32,
    /// The parity bit of each character.
    pub parity: Parity,
    /// Two stop bits instead of one.
    pub two_stop_bits: bool,
    /// Seven data bits instead of eight.
    pub seven_bits: bool,
    /// RTS switches the transceiver of an RS-485 line to sending while the port sends.
    pub rs485: bool,
}

impl SerialSettings {
    /// The time of one character on the line: a start bit, the data bits, the parity bit if there is one, the stop bits.
    pub fn character(&self) -> Nanos {
        let bits = 10 + i64::from(self.parity != Parity::None) + i64::from(self.two_stop_bits)
            - i64::from(self.seven_bits);
        Nanos(bits * 1_000_000_000 / i64::from(self.baud.max(1)))
    }
}

impl fmt::Display for SerialSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parity = match self.parity {
            Parity::Even => 'E',
            Parity::Odd => 'O',
            Parity::None => 'N',
        };
        let stop_bits = if self.two_stop_bits { 2 } else { 1 };
        let data_bits = if self.seven_bits { 7 } else { 8 };
        write!(f, "{} baud, {data_bits}{parity}{stop_bits}", self.baud)?;
        f.write_str(if self.rs485 { ", RS-485" } else { "" })
    }
}

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
pub use unix::SerialPort;
#[cfg(windows)]
pub use windows::SerialPort;
