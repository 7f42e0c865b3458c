//! The bus's section of a driver.cfg.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table};
use tickbus_fieldbus::CardOptions;

/// The vendor's library on Windows; on other systems `library` has to name one.
pub(super) const LIBRARY: Option<&str> = if cfg!(windows) {
    Some("Ibddiwnt.dll")
} else {
    None
};

/// The longest name of a device, in characters.
const DEVICE_LIMIT: usize = 40;

/// The bus's own keys, for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "device",
        Shape::Label(DEVICE_LIMIT),
        "Board and node as the driver names them, without _D and _M",
    )
    .or("\"IBB1N1\""),
    Key::new(
        "activate",
        Shape::Whole(1, 0xFFFF),
        "The service that activates the configuration; without it the board's own configuration counts",
    ),
    Key::new(
        "start_timeout",
        Shape::Duration,
        "How long the board may take to answer, and the bus to run",
    )
    .or("\"10s\""),
    CardOptions::library_key(LIBRARY),
];

/// The options of the bus `interbus-ddi`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Library, places and watchdog.
    pub card: CardOptions,
    /// The board and its node: the driver's name without `_D` and `_M`.
    pub device: String,
    /// The service that activates the configuration, if it is to be requested.
    pub activate: Option<u16>,
    /// The time for the board to answer, and for its bus to start.
    pub start_timeout: Nanos,
}

impl Options {
    /// Reads the keys of the bus.
    pub fn read(table: &mut Table<'_>) -> Option<Self> {
        let device = table.take("device");
        let activate = table.take("activate");
        let start_timeout = table.take("start_timeout");
        let card = CardOptions::read(table, LIBRARY);
        let device = device.map_or(Some("IBB1N1"), |value| {
            let right =
                "name board and node as the driver does, without _D and _M, such as \"IBB1N1\"";
            value.label(DEVICE_LIMIT, right)
        });
        let activate = activate.map(|value| value.whole(1..=0xFFFF));
        let start_timeout = start_timeout.map_or(Some(Nanos::from_secs(10)), |value| {
            value.duration_from(Nanos::from_millis(1), "a bus takes longer to start")
        });
        let activate = match activate {
            None => None,
            Some(service) => Some(u16::try_from(service?).ok()?),
        };
        Some(Self {
            card: card?,
            device: device?.to_owned(),
            activate,
            start_timeout: start_timeout?,
        })
    }
}
