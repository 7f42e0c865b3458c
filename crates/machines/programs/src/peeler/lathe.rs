//! The program "lathe": takes a block between its spindles, peels it, and drops the core.
//!
//! | step | what happens | leads on when |
//! |---|---|---|
//! | home | everything opens and draws back | all is there |
//! | ready | the charger may come | a block is presented |
//! | clamp | the spindles close | both have stood on the block for 100 ms |
//! | clear | the charger releases it and draws back | nothing of it is in the way |
//! | approach | knife and rolls come near, the block begins to turn | it turns |
//! | round up | the knife takes a thick veneer per turn, the rolls follow | the block is round |
//! | peel | veneer | the core is reached |
//! | retract | knife and rolls draw back, the core stops | it stands |
//! | drop | the spindles open over the core drop | they are open |
//!
//! While peeling, the program keeps the speed of the veneer constant by adapting the spindle speed to the
//! knife's position: a new command whenever the speed is off by more than 1 %, as often as `Execute` permits.

use std::f64::consts::TAU;
use std::sync::atomic::Ordering::Relaxed;

use super::io::{Axis, Io, SignalIndex};
use super::options::Options;
use super::report::PeelerCounters;
use super::sequence::{Find, LIMIT, SETTLE, Sequence, Sequenced, WELL, motion, squeeze, to};
use tickbus_axis::{AxisKind, Mode, Motion};
use tickbus_base::time::Nanos;
use tickbus_plc::ProgramError;
use tickbus_plc::blocks::{AxisCommand, Ton};

/// The axes, in the program's own order.
const AXES: [(&str, AxisKind); 13] = [
    ("spindle left", AxisKind::Torque),
    ("spindle right", AxisKind::Torque),
    ("spindle rotation", AxisKind::Speed),
    ("knife carriage", AxisKind::Tracking),
    ("pitch angle", AxisKind::Tracking),
    ("nosebar", AxisKind::Position),
    ("top roll", AxisKind::Tracking),
    ("bottom roll left", AxisKind::Tracking),
    ("bottom roll right", AxisKind::Tracking),
    ("roll rotation", AxisKind::Tracking),
    ("veneer gate", AxisKind::Torque),
    ("round-up gate", AxisKind::Torque),
    ("core drop", AxisKind::Torque),
];

const SPINDLES: [usize; 2] = [0, 1];
const ROTATION: usize = 2;
const KNIFE: usize = 3;
const PITCH: usize = 4;
const NOSEBAR: usize = 5;
const ROLLS: [usize; 3] = [6, 7, 8];
const ROLL_ROTATION: usize = 9;
const VENEER_GATE: usize = 10;
const ROUND_UP_GATE: usize = 11;
const CORE_DROP: usize = 12;

/// Positions, in mm from the axis of the block.
const BACK: f64 = 300.0;
const CLEAR_OF_BLOCK: f64 = 250.0;
const APPROACH: f64 = 160.0;
const ROLLS_APPROACH: f64 = 165.0;
const ROUND: f64 = 125.0;
const CORE: f64 = 40.0;
/// From here on the knife does not obstruct a falling core.
const CLEAR_OF_CORE: f64 = 100.0;
const SPINDLES_OPEN: f64 = 690.0;
/// The positions of spindles with a block between them.
const ON_BLOCK: std::ops::RangeInclusive<f64> = 600.0..=690.0;
const NOSEBAR_BACK: f64 = 20.0;
const NOSEBAR_CLOSE: f64 = 2.0;

/// The pressure for clamping a block, the one for holding it, and that of the gates, in per cent.
const CLAMP_TORQUE: f64 = 80.0;
const HOLD_TORQUE: f64 = 40.0;
const GATE_TORQUE: f64 = 30.0;
/// How much faster than the block the rolls turn, in per cent.
const ROLL_LEAD: f64 = 2.0;

/// Thickness removed per turn while rounding up a block, in mm.
const ROUND_UP: f64 = 3.0;

/// Turns per second: at the beginning, and at most.
const FIRST_TURNS: f64 = 2.0;
const MOST_TURNS: f64 = 12.0;
/// The relative deviation from which on the speed is corrected.
const SPEED_BAND: f64 = 0.01;

const PEEL_LIMIT: Nanos = Nanos::from_secs(90);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Step {
    #[default]
    Home,
    Ready,
    Clamp,
    Clear,
    Approach,
    RoundUp,
    Peel,
    Retract,
    Drop,
}

/// The signals other than the axes.
#[derive(Clone, Copy, Debug, Default)]
struct Signals {
    ready: SignalIndex,
    holds: SignalIndex,
    presented: SignalIndex,
    clear: SignalIndex,
}

/// The lathe's program, described at the [module](self). Its options are `hold`, `blocks`, `peeling_speed` and
/// `thickness`.
pub(crate) type Lathe = Sequenced<Steps>;

/// The chain of steps.
#[derive(Debug, Default)]
pub(crate) struct Steps {
    options: Options,
    places: Signals,
    clamped: Ton,
    step: Step,
    since: Option<Nanos>,
    /// The spindles hold a block that the charger may release.
    holds: bool,
    /// The last commanded turns per second.
    turns: f64,
}

/// Tracking with this offset; the meaning of `torque` depends on the axis.
const fn track(offset: f64, torque: f64) -> AxisCommand {
    AxisCommand {
        mode: Mode::Tracking,
        motion: motion(offset, torque),
        number: 0,
    }
}

/// Turning endlessly at `turns` turns per second.
const fn turn(turns: f64) -> AxisCommand {
    AxisCommand {
        mode: Mode::Speed,
        motion: Motion {
            position: 1e9,
            speed: turns,
            acceleration: 4.0,
            deceleration: 4.0,
            torque: 0.0,
        },
        number: 0,
    }
}

fn gate(axes: &mut [Axis], axis: usize, open: bool) {
    let mode = if open { Mode::Open } else { Mode::Close };
    axes[axis].want(squeeze(mode, GATE_TORQUE));
}

impl Steps {
    fn go(&mut self, step: Step) {
        self.step = step;
        self.since = None;
    }

    /// The turns per second at which the veneer has its speed, given the knife's position.
    fn wanted_turns(&self, axes: &[Axis]) -> f64 {
        let radius = axes[KNIFE].inputs.position.max(1.0);
        (self.options.peeling_speed / (TAU * radius)).min(MOST_TURNS)
    }

    /// Corrects the speed of the veneer.
    fn keep_speed(&mut self, axes: &mut [Axis], wanted: f64) {
        let off = (wanted - self.turns).abs() > SPEED_BAND * wanted;
        if off && axes[ROTATION].control.is_ready() {
            self.turns = wanted;
            axes[ROTATION].repeat(turn(wanted));
        }
    }

    fn draw_back(axes: &mut [Axis]) -> bool {
        for axis in [KNIFE, ROLLS[0], ROLLS[1], ROLLS[2]] {
            axes[axis].want(to(BACK));
        }
        axes[NOSEBAR].want(to(NOSEBAR_BACK));
        axes[PITCH].want(to(0.0));
        for axis in [ROTATION, ROLL_ROTATION] {
            axes[axis].release();
        }
        gate(axes, VENEER_GATE, false);
        gate(axes, ROUND_UP_GATE, false);
        axes[KNIFE].inputs.position > CLEAR_OF_CORE && axes[ROTATION].inputs.speed.abs() < 0.01
    }

    /// Knife and rolls approach, and the block starts to turn.
    fn come_near(&mut self, axes: &mut [Axis]) {
        // The block is gripped: with less pressure it does not crack.
        for axis in SPINDLES {
            axes[axis].want(squeeze(Mode::Close, HOLD_TORQUE));
        }
        gate(axes, ROUND_UP_GATE, true);
        axes[NOSEBAR].want(to(NOSEBAR_CLOSE));
        axes[KNIFE].want(to(APPROACH));
        for axis in ROLLS {
            axes[axis].want(to(ROLLS_APPROACH));
        }
        self.turns = FIRST_TURNS;
        axes[ROTATION].repeat(turn(FIRST_TURNS));
    }

    /// Lets knife and rolls track once they are in position and the block turns; returns whether they do.
    fn begin_to_peel(axes: &mut [Axis]) -> bool {
        let there = [KNIFE, ROLLS[0], ROLLS[1], ROLLS[2]]
            .into_iter()
            .all(|axis| axes[axis].is_done());
        let turns = axes[ROTATION].inputs.speed.abs() > 0.9 * FIRST_TURNS;
        if there && turns {
            for axis in [ROLLS[0], ROLLS[1], ROLLS[2], PITCH] {
                axes[axis].want(track(0.0, 0.0));
            }
            axes[ROLL_ROTATION].want(track(0.0, ROLL_LEAD));
            axes[KNIFE].want(track(0.0, ROUND_UP));
        }
        there && turns
    }

    /// One scan of the sequence; returns how long the step has lasted, if that is limited, and its limit.
    fn sequence(&mut self, io: &mut Io, now: Nanos, counters: &PeelerCounters) -> (Nanos, Nanos) {
        let lasts = now - *self.since.get_or_insert(now);
        let (presented, clear) = (io.is_on(self.places.presented), io.is_on(self.places.clear));
        let axes = &mut io.axes;
        let open = SPINDLES
            .into_iter()
            .all(|axis| axes[axis].inputs.position > SPINDLES_OPEN);
        let stand = SPINDLES.into_iter().all(|axis| axes[axis].stands());
        let on_block = SPINDLES
            .into_iter()
            .all(|axis| ON_BLOCK.contains(&axes[axis].inputs.position));
        let spindles = |axes: &mut [Axis], mode, torque| {
            for axis in SPINDLES {
                axes[axis].want(squeeze(mode, torque));
            }
        };
        let wanted = self.wanted_turns(axes);
        let clamping = self.step == Step::Clamp && stand && on_block;
        let clamped = self.clamped.call(now, clamping, SETTLE);
        let next = match self.step {
            Step::Home => {
                gate(axes, CORE_DROP, false);
                spindles(axes, Mode::Open, HOLD_TORQUE);
                let still = Self::draw_back(axes);
                let back = axes[KNIFE].inputs.position >= CLEAR_OF_BLOCK;
                (still && back && open && stand).then_some(Step::Ready)
            }
            Step::Ready => {
                if !presented {
                    return (Nanos::ZERO, LIMIT);
                }
                Some(Step::Clamp)
            }
            Step::Clamp => {
                spindles(axes, Mode::Close, CLAMP_TORQUE);
                clamped.then(|| {
                    self.holds = true;
                    Step::Clear
                })
            }
            Step::Clear => {
                if presented || !clear {
                    return (Nanos::ZERO, LIMIT);
                }
                self.come_near(axes);
                Some(Step::Approach)
            }
            Step::Approach => Self::begin_to_peel(axes).then_some(Step::RoundUp),
            Step::RoundUp => {
                self.keep_speed(axes, wanted);
                (axes[KNIFE].inputs.position <= ROUND).then(|| {
                    gate(axes, VENEER_GATE, true);
                    gate(axes, ROUND_UP_GATE, false);
                    axes[KNIFE].want(track(0.0, self.options.thickness));
                    Step::Peel
                })
            }
            Step::Peel => {
                self.keep_speed(axes, wanted);
                // During the first turns the drive is still accelerating.
                if lasts > WELL && wanted < MOST_TURNS {
                    counters
                        .kept
                        .sample(axes[ROTATION].inputs.speed.abs(), wanted);
                }
                (axes[KNIFE].inputs.position <= CORE).then_some(Step::Retract)
            }
            Step::Retract => Self::draw_back(axes).then(|| {
                gate(axes, CORE_DROP, true);
                Step::Drop
            }),
            Step::Drop => {
                if axes[CORE_DROP].stands() {
                    spindles(axes, Mode::Open, HOLD_TORQUE);
                }
                (open && stand).then(|| {
                    self.holds = false;
                    counters.blocks.fetch_add(1, Relaxed);
                    Step::Home
                })
            }
        };
        let most = if self.step == Step::Peel || self.step == Step::RoundUp {
            PEEL_LIMIT
        } else {
            LIMIT
        };
        if let Some(next) = next {
            self.go(next);
        }
        (lasts, most)
    }
}

impl Sequence for Steps {
    const NAME: &'static str = "lathe";
    const AXES: &'static [(&'static str, AxisKind)] = &AXES;
    const OPTIONS: &'static [&'static str] = &Options::LATHE;

    fn new(options: Options) -> Self {
        Self {
            options,
            ..Self::default()
        }
    }

    fn fit(&mut self, find: &Find<'_>) -> Result<(), ProgramError> {
        self.places = Signals {
            ready: find("lathe ready")?,
            holds: find("lathe holds block")?,
            presented: find("block presented")?,
            clear: find("transfer clear")?,
        };
        Ok(())
    }

    /// Starts over. A block between the spindles is clamped again if the charger presents it; otherwise it counts as a
    /// core. A core is not reported as held, so that a charger that also holds it keeps it.
    fn restart(&mut self, io: &mut Io) {
        io.forget();
        self.turns = 0.0;
        self.holds = false;
        let on_block = SPINDLES
            .into_iter()
            .all(|axis| ON_BLOCK.contains(&io.axes[axis].inputs.position));
        let presented = io.is_on(self.places.presented);
        self.go(match (on_block, presented) {
            (true, true) => Step::Clamp,
            (true, false) => Step::Retract,
            (false, _) => Step::Home,
        });
    }

    fn step(&mut self, io: &mut Io, now: Nanos, counters: &PeelerCounters) -> Result<(), String> {
        let step = self.step;
        let (lasts, most) = self.sequence(io, now, counters);
        if lasts > most {
            return Err(format!("the step {step:?} takes too long"));
        }
        Ok(())
    }

    fn show(&self, io: &mut Io, enable: bool) {
        io.switch(self.places.ready, enable && self.step == Step::Ready);
        io.switch(self.places.holds, self.holds);
    }
}
