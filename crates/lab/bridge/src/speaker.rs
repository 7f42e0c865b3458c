//! The common interface of both bridges to the dispatcher.

use tickbus_base::time::Nanos;

/// A client of the dispatcher, without its connection: bytes in, bytes out; the caller passes the time.
pub trait Speaker {
    /// A connection with the dispatcher is there.
    fn connected(&mut self, now: Nanos);

    /// The connection is gone. Returns true if that was expected, and another one is wanted at once.
    fn disconnected(&mut self) -> bool;

    /// True if the dispatcher has accepted the client.
    fn is_here(&self) -> bool;

    /// True if bytes from the dispatcher are wanted now; otherwise the other side has to take some first.
    fn wants_to_hear(&self) -> bool;

    /// Bytes have arrived from the dispatcher, in any pieces.
    ///
    /// # Errors
    ///
    /// The dispatcher refuses the client now, or is no dispatcher: close the connection, and open another one after a
    /// pause.
    fn hear(&mut self, now: Nanos, bytes: &[u8]) -> Result<(), String>;

    /// Does the work that is due. Call it after passing all received bytes on.
    ///
    /// # Errors
    ///
    /// The dispatcher does not answer: close the connection, and open another one.
    fn tick(&mut self, now: Nanos) -> Result<(), String>;

    /// When [`tick`](Self::tick) has something to do even if nothing arrives.
    fn deadline(&self) -> Nanos;

    /// The bytes to write to the dispatcher now.
    fn to_write(&mut self) -> &[u8];

    /// The connection has taken this many bytes.
    fn wrote(&mut self, now: Nanos, count: usize);
}
