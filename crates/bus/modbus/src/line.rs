//! The line in a driver.cfg: an address, with one of three framings, or a serial port, with one of two.

use std::fmt;

use tickbus_base::Mistake;
use tickbus_base::os::{Parity, SerialSettings};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Table, Value};
use tickbus_net::Address;
use tickbus_net::serial as serial_port;

use super::{Coding, ascii, rtu};

/// The range of serial speeds, in bits per second.
pub(super) const BAUDS: std::ops::RangeInclusive<i128> = 50..=4_000_000;

/// A framing of telegrams, on whichever line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Framing {
    Tcp,
    Udp,
    Rtu,
    Ascii,
}

/// The framings by their names.
pub(super) const FRAMINGS: [(&str, Framing); 4] = [
    ("tcp", Framing::Tcp),
    ("udp", Framing::Udp),
    ("rtu", Framing::Rtu),
    ("ascii", Framing::Ascii),
];

/// The parities of a serial port.
pub(super) const PARITIES: [(&str, Parity); 3] = [
    ("even", Parity::Even),
    ("odd", Parity::Odd),
    ("none", Parity::None),
];

/// The line to the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Line {
    /// Modbus TCP.
    Tcp(Address),
    /// RTU telegrams over TCP, as transported by serial device servers.
    RtuOverTcp(Address),
    /// Telegrams of Modbus TCP, one in each UDP datagram.
    Udp(Address),
    /// Modbus RTU or ASCII over a serial port.
    Serial(Serial),
}

/// A serial port and its settings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Serial {
    /// The system's name of the port.
    pub device: String,
    /// The settings.
    pub settings: SerialSettings,
    /// The coding of telegrams.
    pub coding: Coding,
    /// The silence that ends a telegram; with ASCII, that gives up one.
    pub silence: Nanos,
    /// True if the line echoes sent bytes, so that the echo must be dropped.
    pub echo: bool,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::RtuOverTcp(address) => write!(f, "{address} (RTU over TCP)"),
            Self::Udp(address) => write!(f, "{address} (UDP)"),
            Self::Serial(serial) => {
                write!(f, "{} at {}", serial.device, serial.settings)?;
                if serial.coding == Coding::Ascii {
                    f.write_str(", ASCII")?;
                }
                f.write_str(if serial.echo { ", which echoes" } else { "" })
            }
        }
    }
}

impl Serial {
    /// The echo to be dropped, if there is one.
    pub(super) fn new_echo(&self) -> Option<rtu::Echo> {
        self.echo.then(|| rtu::Echo::new(self.settings.baud))
    }
}

impl Line {
    /// The address of a line that is not serial.
    pub(crate) const fn address(&self) -> Option<&Address> {
        match self {
            Self::Tcp(address) | Self::RtuOverTcp(address) | Self::Udp(address) => Some(address),
            Self::Serial(_) => None,
        }
    }

    /// Replaces the address or the serial line of the driver.cfg, if `check` accepts the new address. The framing of an
    /// address is kept.
    ///
    /// # Errors
    ///
    /// The address is invalid.
    pub fn set_address(
        &mut self,
        address: &str,
        check: impl FnOnce(&Address) -> Result<(), Mistake>,
    ) -> Result<(), Mistake> {
        let address: Address = address.parse()?;
        check(&address)?;
        *self = match self {
            Self::RtuOverTcp(_) => Self::RtuOverTcp(address),
            Self::Udp(_) => Self::Udp(address),
            Self::Tcp(_) | Self::Serial(_) => Self::Tcp(address),
        };
        Ok(())
    }

    /// Reads `address` or `device`, `framing`, and with `device` the settings of the port; without any of these, the
    /// default address. `check` checks an address stated in the driver.cfg.
    pub(super) fn read(
        table: &mut Table<'_>,
        address: Address,
        check: impl FnOnce(&Address) -> Result<(), Mistake>,
    ) -> Option<Self> {
        let stated = table.take("address");
        let framing = table.take("framing");
        let device = table.take("device");
        let framing_at = framing.as_ref();
        let stated_framing = framing_at.map(|value| value.choice("framings", &FRAMINGS));
        let serial = [
            "baud",
            "parity",
            "data_bits",
            "stop_bits",
            "silence",
            "echo",
            "rs485",
        ]
        .map(|key| (key, table.take(key)));
        let Some(device) = device else {
            for (key, value) in &serial {
                if let Some(value) = value
                    && table.is_whole()
                {
                    value.wrong(
                        format!("\"{key}\" stands without \"device\""),
                        "name the serial port, such as device = \"/dev/ttyUSB0\", or remove it",
                    );
                }
            }
            let framing = stated_framing.unwrap_or(Some(Framing::Tcp));
            if let (Some(value), Some(Framing::Ascii)) = (framing_at, framing) {
                value.wrong(
                    "\"ascii\" is a framing for serial ports",
                    "name the serial port, such as device = \"/dev/ttyUSB0\", or write \"rtu\", \"tcp\" or \"udp\"",
                );
            }
            let framed = |address| {
                Some(match framing? {
                    Framing::Rtu => Self::RtuOverTcp(address),
                    Framing::Udp => Self::Udp(address),
                    Framing::Tcp => Self::Tcp(address),
                    Framing::Ascii => return None,
                })
            };
            let Some(value) = stated else {
                return framed(address);
            };
            let text =
                value.text("write a host and a port in quotes, such as \"127.0.0.1:1502\"")?;
            let read = text.parse().and_then(|address| {
                check(&address)?;
                Ok(address)
            });
            return match read {
                Ok(address) => framed(address),
                Err(mistake) => {
                    value.refuse(mistake);
                    None
                }
            };
        };
        if let Some(value) = &stated {
            value.wrong(
                "\"address\" stands beside \"device\"",
                "remove one of the two: \"address\" is for Modbus TCP, \"device\" for a serial port",
            );
        }
        if let (Some(value), Some(Some(Framing::Tcp | Framing::Udp))) = (framing_at, stated_framing)
        {
            value.wrong(
                "this \"framing\" stands beside \"device\"",
                "write \"rtu\" or \"ascii\" for a serial port, or \"address\" instead of \"device\"",
            );
        }
        let coding = match stated_framing {
            Some(Some(Framing::Ascii)) => Coding::Ascii,
            _ => Coding::Rtu,
        };
        let device = serial_port::read_device(&device);
        let [baud, parity, data_bits, stop_bits, silence, echo, rs485] =
            serial.map(|(_, value)| value);
        let flag = |value: Option<Value<'_>>| value.map_or(Some(false), |value| value.boolean());
        let (echo, rs485) = (flag(echo), flag(rs485));
        let seven_bits = read_data_bits(data_bits.as_ref(), coding);
        let settings = read_settings(baud.as_ref(), parity.as_ref(), stop_bits.as_ref(), rs485);
        let silence = silence.as_ref().map(Value::duration);
        let (device, mut settings) = (device?, settings?);
        settings.seven_bits = seven_bits?;
        let silence = match (silence, coding) {
            (Some(stated), _) => stated?,
            (None, Coding::Rtu) => rtu::silence(settings.baud),
            (None, Coding::Ascii) => ascii::SILENCE,
        };
        Some(Self::Serial(Serial {
            device,
            settings,
            coding,
            silence,
            echo: echo?,
        }))
    }
}

fn read_settings(
    baud: Option<&Value<'_>>,
    parity: Option<&Value<'_>>,
    stop_bits: Option<&Value<'_>>,
    rs485: Option<bool>,
) -> Option<SerialSettings> {
    let baud = match baud {
        None => Some(19_200),
        Some(value) => value.whole(BAUDS).and_then(|baud| u32::try_from(baud).ok()),
    };
    let parity = parity.map_or(Some(Parity::Even), |value| {
        value.choice("parities", &PARITIES)
    });
    // A character has eleven bits in the standard: without parity there are two stop bits.
    let two_by_default = parity == Some(Parity::None);
    let two_stop_bits = stop_bits.map_or(Some(two_by_default), |value| {
        value.whole(1..=2).map(|bits| bits == 2)
    });
    Some(SerialSettings {
        baud: baud?,
        parity: parity?,
        two_stop_bits: two_stop_bits?,
        seven_bits: false,
        rs485: rs485?,
    })
}

/// Reads the data bits of a character; returns true for seven, which ASCII has unless stated otherwise.
fn read_data_bits(stated: Option<&Value<'_>>, coding: Coding) -> Option<bool> {
    let Some(value) = stated else {
        return Some(coding == Coding::Ascii);
    };
    let seven_bits = value.whole(7..=8)? == 7;
    if seven_bits && coding == Coding::Rtu {
        value.wrong(
            "RTU has bytes of 8 bits",
            "remove it, or write framing = \"ascii\" if the other end speaks ASCII",
        );
        return None;
    }
    Some(seven_bits)
}
