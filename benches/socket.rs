//! The socket bus as its peer sees it, compared with bare TCP, in alternating rounds of one run, each server a process.
//!
//! `reply`: a client sends 360 bytes and waits for 134, from a device with `send = "reply"`, with the default
//! `max_age` and with 90 ms, and from a bare server. `cycle`: 134 bytes every 10 ms, from a device and from a bare server that sleeps until its
//! deadlines. Medians over the rounds; prints one `rust NAME VALUE` per line on stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]

mod servers;
mod signals;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use servers::{Server, Turn, median};

/// Bytes from the PLC and to it: %Q and %I.
const REQUEST: usize = 360;
const ANSWER: usize = 134;

const CYCLE: Duration = Duration::from_millis(10);

/// The extent of the measurement.
struct Extent {
    rounds: usize,
    /// Many short rounds of ping-pong, so that other load on the machine affects both alike.
    replies: usize,
    /// Time per kind of ping-pong and round.
    replying: Duration,
    /// Cycles per kind and round.
    cycles: usize,
}

fn main() {
    servers::serve_if_told(&[("--deadlines", send_on_deadlines)]);
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let extent = if measured {
        Extent {
            rounds: 7,
            replies: 100,
            replying: Duration::from_millis(50),
            cycles: 400,
        }
    } else {
        Extent {
            rounds: 1,
            replies: 1,
            replying: Duration::from_millis(1),
            cycles: 2,
        }
    };
    reply(&extent);
    cycle(&extent);
}

/// A device like the rig.
fn device(keys: &str) -> Server {
    let signals = signals::latched_bits();
    Server::device(&format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
         input_bytes = {ANSWER}\noutput_bytes = {REQUEST}\n{keys}\n{signals}"
    ))
}

fn reply(extent: &Extent) {
    let bare = Server::own(&["--bare", &REQUEST.to_string(), &ANSWER.to_string()]);
    let ours = device("send = \"reply\"");
    let quick = device("send = \"reply\"\nmax_age = \"90ms\"");
    let turn = |name, server: &Server| {
        let (mut stream, mut request) = (server.connect(), [0; REQUEST]);
        Turn::new(name, move || {
            // An edge for every latch, in both directions in turn.
            for byte in &mut request[..2] {
                *byte = !*byte;
            }
            stream.write_all(&request).expect("the server reads");
            stream.read_exact(&mut [0; ANSWER]).expect("an answer");
        })
    };
    let mut turns = [
        turn("socket.reply.bare", &bare),
        turn("socket.reply", &ours),
        turn("socket.reply.max_age_90ms", &quick),
    ];
    servers::by_turns(extent.replies, extent.replying, &mut turns);
}

/// The times at which records arrived.
#[derive(Default)]
struct Intervals {
    means: Vec<f64>,
    deviations: Vec<f64>,
    gaps: usize,
    missed: f64,
}

impl Intervals {
    /// Receives `cycles` records and one more, answers each with `said`, and records the times between them.
    fn receive(&mut self, stream: &mut TcpStream, said: &[u8], cycles: usize) {
        let mut record = [0; ANSWER];
        stream.read_exact(&mut record).expect("a first record");
        let begin = Instant::now();
        let mut last = begin;
        let mut passed = 0.0;
        for _ in 0..cycles {
            stream.read_exact(&mut record).expect("a record");
            let now = Instant::now();
            stream.write_all(said).expect("the server reads");
            let interval = now - last;
            last = now;
            self.deviations
                .push(interval.abs_diff(CYCLE).as_secs_f64() * 1e6);
            self.gaps += usize::from(interval > CYCLE + CYCLE / 5);
            // A skipped cycle is removed from its interval, since only the drift is of interest.
            let here = interval.div_duration_f64(CYCLE).round();
            passed += here;
            self.missed += here - 1.0;
        }
        self.means.push((last - begin).as_secs_f64() * 1e3 / passed);
    }

    fn print(mut self, name: &str) {
        println!("rust {name}.mean_ms {:.4}", median(&mut self.means));
        println!("rust {name}.p50_us {:.1}", median(&mut self.deviations));
        println!("rust {name}.gaps {}", self.gaps);
        println!("rust {name}.missed {}", self.missed);
    }
}

/// Sends a record to one client at each deadline until that is gone; missed ones are skipped, as by the bus.
fn send_on_deadlines() {
    let mut stream = servers::accept_one();
    let mut due = Instant::now();
    while stream.write_all(&[0; ANSWER]).is_ok() {
        while due <= Instant::now() {
            due += CYCLE;
        }
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}

fn cycle(extent: &Extent) {
    let (mut device_records, mut bare_records) = (Intervals::default(), Intervals::default());
    for _ in 0..extent.rounds {
        let server = device("cycle = \"10ms\"");
        // A device drops a peer that says nothing.
        device_records.receive(&mut server.connect(), &[0; REQUEST], extent.cycles);
        let server = Server::own(&["--deadlines"]);
        bare_records.receive(&mut server.connect(), &[], extent.cycles);
    }
    device_records.print("socket.cycle");
    bare_records.print("socket.cycle.bare");
}
