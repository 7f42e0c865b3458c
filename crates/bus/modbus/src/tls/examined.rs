//! TLS around a connection that blocks, for an examination.

use std::io;
use std::net::TcpStream;
use std::sync::Arc;

use rustls::{ClientConnection, Error, StreamOwned};
use tickbus_fieldbus::examine::Wire;

use super::{ClientSide, reason};

/// Begins TLS; the peer must have shown its certificate afterwards. With TLS 1.3 the peer judges the certificate of this
/// end later.
///
/// # Errors
///
/// The cause as a fixed word, and the reason.
pub(crate) fn open(side: &ClientSide, wire: Wire) -> Result<Wire, (&'static str, String)> {
    let ClientSide(config, name) = side;
    let connection = ClientConnection::new(Arc::clone(config), name.clone());
    let connection = connection.map_err(|error| ("tls-files", error.to_string()))?;
    let socket = wire
        .socket()
        .map_err(|error| ("connect-failed", error.to_string()))?;
    let mut stream = StreamOwned::new(connection, socket);
    while stream.conn.is_handshaking() {
        stream
            .conn
            .complete_io(&mut stream.sock)
            .map_err(|error| judge(&error))?;
    }
    Ok(wire.within(Box::new(Legible(stream))))
}

fn judge(error: &io::Error) -> (&'static str, String) {
    let Some(inner) = tls_error(error) else {
        let cause = "tls-missing";
        return (cause, format!("the peer does not begin TLS ({error})"));
    };
    let cause = match inner {
        Error::InvalidMessage(_) => "tls-missing",
        Error::AlertReceived(_) => "certificate-refused",
        _ => "certificate-unknown",
    };
    (cause, format!("the peer: {}", reason::of(inner)))
}

fn tls_error(error: &io::Error) -> Option<&Error> {
    error.get_ref()?.downcast_ref()
}

/// A stream whose errors say what to do.
struct Legible(StreamOwned<ClientConnection, TcpStream>);

fn legible(error: io::Error) -> io::Error {
    match tls_error(&error) {
        Some(inner) => io::Error::other(reason::of(inner)),
        None => error,
    }
}

impl io::Read for Legible {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.read(bytes).map_err(legible)
    }
}

impl io::Write for Legible {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).map_err(legible)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush().map_err(legible)
    }
}
