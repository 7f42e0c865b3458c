//! The S7 server as its clients see it, compared with python-snap7's server and a bare TCP server, in
//! alternating rounds of one run, each server a process.
//!
//! An exchange is two transactions with prepared frames: 360 bytes are written to a data block, 134 are read
//! from another one. The bare server answers as many bytes to as many, twice. Medians over the rounds;
//! prints one `rust NAME VALUE` per line on stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]

mod servers;
mod signals;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::time::Duration;

use servers::{Server, Turn};

/// Bytes from the PLC and to it: %Q and %I.
const REQUEST: usize = 360;
const ANSWER: usize = 134;

fn main() {
    servers::serve_if_told(&[]);
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    // Short rounds, so that other load on the machine affects all servers alike.
    let (rounds, span) = if measured { (100, 50) } else { (1, 1) };

    let device = device();
    let mut ours = Client::new(device.connect());
    let sizes = [ours.write.len(), WRITTEN, ours.read.len(), READ].map(|size| size.to_string());
    let bare = Server::own(&["--bare", &sizes[0], &sizes[1], &sizes[2], &sizes[3]]);
    let mut stream = bare.connect();
    let frames = (ours.write.clone(), ours.read.clone());
    let mut turns = vec![
        Turn::new("s7.exchange.bare", move || {
            let (mut written, mut read) = ([0; WRITTEN], [0; READ]);
            stream.write_all(&frames.0).expect("the server reads");
            stream.read_exact(&mut written).expect("an answer");
            stream.write_all(&frames.1).expect("the server reads");
            stream.read_exact(&mut read).expect("an answer");
        }),
        Turn::new("s7.exchange", move || ours.exchange()),
    ];
    let python = measured.then(snap7).flatten();
    if let Some(python) = &python {
        let mut theirs = Client::new(python.connect());
        turns.push(Turn::new("s7.exchange.snap7", move || theirs.exchange()));
    }
    servers::by_turns(rounds, Duration::from_millis(span), &mut turns);
}

/// A device like the rig.
fn device() -> Server {
    let signals = signals::latched_bits();
    Server::device(&format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"s7-server\"\naddress = \"127.0.0.1:0\"\n\
         input_bytes = {ANSWER}\noutput_bytes = {REQUEST}\n\
         db = [{{ number = 1, area = \"%Q\" }}, {{ number = 2, area = \"%I\" }}]\n{signals}"
    ))
}

/// A server of python-snap7, if it is installed.
fn snap7() -> Option<Server> {
    const ROOT: &str = env!("CARGO_MANIFEST_DIR");
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = free.local_addr().expect("it is bound");
    drop(free);
    let mut command = Command::new(format!("{ROOT}/target/peers/main/bin/python"));
    command.arg(format!("{ROOT}/tests/peers/snap7_server.py"));
    command.arg(address.port().to_string());
    let server = Server::of_others(command, Some(address.to_string()));
    if server.is_none() {
        eprintln!("s7: there is no python-snap7 to compare with: run tools/peers");
    }
    server
}

/// A client with its frames.
struct Client {
    stream: TcpStream,
    write: Vec<u8>,
    read: Vec<u8>,
}

/// Lengths of the answers: packet header, PDU header, function and number of items; then a return code, or an
/// item's data.
const WRITTEN: usize = 7 + 12 + 2 + 1;
const READ: usize = 7 + 12 + 2 + 4 + ANSWER;

impl Client {
    fn new(mut stream: TcpStream) -> Self {
        let connect = [
            3, 0, 0, 22, 17, 0xE0, 0, 0, 0, 1, 0, 0xC0, 1, 10, 0xC1, 2, 1, 0, 0xC2, 2, 1, 1,
        ];
        stream.write_all(&connect).expect("the server reads");
        stream.read_exact(&mut [0; 22]).expect("a confirmation");
        let agree = job(&[0xF0, 0, 0, 1, 0, 1, 1, 0xE0], &[]);
        stream.write_all(&agree).expect("the server reads");
        stream.read_exact(&mut [0; 27]).expect("an agreement");
        let short = |number: usize| u16::try_from(number).expect("short").to_be_bytes();
        let item = |function: u8, block: u8, bytes: usize| {
            let [high, low] = short(bytes);
            vec![
                function, 1, 0x12, 10, 0x10, 2, high, low, 0, block, 0x84, 0, 0, 0,
            ]
        };
        let [high, low] = short(REQUEST * 8);
        let data = [&[0, 4, high, low][..], &[0; REQUEST]].concat();
        Self {
            stream,
            write: job(&item(5, 1, REQUEST), &data),
            read: job(&item(4, 2, ANSWER), &[]),
        }
    }

    fn exchange(&mut self) {
        let (mut written, mut read) = ([0; WRITTEN], [0; READ]);
        // An edge for every latch, in both directions in turn.
        let first = self.write.len() - REQUEST;
        for byte in &mut self.write[first..first + 2] {
            *byte = !*byte;
        }
        self.stream
            .write_all(&self.write)
            .expect("the server reads");
        self.stream.read_exact(&mut written).expect("an answer");
        assert_eq!(written[WRITTEN - 1], 0xFF);
        self.stream.write_all(&self.read).expect("the server reads");
        self.stream.read_exact(&mut read).expect("an answer");
        assert_eq!(read[WRITTEN - 1], 0xFF);
    }
}

/// A packet with a job.
fn job(parameters: &[u8], data: &[u8]) -> Vec<u8> {
    let short = |number: usize| u16::try_from(number).expect("short").to_be_bytes();
    let [l0, l1] = short(17 + parameters.len() + data.len());
    let ([p0, p1], [d0, d1]) = (short(parameters.len()), short(data.len()));
    let header = [
        3, 0, l0, l1, 2, 0xF0, 0x80, 0x32, 1, 0, 0, 0, 1, p0, p1, d0, d1,
    ];
    [&header[..], parameters, data].concat()
}
