//! Cycle times and time-outs of `[fieldbus]`.

use crate::Options;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, names};
use tickbus_fieldbus::{Outputs, Role};

/// The default pauses between attempts to reach the peer.
pub(super) const RECONNECT: [Nanos; 6] = [
    Nanos::from_secs(1),
    Nanos::from_secs(2),
    Nanos::from_secs(4),
    Nanos::from_secs(8),
    Nanos::from_secs(15),
    Nanos::from_secs(30),
];

/// The smallest default of `max_age`.
pub(super) const LEAST_MAX_AGE: Nanos = Nanos::from_millis(250);

/// The shortest bus cycle that an operating system can keep.
const LEAST_CYCLE: Nanos = Nanos::from_micros(50);

/// The shortest `watchdog`: pauses on a busy computer must not look like a stopped simulation.
const LEAST_WATCHDOG: Nanos = Nanos::from_millis(10);

/// The longest of these times: the age of data that never arrived must be greater.
const LONGEST: Nanos = Nanos::from_secs(24 * 3600);

/// The value of `watchdog` that disables it.
const OFF: &str = "off";

/// The shortest pause in `reconnect`: each attempt writes a line to the log.
const LEAST_PAUSE: Nanos = Nanos::from_millis(10);

/// The most pauses in `reconnect`.
const RECONNECT_LIMIT: usize = 100;

/// The keys of these times in `[fieldbus]`.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "cycle",
        Shape::Duration,
        "The bus cycle, at least 50us; each bus has its own default",
    ),
    Key::new(
        "max_age",
        Shape::Duration,
        "Data older than this are stale; ten cycles by default, at least 250ms",
    ),
    Key::new(
        "watchdog",
        Shape::Any(&[Shape::Duration, Shape::Choice(&[OFF])]),
        "If the simulation has not ticked for this long, the other end gets fail-safe values; at least 10ms, or \"off\"",
    ),
    Key::new(
        "at_close",
        Shape::Choice(&names(&Outputs::CHOICES)),
        "The values that the other end has after this end has closed",
    ),
    Key::new(
        "while_stale",
        Shape::Choice(&names(&Outputs::CHOICES)),
        "The values that a controller sends while its own data are stale; \"fail_safe\" by default",
    ),
    Key::new(
        "reconnect",
        Shape::List(&Shape::Duration, 1, RECONNECT_LIMIT),
        "Pauses between attempts to open a line that broke, at least 10ms each; the last one repeats",
    )
    .or("[\"1s\", \"2s\", \"4s\", \"8s\", \"15s\", \"30s\"]"),
];

/// The properties of a driver's bus that its times depend on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// The end of the bus.
    pub(super) role: Role,
    /// The bus's own cycle.
    pub(super) cycle: Option<Nanos>,
    /// True if this end writes into a memory of the peer, which keeps the values.
    pub(super) is_client: bool,
}

impl Line {
    /// Returns the line for the end with `role` of `bus`, which is `None` if the file's bus is wrong.
    pub(super) fn of(role: Role, bus: Option<&Options>) -> Self {
        Self {
            role,
            cycle: bus.and_then(|bus| bus.cycle()),
            is_client: bus.is_some_and(|bus| bus.is_client()),
        }
    }
}

/// Cycle times and time-outs of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The bus cycle; `None` leaves it to the bus. Positive.
    pub cycle: Option<Nanos>,
    /// Data from the peer that are older than this are stale. Positive.
    pub max_age: Nanos,
    /// A simulation that has not ticked for longer than this has stopped; `None` disables the check.
    pub watchdog: Option<Nanos>,
    /// The values that the peer has after this end has closed.
    pub at_close: Outputs,
    /// The values that the peer gets while this end has no valid data from it.
    pub while_stale: Outputs,
    /// Pauses between attempts to reach the peer; the last one repeats. Never empty, all positive.
    pub reconnect: Vec<Nanos>,
    stated: Stated,
}

/// The stated values of keys whose defaults depend on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stated {
    watchdog: Watchdog,
    at_close: Option<Outputs>,
    while_stale: Option<Outputs>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Watchdog {
    Usual,
    Off,
    After(Nanos),
}

impl Timing {
    /// Decides the values that the file leaves open for the end of `line`.
    pub(super) fn fit(&mut self, line: Line) {
        let is_controller = line.role == Role::Controller;
        let ten_cycles = self.cycle.or(line.cycle).unwrap_or_default().times(10);
        // A controller that stops must not leave its outputs on. Its scan can be as slow as the other end's answers.
        let usual_watchdog = is_controller.then(|| self.max_age.max(ten_cycles).max(LEAST_MAX_AGE));
        let usual_end = if is_controller || line.is_client {
            Outputs::FailSafe
        } else {
            Outputs::Hold
        };
        self.watchdog = match self.stated.watchdog {
            Watchdog::Usual => usual_watchdog,
            Watchdog::Off => None,
            Watchdog::After(limit) => Some(limit),
        };
        self.at_close = self.stated.at_close.unwrap_or(usual_end);
        // A machine does not depend on its PLC: its sensors continue.
        self.while_stale = if is_controller {
            self.stated.while_stale.unwrap_or(Outputs::FailSafe)
        } else {
            Outputs::Hold
        };
        if line.role == Role::Observer {
            // The peer gets no values at all.
            (self.watchdog, self.at_close) = (None, Outputs::Hold);
        }
    }
}

/// Cycle times and time-outs as written in the file.
pub(super) struct TimingKeys<'a> {
    cycle: Option<Value<'a>>,
    max_age: Option<Value<'a>>,
    watchdog: Option<Value<'a>>,
    at_close: Option<Value<'a>>,
    while_stale: Option<Value<'a>>,
    reconnect: Option<Value<'a>>,
}

impl<'a> TimingKeys<'a> {
    pub(super) fn take(table: &mut Table<'a>) -> Self {
        let [cycle, max_age, watchdog, at_close, while_stale] =
            ["cycle", "max_age", "watchdog", "at_close", "while_stale"].map(|key| table.take(key));
        Self {
            cycle,
            max_age,
            watchdog,
            at_close,
            while_stale,
            reconnect: table.take("reconnect"),
        }
    }

    /// Reads the times, for this line.
    pub(super) fn read(&self, line: Line) -> Option<Timing> {
        let of_bus = line.cycle;
        let span = |value: &Option<Value<'_>>, least, why| match value {
            None => Some(None),
            Some(value) => value.duration_between(least, why, LONGEST).map(Some),
        };
        let no_rhythm = "no operating system keeps to a shorter bus cycle than 50us";
        let no_stop = "a pause of a few milliseconds is no stop of the simulation";
        let spans = (
            span(&self.cycle, LEAST_CYCLE, no_rhythm),
            span(&self.max_age, Nanos(1), ""),
            match &self.watchdog {
                Some(value) if value.as_text() == Some(OFF) => Some(Watchdog::Off),
                Some(value) => value
                    .duration_between(LEAST_WATCHDOG, no_stop, LONGEST)
                    .map(Watchdog::After),
                None => Some(Watchdog::Usual),
            },
        );
        let outputs = |value: &Option<Value<'_>>| match value {
            None => Some(None),
            Some(value) => value
                .choice("kinds of outputs", &Outputs::CHOICES)
                .map(Some),
        };
        let ends = (outputs(&self.at_close), outputs(&self.while_stale));
        let reconnect = match &self.reconnect {
            None => Some(RECONNECT.to_vec()),
            Some(value) => read_reconnect(value),
        };
        let (stated_cycle, stated, watchdog) = (spans.0?, spans.1?, spans.2?);
        if let (Some(cycle), Some(stated), Some(value)) =
            (stated_cycle.or(of_bus), stated, &self.max_age)
            && stated < cycle
        {
            let whose = if stated_cycle.is_some() {
                ""
            } else {
                ", which is that of the bus where no \"cycle\" is stated"
            };
            value.wrong(
                format!("\"max_age\" is {stated}, shorter than one bus cycle of {cycle}{whose}"),
                "write some cycles, or all data are stale",
            );
        }
        let ten_cycles = stated_cycle.or(of_bus).unwrap_or_default().times(10);
        let mut timing = Timing {
            cycle: stated_cycle,
            max_age: stated.unwrap_or(ten_cycles.max(LEAST_MAX_AGE)),
            watchdog: None,
            at_close: Outputs::Hold,
            while_stale: Outputs::Hold,
            reconnect: reconnect?,
            stated: Stated {
                watchdog,
                at_close: ends.0?,
                while_stale: ends.1?,
            },
        };
        timing.fit(line);
        Some(timing)
    }
}

fn read_reconnect(value: &Value<'_>) -> Option<Vec<Nanos>> {
    const SHAPE: &str = "write a list of durations, such as [\"1s\", \"2s\", \"5s\"]";
    let list = value.list(SHAPE)?;
    if list.is_empty() || list.len() > RECONNECT_LIMIT {
        value.wrong(
            format!("\"reconnect\" has {} elements", list.len()),
            format!("write 1 to {RECONNECT_LIMIT} durations, such as [\"1s\", \"2s\", \"5s\"]"),
        );
        return None;
    }
    let pause = |value: &Value<'_>| {
        value.duration_from(LEAST_PAUSE, "attempts that often only burden both ends")
    };
    let spans: Vec<Option<Nanos>> = list.iter().map(pause).collect();
    spans.into_iter().collect()
}
