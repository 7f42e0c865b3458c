//! The `[[axis]]` sections of a driver.cfg: each expands into signals.

use std::collections::HashMap;

use super::field::Quantity;
use super::{
    Axis, COMMAND_BYTES, Command, EXTENDED_FEEDBACK_BYTES, FEEDBACK_BYTES, Field, Kind, Mode,
    Motion, Switch,
};
use crate::config::{Table, Value, short_number, shown};
use crate::signal::section::{
    NAME_LIMIT, Section, Structure, address_of, name_of, pair_of, scale_of,
};
use crate::signal::{
    AREA_LIMIT, Addressing, Area, ByteOrder, DataType, Latch, Scale, Signal, Slot, Width,
};
use crate::time::Nanos;

/// What the name of a field adds to that of its axis, at most.
const FIELD_NAME: usize = 16;

/// The longest unit, in characters; "mm" becomes "mm/s³".
const UNIT_LIMIT: usize = 36;

/// The most commands of one axis, and the most end switches.
const LIST_LIMIT: usize = 1000;

/// What the axis tables before this one have taken up.
#[derive(Debug, Default)]
pub struct Places<'a> {
    /// By the name of the station: the first free bytes of `%Q` and of `%I`.
    free: HashMap<&'a str, (usize, usize)>,
}

/// One `[[axis]]` table, read.
#[derive(Debug)]
pub struct Read<'a> {
    /// The axis. Its signals are not yet [resolved](super::resolve).
    pub axis: Axis,
    /// Its signals, in the order of their addresses, with those of its end switches behind them.
    pub sections: Vec<Section<'a>>,
}

/// How the numbers of an axis become raw ones.
#[derive(Clone, Copy, Debug)]
struct Scales {
    scale: Option<Scale>,
    /// Where the axis is inverted: the sum of its limits.
    mirror: Option<f64>,
}

impl Scales {
    fn of(self, quantity: Quantity) -> Option<Scale> {
        let Scale { gain, offset } = self.scale.unwrap_or(Scale {
            gain: 1.0,
            offset: 0.0,
        });
        let (sign, offset) = match self.mirror {
            Some(mirror) => (-1.0, mirror - offset),
            None => (1.0, offset),
        };
        let scale = match quantity {
            Quantity::Position => Scale {
                gain: gain * sign,
                offset,
            },
            Quantity::Velocity => Scale {
                gain: gain * sign,
                offset: 0.0,
            },
            Quantity::Magnitude(_) => Scale {
                gain: gain.abs(),
                offset: 0.0,
            },
            _ => return None,
        };
        let plain = Scale {
            gain: 1.0,
            offset: 0.0,
        };
        (scale != plain).then_some(scale)
    }
}

/// Reads one section, the one with this `number` from 0, and reports its mistakes; `None` when its signals
/// cannot be placed.
pub fn read<'a>(
    mut table: Table<'a>,
    number: usize,
    addressing: Addressing,
    places: &mut Places<'a>,
) -> Option<Read<'a>> {
    let name = table.require("name", "give the axis a name of its own");
    let kind = table.take("kind");
    let unit = table.take("unit");
    let scale = table.take("scale");
    let limits = table.take("limits");
    let inverted = table.take("inverted");
    let dead_band = table.take("dead_band");
    let station = table.take("station");
    let offsets = ["command_offset", "feedback_offset"].map(|key| table.take(key));
    let [acknowledge, diagnostics, jerk] =
        ["acknowledge", "diagnostics", "jerk"].map(|key| table.take(key));
    let commands = table.take("command");
    let switches = table.take("switch");
    let whole = table.is_whole();
    table.finish();

    let named = name
        .as_ref()
        .and_then(|value| name_of(value).map(|name| (name, value)))
        .filter(|(name, value)| is_short(name, value));
    let kind = kind.map_or(Some(Kind::Position), |value| {
        value.choice("kinds of axes", &Kind::ALL)
    });
    let unit = unit.and_then(|unit| unit.label(UNIT_LIMIT, "leave it out if the axis has no unit"));
    let scaled = scale.as_ref().map(|value| scale_of(value, DataType::Real));
    let stated = limits.as_ref().map(limits_of);
    let mirrored = inverted.as_ref().map(|value| (value.boolean(), value));
    let flag = |value: Option<Value<'_>>| value.map_or(Some(false), |value| value.boolean());
    let [acknowledge, diagnostics, jerk] = [flag(acknowledge), flag(diagnostics), flag(jerk)];
    let band = dead_band.as_ref().map(band_of);
    let bounds = stated.flatten();
    if let (Some((Some(true), value)), None, true) = (mirrored, &limits, whole) {
        value.wrong(
            "\"inverted\" stands without \"limits\"",
            "add limits = [0.0, 650.0], so that it is known where the other end is",
        );
    }
    let commands = commands.map(|value| read_commands(&value, kind, bounds));
    let numbered = commands.is_some();
    let switches = switches
        .map(|value| read_switches(&value, addressing, bounds))
        .unwrap_or_default();

    let extended = diagnostics == Some(true) || numbered;
    let feedback_bytes = if extended {
        EXTENDED_FEEDBACK_BYTES
    } else {
        FEEDBACK_BYTES
    };
    let key = station.as_ref().and_then(Value::as_text).unwrap_or("");
    let free = places.free.entry(key).or_default();
    let command = offset_of(offsets[0].as_ref(), free.0, COMMAND_BYTES);
    let feedback = offset_of(offsets[1].as_ref(), free.1, feedback_bytes);
    *free = (
        command.unwrap_or(free.0) + COMMAND_BYTES,
        feedback.unwrap_or(free.1) + feedback_bytes,
    );
    let (command, feedback) = (command?, feedback?);
    let ((name, value), kind) = (named?, kind?);
    if !whole || matches!(scaled, Some(None)) || (mirrored.is_some() && bounds.is_none()) {
        return None;
    }
    let end = (command + COMMAND_BYTES).max(feedback + feedback_bytes);
    if end > AREA_LIMIT {
        value.wrong(
            format!("the axis \"{}\" ends at byte {}", shown(name), end - 1),
            format!("an area has at most {AREA_LIMIT} bytes; use several stations"),
        );
        return None;
    }
    let axis = Axis {
        name: name.to_owned(),
        kind,
        unit: unit.map(str::to_owned),
        limits: bounds,
        inverted: matches!(mirrored, Some((Some(true), _))),
        command,
        feedback,
        feedback_bytes,
        commands: commands.unwrap_or_default(),
        switches: switches.iter().map(|(switch, _)| switch.clone()).collect(),
        slots: [None; Field::COUNT],
    };
    let scales = Scales {
        scale: scaled.flatten(),
        mirror: bounds
            .filter(|_| axis.inverted)
            .map(|[low, high]| low + high),
    };
    let fields = Field::ALL.into_iter().filter(|field| match field {
        Field::Acknowledge => acknowledge == Some(true),
        Field::Jerk => jerk == Some(true),
        Field::Status | Field::Error => diagnostics == Some(true),
        Field::CommandNumber | Field::CommandDone => numbered,
        _ => true,
    });
    let mut sections: Vec<Section<'a>> = fields
        .map(|field| Section {
            signal: signal(&axis, field, scales, band.flatten()),
            name: Some(value.clone()),
            address: match field.area() {
                Area::Output => offsets[0].clone(),
                Area::Input => offsets[1].clone(),
            }
            .unwrap_or_else(|| value.clone()),
            station: station.clone(),
            structure: Some(Structure {
                table: number,
                end: match field.area() {
                    Area::Output => axis.command + COMMAND_BYTES,
                    Area::Input => axis.feedback + axis.feedback_bytes,
                },
            }),
        })
        .collect();
    for (_, mut section) in switches {
        section.station.clone_from(&station);
        sections.push(section);
    }
    Some(Read { axis, sections })
}

fn is_short(name: &str, value: &Value<'_>) -> bool {
    let most = NAME_LIMIT - FIELD_NAME;
    let short = name.chars().nth(most).is_none();
    if !short {
        value.wrong(
            format!(
                "the axis' name is longer than {most} characters: \"{}\"",
                shown(name)
            ),
            "shorten it; the names of its signals begin with it",
        );
    }
    short
}

/// The signal of one field.
fn signal(axis: &Axis, field: Field, scales: Scales, band: Option<f64>) -> Signal {
    let quantity = field.quantity();
    let scale = scales.of(quantity);
    let base = match field.area() {
        Area::Output => axis.command,
        Area::Input => axis.feedback,
    };
    let unit = axis.unit.as_deref();
    let feedback = matches!(field, Field::ActualPosition | Field::ActualSpeed);
    Signal {
        name: axis.signal(field),
        station: 0,
        area: field.area(),
        byte: base + field.offset(),
        bit: field.bit(),
        data_type: field.data_type(),
        order: ByteOrder::Abcd,
        scale,
        unit: match quantity {
            Quantity::Position => unit.map(str::to_owned),
            Quantity::Velocity | Quantity::Magnitude(1) => unit.map(|unit| format!("{unit}/s")),
            Quantity::Magnitude(2) => unit.map(|unit| format!("{unit}/s²")),
            Quantity::Magnitude(_) => unit.map(|unit| format!("{unit}/s³")),
            Quantity::Torque if axis.kind == Kind::Torque => Some("%".to_owned()),
            _ => None,
        },
        // A PLC may drop Execute at any time after it has been sent.
        latch: (field == Field::Execute).then_some(Latch::Rising),
        hold: Nanos::ZERO,
        fail_safe: scale.map_or_else(Slot::default, |scale| Slot::from_real(scale.offset)),
        dead_band: band.filter(|_| feedback).unwrap_or_default(),
    }
}

fn limits_of(value: &Value<'_>) -> Option<[f64; 2]> {
    let [(low, _), (high, _)] = pair_of(value, "write two numbers, such as [0.0, 650.0]")?;
    if low >= high {
        value.wrong(
            format!(
                "\"limits\" go from {} to {}",
                short_number(low),
                short_number(high)
            ),
            "write the lower one first, such as [0.0, 650.0]",
        );
        return None;
    }
    Some([low, high])
}

fn band_of(value: &Value<'_>) -> Option<f64> {
    crate::signal::section::dead_band_of(value)
}

fn offset_of(value: Option<&Value<'_>>, free: usize, bytes: usize) -> Option<usize> {
    let Some(value) = value else {
        return Some(free);
    };
    let most = i128::try_from(AREA_LIMIT - bytes).ok()?;
    let offset = value.whole(0..=most)?;
    usize::try_from(offset).ok()
}

/// Tells where a position lies outside of the limits.
fn check_within(value: &Value<'_>, position: f64, limits: Option<[f64; 2]>) {
    if let Some([low, high]) = limits
        && !(low..=high).contains(&position)
    {
        value.wrong(
            format!(
                "{} is beyond the limits of the axis, {} and {}",
                value.written(),
                short_number(low),
                short_number(high)
            ),
            "write a position between them",
        );
    }
}

fn read_commands(value: &Value<'_>, kind: Option<Kind>, limits: Option<[f64; 2]>) -> Vec<Command> {
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
    kind: Option<Kind>,
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
        Some(Kind::Speed) => Mode::Speed,
        Some(Kind::Tracking) => Mode::Tracking,
        Some(Kind::Torque) => Mode::Close,
        Some(Kind::Position) | None => Mode::Position,
    };
    let chosen = match &mode {
        None => Some(usual),
        Some(value) => value.choice("modes", &Mode::ALL),
    };
    if let (Some(chosen), Some(value), Some(kind)) = (chosen, &mode, kind) {
        let opens = matches!(chosen, Mode::Open | Mode::Close);
        if opens != (kind == Kind::Torque) || (chosen == Mode::Tracking && kind != Kind::Tracking) {
            value.wrong(
                format!(
                    "an axis of the kind \"{}\" has no mode \"{}\"",
                    kind.name(),
                    chosen.name()
                ),
                match kind {
                    Kind::Torque => "write \"open\" or \"close\"",
                    Kind::Tracking => "write \"tracking\", \"position\" or \"speed\"",
                    Kind::Position | Kind::Speed => "write \"position\" or \"speed\"",
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

fn read_switches<'a>(
    value: &Value<'a>,
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
        .filter_map(|table| read_switch(table, addressing, limits));
    read.collect()
}

fn read_switch<'a>(
    mut table: Table<'a>,
    addressing: Addressing,
    limits: Option<[f64; 2]>,
) -> Option<(Switch, Section<'a>)> {
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
    const POSITION: &str = "write a position in the unit of the axis, such as 395.0";
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
        name: name.to_owned(),
        station: 0,
        area: place.area,
        byte: place.byte,
        bit: place.bit,
        data_type: DataType::Bool,
        order: ByteOrder::Abcd,
        scale: None,
        unit: None,
        latch: None,
        hold: Nanos::ZERO,
        fail_safe: Slot::default(),
        dead_band: 0.0,
    };
    let section = Section {
        signal,
        name: Some(name_value),
        address: address?,
        station: None,
        structure: None,
    };
    Some((switch, section))
}
