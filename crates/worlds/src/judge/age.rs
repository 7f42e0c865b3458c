//! Ages: never less than the true one, and nothing old is told to be young.

use tickbus_dispatcher::LEAST_PROMISE;

use super::seen::Seen;
use super::writer::Writer;
use super::{Broken, Stamp, broken};
use crate::plan::{BETWEEN, Bus, Event, Misfortune, Plan};
use crate::scheduler::STARVED;

/// What the line adds to the age of what arrives on it, in ns: cycles of both ends, and threads that run late.
pub(crate) fn slack(plan: &Plan) -> i64 {
    let cycles = plan.cycle.0 * 4;
    let late = plan.habits.late * 6
        + if plan.habits.preempts > 0 {
            3_000_000
        } else {
            0
        };
    cycles + late + plan.round_trip() + plan.held_by_faults() + 1_000_000
}

/// How long lines may have waited for a dispatcher that is suspended, and count: up to twice the time within which one was promised.
pub(super) fn relayed(plan: &Plan) -> i64 {
    let is_suspended = |event: &Event| matches!(event.what, Misfortune::Suspend(BETWEEN, _));
    if plan.events.iter().any(is_suspended) {
        promise(plan) * 2
    } else {
        0
    }
}

/// Within what an end promises a dispatcher a line, in ns.
pub(crate) fn promise(plan: &Plan) -> i64 {
    plan.max_age.max(LEAST_PROMISE).0
}

/// How long what was taken to be sent may be on its way, beyond what the network takes.
pub(crate) fn held(plan: &Plan) -> i64 {
    let spans = plan.events.iter().map(|event| match event.what {
        Misfortune::Hold(span) => span.0,
        Misfortune::Suspend(BETWEEN, _) => 0,
        // A thread that has taken what to send may lose the processor before it sends that.
        Misfortune::Suspend(_, span) if plan.habits.preempts > 0 || plan.bus.asks() => span.0,
        _ => 0,
    });
    spans.sum::<i64>() + plan.habits.starves * i64::from(STARVED)
}

/// The age that is told is at least the true one.
pub(super) fn judge(plan: &Plan, area: u64, seen: &Seen<'_>) -> Result<(), Broken> {
    if seen.is_stale || plan.bus == Bus::Loopback {
        return Ok(());
    }
    // A tick that loses the processor behind its look at the clock may see what came meanwhile: that is younger.
    let Some(last) = seen.deliveries.last() else {
        return broken("age", format!("{} ns, though nothing has come", seen.age));
    };
    // A slave of PROFIBUS clears its outputs when its master has sent nothing for the time of its watchdog. One whose adapter was
    // unplugged begins again without a watchdog.
    let silence = seen.began - last.at;
    let limit = plan.slave_watchdog().0 + slack(plan);
    let is_watched = plan.bus == Bus::Profibus
        && area == 0
        && !plan
            .events
            .iter()
            .any(|event| event.what == Misfortune::Reset);
    if is_watched && silence > limit {
        return broken(
            "age",
            format!("not stale, {silence} ns after the last request"),
        );
    }
    // As docs/ARCHITECTURE.md has it: half of max_age, or 2 ms.
    let allowed = (plan.max_age.0 / 2).max(2_000_000) + slack(plan);
    if silence > seen.age + allowed {
        return broken(
            "age",
            format!(
                "told {} ns, and the last bytes came {silence} ns ago",
                seen.age
            ),
        );
    }
    Ok(())
}

/// Old data as young: the peer had written something newer before it sent what made the age so small.
pub(super) fn judge_young(
    plan: &Plan,
    writer: &Writer,
    seen: &Seen<'_>,
    (station, stamp): (usize, Stamp),
) -> Result<(), Broken> {
    let now = seen.began;
    let Stamp {
        life, tick, area, ..
    } = stamp;
    let slack =
        slack(plan) + plan.waits_for_pulses() + if plan.bus.asks() { held(plan) } else { 0 };
    let heard = now - seen.age;
    // What a fault delays is told to have come that much later.
    let arrived = heard - plan.delayed_at(usize::from(area == 1));
    let least = match plan.bus {
        Bus::Loopback => writer.newest_at(heard - slack),
        Bus::Dispatcher => seen.known.and_then(|known| known.least),
        _ => {
            let before = seen
                .deliveries
                .partition_point(|delivery| delivery.at <= arrived - 1_000_000);
            // The beginning of a message that has not come whole makes nothing young.
            let whole = seen.deliveries[..before]
                .iter()
                .rfind(|delivery| delivery.is_whole);
            whole.and_then(|delivery| writer.newest_at(delivery.sent - slack))
        }
    };
    if let Some(least) = least
        && (life, tick) < least
    {
        broken(
            "old as young",
            format!(
                "at {now} station {station} shows {stamp:?} with age {}; {least:?} was there when its peer sent",
                seen.age
            ),
        )?;
    }
    Ok(())
}
