//! The keys of a driver.cfg, each declared beside the code that reads it: for the schema of the file.

use tickbus_axis as axis;
use tickbus_base::toml_text::{Key, Shape};
use tickbus_fieldbus::faults::{self, FAULT_KEYS};
use tickbus_fieldbus::{ADDRESS_LIMIT, Role, Written};
use tickbus_image::signal::section;
use tickbus_record as record;
use tickbus_reply as reply;

use crate::{driver_table, layout, page, timing};

pub use crate::kind_keys::KindKeys;
pub use crate::layout::STATION_LIMIT;

const ROLES: [&str; Role::ALL.len()] = [
    Role::ALL[0].name(),
    Role::ALL[1].name(),
    Role::ALL[2].name(),
];

/// The keys of `[fieldbus]` on every bus, beside `kind` and `events`, in groups.
pub const FIELDBUS: &[&[Key]] = &[
    &[
        Key::new(
            "role",
            Shape::Choice(&ROLES),
            "\"device\": this end is the machine; \"controller\": this end is the PLC; \"observer\": this end only reads. A file without it serves both ends",
        ),
        Key::new(
            "at",
            Shape::Map(&Shape::Label(ADDRESS_LIMIT)),
            "The addresses of single signals in the device, as the device spells them",
        ),
    ],
    Written::KEYS,
    timing::KEYS,
    layout::SIZE_KEYS,
];

/// The keys of a `[[station]]` on every bus, in groups.
pub const STATION: &[&[Key]] = &[
    &[Key::required(
        "name",
        Shape::Label(section::NAME_LIMIT),
        "A unique name",
    )],
    layout::SIZE_KEYS,
];

/// The tables of the file, but for `[fieldbus]` and `[[station]]`, whose keys depend on the bus.
pub const FILE: &[Key] = &[
    Key::required(
        "driver",
        Shape::Table(driver_table::KEYS),
        "The driver: its id and its name",
    ),
    Key::new(
        "signal",
        Shape::List(&Shape::Table(section::KEYS), 0, layout::SIGNAL_LIMIT),
        "The signals, the same on every bus; the simulator's components have their order",
    ),
    Key::new(
        "axis",
        Shape::List(&Shape::Table(axis::section::KEYS), 0, layout::AXIS_LIMIT),
        "Drives of the machine, each as some fifteen signals",
    ),
    Key::new(
        "drive",
        Shape::List(
            &Shape::Table(axis::section::drives::KEYS),
            0,
            layout::DRIVE_LIMIT,
        ),
        "Drives on a telegram of PROFIdrive",
    ),
    Key::new(
        "reply",
        Shape::List(&Shape::Table(reply::REPLY_KEYS), 0, reply::LIMIT),
        "Signals that the driver makes where no model does",
    ),
    Key::new(
        "fault",
        Shape::List(&Shape::Table(FAULT_KEYS), 0, faults::LIMIT),
        "What goes wrong on purpose",
    ),
    Key::new(
        "record",
        Shape::Table(record::Options::KEYS),
        "Writes what every tick sees to a file",
    ),
    Key::new(
        "page",
        Shape::Table(page::KEYS),
        "Shows the driver on a live page",
    ),
];
