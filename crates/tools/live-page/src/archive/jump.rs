//! The next and the last tick that has what was asked for.

use serde_json::json;
use tickbus_record::{Goal, Moment};

use super::{Archive, Mark, millis};

impl Archive {
    /// The next tick after this one that has what was asked for, or the last one before it; `None` if that is unknown.
    pub(crate) fn jump(&self, what: &str, is_forward: bool, from: u64) -> Option<String> {
        let found = match what {
            "outage" => self.history.search(from, is_forward, Goal::Outage),
            "fault" => {
                let marks = self.notes().marks.clone();
                let aside = |mark: &&Mark| {
                    mark.begins && mark.tick != from && (mark.tick > from) == is_forward
                };
                let mut ticks: Vec<u64> =
                    marks.iter().filter(aside).map(|mark| mark.tick).collect();
                ticks.sort_unstable();
                let tick = if is_forward {
                    ticks.first()
                } else {
                    ticks.last()
                };
                let tick = tick.and_then(|tick| self.history.at(Moment::Tick(*tick)));
                tick.map(|tick| (tick.number, tick.time))
                    .filter(|(number, _)| *number != from && (*number > from) == is_forward)
            }
            index => {
                let index = index.parse().ok()?;
                self.facts.table.signals.get(index)?;
                self.history.search(from, is_forward, Goal::Change(index))
            }
        };
        let found = found.map(|(tick, time)| json!({ "tick": tick, "ms": millis(time) }));
        Some(found.unwrap_or_else(|| json!({ "tick": null })).to_string())
    }
}
