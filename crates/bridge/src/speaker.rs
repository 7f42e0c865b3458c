//! What both bridges are to the dispatcher.

use tickbus_base::time::Nanos;

/// A client of the dispatcher, without its connection: bytes in, bytes out, and time handed in.
pub trait Speaker {
    /// A connection with the dispatcher is there.
    fn connected(&mut self, now: Nanos);

    /// The connection is gone. Returns whether that was to be expected, and another one is wanted at once.
    fn disconnected(&mut self) -> bool;

    /// Whether the dispatcher has taken the client.
    fn is_here(&self) -> bool;

    /// Whether bytes from the dispatcher are wanted now; if not, the other side has to take some first.
    fn wants_to_hear(&self) -> bool;

    /// Bytes have arrived from the dispatcher, in any pieces.
    ///
    /// # Errors
    ///
    /// The dispatcher does not let the client in now, or is none: close the connection, and begin another one after a pause.
    fn hear(&mut self, now: Nanos, bytes: &[u8]) -> Result<(), String>;

    /// Does what is due. Call it after what has arrived was handed over.
    ///
    /// # Errors
    ///
    /// The dispatcher does not answer: close the connection, and begin another one.
    fn tick(&mut self, now: Nanos) -> Result<(), String>;

    /// When [`tick`](Self::tick) has something to do even if nothing arrives.
    fn deadline(&self) -> Nanos;

    /// What is to be written to the dispatcher now.
    fn to_write(&mut self) -> &[u8];

    /// The connection has taken this many bytes.
    fn wrote(&mut self, now: Nanos, count: usize);
}
