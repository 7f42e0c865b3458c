//! The pulses of a whole world: those written, and those seen.

use tickbus_base::time::Nanos;

use super::Shared;
use crate::broken::Broken;
use crate::faults::FaultPlan;
use crate::plan::{Bus, Misfortune};

/// Judges that each pulse written while all is well is seen once, and that no more pulses are seen than were written.
pub(super) fn judge(shared: &Shared, ended: Nanos) {
    let plan = &shared.plan;
    let readers = [0, 1].map(|end| shared.ends[end].reader.borrow());
    // All is well from the first data on, if there are no misfortunes.
    let well_since = readers
        .iter()
        .map(|reader| reader.valid_since.iter().copied().min().unwrap_or(i64::MAX))
        .max();
    let well_since = well_since
        .filter(|_| plan.events.is_empty() && plan.habits.starves == 0)
        // Connections on request are made one by one, and that of the pulse may be the last.
        .filter(|_| !plan.laboratory.is_asked)
        .unwrap_or(i64::MAX);
    for end in 0..2 {
        let (reader, writer) = (&readers[end], shared.ends[1 - end].writer.borrow());
        for station in 0..plan.stations {
            let edges = reader.edges.get(station).map_or(&[][..], |edges| edges);
            let seen: u64 = edges.iter().map(|edge| edge.1).sum();
            let written = writer.pulses.len() as u64;
            // Three levels rise again: one that fail-safe values have interrupted, one whose answer was lost, and one
            // that is on when a new driver first sees it.
            let begins_anew = plan.events.iter().any(|event| match event.what {
                Misfortune::Kill(which, _) | Misfortune::Close(which, _) => which == end,
                _ => false,
            });
            let interrupts = begins_anew
                || plan.features.faults.iter().any(FaultPlan::is_of_line)
                || plan.watchdog(1 - end).is_some()
                || plan.bus == Bus::Dispatcher
                || end == 0 && !plan.ends[1].holds_while_stale;
            if seen > written && !plan.bus.asks() && !interrupts {
                shared.fail(Broken {
                    promise: "edges",
                    what: format!("end {end} saw {seen} rising edges of station {station}, and {written} were written"),
                });
            }
            for (index, pulse) in writer.pulses.iter().enumerate() {
                let window = *pulse..pulse.saturating_add(plan.pulses.0);
                // A pair is judged as one.
                let last = writer.pulses[..index].last();
                if last.is_some_and(|last| pulse - last < plan.pulses.0) {
                    continue;
                }
                let within = writer.pulses[index..].iter();
                let written = within.filter(|pulse| window.contains(pulse)).count() as u64;
                let before = pulse - plan.max_age.0 * 2;
                let is_well = before > well_since
                    && window.end < ended.0
                    && !readers.iter().any(|reader| {
                        reader
                            .stale
                            .iter()
                            .any(|at| (before..window.end).contains(at))
                    });
                let seen: u64 = edges
                    .iter()
                    .filter(|(at, _)| window.contains(at))
                    .map(|edge| edge.1)
                    .sum();
                if is_well && seen != written {
                    shared.fail(Broken {
                        promise: "pulses",
                        what: format!(
                            "end {end} saw {seen} rising edges of station {station} after {written} pulses from {pulse} on"
                        ),
                    });
                }
            }
        }
    }
}
