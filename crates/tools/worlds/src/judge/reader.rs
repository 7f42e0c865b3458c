//! The data that one end sees, tick by tick: nothing is torn across stations, and only new data are fresh.

use std::collections::BTreeMap;

use super::seen::Seen;
use super::writer::Writer;
use super::{Broken, Stamp, broken};
use crate::faults::{self, FaultPlan};
use crate::plan::{Bus, FAIL_SAFE, Plan};

/// A time in which all ticks of an end were stale, without a gap in which it might not have been.
#[derive(Debug)]
pub(super) struct Blind {
    pub(super) since: i64,
    pub(super) last: i64,
}

/// The data that one end has seen.
#[derive(Debug, Default)]
pub(crate) struct Reader {
    pub(super) newest: Vec<(u64, u64)>,
    sequence: u64,
    /// The times at which rising edges were seen, and their counts, per station.
    pub(crate) edges: Vec<Vec<(i64, u64)>>,
    /// The last tick that was not stale: its time, and the tick of its peer that it saw.
    pub(crate) last_valid: Option<(i64, Option<(u64, u64)>)>,
    /// When each life of the end was first not stale; [`i64::MAX`] if it never was.
    pub(crate) valid_since: Vec<i64>,
    /// The time of the first tick of this life.
    pub(super) begun: Option<i64>,
    /// The time since which the end has been stale, up to its last tick.
    pub(super) blind: Option<Blind>,
    /// The times at which the end was stale, or its line was disturbed on purpose.
    pub(crate) stale: Vec<i64>,
    /// The signals beside the stamp of station 0 in the previous tick.
    pub(super) before: [f64; 3],
    /// The values that were shown when faults of this end began, by the numbers of the faults.
    pub(super) held: BTreeMap<usize, f64>,
    /// The heartbeat that was shown last, and its stamp.
    pub(super) beat: Option<(Stamp, u8)>,
    /// True if the last tick that counted showed fail-safe values, false if it showed those of its peer's ticks; with
    /// the time since which ticks have done so.
    pub(super) kind: Option<(bool, i64)>,
}

impl Reader {
    /// Begins a life: the new driver knows nothing of what the previous one saw.
    pub(crate) fn begin(&mut self, stations: usize) {
        self.newest = vec![(0, 0); stations];
        self.before = faults::values(None);
        self.held.clear();
        self.beat = None;
        self.kind = None;
        self.blind = None;
        self.begun = None;
        self.sequence = 0;
        self.valid_since.push(i64::MAX);
    }

    /// Judges what a tick of the end that reads `area` shows of the values that `writer` wrote.
    pub(crate) fn judge(
        &mut self,
        plan: &Plan,
        area: u64,
        writer: &Writer,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        let now = seen.began;
        // A client that got no answer may read again before it writes again.
        let is_unwritten = plan.features.faults.iter().any(FaultPlan::is_of_line)
            && seen.stations.iter().any(|shown| shown.stamp == FAIL_SAFE);
        // A dispatcher shows fail-safe values for a lost source as well.
        let is_lost = plan.bus == Bus::Dispatcher
            && (seen.stations.iter()).all(|shown| shown.stamp == FAIL_SAFE);
        if seen.is_stale || is_unwritten || is_lost {
            self.stale.push(now);
        }
        self.begun.get_or_insert(now);
        let before = self
            .blind
            .take()
            .filter(|it| now - it.last <= plan.max_age.0);
        self.blind = seen.is_stale.then(|| Blind {
            since: before.map_or(now, |it| it.since),
            last: now,
        });
        if !seen.is_stale && seen.age > plan.max_age.0 {
            broken("stale", format!("age {} ns, and not stale", seen.age))?;
        }
        if seen.is_fresh && seen.sequence <= self.sequence {
            broken("fresh", "without a new cycle".to_owned())?;
        }
        if !seen.is_stale {
            self.sequence = seen.sequence;
        }
        let mut first = None;
        for (station, shown) in seen.stations.iter().enumerate() {
            self.judge_station(plan, (area, station), writer, seen, shown)?;
            let stamp = (shown.stamp != FAIL_SAFE).then(|| {
                let Stamp { life, tick, .. } = Stamp::of(shown.stamp);
                (life, tick)
            });
            // All stations travel in one message. Connections on request are made one by one, also when they are
            // requested again, and until then a station keeps its values.
            let is_apart = plan.laboratory.is_asked
                && (stamp.is_none() || first == Some(None) || !plan.events.is_empty())
                || plan.bus.has_units();
            match first {
                Some(_) if is_apart => {}
                None => first = Some(stamp),
                Some(first) if first != stamp => broken(
                    "torn",
                    format!("station 0 has {first:?}, station {station} {stamp:?}"),
                )?,
                Some(_) => {}
            }
            if shown.edges > 0 {
                self.edges
                    .resize(self.edges.len().max(station + 1), Vec::new());
                self.edges[station].push((now, shown.edges));
            }
        }
        if !seen.is_stale {
            self.last_valid = Some((now, first.flatten()));
            if let Some(since) = self.valid_since.last_mut() {
                *since = now.min(*since);
            }
        }
        super::age::judge(plan, area, seen)
    }
}
