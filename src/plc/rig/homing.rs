//! Homing: lifts down, suction off, wheels to their index zero. Homing, recovering and finalising
//! all do this, the first two after acknowledging a fault.

use super::image::Inputs;
use super::image::command::{ACKNOWLEDGE, IM1_JOG, IM2_JOG, LA1_CODE, LA1_RUN, LA2_RUN};
use crate::plc::blocks::Ton;
use crate::time::Nanos;

/// How long Acknowledge stays on.
const PULSE: Nanos = Nanos::from_millis(100);
/// How long the machine may take to clear its fault.
const CLEAR_LIMIT: Nanos = Nanos::from_secs(2);
/// How long the lifts may take down.
const LIFTS_LIMIT: Nanos = Nanos::from_secs(10);
/// How long the wheels may take to their zero.
const WHEELS_LIMIT: Nanos = Nanos::from_secs(10);
/// How long switches must show before they are believed. A lift reaches the mechanical stop, and a
/// wheel comes to rest, only after its switch has come on.
const SETTLE: Nanos = Nanos::from_millis(300);
/// How long the suction cups take to let go, and a wheel that was indexing to come to rest.
const LET_GO: Nanos = Nanos::from_secs(1);

/// Where homing stands.
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
    /// The suction cups let go.
    LetGo,
    /// The wheels turn to their zero.
    Wheels,
    /// All is home.
    Done,
    /// It could not be done.
    Failed,
}

/// The homing sequence.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Homing {
    step: Step,
    /// This homing has acknowledged a fault, so the lift drives have lost their reference.
    unreferenced: bool,
    lower_1: bool,
    lower_2: bool,
    pulse: Ton,
    clear: Ton,
    lifts: Ton,
    landed: Ton,
    let_go: Ton,
    wheels: Ton,
    centred: Ton,
}

impl Homing {
    /// Begins anew, with an Acknowledge pulse or without.
    pub(super) fn begin(&mut self, acknowledge: bool, not_ok: bool) {
        self.step = if acknowledge {
            Step::Acknowledge
        } else {
            Step::Lifts
        };
        self.unreferenced = acknowledge && not_ok;
        self.lower_1 = false;
        self.lower_2 = false;
    }

    /// Stops, wherever it stands.
    pub(super) fn stop(&mut self) {
        self.step = Step::Idle;
        self.lower_1 = false;
        self.lower_2 = false;
    }

    /// Takes the sequence on by one scan.
    pub(super) fn call(&mut self, now: Nanos, inputs: Inputs) {
        // The timers see the step that the scan before has left.
        let step = self.step;
        let centred = inputs.home_1() && inputs.home_2();
        self.pulse.call(now, step == Step::Acknowledge, PULSE);
        self.clear.call(now, step == Step::Clear, CLEAR_LIMIT);
        self.lifts.call(now, step == Step::Lifts, LIFTS_LIMIT);
        self.landed
            .call(now, step == Step::Lifts && inputs.at_bottom(), SETTLE);
        self.let_go.call(now, step == Step::LetGo, LET_GO);
        self.wheels.call(now, step == Step::Wheels, WHEELS_LIMIT);
        self.centred
            .call(now, step == Step::Wheels && centred, SETTLE);

        self.step = match step {
            Step::Acknowledge if self.pulse.q => Step::Clear,
            Step::Clear if !inputs.not_ok() => Step::Lifts,
            Step::Clear if self.clear.q => Step::Failed,
            Step::Lifts if inputs.not_ok() && self.unreferenced => Step::Failed,
            // A drive that stands referenced in mid-path refuses to go further than its bottom
            // stop. Acknowledging takes its reference, and then it makes a reference run.
            Step::Lifts if inputs.not_ok() => {
                self.unreferenced = true;
                Step::Acknowledge
            }
            Step::Lifts if self.landed.q => Step::LetGo,
            Step::Lifts if self.lifts.q => Step::Failed,
            Step::LetGo if inputs.not_ok() => Step::Failed,
            Step::LetGo if self.let_go.q => Step::Wheels,
            Step::Wheels if inputs.not_ok() || !inputs.at_bottom() => Step::Failed,
            Step::Wheels if self.centred.q => Step::Done,
            Step::Wheels if self.wheels.q => Step::Failed,
            other => other,
        };

        // A lift that is at its bottom already is left alone: referenced, it would run into its
        // stop. One that is not keeps running after its switch, to the stop.
        let lowering = self.step == Step::Lifts;
        self.lower_1 = lowering && (self.lower_1 || !inputs.la1_bottom());
        self.lower_2 = lowering && (self.lower_2 || !inputs.la2_bottom());
    }

    /// The bits of the command word that homing needs in this scan.
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

    /// The lifts are down, so the suction cups need not hold any more.
    pub(super) fn lets_go(&self) -> bool {
        matches!(self.step, Step::LetGo | Step::Wheels | Step::Done)
    }

    /// All is home.
    pub(super) fn done(&self) -> bool {
        self.step == Step::Done
    }

    /// It could not be done.
    pub(super) fn failed(&self) -> bool {
        self.step == Step::Failed
    }
}
