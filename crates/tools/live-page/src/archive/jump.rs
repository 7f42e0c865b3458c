//! The next and the last tick that has what was asked for.

use serde_json::json;
use tickbus_record::Goal;
use tickbus_reply::{Condition, Demand};

use super::{Archive, Mark, millis};

impl Archive {
    /// The next tick after this one that has what was asked for, or the last one before it; `None` if that is unknown.
    pub(crate) fn jump(&self, what: &str, is_forward: bool, from: u64) -> Option<String> {
        let found = match what {
            "outage" => self.history.search(from, is_forward, Goal::Outage),
            "fault" => {
                let first = self.history.span().map_or(0, |span| span.first.0);
                let is_wanted = |mark: &Mark| {
                    let is_aside = mark.tick != from && (mark.tick > from) == is_forward;
                    mark.begins && is_aside && mark.tick >= first
                };
                let marks = self.last_marks(usize::MAX, is_wanted);
                let places = marks.iter().filter_map(|mark| Some((mark.tick, mark.at?)));
                if is_forward {
                    places.min()
                } else {
                    places.max()
                }
            }
            index => {
                let index = index.parse().ok()?;
                self.facts.table.signals.get(index)?;
                if self.has_forces(index) {
                    let changes = Condition {
                        signal: index,
                        demand: Demand::Changes,
                    };
                    self.search(vec![changes], is_forward, from).at
                } else {
                    self.history.search(from, is_forward, Goal::Change(index))
                }
            }
        };
        let found = found.map(|(tick, time)| json!({ "tick": tick, "ms": millis(time) }));
        Some(found.unwrap_or_else(|| json!({ "tick": null })).to_string())
    }
}
