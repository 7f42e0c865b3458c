//! Servers in processes of their own, as every client meets one: this program again, with its role in the arguments, or a
//! program of others. A server that is a thread of its client would look better than it is.
#![allow(dead_code, reason = "each bench needs a part of it")]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Monotonic, Nanos};
use tickbus_base::os::raise_open_files;

/// A server, which is ended when this is dropped.
pub(crate) struct Server {
    process: Child,
    pub(crate) address: String,
}

impl Server {
    /// This program in a role of [`serve_if_told`].
    pub(crate) fn own(role: &[&str]) -> Self {
        let mut command = Command::new(std::env::current_exe().expect("this program has a file"));
        command.args(role).stderr(Stdio::inherit());
        Self::started(command, None).expect("the server starts")
    }

    /// A device with this `driver.cfg`.
    pub(crate) fn device(text: &str) -> Self {
        let mut command = Command::new(std::env::current_exe().expect("this program has a file"));
        command.arg("--device").stderr(Stdio::inherit());
        Self::started(command, Some(text)).expect("the server starts")
    }

    /// A program whose first line is its address, or for one that was given an address, any line.
    pub(crate) fn of_others(mut command: Command, given: Option<String>) -> Option<Self> {
        command.stderr(Stdio::null());
        let mut server = Self::started(command, None)?;
        if let Some(given) = given {
            server.address = given;
        }
        Some(server)
    }

    /// The program gets `input` as the whole of its stdin; without it, a stdin that stays open.
    fn started(mut command: Command, input: Option<&str>) -> Option<Self> {
        let mut process = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .ok()?;
        if let Some(input) = input {
            let mut stdin = process.stdin.take().expect("a pipe");
            stdin.write_all(input.as_bytes()).ok()?;
        }
        let told = process.stdout.take().expect("a pipe");
        let mut server = Self {
            process,
            address: String::new(),
        };
        BufReader::new(told).read_line(&mut server.address).ok()?;
        server.address.truncate(server.address.trim_end().len());
        (!server.address.is_empty()).then_some(server)
    }

    /// Returns the resident memory of the process, in bytes.
    pub(crate) fn resident(&self) -> f64 {
        let statm = format!("/proc/{}/statm", self.process.id());
        let text = std::fs::read_to_string(statm).unwrap_or_default();
        let pages = text.split(' ').nth(1).and_then(|pages| pages.parse().ok());
        pages.unwrap_or(0.0) * 4096.0
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("it listens");
        stream.set_nodelay(true).expect("a TCP option");
        stream
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Serves and does not return if the arguments say so: `--device` with a driver.cfg on stdin, `--bare REQUEST ANSWER...` with sizes in bytes, or
/// one of these roles.
pub(crate) fn serve_if_told(others: &[(&str, fn())]) {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sizes = || {
        arguments[1..]
            .iter()
            .map(|size| size.parse().expect("bytes"))
    };
    match arguments.first().map(String::as_str) {
        Some("--device") => {
            let mut text = String::new();
            let read = std::io::stdin().read_to_string(&mut text);
            read.expect("a driver.cfg on stdin");
            serve_device(&text)
        }
        Some("--bare") => serve_bare(&sizes().collect::<Vec<usize>>()),
        role => {
            if let Some((_, serve)) = others.iter().find(|(name, _)| role == Some(*name)) {
                serve();
                std::process::exit(0);
            }
        }
    }
}

/// A device whose simulation ticks each millisecond, in which all inputs of the PLC change: they are the second half of the
/// signals.
fn serve_device(text: &str) -> ! {
    const TICK: Duration = Duration::from_millis(1);
    raise_open_files();
    let config =
        Config::parse("driver.cfg", text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
    let address = loop {
        let statistics = driver.statistics();
        let mut lines = statistics.lines();
        if let Some(address) = lines.find_map(|line| line.strip_prefix("address=")) {
            break address.to_owned();
        }
        std::thread::yield_now();
    };
    println!("{address}");
    let mut slots = driver.initial_slots();
    let inputs = slots.len() / 2;
    let (mut time, mut due) = (Nanos::ZERO, Instant::now());
    loop {
        time += Nanos::from_millis(1);
        due += TICK;
        for slot in &mut slots[inputs..] {
            *slot = Slot::from_real(1.0 - slot.real());
        }
        let _ = driver.exchange(time, &mut slots);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}

/// Listens for one client, and tells the address.
pub(crate) fn accept_one() -> TcpStream {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    println!("{}", listener.local_addr().expect("it is bound"));
    let (stream, _) = listener.accept().expect("it connects");
    stream.set_nodelay(true).expect("a TCP option");
    stream
}

/// Answers requests of these sizes, in turn, by as many bytes as follow each.
fn serve_bare(sizes: &[usize]) -> ! {
    let mut stream = accept_one();
    let mut requests: Vec<_> = sizes.iter().step_by(2).map(|&size| vec![0; size]).collect();
    let answers: Vec<_> = sizes
        .iter()
        .skip(1)
        .step_by(2)
        .map(|&size| vec![0; size])
        .collect();
    loop {
        for (request, answer) in requests.iter_mut().zip(&answers) {
            let served = stream
                .read_exact(request)
                .and_then(|()| stream.write_all(answer));
            if served.is_err() {
                std::process::exit(0);
            }
        }
    }
}

/// The rate of `once` per second.
pub(crate) fn rate(span: Duration, mut once: impl FnMut()) -> f64 {
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

pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A client that takes turns with others: its name, an exchange, and its rates with their ratios to the bare one's of the
/// round.
pub(crate) struct Turn<'a> {
    pub(crate) name: &'a str,
    pub(crate) once: Box<dyn FnMut() + 'a>,
    pub(crate) rates: Vec<(f64, f64)>,
}

impl<'a> Turn<'a> {
    pub(crate) fn new(name: &'a str, once: impl FnMut() + 'a) -> Self {
        Self {
            name,
            once: Box::new(once),
            rates: Vec::new(),
        }
    }
}

/// Measures the first of `turns`, which is bare, and the others in alternating rounds, and prints the medians.
pub(crate) fn by_turns(rounds: usize, span: Duration, turns: &mut [Turn<'_>]) {
    // The first round warms up.
    for round in 0..=rounds {
        let mut bare = 0.0;
        for (place, turn) in turns.iter_mut().enumerate() {
            let rate = rate(span, &mut turn.once);
            if place == 0 {
                bare = rate;
            }
            if round > 0 {
                turn.rates.push((rate, rate / bare));
            }
        }
    }
    for (place, turn) in turns.iter_mut().enumerate() {
        let (mut rates, mut ratios): (Vec<f64>, Vec<f64>) = turn.rates.drain(..).unzip();
        println!("rust {} {:.0}", turn.name, median(&mut rates));
        if place > 0 {
            println!("rust {}.ratio {:.3}", turn.name, median(&mut ratios));
        }
    }
}
