//! The common interface of all buses.

use tickbus_base::time::{Nanos, Stop};

use super::{BusError, Port};

/// The default cycle of a bus that has its own cycle.
pub const CYCLE: Nanos = Nanos::from_millis(10);

/// A bus, of one of the two kinds.
pub enum Bus {
    /// A bus with its own thread.
    Free(Box<dyn Free>),
    /// A bus on the ticking thread.
    Stepped(Box<dyn Stepped>),
}

/// A bus with its own thread.
///
/// This kind suits slaves and servers, which answer a telegram with the latest image, and cyclic masters, which send on
/// a deadline.
pub trait Free: Send {
    /// Serves the line until `stop`.
    ///
    /// The bus takes the bytes to send from `port` when it needs them, hands in whole received frames, and reports that
    /// the peer is alive. The bus must check `stop` whenever it would wait, and must wait on the port's clock, never on
    /// the system's.
    ///
    /// # Errors
    ///
    /// The reason why the line cannot be served any longer. Supervision calls again after a pause, so everything that a
    /// fresh start needs must be created here.
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError>;

    /// The number of cycles with fail-safe values that end the exchange when the driver closes. More than one if
    /// something else, such as a card, carries the values to the peer later. None if the peer keeps no outputs; then a
    /// stale line does not change the sent values either.
    fn last_cycles(&self) -> u32 {
        1
    }

    /// How long closing waits for [`run`](Self::run) to end, in real time. After that, closing leaves the thread
    /// behind.
    fn close_timeout(&self) -> Nanos {
        Nanos::from_secs(2)
    }
}

/// A bus that runs on the ticking thread and may make the tick wait: for simulation time, and for tests.
///
/// A bus cycle has two halves, each at a simulation time that never decreases. A tick that exchanges does both at once,
/// and sends first. A tick that answers within itself receives, computes and sends at the same simulation time.
pub trait Stepped: Send {
    /// Checks that a cycle can be made at `now`, before anything is done at that time. A refusal leaves the line
    /// unchanged.
    ///
    /// # Errors
    ///
    /// The reason why no cycle can be made.
    fn accepts(&mut self, now: Nanos) -> Result<(), BusError> {
        let _ = now;
        Ok(())
    }

    /// Sends the simulation's values at `now`.
    ///
    /// # Errors
    ///
    /// The reason why the values could not be sent.
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError>;

    /// Runs the peer up to `now` and receives the data that it sends. Returns the time up to which the simulation may
    /// run before the next cycle.
    ///
    /// # Errors
    ///
    /// The reason why nothing was received.
    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError>;

    /// The side that sets the time.
    fn lead(&self) -> Lead {
        Lead::Simulation
    }
}

/// The side that sets the time of a [stepped bus](Stepped).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lead {
    /// The simulation at this end: without its ticks nothing happens.
    Simulation,
    /// The bus: [`receive`](Stepped::receive) waits, so a PLC program can run on this bus alone.
    Bus,
    /// Neither any more: the bus has ended properly, as the state of the line shows.
    Ended,
}
