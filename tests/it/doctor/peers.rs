//! Peers with a fault, each on a port of its own until the process ends.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU16, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use tickbus::fieldbus::modbus::{mbap, rtu};
use tickbus::fieldbus::s7::item::{Object, ReturnCode};
use tickbus::fieldbus::s7::szl::{Facts, Identity};
use tickbus::fieldbus::s7::{Memory, ServerSession};
use tickbus::time::Nanos;

/// Serves each connection by `serve`, in a thread.
pub(crate) fn server(serve: impl Fn(TcpStream) + Send + Sync + 'static) -> SocketAddr {
    server_at("127.0.0.1:0", serve)
}

pub(crate) fn server_at(
    address: &str,
    serve: impl Fn(TcpStream) + Send + Sync + 'static,
) -> SocketAddr {
    let listener = TcpListener::bind(address).expect("a free port");
    let address = listener.local_addr().expect("an address");
    let serve = Arc::new(serve);
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let serve = Arc::clone(&serve);
            thread::spawn(move || serve(stream));
        }
    });
    address
}

/// A port on which nothing listens.
pub(crate) fn closed() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("an address")
}

/// A port that drops packets: its queue of connections is full, and nobody accepts them.
pub(crate) fn filtered() -> SocketAddr {
    filtered_at("127.0.0.1:0")
}

/// As `filtered`, at this address.
pub(crate) fn filtered_at(own: &str) -> SocketAddr {
    use socket2::{Domain, Socket, Type};
    let socket = Socket::new(Domain::IPV4, Type::STREAM, None).expect("a socket");
    let own: SocketAddr = own.parse().expect("an address");
    socket.bind(&own.into()).expect("a port");
    socket.listen(0).expect("a listener");
    let address = socket
        .local_addr()
        .expect("an address")
        .as_socket()
        .expect("of IPv4");
    let reached = SocketAddr::from(([127, 0, 0, 1], address.port()));
    loop {
        match TcpStream::connect_timeout(&reached, Duration::from_millis(300)) {
            Ok(stream) => std::mem::forget(stream),
            Err(error) if error.kind() == ErrorKind::TimedOut => break,
            Err(error) => panic!("{error}"),
        }
    }
    std::mem::forget(socket);
    address
}

/// Reads everything and answers nothing.
pub(crate) fn mute(mut stream: TcpStream) {
    let mut bytes = [0; 512];
    while matches!(stream.read(&mut bytes), Ok(1..)) {}
}

/// Answers anything with these bytes, and closes.
pub(crate) fn says(answer: &'static [u8]) -> SocketAddr {
    server(move |mut stream| {
        let mut bytes = [0; 512];
        if matches!(stream.read(&mut bytes), Ok(1..)) {
            let _ = stream.write_all(answer);
        }
    })
}

/// A Modbus server.
pub(crate) struct Registers {
    pub(crate) unit: Option<u8>,
    /// The exception for other units; none is silence.
    pub(crate) others: Option<u8>,
    pub(crate) is_rtu: bool,
    pub(crate) first: usize,
    pub(crate) words: Vec<u16>,
    /// The functions that are there.
    pub(crate) functions: &'static [u8],
    pub(crate) delay: Duration,
    /// Closes the connection at a read of this register.
    pub(crate) trap: Option<usize>,
    /// Adds one to the first register at each read.
    pub(crate) counts: bool,
    /// Serves this many connections at the same time, and closes others.
    pub(crate) most: usize,
}

impl Default for Registers {
    fn default() -> Self {
        Self {
            unit: None,
            others: None,
            is_rtu: false,
            first: 0,
            words: vec![0; 100],
            functions: &[1, 2, 3, 4],
            delay: Duration::ZERO,
            trap: None,
            counts: false,
            most: usize::MAX,
        }
    }
}

impl Registers {
    pub(crate) fn serve(self) -> SocketAddr {
        self.serve_at("127.0.0.1:0")
    }

    pub(crate) fn serve_at(self, address: &str) -> SocketAddr {
        let (reads, clients) = (AtomicU16::new(0), AtomicUsize::new(0));
        server_at(address, move |stream| {
            if clients.fetch_add(1, Ordering::SeqCst) < self.most {
                self.talk(stream, &reads);
            }
            clients.fetch_sub(1, Ordering::SeqCst);
        })
    }

    fn talk(&self, mut stream: TcpStream, reads: &AtomicU16) -> Option<()> {
        let mut inbox = Vec::new();
        let mut bytes = [0; 512];
        loop {
            let count = stream.read(&mut bytes).ok().filter(|count| *count > 0)?;
            inbox.extend_from_slice(&bytes[..count]);
            loop {
                let (taken, transaction, unit, pdu) = self.request(&inbox)?;
                if pdu.is_empty() {
                    break;
                }
                inbox.drain(..taken);
                thread::sleep(self.delay);
                let answer = self.answer(unit, &pdu, reads)?;
                if answer.is_empty() {
                    continue;
                }
                let mut out = Vec::new();
                let copy = |to: &mut Vec<u8>| to.extend_from_slice(&answer);
                if self.is_rtu {
                    rtu::append(unit, &mut out, copy);
                } else {
                    mbap::append(transaction, unit, &mut out, copy);
                }
                stream.write_all(&out).ok()?;
            }
        }
    }

    /// The first request, with an empty PDU while it is incomplete, or `None` to close the connection.
    fn request(&self, inbox: &[u8]) -> Option<(usize, u16, u8, Vec<u8>)> {
        const INCOMPLETE: (usize, u16, u8, Vec<u8>) = (0, 0, 0, Vec::new());
        if self.is_rtu {
            // All requests of an examination have eight bytes, but for functions 43 and 17.
            let length = match inbox.get(1) {
                Some(43) => 7,
                Some(17) => 4,
                _ => 8,
            };
            let Some(telegram) = inbox.get(..length) else {
                return Some(INCOMPLETE);
            };
            let (unit, pdu) = rtu::parse(telegram)?;
            return Some((length, 0, unit, pdu.to_vec()));
        }
        let parsed = mbap::Telegram::parse(inbox).ok()?;
        let Some((telegram, taken)) = parsed else {
            return Some(INCOMPLETE);
        };
        Some((
            taken,
            telegram.transaction,
            telegram.unit,
            telegram.pdu.to_vec(),
        ))
    }

    /// The answer, empty for silence, or `None` to close the connection.
    fn answer(&self, unit: u8, pdu: &[u8], reads: &AtomicU16) -> Option<Vec<u8>> {
        let refuse = |code: u8| Some(vec![pdu[0] | 0x80, code]);
        if self.unit.is_some_and(|own| own != unit) {
            return self.others.map_or(Some(Vec::new()), refuse);
        }
        assert!(
            ![5, 6, 15, 16, 22, 23].contains(&pdu[0]),
            "an examination writes nothing"
        );
        if !self.functions.contains(&pdu[0]) {
            return refuse(1);
        }
        let word = |at: usize| usize::from(u16::from_be_bytes([pdu[at], pdu[at + 1]]));
        let (first, count) = (word(1), word(3));
        if self
            .trap
            .is_some_and(|trap| (first..first + count).contains(&trap))
        {
            return None;
        }
        let own = first
            .checked_sub(self.first)
            .and_then(|begin| self.words.get(begin..begin + count));
        let Some(own) = own else {
            return refuse(2);
        };
        let mut own = own.to_vec();
        if self.counts && first == self.first {
            own[0] = reads.fetch_add(1, Ordering::SeqCst);
        }
        let values: Vec<u8> = match pdu[0] {
            1 | 2 => vec![0; count.div_ceil(8)],
            _ => own.iter().flat_map(|word| word.to_be_bytes()).collect(),
        };
        let length = u8::try_from(values.len()).expect("a short answer");
        Some([&[pdu[0], length][..], &values].concat())
    }
}

/// A CPU with data block 1.
#[derive(Clone)]
pub(crate) struct Cpu {
    pub(crate) block: Vec<u8>,
    /// The only slot of rack 0 that lets connect.
    pub(crate) slot: Option<u8>,
    /// The error of all jobs.
    pub(crate) error: Option<u16>,
    /// The code of all items.
    pub(crate) code: Option<ReturnCode>,
    pub(crate) is_stopped: bool,
}

impl Default for Cpu {
    fn default() -> Self {
        Self {
            block: vec![0; 64],
            slot: None,
            error: None,
            code: None,
            is_stopped: false,
        }
    }
}

impl Memory for Cpu {
    fn read(&mut self, object: Object, range: std::ops::Range<usize>) -> Result<&[u8], ReturnCode> {
        match (self.code, object) {
            (Some(code), _) => Err(code),
            (None, Object::Block(1)) => self.block.get(range).ok_or(ReturnCode::ADDRESS),
            _ => Err(ReturnCode::MISSING),
        }
    }

    fn write(&mut self, _: Object, _: usize, _: &[u8]) -> Result<(), ReturnCode> {
        panic!("an examination writes nothing");
    }

    fn write_bit(&mut self, _: Object, _: usize, _: u8, _: bool) -> Result<(), ReturnCode> {
        panic!("an examination writes nothing");
    }

    fn done(&mut self) {}

    fn blocks(&self) -> &[(u16, usize)] {
        &[]
    }
}

impl Cpu {
    pub(crate) fn serve(self) -> SocketAddr {
        self.serve_at("127.0.0.1:0")
    }

    pub(crate) fn serve_at(self, address: &str) -> SocketAddr {
        server_at(address, move |stream| {
            self.clone().talk(stream);
        })
    }

    pub(crate) fn talk(mut self, mut stream: TcpStream) -> Option<()> {
        let facts = Facts {
            identity: Identity::of_driver("Press"),
            pdu: 480,
            clients: 8,
            epoch: Facts::NEVER_SET,
        };
        let mut session = ServerSession::default();
        let mut inbox = Vec::new();
        let mut bytes = [0; 1024];
        loop {
            let count = stream.read(&mut bytes).ok().filter(|count| *count > 0)?;
            inbox.extend_from_slice(&bytes[..count]);
            while inbox.len() >= 4 {
                let length = usize::from(u16::from_be_bytes([inbox[2], inbox[3]]));
                if inbox.len() < length {
                    break;
                }
                let packet: Vec<u8> = inbox.drain(..length).collect();
                let is_connect = packet[5] == 0xE0;
                if let (true, Some(slot)) = (is_connect, self.slot)
                    && !packet.windows(4).any(|part| part == [0xC2, 2, 1, slot])
                {
                    return None;
                }
                let mut reply = Vec::new();
                // Behind packet, transport and PDU headers: the function; 4 reads.
                if let (Some(error), Some(4), Some(1)) = (self.error, packet.get(17), packet.get(8))
                {
                    let [class, code] = error.to_be_bytes();
                    reply.extend([
                        3, 0, 0, 21, 2, 0xF0, 0x80, 0x32, 3, 0, 0, packet[11], packet[12],
                    ]);
                    reply.extend([0, 2, 0, 0, class, code, 4, 0]);
                } else {
                    session
                        .packet(Nanos::ZERO, &packet, &facts, &mut self, &mut reply)
                        .ok()?;
                    if self.is_stopped {
                        stop(&mut reply);
                    }
                }
                stream.write_all(&reply).ok()?;
            }
        }
    }
}

/// Changes the state in an answer with list 0x0424 to STOP: the lower half of the fourth byte of its record.
fn stop(reply: &mut [u8]) {
    let list = reply.windows(2).position(|id| id == [0x04, 0x24]);
    if let Some(list) = list
        && let Some(state) = reply.get_mut(list + 8 + 3)
    {
        *state = 0x04;
    }
}
