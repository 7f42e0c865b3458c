//! Signs of life: a heartbeat counts up as its end ticks, and an end that watches one notices a frozen peer.

use super::age::{held, slack};
use super::reader::Reader;
use super::seen::{Seen, Shown};
use super::writer::Writer;
use super::{Broken, Stamp, broken};
use crate::plan::{Bus, FAIL_SAFE, Misfortune, Plan};

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
        // Each beat has its own tick. Two beats are at most the interval and the tick after it apart; a tick reads the
        // clock somewhere within it.
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

    /// Judges that an end becomes stale when the writer that it watches does not tick, so that its heartbeat is frozen.
    /// The first frame of a connection counts as a change of the heartbeat. So do fail-safe values after those of a
    /// tick, and the reverse.
    pub(crate) fn judge_frozen(
        &mut self,
        plan: &Plan,
        end: usize,
        writer: &Writer,
        connected: i64,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        let Some((every, Some(within))) = plan.beat(end) else {
            return Ok(());
        };
        if seen.is_stale {
            return Ok(());
        }
        let is_fail_safe = seen.stations.iter().all(|shown| shown.stamp == FAIL_SAFE);
        let same = self.kind.filter(|kind| kind.0 == is_fail_safe);
        let (_, replaced) = *self.kind.insert(same.unwrap_or((is_fail_safe, seen.began)));
        // A tick that loses the processor after it has read the clock may see values that were written in the meantime.
        let is_new = |shown: &Shown| {
            shown.stamp != FAIL_SAFE && writer.wrote_after(seen.began, Stamp::of(shown.stamp))
        };
        let Some(last) = writer.last_ended(seen.began) else {
            return Ok(());
        };
        let frozen = seen.began - last.max(replaced).max(connected);
        let limit = (within + every + plan.max_age).0
            + slack(plan)
            + plan.waits_for_pulses()
            + held(plan)
            + suspended(plan, end);
        if frozen <= limit || writer.is_ticking() || seen.stations.iter().any(is_new) {
            return Ok(());
        }
        broken(
            "frozen",
            format!("not stale, {frozen} ns after the last tick of its peer"),
        )
    }
}

/// The time for which an end is suspended, in ns. Values that it wrote right before are sent right after.
pub(super) fn suspended(plan: &Plan, end: usize) -> i64 {
    let spans = plan.events.iter().map(|event| match event.what {
        // Both ends of a loopback are one process.
        Misfortune::Suspend(process, span) if process == end || plan.bus == Bus::Loopback => span.0,
        _ => 0,
    });
    spans.sum()
}
