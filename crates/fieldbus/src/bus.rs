//! What all buses have in common.

use tickbus_base::time::{Nanos, Stop};

use super::{BusError, Port};

/// The default bus cycle of a bus that has a cycle of its own.
pub const CYCLE: Nanos = Nanos::from_millis(10);

/// A bus, of one of the two kinds.
pub enum Bus {
    /// Has its own thread.
    Free(Box<dyn Free>),
    /// Runs on the ticking thread.
    Stepped(Box<dyn Stepped>),
}

/// A bus with a thread of its own.
///
/// Suits slaves and servers, which answer a telegram with the latest image, and cyclic masters, which send on
/// a deadline.
pub trait Free: Send {
    /// Serves the line until `stop`.
    ///
    /// It gets the bytes to send from `port` when it needs them, hands in whole received frames, and reports
    /// that the peer is alive. It must check `stop` whenever it would wait, and must wait on the port's
    /// clock, never on the system's.
    ///
    /// # Errors
    ///
    /// Why the line cannot be served any longer. Supervision calls again after a pause, so everything that a
    /// fresh start needs must be created here.
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError>;

    /// How many cycles with the fail-safe values end the exchange when the driver closes: more than one where somebody else
    /// carries the values to the peer later, and none where the peer keeps no outputs. Then a stale line changes nothing
    /// of what is sent, either.
    fn last_cycles(&self) -> u32 {
        1
    }

    /// How long closing waits for [`run`](Self::run) to end, in real time. After that the thread is left
    /// behind.
    fn close_timeout(&self) -> Nanos {
        Nanos::from_secs(2)
    }
}

/// A bus that runs on the ticking thread and may make the tick wait: for simulation time, and for tests.
///
/// A bus cycle has two halves, each at a simulation time that never decreases. A tick that exchanges does
/// both at once, sending first; a tick that answers within itself receives, computes, and sends at the same
/// time.
pub trait Stepped: Send {
    /// Whether a cycle can be made at `now`, before anything is done at that time: what is refused here leaves the line
    /// as it was.
    ///
    /// # Errors
    ///
    /// Why not.
    fn accepts(&mut self, now: Nanos) -> Result<(), BusError> {
        let _ = now;
        Ok(())
    }

    /// Sends what the simulation has written, at `now`.
    ///
    /// # Errors
    ///
    /// Why it could not be sent.
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError>;

    /// Runs the peer up to `now` and receives what it sends; returns the time up to which the simulation may
    /// run before the next cycle.
    ///
    /// # Errors
    ///
    /// Why nothing was received.
    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError>;

    /// Who hands out the time.
    fn lead(&self) -> Lead {
        Lead::Simulation
    }
}

/// Who hands out the time of a [stepped bus](Stepped).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lead {
    /// The simulation at this end: without its ticks nothing happens.
    Simulation,
    /// The bus: [`receive`](Stepped::receive) waits, so that a PLC program can run on it by itself.
    Bus,
    /// Nobody any more: the bus has come to its proper end, which the state of the line tells.
    Ended,
}
