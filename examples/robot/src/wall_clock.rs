//! Plant and PLC really free-wheeling: threads that sleep, and an OPC link between them that also sleeps.

use std::sync::{Mutex, PoisonError};

use tickbus_base::time::{Clock, Nanos, Pace, Stop};

use crate::controller::{CYCLE_MILLIS, command};
use crate::free_wheeling::FRAME_MILLIS;
use crate::metrics::Run;
use crate::path::{Path, Point};
use crate::plant::Plant;

/// The values that each side has written, and those that the link has handed over to the other side.
#[derive(Debug, Default)]
struct Exchange {
    position: Point,
    position_seen: Point,
    command: Point,
    command_seen: Point,
}

/// Runs `steps` milliseconds of simulation time, which takes about as long in real time, with an OPC link that hands
/// over at every `update`. No two runs are the same.
pub fn run(clock: &dyn Clock, update: Nanos, steps: usize) -> Run {
    let exchange = Mutex::new(Exchange::default());
    // The values are plain numbers, which stay valid whichever thread panicked.
    let locked = || exchange.lock().unwrap_or_else(PoisonError::into_inner);
    let stop = Stop::new();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let path = Path::default();
            let start = clock.now();
            at_each(clock, Nanos::from_millis(CYCLE_MILLIS), &stop, |now| {
                let mut values = locked();
                values.command = command(&path, now - start, values.position_seen);
            });
        });
        scope.spawn(|| {
            at_each(clock, update, &stop, |_| {
                let mut values = locked();
                values.position_seen = values.position;
                values.command_seen = values.command;
            });
        });
        let mut plant = Plant::default();
        let mut run = Run::with_capacity(steps);
        while run.len() < steps {
            // A simulation waits for its next frame; its computing time adds to the frame time.
            clock.wait_until(clock.now() + Nanos::from_millis(FRAME_MILLIS), &stop);
            let command = locked().command_seen;
            for _ in 0..FRAME_MILLIS.unsigned_abs().min((steps - run.len()) as u64) {
                plant.step(command);
                run.push(plant.position());
            }
            locked().position = plant.position();
        }
        stop.stop();
        run
    })
}

/// Calls `act` at even intervals until stopped.
fn at_each(clock: &dyn Clock, interval: Nanos, stop: &Stop, mut act: impl FnMut(Nanos)) {
    let mut pace = Pace::new(clock.now(), interval);
    while !stop.is_stopped() {
        let now = clock.now();
        if pace.take(now) {
            act(now);
        }
        clock.wait_until(pace.due(), stop);
    }
}
