//! What may stand on the page: a driver with its line, or a run on virtual time.

use std::fmt;

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::LinkState;
use tickbus_image::signal::Signal;
use tickbus_web::Refused;

use crate::picture::Picture;
use crate::sheet::Sheet;

/// How old the data of a station are.
pub(crate) struct Freshness<'a> {
    pub(crate) name: &'a str,
    /// `None` if there never were any.
    pub(crate) age_ms: Option<f64>,
    pub(crate) stale: bool,
}

/// Something with signals that is shown on the page.
///
/// The page asks for a copy, takes it over when it has come, and compares it with what it knew.
pub(crate) trait Exhibit: fmt::Debug + Send {
    /// Its id on the page.
    fn id(&self) -> i32;

    /// Its name, for people.
    fn name(&self) -> &str;

    /// Its signals, in their order.
    fn signals(&self) -> &[Signal];

    /// What is known of them.
    fn sheet(&self) -> &Sheet;

    /// As [`sheet`](Self::sheet), to change it.
    fn sheet_mut(&mut self) -> &mut Sheet;

    /// Asks for a copy.
    fn ask(&mut self, now: Nanos);

    /// Takes over the newest copy, if there is a new one.
    fn take(&mut self) -> bool;

    /// Compares what was taken over with what was known, as the state with this number; tells whether anything is new.
    fn update(&mut self, now: Nanos, number: u64, with_line: bool) -> bool;

    /// Whether it has other signals, or other stations, than before the last update.
    fn is_other(&self) -> bool {
        false
    }

    /// All about it and its signals, as JSON.
    fn json(&self) -> String;

    /// How old the data of its stations are; empty where that means nothing.
    fn stations(&self) -> Vec<Freshness<'_>> {
        Vec::new()
    }

    /// The state of its line.
    fn state(&self) -> LinkState;

    /// What it counts and measures.
    fn statistics(&self) -> &Statistics;

    /// The picture of its machine.
    fn picture(&self) -> Option<&Picture> {
        None
    }

    /// Holds a signal to a value.
    fn force(&mut self, signal: &str, value: &str) -> Result<(), Refused>;

    /// Holds a signal no longer.
    fn release(&mut self, signal: &str) -> Result<(), Refused>;

    /// Holds no signal any longer; those whose end is not taken over remain.
    fn release_all(&mut self) -> Result<(), Refused> {
        Ok(())
    }

    /// Forgets what is forced no more, since others can end faults as well.
    fn look_at_forced(&mut self) {}

    /// How long its signals stay forced for nobody; `None` if none is forced, or for good.
    fn grace(&self) -> Option<Nanos> {
        None
    }
}
