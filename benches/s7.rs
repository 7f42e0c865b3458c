//! The S7 server as its clients see it, compared with python-snap7's server and a bare TCP server, in
//! alternating rounds of one run.
//!
//! An exchange is two transactions with prepared frames: 360 bytes are written to a data block, 134 are read
//! from another one. The bare TCP server receives 360 bytes and sends 134, once. Medians over the rounds;
//! prints one `rust NAME VALUE` per line on stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Monotonic;

/// Bytes from the PLC and to it: %Q and %I.
const REQUEST: usize = 360;
const ANSWER: usize = 134;

/// The extent of the measurement.
struct Extent {
    rounds: usize,
    /// Time per server and round: short, so that other load on the machine affects all servers alike.
    span: Duration,
}

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let extent = if measured {
        Extent {
            rounds: 100,
            span: Duration::from_millis(50),
        }
    } else {
        Extent {
            rounds: 1,
            span: Duration::from_millis(1),
        }
    };
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
    let mut ours = Client::new(&address);
    let python = Python::start();
    let mut theirs = python.as_ref().map(|python| Client::new(&python.address));

    let (mut rates, mut bare_rates, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let (mut their_rates, mut their_ratios) = (Vec::new(), Vec::new());
    // The first round warms up.
    for round in 0..=extent.rounds {
        let bare = rate(extent.span, || {
            let mut answer = [0; ANSWER];
            bare.write_all(&[0; REQUEST]).expect("the other end reads");
            bare.read_exact(&mut answer).expect("an answer");
        });
        let rate_of_ours = rate(extent.span, || ours.exchange());
        let rate_of_theirs = theirs
            .as_mut()
            .map(|theirs| rate(extent.span, || theirs.exchange()));
        if round == 0 && extent.rounds > 1 {
            continue;
        }
        bare_rates.push(bare);
        rates.push(rate_of_ours);
        ratios.push(rate_of_ours / bare);
        their_rates.extend(rate_of_theirs);
        their_ratios.extend(rate_of_theirs.map(|theirs| theirs / bare));
    }
    drop(bare);
    server.join().expect("no panic");
    driver.close();
    println!("rust s7.exchange {:.0}", median(&mut rates));
    println!("rust s7.exchange.bare {:.0}", median(&mut bare_rates));
    println!("rust s7.exchange.ratio {:.3}", median(&mut ratios));
    if !their_rates.is_empty() {
        println!("rust s7.exchange.snap7 {:.0}", median(&mut their_rates));
        println!(
            "rust s7.exchange.snap7_ratio {:.3}",
            median(&mut their_ratios)
        );
    }
}

/// A Device with 16 latched bits in each direction, like the rig, and its listening address.
fn device() -> (Driver, String) {
    let mut text = format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"s7-server\"\naddress = \"127.0.0.1:0\"\n\
         max_age = \"1h\"\ninput_bytes = {ANSWER}\noutput_bytes = {REQUEST}\n\
         db = [{{ number = 1, area = \"%Q\" }}, {{ number = 2, area = \"%I\" }}]\n"
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
    fn new(address: &str) -> Self {
        let mut stream = connect(address);
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

/// A server of python-snap7, if it is installed.
struct Python {
    process: Child,
    address: String,
}

impl Python {
    fn start() -> Option<Self> {
        const ROOT: &str = env!("CARGO_MANIFEST_DIR");
        let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = free.local_addr().expect("it is bound");
        drop(free);
        let mut process = Command::new(format!("{ROOT}/target/peers/main/bin/python"))
            .args([
                format!("{ROOT}/tests/peers/snap7_server.py"),
                address.port().to_string(),
            ])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut line = String::new();
        let out = process.stdout.take()?;
        BufReader::new(out).read_line(&mut line).ok()?;
        if line != "ready\n" {
            eprintln!("no server of python-snap7: run tools/peers");
            let _ = process.wait();
            return None;
        }
        Some(Self {
            process,
            address: address.to_string(),
        })
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        // It ends with its stdin.
        drop(self.process.stdin.take());
        let _ = self.process.wait();
    }
}

/// The rate of `once` per second.
fn rate(span: Duration, mut once: impl FnMut()) -> f64 {
    let begin = Instant::now();
    let mut count = 0_u32;
    while begin.elapsed() < span {
        // The clock is read only once per batch.
        for _ in 0..10 {
            once();
        }
        count += 10;
    }
    f64::from(count) / begin.elapsed().as_secs_f64()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
