//! Times in a driver.cfg that are valid one by one, and contradict each other.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::Role;

use crate::Config;
use crate::loopback::{Mode, Options, Peer};

impl Config {
    /// The times that contradict each other, each with what to do: the driver works, though not as its author expects.
    pub fn contradictions(&self) -> Vec<Mistake> {
        let mut found = Vec::new();
        let timing = &self.timing;
        let max_age = timing.max_age;
        if let Some(cycle) = timing.cycle.or(self.bus.cycle()) {
            if max_age < cycle.times(2) {
                found.push(Mistake::new(
                    format!("max_age is {max_age}, less than two bus cycles of {cycle}: one late cycle makes all data stale"),
                    format!("set max_age to {} or more", cycle.times(3)),
                ));
            }
            if let Some(watchdog) = timing.watchdog.filter(|watchdog| *watchdog < cycle) {
                found.push(Mistake::new(
                    format!(
                        "watchdog is {watchdog}, shorter than one bus cycle of {cycle}: the peer can get fail-safe \
                         values while the simulation ticks once in each cycle"
                    ),
                    format!("set watchdog to {} or more, or shorten the cycle", cycle.times(3)),
                ));
            }
        }
        let loopback = self.bus.downcast_ref::<Options>();
        if let Some(Options {
            mode,
            peer: Peer::Program {
                scan: Some(scan), ..
            },
            ..
        }) = loopback
        {
            self.of_scan(*scan, *mode, &mut found);
        }
        found
    }

    /// Adds the contradictions of a hosted program that is scanned so often.
    fn of_scan(&self, scan: Nanos, mode: Mode, found: &mut Vec<Mistake>) {
        let timing = &self.timing;
        let max_age = timing.max_age;
        if scan > max_age {
            found.push(Mistake::new(
                format!(
                    "scan is {scan}, longer than max_age of {max_age}: a program that has stopped is noticed after two \
                     scans only"
                ),
                format!("set max_age to {} or more, or scan more often", scan.times(2)),
            ));
        }
        if let Some(watchdog) = timing
            .watchdog
            .filter(|watchdog| *watchdog < scan && self.role == Role::Device)
        {
            found.push(Mistake::new(
                format!(
                    "watchdog is {watchdog}, shorter than one scan of {scan}: a simulation that ticks once in each scan \
                     counts as stopped"
                ),
                format!("set watchdog to {} or more", scan.times(2)),
            ));
        }
        let cycle = timing.cycle.or(self.bus.cycle());
        if let Some(cycle) = cycle.filter(|cycle| mode == Mode::Free && *cycle > scan) {
            found.push(Mistake::new(
                format!(
                    "scan is {scan}, shorter than one bus cycle of {cycle}: several scans see the same inputs, and an \
                     output that is on for one scan does not reach the machine"
                ),
                format!("set cycle to {scan} or less, or latch for such outputs"),
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(fieldbus: &str) -> Vec<String> {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n{fieldbus}\n\
             [[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n"
        );
        let config = Config::parse("driver.cfg", &text, &crate::KINDS);
        let config = config.unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let found = config.contradictions();
        found.iter().map(Mistake::to_string).collect()
    }

    #[test]
    fn each_contradiction_is_named_with_what_to_do() {
        for (fieldbus, words) in [
            ("", &[] as &[&str]),
            ("cycle = \"10ms\"\nmax_age = \"20ms\"", &[]),
            (
                "cycle = \"10ms\"\nmax_age = \"19ms\"",
                &[
                    "less than two bus cycles of 10ms",
                    "set max_age to 30ms or more",
                ],
            ),
            (
                "cycle = \"1s\"\nwatchdog = \"900ms\"\nmode = \"stepped\"",
                &[
                    "watchdog is 900ms, shorter than one bus cycle of 1s",
                    "set watchdog to 3s or more",
                ],
            ),
            (
                "scan = \"300ms\"\nmax_age = \"250ms\"",
                &[
                    "scan is 300ms, longer than max_age of 250ms",
                    "set max_age to 600ms or more",
                ],
            ),
            (
                "scan = \"200ms\"\nwatchdog = \"150ms\"",
                &[
                    "watchdog is 150ms, shorter than one scan of 200ms",
                    "set watchdog to 400ms",
                ],
            ),
            (
                "scan = \"5ms\"\ncycle = \"10ms\"",
                &[
                    "scan is 5ms, shorter than one bus cycle of 10ms",
                    "set cycle to 5ms or less",
                ],
            ),
            ("scan = \"5ms\"\ncycle = \"10ms\"\nmode = \"stepped\"", &[]),
        ] {
            let found = found(fieldbus);
            assert_eq!(
                found.len(),
                usize::from(!words.is_empty()),
                "{fieldbus}: {found:?}"
            );
            for word in words {
                assert!(found[0].contains(word), "{fieldbus}: {found:?}");
            }
        }
    }
}
