//! Plant and PLC in lock-step.

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_fieldbus::tcp::Address;
use tickbus_virtual_time::tcp::Listener;
use tickbus_virtual_time::{
    Cause, Controls, Ended, Hosting, Logic, Outcome, Participant, Settings, StartCondition,
    in_process,
};

use crate::metrics::Run;
use crate::participants::{Machine, Program, STEP, STEPS};

/// What the server is told: both must be there, and the run has an end.
pub fn settings() -> Settings {
    let names = ["plant", "plc"].map(str::to_owned).to_vec();
    Settings {
        steps: Some(STEPS as u64),
        // So that a client that cannot be started ends the run.
        join: Nanos::from_secs(60),
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

/// A run over TCP, with a server in this process: `clients` starts both at its address, and returns when they are done.
///
/// # Errors
///
/// Why there was none.
pub fn over_tcp<T>(clients: impl FnOnce(&Address) -> T) -> Result<(T, Outcome), Ended> {
    let listener = Listener::bind(&Address::local(0)).map_err(|error| Ended {
        cause: Cause::System,
        client: None,
        reason: format!("no port can be listened on: {error}"),
        steps: 0,
    })?;
    let address = Address::local(listener.address().port());
    std::thread::scope(|scope| {
        let server = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            listener.run(settings(), Logic::new(), hosting)
        });
        let done = clients(&address);
        let outcome = server.join().expect("the server does not panic")?;
        Ok((done, outcome))
    })
}
