//! The keys of a `[[fault]]` section, and the kinds of faults that have them.

use tickbus_base::toml_text::{Key, RequiredKey, Shape, TableKind, kind_names, names};
use tickbus_image::signal::section::NAME_LIMIT;

use super::super::Direction;
use super::super::answer::WrongAnswer;
use super::super::diagnosis::{AlarmKind, ChannelError, OCTET_LIMIT};
use super::super::fault::{LATE_VALUES, MODEL};

const fn kind(
    name: &'static str,
    required: &'static [RequiredKey],
    optional: &'static [&'static str],
) -> TableKind {
    TableKind::new(name, required, optional)
}

/// The remedy where a signal should be named.
pub(super) const SIGNAL: &str = "name the signal that is wrong, such as signal = \"LA1 bottom\"";

const fn key(name: &'static str, shape: Shape, right: &'static str) -> RequiredKey {
    RequiredKey { name, shape, right }
}

const OF_SIGNAL: RequiredKey = key("signal", Shape::Text, SIGNAL);
const BY_TIME: RequiredKey = key(
    "by",
    Shape::Duration,
    "say by how much, such as by = \"20ms\"",
);

/// The remedy where the code of an error should be.
pub(super) const CODE: &str =
    "write the error of the protocol, such as code = 6 for a busy Modbus device";

/// The code of an error: a number, or the name of an OPC UA status.
const CODES: Shape = Shape::Any(&[Shape::Whole(1, u32::MAX as i128), Shape::Text]);

/// Which answers are wrong.
const OF_ANSWERS: &[&str] = &[
    "chance", "station", "function", "signal", "quantity", "seed",
];

/// The same, and how the bytes of an answer go out.
const OF_LATE_ANSWERS: &[&str] = &[
    "chance", "station", "function", "signal", "quantity", "pause", "seed",
];

/// Earlier names of kinds, each with the name of today: accepted, and logged once.
pub const FORMER_FAULT_KINDS: [(&str, &str); 1] = [("slow-answers", LATE_VALUES)];

/// The kinds of faults.
pub const FAULT_KINDS: [TableKind; 15] = [
    kind("stuck", &[OF_SIGNAL], &["value"]),
    kind("invert", &[OF_SIGNAL], &[]),
    kind(
        "offset",
        &[
            key("by", QUANTITY, "say by how much, such as by = 2.5"),
            OF_SIGNAL,
        ],
        &[],
    ),
    kind("noise", &[OF_SIGNAL], &["amplitude", "chance", "seed"]),
    kind("delay", &[BY_TIME], &[]),
    kind(LATE_VALUES, &[BY_TIME], &[]),
    kind(
        "drop",
        &[key(
            "chance",
            Shape::Number,
            "say how likely it is, such as chance = 0.1",
        )],
        &["direction", "seed"],
    ),
    kind("duplicate", &[], &["chance", "direction", "seed"]),
    kind("answer-late", &[BY_TIME], OF_LATE_ANSWERS),
    kind("answer-error", &[key("code", CODES, CODE)], OF_ANSWERS),
    kind(
        "answer-wrong",
        &[key(
            "how",
            Shape::Choice(&names(&WrongAnswer::NAMES)),
            "say what is wrong, such as how = \"truncated\"",
        )],
        OF_ANSWERS,
    ),
    kind("link-down", &[], &[]),
    kind(
        "station-down",
        &[key("station", Shape::Text, "name the station that is gone")],
        &[],
    ),
    kind(
        "diagnosis",
        &[],
        &[
            "station", "slot", "channel", "error", "octets", "static", "alarm",
        ],
    ),
    TableKind {
        needs_name: true,
        ..kind(MODEL, &[], &["value"])
    },
];

const KIND_NAMES: [&str; FAULT_KINDS.len()] = kind_names(&FAULT_KINDS);

/// The directions of lost and repeated frames.
pub(super) const DIRECTIONS: [(&str, Direction); 3] = [
    ("in", Direction::In),
    ("out", Direction::Out),
    ("both", Direction::Both),
];

/// The maximum number of slots and channels that a diagnosis distinguishes in a station.
pub(super) const DIAGNOSIS_LIMIT: i128 = 64;

/// The greatest slot of an alarm.
pub(super) const ALARM_SLOT_LIMIT: i128 = 254;

/// A number, or a text with a number and its unit.
const QUANTITY: Shape = Shape::Any(&[Shape::Number, Shape::Text]);

/// A count of ticks or of times.
const COUNT: Shape = Shape::Whole(1, i64::MAX as i128);

/// The keys of a section: of all kinds of faults.
pub const FAULT_KEYS: &[Key] = &[
    Key::required("kind", Shape::Choice(&KIND_NAMES), "The kind of fault"),
    Key::new(
        "name",
        Shape::Label(NAME_LIMIT),
        "A name of its own; kind and signal by default; model: the name by which the model knows the fault",
    ),
    Key::new(
        "signal",
        Shape::Text,
        "The name of the signal that is wrong; answer-late, answer-error and answer-wrong: only requests that concern it",
    ),
    Key::new(
        "value",
        Shape::Any(&[Shape::Number, Shape::Boolean, Shape::Text]),
        "stuck: the value; where the signal is when the fault begins, without this key; model: the fault's value, 1 without \
         this key",
    ),
    Key::new(
        "by",
        QUANTITY,
        "offset: what is added; delay, values-late and answer-late: a duration, at most 60s",
    ),
    Key::new(
        "amplitude",
        QUANTITY,
        "noise: how far the value goes to either side",
    ),
    Key::new(
        "chance",
        Shape::Number,
        "How likely it is, above 0 and up to 1",
    ),
    Key::new(
        "direction",
        Shape::Choice(&names(&DIRECTIONS)),
        "The frames that it meets, as seen from this end",
    )
    .or("\"both\""),
    Key::new("station", Shape::Text, "The name of the station"),
    Key::new(
        "function",
        Shape::Whole(1, 255),
        "The function code of the requests whose answers are wrong; all without this key",
    ),
    Key::new(
        "quantity",
        Shape::Whole(1, u16::MAX as i128),
        "The number of elements in the requests whose answers are wrong; any without this key",
    ),
    Key::new(
        "pause",
        Shape::Duration,
        "answer-late: the time between two bytes of the answer, at most 60s; none without this key",
    ),
    Key::new(
        "code",
        CODES,
        "answer-error: the exception of Modbus; the return code of an item of S7; the status of OPC UA, or its name",
    ),
    Key::new(
        "how",
        Shape::Choice(&names(&WrongAnswer::NAMES)),
        "answer-wrong: what is wrong",
    ),
    Key::new(
        "slot",
        Shape::Whole(0, ALARM_SLOT_LIMIT),
        "diagnosis: the slot of the module, 1 to 64; of an alarm 0 to 254",
    ),
    Key::new(
        "channel",
        Shape::Whole(0, DIAGNOSIS_LIMIT - 1),
        "diagnosis: the channel of the module",
    ),
    Key::new(
        "error",
        Shape::Choice(&names(&ChannelError::ALL)),
        "diagnosis: the error of the channel",
    ),
    Key::new(
        "octets",
        Shape::List(&Shape::Whole(0, 255), 1, OCTET_LIMIT),
        "diagnosis: octets of the device's own",
    ),
    Key::new(
        "alarm",
        Shape::Choice(&names(&AlarmKind::ALL)),
        "diagnosis: an alarm of this type (DP-V1), which the master acknowledges",
    ),
    Key::new(
        "static",
        Shape::Boolean,
        "diagnosis: true: the device cannot exchange data, and its master continues to read the diagnosis",
    )
    .or("false"),
    Key::new(
        "seed",
        Shape::Whole(0, u64::MAX as i128),
        "The seed of the random numbers: the same seed gives the same run",
    )
    .or("1"),
    Key::new(
        "at",
        Shape::Duration,
        "The fault begins this long after the first tick",
    ),
    Key::new("tick", COUNT, "The fault begins at this tick"),
    Key::new(
        "when",
        Shape::Text,
        "The fault begins when this condition becomes true, such as \"LA1 run == 1\"",
    ),
    Key::new(
        "while",
        Shape::Text,
        "The fault is there whenever this condition is true",
    ),
    Key::new("for", Shape::Duration, "The fault ends after this time"),
    Key::new("ticks", COUNT, "The fault ends after this many ticks"),
    Key::new(
        "times",
        COUNT,
        "With \"when\": the fault begins at most this often",
    ),
];
