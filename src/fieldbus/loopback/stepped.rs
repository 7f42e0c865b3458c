//! The loopback as a bus on the tick's own thread.

use crate::fieldbus::{BusError, Port, Stepped};
use crate::time::Nanos;

use super::link::End;

/// A stepped loopback: each end exchanges on its own tick, so the order of the ticks alone decides
/// what is seen.
#[derive(Debug)]
pub struct SteppedLoopback {
    name: String,
    end: Option<End>,
}

impl SteppedLoopback {
    /// A loopback over the link called `name`.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            end: None,
        }
    }
}

impl Stepped for SteppedLoopback {
    fn exchange(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        let end = match &mut self.end {
            Some(end) => end,
            none => {
                port.opening("waiting for the other end of the link");
                none.insert(End::join(&self.name, port)?)
            }
        };
        end.cycle(now, port);
        Ok(now)
    }
}
