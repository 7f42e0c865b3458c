//! The `[[signal]]` sections of a driver.cfg: the same on every bus.

use super::plan::rounded as rounded_by_codec;
use super::{Address, Addressing, Area, ByteOrder, DataType, Latch, Scale, Signal, Slot, Width};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, did_you_mean, names, short_number, shown};

/// The longest name of a signal or station, in characters.
pub const NAME_LIMIT: usize = 120;

/// The longest unit, in characters.
const UNIT_LIMIT: usize = 40;

/// The remedy where a station should be named.
pub const STATION: &str = "write the name of a [[station]] in quotes";

/// The shape of an address, such as `%QX1.0`.
pub const ADDRESS: Shape = Shape::Pattern("\\s*%[IQiq][XBWDLxbwdl]?[0-9]+(\\.[0-7])?\\s*");

/// The shape of two numbers.
pub const TWO_NUMBERS: Shape = Shape::List(&Shape::Number, 2, 2);

/// The key `scale`.
pub const SCALE_KEY: Key = Key::new(
    "scale",
    Shape::Table(&[
        Key::required("raw", TWO_NUMBERS, "Two values on the wire"),
        Key::required(
            "value",
            TWO_NUMBERS,
            "The values that they mean, in the unit",
        ),
    ]),
    "A linear scale: { raw = [0, 27648], value = [0.0, 250.0] }",
);

/// The key `dead_band`.
pub const DEAD_BAND_KEY: Key = Key::new(
    "dead_band",
    Shape::Number,
    "How far the value may move without being sent, on buses that send on change; not negative",
);

/// The key `count_swallowed`.
const COUNT_SWALLOWED: Key = Key::new(
    "count_swallowed",
    Shape::Boolean,
    "Whether changes are counted that came and went unseen: so on a BOOL without \"latch\" by default",
);

/// The key `station`.
pub const STATION_KEY: Key = Key::new(
    "station",
    Shape::Label(NAME_LIMIT),
    "The name of its [[station]], if there are several",
);

/// The keys of a `[[signal]]` section.
pub const KEYS: &[Key] = &[
    Key::required(
        "name",
        Shape::Label(NAME_LIMIT),
        "A unique name; names that begin with \"bus.\" are reserved",
    ),
    Key::required(
        "address",
        ADDRESS,
        "%QX1.0 (a bit), %QB1, %QW2, %QD4, %QL8, and %I likewise; directions are the PLC's",
    ),
    Key::new(
        "type",
        Shape::AnyCase(&TYPES),
        "The type in IEC 61131-3, of the address's size; BOOL, BYTE, WORD, DWORD or LWORD if it is left out",
    ),
    Key::new(
        "order",
        Shape::Choice(&ORDERS),
        "Byte order: ABCD big-endian, DCBA little-endian, CDAB words swapped, BADC bytes swapped in each word",
    )
    .or("\"ABCD\""),
    SCALE_KEY,
    Key::new("unit", Shape::Label(UNIT_LIMIT), "A unit for people"),
    Key::new(
        "latch",
        Shape::Choice(&names(&LATCHES)),
        "On a BOOL: these edges must not get lost",
    ),
    Key::new(
        "hold",
        Shape::Duration,
        "On a latched %I: how long a pulse is held beyond the exchange that carries it",
    ),
    COUNT_SWALLOWED,
    Key::new(
        "fail_safe",
        Shape::Any(&[Shape::Number, Shape::Boolean]),
        "The value when data are stale, or the simulation has stopped; all bits zero by default",
    ),
    DEAD_BAND_KEY,
    STATION_KEY,
    super::notes::COMMENT,
    super::notes::FOLDER,
];

const TYPES: [&str; DataType::ALL.len()] = {
    let mut names = [""; DataType::ALL.len()];
    let mut index = 0;
    while index < names.len() {
        names[index] = DataType::ALL[index].name();
        index += 1;
    }
    names
};

const ORDERS: [&str; 4] = [
    ByteOrder::Abcd.name(),
    ByteOrder::Cdab.name(),
    ByteOrder::Badc.name(),
    ByteOrder::Dcba.name(),
];

/// The edges that can be latched.
const LATCHES: [(&str, Latch); 3] = [
    ("rising", Latch::Rising),
    ("falling", Latch::Falling),
    ("both", Latch::Both),
];

/// One `[[signal]]` section, read on its own.
#[derive(Debug)]
pub struct Section<'a> {
    /// The signal. Its name is empty when the section has no valid one, and its station is not yet looked up.
    pub signal: Signal,
    /// The value of `name`, if valid.
    pub name: Option<Value<'a>>,
    /// The value of `address`.
    pub address: Value<'a>,
    /// The value of `station`.
    pub station: Option<Value<'a>>,
    /// The structure that contains the signal, if any.
    pub structure: Option<Structure>,
}

/// A structure in the image that one table of the driver.cfg describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Structure {
    /// The kind of thing that the table describes: `axis` or `drive`.
    pub kind: &'static str,
    /// Index of the table among all of these, from 0.
    pub table: usize,
    /// Offset just beyond the structure, reserved bytes included.
    pub end: usize,
}

impl Section<'_> {
    /// Offset just beyond the signal, or beyond the structure that contains it.
    pub fn end(&self) -> usize {
        let signal = &self.signal;
        let own = signal.byte + signal.data_type.size_bytes();
        self.structure.map_or(own, |structure| structure.end)
    }

    /// True if the name is in the file, and is not derived from the name of its table.
    pub fn has_own_name(&self) -> bool {
        let name = self.name.as_ref().and_then(Value::as_text);
        name == Some(&self.signal.name)
    }

    /// The name of the whole table in messages.
    pub fn title(&self) -> String {
        let name = self.name.as_ref().and_then(Value::as_text);
        match (name, self.structure) {
            (Some(name), Some(Structure { kind, .. })) if !self.has_own_name() => {
                format!("the {kind} \"{}\"", shown(name))
            }
            _ => self.label(),
        }
    }

    /// The name of the signal in messages.
    pub fn label(&self) -> String {
        let Signal { name, .. } = &self.signal;
        if name.is_empty() {
            self.signal.address().to_string()
        } else {
            format!("\"{}\" ({})", shown(name), self.signal.address())
        }
    }
}

/// Reads one section and reports its mistakes; `None` when it cannot be placed in the image.
pub fn read(mut table: Table<'_>, addressing: Addressing) -> Option<Section<'_>> {
    let name = table.require("name", "give the signal a name of its own");
    let address = table.require("address", "write one such as \"%QX1.0\" or \"%IW4\"");
    let type_ = table.take("type");
    let order = table.take("order");
    let scale = table.take("scale");
    let unit = table.take("unit");
    let latch = table.take("latch");
    let hold = table.take("hold");
    let count = table.take("count_swallowed");
    let fail_safe = table.take("fail_safe");
    let dead_band = table.take("dead_band");
    let station = table.take("station");
    let notes = super::notes::take(&mut table);
    let whole = table.is_whole();
    table.finish();

    let name = name.and_then(|value| Some((name_of(&value)?, value)));
    let place = address
        .as_ref()
        .and_then(|value| address_of(value, addressing));
    let stated = type_.as_ref().map(type_of);
    let unit =
        unit.and_then(|unit| unit.label(UNIT_LIMIT, "leave it out if the signal has no unit"));
    let latched = latch.as_ref().map(latch_of);
    let held = hold.as_ref().map(Value::duration);
    let ordered = order.as_ref().map(order_of);
    let band = dead_band.as_ref().map(dead_band_of);
    if place.is_none() || matches!(stated, Some(None)) {
        check_shapes(scale.as_ref(), fail_safe.as_ref(), station.as_ref());
    }
    let (address, place) = (address?, place?);
    // Without the address or the type the rules below would blame the wrong key, and with a broken line it is
    // unknown whether they are violated at all.
    let data_type = match stated {
        None => place.width.data_type(),
        Some(stated) => stated?,
    };
    if !whole {
        return None;
    }
    if let Some(value) = &type_ {
        check_width(value, data_type, place)?;
    }
    let signal = Signal {
        name: name
            .as_ref()
            .map(|(name, _)| (*name).to_owned())
            .unwrap_or_default(),
        station: 0,
        area: place.area,
        byte: place.byte,
        bit: place.bit,
        data_type,
        order: order
            .and_then(|value| fitting_order(&value, ordered.flatten()?, data_type))
            .unwrap_or_default(),
        scale: None,
        unit: unit.map(str::to_owned),
        latch: latch.and_then(|value| fitting_latch(&value, latched.flatten()?, data_type)),
        count_swallowed: count.and_then(|value| value.boolean()),
        hold: Nanos::ZERO,
        fail_safe: Slot::default(),
        states_fail_safe: fail_safe.is_some(),
        dead_band: dead_band
            .and_then(|value| fitting_dead_band(&value, band.flatten()?, data_type))
            .unwrap_or_default(),
        range: None,
        in_plc: None,
        notes,
    };
    let hold =
        hold.and_then(|value| fitting_hold(&value, held.flatten()?, &signal, latched.is_some()));
    let signal = Signal {
        hold: hold.unwrap_or_default(),
        ..signal
    };
    let scaled = scale.as_ref().map(|value| drawn(value, data_type));
    let (scale, range) = scaled.flatten().unzip();
    let signal = Signal {
        scale,
        range,
        ..signal
    };
    let fail_safe = match (fail_safe, scaled) {
        // With an invalid scale, a fail-safe value cannot be checked.
        (_, Some(None)) => None,
        (Some(value), _) => slot_of(&value, &signal, "fail_safe"),
        (None, _) => Some(at_rest(&signal)),
    };
    let signal = Signal {
        fail_safe: fail_safe.unwrap_or_default(),
        ..signal
    };
    Some(Section {
        signal,
        name: name.map(|(_, value)| value),
        address,
        station,
        structure: None,
    })
}

/// Checks the values of a signal with an unknown type, as far as possible.
fn check_shapes(
    scale: Option<&Value<'_>>,
    fail_safe: Option<&Value<'_>>,
    station: Option<&Value<'_>>,
) {
    if let Some(scale) = scale {
        scale_of(scale, DataType::Lreal);
    }
    if let Some(fail_safe) = fail_safe.filter(|value| !value.is_boolean()) {
        fail_safe.number("write a number, or true or false for a BOOL");
    }
    if let Some(station) = station {
        station.text(STATION);
    }
}

/// A name: printable characters, not reserved for tickbus.
pub fn name_of<'a>(value: &Value<'a>) -> Option<&'a str> {
    let name = value.label(NAME_LIMIT, "give the signal a name of its own")?;
    if name.starts_with("bus.") {
        value.wrong(
            format!("the name \"{}\" begins with \"bus.\"", shown(name)),
            "choose another; that beginning is kept for bus.age, bus.sequence, bus.status",
        );
        return None;
    }
    Some(name)
}

/// An address, such as `%QX1.0`.
pub fn address_of(value: &Value<'_>, addressing: Addressing) -> Option<Address> {
    let text = value.text("write an address in quotes, such as \"%QX1.0\"")?;
    Address::parse(text, addressing)
        .map_err(|mistake| value.refuse(mistake))
        .ok()
}

fn type_of(value: &Value<'_>) -> Option<DataType> {
    let text = value.text("write a type in quotes, such as \"INT\"")?;
    text.parse()
        .map_err(|_| {
            let right = match other_name(text) {
                Some(known) => format!("did you mean \"{known}\"?"),
                None => did_you_mean(text, "types", &DataType::ALL.map(DataType::name)),
            };
            value.wrong(
                format!("\"{}\" is no type of IEC 61131-3", shown(text)),
                right,
            );
        })
        .ok()
}

/// The type that has this name in programming languages.
fn other_name(text: &str) -> Option<DataType> {
    Some(match text.to_ascii_uppercase().as_str() {
        "BIT" | "BOOLEAN" => DataType::Bool,
        "INT8" | "I8" => DataType::Sint,
        "UINT8" | "U8" | "CHAR" => DataType::Usint,
        "INT16" | "I16" | "SHORT" => DataType::Int,
        "UINT16" | "U16" | "USHORT" => DataType::Uint,
        "INT32" | "I32" | "INTEGER" => DataType::Dint,
        "UINT32" | "U32" => DataType::Udint,
        "INT64" | "I64" | "LONG" => DataType::Lint,
        "UINT64" | "U64" => DataType::Ulint,
        "FLOAT" | "FLOAT32" | "F32" | "SINGLE" => DataType::Real,
        "DOUBLE" | "FLOAT64" | "F64" => DataType::Lreal,
        _ => return None,
    })
}

fn check_width(value: &Value<'_>, data_type: DataType, place: Address) -> Option<()> {
    if data_type.width() == place.width {
        return Some(());
    }
    let fitting: Vec<&str> = DataType::ALL
        .into_iter()
        .filter(|candidate| candidate.width() == place.width)
        .map(DataType::name)
        .collect();
    let moved = match data_type.width() {
        Width::Bit => format!("{}X{}.0", place.area, place.byte),
        width => format!("{}{}{}", place.area, width.letter(), place.byte),
    };
    let bits = |width: Width| match width.bits() {
        1 => "1 bit".to_owned(),
        bits => format!("{bits} bits"),
    };
    value.wrong(
        format!(
            "{data_type} has {}, but the address {place} has {}",
            bits(data_type.width()),
            bits(place.width)
        ),
        format!(
            "{data_type} fits {moved}; {place} takes {}",
            fitting.join(", ")
        ),
    );
    None
}

fn order_of(value: &Value<'_>) -> Option<ByteOrder> {
    value.choice(
        "byte orders",
        &ByteOrder::ALL.map(|order| (order.name(), order)),
    )
}

fn fitting_order(value: &Value<'_>, order: ByteOrder, data_type: DataType) -> Option<ByteOrder> {
    if data_type.size_bytes() == 1 {
        value.wrong(
            format!("a {data_type} has no byte order"),
            "remove \"order\"; it is for values of two bytes and more",
        );
        return None;
    }
    Some(order)
}

fn latch_of(value: &Value<'_>) -> Option<Latch> {
    value.choice("latches", &LATCHES)
}

fn fitting_latch(value: &Value<'_>, latch: Latch, data_type: DataType) -> Option<Latch> {
    if data_type != DataType::Bool {
        value.wrong(
            format!("a {data_type} cannot be latched"),
            "remove \"latch\"; only a BOOL has edges",
        );
        return None;
    }
    Some(latch)
}

fn fitting_hold(value: &Value<'_>, hold: Nanos, signal: &Signal, latched: bool) -> Option<Nanos> {
    if signal.area == Area::Output {
        value.wrong(
            format!("\"hold\" stands at a {} signal", signal.area),
            "remove it; it lengthens the pulses that the simulation sends, on %I",
        );
    } else if !latched {
        value.wrong(
            "\"hold\" stands without \"latch\"",
            "add latch = \"rising\", or remove \"hold\"",
        );
    } else {
        return Some(hold);
    }
    None
}

/// A dead band: a number that is not negative.
pub fn dead_band_of(value: &Value<'_>) -> Option<f64> {
    const RIGHT: &str = "write how far the value may move without being sent, such as 0.5";
    let number = value.number(RIGHT)?;
    if number < 0.0 {
        value.wrong(
            format!("\"dead_band\" is {}, less than nothing", value.written()),
            RIGHT,
        );
        return None;
    }
    Some(number)
}

fn fitting_dead_band(value: &Value<'_>, band: f64, data_type: DataType) -> Option<f64> {
    if data_type == DataType::Bool {
        value.wrong(
            "a BOOL has no dead band",
            "remove \"dead_band\"; every change of a BOOL counts",
        );
        return None;
    }
    Some(band)
}

/// The remedy where two numbers are expected.
const PAIR: &str = "write two numbers, such as [0, 27648]";

/// A linear scale for raw values of `data_type`.
pub fn scale_of(value: &Value<'_>, data_type: DataType) -> Option<Scale> {
    drawn(value, data_type).map(|(scale, _)| scale)
}

/// A linear scale for raw values of `data_type`, and the two values of its points, the lower one first.
fn drawn(value: &Value<'_>, data_type: DataType) -> Option<(Scale, [f64; 2])> {
    const SHAPE: &str = "write scale = { raw = [0, 27648], value = [0.0, 250.0] }";
    if data_type == DataType::Bool {
        value.wrong("a BOOL cannot be scaled", "remove \"scale\"");
        return None;
    }
    let mut table = value.table("scale", SHAPE)?;
    let raw = table.require("raw", SHAPE);
    let engineering = table.require("value", SHAPE);
    table.finish();
    let (raw, engineering) = (raw?, engineering?);
    let (raw_pair, pair) = (pair_of(&raw, PAIR), pair_of(&engineering, PAIR));
    let raw_pair = raw_pair?;
    for (number, element) in &raw_pair {
        if !fits_raw(*number, data_type) {
            element.wrong(
                format!(
                    "raw {} is beyond the range of {data_type}",
                    element.written()
                ),
                raw_range(data_type),
            );
            return None;
        }
    }
    let pair = pair?;
    let (raw_numbers, numbers) = (
        raw_pair.map(|(number, _)| number),
        pair.map(|(number, _)| number),
    );
    #[expect(
        clippy::float_cmp,
        reason = "equal to the last bit is what divides by zero"
    )]
    let equal = |numbers: [f64; 2]| numbers[0] == numbers[1];
    if equal(raw_numbers) {
        raw.wrong(
            format!("both raw values are {}", short_number(raw_numbers[0])),
            "write two different ones, such as raw = [0, 27648]",
        );
    } else if equal(numbers) {
        engineering.wrong(
            format!("both scaled values are {}", short_number(numbers[0])),
            "write two different ones, such as value = [0.0, 250.0]",
        );
    } else if let Some(scale) = Scale::through(raw_numbers, numbers) {
        let [one, other] = numbers;
        return Some((scale, [one.min(other), one.max(other)]));
    } else {
        value.wrong(
            "the slope of this scale is beyond what a number can hold",
            "write points that lie less far apart",
        );
    }
    None
}

/// A list of two numbers, each with its value in the file; `right` shows an example.
pub fn pair_of<'a>(value: &Value<'a>, right: &str) -> Option<[(f64, Value<'a>); 2]> {
    let list = value.list(right)?;
    let length = list.len();
    let Ok([first, second]) = <[Value<'a>; 2]>::try_from(list) else {
        value.wrong(format!("this list has {length} elements"), right);
        return None;
    };
    let numbers = (first.number(right), second.number(right));
    Some([(numbers.0?, first), (numbers.1?, second)])
}

/// True if a raw number is within the range of the type; it may have a fraction.
fn fits_raw(number: f64, data_type: DataType) -> bool {
    let (least, greatest) = raw_limits(data_type);
    (least..=greatest).contains(&number)
}

/// The range of the type in doubles.
fn raw_limits(data_type: DataType) -> (f64, f64) {
    match (data_type.range(), data_type) {
        #[expect(
            clippy::cast_precision_loss,
            reason = "the ends of 64-bit ranges, rounded outwards"
        )]
        (Some(range), _) => (*range.start() as f64, *range.end() as f64),
        (None, DataType::Real) => (f64::from(f32::MIN), f64::from(f32::MAX)),
        (None, _) => (f64::MIN, f64::MAX),
    }
}

fn raw_range(data_type: DataType) -> String {
    match data_type.range() {
        Some(range) => format!("{data_type} goes from {} to {}", range.start(), range.end()),
        None => format!(
            "{data_type} goes up to {}",
            short_number(raw_limits(data_type).1)
        ),
    }
}

/// The value of a signal whose bits are all zero, as a bus delivers for a missing device.
fn at_rest(signal: &Signal) -> Slot {
    signal
        .scale
        .map_or_else(Slot::default, |scale| Slot::from_real(scale.offset))
}

/// A value of `signal`, in its unit, as its slot; messages call the key `key`.
pub fn slot_of(value: &Value<'_>, signal: &Signal, key: &str) -> Option<Slot> {
    if signal.data_type == DataType::Bool {
        return bit_of(value, key);
    }
    if value.is_boolean() {
        value.wrong(
            format!("a boolean is no value of {}", signal.data_type),
            "write a number, or make the signal a BOOL",
        );
        return None;
    }
    if signal.scale.is_none() && signal.data_type.is_integer() {
        return integer_of(value, signal, key);
    }
    let (least, greatest) = raw_limits(signal.data_type);
    let number = value.number("write a number")?;
    let raw = signal.scale.map_or(number, |scale| scale.raw(number));
    // Rounded as the codec rounds it.
    let rounded = if signal.data_type.is_integer() {
        rounded_by_codec(raw)
    } else {
        raw
    };
    if (least..=greatest).contains(&rounded) {
        return Some(Slot::from_real(number));
    }
    value.wrong(
        format!("{key} {} does not fit", value.written()),
        value_range(signal),
    );
    None
}

/// The least and the greatest value of `signal`, in its unit.
pub fn value_limits(signal: &Signal) -> (f64, f64) {
    let (least, greatest) = raw_limits(signal.data_type);
    let Some(scale) = signal.scale else {
        return (least, greatest);
    };
    let ends = [scale.value(least), scale.value(greatest)];
    (ends[0].min(ends[1]), ends[0].max(ends[1]))
}

/// The values that `signal` accepts, in words.
pub fn value_range(signal: &Signal) -> String {
    if signal.scale.is_none() {
        return raw_range(signal.data_type);
    }
    let (low, high) = value_limits(signal);
    format!(
        "{} with this scale goes from {} to {}",
        signal.data_type,
        short_number(low),
        short_number(high)
    )
}

fn bit_of(value: &Value<'_>, key: &str) -> Option<Slot> {
    const RIGHT: &str = "a BOOL takes true or false";
    if value.is_boolean() {
        return value
            .boolean()
            .map(|on| Slot::from_real(f64::from(u8::from(on))));
    }
    let number = value.number(RIGHT)?;
    let fitting = [0.0, 1.0]
        .into_iter()
        .find(|bit: &f64| bit.total_cmp(&number).is_eq());
    if fitting.is_none() {
        value.wrong(format!("{key} {} does not fit", value.written()), RIGHT);
    }
    fitting.map(Slot::from_real)
}

/// An unscaled integer, exact to the last bit.
fn integer_of(value: &Value<'_>, signal: &Signal, key: &str) -> Option<Slot> {
    let range = signal.data_type.range()?;
    let number = if value.is_integer() {
        value.whole(range)?
    } else {
        let number = value.number("write a whole number")?;
        if number.fract() != 0.0 {
            value.wrong(
                format!("{key} {} has a fraction", value.written()),
                format!("write a whole number; {}", raw_range(signal.data_type)),
            );
            return None;
        }
        // The conversion saturates at the range of an i128, which is beyond every type's range.
        #[expect(clippy::cast_possible_truncation, reason = "whole, and saturating")]
        let whole = number as i128;
        if !range.contains(&whole) {
            value.wrong(
                format!("{key} {} does not fit", value.written()),
                raw_range(signal.data_type),
            );
            return None;
        }
        whole
    };
    #[expect(
        clippy::cast_precision_loss,
        reason = "at most 32 bits where the slot is a double"
    )]
    Some(if !signal.is_integer_slot() {
        Slot::from_real(number as f64)
    } else if signal.data_type.is_signed() {
        i64::try_from(number).map(Slot::from_signed).ok()?
    } else {
        u64::try_from(number).map(Slot::from_unsigned).ok()?
    })
}
