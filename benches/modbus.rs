//! The Modbus server compared with a bare TCP server and with third-party servers, in alternating rounds of
//! one run.
//!
//! One client with prepared telegrams writes 64 registers and reads 64 (function 23): from a bare server that
//! answers as many bytes, from ours, and from libmodbus, tokio-modbus and pymodbus if installed. Then 1,000
//! clients write one register each every 100 ms. Medians over the rounds; prints one `rust NAME VALUE` per
//! line on stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]
#![allow(unsafe_code, reason = "libmodbus is a library in C")]

#[path = "modbus/libmodbus.rs"]
mod libmodbus;

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::{Monotonic, Nanos, TimeHistogram};
use tickbus_base::os::raise_open_files;

/// Registers written and read in one request.
const REGISTERS: u8 = 64;

/// Size of such a request and of its answer, in bytes.
const REQUEST: usize = 7 + 10 + 2 * REGISTERS as usize;
const ANSWER: usize = 7 + 2 + 2 * REGISTERS as usize;

/// The holding register at which %I begins.
const WINDOW: u16 = 1024;

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

/// A Device with 16 latched bits in each direction, like the rig, and its listening address.
fn device() -> (Driver, String) {
    let bytes = 2 * usize::from(REGISTERS);
    let mut text = format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n\
         inputs = \"offset:{WINDOW}\"\nmax_age = \"1h\"\ninput_bytes = {bytes}\noutput_bytes = {bytes}\n"
    );
    for area in ['Q', 'I'] {
        for bit in 0..16 {
            let (byte, bit) = (1 - bit / 8, bit % 8);
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {byte}.{bit}\"\naddress = \"%{area}X{byte}.{bit}\"\n\
                 latch = \"rising\"\n"
            );
        }
    }
    let config =
        Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let clock = Monotonic::shared();
    let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
    loop {
        let statistics = driver.statistics();
        let address = statistics
            .lines()
            .find_map(|line| line.strip_prefix("address="));
        if let Some(address) = address {
            return (driver, address.to_owned());
        }
        std::thread::yield_now();
    }
}

fn connect(address: &str) -> TcpStream {
    let stream = TcpStream::connect(address).expect("somebody listens");
    stream.set_nodelay(true).expect("a TCP option");
    stream
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

/// Sends requests for `span`; returns the exchanges per second.
fn ping_pong(stream: &mut TcpStream, request: &[u8], span: Duration) -> f64 {
    let mut answer = [0; ANSWER];
    let begin = Instant::now();
    let mut exchanges = 0_u32;
    while begin.elapsed() < span {
        // The clock is read only once per batch.
        for _ in 0..10 {
            stream.write_all(request).expect("the other end reads");
            stream.read_exact(&mut answer).expect("an answer");
        }
        exchanges += 10;
    }
    f64::from(exchanges) / begin.elapsed().as_secs_f64()
}

/// A server in a child process that prints a line when it is ready: with its address, or anything if it was
/// given one.
struct Peer(Child);

impl Peer {
    fn start(mut command: Command) -> Option<(Self, String)> {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let told = child.stdout.take().expect("a pipe");
        let first = BufReader::new(told).lines().next();
        let peer = Self(child);
        Some((peer, first?.ok()?))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// An address that is not in use at the moment.
fn free_address() -> std::net::SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("it is bound")
}

fn pymodbus() -> Option<(Peer, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let address = free_address();
    let mut command = Command::new(root.join("target/peers/main/bin/python"));
    command.arg(root.join("tests/peers/modbus_server.py"));
    command.args(["tcp", "127.0.0.1", &address.port().to_string()]);
    let (peer, _) = Peer::start(command)?;
    Some((peer, address.to_string()))
}

/// The server built by tools/bench.
fn tokio_modbus() -> Option<(Peer, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    Peer::start(Command::new(
        root.join("target/peers/tokio-modbus/release/tokio-modbus-server"),
    ))
}

fn exchanges(extent: &Extent, measured: bool) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let mut bare = connect(&listener.local_addr().expect("it is bound").to_string());
    let (mut served, _) = listener.accept().expect("it connects");
    served.set_nodelay(true).expect("a TCP option");
    let server = std::thread::spawn(move || {
        let (mut request, answer) = ([0; REQUEST], [0; ANSWER]);
        while served.read_exact(&mut request).is_ok() {
            served.write_all(&answer).expect("the client reads");
        }
    });
    let (driver, address) = device();
    let mut kept = Vec::new();
    let mut servers = vec![("", connect(&address), request(WINDOW), Vec::new())];
    if measured {
        let libmodbus = libmodbus::serve(free_address());
        let mut add = |name, address: Option<String>| match address {
            Some(address) => servers.push((name, connect(&address), request(0), Vec::new())),
            None => eprintln!("modbus: there is no{}", name.replace(['.', '_'], " ")),
        };
        add(".libmodbus", libmodbus.map(|address| address.to_string()));
        for (name, peer) in [(".tokio_modbus", tokio_modbus()), (".pymodbus", pymodbus())] {
            let (peer, address) = peer.unzip();
            kept.push(peer);
            add(name, address);
        }
    }
    let any = request(0);
    ping_pong(&mut bare, &any, extent.span);
    let mut bare_rates = Vec::new();
    for _ in 0..extent.rounds {
        let bare = ping_pong(&mut bare, &any, extent.span);
        bare_rates.push(bare);
        for (_, stream, request, rates) in &mut servers {
            let rate = ping_pong(stream, &*request, extent.span);
            rates.push((rate, rate / bare));
        }
    }
    drop(bare);
    server.join().expect("no panic");
    driver.close();
    println!("rust modbus.fc23.bare {:.0}", median(&mut bare_rates));
    for (name, _, _, rates) in servers {
        let (mut rates, mut ratios): (Vec<f64>, Vec<f64>) = rates.into_iter().unzip();
        println!("rust modbus.fc23{name} {:.0}", median(&mut rates));
        println!("rust modbus.fc23{name}.ratio {:.3}", median(&mut ratios));
    }
}

/// Resident memory of this process, in bytes.
fn resident() -> f64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = text.split(' ').nth(1).and_then(|pages| pages.parse().ok());
    pages.unwrap_or(0.0) * 4096.0
}

/// Many clients, each with its own schedule; a request is timed from when it was due.
fn crowd(extent: &Extent) {
    const INTERVAL: Duration = Duration::from_millis(100);
    // Both ends of each connection are in this process.
    let count = extent
        .clients
        .min(raise_open_files().saturating_sub(100) / 2);
    let (driver, address) = device();
    let before = resident();
    let mut refused = 0_u32;
    let write = [0, 1, 0, 0, 0, 6, 1, 6, 0, 3, 0, 9];
    let mut clients = Vec::with_capacity(count);
    for _ in 0..count {
        let mut stream = connect(&address);
        stream.write_all(&write).expect("the server reads");
        stream.read_exact(&mut [0; 12]).expect("an answer");
        clients.push(stream);
    }
    let memory = (resident() - before) / f64::from(u32::try_from(count).expect("some"));
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
    driver.close();
    println!("rust modbus.crowd.clients {count}");
    println!("rust modbus.crowd.writes_per_s {rate:.0}");
    println!("rust modbus.crowd.refused {refused}");
    for (name, quantile) in [("p50", 0.5), ("p99", 0.99), ("p999", 0.999)] {
        let span = spans.quantile(quantile).as_micros();
        println!("rust modbus.crowd.{name}_us {span:.0}");
    }
    println!("rust modbus.crowd.bytes_per_client {memory:.0}");
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
