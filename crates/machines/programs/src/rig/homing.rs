//! Homing: lifts down, suction off, wheels to their index zero. The phases home, recover and finalise all do
//! this, the first two after acknowledging a fault.
//!
//! The first two also bring down a bottle that may be in the sleeve over lift 1. No sensor tells whether a
//! cycle was interrupted between handing a bottle over and taking the other one back, and a program that was
//! just started has no memory; but step 2 must find that sleeve empty. The stroke is harmless in every other
//! case: while a bottle is in the pocket under lift 1, nothing has been handed over, and it goes up into an
//! empty sleeve and comes down again.

use super::guard::EARLY;
use super::image::Inputs;
use super::image::command::{
    ACKNOWLEDGE, IM1_JOG, IM2_JOG, LA1_CODE, LA1_RUN, LA2_RUN, SC1, SUCTION,
};
use tickbus_base::time::Nanos;
use tickbus_plc::blocks::Ton;

/// How long Acknowledge stays on.
const PULSE: Nanos = Nanos::from_millis(100);
/// How long the machine may take to clear its fault.
const CLEAR_LIMIT: Nanos = Nanos::from_secs(2);
/// How long the lifts may take to go down.
const LIFTS_LIMIT: Nanos = Nanos::from_secs(10);
/// How long the wheels may take to reach their zero.
const WHEELS_LIMIT: Nanos = Nanos::from_secs(10);
/// How long lift 1 may take up to the sleeve, or down again.
const FETCH_LIMIT: Nanos = Nanos::from_secs(5);
/// How long switches must be on before homing continues. A lift reaches the mechanical stop, and a wheel
/// comes to rest, only after its switch has come on.
const SETTLE: Nanos = Nanos::from_millis(300);
/// As [`SETTLE`], for a jogged wheel that something will pass through: it stops anywhere inside its homing
/// window, from where its drive creeps to the index position.
const CREEP: Nanos = Nanos::from_millis(1_500);
/// How long the suction cups take to release, and an indexing wheel to come to rest.
const LET_GO: Nanos = Nanos::from_secs(1);

/// The step of homing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Step {
    /// Nothing to do.
    #[default]
    Idle,
    /// The Acknowledge pulse.
    Acknowledge,
    /// Waits until the machine has cleared its fault.
    Clear,
    /// The lifts go down.
    Lifts,
    /// The suction cups release.
    LetGo,
    /// The wheels turn to their zero.
    Wheels,
    /// Lift 1 goes up to the sleeve, with suction.
    Fetch,
    /// Lift 1 comes down with whatever it has found.
    Bring,
    /// Homing is complete.
    Done,
    /// Homing has failed.
    Failed,
}

/// The homing sequence.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a coil of its own")]
pub(super) struct Homing {
    step: Step,
    /// This homing has acknowledged a fault, so that the lift drives have lost their reference.
    unreferenced: bool,
    /// Homing ends by bringing down any bottle in the sleeve over lift 1.
    fetches: bool,
    /// A wheel was off its homing sensor.
    jogged: bool,
    lower_1: bool,
    lower_2: bool,
    pulse: Ton,
    clear: Ton,
    lifts: Ton,
    landed: Ton,
    let_go: Ton,
    wheels: Ton,
    centred: Ton,
    fetch: Ton,
    bring: Ton,
    brought: Ton,
}

impl Homing {
    /// Starts over, with or without an Acknowledge pulse; `fetches` if a cycle may follow.
    pub(super) fn begin(&mut self, acknowledge: bool, not_ok: bool, fetches: bool) {
        self.step = if acknowledge {
            Step::Acknowledge
        } else {
            Step::Lifts
        };
        self.unreferenced = acknowledge && not_ok;
        self.fetches = fetches;
        self.jogged = false;
        self.lower_1 = false;
        self.lower_2 = false;
    }

    /// Stops at any step.
    pub(super) fn stop(&mut self) {
        self.step = Step::Idle;
        self.lower_1 = false;
        self.lower_2 = false;
    }

    /// Advances the sequence by one scan.
    pub(super) fn call(&mut self, now: Nanos, inputs: Inputs) {
        // The timers get the step as of the end of the previous scan.
        let step = self.step;
        let centred = inputs.home_1() && inputs.home_2();
        self.pulse.call(now, step == Step::Acknowledge, PULSE);
        self.clear.call(now, step == Step::Clear, CLEAR_LIMIT);
        self.lifts.call(now, step == Step::Lifts, LIFTS_LIMIT);
        self.landed
            .call(now, step == Step::Lifts && inputs.at_bottom(), SETTLE);
        self.let_go.call(now, step == Step::LetGo, LET_GO);
        self.wheels.call(now, step == Step::Wheels, WHEELS_LIMIT);
        self.jogged |= step == Step::Wheels && !centred;
        let settle = if self.jogged && self.fetches {
            CREEP
        } else {
            SETTLE
        };
        self.centred
            .call(now, step == Step::Wheels && centred, settle);
        self.fetch.call(now, step == Step::Fetch, FETCH_LIMIT);
        self.bring.call(now, step == Step::Bring, FETCH_LIMIT);
        self.brought
            .call(now, step == Step::Bring && inputs.la1_bottom(), SETTLE);

        self.step = match step {
            Step::Acknowledge if self.pulse.q => Step::Clear,
            Step::Clear if !inputs.not_ok() => Step::Lifts,
            Step::Clear if self.clear.q => Step::Failed,
            Step::Lifts if inputs.not_ok() && self.unreferenced => Step::Failed,
            // A referenced drive refuses to move beyond its bottom stop from the middle of its path.
            // Acknowledging clears its reference, and then it makes a reference run.
            Step::Lifts if inputs.not_ok() => {
                self.unreferenced = true;
                Step::Acknowledge
            }
            Step::Lifts if self.landed.q => Step::LetGo,
            Step::Lifts if self.lifts.q => Step::Failed,
            Step::LetGo | Step::Fetch | Step::Bring if inputs.not_ok() => Step::Failed,
            Step::LetGo if self.let_go.q => Step::Wheels,
            Step::Wheels if inputs.not_ok() || !inputs.at_bottom() => Step::Failed,
            Step::Wheels if self.centred.q && self.fetches => Step::Fetch,
            Step::Wheels if self.centred.q => Step::Done,
            Step::Wheels if self.wheels.q => Step::Failed,
            // Broken feedback: there before the lift can be, or together with the bottom switch.
            Step::Fetch if inputs.fetched() && (self.fetch.et < EARLY || inputs.la1_bottom()) => {
                Step::Failed
            }
            Step::Fetch if inputs.fetched() => Step::Bring,
            Step::Fetch if self.fetch.q => Step::Failed,
            Step::Bring if self.brought.q => Step::Done,
            Step::Bring if self.bring.q => Step::Failed,
            other => other,
        };

        // A lift already at its bottom is not moved: referenced, it would run into its stop. Any other lift
        // keeps running past its switch, to the stop.
        let lowering = self.step == Step::Lifts;
        self.lower_1 = lowering && (self.lower_1 || !inputs.la1_bottom());
        self.lower_2 = lowering && (self.lower_2 || !inputs.la2_bottom());
    }

    /// The bits of the command word needed by homing in this scan.
    pub(super) fn command(&self, inputs: Inputs) -> u16 {
        let mut word = 0;
        if self.step == Step::Acknowledge {
            word |= ACKNOWLEDGE;
        }
        if self.lower_1 {
            word |= LA1_RUN | LA1_CODE;
        }
        if self.lower_2 {
            word |= LA2_RUN;
        }
        match self.step {
            // The same word as in step 2, so that the machine reports completion by that step's bit.
            Step::Fetch => word |= LA1_RUN,
            Step::Bring => word |= LA1_RUN | LA1_CODE,
            _ => {}
        }
        if self.step == Step::Wheels && inputs.at_bottom() {
            if !inputs.home_1() {
                word |= IM1_JOG;
            }
            if !inputs.home_2() {
                word |= IM2_JOG;
            }
        }
        word
    }

    /// The suction cups that hold: those in `held` keep holding until the lifts are down.
    pub(super) fn suction(&self, held: u16) -> u16 {
        match self.step {
            Step::LetGo | Step::Wheels | Step::Done => 0,
            Step::Fetch | Step::Bring => SC1,
            _ => held & SUCTION,
        }
    }

    /// Homing is complete.
    pub(super) fn done(&self) -> bool {
        self.step == Step::Done
    }

    /// Homing has failed.
    pub(super) fn failed(&self) -> bool {
        self.step == Step::Failed
    }
}
