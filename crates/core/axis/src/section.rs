//! The `[[axis]]` and `[[drive]]` sections of a driver.cfg: each expands into signals.

mod commands;
pub mod drives;
mod switches;

use std::collections::HashMap;

use commands::read_commands;
use switches::read_switches;

use super::field::Quantity;
use super::{Axis, AxisKind, COMMAND_BYTES, EXTENDED_FEEDBACK_BYTES, FEEDBACK_BYTES, Field};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, names, short_number, shown};
use tickbus_image::signal::section::{
    DEAD_BAND_KEY, NAME_LIMIT, SCALE_KEY, STATION_KEY, Section, Structure, TWO_NUMBERS,
    dead_band_of, name_of, pair_of, scale_of,
};
use tickbus_image::signal::{
    AREA_LIMIT, Addressing, Area, ByteOrder, DataType, Latch, Scale, Signal, Slot,
};

/// The longest name of a field, with the dot, in characters.
const FIELD_NAME: usize = 16;

/// The longest unit, in characters; "mm" becomes "mm/s³".
const UNIT_LIMIT: usize = 36;

/// The most commands, and the most end switches, of one axis.
const LIST_LIMIT: usize = 1000;

/// The keys of an `[[axis]]` section.
pub const KEYS: &[Key] = &[
    Key::required(
        "name",
        Shape::Label(NAME_LIMIT - FIELD_NAME),
        "A unique name; the names of its signals begin with it",
    ),
    Key::new(
        "kind",
        Shape::Choice(&names(&AxisKind::ALL)),
        "The commands that make sense: \"torque\" opens and closes",
    )
    .or("\"position\""),
    Key::new(
        "unit",
        Shape::Label(UNIT_LIMIT),
        "The unit of the position; speeds get /s, accelerations /s²",
    ),
    SCALE_KEY,
    Key::new("limits", TWO_NUMBERS, "The least and the greatest position"),
    Key::new(
        "inverted",
        Shape::Boolean,
        "true: on the wire positions count from the other limit, and speeds the other way",
    )
    .or("false"),
    DEAD_BAND_KEY,
    STATION_KEY,
    Key::new(
        "command_offset",
        Shape::Whole(0, (AREA_LIMIT - COMMAND_BYTES) as i128),
        "The first byte of the command in %Q; right behind the axis before it if it is left out",
    ),
    Key::new(
        "feedback_offset",
        Shape::Whole(0, (AREA_LIMIT - FEEDBACK_BYTES) as i128),
        "The first byte of the feedback in %I; right behind the axis before it if it is left out",
    ),
    Key::new(
        "acknowledge",
        Shape::Boolean,
        "true: with the bit .Acknowledge",
    )
    .or("false"),
    Key::new(
        "diagnostics",
        Shape::Boolean,
        "true: with the words .Status and .Error",
    )
    .or("false"),
    Key::new(
        "jerk",
        Shape::Boolean,
        "true: with the number .Jerk, which requests an S-curve",
    )
    .or("false"),
    Key::new(
        "command",
        Shape::List(&Shape::Table(commands::KEYS), 0, LIST_LIMIT),
        "The commands that the PLC requests by number",
    ),
    Key::new(
        "switch",
        Shape::List(&Shape::Table(switches::KEYS), 0, LIST_LIMIT),
        "The end switches",
    ),
];

/// The bytes that the preceding tables of axes and drives occupy.
#[derive(Debug, Default)]
pub struct OffsetAllocator<'a> {
    /// By name of the station: the first free bytes of `%Q` and of `%I`.
    free: HashMap<&'a str, (usize, usize)>,
}

impl<'a> OffsetAllocator<'a> {
    /// Allocates the two structures of an axis or a drive: at the offsets of its table, or right after the preceding
    /// one. `least` are the bytes that have to fit behind a stated offset.
    fn take(
        &mut self,
        station: Option<&Value<'a>>,
        offsets: &[Option<Value<'a>>; 2],
        bytes: [usize; 2],
        least: [usize; 2],
    ) -> (Option<usize>, Option<usize>) {
        let key = station.and_then(Value::as_text).unwrap_or("");
        let free = self.free.entry(key).or_default();
        let command = offset_of(offsets[0].as_ref(), free.0, least[0]);
        let feedback = offset_of(offsets[1].as_ref(), free.1, least[1]);
        *free = (
            command.unwrap_or(free.0) + bytes[0],
            feedback.unwrap_or(free.1) + bytes[1],
        );
        (command, feedback)
    }
}

/// One `[[axis]]` table, read.
#[derive(Debug)]
pub struct Read<'a> {
    /// The axis. Its signals are not [resolved](super::resolve) yet.
    pub axis: Axis,
    /// The signals, in the order of their addresses, followed by those of the end switches.
    pub sections: Vec<Section<'a>>,
}

/// The scaling of an axis' numbers.
#[derive(Clone, Copy, Debug)]
struct Scales {
    scale: Option<Scale>,
    /// Of an inverted axis: the sum of its limits.
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
    places: &mut OffsetAllocator<'a>,
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
        .filter(|(name, value)| is_short("axis", name, value));
    let kind = kind.map_or(Some(AxisKind::Position), |value| {
        value.choice("kinds of axes", &AxisKind::ALL)
    });
    let unit = unit.and_then(|unit| unit.label(UNIT_LIMIT, "leave it out if the axis has no unit"));
    let scaled = scale.as_ref().map(|value| scale_of(value, DataType::Real));
    let stated = limits.as_ref().map(limits_of);
    let mirrored = inverted.as_ref().map(|value| (value.boolean(), value));
    let flag = |value: Option<Value<'_>>| value.map_or(Some(false), |value| value.boolean());
    let [acknowledge, diagnostics, jerk] = [flag(acknowledge), flag(diagnostics), flag(jerk)];
    let band = dead_band.as_ref().map(dead_band_of);
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
        .map(|value| read_switches(&value, number, addressing, bounds))
        .unwrap_or_default();

    let feedback_bytes = if diagnostics == Some(true) || numbered {
        EXTENDED_FEEDBACK_BYTES
    } else {
        FEEDBACK_BYTES
    };
    let bytes = [COMMAND_BYTES, feedback_bytes];
    let (command, feedback) = places.take(station.as_ref(), &offsets, bytes, bytes);
    let (command, feedback) = (command?, feedback?);
    let ((name, value), kind) = (named?, kind?);
    let end = (command + COMMAND_BYTES).max(feedback + feedback_bytes);
    let judged = whole && !matches!(scaled, Some(None));
    let may_invert = mirrored.is_some_and(|(inverted, _)| inverted != Some(false));
    if !judged || (may_invert && bounds.is_none()) || !fits("axis", end, name, value) {
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
    let has = |field| match field {
        Field::Acknowledge => acknowledge == Some(true),
        Field::Jerk => jerk == Some(true),
        Field::Status | Field::Error => diagnostics == Some(true),
        Field::CommandNumber | Field::CommandDone => numbered,
        _ => true,
    };
    let fields = Field::ALL.into_iter().filter(|field| has(*field));
    let signals = fields.map(|field| signal(&axis, field, scales, band.flatten()));
    let structures = Structures {
        kind: "axis",
        name: value,
        offsets: &offsets,
        station: station.as_ref(),
        number,
        ends: [command + COMMAND_BYTES, feedback + feedback_bytes],
    };
    let mut sections: Vec<Section<'a>> = signals.map(|signal| structures.section(signal)).collect();
    for (_, mut section) in switches {
        section.station.clone_from(&station);
        sections.push(section);
    }
    Some(Read { axis, sections })
}

/// The data shared by the sections of all signals of one axis or drive.
struct Structures<'t, 'a> {
    /// The kind of thing that the table describes, in messages.
    kind: &'static str,
    name: &'t Value<'a>,
    /// The values of `command_offset` and `feedback_offset`.
    offsets: &'t [Option<Value<'a>>; 2],
    station: Option<&'t Value<'a>>,
    number: usize,
    /// Offsets just beyond the command and the feedback.
    ends: [usize; 2],
}

impl<'a> Structures<'_, 'a> {
    fn section(&self, signal: Signal) -> Section<'a> {
        let place = usize::from(signal.area == Area::Input);
        Section {
            name: Some(self.name.clone()),
            address: self.offsets[place].as_ref().unwrap_or(self.name).clone(),
            station: self.station.cloned(),
            structure: Some(Structure {
                kind: self.kind,
                table: self.number,
                end: self.ends[place],
            }),
            signal,
        }
    }
}

fn is_short(kind: &str, name: &str, value: &Value<'_>) -> bool {
    let most = NAME_LIMIT - FIELD_NAME;
    let short = name.chars().nth(most).is_none();
    if !short {
        value.wrong(
            format!(
                "the name of the {kind} is longer than {most} characters: \"{}\"",
                shown(name)
            ),
            "shorten it; the names of its signals begin with it",
        );
    }
    short
}

/// True if a structure that ends at `end` fits into its area.
fn fits(kind: &str, end: usize, name: &str, value: &Value<'_>) -> bool {
    if end > AREA_LIMIT {
        value.wrong(
            format!("the {kind} \"{}\" ends at byte {}", shown(name), end - 1),
            format!("an area has at most {AREA_LIMIT} bytes; use several stations"),
        );
    }
    end <= AREA_LIMIT
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
            Quantity::Torque if axis.kind == AxisKind::Torque => Some("%".to_owned()),
            _ => None,
        },
        // The pulses may be shorter than a tick or a bus cycle.
        latch: matches!(field, Field::Execute | Field::Acknowledge).then_some(Latch::Rising),
        count_swallowed: None,
        states_fail_safe: false,
        hold: Nanos::ZERO,
        fail_safe: scale.map_or_else(Slot::default, |scale| Slot::from_real(scale.offset)),
        dead_band: band.filter(|_| feedback).unwrap_or_default(),
        range: None,
        in_plc: None,
        notes: None,
    }
}

fn limits_of(value: &Value<'_>) -> Option<[f64; 2]> {
    let [(low, _), (high, _)] = pair_of(value, "write two numbers, such as [0.0, 650.0]")?;
    if !(low + high).is_finite() {
        value.wrong(
            "the sum of these \"limits\" is beyond every number",
            "write smaller ones, such as [0.0, 650.0]",
        );
        return None;
    }
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

fn offset_of(value: Option<&Value<'_>>, free: usize, bytes: usize) -> Option<usize> {
    let Some(value) = value else {
        return Some(free);
    };
    let most = i128::try_from(AREA_LIMIT - bytes).ok()?;
    let offset = value.whole(0..=most)?;
    usize::try_from(offset).ok()
}

/// Reports a position outside the limits.
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
