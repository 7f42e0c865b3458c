//! Judges ages: a reported age is never less than the true one, and nothing old passes as young.

use tickbus_dispatcher::LEAST_PROMISE;

use super::seen::Seen;
use super::writer::Writer;
use super::{Broken, Stamp, broken};
use crate::plan::{BETWEEN, Bus, Event, Misfortune, Plan};
use crate::scheduler::STARVED;

/// The time that the line adds to the age of data that arrive on it, in ns: cycles of both ends, and threads that run
/// late.
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

/// The time for which lines may have waited for a suspended dispatcher and still count, in ns: up to twice the promised
/// interval.
pub(super) fn relayed(plan: &Plan) -> i64 {
    let is_suspended = |event: &Event| matches!(event.what, Misfortune::Suspend(BETWEEN, _));
    if plan.events.iter().any(is_suspended) {
        promise(plan) * 2
    } else {
        0
    }
}

/// The interval at which an end promises lines to a dispatcher, in ns.
pub(crate) fn promise(plan: &Plan) -> i64 {
    plan.max_age.max(LEAST_PROMISE).0
}

/// The time for which data that were taken for sending may be under way, beyond the time of the network, in ns.
pub(crate) fn held(plan: &Plan) -> i64 {
    let spans = plan.events.iter().map(|event| match event.what {
        Misfortune::Hold(span) => span.0,
        Misfortune::Suspend(BETWEEN, _) => 0,
        // A thread that has taken data for sending may lose the processor before it sends them.
        Misfortune::Suspend(_, span) if plan.habits.preempts > 0 || plan.bus.asks() => span.0,
        _ => 0,
    });
    spans.sum::<i64>() + plan.habits.starves * i64::from(STARVED)
}

/// Judges that the reported age is at least the true one.
pub(super) fn judge(plan: &Plan, area: u64, seen: &Seen<'_>) -> Result<(), Broken> {
    if seen.is_stale || plan.bus == Bus::Loopback {
        return Ok(());
    }
    // A tick that loses the processor after it has read the clock may see bytes that came in the meantime; they are
    // younger.
    let Some(last) = seen.deliveries.last() else {
        return broken("age", format!("{} ns, though nothing has come", seen.age));
    };
    // A slave of PROFIBUS clears its outputs when its master has sent nothing for the time of its watchdog.
    let silence = seen.began - last.at;
    let limit = plan.slave_watchdog().0 + slack(plan);
    if plan.bus == Bus::Profibus && area == 0 && silence > limit {
        return broken(
            "age",
            format!("not stale, {silence} ns after the last request"),
        );
    }
    // The tolerance of docs/ARCHITECTURE.md: half of `max_age`, but at least 2 ms.
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

/// Judges that old data do not pass as young: the peer had written nothing newer before it sent the bytes that set the
/// age.
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
    // Data that a fault delays count from the end of the delay.
    let arrived = heard - plan.delayed_at(usize::from(area == 1));
    let least = match plan.bus {
        Bus::Loopback => writer.newest_at(heard - slack),
        Bus::Dispatcher => seen.known.and_then(|known| known.least),
        _ => {
            let before = seen
                .deliveries
                .partition_point(|delivery| delivery.at <= arrived - 1_000_000);
            // The beginning of a message that has not fully arrived makes nothing young.
            let whole = seen.deliveries[..before]
                .iter()
                .rfind(|delivery| delivery.is_whole);
            whole.and_then(|delivery| writer.newest_at(delivery.sent - slack))
        }
    };
    // A client of several units asks one that did not answer who it is before it writes again, and reads meanwhile. After
    // a silence of `max_age` and reads for as long, a server takes it for a client that writes only changes.
    let asks_again = matches!(plan.bus, Bus::Modbus | Bus::ModbusRtu)
        && plan.controller_serves
        && area == 1
        && plan.stations > 1;
    if asks_again && !writer.wrote_after(heard - 2 * plan.max_age.0, stamp) {
        return Ok(());
    }
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
