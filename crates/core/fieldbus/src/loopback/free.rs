//! The loopback as a bus with its own thread and cycle.

use crate::{BusError, Free, Port};
use tickbus_base::time::{Nanos, Pace, Stop};

use super::link::End;

/// A free-running loopback.
#[derive(Debug)]
pub struct FreeLoopback {
    place: EndSource,
    cycle: Nanos,
}

/// The source of the end.
#[derive(Debug)]
enum EndSource {
    /// By joining the link of this name.
    Named(String),
    /// The end was handed in.
    Given(End),
}

impl FreeLoopback {
    /// A loopback over the link called `name`, with a bus cycle of `cycle`.
    pub fn named(name: &str, cycle: Nanos) -> Self {
        Self {
            place: EndSource::Named(name.to_owned()),
            cycle,
        }
    }

    /// A loopback over an existing end.
    pub fn over(end: End, cycle: Nanos) -> Self {
        Self {
            place: EndSource::Given(end),
            cycle,
        }
    }
}

impl Free for FreeLoopback {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        match &mut self.place {
            EndSource::Given(end) => serve(end, self.cycle, port, stop),
            EndSource::Named(name) => serve(&mut End::join(name, port)?, self.cycle, port, stop),
        }
        Ok(())
    }
}

/// Exchanges frames every `cycle`, on deadlines without drift.
fn serve(end: &mut End, cycle: Nanos, port: &mut Port, stop: &Stop) {
    port.opening("waiting for the other end of the link");
    let mut pace = Pace::new(port.clock().now(), cycle);
    while !stop.is_stopped() {
        let now = port.clock().now();
        if pace.take(now) {
            end.cycle(now, port);
        } else {
            port.observe(now);
        }
        port.wait_until(pace.due(), stop);
    }
}
