//! Judges that nothing is left on: a writer that stopped and a controller that closed leave fail-safe values.

use super::age::{held, relayed, slack};
use super::beats::suspended;
use super::reader::Reader;
use super::seen::Seen;
use super::writer::Writer;
use super::{Broken, Stamp, broken};
use crate::plan::{Bus, FAIL_SAFE, Plan};

impl Reader {
    /// Judges that the watchdog of a writer that does not tick has tripped, so that none of its values count any more.
    pub(crate) fn judge_watchdog(
        plan: &Plan,
        limit: i64,
        writer: &Writer,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        let now = seen.began;
        let Some(last) = writer.last_ended(now) else {
            return Ok(());
        };
        // A dispatcher that holds the values of a lost source is configured to do so.
        let holds = plan.laboratory.holds && !plan.events.is_empty();
        if holds
            || writer.is_ticking()
            || now - last
                <= limit
                    + plan.max_age.0
                    + slack(plan)
                    + plan.waits_for_pulses()
                    + held(plan)
                    + relayed(plan)
        {
            return Ok(());
        }
        for (station, shown) in seen.stations.iter().enumerate() {
            // A tick that loses the processor after it has read the clock may see values that were written in the
            // meantime.
            if shown.stamp != FAIL_SAFE && !writer.wrote_after(now, Stamp::of(shown.stamp)) {
                broken(
                    "left on",
                    format!(
                        "station {station} shows {:?}, {} ns after its writer's last tick",
                        Stamp::of(shown.stamp),
                        now - last
                    ),
                )?;
            }
        }
        Ok(())
    }

    /// Judges that a closed controller leaves its fail-safe values, unless it is configured to hold.
    pub(crate) fn judge_farewell(
        plan: &Plan,
        controller: &Self,
        left: i64,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        // A controller that closes before it has joined leaves a dispatcher with the values of its previous life.
        let has_joined = controller.valid_since.last() < Some(&i64::MAX);
        let holds = plan.ends[1].holds_at_close
            || plan.habits.starves > 0
            || plan.laboratory.holds && !has_joined
            // A client whose request was lost does not ask again in time.
            || plan.bus.asks() && (plan.goes_down(0) || plan.goes_down(1));
        let through = if plan.bus == Bus::Dispatcher {
            held(plan) + relayed(plan)
        } else {
            0
        };
        let soon = slack(plan) + plan.waits_for_pulses() + through;
        if holds || seen.is_stale || seen.began <= left + soon {
            return Ok(());
        }
        match seen.stations.iter().find(|shown| shown.stamp != FAIL_SAFE) {
            Some(shown) => broken(
                "left on",
                format!("{:?} after its controller closed", Stamp::of(shown.stamp)),
            ),
            None => Ok(()),
        }
    }

    /// Judges that a controller that hears nothing from its peer sends fail-safe values, unless it is configured to
    /// hold. The peer's newest connection is from `connected`.
    pub(crate) fn judge_blind(
        &self,
        plan: &Plan,
        controller: &Self,
        connected: i64,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        let Some(blind) = &controller.blind else {
            return Ok(());
        };
        let heard = seen.began - seen.age;
        // A controller that is asked is no longer blind when it answers. The age of the data that a program reads is
        // unknown. The first cycle of a line that was down is like that of a new one.
        let is_unknown = plan.bus.asks()
            || plan.goes_down(1)
            // Both ends of a loopback have one line.
            || plan.bus == Bus::Loopback && plan.goes_down(0)
            || plan.bus == Bus::Dispatcher
            || plan.features.hosted == Some(0)
            || heard > blind.last;
        // The controller's first cycle finds everything stale, and sends the values of its program.
        let since = blind
            .since
            .max(connected)
            .max(self.begun.unwrap_or(connected));
        let soon = plan.cycle.0 * 2
            + slack(plan)
            + plan.waits_for_pulses()
            + held(plan)
            + suspended(plan, 0);
        if plan.ends[1].holds_while_stale || seen.is_stale || is_unknown || heard - since <= soon {
            return Ok(());
        }
        match seen.stations.iter().find(|shown| shown.stamp != FAIL_SAFE) {
            Some(shown) => broken(
                "left on",
                format!(
                    "{:?}, {} ns after its controller has become stale",
                    Stamp::of(shown.stamp),
                    heard - since
                ),
            ),
            None => Ok(()),
        }
    }

    /// Judges that data are stale soon after the line of either end went down on purpose.
    pub(crate) fn judge_down(plan: &Plan, since: i64, seen: &Seen<'_>) -> Result<(), Broken> {
        let limit = plan.max_age.0 + slack(plan) + held(plan);
        if seen.is_stale || seen.began - since <= limit {
            return Ok(());
        }
        broken(
            "link down",
            format!("not stale, {} ns after it went down", seen.began - since),
        )
    }
}
