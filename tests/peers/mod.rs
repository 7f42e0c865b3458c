//! What tests with foreign ends share: addresses of their own, and ways to begin and end a connection.
#![allow(dead_code, reason = "each test uses a part of it")]

use std::io::{ErrorKind, Read};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// An address on this machine that nobody else uses.
pub fn own_address() -> SocketAddr {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let ip = if cfg!(target_os = "linux") {
        // All of 127.0.0.0/8 is this machine: a host for each process and test.
        let host = std::process::id().wrapping_mul(64) + NEXT.fetch_add(1, Ordering::Relaxed);
        let [_, x, y, z] = host.to_be_bytes();
        Ipv4Addr::new(127, x, y, z.clamp(1, 254))
    } else {
        Ipv4Addr::LOCALHOST
    };
    let listener = TcpListener::bind((ip, 0)).expect("an address of this machine");
    listener.local_addr().expect("it is bound")
}

/// Closes in good order: with nothing left unread, which would make the system reset the connection.
pub fn leave(mut stream: TcpStream) {
    let _ = stream.shutdown(Shutdown::Write);
    while matches!(stream.read(&mut [0; 4096]), Ok(count) if count > 0) {}
}

/// A thread that is told to end, and waited for.
pub struct Ending {
    pub over: Arc<AtomicBool>,
    pub thread: Option<JoinHandle<()>>,
}

impl Drop for Ending {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the peer did not panic");
        }
    }
}

pub fn client(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).expect("the device listens");
    stream.set_nodelay(true).expect("a TCP option");
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .expect("a TCP option");
    stream
}

/// Whether the other end has closed; what had come before is thrown away.
pub fn is_closed(stream: &TcpStream) -> bool {
    stream.set_nonblocking(true).expect("a TCP option");
    let mut reader = stream;
    let closed = loop {
        match reader.read(&mut [0; 4096]) {
            Ok(0) => break true,
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => break false,
            Err(_) => break true,
        }
    };
    stream.set_nonblocking(false).expect("a TCP option");
    closed
}
