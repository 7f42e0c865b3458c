//! The line in a driver.cfg: a TCP address, with one of two framings, or a serial port.

use std::fmt;

use tickbus_base::Mistake;
use tickbus_base::os::{Parity, SerialSettings};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Table, Value};
use tickbus_net::Address;
use tickbus_net::serial as serial_port;

use super::rtu;

/// The range of serial speeds, in bits per second.
pub(super) const BAUDS: std::ops::RangeInclusive<i128> = 50..=4_000_000;

/// The framings of telegrams over TCP: true for RTU.
pub(super) const FRAMINGS: [(&str, bool); 2] = [("tcp", false), ("rtu", true)];

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
    /// Modbus RTU over a serial port.
    Serial(Serial),
}

/// A serial port and its settings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Serial {
    /// The system's name of the port.
    pub device: String,
    /// The settings.
    pub settings: SerialSettings,
    /// The silence that ends a telegram.
    pub silence: Nanos,
    /// True if the line echoes sent bytes, so that the echo must be dropped.
    pub echo: bool,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::RtuOverTcp(address) => write!(f, "{address} (RTU over TCP)"),
            Self::Serial(serial) => {
                write!(f, "{} at {}", serial.device, serial.settings)?;
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
            Self::Tcp(_) | Self::Serial(_) => Self::Tcp(address),
        };
        Ok(())
    }

    /// Reads `address` and `framing`, or `device`, `baud`, `parity`, `stop_bits`, `silence`, `echo` and `rs485`; without
    /// any of these, the default address. `check` checks an address stated in the driver.cfg.
    pub(super) fn read(
        table: &mut Table<'_>,
        address: Address,
        check: impl FnOnce(&Address) -> Result<(), Mistake>,
    ) -> Option<Self> {
        let stated = table.take("address");
        let framing = table.take("framing");
        let device = table.take("device");
        let serial = ["baud", "parity", "stop_bits", "silence", "echo", "rs485"]
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
            let is_rtu = framing.map_or(Some(false), |value| value.choice("framings", &FRAMINGS));
            let framed = |address| {
                Some(if is_rtu? {
                    Self::RtuOverTcp(address)
                } else {
                    Self::Tcp(address)
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
                "remove one of the two: \"address\" is for Modbus TCP, \"device\" for RTU over a serial port",
            );
        }
        if let Some(value) = &framing {
            value.wrong(
                "\"framing\" stands beside \"device\"",
                "remove one of the two: a serial port has RTU in any case, and \"framing\" is for an \"address\"",
            );
        }
        let device = serial_port::read_device(&device);
        let [baud, parity, stop_bits, silence, echo, rs485] = serial.map(|(_, value)| value);
        let flag = |value: Option<Value<'_>>| value.map_or(Some(false), |value| value.boolean());
        let (echo, rs485) = (flag(echo), flag(rs485));
        let settings = read_settings(baud.as_ref(), parity.as_ref(), stop_bits.as_ref(), rs485);
        let silence = silence.as_ref().map(Value::duration);
        let (device, settings) = (device?, settings?);
        let silence = match silence {
            None => rtu::silence(settings.baud),
            Some(stated) => stated?,
        };
        Some(Self::Serial(Serial {
            device,
            settings,
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
        rs485: rs485?,
    })
}
