//! The variables of the FMU that are not signals: parameters, and the state of the bus.

use std::ops::DerefMut as _;

use tickbus_base::time::Nanos;
use tickbus_driver::Exchange;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::LinkState;
use tickbus_image::signal::SignalTable;

use super::variables::{Enumeration, Place, Start, Use, Variable, seconds};
use crate::value::{Value, ValueType, Version};

/// The type of `bus.status`.
static STATUS: Enumeration = Enumeration {
    name: "bus.Status",
    items: &["fresh", "unchanged", "stale"],
};

/// The type of `bus.state`.
static STATE: Enumeration = Enumeration {
    name: "bus.State",
    items: &STATES,
};

/// The names of the states of a line.
const STATES: [&str; LinkState::ALL.len()] = {
    let mut names = [""; LinkState::ALL.len()];
    let mut at = 0;
    while at < names.len() {
        names[at] = LinkState::ALL[at].name();
        at += 1;
    }
    names
};

/// Returns the type of a counter; FMI 2.0 has no unsigned one.
const fn counter(version: Version) -> ValueType {
    match version {
        Version::Two => ValueType::Float64,
        Version::Three => ValueType::UInt64,
    }
}

/// Returns the name of a variable that is not a signal: `name`, unless a signal has that name.
fn free_name(name: &str, table: &SignalTable) -> String {
    // Names with this prefix are reserved.
    match table.position(name) {
        None => name.to_owned(),
        Some(_) => format!("bus.{name}"),
    }
}

/// Returns a variable that is not a signal, with a name that no signal has.
fn own(
    table: &SignalTable,
    (name, place, value_type): (&str, Place, ValueType),
    usage: Use,
    start: Start,
    description: &str,
) -> Variable {
    Variable {
        name: if name.starts_with("bus.") {
            name.to_owned()
        } else {
            free_name(name, table)
        },
        reference: place.reference(),
        value_type,
        enumeration: None,
        sizes: Vec::new(),
        usage,
        unit: matches!(place, Place::Time | Place::Age | Place::Lag).then(|| "s".to_owned()),
        start,
        description: description.to_owned(),
    }
}

/// Returns the variables that are not signals.
pub(super) fn own_variables(config: &Config, version: Version) -> Vec<Variable> {
    use ValueType::{Boolean, Float64, Int32, Int64, String as Text};

    let own =
        |what, usage, start, description: &str| own(&config.table, what, usage, start, description);
    let number = |value| Start::Numbers(vec![value]);
    let record = config.record.as_ref();
    let record = record.map(|record| record.file.to_string_lossy().into_owned());
    let is_three = version == Version::Three;
    let mut all = Vec::new();
    // FMI 2.0 does not need this variable, and a library used by some of its tools rejects it.
    if is_three {
        let what = ("time", Place::Time, Float64);
        all.push(own(what, Use::Independent, Start::None, "Simulation time"));
    }
    all.push(own(
        ("pace", Place::Pace, Float64),
        Use::Parameter,
        number(Value::Real(default_pace(config))),
        "Seconds of simulation in one of the clock on the wall: 1 for real time, 0 for as fast as possible",
    ));
    if has_address(config) {
        all.push(own(
            ("address", Place::Address, Text),
            Use::Parameter,
            Start::Text(String::new()),
            "Address of the line, in place of the one in driver.cfg; empty for that one",
        ));
    }
    all.extend([
        own(
            ("record", Place::Record, Text),
            Use::Parameter,
            Start::Text(record.unwrap_or_default()),
            "File that every step is recorded to, ending in .vcd or .csv, from the current folder on; empty for none",
        ),
        Variable {
            enumeration: is_three.then_some(&STATUS),
            ..own(
                ("bus.status", Place::Status, if is_three { Int64 } else { Int32 }),
                Use::Output,
                number(Value::Signed(2)),
                "0 fresh, 1 unchanged, 2 stale",
            )
        },
        own(
            ("bus.age", Place::Age, Float64),
            Use::Output,
            number(Value::Real(seconds(Exchange::NONE.age))),
            "Age of the oldest station's data",
        ),
        own(
            ("bus.sequence", Place::Sequence, counter(version)),
            Use::Output,
            number(Value::Unsigned(0)),
            "Bus cycles so far",
        ),
        own(
            ("bus.lag", Place::Lag, Float64),
            Use::Output,
            number(Value::Real(0.0)),
            "How late the last step ended by the clock on the wall; 0 without a pace",
        ),
    ]);
    if is_three {
        all.extend([
            Variable {
                enumeration: Some(&STATE),
                ..own(
                    ("bus.state", Place::State, Int64),
                    Use::Output,
                    number(Value::Signed(0)),
                    "State of the line",
                )
            },
            own(
                ("bus.reason", Place::Reason, Text),
                Use::Output,
                Start::Text(String::new()),
                "Why the line is in its state",
            ),
            own(
                ("bus.cycle", Place::Cycle, Boolean),
                Use::Clock,
                Start::None,
                "Ticks when a new whole bus cycle has arrived",
            ),
        ]);
    }
    all
}

/// Returns true if the bus has an address that can be replaced.
fn has_address(config: &Config) -> bool {
    // The empty text need not be a valid address.
    config.bus.clone().deref_mut().set_address("").is_some()
}

/// Returns true if the bus runs in the steps of the simulation.
pub fn is_stepped(config: &Config) -> bool {
    config.bus.is_stepped()
}

/// Returns the time between two bus cycles, which is the proposed step: 10 ms if neither driver.cfg nor the bus knows it.
pub(super) fn cycle(config: &Config) -> Nanos {
    let cycle = config.timing.cycle.or(config.bus.cycle());
    cycle.unwrap_or(Nanos::from_millis(10))
}

/// Returns the default pace. A free-running bus is a PLC in real time: a simulation that runs faster would see only a
/// few of its cycles.
pub(super) fn default_pace(config: &Config) -> f64 {
    if is_stepped(config) { 0.0 } else { 1.0 }
}
