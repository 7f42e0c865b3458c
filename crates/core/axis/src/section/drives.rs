//! The `[[drive]]` sections: drives on a telegram of PROFIdrive.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, short_number};
use tickbus_image::signal::section::{NAME_LIMIT, STATION_KEY, Section, TWO_NUMBERS, name_of};
use tickbus_image::signal::{AREA_LIMIT, ByteOrder, Signal, Slot};

use super::{FIELD_NAME, OffsetAllocator, Structures, fits, is_short, limits_of};
use crate::profidrive::{Mechanics, Setup, Telegram, Word};

/// The factory settings of SINAMICS: p2000 in turns per minute, p1120 and p1121, and the external fault and alarm
/// (F07860, A07850).
const REFERENCE_SPEED: f64 = 3000.0;
const RAMP: Nanos = Nanos::from_secs(10);
const CODES: [u16; 2] = [7860, 7850];

/// The increments of a turn: an encoder with 2048 lines and the fine resolution of the factory (p0418 = 11 bits).
const INCREMENTS: u32 = 2048 << 11;

/// The factory settings of the positioner: p2571 in 1000 LU per minute, p2572 and p2573 in 1000 LU/s², p2506 in LU.
const VELOCITY: f64 = 30_000.0;
const ACCELERATION: f64 = 100.0;
const UNITS_PER_TURN: f64 = 10_000.0;

/// The shape of a condition, of a list of conditions that must all hold, or of signals and their values.
pub const CONDITIONS: Shape = Shape::Any(&[Shape::Text, Shape::List(&Shape::Text, 1, 100), VALUES]);

/// The shape of signals and their values.
pub const VALUES: Shape = Shape::Map(&Shape::Any(&[Shape::Number, Shape::Boolean]));

/// The bytes of the shortest telegram.
const LEAST: usize = 4;

const CODE: Shape = Shape::Whole(1, u16::MAX as i128);

const NUMBERS: [u32; Telegram::ALL.len()] = {
    let mut numbers = [0; Telegram::ALL.len()];
    let mut index = 0;
    while index < numbers.len() {
        numbers[index] = Telegram::ALL[index].number();
        index += 1;
    }
    numbers
};

/// The keys of a `[[drive]]` section.
pub const KEYS: &[Key] = &[
    Key::required(
        "name",
        Shape::Label(NAME_LIMIT - FIELD_NAME),
        "A unique name; the names of its signals begin with it",
    ),
    Key::required(
        "telegram",
        Shape::Numbers(&NUMBERS),
        "The telegram of PROFIdrive: 1, 2, 3 and 5 for speeds, 111 for positions",
    ),
    STATION_KEY,
    Key::new(
        "command_offset",
        Shape::Whole(0, (AREA_LIMIT - LEAST) as i128),
        "The first byte of the telegram in %Q; right behind the axis or drive before it if it is left out",
    ),
    Key::new(
        "feedback_offset",
        Shape::Whole(0, (AREA_LIMIT - LEAST) as i128),
        "The first byte of the telegram in %I; right behind the axis or drive before it if it is left out",
    ),
    Key::new(
        "reference_speed",
        Shape::Number,
        "The speed of 100 % (p2000), in turns per minute, above 0",
    )
    .or("3000"),
    Key::new(
        "ramp_up",
        Shape::Duration,
        "From standstill to the reference speed (p1120)",
    )
    .or("\"10s\""),
    Key::new(
        "ramp_down",
        Shape::Duration,
        "From the reference speed to standstill, also after OFF1 (p1121)",
    )
    .or("\"10s\""),
    Key::new(
        "quick_stop",
        Shape::Duration,
        "From the reference speed to standstill after OFF3 (p1135); a tenth of ramp_down if it is left out",
    ),
    Key::new(
        "coast",
        Shape::Duration,
        "From the reference speed to standstill after OFF2 or a fault; ramp_down if it is left out",
    ),
    Key::new(
        "fault",
        CONDITIONS,
        "A condition that raises a fault, such as \"Motor is hot\"; the PLC acknowledges the fault when the condition is over",
    ),
    Key::new("fault_code", CODE, "The code of that fault").or("7860"),
    Key::new("warning", CONDITIONS, "A condition that raises a warning"),
    Key::new("warning_code", CODE, "The code of that warning").or("7850"),
    Key::new(
        "increments",
        Shape::Whole(1, u32::MAX as i128),
        "Telegrams 3 and 5: the increments of a turn in G1_XIST1",
    )
    .or("4194304"),
    Key::new(
        "velocity",
        Shape::Number,
        "Telegram 111: the greatest velocity in 1000 LU per minute (p2571), above 0",
    )
    .or("30000"),
    Key::new(
        "acceleration",
        Shape::Number,
        "Telegram 111: the greatest acceleration in 1000 LU/s² (p2572), above 0",
    )
    .or("100"),
    Key::new(
        "deceleration",
        Shape::Number,
        "Telegram 111: the greatest deceleration in 1000 LU/s² (p2573), above 0",
    )
    .or("100"),
    Key::new(
        "units_per_turn",
        Shape::Number,
        "Telegram 111: the LU of a turn of the motor (p2506), above 0",
    )
    .or("10000"),
    Key::new(
        "limits",
        TWO_NUMBERS,
        "Telegram 111: the software limit switches in LU (p2580, p2581)",
    ),
];

/// The keys that only telegram 111 has, and the one that only 3 and 5 have.
const OF_POSITIONER: [&str; 5] = [
    "velocity",
    "acceleration",
    "deceleration",
    "units_per_turn",
    "limits",
];
const OF_ENCODER: &str = "increments";

/// One `[[drive]]` table, read.
#[derive(Debug)]
pub struct Read<'a> {
    /// The name.
    pub name: String,
    /// The properties of the drive.
    pub setup: Setup,
    /// The conditions of a fault and of a warning, which are read when all signals are known.
    pub conditions: [Option<Value<'a>>; 2],
    /// The signals, in the order of the telegram.
    pub sections: Vec<Section<'a>>,
}

/// The name of the signal of a word.
pub fn signal_name(drive: &str, word: Word) -> String {
    format!("{drive}.{}", word.name())
}

/// Reads one section, the one with this `number` among the axes and drives, and reports its mistakes; `None` when its
/// signals cannot be placed.
pub fn read<'a>(
    mut table: Table<'a>,
    number: usize,
    places: &mut OffsetAllocator<'a>,
) -> Option<Read<'a>> {
    let name = table.require("name", "give the drive a name of its own");
    let telegram = table.require(
        "telegram",
        "write the number of its telegram, such as telegram = 1",
    );
    let station = table.take("station");
    let offsets = ["command_offset", "feedback_offset"].map(|key| table.take(key));
    let reference = table.take("reference_speed");
    let times = ["ramp_up", "ramp_down", "quick_stop", "coast"].map(|key| table.take(key));
    let conditions = ["fault", "warning"].map(|key| table.take(key));
    let codes = ["fault_code", "warning_code"].map(|key| table.take(key));
    let increments = table.take(OF_ENCODER);
    let of_positioner = OF_POSITIONER.map(|key| table.take(key));
    let whole = table.is_whole();
    table.finish();

    let named = name
        .as_ref()
        .and_then(|value| name_of(value).map(|name| (name, value)))
        .filter(|(name, value)| is_short("drive", name, value));
    let telegram = telegram.and_then(|value| read_telegram(&value));
    let [up, down, quick_stop, coast] = times.map(|value| match value {
        None => Some(None),
        Some(value) => value.duration().map(Some),
    });
    let reference = positive(reference.as_ref(), REFERENCE_SPEED);
    let [fault, warning] = [0, 1].map(|place| {
        let code = codes[place].as_ref();
        let code = code.map_or(Some(CODES[place].into()), |value| {
            value.whole(1..=u16::MAX.into())
        })?;
        u16::try_from(code).ok()
    });
    check_codes(&conditions, &codes);
    if let Some(telegram) = telegram {
        check_use(telegram, increments.as_ref(), &of_positioner);
    }
    let increments = increments.map_or(Some(INCREMENTS.into()), |value| {
        value.whole(1..=u32::MAX.into())
    });
    let [velocity, acceleration, deceleration, units, limits] = &of_positioner;
    let velocity = positive(velocity.as_ref(), VELOCITY);
    let acceleration = positive(acceleration.as_ref(), ACCELERATION);
    let deceleration = positive(deceleration.as_ref(), ACCELERATION);
    let units_per_turn = positive(units.as_ref(), UNITS_PER_TURN);
    let limits = limits.as_ref().map(limits_of);

    let telegram = telegram?;
    let bytes = telegram.bytes();
    let (command, feedback) = places.take(station.as_ref(), &offsets, bytes, [LEAST; 2]);
    let (command, feedback) = (command?, feedback?);
    let (name, value) = named?;
    let ends = [command + bytes[0], feedback + bytes[1]];
    if !whole || !fits("drive", ends[0].max(ends[1]), name, value) {
        return None;
    }
    let seconds = |time: Nanos| time.as_micros() / 1e6;
    let down = down?.unwrap_or(RAMP);
    let setup = Setup {
        telegram,
        reference_speed: reference?,
        ramp_up: seconds(up?.unwrap_or(RAMP)),
        ramp_down: seconds(down),
        quick_stop: quick_stop?.map_or(seconds(down) / 10.0, seconds),
        coast: seconds(coast?.unwrap_or(down)),
        increments: f64::from(u32::try_from(increments?).ok()?),
        codes: [fault?, warning?],
        mechanics: Mechanics {
            velocity: velocity? * 1000.0 / 60.0,
            rates: [acceleration? * 1000.0, deceleration? * 1000.0],
            limits: match limits {
                Some(limits) => Some(limits?),
                None => None,
            },
            units_per_turn: units_per_turn?,
        },
    };
    let structures = Structures {
        kind: "drive",
        name: value,
        offsets: &offsets,
        station: station.as_ref(),
        number,
        ends,
    };
    let mut sections = Vec::new();
    for (words, begin) in telegram.words().into_iter().zip([command, feedback]) {
        let mut byte = begin;
        for word in words {
            sections.push(structures.section(signal(name, *word, byte, &setup)));
            byte += word.data_type().size_bytes();
        }
    }
    Some(Read {
        name: name.to_owned(),
        setup,
        conditions,
        sections,
    })
}

/// Reports codes of conditions that do not exist.
fn check_codes(conditions: &[Option<Value<'_>>; 2], codes: &[Option<Value<'_>>; 2]) {
    let keys = ["fault", "warning"].into_iter();
    for (key, (condition, code)) in keys.zip(conditions.iter().zip(codes)) {
        if let (None, Some(code)) = (condition, code) {
            code.wrong(
                format!("\"{key}_code\" stands without \"{key}\""),
                format!("add {key} = \"Motor is hot\", or remove the code"),
            );
        }
    }
}

/// Reports keys that the telegram does not use.
fn check_use(
    telegram: Telegram,
    increments: Option<&Value<'_>>,
    of_positioner: &[Option<Value<'_>>],
) {
    let has_encoder = matches!(telegram, Telegram::Encoder | Telegram::Servo);
    let has_positioner = telegram == Telegram::Positioner;
    let stray = increments.filter(|_| !has_encoder).into_iter();
    let of_positioner = of_positioner.iter().flatten();
    for value in stray.chain(of_positioner.filter(|_| !has_positioner)) {
        value.wrong(
            format!("telegram {} does not use this key", telegram.number()),
            "remove it, or write another telegram",
        );
    }
}

fn read_telegram(value: &Value<'_>) -> Option<Telegram> {
    let number = value.whole(0..=i128::from(u16::MAX))?;
    let found = Telegram::ALL
        .into_iter()
        .find(|telegram| i128::from(telegram.number()) == number);
    if found.is_none() {
        value.wrong(
            format!("telegram {number} is not one of those that a drive can have"),
            "write 1, 2, 3, 5 or 111",
        );
    }
    found
}

/// A number above 0; `usual` without the key.
fn positive(value: Option<&Value<'_>>, usual: f64) -> Option<f64> {
    let Some(value) = value else {
        return Some(usual);
    };
    let number = value.number("write a number above 0")?;
    if number > 0.0 {
        return Some(number);
    }
    value.wrong(
        format!("{} is no more than nothing", short_number(number)),
        "write a number above 0",
    );
    None
}

/// The signal of one word.
fn signal(drive: &str, word: Word, byte: usize, setup: &Setup) -> Signal {
    let scale = word.scale(setup.reference_speed);
    Signal {
        name: signal_name(drive, word),
        station: 0,
        area: word.area(),
        byte,
        bit: 0,
        data_type: word.data_type(),
        order: ByteOrder::Abcd,
        scale,
        unit: scale.map(|_| "1/min".to_owned()),
        latch: None,
        count_swallowed: None,
        // A drive without its PLC stops, also where other words keep their last values.
        states_fail_safe: matches!(word, Word::Stw1),
        hold: Nanos::ZERO,
        fail_safe: Slot::default(),
        dead_band: 0.0,
        range: None,
        in_plc: None,
        notes: None,
    }
}
