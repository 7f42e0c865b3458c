//! Plant and PLC in lock-step.

use tickbus_virtual_time::{
    Ended, Logic, Outcome, Participant, Settings, StartCondition, in_process,
};

use crate::metrics::Run;
use crate::participants::{Machine, Program, STEP, STEPS};

/// What the server is told: both must be there, and the run has an end.
pub fn settings() -> Settings {
    let names = ["plant", "plc"].map(str::to_owned).to_vec();
    Settings {
        steps: Some(STEPS as u64),
        ..Settings::new(STEP, StartCondition::Names(names))
    }
}

/// A run in this thread.
///
/// # Errors
///
/// Why there was none.
pub fn in_process(plc_first: bool) -> Result<(Run, Outcome), Ended> {
    let (mut machine, mut program) = (Machine::default(), Program::default());
    let mut participants: Vec<&mut dyn Participant> = vec![&mut machine, &mut program];
    if plc_first {
        participants.reverse();
    }
    let outcome = in_process::run(settings(), participants, Logic::new())?;
    Ok((machine.into_run(), outcome))
}
