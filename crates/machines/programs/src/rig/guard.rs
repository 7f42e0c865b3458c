//! The conditions that stop a running rig: jams, locked wheels, and a "complete" that comes too early.

use super::image::Inputs;
use super::image::command::{IM1_INDEX, IM1_JOG, IM2_INDEX, IM2_JOG};
use tickbus_base::time::Nanos;
use tickbus_plc::blocks::Ton;

/// A beam interrupted for longer than this is a jam. The machine itself reports it after 1 s.
const JAM: Nanos = Nanos::from_millis(1_500);

/// A step that is reported as complete sooner than this was reported before it began: the machine drops "complete" when it
/// gets the word of the next step, and its shortest motion takes 0.4 s.
pub(super) const EARLY: Nanos = Nanos::from_millis(50);

/// Watches the package sensors while the drum turns.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct JamGuard {
    beam_1: Ton,
    beam_2: Ton,
}

impl JamGuard {
    /// Returns whether a bottle is stuck in a beam.
    pub(super) fn call(&mut self, now: Nanos, running: bool, inputs: Inputs) -> bool {
        let jam_1 = self.beam_1.call(now, running && inputs.package_1(), JAM);
        let jam_2 = self.beam_2.call(now, running && inputs.package_2(), JAM);
        jam_1 || jam_2
    }
}

/// True if `command` would turn a wheel through a lift.
///
/// Every turn requires both lifts to be at their bottom switches, except indexing wheel 2: it passes under
/// lift 2, and is done while lift 1 is in its sleeve.
pub(super) fn wheel_locked(command: u16, inputs: Inputs) -> bool {
    let any_lift = command & (IM1_INDEX | IM1_JOG | IM2_JOG) != 0;
    let lift_2 = command & IM2_INDEX != 0;
    (any_lift && !inputs.at_bottom()) || (lift_2 && !inputs.la2_bottom())
}
