//! Plant and PLC in lock-step.

use std::io;

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_net::Address;
#[cfg(unix)]
use tickbus_virtual_time::shared_memory;
use tickbus_virtual_time::{
    Cause, Controls, Ended, Hosting, Logic, Meeting, Outcome, Participant, Settings,
    StartCondition, in_process, tcp,
};

use crate::metrics::Run;
use crate::participants::{Machine, Program, STEP, STEPS};

/// Returns the server's settings: both participants must be there, and the run has an end.
pub fn settings() -> Settings {
    let names = ["plant", "plc"].map(str::to_owned).to_vec();
    Settings {
        steps: Some(STEPS as u64),
        // Limited, so that the run ends if a client cannot be started.
        join: Nanos::from_secs(60),
        ..Settings::new(STEP, StartCondition::Names(names))
    }
}

/// Makes a run in this thread.
///
/// # Errors
///
/// Returns why there was no run.
pub fn in_process(plc_first: bool) -> Result<(Run, Outcome), Ended> {
    let (mut machine, mut program) = (Machine::default(), Program::default());
    let mut participants: Vec<&mut dyn Participant> = vec![&mut machine, &mut program];
    if plc_first {
        participants.reverse();
    }
    let outcome = in_process::run(settings(), participants, Logic::new())?;
    Ok((machine.into_run(), outcome))
}

/// Takes part in a run at its server.
///
/// # Errors
///
/// There is no server, it refuses this client, or the run was broken off.
pub fn join(server: &Meeting, participant: &mut dyn Participant) -> Result<Outcome, Ended> {
    match server {
        Meeting::Tcp(address) => tcp::join(address, participant),
        Meeting::Unix(address) => tcp::join_local(address, participant),
        #[cfg(unix)]
        Meeting::SharedMemory(name) => shared_memory::join(name, participant),
        #[cfg(not(unix))]
        Meeting::SharedMemory(_) => Err(system("there is no shared memory on this system")),
    }
}

/// Makes a run with a server in this process; with port 0 the system chooses the port. `clients` starts both clients
/// with the server's address, and returns when they are done.
///
/// # Errors
///
/// Returns why there was no run.
pub fn served<T>(at: Meeting, clients: impl FnOnce(&Meeting) -> T) -> Result<(T, Outcome), Ended> {
    type Serve = Box<dyn FnOnce(Hosting<'_>) -> Result<Outcome, Ended> + Send>;
    let cannot = |error: io::Error| system(&format!("no server can be started: {error}"));
    let (at, serve): (Meeting, Serve) = match at {
        Meeting::Tcp(address) => {
            let listener = tcp::Listener::bind(&address).map_err(cannot)?;
            let port = listener.address().port();
            let serve = |hosting: Hosting<'_>| listener.run(settings(), Logic::new(), hosting);
            (Meeting::Tcp(Address { port, ..address }), Box::new(serve))
        }
        Meeting::Unix(address) => {
            let listener = tcp::Listener::bind_local(&address).map_err(cannot)?;
            let serve = |hosting: Hosting<'_>| listener.run(settings(), Logic::new(), hosting);
            (Meeting::Unix(address), Box::new(serve))
        }
        #[cfg(unix)]
        Meeting::SharedMemory(name) => {
            let listener = shared_memory::Listener::bind(&name, &settings()).map_err(cannot)?;
            let serve = |hosting: Hosting<'_>| listener.run(settings(), Logic::new(), hosting);
            (Meeting::SharedMemory(name), Box::new(serve))
        }
        #[cfg(not(unix))]
        Meeting::SharedMemory(_) => return Err(system("there is no shared memory on this system")),
    };
    std::thread::scope(|scope| {
        let server = scope.spawn(|| {
            serve(Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            })
        });
        let done = clients(&at);
        let outcome = server.join().expect("the server does not panic")?;
        Ok((done, outcome))
    })
}

fn system(reason: &str) -> Ended {
    Ended {
        cause: Cause::System,
        client: None,
        reason: reason.to_owned(),
        steps: 0,
    }
}
