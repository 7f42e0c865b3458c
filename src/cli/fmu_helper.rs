//! `tickbus fmu-helper`: the process that runs an FMU for its host.

use super::Outcome;

pub(super) fn run() -> Outcome {
    match tickbus_fmi::foreign::serve() {
        Ok(()) => Outcome::Done,
        Err(error) => {
            eprintln!("fmu-helper: {error}");
            Outcome::Usage
        }
    }
}
