//! TLS in front of a connection with one peer.

use std::io::{self, Read as _, Write as _};
use std::sync::Arc;

use rustls::ClientConnection;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::Caller;
use tickbus_fieldbus::{BusError, Port};

use super::{ClientSide, reason};

/// A caller within TLS.
pub(crate) struct TlsCaller<'a, C> {
    inner: &'a mut C,
    connection: ClientConnection,
    /// The encrypted bytes to be written.
    out: Vec<u8>,
    /// The time by which the peer has to be known.
    limit: Nanos,
    peer: String,
    /// True if the peer has sent anything within TLS. With TLS 1.3 it judges the certificate of this end after this end has
    /// judged its own.
    has_answered: bool,
    /// Why the connection ends, as soon as the peer has been told.
    failed: Option<BusError>,
}

impl<'a, C: Caller> TlsCaller<'a, C> {
    /// Begins at `now` with a peer, which has `timeout` to show its certificate.
    pub(crate) fn new(
        side: &ClientSide,
        inner: &'a mut C,
        peer: String,
        now: Nanos,
        timeout: Nanos,
    ) -> Self {
        let ClientSide(config, name) = side;
        let connection = ClientConnection::new(Arc::clone(config), name.clone());
        let mut caller = Self {
            inner,
            connection: connection.expect("the configuration was accepted"),
            out: Vec::new(),
            limit: now + timeout,
            peer,
            has_answered: false,
            failed: None,
        };
        caller.flush();
        caller
    }

    /// Encrypts what the inner caller writes.
    fn send(&mut self, now: Nanos, port: &mut Port) {
        if self.failed.is_some() || self.connection.is_handshaking() {
            return;
        }
        while let plain = self.inner.to_write(now)
            && !plain.is_empty()
        {
            let Ok(count) = self.connection.writer().write(plain) else {
                break;
            };
            if count == 0 {
                break;
            }
            self.inner.wrote(now, count, port);
        }
        self.flush();
    }

    fn flush(&mut self) {
        // Memory takes everything.
        while self.connection.wants_write() && self.connection.write_tls(&mut self.out).is_ok() {}
    }
}

impl<C: Caller> Caller for TlsCaller<'_, C> {
    fn hear(&mut self, now: Nanos, mut bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        while !bytes.is_empty() {
            let read = self.connection.read_tls(&mut bytes);
            let state = match self.connection.process_new_packets() {
                Ok(state) => state,
                Err(error) => {
                    // The peer is told why in this turn, before `check` ends the connection.
                    self.flush();
                    let why = format!("{}: {}", self.peer, reason::of(&error));
                    self.failed = Some(BusError::Refused(why));
                    return Ok(());
                }
            };
            let mut plain = vec![0; state.plaintext_bytes_to_read()];
            if self.connection.reader().read_exact(&mut plain).is_ok() && !plain.is_empty() {
                self.has_answered = true;
                self.inner.hear(now, &plain, port)?;
            }
            if matches!(read, Ok(0) | Err(_)) {
                break;
            }
        }
        self.send(now, port);
        self.flush();
        Ok(())
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        if self.failed.is_some() {
            return Ok(());
        }
        if !self.connection.is_handshaking() {
            self.inner.turn(now, port)?;
            self.send(now, port);
        } else if now >= self.limit {
            return Err(BusError::Link(format!(
                "{} did not begin TLS in time; check its port, and whether it has Modbus/TCP Security",
                self.peer
            )));
        }
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        &self.out
    }

    fn wrote(&mut self, now: Nanos, count: usize, port: &mut Port) {
        self.out.drain(..count);
        if self.out.is_empty() {
            self.send(now, port);
        }
    }

    fn check(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        match self.failed.take() {
            Some(error) => Err(error),
            None => self.inner.check(now, port),
        }
    }

    fn deadline(&self, port: &Port) -> Nanos {
        if self.connection.is_handshaking() {
            self.limit
        } else {
            self.inner.deadline(port)
        }
    }

    fn left(&mut self) -> BusError {
        if self.has_answered {
            return self.inner.left();
        }
        BusError::Refused(format!(
            "{} closed the connection before its first answer; let it trust the authority of certificate_file, and see \
             its log",
            self.peer
        ))
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        if self.has_answered {
            return self.inner.broke(error);
        }
        BusError::Refused(format!(
            "{} broke the connection before its first answer ({error}); let it trust the authority of \
             certificate_file, and see its log",
            self.peer
        ))
    }
}
