//! Steps per second of an empty run, compared with a bare TCP coordinator (a loop that sends one message to each client
//! and waits for the answers), with the same loop in shared memory, and with HELICS if it is installed. The rounds of one
//! run alternate; each client is a separate process.
//!
//! Medians over the rounds; prints one `rust NAME VALUE` per line on stdout.
#![allow(missing_docs, reason = "a bench")]
#![allow(unsafe_code, reason = "HELICS is a library in C")]

#[path = "lockstep/helics.rs"]
mod helics;
#[cfg(unix)]
#[path = "lockstep/memory.rs"]
mod memory;

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use tickbus_base::time::{Monotonic, Nanos, Stop};
use tickbus_image::signal::DataType;
use tickbus_net::Address;
use tickbus_virtual_time::client::Client;
#[cfg(unix)]
use tickbus_virtual_time::shared_memory;
use tickbus_virtual_time::{
    Controls, Declaration, Exchange, Hosting, Logic, Meeting, Participant, Settings,
    StartCondition, Step, Variable, in_process, tcp,
};

/// The bytes of a step and of its answer without any variable, in our format.
const ASKED: usize = 21;
const ANSWERED: usize = 13;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|argument| argument == "--client") {
        return client(&arguments[at + 1..]);
    }
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = arguments.iter().any(|argument| argument == "--bench");
    let (rounds, span) = if measured {
        (15, Duration::from_millis(300))
    } else {
        (1, Duration::from_millis(1))
    };
    // A word on the command line selects what to measure.
    let wanted = |name: &str| {
        let mut words = arguments[1..].iter().filter(|word| !word.starts_with("--"));
        words.next().is_none_or(|word| name.contains(&**word))
    };
    let with_helics = measured && helics::installed();
    for count in [2, 8] {
        if !wanted(&format!("tcp.{count}")) {
            continue;
        }
        let (mut bares, mut ours, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
        let (mut others, mut others_ratios) = (Vec::new(), Vec::new());
        let local = format!("unix:bench-{}", std::process::id());
        // The kinds that are compared with the bare coordinator, each in every round.
        let mut kinds = vec![("direct", "127.0.0.1:0", true)];
        if cfg!(unix) {
            kinds.extend([("unix", &*local, false), ("direct_unix", &*local, true)]);
        }
        let mut found = vec![(Vec::new(), Vec::new()); kinds.len()];
        for _ in 0..rounds {
            let bare = bare(count, span);
            let tcp = over_tcp(count, 0, span);
            for ((_, place, direct), (rates, ratios)) in kinds.iter().zip(&mut found) {
                let rate = over(place, *direct, count, 0, span);
                rates.push(rate);
                ratios.push(rate / bare);
            }
            bares.push(bare);
            ours.push(tcp);
            ratios.push(tcp / bare);
            if with_helics {
                let rate = helics::steps(count, span);
                others.extend(rate);
                others_ratios.extend(rate.map(|rate| rate / bare));
            }
        }
        println!("rust sdsp.bare.{count} {:.0}", median(&mut bares));
        println!("rust sdsp.tcp.{count} {:.0}", median(&mut ours));
        println!("rust sdsp.tcp.{count}.ratio {:.3}", median(&mut ratios));
        for ((name, ..), (rates, ratios)) in kinds.iter().zip(&mut found) {
            println!("rust sdsp.{name}.{count} {:.0}", median(rates));
            println!("rust sdsp.{name}.{count}.ratio {:.3}", median(ratios));
        }
        if !others.is_empty() {
            println!("rust sdsp.helics.{count} {:.0}", median(&mut others));
            let ratio = median(&mut others_ratios);
            println!("rust sdsp.helics.{count}.ratio {ratio:.3}");
        }
    }
    // The server as a third process, and in the process of one of the clients.
    #[cfg(unix)]
    for (name, local) in [("shared_memory.2", 0), ("shared_memory.2.embedded", 1)] {
        if !wanted(name) {
            continue;
        }
        let (mut shared, mut ratios) = (Vec::new(), Vec::new());
        let (mut bares, mut bares_ratios) = (Vec::new(), Vec::new());
        for _ in 0..rounds {
            let rate = through_memory(2, local, span);
            shared.push(rate);
            ratios.push(rate / bare(2, span));
            let bare = memory::bare(2 - local, span);
            bares.push(bare);
            bares_ratios.push(rate / bare);
        }
        println!("rust sdsp.{name} {:.0}", median(&mut shared));
        println!("rust sdsp.{name}.ratio {:.1}", median(&mut ratios));
        println!("rust sdsp.{name}.bare {:.0}", median(&mut bares));
        let ratio = median(&mut bares_ratios);
        println!("rust sdsp.{name}.bare.ratio {ratio:.2}");
    }
    if wanted("in_process.2") {
        let (mut alone, mut ratios) = (Vec::new(), Vec::new());
        for _ in 0..rounds {
            let rate = in_this_process(2, 0, span);
            alone.push(rate);
            ratios.push(rate / bare(2, span));
        }
        println!("rust sdsp.in_process.2 {:.0}", median(&mut alone));
        println!("rust sdsp.in_process.2.ratio {:.1}", median(&mut ratios));
    }
    if !wanted("100") {
        return;
    }
    for variables in [0, 10, 100] {
        let rate = over_tcp(if measured { 100 } else { 3 }, variables, span);
        println!("rust sdsp.tcp.100.{variables} {rate:.1}");
        let rate = in_this_process(100, variables, span);
        println!("rust sdsp.in_process.100.{variables} {rate:.1}");
    }
}

fn median(figures: &mut [f64]) -> f64 {
    figures.sort_by(f64::total_cmp);
    figures[figures.len() / 2]
}

/// A client that does nothing, with this many variables, which the client also reads.
struct Idle(String, usize);

impl Participant for Idle {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new(&self.0);
        let name = |at| format!("{} {at}", self.0);
        declaration.reads = (0..self.1).map(name).collect();
        let variable = |name: &String| Variable::new(name, DataType::Lreal);
        declaration.writes = declaration.reads.iter().map(variable).collect();
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, _: Step, _: &[u64], _: &mut [u64]) -> Result<(), String> {
        Ok(())
    }
}

fn client(arguments: &[String]) {
    if arguments[0] == "helics" {
        return helics::client(&arguments[1..]);
    }
    let [kind, address, name, variables] = arguments else {
        panic!("unexpected arguments {arguments:?}");
    };
    match &**kind {
        "bare" => {
            let mut stream = TcpStream::connect(address).expect("it listens");
            stream.set_nodelay(true).expect("it is open");
            let mut asked = [0; ASKED];
            while stream.read_exact(&mut asked).is_ok() {
                stream.write_all(&[0; ANSWERED]).expect("it reads");
            }
        }
        "socket" => {
            let mut idle = Idle(name.clone(), variables.parse().expect("a number"));
            let clock = Monotonic::shared() as _;
            let client = Client::new(idle.declare()).expect("it is right");
            let meeting: Meeting = address.parse().expect("an address");
            let connection = meeting.connect(client, &clock, &Stop::new());
            connection
                .and_then(|connection| connection.run(&mut idle))
                .expect("it runs");
        }
        #[cfg(unix)]
        "shared_memory" => {
            let mut idle = Idle(name.clone(), variables.parse().expect("a number"));
            shared_memory::join(address, &mut idle).expect("it runs");
        }
        #[cfg(unix)]
        "memory" => {
            let at = name[1..].parse().expect("a number");
            memory::client(address, at, variables.parse().expect("a number"));
        }
        other => panic!("unknown kind {other}"),
    }
}

fn clients(kind: &str, address: &str, count: usize, variables: usize) -> Vec<Child> {
    let own = std::env::current_exe().expect("a path");
    let client = |at: usize| {
        let mut command = Command::new(&own);
        command.args(["--client", kind, address]);
        command.args([format!("c{at:03}"), variables.to_string()]);
        command.spawn().expect("it starts")
    };
    (0..count).map(client).collect()
}

fn wait(children: Vec<Child>) {
    for mut child in children {
        assert!(child.wait().expect("it was started").success());
    }
}

/// Steps per second of the bare coordinator.
fn bare(count: usize, span: Duration) -> f64 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound").to_string();
    let children = clients("bare", &address, count, 0);
    let mut streams: Vec<TcpStream> = (0..count)
        .map(|_| listener.accept().expect("it comes").0)
        .collect();
    for stream in &streams {
        stream.set_nodelay(true).expect("it is open");
    }
    let mut step = || {
        for stream in &mut streams {
            stream.write_all(&[0; ASKED]).expect("it reads");
        }
        for stream in &mut streams {
            stream.read_exact(&mut [0; ANSWERED]).expect("it answers");
        }
    };
    for _ in 0..100 {
        step();
    }
    let (begun, mut steps) = (Instant::now(), 0_u32);
    while begun.elapsed() < span {
        step();
        steps += 1;
    }
    let rate = f64::from(steps) / begun.elapsed().as_secs_f64();
    drop(streams);
    wait(children);
    rate
}

/// Settings for this many clients.
fn settings(count: usize) -> Settings {
    Settings::new(Nanos::from_millis(1), StartCondition::Count(count))
}

/// Counts steps for `span` after the first 100, and then stops the run.
#[derive(Default)]
struct Meter {
    begun: Option<Instant>,
    steps: u64,
    rate: f64,
}

impl Meter {
    /// True when the time is over.
    fn step(&mut self, sequence: u64, span: Duration) -> bool {
        if sequence == 100 {
            self.begun = Some(Instant::now());
            self.steps = sequence;
        }
        let Some(begun) = self.begun else {
            return false;
        };
        // The bare coordinator reads the clock, too.
        let elapsed = begun.elapsed();
        if self.rate == 0.0 && elapsed >= span {
            #[expect(clippy::cast_precision_loss, reason = "exact for years")]
            let steps = (sequence - self.steps) as f64;
            self.rate = steps / elapsed.as_secs_f64();
            return true;
        }
        false
    }
}

fn over_tcp(count: usize, variables: usize, span: Duration) -> f64 {
    over("127.0.0.1:0", false, count, variables, span)
}

/// Steps per second of a server at `place`; if `direct`, the clients exchange their values without it.
fn over(place: &str, direct: bool, count: usize, variables: usize, span: Duration) -> f64 {
    let listener = match place.parse().expect("a place") {
        Meeting::Unix(address) => tcp::Listener::bind_local(&address).expect("a free path"),
        _ => tcp::Listener::bind(&Address::local(0)).expect("a free port"),
    };
    let children = clients("socket", listener.place(), count, variables);
    let controls = Controls::default();
    let mut meter = Meter::default();
    let logic = Logic::new().on_commit(|commit| {
        if meter.step(commit.step().sequence, span) {
            controls.send(tickbus_virtual_time::server::Control::Stop);
        }
        Ok(())
    });
    let settings = Settings {
        exchange: if direct {
            Exchange::Direct
        } else {
            Exchange::ByServer { rejoin: None }
        },
        ..settings(count)
    };
    let mut is_direct = false;
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        controls: &controls,
        news: &mut |line| is_direct |= line.ends_with("directly"),
    };
    listener.run(settings, logic, hosting).expect("it runs");
    wait(children);
    assert_eq!(
        is_direct, direct,
        "the clients exchange their values as asked"
    );
    meter.rate
}

#[cfg(unix)]
fn through_memory(count: usize, local: usize, span: Duration) -> f64 {
    let name = format!("bench-{}", std::process::id());
    let settings = settings(count);
    let listener = shared_memory::Listener::bind(&name, &settings).expect("a free name");
    let children = clients("shared_memory", &name, count - local, 0);
    let mut idle: Vec<Idle> = (0..local).map(|at| Idle(format!("l{at}"), 0)).collect();
    let locals = idle.iter_mut().map(|client| client as _).collect();
    let controls = Controls::default();
    let mut meter = Meter::default();
    let logic = Logic::new().on_time(|access| {
        if meter.step(access.step().sequence, span) {
            controls.send(tickbus_virtual_time::server::Control::Stop);
        }
        Ok(())
    });
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        controls: &controls,
        news: &mut |_| {},
    };
    listener
        .run_with(settings, logic, hosting, locals)
        .expect("it runs");
    wait(children);
    meter.rate
}

fn in_this_process(count: usize, variables: usize, span: Duration) -> f64 {
    let mut idle: Vec<Idle> = (0..count)
        .map(|at| Idle(format!("c{at:03}"), variables))
        .collect();
    let participants = idle.iter_mut().map(|client| client as _).collect();
    let mut meter = Meter::default();
    let logic = Logic::new().on_time(|access| {
        if meter.step(access.step().sequence, span) {
            return Err("enough".to_owned());
        }
        Ok(())
    });
    in_process::run(settings(count), participants, logic).expect_err("enough");
    meter.rate
}
