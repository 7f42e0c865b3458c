//! The report of the two programs: commands per axis, blocks, and the precision of the veneer's speed.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering::Relaxed};

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_plc::Report;

const SECOND: i64 = 1_000_000_000;

/// The progress of a program. Written by its scans, which never wait; read by its host.
#[derive(Debug)]
pub(crate) struct PeelerCounters {
    axes: Box<[AxisTally]>,
    /// Blocks passed on.
    pub(super) blocks: AtomicU64,
    /// The program is done after this many blocks; 0 for never.
    pub(super) asked: AtomicU64,
    /// How often a fault made the sequence start over.
    pub(super) faults: AtomicU64,
    /// The axes that are not healthy now, a bit for each, and those that have stopped the sequence so far.
    pub(super) unhealthy: AtomicU64,
    pub(super) failed: AtomicU64,
    /// How often the simulation was restarted.
    pub(super) restarts: AtomicU64,
    /// The deviations from the speed, if the program controls one.
    pub(super) kept: Kept,
}

/// Deviations from a speed, in thousandths of it.
#[derive(Debug, Default)]
pub(super) struct Kept {
    samples: AtomicU64,
    squares: AtomicU64,
    most: AtomicU64,
}

/// The commands of one axis.
#[derive(Debug)]
pub(super) struct AxisTally {
    name: &'static str,
    commands: AtomicU64,
    /// Shortest time between two commands; 0 before the second.
    least: AtomicI64,
    last: AtomicI64,
    /// The start of the second being counted, and the commands in it.
    second: AtomicI64,
    in_second: AtomicU64,
    /// Commands in the busiest second.
    busiest: AtomicU64,
}

impl AxisTally {
    /// Counts a command at `now`.
    pub(super) fn count(&self, now: Nanos) {
        if self.commands.fetch_add(1, Relaxed) > 0 {
            let span = now.0 - self.last.load(Relaxed);
            let least = self.least.load(Relaxed);
            if least == 0 || span < least {
                self.least.store(span, Relaxed);
            }
        }
        self.last.store(now.0, Relaxed);
        if now.0 - self.second.load(Relaxed) >= SECOND || self.in_second.load(Relaxed) == 0 {
            self.second.store(now.0, Relaxed);
            self.in_second.store(0, Relaxed);
        }
        let count = self.in_second.fetch_add(1, Relaxed) + 1;
        self.busiest.fetch_max(count, Relaxed);
    }
}

impl Kept {
    /// Adds the deviation of `actual` from `wanted`.
    pub(super) fn sample(&self, actual: f64, wanted: f64) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative, and saturating"
        )]
        let off = ((actual / wanted - 1.0).abs() * 1_000.0).round() as u64;
        self.samples.fetch_add(1, Relaxed);
        self.squares.fetch_add(off.saturating_mul(off), Relaxed);
        self.most.fetch_max(off, Relaxed);
    }

    /// Root mean square and maximum, in per cent; `None` before the first sample.
    #[expect(clippy::cast_precision_loss, reason = "for people")]
    fn per_cent(&self) -> Option<(f64, f64)> {
        let samples = self.samples.load(Relaxed);
        let mean = self.squares.load(Relaxed) as f64 / samples as f64;
        (samples > 0).then(|| (mean.sqrt() / 10.0, self.most.load(Relaxed) as f64 / 10.0))
    }
}

impl PeelerCounters {
    pub(super) fn new(axes: impl Iterator<Item = &'static str>) -> Self {
        let axis = |name| AxisTally {
            name,
            commands: AtomicU64::new(0),
            least: AtomicI64::new(0),
            last: AtomicI64::new(0),
            second: AtomicI64::new(0),
            in_second: AtomicU64::new(0),
            busiest: AtomicU64::new(0),
        };
        Self {
            axes: axes.map(axis).collect(),
            blocks: AtomicU64::new(0),
            asked: AtomicU64::new(0),
            faults: AtomicU64::new(0),
            unhealthy: AtomicU64::new(0),
            failed: AtomicU64::new(0),
            restarts: AtomicU64::new(0),
            kept: Kept::default(),
        }
    }

    /// The axes, in the program's own order.
    pub(super) fn axes(&self) -> impl Iterator<Item = &AxisTally> {
        self.axes.iter()
    }

    /// The names of these axes, of which each is a bit.
    pub(super) fn names(&self, axes: u64) -> Vec<&'static str> {
        let named = self.axes.iter().enumerate();
        let named = named.filter(|(index, _)| axes >> index & 1 == 1);
        named.map(|(_, axis)| axis.name).collect()
    }

    /// The busiest axis: its name, its most commands within a second, and the shortest time between two.
    fn busiest(&self) -> Option<(&'static str, u64, Nanos)> {
        let busiest = self
            .axes
            .iter()
            .max_by_key(|axis| axis.busiest.load(Relaxed))?;
        Some((
            busiest.name,
            busiest.busiest.load(Relaxed),
            Nanos(busiest.least.load(Relaxed)),
        ))
    }

    fn commands(&self) -> u64 {
        self.axes
            .iter()
            .map(|axis| axis.commands.load(Relaxed))
            .sum()
    }
}

impl Report for PeelerCounters {
    fn write(&self, statistics: &mut Statistics) {
        statistics.count("peeler.blocks", self.blocks.load(Relaxed));
        statistics.count("peeler.faults", self.faults.load(Relaxed));
        for (key, axes) in [
            ("peeler.not_healthy", &self.unhealthy),
            ("peeler.failed_axes", &self.failed),
        ] {
            let names = self.names(axes.load(Relaxed));
            if !names.is_empty() {
                statistics.text(key, &names.join(", "));
            }
        }
        statistics.count("peeler.restarts", self.restarts.load(Relaxed));
        statistics.count("peeler.commands", self.commands());
        for axis in &self.axes {
            let mut count = |of: &str, count| {
                statistics.count(format!("peeler.{of}.{}", axis.name), count);
            };
            count("commands", axis.commands.load(Relaxed));
            count("commands_per_s", axis.busiest.load(Relaxed));
            count(
                "command_interval_us",
                axis.least.load(Relaxed).unsigned_abs() / 1_000,
            );
        }
        if let Some((mean, most)) = self.kept.per_cent() {
            statistics.number("peeler.speed_error_rms_percent", mean, 2);
            statistics.number("peeler.speed_error_max_percent", most, 1);
        }
    }

    fn summary(&self) -> String {
        let mut text = format!(
            "blocks {}, faults {}, restarts of the simulation {}, commands {}\n",
            self.blocks.load(Relaxed),
            self.faults.load(Relaxed),
            self.restarts.load(Relaxed),
            self.commands(),
        );
        let failed = self.names(self.failed.load(Relaxed));
        if !failed.is_empty() {
            let _ = writeln!(text, "axes that were not healthy: {}", failed.join(", "));
        }
        if let Some((name, count, least)) = self.busiest().filter(|(_, count, _)| *count > 0) {
            let _ = writeln!(
                text,
                "busiest axis \"{name}\": {count} commands in one second, {least} between two at least"
            );
        }
        if let Some((mean, most)) = self.kept.per_cent() {
            let _ = writeln!(
                text,
                "speed of the veneer kept to {mean:.2} % (root mean square), {most:.1} % at worst"
            );
        }
        text
    }

    fn is_done(&self) -> bool {
        let asked = self.asked.load(Relaxed);
        asked > 0 && self.blocks.load(Relaxed) >= asked
    }

    fn failure(&self) -> Option<String> {
        None
    }
}
