//! The `[[axis.command]]` tables: commands by number.

use std::collections::HashMap;

use super::{LIST_LIMIT, check_within};
use crate::{AxisKind, Command, Mode, Motion};
use tickbus_base::toml_text::{Key, Shape, Table, Value, names};

/// The keys of an `[[axis.command]]` table.
pub(super) const KEYS: &[Key] = &[
    Key::required(
        "number",
        Shape::Whole(1, u16::MAX as i128),
        "The number that the PLC sends",
    ),
    Key::new(
        "mode",
        Shape::Choice(&names(&Mode::ALL)),
        "What the axis does; by its kind if it is left out",
    ),
    Key::new(
        "position",
        Shape::Number,
        "The target, in the unit of the axis",
    ),
    Key::new("speed", Shape::Number, "Above 0"),
    Key::new("acceleration", Shape::Number, "Above 0"),
    Key::new("deceleration", Shape::Number, "Above 0"),
    Key::new("torque", Shape::Number, "The torque, in percent"),
];

/// Reads the numbered commands of an axis of this `kind`.
pub(super) fn read_commands(
    value: &Value<'_>,
    kind: Option<AxisKind>,
    limits: Option<[f64; 2]>,
) -> Vec<Command> {
    let tables = value.tables("[[axis.command]]");
    if let Some(table) = tables.get(LIST_LIMIT) {
        table.wrong(
            format!("there are {} commands", tables.len()),
            format!("an axis has at most {LIST_LIMIT}"),
        );
        return Vec::new();
    }
    let mut lines = HashMap::new();
    let read = tables
        .into_iter()
        .filter_map(|table| read_command(table, kind, limits, &mut lines));
    read.collect()
}

fn read_command(
    mut table: Table<'_>,
    kind: Option<AxisKind>,
    limits: Option<[f64; 2]>,
    lines: &mut HashMap<u16, usize>,
) -> Option<Command> {
    let number = table.require("number", "write the number that the PLC sends, from 1 on");
    let mode = table.take("mode");
    let [position, speed, acceleration, deceleration, torque] = [
        "position",
        "speed",
        "acceleration",
        "deceleration",
        "torque",
    ]
    .map(|key| table.take(key));
    table.finish();
    let usual = match kind {
        Some(AxisKind::Speed) => Mode::Speed,
        Some(AxisKind::Tracking) => Mode::Tracking,
        Some(AxisKind::Torque) => Mode::Close,
        Some(AxisKind::Position) | None => Mode::Position,
    };
    let chosen = match &mode {
        None => Some(usual),
        Some(value) => value.choice("modes", &Mode::ALL),
    };
    if let (Some(chosen), Some(value), Some(kind)) = (chosen, &mode, kind) {
        let opens = matches!(chosen, Mode::Open | Mode::Close);
        if opens != (kind == AxisKind::Torque)
            || (chosen == Mode::Tracking && kind != AxisKind::Tracking)
        {
            value.wrong(
                format!(
                    "an axis of the kind \"{}\" has no mode \"{}\"",
                    kind.name(),
                    chosen.name()
                ),
                match kind {
                    AxisKind::Torque => "write \"open\" or \"close\"",
                    AxisKind::Tracking => "write \"tracking\", \"position\" or \"speed\"",
                    AxisKind::Position | AxisKind::Speed => "write \"position\" or \"speed\"",
                },
            );
        }
    }
    let plain = |value: &Option<Value<'_>>| {
        let value = value.as_ref()?;
        value.number("write a number in the unit of the axis")
    };
    let size = |value: &Option<Value<'_>>| {
        let (value, number) = (value.as_ref()?, plain(value)?);
        if number <= 0.0 {
            value.wrong(
                format!("{} is no more than nothing", value.written()),
                "write a number above 0; where the position is decides the direction",
            );
        }
        Some(number)
    };
    let target = plain(&position);
    if let (Some(value), Some(target), Some(Mode::Position)) = (&position, target, chosen) {
        check_within(value, target, limits);
    }
    let motion = Motion {
        position: target,
        speed: size(&speed),
        acceleration: size(&acceleration),
        deceleration: size(&deceleration),
        torque: plain(&torque),
    };
    let number = number?;
    let stated = u16::try_from(number.whole(1..=i128::from(u16::MAX))?).ok()?;
    if let Some(line) = lines.get(&stated) {
        number.wrong(
            format!("the number {stated} is that of the command on line {line}"),
            "give each command of an axis a number of its own",
        );
        return None;
    }
    lines.insert(stated, number.line());
    Some(Command {
        number: stated,
        mode: chosen?,
        motion,
    })
}
