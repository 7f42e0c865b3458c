//! All clients in this process: the same server, without a connection.

use tickbus_base::time::{Clock as _, Monotonic, Stop};

use crate::local::Locals;
use crate::logic::Logic;
use crate::server::Server;
use crate::{Cause, Ended, Outcome, Pacing, Participant, Settings, saved_run};

/// Runs these participants, one after another in each step, until the run ends.
///
/// The start condition of `settings` must fit the participants. A run without a number of steps ends when a participant
/// or the logic fails; use a [`Server`] to control a run from outside.
///
/// # Errors
///
/// Why there was no run, or why it was broken off.
pub fn run(
    settings: Settings,
    participants: Vec<&mut dyn Participant>,
    logic: Logic<'_>,
) -> Result<Outcome, Ended> {
    if settings.paused {
        let reason = "a run in one process cannot begin paused: nobody could resume it";
        return Err(Ended::before(Cause::Configuration, reason));
    }
    let clock = Monotonic::shared();
    // A participant that hangs blocks this thread, so without pacing nothing needs the time.
    let is_paced = settings.pacing != Pacing::Fast;
    let mut now = clock.now();
    let mut server = Server::new(settings, logic, now)
        .map_err(|mistake| Ended::before(Cause::Configuration, mistake.to_string()))?;
    let mut locals = Locals::join(&mut server, now, participants);
    let mut has_begun = false;
    loop {
        while let Some((seat, message)) = server.poll() {
            locals.take(seat, &message);
        }
        let saved = server.take_saved().zip(server.saved_to());
        let written = saved.map(|(saved, file)| {
            let (_, content) = saved?;
            saved_run::write(file, &content).map_err(|error| format!("{}: {error}", file.display()))
        });
        if let Some(Err(why)) = written
            && !matches!(server.outcome(), Some(Err(_)))
        {
            let reason = format!("the run was not saved: {why}");
            return Err(Ended::before(Cause::System, reason));
        }
        if let Some(outcome) = server.outcome() {
            return outcome.clone();
        }
        if !has_begun {
            has_begun = true;
            // Report a participant that is left out.
            if let Some(refused) = locals.refusal() {
                return Err(refused.clone());
            }
            if let Some(missing) = server.missing() {
                let reason = format!("the start condition still waits for {missing}");
                return Err(Ended::before(Cause::Configuration, reason));
            }
        }
        if is_paced {
            now = clock.now();
        }
        if !locals.run(&mut server, now) {
            clock.wait_until(server.deadline(), &Stop::new());
            server.tick(clock.now());
        }
    }
}
