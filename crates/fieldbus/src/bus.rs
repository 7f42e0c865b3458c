//! What every bus is.

use tickbus_base::time::{Nanos, Stop};

use super::Port;

/// The bus cycle of a bus with a rhythm of its own, where a driver.cfg states none.
pub const CYCLE: Nanos = Nanos::from_millis(10);

/// A bus, of one of the two kinds.
pub enum Bus {
    /// Owns the one thread of its line.
    Free(Box<dyn Free>),
    /// Runs on the tick's own thread.
    Stepped(Box<dyn Stepped>),
}

/// A bus that owns the one thread of its line.
///
/// It suits slaves and servers, where a telegram asks and the latest image answers, and cyclic
/// masters, where a deadline sends.
pub trait Free: Send {
    /// Serves the line until `stop` says so.
    ///
    /// Through `port` it takes the bytes to send when it needs them, hands in whole received frames,
    /// and says that the peer is alive. It must look at `stop` whenever it would wait, and must wait
    /// on the port's clock, never on the system's.
    ///
    /// # Errors
    ///
    /// Why the line cannot be served any more. Supervision calls again after its back-off, so
    /// everything that a fresh start needs must be made anew here.
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError>;

    /// How long closing waits for [`run`](Self::run) to end, in real time. After that its thread is left
    /// behind.
    fn close_timeout(&self) -> Nanos {
        Nanos::from_secs(2)
    }
}

/// A bus that runs on the tick's own thread and may make the tick wait: for virtual time, and tests.
///
/// A bus cycle has two halves, each at a simulation time that never falls. A tick that exchanges makes both at once,
/// sending first; a tick that answers within itself receives, computes, and sends at the same time.
pub trait Stepped: Send {
    /// Sends what the simulation has written, at `now`.
    ///
    /// # Errors
    ///
    /// Why it was not sent.
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError>;

    /// Runs the peer up to `now` and brings what it sends; gives the time up to which the simulation may
    /// go on without the next cycle.
    ///
    /// # Errors
    ///
    /// Why nothing came.
    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError>;
}

/// Why a bus cannot go on, apart by whose fault it is.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BusError {
    /// The line is broken, or was never there; trying again may help.
    #[error("the link failed: {0}")]
    Link(String),
    /// The peer ended the connection in good order.
    #[error("the peer left: {0}")]
    Left(String),
    /// The peer does not keep to the protocol.
    #[error("the protocol was broken: {0}")]
    Protocol(String),
    /// The peer understood, and declined.
    #[error("refused: {0}")]
    Refused(String),
}
