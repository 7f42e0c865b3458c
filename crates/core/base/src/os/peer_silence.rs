//! How long the other computer of a TCP connection has sent no acknowledgement.
#![allow(
    unsafe_code,
    reason = "the system is asked for the state of a connection"
)]

use std::net::TcpStream;

use crate::time::Nanos;

/// How long the peer's computer has sent no acknowledgement although the system retransmits; zero as long as nothing
/// had to be retransmitted. `None` if everything is acknowledged, or where the system does not provide this.
///
/// A program that does not read is a different case: its computer answers, but accepts no more.
pub fn peer_silence(stream: &TcpStream) -> Option<Nanos> {
    #[cfg(target_os = "linux")]
    return linux::peer_silence(stream);
    #[cfg(not(target_os = "linux"))]
    {
        let _ = stream;
        None
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use std::ffi::{c_int, c_uint, c_void};
    use std::net::TcpStream;
    use std::os::fd::AsRawFd as _;

    use crate::time::Nanos;

    const SOL_TCP: c_int = 6;
    const TCP_INFO: c_int = 11;

    /// The beginning of the kernel's `struct tcp_info`.
    #[repr(C)]
    #[derive(Default)]
    struct Info {
        state: u8,
        ca_state: u8,
        /// How often the oldest unacknowledged segment was retransmitted.
        retransmits: u8,
        others: [u8; 5],
        times_and_sizes: [u32; 4],
        /// Segments on their way.
        unacknowledged: u32,
        counts: [u32; 7],
        /// In milliseconds.
        last_ack_received: u32,
    }

    unsafe extern "C" {
        fn getsockopt(
            socket: c_int,
            level: c_int,
            name: c_int,
            value: *mut c_void,
            length: *mut c_uint,
        ) -> c_int;
    }

    pub(super) fn peer_silence(stream: &TcpStream) -> Option<Nanos> {
        let mut info = Info::default();
        let size = c_uint::try_from(size_of::<Info>()).ok()?;
        let mut length = size;
        // SAFETY: the descriptor is open as long as `stream` is borrowed; `value` points to `length` bytes that may be written,
        // and every value of them is an `Info`; `length` is written, too.
        let done = unsafe {
            let value = (&raw mut info).cast::<c_void>();
            getsockopt(
                stream.as_raw_fd(),
                SOL_TCP,
                TCP_INFO,
                value,
                &raw mut length,
            )
        };
        let is_told = done == 0 && length == size && info.unacknowledged > 0;
        is_told.then(|| match info.retransmits {
            0 => Nanos::ZERO,
            _ => Nanos::from_millis(info.last_ack_received.into()),
        })
    }

    #[test]
    fn the_structure_is_the_kernels() {
        assert_eq!(std::mem::offset_of!(Info, retransmits), 2);
        assert_eq!(std::mem::offset_of!(Info, unacknowledged), 24);
        assert_eq!(std::mem::offset_of!(Info, last_ack_received), 56);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;
    use std::net::{TcpListener, TcpStream};

    #[test]
    fn a_peer_that_does_not_read_is_not_silent() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("bound");
        let mut stream = TcpStream::connect(address).expect("it listens");
        let _peer = listener.accept().expect("it came");
        stream.set_nonblocking(true).expect("an option");
        while stream.write(&[0; 8192]).is_ok() {}
        let silence = super::peer_silence(&stream).unwrap_or_default();
        assert_eq!(silence, crate::time::Nanos::ZERO);
    }
}
