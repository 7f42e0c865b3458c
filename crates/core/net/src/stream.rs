//! Streams of bytes, and the system settings that every connection needs.

use std::io::{self, ErrorKind, Read, Write};
use std::net;
use std::time::Duration;

use socket2::SockRef;

use tickbus_base::net::{HalfClose, TcpStream};
use tickbus_base::os::{LinkedTerminal, Pollable, SerialLine, SerialPort};
use tickbus_base::time::Nanos;

/// The maximum number of reads from a socket while it is being closed.
const READS: usize = 64;

/// The longest time-out to set: systems accept no more than some hours.
const LONGEST: Nanos = Nanos::from_secs(3600);

/// A stream of bytes that never blocks.
pub trait Stream: Read + Write + Pollable {
    /// Called when the stream is about to be dropped.
    fn close(&mut self) {}

    /// Called when the stream is about to be dropped together with the bytes that the peer has not received yet. A
    /// stream that cannot drop these is closed.
    fn close_by_reset(&mut self) {
        self.close();
    }
}

impl Stream for TcpStream {
    fn close(&mut self) {
        close_gracefully(self);
    }

    fn close_by_reset(&mut self) {
        close_by_reset(self);
    }
}

impl Stream for net::TcpStream {
    fn close(&mut self) {
        close_gracefully(self);
    }
}

impl<S: Stream + ?Sized> Stream for Box<S> {
    fn close(&mut self) {
        (**self).close();
    }

    fn close_by_reset(&mut self) {
        (**self).close_by_reset();
    }
}

impl Stream for SerialPort {}

impl Stream for SerialLine {}

impl Stream for LinkedTerminal {}

/// Closes the sending direction before a connection is closed. With unread bytes the system would reset the connection,
/// and the peer would lose the bytes that it has not read yet.
pub fn close_gracefully<'a, S: HalfClose>(mut stream: &'a S)
where
    &'a S: Read,
{
    // If this fails, the connection has failed already.
    let _ = stream.shutdown_write();
    let mut unread = [0; 4096];
    for _ in 0..READS {
        if !matches!(stream.read(&mut unread), Ok(count) if count > 0) {
            break;
        }
    }
}

/// Makes the system reset a connection that is about to be dropped, and discard the bytes that the peer has not
/// received.
///
/// For outdated values. Without the reset, the system would continue to send them to a peer with a pulled cable, even
/// after the program has ended. Once the cable is back, the peer would use them.
pub fn close_by_reset(stream: &TcpStream) {
    match stream {
        TcpStream::Os(stream) => {
            // If this fails, the connection has failed already.
            let _ = SockRef::from(stream).set_linger(Some(Duration::ZERO));
        }
        // Within one computer nothing is on its way once the program has ended.
        #[cfg(unix)]
        TcpStream::Local(_) => {}
        TcpStream::Simulated(stream) => stream.close_by_reset(),
    }
}

/// Returns true if the call has not failed, but must be repeated when the socket is ready.
pub fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// Makes the system send at once, never block, and give up after `patience` on a peer with a pulled cable. `None` means
/// a simulated connection or a Unix socket, which have no cable and send at once anyway.
///
/// # Errors
///
/// The system refuses one of these settings.
pub fn prepare<'a>(
    stream: impl Into<Option<&'a net::TcpStream>>,
    patience: Nanos,
) -> io::Result<()> {
    let Some(stream) = stream.into() else {
        return Ok(());
    };
    stream.set_nonblocking(true)?;
    stream.set_nodelay(true)?;
    let limit = patience.min(LONGEST).to_duration();
    let socket = SockRef::from(stream);
    #[cfg(any(target_os = "linux", target_os = "android"))]
    socket.set_tcp_user_timeout(Some(limit))?;
    // Keep-alive, for a peer that has nothing to send; the system counts it in whole seconds.
    let pause = limit.max(std::time::Duration::from_secs(1));
    let keepalive = socket2::TcpKeepalive::new()
        .with_time(pause)
        .with_interval(pause);
    socket.set_tcp_keepalive(&keepalive)
}

/// Replaces the patience of [`prepare`] for a peer that need not read. The system probes the peer's computer every
/// second, and ends the connection after two probes without an answer. While data are unacknowledged the system does
/// not probe; [`peer_silence`](tickbus_base::os::peer_silence) covers that case. `None` means a simulated connection,
/// which behaves like this anyway.
///
/// # Errors
///
/// The system refuses one of these settings.
pub fn watch_peer<'a>(stream: impl Into<Option<&'a net::TcpStream>>) -> io::Result<()> {
    let Some(stream) = stream.into() else {
        return Ok(());
    };
    let socket = SockRef::from(stream);
    // A user time-out would also end the connection with a peer that is alive but does not read.
    #[cfg(any(target_os = "linux", target_os = "android"))]
    socket.set_tcp_user_timeout(None)?;
    let second = std::time::Duration::from_secs(1);
    let keepalive = socket2::TcpKeepalive::new()
        .with_time(second)
        .with_interval(second);
    #[cfg(not(windows))]
    let keepalive = keepalive.with_retries(2);
    socket.set_tcp_keepalive(&keepalive)
}
