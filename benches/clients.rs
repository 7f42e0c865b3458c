//! The clients of Modbus and S7 compared with a client that only makes the same system calls, and that of OPC UA, in
//! alternating rounds of one run.
//!
//! Each client writes 60 INT to a device in a process of its own and reads 60 from it, in each cycle of 1 ms. What counts is
//! the processor time of a cycle, since the time of an answer is the device's. Then Modbus and S7 make as many cycles as they
//! can, at the shortest cycle that driver.cfg takes. OPC UA has no such cycle, it sends what has changed: all values do, each
//! millisecond, and what counts is the processor time of a millisecond. Medians over the rounds; prints one `rust NAME VALUE` per line on stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]

mod processor;
mod servers;

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::time::{Duration, Instant};

use processor::processor_us;
use servers::Server;
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::Monotonic;

/// INTs in each direction.
const SIGNALS: usize = 60;

/// A kind of client, and the server that it asks.
struct Kind {
    name: &'static str,
    server: &'static str,
    /// Ends where the server's address belongs.
    client: &'static str,
    /// Sizes of the requests of a cycle, each followed by that of its answer; none where a bare client would need the
    /// protocol.
    sizes: &'static [usize],
}

const KINDS: &[Kind] = &[
    Kind {
        name: "modbus",
        server: "kind = \"modbus-server\"",
        client: "kind = \"modbus-client\"\nwrite_to = \"tickbus bench\"\naddress = \"",
        sizes: &[13 + 2 * SIGNALS, 12, 12, 9 + 2 * SIGNALS],
    },
    Kind {
        name: "s7",
        server: "kind = \"s7-server\"\ndb = [{ number = 1, area = \"%Q\" }, { number = 2, area = \"%I\" }]",
        client: "kind = \"s7-client\"\noutput = \"DB1\"\ninput = \"DB2\"\nwrite_to = \"tickbus bench\"\naddress = \"",
        // Both requests are in flight at once.
        sizes: &[35 + 2 * SIGNALS + 31, 22 + 25 + 2 * SIGNALS],
    },
    #[cfg(feature = "opcua")]
    Kind {
        name: "opcua",
        server: "kind = \"opcua-server\"\nsecurity = \"None\"\nanonymous = true",
        client: "kind = \"opcua-client\"\nsecurity = \"None\"\nwrite_to = \"urn:tickbus:bench tickbus\"\n\
                 url = \"opc.tcp://",
        sizes: &[],
    },
];

struct Extent {
    rounds: usize,
    span: Duration,
}

fn main() {
    servers::serve_if_told(&[]);
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let extent = if measured {
        Extent {
            rounds: 7,
            span: Duration::from_secs(1),
        }
    } else {
        Extent {
            rounds: 1,
            span: Duration::from_millis(20),
        }
    };
    for kind in KINDS {
        measure(kind, &extent);
    }
}

fn measure(kind: &Kind, extent: &Extent) {
    let device = Server::device(&config(kind.server, "address = \"127.0.0.1:0\""));
    let client = format!("{}{}\"", kind.client, device.address);
    let (mut ours, mut bare, mut most) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..extent.rounds {
        if kind.sizes.is_empty() {
            ours.push(changes(&client, extent.span));
            continue;
        }
        ours.push(cycles(&client, "1ms", extent.span).cost_us);
        bare.push(bare_cycles(kind.sizes, extent.span));
        most.push(cycles(&client, "50us", extent.span).rate);
    }
    for (name, mut values) in [("us", ours), ("bare_us", bare), ("rate", most)] {
        values.sort_by(f64::total_cmp);
        if let Some(median) = values.get(values.len() / 2) {
            println!("rust clients.{}.{name} {median:.2}", kind.name);
        }
    }
}

/// A driver.cfg with these signals.
fn config(bus: &str, further: &str) -> String {
    let mut text = format!("[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\n{bus}\n{further}\n");
    for area in ['Q', 'I'] {
        for at in 0..SIGNALS {
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {at}\"\naddress = \"%{area}W{}\"\ntype = \"INT\"\n",
                2 * at
            );
        }
    }
    text
}

fn open(client: &str, cycle: &str) -> Driver {
    let further = format!("role = \"controller\"\ncycle = \"{cycle}\"");
    let text = config(client, &further);
    let config =
        Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    Driver::open(config, Monotonic::shared()).expect("opens")
}

/// A line of the statistics, once it is there.
fn statistic(driver: &Driver, name: &str) -> String {
    let begin = Instant::now();
    loop {
        let statistics = driver.statistics();
        let mut lines = statistics.lines().filter_map(|line| line.split_once('='));
        if let Some((_, value)) = lines.find(|(key, _)| *key == name) {
            return value.to_owned();
        }
        assert!(
            begin.elapsed() < Duration::from_secs(20),
            "no {name}:\n{statistics}"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}

struct Cycles {
    /// The processor time of one, in microseconds.
    cost_us: f64,
    /// Cycles in a second.
    rate: f64,
}

/// The cycles of a client of ours.
fn cycles(client: &str, cycle: &str, span: Duration) -> Cycles {
    let driver = open(client, cycle);
    let count = || -> f64 {
        let count = statistic(&driver, "bus_cycle.count");
        count.parse().expect("a number")
    };
    while count() < 20.0 {
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(statistic(&driver, "writes"), "allowed");
    let (before, begun, begin) = (count(), processor_us(false), Instant::now());
    std::thread::sleep(span);
    let (passed, made) = (begin.elapsed().as_secs_f64(), count() - before);
    let cost_us = (processor_us(false) - begun) / made;
    driver.close();
    Cycles {
        cost_us,
        rate: made / passed,
    }
}

/// The processor time of a millisecond in which all values change at both ends, in microseconds.
fn changes(client: &str, span: Duration) -> f64 {
    const TICK: Duration = Duration::from_millis(1);
    let mut driver = open(client, "1ms");
    let received = |driver: &Driver| -> f64 {
        let count = statistic(driver, "bus_cycles");
        count.parse().expect("a number")
    };
    while received(&driver) < 20.0 {
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(statistic(&driver, "writes"), "allowed");
    let mut slots = driver.initial_slots();
    let (begun, begin) = (processor_us(false), Instant::now());
    let (mut due, mut made) = (begin, 0.0);
    while begin.elapsed() < span {
        // The signals that the client sends are the first half.
        for slot in &mut slots[..SIGNALS] {
            *slot = Slot::from_real(1.0 - slot.real());
        }
        let _ = driver.exchange(None, &mut slots);
        made += 1.0;
        due += TICK;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    let cost_us = (processor_us(false) - begun) / made;
    driver.close();
    cost_us
}

/// The processor time of a cycle of a client that writes and reads blindly, in microseconds.
fn bare_cycles(sizes: &[usize], span: Duration) -> f64 {
    const CYCLE: Duration = Duration::from_millis(1);
    let texts: Vec<String> = sizes.iter().map(usize::to_string).collect();
    let mut role = vec!["--bare"];
    role.extend(texts.iter().map(String::as_str));
    let server = Server::own(&role);
    let mut stream = server.connect();
    let mut buffers: Vec<Vec<u8>> = sizes.iter().map(|&size| vec![0; size]).collect();
    let (begun, begin) = (processor_us(false), Instant::now());
    let (mut due, mut made) = (begin, 0.0);
    while begin.elapsed() < span {
        for pair in buffers.chunks_exact_mut(2) {
            stream.write_all(&pair[0]).expect("the server reads");
            stream.read_exact(&mut pair[1]).expect("an answer");
        }
        made += 1.0;
        due += CYCLE;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    (processor_us(false) - begun) / made
}
