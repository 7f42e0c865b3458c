//! The socket bus as its peer sees it, compared with bare TCP, in alternating rounds of one run.
//!
//! `reply`: a client sends 360 bytes and waits for 134, from a Device with `send = "reply"` and from a bare
//! server. `cycle`: 134 bytes every 10 ms, from a Device and from a bare thread that sleeps until its
//! deadlines. Medians over the rounds; prints one `rust NAME VALUE` per line on stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]

use std::fmt::Write as _;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Monotonic;

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

/// A Device with 16 latched bits in each direction, like the rig, and its listening address.
fn device(keys: &str) -> (Driver, String) {
    let mut text = format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
         max_age = \"1h\"\ninput_bytes = {ANSWER}\noutput_bytes = {REQUEST}\n{keys}\n"
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

/// Sends and receives for `span`; returns the exchanges per second.
fn ping_pong(stream: &mut TcpStream, span: Duration) -> f64 {
    let (request, mut answer) = ([0; REQUEST], [0; ANSWER]);
    let begin = Instant::now();
    let mut exchanges = 0_u32;
    while begin.elapsed() < span {
        // The clock is read only once per batch.
        for _ in 0..50 {
            stream.write_all(&request).expect("the other end reads");
            stream.read_exact(&mut answer).expect("an answer");
        }
        exchanges += 50;
    }
    f64::from(exchanges) / begin.elapsed().as_secs_f64()
}

fn reply(extent: &Extent) {
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
    let (driver, address) = device("send = \"reply\"");
    let mut adapter = connect(&address);

    ping_pong(&mut bare, extent.replying);
    ping_pong(&mut adapter, extent.replying);
    let (mut rates, mut bare_rates, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..extent.replies {
        let bare = ping_pong(&mut bare, extent.replying);
        let rate = ping_pong(&mut adapter, extent.replying);
        bare_rates.push(bare);
        rates.push(rate);
        ratios.push(rate / bare);
    }
    drop(bare);
    server.join().expect("no panic");
    driver.close();
    println!("rust socket.reply {:.0}", median(&mut rates));
    println!("rust socket.reply.bare {:.0}", median(&mut bare_rates));
    println!("rust socket.reply.ratio {:.3}", median(&mut ratios));
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
    /// Receives `cycles` records and one more, and records the times between them.
    fn receive(&mut self, stream: &mut TcpStream, cycles: usize) {
        let mut record = [0; ANSWER];
        stream.read_exact(&mut record).expect("a first record");
        let begin = Instant::now();
        let mut last = begin;
        let mut passed = 0.0;
        for _ in 0..cycles {
            stream.read_exact(&mut record).expect("a record");
            let now = Instant::now();
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

/// Sends a record at each deadline until the other end is gone; missed ones are skipped, as by the bus.
fn send_on_deadlines(mut stream: TcpStream) {
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
        let (driver, address) = device("cycle = \"10ms\"");
        device_records.receive(&mut connect(&address), extent.cycles);
        driver.close();

        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let mut stream = connect(&listener.local_addr().expect("it is bound").to_string());
        let (served, _) = listener.accept().expect("it connects");
        served.set_nodelay(true).expect("a TCP option");
        let sender = std::thread::spawn(move || send_on_deadlines(served));
        bare_records.receive(&mut stream, extent.cycles);
        drop(stream);
        sender.join().expect("no panic");
    }
    device_records.print("socket.cycle");
    bare_records.print("socket.cycle.bare");
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
