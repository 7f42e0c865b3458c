//! Capture files for Wireshark, made from the bytes of TCP conversations that a test has recorded, and
//! tshark's analysis of them.
//!
//! The bytes are wrapped in TCP, IP and Ethernet headers: no capture privileges are needed.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};

/// The sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    Client,
    Server,
}

/// The data sent by both ends of a TCP connection, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Conversation(pub Vec<(From, Vec<u8>)>);

/// The longest piece of a stream in one packet.
const SEGMENT: usize = 1400;

/// Writes a file with these conversations, each with a server at TCP port `port`.
///
/// # Errors
///
/// The file cannot be written.
pub fn write(path: &Path, port: u16, conversations: &[Conversation]) -> io::Result<()> {
    let mut file = Vec::new();
    // Microseconds, version 2.4, no time zone, whole packets, Ethernet.
    for word in [0xA1B2_C3D4_u32, 0x0002_0004, 0, 0, 65_535, 1] {
        let bytes = match word {
            // Two 16-bit fields in the file's byte order.
            0x0002_0004 => [2, 0, 4, 0],
            word => word.to_le_bytes(),
        };
        file.extend_from_slice(&bytes);
    }
    let mut micros = 0;
    for (index, conversation) in conversations.iter().enumerate() {
        let client = 50_000 + u16::try_from(index).expect("few conversations");
        let mut line = Line {
            ports: [client, port],
            next: [1000, 5000],
            file: &mut file,
            micros: &mut micros,
        };
        line.segment(From::Client, SYN, &[]);
        line.segment(From::Server, SYN | ACK, &[]);
        line.segment(From::Client, ACK, &[]);
        for (from, bytes) in &conversation.0 {
            for piece in bytes.chunks(SEGMENT) {
                line.segment(*from, PUSH | ACK, piece);
            }
        }
        line.segment(From::Client, FIN | ACK, &[]);
        line.segment(From::Server, FIN | ACK, &[]);
        line.segment(From::Client, ACK, &[]);
    }
    std::fs::write(path, file)
}

const FIN: u8 = 1;
const SYN: u8 = 2;
const PUSH: u8 = 8;
const ACK: u8 = 16;

struct Line<'a> {
    /// The ports of the client and of the server.
    ports: [u16; 2],
    /// The sequence numbers of the next bytes.
    next: [u32; 2],
    file: &'a mut Vec<u8>,
    micros: &'a mut u32,
}

impl Line<'_> {
    fn segment(&mut self, from: From, flags: u8, bytes: &[u8]) {
        let (own, other) = match from {
            From::Client => (0, 1),
            From::Server => (1, 0),
        };
        let length = u16::try_from(20 + 20 + bytes.len()).expect("a segment");
        let mut packet = Vec::with_capacity(14 + usize::from(length));
        for end in [other, own] {
            packet.extend_from_slice(&[2, 0, 0, 0, 0, u8::try_from(end).expect("0 or 1")]);
        }
        packet.extend_from_slice(&[8, 0]);
        let ip = packet.len();
        packet.extend_from_slice(&[0x45, 0]);
        packet.extend_from_slice(&length.to_be_bytes());
        packet.extend_from_slice(&[0, 0, 0x40, 0, 64, 6, 0, 0]);
        for end in [own, other] {
            packet.extend_from_slice(&[10, 0, 0, u8::try_from(end + 1).expect("1 or 2")]);
        }
        let sum = checksum(&packet[ip..]);
        packet[ip + 10..ip + 12].copy_from_slice(&sum.to_be_bytes());
        for port in [self.ports[own], self.ports[other]] {
            packet.extend_from_slice(&port.to_be_bytes());
        }
        let acknowledged = if flags & ACK == 0 {
            0
        } else {
            self.next[other]
        };
        for number in [self.next[own], acknowledged] {
            packet.extend_from_slice(&number.to_be_bytes());
        }
        // Wireshark does not check the TCP checksum by default.
        packet.extend_from_slice(&[0x50, flags, 0xFF, 0xFF, 0, 0, 0, 0]);
        packet.extend_from_slice(bytes);
        let counted =
            u32::try_from(bytes.len()).expect("a segment") + u32::from(flags & (SYN | FIN) != 0);
        self.next[own] += counted;
        *self.micros += 100;
        let size = u32::try_from(packet.len()).expect("a packet");
        for word in [0, *self.micros, size, size] {
            self.file.extend_from_slice(&word.to_le_bytes());
        }
        self.file.extend_from_slice(&packet);
    }
}

fn checksum(header: &[u8]) -> u16 {
    let words = header.chunks_exact(2);
    let sum: u32 = words
        .map(|pair| u32::from(u16::from_be_bytes([pair[0], pair[1]])))
        .sum();
    let folded = (sum & 0xFFFF) + (sum >> 16);
    !u16::try_from((folded & 0xFFFF) + (folded >> 16)).expect("folded twice")
}

/// An event on a connection between a client and a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard<'a> {
    /// One of them has sent data; they are forwarded once the listener has seen them.
    Said(From, &'a [u8]),
    /// The client has sent everything.
    Left,
}

/// Listens between clients and a server at `server`: calls `hear` with the number of the connection, counted from 0,
/// and the event. Returns the address for clients.
pub fn listen_before(
    server: SocketAddr,
    hear: impl Fn(usize, Heard<'_>) + Send + Sync + 'static,
) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    let hear = Arc::new(hear);
    // Not joined: the thread ends with the process.
    std::thread::spawn(move || {
        for index in 0.. {
            let Ok((client, _)) = listener.accept() else {
                break;
            };
            let server = TcpStream::connect(server).expect("the server listens");
            for (from, stream, to) in [
                (From::Client, &client, &server),
                (From::Server, &server, &client),
            ] {
                let ends = (stream.try_clone(), to.try_clone());
                let (Ok(stream), Ok(to)) = ends else {
                    panic!("more descriptors");
                };
                stream.set_nodelay(true).expect("a TCP option");
                to.set_nodelay(true).expect("a TCP option");
                let hear = Arc::clone(&hear);
                std::thread::spawn(move || carry(from, stream, to, |heard| hear(index, heard)));
            }
        }
    });
    address
}

/// Listens between clients and a server, and records their data.
#[derive(Debug)]
pub struct Tap {
    /// The address for clients.
    pub address: SocketAddr,
    conversations: Arc<Mutex<Vec<Conversation>>>,
}

impl Tap {
    pub fn before(server: SocketAddr) -> Self {
        let conversations = Arc::<Mutex<Vec<Conversation>>>::default();
        let taken = Arc::clone(&conversations);
        let address = listen_before(server, move |index, heard| {
            let mut all = taken.lock().expect("nobody panics");
            if all.len() <= index {
                all.resize_with(index + 1, Conversation::default);
            }
            if let Heard::Said(from, bytes) = heard {
                all[index].0.push((from, bytes.to_vec()));
            }
        });
        Self {
            address,
            conversations,
        }
    }

    /// Everything recorded so far.
    pub fn conversations(&self) -> Vec<Conversation> {
        self.conversations.lock().expect("nobody panics").clone()
    }
}

fn carry(from: From, mut stream: TcpStream, mut to: TcpStream, hear: impl Fn(Heard<'_>)) {
    let mut buffer = [0; 4096];
    while let Ok(count @ 1..) = stream.read(&mut buffer) {
        // Before forwarding, so that the answer follows the question.
        hear(Heard::Said(from, &buffer[..count]));
        if to.write_all(&buffer[..count]).is_err() {
            break;
        }
    }
    if from == From::Client {
        hear(Heard::Left);
    }
    let _ = to.shutdown(std::net::Shutdown::Write);
}

/// tshark's output for each packet of a file: the requested fields, one line per packet.
///
/// `decode` names ports and their protocols, such as `tcp.port==1102,tpkt`.
///
/// # Panics
///
/// When tshark cannot be run.
pub fn tshark(
    mut tshark: Command,
    file: &Path,
    decode: &str,
    filter: &str,
    fields: &[&str],
) -> String {
    tshark
        .arg("-r")
        .arg(file)
        .args(["-d", decode, "-Y", filter, "-T", "fields"]);
    for field in fields {
        tshark.args(["-e", field]);
    }
    let output = tshark.stdin(Stdio::null()).output().expect("tshark starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}\n{complaint}");
    text
}
