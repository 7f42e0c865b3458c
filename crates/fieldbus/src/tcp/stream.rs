//! What every connection needs of the system.

use std::io::{self, ErrorKind, Read as _};
use std::net::{Shutdown, TcpStream};

use socket2::SockRef;

use tickbus_base::time::Nanos;

/// So many times a socket is read at most when it is closed.
const READS: usize = 64;

/// The longest that the system is asked to be patient: it takes no times beyond some hours.
const LONGEST: Nanos = Nanos::from_secs(3600);

/// Takes leave in good order before a connection is closed: unread bytes would make the system reset it,
/// and the peer lose what it has not read yet.
pub fn bow_out(mut stream: &TcpStream) {
    // What fails here has failed already.
    let _ = stream.shutdown(Shutdown::Write);
    let mut unread = [0; 4096];
    for _ in 0..READS {
        if !matches!(stream.read(&mut unread), Ok(count) if count > 0) {
            break;
        }
    }
}

/// Whether it did not fail, and only has to be tried again when the socket is ready.
pub fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// Makes the system send at once, never wait, and give up after `patience` a peer whose cable was pulled.
pub fn prepare(stream: &TcpStream, patience: Nanos) -> io::Result<()> {
    stream.set_nonblocking(true)?;
    stream.set_nodelay(true)?;
    let limit = patience.min(LONGEST).to_duration();
    let socket = SockRef::from(stream);
    #[cfg(any(target_os = "linux", target_os = "android"))]
    socket.set_tcp_user_timeout(Some(limit))?;
    // For a peer that has nothing to say; whole seconds are all that the system knows.
    let pause = limit.max(std::time::Duration::from_secs(1));
    let keepalive = socket2::TcpKeepalive::new()
        .with_time(pause)
        .with_interval(pause);
    socket.set_tcp_keepalive(&keepalive)
}
