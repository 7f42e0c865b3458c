//! The exhibits of the page: a driver with its line, a run on virtual time, or a recording.

use std::fmt;
use std::sync::Arc;

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_fieldbus::LinkState;
use tickbus_image::signal::Signal;
use tickbus_web::Refused;

use crate::archive::Archive;
use crate::lists::Beside;
use crate::picture::Picture;
use crate::sheet::Sheet;

/// The age of a station's data.
pub(crate) struct Freshness<'a> {
    pub(crate) name: &'a str,
    /// `None` if there never were any data.
    pub(crate) age_ms: Option<f64>,
    pub(crate) stale: bool,
}

/// Something with signals that the page shows.
///
/// The page requests a copy, takes it over once it has come, and compares it with the last known state.
pub(crate) trait Exhibit: fmt::Debug + Send {
    /// The id on the page.
    fn id(&self) -> i32;

    /// The name, for people.
    fn name(&self) -> &str;

    /// The signals, in their order.
    fn signals(&self) -> &[Signal];

    /// The known state of the signals.
    fn sheet(&self) -> &Sheet;

    /// Like [`sheet`](Self::sheet), but mutable.
    fn sheet_mut(&mut self) -> &mut Sheet;

    /// Requests a copy.
    fn ask(&mut self, now: Nanos);

    /// Takes over the newest copy; returns true if there was one.
    fn take(&mut self) -> bool;

    /// Compares the copy with the known state, and stores it under this number; returns true if anything is new.
    fn update(&mut self, now: Nanos, number: u64, with_line: bool) -> bool;

    /// True if the signals or stations are others than before the last update.
    fn is_other(&self) -> bool {
        false
    }

    /// The exhibit and its signals as JSON.
    fn json(&self) -> String;

    /// The age of the stations' data; empty where that means nothing.
    fn stations(&self) -> Vec<Freshness<'_>> {
        Vec::new()
    }

    /// The state of the line.
    fn state(&self) -> LinkState;

    /// The counters and measurements.
    fn statistics(&self) -> &Statistics;

    /// The past, if it is recorded.
    fn archive(&self) -> Option<Arc<Archive>> {
        None
    }

    /// The picture of the machine.
    fn picture(&self) -> Option<&Picture> {
        None
    }

    /// The file of the lists of signals.
    fn lists(&self) -> Option<Arc<Beside>> {
        None
    }

    /// Forces signals to values, all from the same tick on, or none if one is refused.
    fn force(&mut self, values: &[(String, String)]) -> Result<(), Refused>;

    /// Ends the forces of signals in the same tick.
    fn release(&mut self, signals: &[String]) -> Result<(), Refused>;

    /// Gives the simulation's model a fault of this value, or ends it.
    fn fault(&mut self, name: &str, _value: Option<&str>) -> Result<(), Refused> {
        Err(Refused {
            status: 404,
            text: format!("\"{}\" has no fault \"{}\"", self.name(), shown(name)),
        })
    }

    /// Ends all forces and faults of the model; those whose end is not accepted remain.
    fn release_all(&mut self) -> Result<(), Refused> {
        Ok(())
    }

    /// Forgets forces that have ended, since others can end faults as well.
    fn look_at_forced(&mut self) {}

    /// How long signals stay forced when nobody is there; `None` if none is forced, or for good.
    fn grace(&self) -> Option<Nanos> {
        None
    }
}
