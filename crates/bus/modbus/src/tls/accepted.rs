//! TLS in front of a service for many clients.

use std::io::{Read as _, Write as _};
use std::net::SocketAddr;
use std::sync::Arc;

use rustls::ServerConnection;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::{Limits, Service};
use tickbus_fieldbus::{BusError, Port};

use super::{ServerSide, reason, role};
use crate::restricts::Restricts;

/// The time for a client to show its certificate.
const HANDSHAKE: Nanos = Nanos::from_secs(5);

/// A service within TLS.
pub(crate) struct TlsService<'a, S> {
    inner: S,
    side: &'a ServerSide,
    write_roles: Option<&'a [String]>,
}

/// One client.
pub(crate) struct Client<C> {
    inner: C,
    peer: SocketAddr,
    /// When it connected.
    since: Nanos,
    connection: ServerConnection,
    /// The decrypted part of a telegram.
    begun: Vec<u8>,
    /// True if the client has shown its certificate.
    is_known: bool,
}

impl<'a, S: Restricts> TlsService<'a, S> {
    /// A service for clients that show a certificate, of which those with one of `write_roles` may write; all of them
    /// without such a list.
    pub(crate) fn new(inner: S, side: &'a ServerSide, write_roles: Option<&'a [String]>) -> Self {
        Self {
            inner,
            side,
            write_roles,
        }
    }

    /// The client has shown its certificate.
    fn know(&self, client: &mut Client<S::Client>) {
        client.is_known = true;
        let own = client.connection.peer_certificates();
        let role = own.and_then(|chain| role::of(chain.first()?));
        let writes = self.write_roles.is_none_or(|roles| {
            role.as_ref()
                .is_some_and(|role| roles.iter().any(|other| other == role))
        });
        if !writes {
            S::restrict(&mut client.inner);
        }
        let role = role.map_or_else(
            || "no role".to_owned(),
            |role| format!("the role \"{}\"", tickbus_base::toml_text::shown(&role)),
        );
        let may = if writes { "may write" } else { "may only read" };
        log::info!("{} has {role} in its certificate, and {may}", client.peer);
    }

    /// Answers the decrypted telegrams.
    fn answer(
        &mut self,
        client: &mut Client<S::Client>,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let mut plain = Vec::new();
        let mut taken = 0;
        let answered = loop {
            let rest = &client.begun[taken..];
            if rest.is_empty() {
                break Ok(());
            }
            let inner = &mut client.inner;
            match self.inner.telegram(inner, now, rest, &mut plain, port) {
                Ok(0) => break Ok(()),
                Ok(count) => taken += count,
                Err(error) => break Err(error),
            }
        };
        client.begun.drain(..taken);
        // Memory takes everything.
        let _ = client.connection.writer().write_all(&plain);
        if answered.is_err() {
            client.connection.send_close_notify();
        }
        answered
    }

    fn hear(
        &mut self,
        client: &mut Client<S::Client>,
        now: Nanos,
        mut bytes: &[u8],
        port: &mut Port,
    ) -> Result<(), BusError> {
        let refused = |error: &rustls::Error| BusError::Protocol(reason::of(error));
        while !bytes.is_empty() {
            let read = client.connection.read_tls(&mut bytes);
            let state = client.connection.process_new_packets();
            let state = state.map_err(|error| refused(&error))?;
            if !client.is_known && !client.connection.is_handshaking() {
                self.know(client);
            }
            let begin = client.begun.len();
            client
                .begun
                .resize(begin + state.plaintext_bytes_to_read(), 0);
            let plain = &mut client.begun[begin..];
            if client.connection.reader().read_exact(plain).is_err() {
                client.begun.truncate(begin);
            }
            self.answer(client, now, port)?;
            if matches!(read, Ok(0) | Err(_)) {
                // The client has said goodbye; it closes the connection now.
                break;
            }
        }
        Ok(())
    }
}

impl<S: Restricts> Service for TlsService<'_, S> {
    type Client = Client<S::Client>;

    fn limits(&self) -> Limits {
        self.inner.limits()
    }

    fn welcome(&mut self, peer: SocketAddr, now: Nanos) -> Self::Client {
        let connection = ServerConnection::new(Arc::clone(&self.side.0));
        let mut connection = connection.expect("the configuration was accepted");
        // All requests of one read are answered, however long the answers are.
        connection.set_buffer_limit(None);
        Client {
            inner: self.inner.welcome(peer, now),
            peer,
            connection,
            begun: Vec::new(),
            is_known: false,
            since: now,
        }
    }

    /// Takes all bytes: TLS has its own boundaries, and keeps what is not whole.
    fn telegram(
        &mut self,
        client: &mut Self::Client,
        now: Nanos,
        bytes: &[u8],
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        // Until it is known, its bytes do not keep its place for it.
        if !client.is_known && now - client.since > HANDSHAKE {
            let why = format!("it has shown no certificate within {HANDSHAKE}");
            return Err(BusError::Protocol(why));
        }
        let heard = self.hear(client, now, bytes, port);
        // Also what tells the client why it is refused.
        while client.connection.wants_write() && client.connection.write_tls(reply).is_ok() {}
        heard.map(|()| bytes.len())
    }

    fn speaks(&self, client: &Self::Client) -> bool {
        client.is_known
    }

    /// The encryption counts its records, also those that nobody reads.
    fn lost(&mut self, client: &mut Self::Client, mut bytes: &[u8]) {
        client.begun.clear();
        while !bytes.is_empty() {
            let read = client.connection.read_tls(&mut bytes);
            let Ok(state) = client.connection.process_new_packets() else {
                // The next bytes meet the same error.
                return;
            };
            let mut plain = vec![0; state.plaintext_bytes_to_read()];
            let forgotten = client.connection.reader().read_exact(&mut plain);
            if forgotten.is_err() || matches!(read, Ok(0) | Err(_)) {
                return;
            }
        }
    }

    fn replied(&mut self, client: &mut Self::Client, port: &mut Port) {
        self.inner.replied(&mut client.inner, port);
    }

    fn unheard(&mut self, client: &mut Self::Client, now: Nanos, port: &mut Port) {
        self.inner.unheard(&mut client.inner, now, port);
    }
}
