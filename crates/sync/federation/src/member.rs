//! A federation as a member of a run: the loop that is the same for every engine.

use tickbus_base::time::{Nanos, Stop};
use tickbus_image::signal::DataType;
use tickbus_virtual_time::client::{Asked, Connection};
use tickbus_virtual_time::{Cause, Ended, Outcome, Step};

use crate::mapping::{Engine, Mapping};

/// A federation that has begun.
pub(crate) trait Federation {
    /// Runs one step: publishes `reads`, goes to the time of the step, and leaves in `writes` what was published before.
    ///
    /// # Errors
    ///
    /// Why the run has to end.
    fn step(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String>;
}

/// Runs until the end. A server that sends nothing for `timeout` hangs.
pub(crate) fn run<E: Engine>(
    mut connection: Connection,
    mapping: &Mapping<E>,
    timeout: Nanos,
    federation: &mut dyn Federation,
) -> Result<Outcome, Ended> {
    let mut writes: Vec<u64> = mapping.subscribe.iter().map(|one| one.initial).collect();
    loop {
        let ran = match connection.wait(timeout)? {
            Asked::Initial => check_types(mapping, connection.client().read_types()),
            Asked::Step(step) => federation.step(step, connection.client().reads(), &mut writes),
            Asked::End(outcome) => return outcome,
        };
        match ran {
            Ok(()) => connection.answer(&writes),
            // The server answers with the end.
            Err(reason) => connection.give_up(&reason),
        }
    }
}

/// The types of the run's variables are those of the mapping.
fn check_types<E: Engine>(mapping: &Mapping<E>, found: &[DataType]) -> Result<(), String> {
    let mut all = mapping.publish.iter().zip(found);
    match all.find(|(own, found)| own.data_type != **found) {
        Some((own, found)) => Err(format!(
            "publishes \"{}\" as {}, but that is {found}; write type = \"{found}\"",
            own.variable, own.data_type
        )),
        None => Ok(()),
    }
}

/// The end of a client that has not run a step.
pub(crate) fn ended(stop: &Stop, client: &str, reason: String) -> Ended {
    let cause = if stop.is_stopped() {
        Cause::Stopped
    } else {
        Cause::Failed
    };
    Ended {
        cause,
        client: Some(client.to_owned()),
        reason,
        steps: 0,
    }
}
