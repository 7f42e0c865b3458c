//! A program scanned by the tick, in simulation time.

use std::sync::Arc;

use tickbus_base::time::{Manual, Nanos};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{BusError, LinkStatus, Port, Role, Stepped};
use tickbus_plc::Program;

use super::ScanCounters;
use super::cpu::{Cpu, half};

/// The most scans that one exchange catches up on: 1,000 s of scans every 10 ms. A longer step is taken for a
/// wrong time; scanning through it would block the tick for as long as that takes.
const MOST_SCANS: i64 = 100_000;

/// A hosted program scanned by the tick, in simulation time.
pub(crate) struct SteppedHost {
    cpu: Cpu,
    port: Port,
    interval: Nanos,
    /// When the next scan is due; `None` before the first exchange.
    due: Option<Nanos>,
    /// Whether the program was sent the machine's latest values.
    is_delivered: bool,
}

impl SteppedHost {
    pub(crate) fn new(
        program: Box<dyn Program>,
        config: &Config,
        interval: Nanos,
    ) -> (Self, Arc<ScanCounters>) {
        let max_age = config.timing.max_age;
        let (cpu, bus) = half(program, config, Role::Controller);
        let scan_counters = Arc::clone(&cpu.scan_counters);
        let status = LinkStatus::new(cpu.units[0].program.name(), max_age);
        let watches = config
            .life_signs
            .watches(&config.table, Role::Controller, max_age);
        let port =
            Port::new(bus, Manual::new(), Role::Controller, None, status).with_life_signs(watches);
        (
            Self {
                cpu,
                port,
                interval,
                due: None,
                is_delivered: false,
            },
            scan_counters,
        )
    }
}

/// Carries the frames that `from` sends over to `to`; false if an injected fault swallows them.
fn carry(from: &mut Port, to: &mut Port, now: Nanos) -> bool {
    let Some(mut frames) = from.take_all(now) else {
        return false;
    };
    for station in frames.stations() {
        to.received(station, now, frames.frame(station));
    }
    let receipt = frames.receipt();
    from.sent(&receipt);
    true
}

impl Stepped for SteppedHost {
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        port.running("the hosted program is there");
        self.is_delivered = carry(port, &mut self.port, now);
        Ok(())
    }

    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        port.running("the hosted program is there");
        let mut due = self.due.unwrap_or(now);
        let late = now - due;
        if late > self.interval.times(MOST_SCANS) {
            self.due = Some(now);
            return Err(BusError::Refused(format!(
                "simulation time jumped from {due} to {now}, over more than {MOST_SCANS} scans of the \
                 hosted program; hand in the nanoseconds since the simulation began, tick by tick",
            )));
        }
        // Counted rather than compared, since at the largest time the next scan would be due when the last
        // one was.
        let scans = if late < Nanos::ZERO {
            0
        } else if late < self.interval {
            // Nearly always, and a division takes its time.
            1
        } else {
            late.0 / self.interval.0 + 1
        };
        for _ in 0..scans {
            if self.is_delivered {
                // Between two ticks only simulation time passes: the machine is there all along, however
                // large the steps are.
                (0..self.port.stations()).for_each(|station| self.port.touch(station, due));
            }
            self.cpu.scan(due, true);
            due += self.interval;
        }
        self.due = Some(due);
        if port.is_up(now) {
            carry(&mut self.port, port, now);
        }
        Ok(due)
    }
}
