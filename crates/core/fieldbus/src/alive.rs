//! `alive` and `heartbeat` of `[fieldbus]`: signals by which each end detects that the other end is alive.

use std::ops::Range;

use super::Role;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, did_you_mean, shown};
use tickbus_image::signal::{Area, DataType, Signal, SignalTable};

/// The shortest time within which a signal can be required to change: shorter times are within the jitter of an
/// operating system.
const LEAST_WITHIN: Nanos = Nanos::from_millis(10);

/// The shortest interval of a heartbeat.
const LEAST_EVERY: Nanos = Nanos::from_millis(1);

/// How many beats may be missed before the watching end regards the data as frozen.
const MISSED: i64 = 5;

/// A signal that must keep changing for the data of its station to be valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Alive {
    /// The signal's index in the signal table; the end that the driver.cfg describes reads the signal.
    pub signal: usize,
    /// The longest time without a change; positive.
    pub within: Nanos,
}

/// A signal that the driver counts up while the simulation ticks; a BOOL toggles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// The signal's index in the signal table: an unscaled BOOL or integer, written by the end that the driver.cfg
    /// describes.
    pub signal: usize,
    /// Time from one beat to the next; positive.
    pub every: Nanos,
}

/// The life signs that a driver.cfg configures.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LifeSigns {
    /// The signals of `alive`.
    pub alive: Vec<Alive>,
    /// The signals of `heartbeat`.
    pub heartbeat: Vec<Heartbeat>,
}

/// A signal that is watched for changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Watch {
    /// The signal's name in messages.
    pub name: String,
    /// The signal's station.
    pub station: usize,
    /// The signal's bytes in the received frame.
    pub bytes: Range<usize>,
    /// The signal's bits in each of these bytes.
    pub mask: u8,
    /// The longest time without a change.
    pub within: Nanos,
}

impl LifeSigns {
    /// The heartbeats that the end with `role` sends.
    pub fn beats<'a>(
        &'a self,
        table: &'a SignalTable,
        role: Role,
    ) -> impl Iterator<Item = Heartbeat> + 'a {
        let (writes, _) = role.areas();
        let beats = self.heartbeat.iter().copied();
        beats.filter(move |beat| table.signals[beat.signal].area == writes)
    }

    /// The signals that the end with `role` watches. The end that the driver.cfg describes watches the signals in
    /// `alive`. The other end watches the heartbeats of that end, which may pause for `max_age` or five beats,
    /// whichever is longer.
    pub fn watches(&self, table: &SignalTable, role: Role, max_age: Nanos) -> Vec<Watch> {
        let (_, reads) = role.areas();
        let beats = self.heartbeat.iter();
        let beats = beats.map(|beat| (beat.signal, max_age.max(beat.every.times(MISSED))));
        let alive = self.alive.iter().map(|alive| (alive.signal, alive.within));
        let watched = alive.chain(beats);
        let watched = watched.map(|(signal, within)| (&table.signals[signal], within));
        let watched = watched.filter(|(signal, _)| signal.area == reads);
        watched
            .map(|(signal, within)| Watch::new(signal, within))
            .collect()
    }
}

impl Watch {
    fn new(signal: &Signal, within: Nanos) -> Self {
        Self {
            name: signal.name.clone(),
            station: signal.station,
            bytes: signal.byte..signal.byte + signal.data_type.size_bytes(),
            mask: match signal.data_type {
                DataType::Bool => 1 << signal.bit,
                _ => u8::MAX,
            },
            within,
        }
    }
}

/// `alive` and `heartbeat` as written in the file; both can be read only after the signals.
#[derive(Debug, Default)]
pub struct Written<'a> {
    alive: Option<Value<'a>>,
    heartbeat: Option<Value<'a>>,
}

const SIGNAL: Key = Key::required("signal", Shape::Text, "The name of the signal");

const ALIVE: Shape = Shape::Table(&[
    SIGNAL,
    Key::required(
        "within",
        Shape::Duration,
        "The signal has to change within this time: at least 10ms and one bus cycle",
    ),
]);

const HEARTBEAT: Shape = Shape::Table(&[
    SIGNAL,
    Key::required(
        "every",
        Shape::Duration,
        "The signal is counted up once in this time: at least 1ms",
    ),
]);

impl<'a> Written<'a> {
    /// The keys in `[fieldbus]`.
    pub const KEYS: &'static [Key] = &[
        Key::new(
            "alive",
            Shape::Any(&[ALIVE, Shape::List(&ALIVE, 0, usize::MAX)]),
            "A signal that this end reads and that has to change, or a list of such tables",
        ),
        Key::new(
            "heartbeat",
            Shape::Any(&[HEARTBEAT, Shape::List(&HEARTBEAT, 0, usize::MAX)]),
            "A signal that this end writes and that the driver counts up, or a list of such tables",
        ),
    ];

    /// Takes the keys out of `[fieldbus]`.
    pub fn take(table: &mut Table<'a>) -> Self {
        Self {
            alive: table.take("alive"),
            heartbeat: table.take("heartbeat"),
        }
    }

    /// Reads both keys for the end that the file describes, which has `role`; `cycle` is the bus cycle, if the bus has
    /// its own. Reports signals that do not exist or that the wrong end writes.
    pub fn read(
        &self,
        signals: &SignalTable,
        role: Role,
        cycle: Option<Nanos>,
        signs: &mut LifeSigns,
    ) {
        let (writes, reads) = role.areas();
        if let Some(value) = &self.alive {
            const RIGHT: &str = "write alive = { signal = \"<name>\", within = \"500ms\" }, or a list of such tables";
            let read = |mut table: Table<'a>, taken: &mut Vec<usize>| {
                let signal = table.require("signal", RIGHT);
                let within = table.require("within", RIGHT);
                table.finish();
                let within = within.and_then(|value| {
                    let least = cycle.unwrap_or_default().max(LEAST_WITHIN);
                    value.duration_from(least, "a PLC needs some cycles to change a signal")
                });
                let signal = find(&signal?, signals, reads, "reads", taken)?;
                Some(Alive {
                    signal,
                    within: within?,
                })
            };
            signs.alive = each(value, "alive", RIGHT, read);
        }
        // An observer's heartbeat is refused as a whole.
        if let Some(value) = &self.heartbeat
            && role != Role::Observer
        {
            const RIGHT: &str = "write heartbeat = { signal = \"<name>\", every = \"100ms\" }, or a list of such tables";
            let read = |mut table: Table<'a>, taken: &mut Vec<usize>| {
                let signal = table.require("signal", RIGHT);
                let every = table.require("every", RIGHT);
                table.finish();
                let every = every.and_then(|value| {
                    value.duration_from(LEAST_EVERY, "no PLC looks at it more often")
                });
                let value = signal?;
                let signal = find(&value, signals, writes, "writes", taken)?;
                let found = &signals.signals[signal];
                if found.scale.is_some()
                    || matches!(found.data_type, DataType::Real | DataType::Lreal)
                {
                    let what = if found.scale.is_some() {
                        "has a scale"
                    } else {
                        "is a number with a fraction"
                    };
                    value.wrong(
                        format!(
                            "the signal \"{}\" {what}, and a heartbeat counts",
                            shown(&found.name)
                        ),
                        "name a BOOL, which toggles, or an integer without a scale",
                    );
                    return None;
                }
                Some(Heartbeat {
                    signal,
                    every: every?,
                })
            };
            signs.heartbeat = each(value, "heartbeat", RIGHT, read);
        }
    }
}

/// Reads `value` if it is a table, or each table if it is a list of them.
fn each<'a, T>(
    value: &Value<'a>,
    key: &str,
    right: &str,
    mut read: impl FnMut(Table<'a>, &mut Vec<usize>) -> Option<T>,
) -> Vec<T> {
    let tables = if value.is_table() {
        vec![value.clone()]
    } else {
        value.list(right).unwrap_or_default()
    };
    let mut taken = Vec::new();
    let tables = tables.iter().filter_map(|value| value.table(key, right));
    tables.filter_map(|table| read(table, &mut taken)).collect()
}

/// The signal that `value` names, in `area` and not named before.
fn find(
    value: &Value<'_>,
    table: &SignalTable,
    area: Area,
    does: &str,
    taken: &mut Vec<usize>,
) -> Option<usize> {
    let name = value.text("write the name of a signal in quotes")?;
    let Some(found) = table.position(name) else {
        let names: Vec<&str> = table.signals.iter().map(|s| s.name.as_str()).collect();
        value.wrong(
            format!("there is no signal \"{}\"", shown(name)),
            did_you_mean(name, "signals", &names),
        );
        return None;
    };
    let its = table.signals[found].area;
    if its != area {
        value.wrong(
            format!("the signal \"{}\" is in {its}", shown(name)),
            format!("name one in {area}, which this end {does}"),
        );
        return None;
    }
    if taken.contains(&found) {
        value.wrong(
            format!("the signal \"{}\" is named twice", shown(name)),
            "name each signal once",
        );
        return None;
    }
    taken.push(found);
    Some(found)
}
