//! The `[[axis.switch]]` tables: end switches.

use super::{LIST_LIMIT, check_within};
use crate::Switch;
use tickbus_base::toml_text::{Key, Shape, Table, Value};
use tickbus_image::signal::section::{
    ADDRESS, NAME_LIMIT, Section, Structure, address_of, name_of,
};
use tickbus_image::signal::{Addressing, Area, DataType, Signal, Width};

/// The keys of an `[[axis.switch]]` table.
pub(super) const KEYS: &[Key] = &[
    Key::required("name", Shape::Label(NAME_LIMIT), "A unique name"),
    Key::required("address", ADDRESS, "A bit of %I, such as \"%IX120.0\""),
    Key::new("above", Shape::Number, "The position above which it is on"),
    Key::new("below", Shape::Number, "The position below which it is on"),
    Key::new(
        "hysteresis",
        Shape::Number,
        "How far the axis comes back before the switch is off; not negative",
    )
    .or("0.0"),
];

/// The remedy where a trip point is expected.
const POSITION: &str = "write a position in the unit of the axis, such as 395.0";

/// Reads the end switches of the axis with this `number`.
pub(super) fn read_switches<'a>(
    value: &Value<'a>,
    number: usize,
    addressing: Addressing,
    limits: Option<[f64; 2]>,
) -> Vec<(Switch, Section<'a>)> {
    let tables = value.tables("[[axis.switch]]");
    if let Some(table) = tables.get(LIST_LIMIT) {
        table.wrong(
            format!("there are {} end switches", tables.len()),
            format!("an axis has at most {LIST_LIMIT}"),
        );
        return Vec::new();
    }
    let read = tables
        .into_iter()
        .filter_map(|table| read_switch(table, number, addressing, limits));
    read.collect()
}

fn read_switch(
    mut table: Table<'_>,
    number: usize,
    addressing: Addressing,
    limits: Option<[f64; 2]>,
) -> Option<(Switch, Section<'_>)> {
    let name = table.require("name", "give the end switch a name of its own");
    let address = table.require("address", "write the bit of %I, such as \"%IX120.0\"");
    let above = table.take("above");
    let below = table.take("below");
    let hysteresis = table.take("hysteresis");
    table.require_one_of(
        &["above", "below"],
        "write the position above which it is on, such as above = 395.0, or below which",
    );
    let whole = table.is_whole();
    table.finish();
    let name = name.and_then(|value| Some((name_of(&value)?, value)));
    let place = address
        .as_ref()
        .and_then(|value| Some((address_of(value, addressing)?, value)));
    if let (Some(_), Some(below)) = (&above, &below) {
        below.wrong(
            "\"above\" and \"below\" stand together",
            "remove one of them; a switch has one trip point",
        );
    }
    let trip = |value: &Option<Value<'_>>| {
        let value = value.as_ref()?;
        let at = value.number(POSITION)?;
        check_within(value, at, limits);
        Some(at)
    };
    let (up, down) = (trip(&above), trip(&below));
    let slack = hysteresis.as_ref().map_or(Some(0.0), |value| {
        let number =
            value.number("write how far the axis comes back before it is off, such as 0.5")?;
        if number < 0.0 {
            value.wrong(
                format!("\"hysteresis\" is {}, less than nothing", value.written()),
                "write how far the axis comes back before it is off, such as 0.5",
            );
        }
        Some(number)
    });
    let (place, at_address) = place?;
    if place.area != Area::Input || place.width != Width::Bit {
        at_address.wrong(
            format!("{place} is no bit of %I"),
            "an end switch is one, such as \"%IX120.0\"",
        );
        return None;
    }
    let ((name, name_value), at, hysteresis) = (name?, up.or(down)?, slack?);
    if !whole {
        return None;
    }
    let switch = Switch {
        name: name.to_owned(),
        at,
        above: up.is_some(),
        hysteresis,
        slot: 0,
    };
    let signal = Signal {
        bit: place.bit,
        ..Signal::new(name, place.area, place.byte, DataType::Bool)
    };
    let section = Section {
        signal,
        name: Some(name_value),
        address: address?,
        station: None,
        structure: Some(Structure {
            kind: "axis",
            table: number,
            end: place.byte + 1,
        }),
    };
    Some((switch, section))
}
