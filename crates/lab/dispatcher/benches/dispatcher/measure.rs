//! The measurements.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use tickbus_base::os::raise_open_files;
use tickbus_base::time::{Monotonic, Nanos, Stop, TimeHistogram};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{Dispatcher, Patch, Settings, Traffic};
use tickbus_net::Address;

use crate::hub;
use crate::mosquitto::{self, Mosquitto};
use crate::nats::Nats;

/// The argument that makes this program the idle clients.
const IDLE: &str = "--idle-clients";

/// Lines of one round over one pair.
const BATCH: usize = 1024;

struct Extent {
    rounds: usize,
    /// Time per server and round.
    span: Duration,
    pairs: usize,
    /// Lines at 500 per second.
    slow: u32,
    idle: usize,
    active: usize,
}

/// The clients of one server, in pairs of a sender and a receiver.
struct Pairs {
    name: &'static str,
    streams: Vec<(TcpStream, TcpStream)>,
    /// Makes the message that sends one value through a pair.
    message: fn(usize, usize) -> String,
}

pub(crate) fn run() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, argument, address, count] = &*arguments
        && argument == IDLE
    {
        return be_idle(address, count);
    }
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let is_measured = arguments.iter().any(|argument| argument == "--bench");
    let extent = if is_measured {
        Extent {
            rounds: 20,
            span: Duration::from_millis(100),
            pairs: 100,
            slow: 2000,
            idle: 10_000,
            active: 1000,
        }
    } else {
        Extent {
            rounds: 1,
            span: Duration::from_millis(1),
            pairs: 3,
            slow: 5,
            idle: 20,
            active: 4,
        }
    };
    let nats = is_measured.then(Nats::start).flatten();
    if nats.is_none() {
        eprintln!("dispatcher: there is no nats-server; it is left out");
    }
    let broker = is_measured.then(Mosquitto::start).flatten();
    if broker.is_none() {
        eprintln!("dispatcher: there is no mosquitto; it is left out");
    }
    let stop = Stop::new();
    let (address, served) = start(&stop);
    let connect = |count| {
        let mut all = vec![ours(address, count), bare(hub::start(), count)];
        all.extend(nats.as_ref().map(|server| through_nats(server, count)));
        all.extend(
            broker
                .as_ref()
                .map(|broker| through_mosquitto(broker, count)),
        );
        all
    };
    let mut one = connect(1);
    compare("pair.write_per_line", &extent, &mut one, |pairs, span| {
        pairs.batches(1, span)
    });
    compare("pair.64_per_write", &extent, &mut one, |pairs, span| {
        pairs.batches(64, span)
    });
    latency(&extent, &mut one);
    drop(one);
    let mut many = connect(extent.pairs);
    compare("pairs", &extent, &mut many, Pairs::turns);
    drop(many);
    crowd(&extent, address);
    stop.stop();
    let traffic = served.join().expect("no panic");
    println!("rust dispatcher.values {}", traffic.values);
    println!("rust dispatcher.overtaken {}", traffic.overtaken);
}

/// Starts a dispatcher.
fn start(stop: &Stop) -> (SocketAddr, thread::JoinHandle<Traffic>) {
    let listener = Listener::bind(&Address::local(0)).expect("a free port");
    let address = listener.address();
    let stop = stop.clone();
    let settings = Settings {
        idle: Nanos::from_secs(3600),
        ..Settings::default()
    };
    let served = thread::spawn(move || {
        let mut dispatcher = Dispatcher::new(settings, Patch::new());
        let hosting = Hosting {
            clock: &*Monotonic::shared(),
            stop: &stop,
            door: None,
            patch_file: None,
            news: &mut |line| eprintln!("dispatcher: {line}"),
        };
        listener.run(&mut dispatcher, hosting).expect("it serves");
        dispatcher.traffic()
    });
    (address, served)
}

/// A client of the dispatcher that has sent `words` and received a line that begins with `until`.
fn client(address: SocketAddr, words: &str, until: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).expect("it listens");
    stream.set_nodelay(true).expect("a TCP option");
    stream.write_all(words.as_bytes()).expect("it reads");
    let mut lines = BufReader::new(&stream).lines();
    while !lines
        .next()
        .expect("a line")
        .expect("text")
        .starts_with(until)
    {}
    stream
}

fn ours(address: SocketAddr, count: usize) -> Pairs {
    let pair = |at| {
        let sender = client(address, &format!("VR A{at} Q01 V=2\r\n"), "END");
        let words = format!("VP B{at} I01 V=2\r\nCONNECT I1:A{at}:Q1\r\n");
        (sender, client(address, &words, "OK CONNECT"))
    };
    Pairs {
        name: "",
        streams: (0..count).map(pair).collect(),
        message: |_, value| format!("P Q1={value}\r\n"),
    }
}

fn bare(address: SocketAddr, count: usize) -> Pairs {
    let connect = || {
        let stream = TcpStream::connect(address).expect("it listens");
        stream.set_nodelay(true).expect("a TCP option");
        stream
    };
    Pairs {
        name: ".bare",
        streams: (0..count).map(|_| (connect(), connect())).collect(),
        message: |_, value| format!("P I1={value}\r\n"),
    }
}

fn through_nats(server: &Nats, count: usize) -> Pairs {
    let pair = |at| {
        (
            server.connect(""),
            server.connect(&format!("SUB s{at} 1\r\n")),
        )
    };
    Pairs {
        name: ".nats",
        streams: (0..count).map(pair).collect(),
        message: |pair, value| {
            let text = format!("P Q1={value}");
            format!("PUB s{pair} {}\r\n{text}\r\n", text.len())
        },
    }
}

fn through_mosquitto(broker: &Mosquitto, count: usize) -> Pairs {
    let pair = |at| {
        let topic = format!("s{at}");
        let name = format!("{count}-{at}");
        let receiver = broker.connect(&format!("to-{name}"), Some(&topic));
        (broker.connect(&format!("from-{name}"), None), receiver)
    };
    Pairs {
        name: ".mosquitto",
        streams: (0..count).map(pair).collect(),
        message: |pair, value| mosquitto::publish(&format!("s{pair}"), &format!("P Q1={value}")),
    }
}

/// Reads this many values: each has one sign of equality, and NATS's own lines have none.
fn read_values(mut stream: &TcpStream, mut count: usize, buffer: &mut [u8]) {
    while count > 0 {
        let length = stream.read(buffer).expect("lines arrive");
        assert!(length > 0, "the connection is closed");
        let values = buffer[..length]
            .iter()
            .filter(|byte| **byte == b'=')
            .count();
        count = count.checked_sub(values).expect("no more than was sent");
    }
}

impl Pairs {
    /// Sends through the first pair, `per_write` lines at a time; returns lines per second.
    fn batches(&mut self, per_write: usize, span: Duration) -> f64 {
        let lines: Vec<String> = (0..BATCH)
            .map(|value| (self.message)(0, 1000 + value))
            .collect();
        let writes: Vec<String> = lines.chunks(per_write).map(<[String]>::concat).collect();
        let (sender, receiver) = &mut self.streams[0];
        let mut buffer = vec![0; 64 * 1024];
        let begin = Instant::now();
        let mut count = 0.0;
        while begin.elapsed() < span {
            for write in &writes {
                sender.write_all(write.as_bytes()).expect("it reads");
            }
            read_values(receiver, BATCH, &mut buffer);
            count += BATCH as f64;
        }
        count / begin.elapsed().as_secs_f64()
    }

    /// Sends a line through each pair, over and over; returns lines per second.
    fn turns(&mut self, span: Duration) -> f64 {
        let pairs = 0..self.streams.len();
        let lines: Vec<[String; 2]> = pairs
            .map(|pair| [(self.message)(pair, 1000), (self.message)(pair, 1001)])
            .collect();
        let mut buffer = vec![0; 64 * 1024];
        let begin = Instant::now();
        let mut turn = 0;
        while begin.elapsed() < span {
            for ((sender, _), lines) in self.streams.iter_mut().zip(&lines) {
                sender
                    .write_all(lines[turn % 2].as_bytes())
                    .expect("it reads");
            }
            for (_, receiver) in &self.streams {
                read_values(receiver, 1, &mut buffer);
            }
            turn += 1;
        }
        // The next span begins with a different value than the last one of this span.
        if turn % 2 == 1 {
            for ((sender, receiver), lines) in self.streams.iter_mut().zip(&lines) {
                sender.write_all(lines[1].as_bytes()).expect("it reads");
                read_values(receiver, 1, &mut buffer);
            }
        }
        (turn * self.streams.len()) as f64 / begin.elapsed().as_secs_f64()
    }
}

fn compare(
    name: &str,
    extent: &Extent,
    servers: &mut [Pairs],
    measure: impl Fn(&mut Pairs, Duration) -> f64,
) {
    let mut rates = vec![Vec::new(); servers.len()];
    for _ in 0..extent.rounds {
        for (server, rates) in servers.iter_mut().zip(&mut rates) {
            rates.push(measure(server, extent.span));
        }
    }
    let ours = median(&mut rates[0].clone());
    for (server, rates) in servers.iter().zip(&mut rates) {
        let rate = median(rates);
        println!("rust dispatcher.{name}{} {rate:.0}", server.name);
        if !server.name.is_empty() {
            println!(
                "rust dispatcher.{name}.ratio{} {:.3}",
                server.name,
                ours / rate
            );
        }
    }
}

fn latency(extent: &Extent, servers: &mut [Pairs]) {
    const INTERVAL: Duration = Duration::from_millis(2);

    let mut buffer = vec![0; 4096];
    let mut spans: Vec<_> = servers.iter().map(|_| TimeHistogram::new()).collect();
    let mut due = Instant::now();
    for turn in 0..extent.slow {
        for (server, spans) in servers.iter_mut().zip(&mut spans) {
            thread::sleep(due.saturating_duration_since(Instant::now()));
            let message = (server.message)(0, 1000 + turn as usize % 2);
            let (sender, receiver) = &mut server.streams[0];
            let begin = Instant::now();
            sender.write_all(message.as_bytes()).expect("it reads");
            read_values(receiver, 1, &mut buffer);
            let span = i64::try_from(begin.elapsed().as_nanos()).unwrap_or(i64::MAX);
            spans.record(Nanos(span));
            due += INTERVAL;
        }
    }
    for (server, spans) in servers.iter().zip(&spans) {
        for (name, quantile) in [("p50", 0.5), ("p99", 0.99)] {
            let span = spans.quantile(quantile).as_micros();
            println!("rust dispatcher.latency.{name}_us{} {span:.1}", server.name);
        }
    }
}

/// Resident memory of this process, in bytes.
fn resident() -> f64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = text.split(' ').nth(1).and_then(|pages| pages.parse().ok());
    pages.unwrap_or(0.0) * 4096.0
}

fn crowd(extent: &Extent, address: SocketAddr) {
    raise_open_files();
    let before = resident();
    // In a separate process: the limit of open files and the measured memory then belong to the server alone.
    let mut idle = Command::new(std::env::current_exe().expect("a path"))
        .args([IDLE, &address.to_string(), &extent.idle.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("this program");
    let said = BufReader::new(idle.stdout.take().expect("a pipe"))
        .lines()
        .next();
    assert_eq!(said.expect("a line").expect("text"), "ready");
    let memory = (resident() - before) / extent.idle as f64;
    let mut pairs = ours(address, extent.active / 2);
    let mut rates: Vec<_> = (0..extent.rounds)
        .map(|_| pairs.turns(extent.span))
        .collect();
    println!("rust dispatcher.crowd.idle {}", extent.idle);
    println!("rust dispatcher.crowd.active {}", 2 * pairs.streams.len());
    println!("rust dispatcher.crowd.bytes_per_client {memory:.0}");
    println!(
        "rust dispatcher.crowd.us_per_line {:.3}",
        1e6 / median(&mut rates)
    );
    drop(idle.stdin.take());
    idle.wait().expect("it ends");
}

/// The other process: idle clients, until stdin ends.
fn be_idle(address: &str, count: &str) {
    raise_open_files();
    let address = address.parse().expect("an address");
    let count: usize = count.parse().expect("a number");
    let name = |at| format!("VP IDLE{at} Q08 I08 AQ02 AI03 V=2\r\n");
    let kept: Vec<_> = (0..count)
        .map(|at| client(address, &name(at), "END"))
        .collect();
    println!("ready");
    let _ = std::io::stdin().read(&mut [0]);
    drop(kept);
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
