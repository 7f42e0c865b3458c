//! The table `[driver]` of a driver.cfg.

use tickbus_base::RealTime;
use tickbus_base::toml_text::{Key, Shape, Table, names};
use tickbus_image::signal::Addressing;

use crate::real_time::{self, read_real_time};

/// The longest name of a driver, in characters.
const NAME_LIMIT: usize = 120;

/// The longest path of a file, in characters.
pub(crate) const PATH_LIMIT: usize = 1000;

/// The keys of the table.
pub(crate) const KEYS: &[Key] = &[
    Key::required(
        "id",
        Shape::Whole(1, i32::MAX as i128),
        "A positive number, unique among the drivers of a folder",
    ),
    Key::required("name", Shape::Label(NAME_LIMIT), "A name for people"),
    Key::new(
        "addressing",
        Shape::Choice(&names(&ADDRESSINGS)),
        "\"bytes\": addresses are byte offsets, as Siemens counts; \"iec\": they count elements, as CODESYS does",
    )
    .or("\"bytes\""),
    Key::new(
        "faults",
        Shape::Label(PATH_LIMIT),
        "A file with [[fault]] sections, relative to the folder of this file",
    ),
    Key::new(
        "real_time",
        Shape::Table(real_time::KEYS),
        "Priority, processor and locked memory for the threads of the bus and of a hosted program",
    ),
];

const ADDRESSINGS: [(&str, Addressing); 2] =
    [("bytes", Addressing::Bytes), ("iec", Addressing::Elements)];

/// The contents of `[driver]`.
pub(crate) struct DriverTable {
    pub(crate) id: Option<i32>,
    pub(crate) name: Option<String>,
    pub(crate) addressing: Addressing,
    pub(crate) faults: Option<String>,
    pub(crate) real_time: Option<RealTime>,
}

/// Reads the table.
pub(crate) fn read_driver(mut table: Table<'_>) -> DriverTable {
    let id = table.require(
        "id",
        "write a number that no other driver has, such as id = 4711",
    );
    let name = table.require("name", "give the driver a name for people");
    let addressing = table.take("addressing");
    let faults = table.take("faults");
    let real_time = table.take("real_time");
    table.finish();
    DriverTable {
        id: id
            .and_then(|value| value.whole(1..=i32::MAX.into()))
            .and_then(|id| i32::try_from(id).ok()),
        name: name
            .and_then(|value| value.label(NAME_LIMIT, "give the driver a name for people"))
            .map(str::to_owned),
        addressing: addressing
            .and_then(|value| value.choice("ways of addressing", &ADDRESSINGS))
            .unwrap_or_default(),
        faults: faults
            .and_then(|value| {
                let right = "name a file that has [[fault]] sections, such as \"faults.toml\"";
                value.label(PATH_LIMIT, right)
            })
            .map(str::to_owned),
        real_time: real_time.and_then(|value| read_real_time(&value)),
    }
}
