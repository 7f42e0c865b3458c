//! The loopback as a bus on the ticking thread.

use crate::{BusError, Port, Stepped};
use tickbus_base::time::Nanos;

use super::link::End;

/// A stepped loopback: each end exchanges within its own tick, so only the order of the ticks decides which values each
/// end sees.
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

    fn end(&mut self, port: &mut Port) -> Result<&mut End, BusError> {
        match &mut self.end {
            Some(end) => Ok(end),
            none => {
                port.opening("waiting for the other end of the link");
                Ok(none.insert(End::join(&self.name, port)?))
            }
        }
    }
}

impl Stepped for SteppedLoopback {
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.end(port)?.offer(now, port);
        Ok(())
    }

    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        self.end(port)?.take(now, port);
        Ok(now)
    }
}
