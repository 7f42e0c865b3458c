//! The interface between a server and its protocol.

use std::net::SocketAddr;

use crate::{BusError, Port};
use tickbus_base::time::Nanos;

/// The limits that a server sets for its clients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest telegram of the protocol, in bytes. A client that sends this many bytes without a complete
    /// telegram violates the protocol.
    pub telegram: usize,
    /// How many clients are served at the same time.
    pub clients: usize,
    /// How long a client may take to complete a telegram, or to read an answer.
    pub patience: Nanos,
}

/// A protocol as the server speaks it with each client: bytes in, bytes out, and the image behind the port. A service
/// does no I/O.
pub trait Service {
    /// The state of one client.
    type Client;

    /// The limits for clients.
    fn limits(&self) -> Limits;

    /// A client has connected from `peer`.
    fn welcome(&mut self, peer: SocketAddr, now: Nanos) -> Self::Client;

    /// Examines the bytes received from a client and not yet consumed.
    ///
    /// Returns the length of the telegram at their beginning, and appends the answer, if any, to `reply`. Returns 0 if
    /// the telegram is not complete yet. The server repeats the call until it returns 0.
    ///
    /// # Errors
    ///
    /// The client violates the protocol. The server sends the bytes in `reply` and disconnects the client; other
    /// clients are not affected.
    fn telegram(
        &mut self,
        client: &mut Self::Client,
        now: Nanos,
        bytes: &[u8],
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Result<usize, BusError>;

    /// Returns true if a client that has sent telegrams is present as a peer; false while it still proves who it is.
    fn speaks(&self, client: &Self::Client) -> bool {
        let _ = client;
        true
    }

    /// The system has accepted all answers made by the last calls of [`telegram`](Self::telegram) for this
    /// client. Not called for answers that had to wait for a slow client.
    fn replied(&mut self, client: &mut Self::Client, port: &mut Port);

    /// These bytes of a client are lost, since the line is down; for a service whose telegrams cannot be read without
    /// those before them.
    fn lost(&mut self, client: &mut Self::Client, bytes: &[u8]) {
        let _ = (client, bytes);
    }

    /// Bytes from or to this client were lost at `now`, since the line was down: perhaps requests, and perhaps the client
    /// wrote; perhaps answers, none of which counts as [`replied`](Self::replied) any more.
    fn unheard(&mut self, client: &mut Self::Client, now: Nanos, port: &mut Port);

    /// An answer of these stations to this client was lost at `now`, since one of them was dead.
    fn unanswered(
        &mut self,
        client: &mut Self::Client,
        stations: &[usize],
        now: Nanos,
        port: &mut Port,
    ) {
        let _ = stations;
        self.unheard(client, now, port);
    }
}
