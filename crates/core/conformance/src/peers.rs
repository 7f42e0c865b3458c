//! Shared by tests with foreign ends: unique addresses, and ways to open and close connections.

use std::any::Any;
use std::io::{ErrorKind, Read};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use tickbus_base::time::{Manual, Nanos};

use tickbus_driver_cfg::Kinds;

use crate::rig::{End, await_that, pass};

/// An address on this machine that no other test uses.
pub fn own_address() -> SocketAddr {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let ip = if cfg!(target_os = "linux") {
        // All of 127.0.0.0/8 is this machine: one host per process and test.
        let host = std::process::id().wrapping_mul(64) + NEXT.fetch_add(1, Ordering::Relaxed);
        let [_, x, y, z] = host.to_be_bytes();
        Ipv4Addr::new(127, x, y, z.clamp(1, 254))
    } else {
        Ipv4Addr::LOCALHOST
    };
    let listener = TcpListener::bind((ip, 0)).expect("an address of this machine");
    listener.local_addr().expect("it is bound")
}

/// Closes properly: with unread bytes, the system would reset the connection.
pub fn leave(mut stream: TcpStream) {
    let _ = stream.shutdown(Shutdown::Write);
    while matches!(stream.read(&mut [0; 4096]), Ok(count) if count > 0) {}
}

/// A thread that can be stopped and joined.
struct Ending {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Ending {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the peer did not panic");
        }
    }
}

/// A peer for [`Liar`](crate::rig::Liar): passes each of its connections to `lie`. It listens on `address`, or connects to it.
pub fn lying(
    address: SocketAddr,
    listens: bool,
    lie: impl Fn(TcpStream) + Send + 'static,
) -> Box<dyn Any> {
    let over = Arc::new(AtomicBool::new(false));
    let listener = listens.then(|| {
        let listener = TcpListener::bind(address).expect("its own address");
        listener.set_nonblocking(true).expect("an option");
        listener
    });
    let thread = std::thread::spawn({
        let over = Arc::clone(&over);
        move || {
            while !over.load(Ordering::Relaxed) {
                let met = match &listener {
                    Some(listener) => listener.accept().map(|met| met.0),
                    None => TcpStream::connect(address),
                };
                match met {
                    Ok(stream) => lie(stream),
                    Err(_) => std::thread::yield_now(),
                }
            }
        }
    });
    Box::new(Ending {
        over,
        thread: Some(thread),
    })
}

pub fn client(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).expect("the device listens");
    stream.set_nodelay(true).expect("a TCP option");
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .expect("a TCP option");
    stream
}

/// True if the other end has closed; data received before that are discarded.
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

/// An end of the bus with foreign peers, and a clock on which no other end waits.
pub struct Alone {
    pub clock: Arc<Manual>,
    pub end: End,
}

impl Alone {
    /// Opens the end of a driver.cfg with this text, which may name these `kinds` of bus.
    pub fn open(text: &str, kinds: &'static Kinds) -> Self {
        let clock = Manual::new();
        let end = End::open(text, &clock, kinds);
        Self { clock, end }
    }

    /// The address on which the end listens.
    pub fn address(&self) -> SocketAddr {
        self.end.address()
    }

    /// Lets cycles pass, and ticks, until `done` holds.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut done: impl FnMut(&mut End) -> bool) {
        await_that(what, || {
            pass(&self.clock, 1);
            self.end.tick();
            done(&mut self.end)
        });
    }

    /// Lets cycles pass until the line's reason has these words; returns the name of its cause.
    #[track_caller]
    pub fn until_reason(&mut self, words: &str) -> &'static str {
        let mut cause = "";
        let mut last = String::new();
        let limit = std::time::Instant::now() + Duration::from_secs(20);
        self.until(&format!("the reason has \"{words}\""), |end| {
            let link = end.link();
            cause = link.cause.name();
            let said = link.reason.contains(words);
            if last != link.reason {
                last = link.reason;
            }
            assert!(
                said || std::time::Instant::now() < limit,
                "no \"{words}\" in {last}"
            );
            said
        });
        cause
    }

    #[track_caller]
    pub fn until_speed(&mut self, speed: i16) {
        self.until(&format!("the speed is {speed}"), |end| {
            end.get("speed") == f64::from(speed)
        });
    }

    /// The time on the clock.
    pub fn now(&self) -> Nanos {
        use tickbus_base::time::Clock as _;
        self.clock.now()
    }
}
