//! The common parts of the two programs: their commands, and the restart of their sequences after a fault.

use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use super::io::{Io, SignalIndex};
use super::options::Options;
use super::report::PeelerCounters;
use tickbus_axis::{AxisKind, Mode, Motion};
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Addressing, SignalTable};
use tickbus_plc::blocks::{AxisCommand, Ton};
use tickbus_plc::{Program, ProgramError, Report, Scan};

/// The time limit of a step, except for those that wait for a block or for the other program.
pub(super) const LIMIT: Nanos = Nanos::from_secs(30);
/// How long a clamp must stand still before its position is taken as final.
pub(super) const SETTLE: Nanos = Nanos::from_millis(100);
/// How long all axes must be healthy before a program starts over.
pub(super) const WELL: Nanos = Nanos::from_secs(1);

/// A motion to `position`, in mm, at the highest speed of the axes that position.
pub(super) const fn motion(position: f64, torque: f64) -> Motion<f64> {
    Motion {
        position,
        speed: 400.0,
        acceleration: 1_500.0,
        deceleration: 1_500.0,
        torque,
    }
}

/// A move to `position`.
pub(super) const fn to(position: f64) -> AxisCommand {
    AxisCommand {
        mode: Mode::Position,
        motion: motion(position, 0.0),
        number: 0,
    }
}

/// A move with this torque, in per cent, until something is in the way.
pub(super) const fn squeeze(mode: Mode, torque: f64) -> AxisCommand {
    AxisCommand {
        mode,
        motion: Motion {
            position: 0.0,
            speed: 0.0,
            acceleration: 0.0,
            deceleration: 0.0,
            torque,
        },
        number: 0,
    }
}

/// Finds a signal by its name.
pub(crate) type Find<'a> = dyn Fn(&str) -> Result<SignalIndex, ProgramError> + 'a;

/// The steps of one program.
pub(crate) trait Sequence: Debug + Send {
    /// The program's name.
    const NAME: &'static str;
    /// The axes, in the program's own order.
    const AXES: &'static [(&'static str, AxisKind)];
    /// The options.
    const OPTIONS: &'static [&'static str];

    /// Makes the sequence.
    fn new(options: Options) -> Self;

    /// Finds the signals by name.
    fn fit(&mut self, find: &Find<'_>) -> Result<(), ProgramError>;

    /// True if the sequence has to start over for another reason than a fault.
    fn begins_anew(
        &mut self,
        _io: &Io,
        _now: Nanos,
        _alive: bool,
        _tally: &PeelerCounters,
    ) -> bool {
        false
    }

    /// Starts over from the state that the sensors show.
    fn restart(&mut self, io: &mut Io);

    /// One scan with healthy axes. An error is a fault: all axes stop.
    fn step(&mut self, io: &mut Io, now: Nanos, counters: &PeelerCounters) -> Result<(), String>;

    /// Sets the signals other than the axes; `enable` is false while all axes are stopped.
    fn show(&self, io: &mut Io, enable: bool);
}

/// A PLC program of the line: a sequence, and the image that it works on.
#[derive(Debug)]
pub(crate) struct Sequenced<S> {
    sequence: S,
    hold: Option<Nanos>,
    io: Option<Io>,
    counters: Arc<PeelerCounters>,
    /// A fault has occurred, and no axis is enabled. Until the machine sends data, its health is unknown.
    failed: bool,
    well: Ton,
}

impl<S: Sequence> Sequenced<S> {
    /// The name in [`program`](crate::program).
    pub(crate) const NAME: &'static str = S::NAME;

    /// The program with its options.
    ///
    /// # Errors
    ///
    /// The option does not exist, or does not accept the value.
    pub(crate) fn from_options(options: &[(String, String)]) -> Result<Self, ProgramError> {
        let options = Options::read(S::NAME, S::OPTIONS, options)?;
        let counters = Arc::new(PeelerCounters::new(S::AXES.iter().map(|(name, _)| *name)));
        counters.asked.store(options.blocks.unwrap_or(0), Relaxed);
        Ok(Self {
            sequence: S::new(options),
            hold: options.hold,
            io: None,
            counters,
            failed: true,
            well: Ton::default(),
        })
    }

    /// One scan of the sequence; returns whether the axes are enabled.
    fn solve(&mut self, io: &mut Io, now: Nanos, alive: bool) -> bool {
        let anew = self.sequence.begins_anew(io, now, alive, &self.counters);
        // Without data nothing is known about the axes.
        let unhealthy = if alive { io.unhealthy() } else { 0 };
        self.counters.unhealthy.store(unhealthy, Relaxed);
        let well = self.well.call(now, alive && unhealthy == 0, WELL);
        if !alive || self.failed || anew {
            self.failed = !well || anew;
            if !self.failed {
                self.sequence.restart(io);
            }
            return false;
        }
        let done = if unhealthy == 0 {
            self.sequence.step(io, now, &self.counters)
        } else {
            self.counters.failed.fetch_or(unhealthy, Relaxed);
            Err(not_healthy(&self.counters.names(unhealthy)))
        };
        if let Err(wrong) = &done {
            log::warn!(
                "{}: {wrong}; all axes stop, and the sequence begins anew",
                S::NAME
            );
            self.failed = true;
            self.well = Ton::default();
            self.counters.faults.fetch_add(1, Relaxed);
        }
        done.is_ok()
    }
}

/// The fault of these axes.
fn not_healthy(axes: &[&str]) -> String {
    match axes {
        [axis] => format!("the axis \"{axis}\" is not healthy"),
        _ => format!("the axes \"{}\" are not healthy", axes.join("\", \"")),
    }
}

impl<S: Sequence> Program for Sequenced<S> {
    fn name(&self) -> &str {
        S::NAME
    }

    fn fit(&mut self, table: &SignalTable, _: Addressing) -> Result<(), ProgramError> {
        self.sequence.fit(&|name| Io::place(S::NAME, table, name))?;
        self.io = Some(Io::new(S::NAME, table, S::AXES, self.hold)?);
        self.failed = true;
        Ok(())
    }

    fn input_bytes(&self) -> usize {
        self.io.as_ref().map_or(0, |io| io.input_bytes)
    }

    fn output_bytes(&self) -> usize {
        self.io.as_ref().map_or(0, |io| io.output_bytes)
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        let Some(mut io) = self.io.take() else {
            return;
        };
        if io.begin(scan) {
            let enable = self.solve(&mut io, scan.now, scan.alive);
            self.sequence.show(&mut io, enable);
            io.end(scan, enable, &self.counters);
        }
        self.io = Some(io);
    }

    fn report(&self) -> Option<Arc<dyn Report>> {
        Some(Arc::clone(&self.counters) as _)
    }
}
