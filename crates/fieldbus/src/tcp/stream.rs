//! System settings that every connection needs.

use std::io::{self, ErrorKind, Read};
use std::net;
use std::time::Duration;

use socket2::SockRef;

use tickbus_base::net::{HalfClose, TcpStream};
use tickbus_base::time::Nanos;

/// How many times a socket is read at most while it is being closed.
const READS: usize = 64;

/// The longest time-out that is set: systems accept no more than some hours.
const LONGEST: Nanos = Nanos::from_secs(3600);

/// Closes the sending direction before a connection is closed: with unread bytes the system would reset the
/// connection, and the peer would lose what it has not read yet.
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

/// Makes the system break a connection that is about to be dropped, and drop what the peer has not got.
///
/// For values that are no longer meant: the system would go on sending them to a peer whose cable is pulled after the
/// program has ended, and they would count there when the cable is back.
pub fn close_by_reset(stream: &TcpStream) {
    match stream {
        TcpStream::Os(stream) => {
            // If this fails, the connection has failed already.
            let _ = SockRef::from(stream).set_linger(Some(Duration::ZERO));
        }
        TcpStream::Simulated(stream) => stream.close_by_reset(),
    }
}

/// Whether the call has not failed, but has to be repeated when the socket is ready.
pub fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// Makes the system send at once, never block, and give up after `patience` on a peer whose cable was pulled; `None`, of a
/// simulation, does so anyway.
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

/// Replaces the patience of [`prepare`] for a peer that need not read: the system asks its computer every second whether the
/// connection is still there, and ends it after two questions without an answer. While data are on their way it does not ask;
/// [`peer_silence`](tickbus_base::os::peer_silence) tells of those. `None`, of a simulation, does so anyway.
///
/// # Errors
///
/// The system refuses one of these settings.
pub fn watch_peer<'a>(stream: impl Into<Option<&'a net::TcpStream>>) -> io::Result<()> {
    let Some(stream) = stream.into() else {
        return Ok(());
    };
    let socket = SockRef::from(stream);
    // A limit would count for a peer as well that is there and does not read.
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
