//! The Modbus server compared with a bare TCP server and with third-party servers, in alternating rounds of
//! one run, each server a process.
//!
//! One client with prepared telegrams writes 64 registers and reads 64 (function 23): from a bare server that
//! answers as many bytes, from ours, with the default `max_age`, with 90 ms, and with 2,000 signals, in registers
//! without and with gaps, and from libmodbus, tokio-modbus and pymodbus if installed. Then 1,000 clients connect, and write one register each every
//! 100 ms. Medians over the rounds; prints one `rust NAME VALUE` per line on stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]
#![allow(unsafe_code, reason = "libmodbus is a library in C")]

#[path = "modbus/libmodbus.rs"]
mod libmodbus;
mod servers;
mod signals;

use std::fmt::Write as _;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use servers::{Server, Turn};
use tickbus::time::{Nanos, TimeHistogram};
use tickbus_base::os::raise_open_files;

/// Registers written and read in one request.
const REGISTERS: u8 = 64;

/// Size of such a request and of its answer, in bytes.
const REQUEST: usize = 7 + 10 + 2 * REGISTERS as usize;
const ANSWER: usize = 7 + 2 + 2 * REGISTERS as usize;

/// The holding register at which %I begins.
const WINDOW: u16 = 1024;

/// The first of the scattered registers that are read.
const SCATTERED: u16 = 4000;

struct Extent {
    /// Many short rounds, so that other load on the machine affects all servers alike.
    rounds: usize,
    /// Time per server and round.
    span: Duration,
    clients: usize,
    /// How long they write.
    crowd: Duration,
}

fn main() {
    servers::serve_if_told(&[("--libmodbus", || libmodbus::serve(free_address()))]);
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let extent = if measured {
        Extent {
            rounds: 100,
            span: Duration::from_millis(50),
            clients: 1000,
            crowd: Duration::from_secs(10),
        }
    } else {
        Extent {
            rounds: 1,
            span: Duration::from_millis(1),
            clients: 20,
            crowd: Duration::from_millis(200),
        }
    };
    exchanges(&extent, measured);
    crowd(&extent);
}

/// A device like the rig, with further keys of its bus.
fn device(keys: &str) -> Server {
    let (bytes, signals) = (2 * usize::from(REGISTERS), signals::latched_bits());
    Server::device(&format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n\
         inputs = \"offset:{WINDOW}\"\ninput_bytes = {bytes}\noutput_bytes = {bytes}\n{keys}\n{signals}"
    ))
}

/// A device with 2,000 signals of a register each, half of them read and half of them written: in every second register, with
/// reserved ones between them, or without a gap.
fn large_device(is_scattered: bool) -> Server {
    const EACH: usize = 1000;
    let mut text = "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"modbus-server\"\n\
                    address = \"127.0.0.1:0\"\n"
        .to_owned();
    if is_scattered {
        let areas = [('Q', 0), ('I', usize::from(SCATTERED))];
        let reserved =
            areas.map(|(_, first)| format!("{{ at = \"4{:05}\", count = 2000 }}", first + 1));
        let _ = writeln!(text, "reserved = [{}]\n[fieldbus.at]", reserved.join(", "));
        for (area, first) in areas {
            for index in 0..EACH {
                let number = first + 2 * index + 1;
                let _ = writeln!(text, "\"{area} {index}\" = \"4{number:05}\"");
            }
        }
    } else {
        let _ = writeln!(text, "inputs = \"offset:{WINDOW}\"");
    }
    for area in ['Q', 'I'] {
        for index in 0..EACH {
            let byte = 2 * index;
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {index}\"\naddress = \"%{area}W{byte}\"\ntype = \"WORD\"\n"
            );
        }
    }
    Server::device(&text)
}

/// Writes 64 registers from 0 on, and reads 64 from `reads` on.
fn request(reads: u16) -> [u8; REQUEST] {
    let mut request = [0; REQUEST];
    request[5] = u8::try_from(REQUEST - 6).expect("it is short");
    request[6..8].copy_from_slice(&[1, 23]);
    request[8..10].copy_from_slice(&reads.to_be_bytes());
    request[11] = REGISTERS;
    request[15] = REGISTERS;
    request[16] = 2 * REGISTERS;
    request
}

/// An address that is not in use at the moment.
fn free_address() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("it is bound")
}

fn pymodbus() -> Option<Server> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let address = free_address();
    let mut command = Command::new(root.join("target/peers/main/bin/python"));
    command.arg(root.join("tests/peers/modbus_server.py"));
    command.args(["tcp", "127.0.0.1", &address.port().to_string()]);
    Server::of_others(command, Some(address.to_string()))
}

/// The server built by tools/bench.
fn tokio_modbus() -> Option<Server> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = root.join("target/peers/tokio-modbus/release/tokio-modbus-server");
    Server::of_others(Command::new(program), None)
}

/// This program with libmodbus.
fn libmodbus() -> Option<Server> {
    let mut command = Command::new(std::env::current_exe().ok()?);
    command.arg("--libmodbus");
    Server::of_others(command, None)
}

fn exchanges(extent: &Extent, measured: bool) {
    let bare = Server::own(&["--bare", &REQUEST.to_string(), &ANSWER.to_string()]);
    let (ours, quick) = (device(""), device("max_age = \"90ms\""));
    let (dense, scattered) = (large_device(false), large_device(true));
    let others = if measured {
        [
            ("libmodbus", libmodbus()),
            ("tokio_modbus", tokio_modbus()),
            ("pymodbus", pymodbus()),
        ]
    } else {
        [const { ("", None) }; 3]
    };
    let turn = |name, server: &Server, reads| {
        let (mut stream, mut request) = (server.connect(), request(reads));
        Turn::new(name, move || {
            // An edge for every latch, in both directions in turn.
            for byte in &mut request[REQUEST - 2 * usize::from(REGISTERS)..][..2] {
                *byte = !*byte;
            }
            stream.write_all(&request).expect("the server reads");
            stream.read_exact(&mut [0; ANSWER]).expect("an answer");
        })
    };
    let names: Vec<String> = others
        .iter()
        .map(|(name, _)| format!("modbus.fc23.{name}"))
        .collect();
    let mut turns = vec![
        turn("modbus.fc23.bare", &bare, 0),
        turn("modbus.fc23", &ours, WINDOW),
        turn("modbus.fc23.max_age_90ms", &quick, WINDOW),
        turn("modbus.fc23.dense_2000", &dense, WINDOW),
        turn("modbus.fc23.scattered_2000", &scattered, SCATTERED),
    ];
    for ((what, server), name) in others.iter().zip(&names) {
        match server {
            Some(server) => turns.push(turn(name, server, 0)),
            None if measured => eprintln!("modbus: there is no {what} to compare with"),
            None => {}
        }
    }
    servers::by_turns(extent.rounds, extent.span, &mut turns);
}

/// Many clients, each with its own schedule; a request is timed from when it was due.
fn crowd(extent: &Extent) {
    const INTERVAL: Duration = Duration::from_millis(100);
    let count = extent.clients.min(raise_open_files().saturating_sub(100));
    let server = device("");
    let before = server.resident();
    let mut refused = 0_u32;
    let write = [0, 1, 0, 0, 0, 6, 1, 6, 0, 3, 0, 9];
    let begin = Instant::now();
    let mut clients: Vec<_> = (0..count).map(|_| server.connect()).collect();
    let connected = begin.elapsed();
    for stream in &mut clients {
        stream.write_all(&write).expect("the server reads");
        stream.read_exact(&mut [0; 12]).expect("an answer");
    }
    let memory = (server.resident() - before) / f64::from(u32::try_from(count).expect("some"));
    let mut spans = TimeHistogram::new();
    let begin = Instant::now();
    let gap = INTERVAL / u32::try_from(count).expect("some");
    let mut due = begin;
    let mut writes = 0_u32;
    for client in (0..count).cycle() {
        let early = due.saturating_duration_since(Instant::now());
        if !early.is_zero() {
            std::thread::sleep(early);
        }
        let stream = &mut clients[client];
        let mut answer = [0; 12];
        let answered = stream
            .write_all(&write)
            .and_then(|()| stream.read_exact(&mut answer));
        refused += u32::from(answered.is_err() || answer != write);
        writes += 1;
        let span = i64::try_from(due.elapsed().as_nanos()).unwrap_or(i64::MAX);
        spans.record(Nanos(span));
        due += gap;
        if begin.elapsed() >= extent.crowd {
            break;
        }
    }
    let rate = f64::from(writes) / begin.elapsed().as_secs_f64();
    println!(
        "rust modbus.crowd.connect_ms {:.1}",
        connected.as_secs_f64() * 1e3
    );
    println!("rust modbus.crowd.clients {count}");
    println!("rust modbus.crowd.writes_per_s {rate:.0}");
    println!("rust modbus.crowd.refused {refused}");
    for (name, quantile) in [("p50", 0.5), ("p99", 0.99), ("p999", 0.999)] {
        let span = spans.quantile(quantile).as_micros();
        println!("rust modbus.crowd.{name}_us {span:.0}");
    }
    println!("rust modbus.crowd.bytes_per_client {memory:.0}");
}
