//! The keys of `modbus-server` and `modbus-client` in a driver.cfg, for its schema.

use tickbus_base::toml_text::{Key, Shape, names};
use tickbus_net::serial;

use crate::client::{PART_KEYS, PARTS};
use crate::identity::IDENTITY_KEYS;
use crate::line::{BAUDS, FRAMINGS, PARITIES};
use crate::server::{FILES, QUEUES, RANGE_KEYS, RANGES};
use crate::stations::IDENTITY_LIMIT;
use crate::tls_options;

/// The line of both ends.
pub(crate) const LINE: &[Key] = &[
    Key::new(
        "address",
        Shape::ADDRESS,
        "Where to listen, or what to connect to; \"127.0.0.1:1502\" if there is no device",
    ),
    Key::new(
        "framing",
        Shape::Choice(&names(&FRAMINGS)),
        "\"rtu\" with an address: RTU telegrams over TCP; \"udp\": over UDP; \"ascii\" with a device: Modbus ASCII",
    ),
    Key {
        is_required: false,
        ..serial::DEVICE_KEY
    },
    Key::new(
        "baud",
        Shape::whole(&BAUDS),
        "Bits per second; 19200 by default",
    ),
    Key::new(
        "parity",
        Shape::Choice(&names(&PARITIES)),
        "The parity of the serial port; \"even\" by default",
    ),
    Key::new(
        "data_bits",
        Shape::Whole(7, 8),
        "The data bits of a character; 7 by default with ASCII, otherwise 8",
    ),
    Key::new(
        "stop_bits",
        Shape::Whole(1, 2),
        "The stop bits of the serial port; 1 by default, 2 without parity",
    ),
    Key::new(
        "silence",
        Shape::Duration,
        "The pause that ends a telegram; 3.5 characters by default, 1.75 ms above 19200 baud; with ASCII 1s",
    ),
    Key::new(
        "echo",
        Shape::Boolean,
        "true: the line echoes what this end sends; false by default",
    ),
    Key::new(
        "rs485",
        Shape::Boolean,
        "true: the port switches the transceiver with RTS while it sends; false by default",
    ),
];

const UNIT: Key = Key::new(
    "unit",
    Shape::Whole(0, 255),
    "The number of the Modbus unit; 1 to 247 with RTU. With several stations each has its own",
);

const WRITE_TO: Key = Key::new(
    "write_to",
    Shape::Label(IDENTITY_LIMIT),
    "The identity of the device that may be written to; without it nothing is written",
);

const IDENTITY: Key = Key::new(
    "identity",
    Shape::Table(IDENTITY_KEYS),
    "How the device names itself; vendor \"tickbus\" and the driver's name by default",
);

/// The server's own.
pub(crate) const SERVER: &[Key] = &[
    UNIT,
    IDENTITY,
    Key::new(
        "inputs",
        Shape::Text,
        "The holding register from which on %I can be read once more; \"offset:1024\" by default",
    ),
    Key::new(
        "clients",
        Shape::Whole(1, 10_000),
        "The most clients at the same time",
    )
    .or("1024"),
    Key::new(
        "reserved",
        Shape::List(&Shape::Table(RANGE_KEYS), 1, RANGES),
        "Elements that exist beside those of [fieldbus.at] and carry nothing",
    ),
    Key::new(
        "diagnostics",
        Shape::Boolean,
        "Functions 8, 11 and 12: counters of the line and its last events; true by default, but over TCP false",
    ),
    Key::new(
        "exception_status",
        Shape::Text,
        "The first of eight coils or discrete inputs that function 7 reads; without it function 7 is refused",
    ),
    Key::new(
        "queues",
        Shape::List(&Shape::Text, 0, QUEUES),
        "Holding registers that count the registers behind them, which function 24 reads as a queue",
    ),
    Key::new(
        "tls",
        Shape::Table(tls_options::SERVER_KEYS),
        "Modbus/TCP Security: the certificates, and the roles that may write",
    ),
    Key::new(
        "files",
        Shape::List(&Shape::Whole(1, 0xFFFF), 0, FILES),
        "The numbers of the files that functions 20 and 21 read and write, each with 10,000 records",
    ),
];

/// The client's own.
pub(crate) const CLIENT: &[Key] = &[
    UNIT,
    Key::new("inputs", AREA, "The place of %I"),
    Key::new("outputs", AREA, "The place of %Q"),
    Key::new(
        "timeout",
        Shape::Duration,
        "How long the device has for an answer; 1s by default",
    ),
    Key::new(
        "read_write",
        Shape::Boolean,
        "false: never function 23, which writes and reads in one request",
    )
    .or("true"),
    WRITE_TO,
    Key::new(
        "tls",
        Shape::Table(tls_options::CLIENT_KEYS),
        "Modbus/TCP Security: the certificates",
    ),
];

const AREA: Shape = Shape::Any(&[Shape::Text, Shape::List(&Shape::Table(PART_KEYS), 1, PARTS)]);

/// A server's station.
pub(crate) const SERVED_STATION: &[Key] = &[UNIT, IDENTITY];

/// A client's station.
pub(crate) const POLLED_STATION: &[Key] = &[UNIT, WRITE_TO];
