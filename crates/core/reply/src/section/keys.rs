//! The keys of a `[[reply]]` section, and the kinds of replies that have them.

use tickbus_axis::section::drives::{CONDITIONS, VALUES};
use tickbus_base::toml_text::{Key, RequiredKey, Shape, TableKind, kind_names};
use tickbus_image::signal::section::{NAME_LIMIT, TWO_NUMBERS};

use crate::behaviour::RULE;
use crate::section::reader::LIST_LIMIT;

/// The flows of an integrator.
const FLOWS: Shape = Shape::List(
    &Shape::Table(&[
        condition(
            "when",
            "The condition under which it flows; always without it",
        ),
        number("rate", "How fast, in units per second; negative: out"),
        signal("input", "The signal whose number is how fast it flows"),
        number("gain", "The factor of the input; negative: out").or("1"),
    ]),
    1,
    LIST_LIMIT,
);

/// The sensors of a track.
const SENSORS: Shape = Shape::List(
    &Shape::Table(&[
        Key::required(
            "signal",
            Shape::Text,
            "The BOOL that is on while a part is there",
        ),
        Key::required("at", Shape::Number, "Where it is"),
        number("above", "It sees only parts that are at least this high"),
        number("below", "It sees only parts that are at most this high"),
    ]),
    1,
    LIST_LIMIT,
);

/// The exits of a track.
const EXITS: Shape = Shape::List(
    &Shape::Table(&[
        Key::required("at", Shape::Number, "Where a part leaves the track"),
        condition(
            "when",
            "The condition under which it leaves; always without it",
        ),
        number("above", "Only parts that are at least this high leave"),
        number("below", "Only parts that are at most this high leave"),
        signal("signal", "The number of parts that have left here"),
    ]),
    1,
    LIST_LIMIT,
);

/// The places of parts on a track.
const PLACES: Shape = Shape::List(
    &Shape::Table(&[
        Key::required(
            "position",
            Shape::Text,
            "The position of the front of a part; minus its length while there is none",
        ),
        signal("height", "The height of the part; 0 while there is none"),
    ]),
    1,
    LIST_LIMIT,
);

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
pub const REPLY_KINDS: [TableKind; 14] = [
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
        "integrator",
        &[
            SIGNAL,
            key(
                "flows",
                FLOWS,
                "write what flows in and out, such as flows = [{ when = \"Pump on\", rate = 5 }]",
            ),
        ],
        &["reset", "limits", "start"],
    ),
    TableKind::new(
        "track",
        &[
            key(
                "length",
                Shape::Number,
                "write how long the track is, such as length = 2000",
            ),
            key(
                "size",
                Shape::Number,
                "write how long a part is, such as size = 100",
            ),
            key(
                "parts",
                Shape::List(&Shape::Number, 1, 1000),
                "write the heights of the parts that come one after the other, such as parts = [40, 80, 40]",
            ),
            key(
                "places",
                PLACES,
                "name a signal for the position of each part that can be on the track, such as places = [{ position = \"Part 1\" }]",
            ),
        ],
        &[
            "forward", "reverse", "rate", "input", "gain", "enters", "gap", "sensors", "exits",
        ],
    ),
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
        "lag, switch, encoder, track, life-sign: the signal with the number",
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
        "motor: what resets the overload relay, which else resets itself; counter, encoder: what sets the count to start; integrator: what sets the number to start",
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
        "cylinder, valve: the position in (closed) and out (open); lag, integrator: the least and the greatest value; counter, encoder, \
         life-sign: where the count wraps",
    ),
    number(
        "start",
        "cylinder, valve: the first position; lag: the first value; counter, encoder: the first count; integrator: the first \
         number",
    ),
    time(
        "time",
        "lag: the time constant, after which 63 % of a step are there",
    ),
    number(
        "gain",
        "lag: the factor of the input; encoder, track: counts per second, or the speed, for an input of 1",
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
    condition("forward", "encoder, track: what lets it count up, or run"),
    condition("reverse", "encoder, track: what lets it count down, or run back"),
    number("rate", "encoder, track: the counts per second, or the speed; above 0"),
    time("on_for", "blink: how long it is on"),
    time("off_for", "blink: how long it is off; on_for by default"),
    time("every", "life-sign: the time between two counts"),
    Key::new("flows", FLOWS, "integrator: what flows in and out"),
    number("length", "track: how long it is"),
    number("size", "track: how long a part is"),
    number(
        "gap",
        "track: the least distance between the fronts of two parts that enter; twice the size by default",
    ),
    Key::new(
        "parts",
        Shape::List(&Shape::Number, 1, 1000),
        "track: the heights of the parts that enter, one after the other, and again from the beginning",
    ),
    condition(
        "enters",
        "track: parts enter while this holds; always without it",
    ),
    Key::new("sensors", SENSORS, "track: what sees the parts"),
    Key::new("exits", EXITS, "track: where parts leave it before its end"),
    Key::new(
        "places",
        PLACES,
        "track: the signals of each part that can be on it at a time",
    ),
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
