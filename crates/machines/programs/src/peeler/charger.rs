//! The program "charger": feeds blocks, centres them, and hands them to the lathe.
//!
//! Three chains run in parallel, each waiting for what the others leave behind:
//!
//! | chain | steps |
//! |---|---|
//! | feeding | the gate lets a block onto step 1; a stroke of the step feeder takes every block one step on |
//! | centring | the linear feeder brings a block; its two ends are measured; the spindles rise to its axis, grip it, lift it and bring it to the transfer arm |
//! | transfer | the clamps take it; the arm brings it to the lathe once that is ready, releases it when the lathe holds it, and returns |

use std::sync::atomic::Ordering::Relaxed;

use super::io::{Axis, Io, SignalIndex};
use super::options::Options;
use super::report::PeelerCounters;
use super::sequence::{Find, LIMIT, SETTLE, Sequence, Sequenced, squeeze, to};
use tickbus_axis::{AxisKind, Mode};
use tickbus_base::time::Nanos;
use tickbus_plc::ProgramError;
use tickbus_plc::blocks::{AxisCommand, Simulation, SimulationTime, Ton};

/// The axes, in the program's own order.
const AXES: [(&str, AxisKind); 12] = [
    ("step feeder", AxisKind::Position),
    ("linear feeder", AxisKind::Position),
    ("centring spindle left", AxisKind::Position),
    ("centring spindle right", AxisKind::Position),
    ("centring x left", AxisKind::Position),
    ("centring y left", AxisKind::Position),
    ("centring x right", AxisKind::Position),
    ("centring y right", AxisKind::Position),
    ("transfer arm", AxisKind::Position),
    ("transfer clamp left", AxisKind::Torque),
    ("transfer clamp right", AxisKind::Torque),
    ("charger gate", AxisKind::Torque),
];

const STEP_FEEDER: usize = 0;
const LINEAR_FEEDER: usize = 1;
const SPINDLES: [usize; 2] = [2, 3];
const X: [usize; 2] = [4, 6];
const Y: [usize; 2] = [5, 7];
const ARM: usize = 8;
const CLAMPS: [usize; 2] = [9, 10];
const GATE: usize = 11;

/// Positions, in mm.
const STROKE: f64 = 400.0;
const PICK_UP: f64 = 650.0;
const SPINDLES_OPEN: f64 = 700.0;
const SPINDLES_GRIP: f64 = 640.0;
const OVER_FEEDER: f64 = 300.0;
const LIFTED: f64 = 280.0;
const ARM_BACK: f64 = 900.0;
const ARM_CLEAR: f64 = 400.0;
const CLAMPS_OPEN: f64 = 690.0;

/// The height in mm above a V-block of 90 degrees from which the sensors look down on a block.
const SENSOR_HEIGHT: f64 = 800.0;

/// The pressure that holds a block, in per cent.
const CLAMP_TORQUE: f64 = 60.0;
const GATE_TORQUE: f64 = 30.0;

/// A simulation whose time stands still for this long has stopped.
const FROZEN: Nanos = Nanos::from_secs(1);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Feeding {
    /// Nothing has been done yet: all axes move to their rest positions.
    #[default]
    Rest,
    Waiting,
    GateOpens,
    GateCloses,
    Up,
    Down,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Centring {
    /// The spindles release the block.
    #[default]
    Release,
    /// All axes move to where the next block is awaited.
    Home,
    Waiting,
    Carry,
    Measure,
    Rise,
    Grip,
    Lift,
    Present,
    /// The block is at the clamps.
    Held,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Transfer {
    /// The clamps open, the arm goes back.
    #[default]
    Home,
    Waiting,
    Grab,
    /// The arm moves back with a block of unknown position.
    Return,
    AwaitLathe,
    ToLathe,
    Presented,
    Open,
}

/// The current step of a chain, and when it began.
#[derive(Clone, Copy, Debug, Default)]
struct Chain<S> {
    step: S,
    since: Option<Nanos>,
}

impl<S: Copy + PartialEq> Chain<S> {
    fn go(&mut self, step: S) {
        self.step = step;
        self.since = None;
    }

    /// How long the step has lasted so far.
    fn lasts(&mut self, now: Nanos) -> Nanos {
        now - *self.since.get_or_insert(now)
    }
}

/// The signals other than the axes.
#[derive(Clone, Copy, Debug, Default)]
struct Signals {
    /// Steps 1 to 4, linear feeder, centring spindles, clamps, gate.
    blocks: [SignalIndex; 8],
    distances: [SignalIndex; 2],
    time: SignalIndex,
    presented: SignalIndex,
    clear: SignalIndex,
    lathe_ready: SignalIndex,
    lathe_holds: SignalIndex,
}

/// The charger's program, described at the [module](self). Its options are `hold` and `blocks`.
pub(crate) type Charger = Sequenced<Chains>;

/// The three chains.
#[derive(Debug, Default)]
pub(crate) struct Chains {
    places: Signals,
    time: SimulationTime,
    clamped: Ton,
    feeding: Chain<Feeding>,
    centring: Chain<Centring>,
    transfer: Chain<Transfer>,
    /// The heights of the block's axis at its two ends.
    heights: [f64; 2],
}

/// The height of a block's axis above the V, from the sensor's distance to its top.
fn axis_height(distance: f64) -> f64 {
    let root = std::f64::consts::SQRT_2;
    let radius = (SENSOR_HEIGHT - distance) / (1.0 + root);
    (radius * root).clamp(0.0, LIFTED)
}

impl Chains {
    fn feed(&mut self, io: &mut Io, now: Nanos) -> Nanos {
        let on = |block: usize| io.is_on(self.places.blocks[block]);
        let (first, last, next) = (on(0), on(3), on(7));
        let any = (0..3).any(on);
        let linear_free = !on(4)
            && self.centring.step == Centring::Waiting
            && (io.axes[LINEAR_FEEDER].inputs.position - PICK_UP).abs() < 1.0;
        let lasts = self.feeding.lasts(now);
        let axes = &mut io.axes;
        match self.feeding.step {
            Feeding::Rest => {
                axes[GATE].want(squeeze(Mode::Close, GATE_TORQUE));
                axes[STEP_FEEDER].want(to(0.0));
                if axes[STEP_FEEDER].is_done() && axes[GATE].inputs.position < 1.0 {
                    self.feeding.go(Feeding::Waiting);
                }
            }
            Feeding::Waiting => {
                if !first && next {
                    axes[GATE].want(squeeze(Mode::Open, GATE_TORQUE));
                    self.feeding.go(Feeding::GateOpens);
                } else if (last && linear_free) || (!last && any) {
                    axes[STEP_FEEDER].want(to(STROKE));
                    self.feeding.go(Feeding::Up);
                }
                return Nanos::ZERO;
            }
            Feeding::GateOpens if first => {
                axes[GATE].want(squeeze(Mode::Close, GATE_TORQUE));
                self.feeding.go(Feeding::GateCloses);
            }
            Feeding::GateCloses if axes[GATE].stands() && axes[GATE].inputs.position < 1.0 => {
                self.feeding.go(Feeding::Waiting);
            }
            Feeding::Up if axes[STEP_FEEDER].is_done() => {
                axes[STEP_FEEDER].want(to(0.0));
                self.feeding.go(Feeding::Down);
            }
            Feeding::Down if axes[STEP_FEEDER].is_done() => self.feeding.go(Feeding::Waiting),
            _ => {}
        }
        lasts
    }

    fn centre(&mut self, io: &mut Io, now: Nanos) -> Nanos {
        let on = |block: usize| io.is_on(self.places.blocks[block]);
        let (on_feeder, held) = (on(4), on(5));
        let distances = self.places.distances.map(|place| io.value(place));
        let lasts = self.centring.lasts(now);
        let axes = &mut io.axes;
        let mut both = |pair: [usize; 2], command: [AxisCommand; 2]| {
            for (axis, command) in pair.into_iter().zip(command) {
                axes[axis].want(command);
            }
            pair.into_iter().all(|axis| axes[axis].is_done())
        };
        let pair = |position| [to(position); 2];
        let next = match self.centring.step {
            Centring::Release => both(SPINDLES, pair(SPINDLES_OPEN)).then_some(Centring::Home),
            Centring::Home => {
                let down = both(Y, pair(0.0));
                let over = both(X, pair(OVER_FEEDER));
                axes[LINEAR_FEEDER].want(to(PICK_UP));
                (down && over && axes[LINEAR_FEEDER].is_done()).then_some(Centring::Waiting)
            }
            Centring::Waiting => {
                // A block that has just fallen onto the feeder is still supported by the step feeder's
                // stroke.
                if !on_feeder || self.feeding.step != Feeding::Waiting {
                    return Nanos::ZERO;
                }
                axes[LINEAR_FEEDER].want(to(0.0));
                Some(Centring::Carry)
            }
            Centring::Carry => axes[LINEAR_FEEDER].is_done().then_some(Centring::Measure),
            Centring::Measure => (lasts >= SETTLE).then(|| {
                self.heights = distances.map(axis_height);
                Centring::Rise
            }),
            Centring::Rise => both(Y, self.heights.map(to)).then_some(Centring::Grip),
            Centring::Grip => {
                for axis in SPINDLES {
                    axes[axis].want(to(SPINDLES_GRIP));
                }
                let grips = SPINDLES.into_iter().all(|axis| axes[axis].stands());
                (held && grips).then_some(Centring::Lift)
            }
            Centring::Lift => {
                let lifted = both(Y, pair(LIFTED));
                if lifted && self.transfer.step != Transfer::Waiting {
                    // There is room for one block at the clamps: this one waits until the arm is back and
                    // empty.
                    return Nanos::ZERO;
                }
                lifted.then_some(Centring::Present)
            }
            Centring::Present => {
                let there = both(X, pair(0.0));
                axes[LINEAR_FEEDER].want(to(PICK_UP));
                (there && axes[LINEAR_FEEDER].is_done()).then_some(Centring::Held)
            }
            Centring::Held => {
                // The clamps have the block when the transfer is in the step that awaits the lathe.
                if self.transfer.step != Transfer::AwaitLathe {
                    return Nanos::ZERO;
                }
                Some(Centring::Release)
            }
        };
        if let Some(next) = next {
            self.centring.go(next);
        }
        lasts
    }

    fn hand_over(&mut self, io: &mut Io, now: Nanos, counters: &PeelerCounters) -> Nanos {
        let clamped = io.is_on(self.places.blocks[6]);
        let (ready, holds) = (
            io.is_on(self.places.lathe_ready),
            io.is_on(self.places.lathe_holds),
        );
        let lasts = self.transfer.lasts(now);
        let axes = &mut io.axes;
        let clamps = |axes: &mut [Axis], mode| {
            for clamp in CLAMPS {
                axes[clamp].want(squeeze(mode, CLAMP_TORQUE));
            }
        };
        let arm_to = |axes: &mut [Axis], position: f64| {
            let mut command = to(position);
            command.motion.speed = 600.0;
            axes[ARM].want(command);
            axes[ARM].is_done()
        };
        let stand = CLAMPS.into_iter().all(|clamp| axes[clamp].stands());
        let opened = CLAMPS
            .into_iter()
            .all(|clamp| axes[clamp].inputs.position > CLAMPS_OPEN);
        let next = match self.transfer.step {
            Transfer::Home => {
                clamps(axes, Mode::Open);
                // With closed jaws the arm would take the block along.
                (opened && arm_to(axes, ARM_BACK)).then_some(Transfer::Waiting)
            }
            Transfer::Waiting => {
                if self.centring.step != Centring::Held {
                    return Nanos::ZERO;
                }
                clamps(axes, Mode::Close);
                Some(Transfer::Grab)
            }
            Transfer::Grab => self
                .clamped
                .call(now, stand && clamped, SETTLE)
                .then_some(Transfer::AwaitLathe),
            Transfer::Return => {
                clamps(axes, Mode::Close);
                arm_to(axes, ARM_BACK).then_some(Transfer::AwaitLathe)
            }
            Transfer::AwaitLathe => {
                let let_go = !matches!(self.centring.step, Centring::Held | Centring::Release);
                // A lathe that holds something is not ready: one of its two signals is broken.
                if !ready || holds || !let_go {
                    return Nanos::ZERO;
                }
                arm_to(axes, 0.0);
                Some(Transfer::ToLathe)
            }
            Transfer::ToLathe => {
                clamps(axes, Mode::Close);
                arm_to(axes, 0.0).then_some(Transfer::Presented)
            }
            Transfer::Presented => {
                if !holds {
                    return Nanos::ZERO;
                }
                clamps(axes, Mode::Open);
                Some(Transfer::Open)
            }
            Transfer::Open => (stand && opened).then(|| {
                counters.blocks.fetch_add(1, Relaxed);
                Transfer::Home
            }),
        };
        if self.transfer.step != Transfer::Grab {
            self.clamped = Ton::default();
        }
        if let Some(next) = next {
            self.transfer.go(next);
        }
        lasts
    }
}

impl Sequence for Chains {
    const NAME: &'static str = "charger";
    const AXES: &'static [(&'static str, AxisKind)] = &AXES;
    const OPTIONS: &'static [&'static str] = &Options::CHARGER;

    fn new(_: Options) -> Self {
        Self::default()
    }

    fn fit(&mut self, find: &Find<'_>) -> Result<(), ProgramError> {
        let places = &mut self.places;
        for (number, block) in places.blocks.iter_mut().enumerate() {
            *block = find(&format!("block at feeder step {}", number + 1))?;
        }
        places.distances = [
            find("pre-centring distance 1")?,
            find("pre-centring distance 2")?,
        ];
        places.time = find("simulation time")?;
        places.presented = find("block presented")?;
        places.clear = find("transfer clear")?;
        places.lathe_ready = find("lathe ready")?;
        places.lathe_holds = find("lathe holds block")?;
        Ok(())
    }

    fn begins_anew(&mut self, io: &Io, now: Nanos, alive: bool, counters: &PeelerCounters) -> bool {
        let time = alive.then(|| io.value(self.places.time));
        let simulation = self.time.call(now, time, FROZEN);
        if self.time.restarted {
            counters.restarts.fetch_add(1, Relaxed);
            log::info!("charger: the simulation was started again; beginning anew");
        }
        self.time.restarted || simulation == Simulation::Unknown
    }

    /// Starts over from the state that the sensors show.
    fn restart(&mut self, io: &mut Io) {
        io.forget();
        let on = |block: usize| io.is_on(self.places.blocks[block]);
        let held = on(5);
        let clamped = on(6);
        let at_lathe = io.axes[ARM].inputs.position < 1.0;
        self.feeding.go(Feeding::Rest);
        // At the clamps' position both hold the same block; anywhere else the spindles hold another one.
        let with_clamps = clamped
            && X.into_iter()
                .all(|axis| io.axes[axis].inputs.position < 1.0);
        self.centring.go(if held && !with_clamps {
            Centring::Lift
        } else {
            Centring::Release
        });
        self.transfer.go(match (clamped, at_lathe) {
            (true, true) => Transfer::ToLathe,
            (true, false) => Transfer::Return,
            (false, _) => Transfer::Home,
        });
    }

    fn step(&mut self, io: &mut Io, now: Nanos, counters: &PeelerCounters) -> Result<(), String> {
        if self.time.state == Simulation::Stopped {
            // No chain progresses, but that is not a time-out.
            self.feeding.since = None;
            self.centring.since = None;
            self.transfer.since = None;
            return Ok(());
        }
        let spans = [
            self.feed(io, now),
            self.centre(io, now),
            self.hand_over(io, now, counters),
        ];
        if spans.into_iter().any(|span| span > LIMIT) {
            return Err(format!(
                "a step takes too long: {:?}, {:?}, {:?}",
                self.feeding.step, self.centring.step, self.transfer.step
            ));
        }
        Ok(())
    }

    fn show(&self, io: &mut Io, enable: bool) {
        let shown = enable && matches!(self.transfer.step, Transfer::Presented | Transfer::Open);
        let clear = enable && io.axes[ARM].inputs.position > ARM_CLEAR;
        io.switch(self.places.presented, shown);
        io.switch(self.places.clear, clear);
    }
}
