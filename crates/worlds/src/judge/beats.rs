//! Signs of life: a heartbeat counts up as its end ticks, and an end that watches one does not take a frozen peer for alive.

use super::age::{held, slack};
use super::reader::Reader;
use super::seen::Seen;
use super::writer::Writer;
use super::{Broken, Stamp, broken};
use crate::plan::Plan;

impl Reader {
    /// Judges the heartbeat that is shown with a stamp.
    pub(super) fn judge_beat(
        &mut self,
        plan: &Plan,
        writer: &Writer,
        (end, stamp): (usize, Stamp),
        beat: Option<u8>,
    ) -> Result<(), Broken> {
        let (Some(beat), Some((every, _))) = (beat, plan.beat(end)) else {
            return Ok(());
        };
        let before = self.beat.replace((stamp, beat));
        let Some((since, counted)) = before.filter(|(since, _)| since.life == stamp.life) else {
            return Ok(());
        };
        let ticks = stamp.tick.saturating_sub(since.tick);
        let times = writer.times(stamp.life, since.tick, stamp.tick);
        let gaps = times.windows(2).map(|pair| pair[1] - pair[0]);
        let longest = gaps.max().unwrap_or_default();
        let span = times
            .last()
            .zip(times.first())
            .map_or(0, |(last, first)| last - first);
        // One tick each, and no pause longer than the time between two beats and the tick behind it; the clock is looked at
        // within a tick.
        let least = (span - slack(plan)) / (every.0 + longest + 1);
        let count = u64::from(beat.wrapping_sub(counted));
        if ticks > 200 || count <= ticks && i64::try_from(count).is_ok_and(|count| count >= least) {
            return Ok(());
        }
        broken(
            "heartbeat",
            format!(
                "{count} beats in {ticks} ticks and {span} ns, at {stamp:?}; one is due every {every}"
            ),
        )
    }

    /// A writer that does not tick does not beat: who watches that is stale.
    pub(crate) fn judge_frozen(
        plan: &Plan,
        end: usize,
        writer: &Writer,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        let Some((every, Some(within))) = plan.beat(end) else {
            return Ok(());
        };
        let limit =
            (within + every + plan.max_age).0 + slack(plan) + plan.waits_for_pulses() + held(plan);
        let frozen = writer.last_ended(seen.began).map(|last| seen.began - last);
        match frozen {
            Some(frozen) if !writer.is_ticking() && !seen.is_stale && frozen > limit => broken(
                "frozen",
                format!("not stale, {frozen} ns after the last tick of its peer"),
            ),
            _ => Ok(()),
        }
    }
}
