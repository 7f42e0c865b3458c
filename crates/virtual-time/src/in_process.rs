//! Clients in this process: the same server, without a connection.

use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};

use crate::logic::Logic;
use crate::server::{Server, ToClient};
use crate::{Cause, Ended, Outcome, Participant, Settings};

/// Runs these participants, one after another in each step, until the run ends.
///
/// The start condition of `settings` must fit them. A run that begins paused, or has no number of steps, does not end
/// by itself: use a [`Server`] for that.
///
/// # Errors
///
/// Why there was no run, or why it was broken off.
pub fn run(
    settings: Settings,
    participants: Vec<&mut dyn Participant>,
    logic: Logic<'_>,
) -> Result<Outcome, Ended> {
    let clock = Monotonic::shared();
    if settings.paused {
        let reason = "a run in one process cannot begin paused: nobody could resume it";
        return Err(Ended::before(Cause::Configuration, reason));
    }
    let mut server = Server::new(settings, logic, clock.now())
        .map_err(|mistake| Ended::before(Cause::Configuration, mistake.to_string()))?;
    let mut seats: Vec<Seat<'_>> = Vec::new();
    for participant in participants {
        let declaration = participant.declare();
        let writes = vec![0; declaration.writes.len()];
        let seat = server.connected(Nanos::ZERO);
        debug_assert_eq!(seat, seats.len(), "seats are given in order");
        seats.push(Seat {
            participant,
            writes,
        });
        server.join(Nanos::ZERO, seat, declaration);
    }
    let mut refused = None;
    loop {
        while let Some((at, message)) = server.poll() {
            let Seat {
                participant,
                writes,
            } = &mut seats[at];
            let (sequence, ran) = match message {
                ToClient::Start { .. } => {
                    participant.initial(writes);
                    (0, Ok(()))
                }
                ToClient::Step { step, reads } => {
                    (step.sequence, participant.run(step, reads, writes))
                }
                ToClient::End(outcome) => {
                    if let Err(ended) = outcome {
                        refused.get_or_insert_with(|| ended.clone());
                    }
                    continue;
                }
            };
            // No one can hang without hanging this thread, so the time matters to the pacing alone.
            match ran {
                Ok(()) => server.done(Nanos::ZERO, at, sequence, writes.iter().copied()),
                Err(reason) => server.gave_up(at, &reason),
            }
        }
        if let Some(outcome) = server.outcome() {
            return outcome.clone();
        }
        if let Some(missing) = server.missing() {
            let reason = format!("the start condition still waits for {missing}");
            return Err(refused.unwrap_or(Ended::before(Cause::Configuration, reason)));
        }
        clock.wait_until(server.deadline(), &Stop::new());
        server.tick(clock.now());
    }
}

struct Seat<'p> {
    participant: &'p mut dyn Participant,
    writes: Vec<u64>,
}
