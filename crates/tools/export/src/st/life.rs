//! Life signs: the simulation's heartbeat, which the program watches, and the signal that the simulation
//! watches, which the program counts up.

use crate::record::{PlacedSignal, Record};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_image::signal::{DataType, Signal};

/// How many beats may be missed.
const MISSED: i64 = 5;

/// The variable that is TRUE while the simulation is alive.
pub(super) const ALIVE: &str = "Alive";

/// A program's code for life signs.
#[derive(Debug, Default)]
pub(super) struct Life {
    /// Local variables: names and types.
    pub(super) locals: Vec<(String, &'static str)>,
    /// Statements after the inputs are read.
    pub(super) before: Vec<String>,
    /// Statements before the outputs are written.
    pub(super) after: Vec<String>,
}

/// The local variables that watch the heartbeat with this number, from 1.
fn watching(number: usize) -> [String; 3] {
    ["Silence", "Beat", "Is_beating"].map(|name| format!("{name}_{number}"))
}

/// Names declared by [`Life::of`].
pub(super) fn declared(config: &Config) -> impl Iterator<Item = String> {
    let beats = 1..=config.life_signs.heartbeat.len();
    beats.flat_map(watching).chain([ALIVE.to_owned()])
}

impl Life {
    /// `kind` is the type of a signal's variable, and `variable` the program's notation for that variable. `alive` and
    /// `simulated` are the variables of these names. `is_known` is true if other statements already set `alive`
    /// according to the received data.
    pub(super) fn of(
        config: &Config,
        records: &[Record<'_>; 2],
        kind: &dyn Fn(&PlacedSignal<'_>) -> DataType,
        variable: &dyn Fn(&str) -> String,
        [alive, simulated]: [&str; 2],
        is_known: bool,
    ) -> Self {
        let place = |signal: usize| {
            let signal: *const Signal = &raw const config.table.signals[signal];
            let mut places = records.iter().flat_map(|record| &record.places);
            places.find(|place| std::ptr::eq(place.signal, signal))
        };
        let mut life = Self::default();
        let mut signs = Vec::from([simulated.to_owned()]);
        if is_known {
            signs.push(alive.to_owned());
        }
        let beats = config.life_signs.beats(&config.table, Role::Device);
        let beats = beats.filter_map(|beat| Some((place(beat.signal)?, beat.every)));
        for (number, (place, every)) in beats.enumerate() {
            let [silence, beat, is_beating] = watching(number + 1);
            let (value, span) = (
                variable(&place.name),
                config.timing.max_age.max(every.times(MISSED)),
            );
            life.before.extend([
                format!(
                    "{silence}(IN := {simulated} AND {value} = {beat}, PT := {});",
                    time(span)
                ),
                format!("{is_beating} := {simulated} AND ({is_beating} OR {value} <> {beat});"),
                format!("{beat} := {value};"),
            ]);
            signs.extend([is_beating.clone(), format!("NOT {silence}.Q")]);
            life.locals.extend([
                (silence, "TON"),
                (beat, kind(place).name()),
                (is_beating, "BOOL"),
            ]);
        }
        if !life.before.is_empty() {
            life.before
                .push(format!("{alive} := {};", signs.join(" AND ")));
        }
        let watched = config.life_signs.alive.iter();
        let watched = watched.filter_map(|alive| place(alive.signal));
        let outputs = watched.filter(|place| place.signal.area == Role::Device.areas().1);
        life.after = outputs
            .map(|place| counted(kind(place), &variable(&place.name)))
            .collect();
        life
    }

    /// Returns true if the simulation has a heartbeat here.
    pub(super) fn is_beating(&self) -> bool {
        !self.before.is_empty()
    }
}

/// A statement that changes a value of any type.
fn counted(data_type: DataType, name: &str) -> String {
    let (unsigned, own) = match data_type {
        DataType::Bool => return format!("{name} := NOT {name};"),
        DataType::Real | DataType::Lreal => return format!("{name} := 1.0 - {name};"),
        DataType::Usint | DataType::Uint | DataType::Udint | DataType::Ulint => {
            return format!("{name} := {name} + 1;");
        }
        own @ (DataType::Byte | DataType::Sint) => ("USINT", own),
        own @ (DataType::Word | DataType::Int) => ("UINT", own),
        own @ (DataType::Dword | DataType::Dint) => ("UDINT", own),
        own @ (DataType::Lword | DataType::Lint) => ("ULINT", own),
    };
    // Unsigned numbers wrap around after the highest one.
    format!("{name} := {unsigned}_TO_{own}({own}_TO_{unsigned}({name}) + 1);")
}

/// A span of time as a literal, in whole milliseconds, at least one.
pub(super) fn time(span: Nanos) -> String {
    format!("T#{}MS", span.0.div_euclid(1_000_000).max(1))
}
