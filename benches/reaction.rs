//! The reaction time of a machine, per bus: from an edge at the PLC to the response at the PLC.
//!
//! The PLC is the program `reaction`. The machine ticks every millisecond and copies its %Q bit to its %I
//! bit: within the tick, like `tickbus mirror` or a simulator that receives, answers and sends; or in the
//! next one, like a simulator that exchanges once per tick. For comparison: a bare TCP ping-pong of 360 and
//! 134 bytes, and the limit for a response within the tick, which is 1.5 times that plus the half tick for
//! which an edge waits on average. Prints one `rust NAME VALUE` per line.
//!
//! Pin it to one core from outside.
#![allow(missing_docs, reason = "a bench")]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use tickbus::driver::{Driver, Host};
use tickbus::driver_cfg::{CommandLineEnd, Config};
use tickbus::fieldbus::Role;
use tickbus::plc::Program;
use tickbus::programs::{Mirror, Reaction};
use tickbus::time::{Clock, Monotonic, Nanos, Pace, Stop, TimeHistogram};

/// Bytes from the PLC and to it: %Q and %I.
const REQUEST: usize = 360;
const ANSWER: usize = 134;

/// The machine's tick.
const TICK: Nanos = Nanos::from_millis(1);

/// Bus cycle and scan interval of the PLC.
const CYCLE: Nanos = Nanos::from_micros(100);

fn config(fieldbus: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\n{fieldbus}\ncycle = \"{CYCLE}\"\n\
         input_bytes = {ANSWER}\noutput_bytes = {REQUEST}\n\
         [[signal]]\nname = \"out\"\naddress = \"%QX0.0\"\nlatch = \"rising\"\n\
         [[signal]]\nname = \"in\"\naddress = \"%IX0.0\"\nlatch = \"rising\"\n"
    )
}

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let (edges, exchanges) = if measured { (3000, 200_000) } else { (3, 10) };
    let bare = ping_pong(exchanges);
    println!("rust reaction.bare_us {bare:.2}");
    let limit = 1.5 * bare + TICK.as_micros();
    println!("rust reaction.limit_us {limit:.1}");
    let within = 1.5 * bare + TICK.as_micros() / 2.0;
    println!("rust reaction.answer.limit_us {within:.1}");

    let loopback = config("kind = \"loopback\"\nlink = \"reaction\"");
    let simulator = reaction(&loopback, None, Machine::Simulator, edges);
    println!("rust reaction.loopback_us {simulator:.1}");
    let answer = reaction(&loopback, None, Machine::Answers, edges);
    println!("rust reaction.loopback.answer_us {answer:.1}");
    let device = config("kind = \"socket\"\naddress = \"127.0.0.1:0\"\nsend = \"reply\"");
    let controller = config("kind = \"socket\"");
    let mirror = reaction(&device, Some(&controller), Machine::Mirror, edges);
    println!("rust reaction.socket_us {mirror:.1}");
    let simulator = reaction(&device, Some(&controller), Machine::Simulator, edges);
    println!("rust reaction.socket.simulator_us {simulator:.1}");
    let answer = reaction(&device, Some(&controller), Machine::Answers, edges);
    println!("rust reaction.socket.answer_us {answer:.1}");
    for kind in ["modbus", "s7"] {
        let device = config(&format!(
            "kind = \"{kind}-server\"\naddress = \"127.0.0.1:0\""
        ));
        let client = format!("kind = \"{kind}-client\"\nwrite_to = \"tickbus bench\"");
        let controller = config(&client);
        let mirror = reaction(&device, Some(&controller), Machine::Mirror, edges);
        println!("rust reaction.{kind}_us {mirror:.1}");
        let simulator = reaction(&device, Some(&controller), Machine::Simulator, edges);
        println!("rust reaction.{kind}.simulator_us {simulator:.1}");
        let answer = reaction(&device, Some(&controller), Machine::Answers, edges);
        println!("rust reaction.{kind}.answer_us {answer:.1}");
    }
    #[cfg(feature = "opcua")]
    opcua(edges.min(500));
}

/// Write in one direction and a subscription in the other; publishing intervals are whole milliseconds.
#[cfg(feature = "opcua")]
fn opcua(edges: usize) {
    let device = config(
        "kind = \"opcua-server\"\naddress = \"127.0.0.1:0\"\nsecurity = \"None\"\nanonymous = true",
    );
    let controller = config(
        "kind = \"opcua-client\"\nurl = \"opc.tcp://127.0.0.1\"\nsecurity = \"None\"\n\
         write_to = \"urn:tickbus:bench tickbus\"",
    );
    let mirror = reaction(&device, Some(&controller), Machine::Mirror, edges);
    println!("rust reaction.opcua_us {mirror:.1}");
    let answer = reaction(&device, Some(&controller), Machine::Answers, edges);
    println!("rust reaction.opcua.answer_us {answer:.1}");
}

/// The median of a bare exchange, in microseconds.
fn ping_pong(exchanges: usize) -> f64 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    let mut client = TcpStream::connect(address).expect("it listens");
    let (mut served, _) = listener.accept().expect("it connects");
    for stream in [&client, &served] {
        stream.set_nodelay(true).expect("a TCP option");
    }
    let server = std::thread::spawn(move || {
        let (mut request, answer) = ([0; REQUEST], [0; ANSWER]);
        while served.read_exact(&mut request).is_ok() {
            served.write_all(&answer).expect("the client reads");
        }
    });
    let (request, mut answer) = ([0; REQUEST], [0; ANSWER]);
    let mut spans = TimeHistogram::new();
    for _ in 0..exchanges {
        let begin = Instant::now();
        client.write_all(&request).expect("the server reads");
        client.read_exact(&mut answer).expect("an answer");
        let span = i64::try_from(begin.elapsed().as_nanos()).unwrap_or(i64::MAX);
        spans.record(Nanos(span));
    }
    drop(client);
    server.join().expect("no panic");
    spans.quantile(0.5).as_micros()
}

fn statistic(text: &str, key: &str) -> Option<String> {
    let found = text
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{key}=")));
    found.map(str::to_owned)
}

/// How the machine responds.
#[derive(Clone, Copy, Debug)]
enum Machine {
    /// Within its tick.
    Mirror,
    /// With the exchange of its next tick.
    Simulator,
    /// Between the two halves of its tick.
    Answers,
}

/// A running machine; ends when dropped.
enum Running {
    Mirror(Box<Host>),
    Simulator(Box<Driver>),
}

impl Running {
    fn statistics(&self) -> String {
        match self {
            Self::Mirror(host) => host.statistics(),
            Self::Simulator(driver) => driver.statistics(),
        }
    }
}

/// The median reaction in microseconds of a machine and a PLC with these driver.cfg; without `controller` the
/// PLC uses the machine's.
fn reaction(device: &str, controller: Option<&str>, machine: Machine, edges: usize) -> f64 {
    let clock = Monotonic::shared();
    let config =
        Config::parse("device.cfg", device, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let shared = Arc::clone(&clock) as Arc<dyn Clock>;
    let answers = matches!(machine, Machine::Answers);
    let mut machine = match machine {
        Machine::Mirror => {
            let mirror = Box::new(Mirror);
            Running::Mirror(Box::new(
                Host::open(&config, mirror, TICK, shared).expect("opens"),
            ))
        }
        Machine::Simulator | Machine::Answers => {
            Running::Simulator(Box::new(Driver::open(config, shared).expect("opens")))
        }
    };
    let controller = controller_config(device, controller, &machine);
    let options = [("count", edges.to_string()), ("pause", "5ms".to_owned())];
    let options = options.map(|(key, value)| (key.to_owned(), value));
    let program = Reaction::from_options(&options).expect("right options");
    let report = program.report().expect("it reports");
    let plc = Host::open(
        &controller,
        Box::new(program),
        CYCLE,
        Arc::clone(&clock) as _,
    );
    let plc = plc.expect("opens");

    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        if let Running::Simulator(driver) = &mut machine {
            scope.spawn(|| simulate(driver, answers, &clock, &over));
        }
        while !report.is_done() {
            let soon = clock.now() + Nanos::from_millis(5);
            clock.wait_until(soon, &Stop::new());
        }
        over.store(true, Ordering::Relaxed);
    });
    assert_eq!(report.failure(), None);
    let statistics = plc.statistics();
    plc.close();
    let median = statistic(&statistics, "reaction.p50_us").expect("it was measured");
    median.parse().expect("a number")
}

fn simulate(driver: &mut Driver, answers: bool, clock: &Monotonic, over: &AtomicBool) {
    let mut slots = driver.initial_slots();
    let mut pace = Pace::new(clock.now(), TICK);
    let stop = Stop::new();
    while !over.load(Ordering::Relaxed) {
        if pace.take(clock.now()) {
            if answers {
                driver.receive(None, &mut slots);
                slots[1] = slots[0];
                driver.send(&mut slots);
            } else {
                driver.exchange(None, &mut slots);
                slots[1] = slots[0];
            }
        }
        clock.wait_until(pace.due(), &stop);
    }
}

fn controller_config(device: &str, controller: Option<&str>, machine: &Running) -> Config {
    let Some(text) = controller else {
        let text = device.replacen("[fieldbus]\n", "[fieldbus]\nrole = \"controller\"\n", 1);
        return Config::parse("controller.cfg", &text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"));
    };
    let asked = CommandLineEnd {
        role: Role::Controller,
        moved: true,
    };
    let mut config = Config::parse_as("controller.cfg", text, Some(asked), &tickbus::KINDS)
        .unwrap_or_else(|why| panic!("{why}"));
    let address = loop {
        match statistic(&machine.statistics(), "address") {
            Some(address) => break address,
            None => std::thread::yield_now(),
        }
    };
    config.bus.set_address(&address).expect("an address");
    config
}
