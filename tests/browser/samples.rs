//! Sample runs.

use tickbus::report::{Mark, MarkKind, Run, SignalKind};
use tickbus::time::Nanos;

/// Pseudo-random numbers, the same in every run.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}

pub(crate) fn mark(at: i64, until: Option<i64>, kind: MarkKind, text: &str) -> Mark {
    Mark {
        at: Nanos::from_millis(at),
        until: until.map(Nanos::from_millis),
        kind,
        of: String::new(),
        text: text.to_owned(),
    }
}

/// A machine with 24 bools, 7 positions and a step, which runs for `ticks` ticks of a millisecond.
#[expect(clippy::cast_precision_loss, reason = "small numbers")]
pub(crate) fn machine(ticks: i64, budget: usize) -> Run {
    let mut run = Run::new(budget);
    let mut random = Random(1);
    for number in 0..24 {
        run.add_signal(&format!("Valve {number} open"), SignalKind::Bool, "");
    }
    for number in 0..7 {
        run.add_signal(&format!("Axis {number} position"), SignalKind::Real, "mm");
    }
    let step = run.add_signal("Step", SignalKind::Real, "");
    let mut valves = [false; 24];
    for tick in 0..ticks {
        let now = Nanos::from_millis(tick);
        run.tick(now);
        for (number, open) in valves.iter_mut().enumerate() {
            let every = 20 + 40 * number as u64;
            *open ^= random.below(every) == 0;
            run.change(number, now, f64::from(u8::from(*open)));
        }
        for axis in 0..7_u8 {
            // An INT from 0 to 27648 for 0 to 250 mm, as from a noisy sensor.
            let phase = tick as f64 / (200.0 * f64::from(axis + 1));
            let raw = (13_824.0 + 13_000.0 * phase.sin() + random.below(9) as f64).round();
            run.change(24 + usize::from(axis), now, raw * 250.0 / 27_648.0);
        }
        run.change(step, now, (tick / 400 % 7) as f64);
    }
    for (at, text) in [
        (0, "live"),
        (ticks / 3, "stale: nothing new for longer than max_age"),
        (ticks * 2 / 5, "live"),
    ] {
        run.mark(mark(at, None, MarkKind::Link, text));
    }
    run.mark(mark(
        ticks / 2,
        Some(ticks / 2 + ticks / 20),
        MarkKind::Fault,
        "Not OK",
    ));
    run.mark(mark(
        ticks * 4 / 5,
        Some(ticks * 4 / 5 + 12),
        MarkKind::Gap,
        "12 ticks were dropped",
    ));
    run
}
