//! The keys of a `[[reply]]` section, and the kinds of replies that have them.

use tickbus_axis::section::drives::{CONDITIONS, VALUES};
use tickbus_base::toml_text::{Key, RequiredKey, Shape, TableKind, kind_names};
use tickbus_image::signal::section::{NAME_LIMIT, TWO_NUMBERS};

use crate::behaviour::RULE;

const fn key(name: &'static str, shape: Shape, right: &'static str) -> RequiredKey {
    RequiredKey { name, shape, right }
}

const SIGNAL: RequiredKey = key(
    "signal",
    Shape::Text,
    "name the signal that the reply makes, such as signal = \"Pump 1 running\"",
);

const NUMBER_INPUT: RequiredKey = key(
    "input",
    Shape::Text,
    "name the signal with the number, such as input = \"Level\"",
);

/// The kinds of replies.
pub const REPLY_KINDS: [TableKind; 12] = [
    TableKind::new(
        "constant",
        &[
            SIGNAL,
            key(
                "value",
                Shape::Any(&[Shape::Number, Shape::Boolean]),
                "write the value, such as value = true",
            ),
        ],
        &[],
    ),
    TableKind::new(
        "follows",
        &[
            SIGNAL,
            key(
                "when",
                CONDITIONS,
                "write what it follows, such as when = \"Pump 1 on\"",
            ),
        ],
        &["on_after", "off_after", "inverted"],
    ),
    TableKind::new(
        "motor",
        &[key(
            "contactor",
            CONDITIONS,
            "write what switches the motor on, such as contactor = \"Pump 1 on\"",
        )],
        &[
            "running",
            "at_speed",
            "speed",
            "overload",
            "healthy",
            "on_after",
            "off_after",
            "start_time",
            "stop_time",
            "full_speed",
            "target",
            "trip",
            "reset",
        ],
    ),
    TableKind::new(
        "cylinder",
        &[
            key(
                "extend",
                CONDITIONS,
                "write what extends the cylinder, such as extend = \"Clamp out\"",
            ),
            key(
                "extend_time",
                Shape::Duration,
                "write how long the whole way takes, such as extend_time = \"600ms\"",
            ),
        ],
        &[
            "retract",
            "extended",
            "retracted",
            "position",
            "retract_time",
            "impulse",
            "limits",
            "start",
        ],
    ),
    TableKind::new(
        "valve",
        &[key(
            "open_time",
            Shape::Duration,
            "write how long the whole way takes, such as open_time = \"3s\"",
        )],
        &[
            "open",
            "close",
            "target",
            "opened",
            "closed",
            "position",
            "close_time",
            "impulse",
            "limits",
            "start",
        ],
    ),
    TableKind::new(
        "lag",
        &[
            SIGNAL,
            key(
                "time",
                Shape::Duration,
                "write the time constant, such as time = \"20s\"",
            ),
        ],
        &[
            "input", "gain", "offset", "when", "on", "off", "limits", "noise", "seed", "start",
        ],
    ),
    TableKind::new(
        "switch",
        &[SIGNAL, NUMBER_INPUT],
        &["above", "below", "hysteresis"],
    ),
    TableKind::new(
        "counter",
        &[
            SIGNAL,
            key(
                "when",
                CONDITIONS,
                "write what is counted, such as when = \"Part passes\"",
            ),
        ],
        &["down", "reset", "limits", "start"],
    ),
    TableKind::new(
        "encoder",
        &[SIGNAL],
        &[
            "input", "gain", "forward", "reverse", "rate", "reset", "limits", "start",
        ],
    ),
    TableKind::new(
        "blink",
        &[
            SIGNAL,
            key(
                "on_for",
                Shape::Duration,
                "write how long it is on, such as on_for = \"500ms\"",
            ),
        ],
        &["off_for", "when"],
    ),
    TableKind::new("life-sign", &[SIGNAL], &["every", "input", "limits"]),
    TableKind::new(
        RULE,
        &[key(
            "when",
            CONDITIONS,
            "write a condition, such as \"LA1 run\"",
        )],
        &["after", "set", "else", "ramp"],
    ),
];

const KIND_NAMES: [&str; REPLY_KINDS.len()] = kind_names(&REPLY_KINDS);

const fn condition(name: &'static str, doc: &'static str) -> Key {
    Key::new(name, CONDITIONS, doc)
}

const fn signal(name: &'static str, doc: &'static str) -> Key {
    Key::new(name, Shape::Text, doc)
}

const fn time(name: &'static str, doc: &'static str) -> Key {
    Key::new(name, Shape::Duration, doc)
}

const fn number(name: &'static str, doc: &'static str) -> Key {
    Key::new(name, Shape::Number, doc)
}

/// The keys of a section: of all kinds of replies.
pub const REPLY_KEYS: &[Key] = &[
    Key::required("kind", Shape::Choice(&KIND_NAMES), "The kind of reply"),
    Key::new(
        "name",
        Shape::Label(NAME_LIMIT),
        "A name for messages; kind and first signal by default",
    ),
    signal("signal", "The signal that the reply makes"),
    Key::new(
        "value",
        Shape::Any(&[Shape::Number, Shape::Boolean]),
        "constant: the value",
    ),
    condition(
        "when",
        "A condition such as \"Pump 1 on\", \"not Stop\" or \"Level > 5\", or several that must hold together. follows: is \
         on while it holds; lag: leads to \"on\" while it holds, else to \"off\"; counter: counts how often it begins to \
         hold; blink: blinks while it holds; rule: takes effect once it holds",
    ),
    signal(
        "input",
        "lag, switch, encoder, life-sign: the signal with the number",
    ),
    condition("contactor", "motor: what switches it on"),
    signal("running", "motor: on while the contactor is on"),
    signal(
        "at_speed",
        "motor: on at full speed, or at the speed of its target",
    ),
    signal("speed", "motor: the speed"),
    signal("overload", "motor: on while the overload relay has tripped"),
    signal("healthy", "motor: off while the overload relay has tripped"),
    time(
        "on_after",
        "follows, motor: how much later it switches on; at once without it",
    ),
    time(
        "off_after",
        "follows, motor: how much later it switches off; at once without it",
    ),
    Key::new(
        "inverted",
        Shape::Boolean,
        "follows: true: off while the condition holds",
    )
    .or("false"),
    time(
        "start_time",
        "motor: from standstill to full speed; at once without it",
    ),
    time(
        "stop_time",
        "motor: from full speed to standstill; start_time by default",
    ),
    number("full_speed", "motor: the speed at the end of its start").or("100"),
    condition("trip", "motor: what trips the overload relay"),
    condition(
        "reset",
        "motor: what resets the overload relay, which else resets itself; counter, encoder: what sets the count to start",
    ),
    condition("extend", "cylinder: the command out"),
    time("extend_time", "cylinder: the time for the whole way out"),
    condition(
        "retract",
        "cylinder: the command in; without it a spring does it",
    ),
    time(
        "retract_time",
        "cylinder: the time for the whole way in; extend_time by default",
    ),
    signal("extended", "cylinder: the switch at the outer end"),
    signal("retracted", "cylinder: the switch at the inner end"),
    condition("open", "valve: the command to open"),
    time("open_time", "valve: the time for the whole way to open"),
    condition(
        "close",
        "valve: the command to close; without it a spring does it",
    ),
    time(
        "close_time",
        "valve: the time for the whole way to close; open_time by default",
    ),
    signal(
        "target",
        "motor: the signal with the speed that a drive is told, up to full_speed; valve: the signal with the position to go \
         to, in the place of commands",
    ),
    signal("opened", "valve: the switch at the open end"),
    signal("closed", "valve: the switch at the closed end"),
    signal("position", "cylinder, valve: the position"),
    Key::new(
        "impulse",
        Shape::Boolean,
        "cylinder, valve: true: a command goes on acting until the other one comes",
    )
    .or("false"),
    Key::new(
        "limits",
        TWO_NUMBERS,
        "cylinder, valve: the position in (closed) and out (open); lag: the least and the greatest value; counter, encoder, \
         life-sign: where the count wraps",
    ),
    number(
        "start",
        "cylinder, valve: the first position; lag: the first value; counter, encoder: the first count",
    ),
    time(
        "time",
        "lag: the time constant, after which 63 % of a step are there",
    ),
    number(
        "gain",
        "lag: the factor of the input; encoder: counts per second for an input of 1",
    )
    .or("1"),
    number("offset", "lag: what is added to the input").or("0"),
    number("on", "lag: where it leads while \"when\" holds"),
    number("off", "lag: where it leads while \"when\" does not hold"),
    number(
        "noise",
        "lag: how far noise goes to either side; not negative",
    )
    .or("0"),
    Key::new(
        "seed",
        Shape::Whole(0, u64::MAX as i128),
        "lag: the seed of the noise: the same seed gives the same run",
    )
    .or("1"),
    number("above", "switch: the number from which on it is on"),
    number("below", "switch: the number down to which it is on"),
    number(
        "hysteresis",
        "switch: how far the number comes back before it is off; not negative",
    )
    .or("0"),
    condition("down", "counter: what counts down"),
    condition("forward", "encoder: what lets it count up"),
    condition("reverse", "encoder: what lets it count down"),
    number("rate", "encoder: the counts per second, above 0"),
    time("on_for", "blink: how long it is on"),
    time("off_for", "blink: how long it is off; on_for by default"),
    time("every", "life-sign: the time between two counts"),
    time(
        "after",
        "rule: how long the conditions hold before it takes effect; at once without it",
    ),
    Key::new(
        "set",
        VALUES,
        "rule: signals and the values that it gives them",
    ),
    Key::new(
        "else",
        VALUES,
        "rule: signals and the values that it gives them when the conditions no longer hold",
    ),
    Key::new(
        "ramp",
        Shape::Table(&[
            Key::required("signal", Shape::Text, "The signal that moves"),
            Key::required("to", Shape::Number, "Where it goes"),
            Key::required(
                "per_second",
                Shape::Number,
                "How fast, in units per second; above 0",
            ),
        ]),
        "rule: a signal that moves while the conditions hold",
    ),
];
