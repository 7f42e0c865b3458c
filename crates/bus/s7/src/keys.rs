//! The keys of `s7-server` and `s7-client` in a driver.cfg, for its schema.

use tickbus_base::toml_text::{Key, Shape};
use tickbus_image::signal::AREA_LIMIT;

use crate::client::IDENTITY_LIMIT;
use crate::identity::IDENTITY_KEYS;
use crate::length::{LEAST, LONGEST};
use crate::tsap::{RACK, SLOT};

const AREA_END: i128 = AREA_LIMIT as i128;

const PDU: Key = Key::new(
    "pdu",
    Shape::Whole(LEAST as i128, LONGEST as i128),
    "The longest unit that is agreed to",
)
.or("960");

/// The server's own.
pub(crate) const SERVER: &[Key] = &[
    Key::new(
        "address",
        Shape::ADDRESS,
        "Where to listen; port 0 lets the system choose one",
    )
    .or("\"127.0.0.1:1102\""),
    Key::new(
        "db",
        Shape::List(&Shape::Table(BLOCK), 0, usize::MAX),
        "The data blocks, and the bytes that they have",
    ),
    IDENTITY,
    Key::new(
        "m_bytes",
        Shape::Whole(0, AREA_END),
        "The bytes of M, scratch memory unless [fieldbus.at] places signals there; without this key 256, or as many as the \
         signals there need",
    ),
    PDU,
    Key::new(
        "clients",
        Shape::Whole(1, 1_000),
        "The most clients at the same time",
    )
    .or("64"),
];

/// A data block.
const BLOCK: &[Key] = &[
    Key::required(
        "number",
        Shape::Whole(1, 65_535),
        "The number of the data block",
    ),
    Key::new(
        "area",
        Shape::Choice(&["%I", "%Q"]),
        "The area whose bytes it has; without it the block has signals of [fieldbus.at], and needs its length",
    ),
    Key::new(
        "station",
        Shape::Text,
        "The name of the station, if there are several",
    ),
    Key::new(
        "offset",
        Shape::Whole(0, AREA_END),
        "The first byte in the area",
    )
    .or("0"),
    Key::new(
        "length",
        Shape::Whole(1, AREA_END),
        "How many bytes; to the end of the area by default",
    ),
];

/// A server's station.
pub(crate) const SERVED_STATION: &[Key] = &[
    Key::new(
        "rack",
        Shape::whole(&RACK),
        "The rack of the CPU; 0 by default",
    ),
    Key::new("slot", Shape::whole(&SLOT), "The slot of the CPU"),
    IDENTITY,
];

const IDENTITY: Key = Key::new(
    "identity",
    Shape::Table(IDENTITY_KEYS),
    "How the CPU names itself; order number \"tickbus\" and the driver's name by default",
);

/// The client's own.
pub(crate) const CLIENT: &[Key] = &[
    Key::required(
        "address",
        Shape::Text,
        "The CPU: \"192.168.0.1\", with :102 or without",
    ),
    Key::new(
        "rack",
        Shape::whole(&RACK),
        "The rack of the CPU; 0 by default",
    ),
    Key::new(
        "slot",
        Shape::whole(&SLOT),
        "The slot of the CPU; 1 by default, as in an S7-1200 or S7-1500",
    ),
    Key::new(
        "remote_tsap",
        Shape::Text,
        "Instead of rack and slot, as TIA Portal shows it: \"03.01\"",
    ),
    Key::new("local_tsap", Shape::Text, "The name of this end").or("\"01.00\""),
    INPUT,
    OUTPUT,
    PDU,
    Key::new(
        "write_to",
        Shape::Label(IDENTITY_LIMIT),
        "The identity of the CPU that may be written to; without it nothing is written",
    ),
];

const INPUT: Key = Key::new(
    "input",
    Shape::Text,
    "Where %I begins: \"DB10\", \"%DB10.DBB4\", \"%QB0\", \"%IB0\" or \"%MB100\"",
);

const OUTPUT: Key = Key::new(
    "output",
    Shape::Text,
    "Where %Q begins: \"DB10\", \"%DB10.DBB4\", \"%QB0\", \"%IB0\" or \"%MB100\"",
);

/// A client's station.
pub(crate) const POLLED_STATION: &[Key] = &[INPUT, OUTPUT];
