//! Cycle times and time-outs of `[fieldbus]`.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Table, Value};

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

/// The shortest `watchdog`: pauses of a busy machine must not look like a stopped simulation.
const LEAST_WATCHDOG: Nanos = Nanos::from_millis(10);

/// The longest of these times: the age of data that never came must be beyond it.
const LONGEST: Nanos = Nanos::from_secs(24 * 3600);

/// The shortest pause in `reconnect`: each attempt writes a line to the log.
const LEAST_PAUSE: Nanos = Nanos::from_millis(10);

/// The most pauses in `reconnect`.
const RECONNECT_LIMIT: usize = 100;

/// Cycle times and time-outs of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The bus cycle; `None` leaves it to the bus. Positive.
    pub cycle: Option<Nanos>,
    /// Data from the peer that are older than this are stale. Positive.
    pub max_age: Nanos,
    /// A simulation that has not ticked for longer than this has stopped; `None` disables the check.
    pub watchdog: Option<Nanos>,
    /// Pauses between attempts to reach the peer; the last one repeats. Never empty, all positive.
    pub reconnect: Vec<Nanos>,
}

/// Cycle times and time-outs as written in the file.
pub(super) struct TimingKeys<'a> {
    cycle: Option<Value<'a>>,
    max_age: Option<Value<'a>>,
    watchdog: Option<Value<'a>>,
    reconnect: Option<Value<'a>>,
}

impl<'a> TimingKeys<'a> {
    pub(super) fn take(table: &mut Table<'a>) -> Self {
        let [cycle, max_age, watchdog] =
            ["cycle", "max_age", "watchdog"].map(|key| table.take(key));
        Self {
            cycle,
            max_age,
            watchdog,
            reconnect: table.take("reconnect"),
        }
    }

    /// Reads them, for a bus whose default cycle is `of_bus`.
    pub(super) fn read(&self, of_bus: Option<Nanos>) -> Option<Timing> {
        let span = |value: &Option<Value<'_>>, least, why| match value {
            None => Some(None),
            Some(value) => value.duration_between(least, why, LONGEST).map(Some),
        };
        let no_rhythm = "no operating system keeps to a shorter bus cycle than 50us";
        let no_stop = "a pause of a few milliseconds is no stop of the simulation";
        let spans = (
            span(&self.cycle, LEAST_CYCLE, no_rhythm),
            span(&self.max_age, Nanos(1), ""),
            span(&self.watchdog, LEAST_WATCHDOG, no_stop),
        );
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
        let max_age = stated.unwrap_or(ten_cycles.max(LEAST_MAX_AGE));
        Some(Timing {
            cycle: stated_cycle,
            max_age,
            watchdog,
            reconnect: reconnect?,
        })
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
