//! Exchanges of a server with one client, for counts that a busy machine does not change: `tools/instructions` counts the
//! server's instructions under valgrind and its system calls with strace, and compares with `instructions.txt`.
//!
//! `serving KIND MAX_AGE EXCHANGES` serves a client that makes this number of exchanges; KIND is `socket`, `modbus` or
//! `s7`. The client is a process of its own, so that the counts are those of the server. The difference between two
//! numbers of exchanges leaves out the start.
#![allow(missing_docs, reason = "a bench")]

mod signals;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::process::Command;
use std::sync::Arc;

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Monotonic;

/// One kind of server, and what its client sends.
struct Kind {
    name: &'static str,
    /// The keys of `[fieldbus]`.
    keys: &'static str,
    /// Requests that begin a connection, each with the length of its answer.
    hello: &'static [(&'static [u8], usize)],
    /// The requests of an exchange, each with the length of its answer.
    exchange: fn() -> Vec<(Vec<u8>, usize)>,
}

const KINDS: [Kind; 3] = [
    Kind {
        name: "socket",
        keys: "kind = \"socket\"\nsend = \"reply\"\ninput_bytes = 134\noutput_bytes = 360",
        hello: &[],
        exchange: || vec![(vec![0; 360], 134)],
    },
    // Function 23 writes 64 registers and reads 64.
    Kind {
        name: "modbus",
        keys: "kind = \"modbus-server\"\ninputs = \"offset:1024\"\ninput_bytes = 128\noutput_bytes = 128",
        hello: &[],
        exchange: || {
            let head = [0, 0, 0, 0, 0, 139, 1, 23, 4, 0, 0, 64, 0, 0, 0, 64, 128];
            vec![([&head[..], &[0; 128]].concat(), 137)]
        },
    },
    // A job writes 360 bytes, another one reads 134.
    Kind {
        name: "s7",
        keys: "kind = \"s7-server\"\ninput_bytes = 134\noutput_bytes = 360\n\
               db = [{ number = 1, area = \"%Q\" }, { number = 2, area = \"%I\" }]",
        hello: &[
            (
                &[
                    3, 0, 0, 22, 17, 0xE0, 0, 0, 0, 1, 0, 0xC0, 1, 10, 0xC1, 2, 1, 0, 0xC2, 2, 1, 1,
                ],
                22,
            ),
            (
                &[
                    3, 0, 0, 25, 2, 0xF0, 0x80, 0x32, 1, 0, 0, 0, 1, 0, 8, 0, 0, 0xF0, 0, 0, 1, 0,
                    1, 1, 0xE0,
                ],
                27,
            ),
        ],
        exchange: || {
            let write = [
                3, 0, 1, 0x8B, 2, 0xF0, 0x80, 0x32, 1, 0, 0, 0, 1, 0, 14, 1, 0x6C, 5, 1, 0x12, 10,
                0x10, 2, 1, 0x68, 0, 1, 0x84, 0, 0, 0, 0, 4, 11, 0x40,
            ];
            let read = [
                3, 0, 0, 31, 2, 0xF0, 0x80, 0x32, 1, 0, 0, 0, 1, 0, 14, 0, 0, 4, 1, 0x12, 10, 0x10,
                2, 0, 134, 0, 2, 0x84, 0, 0, 0,
            ];
            vec![
                ([&write[..], &[0; 360]].concat(), 22),
                (read.to_vec(), 25 + 134),
            ]
        },
    },
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["client", name, address, exchanges] => client(kind(name), address, number(exchanges)),
        [name, max_age, exchanges] if !name.starts_with('-') => {
            serve(kind(name), max_age, number(exchanges));
        }
        // `cargo test` and `cargo bench` want to see that it runs.
        _ => KINDS.iter().for_each(|kind| serve(kind, "1h", 2)),
    }
}

fn kind(name: &str) -> &'static Kind {
    let kind = KINDS.iter().find(|kind| kind.name == name);
    kind.unwrap_or_else(|| panic!("there is no kind {name}"))
}

fn number(text: &str) -> u32 {
    text.parse().expect("a number of exchanges")
}

/// Opens a Device with 16 latched bits each way, like the rig, and waits until its client has ended.
fn serve(kind: &Kind, max_age: &str, exchanges: u32) {
    let text = format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\naddress = \"127.0.0.1:0\"\nmax_age = \"{max_age}\"\n{}\n{}",
        kind.keys,
        signals::latched_bits()
    );
    let config =
        Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let clock = Monotonic::shared();
    let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
    let address = loop {
        // Rarely: each look costs instructions.
        std::thread::sleep(std::time::Duration::from_millis(300));
        let statistics = driver.statistics();
        let mut lines = statistics.lines();
        if let Some(address) = lines.find_map(|line| line.strip_prefix("address=")) {
            break address.to_owned();
        }
    };
    let client = Command::new(std::env::current_exe().expect("its own path"))
        .args(["client", kind.name, &address, &exchanges.to_string()])
        .status();
    assert!(client.expect("it starts").success());
    driver.close();
}

fn client(kind: &Kind, address: &str, exchanges: u32) {
    let mut stream = TcpStream::connect(address).expect("the server listens");
    stream.set_nodelay(true).expect("a TCP option");
    let mut answer = [0; 256];
    let mut ask = |request: &[u8], length| {
        stream.write_all(request).expect("the server reads");
        stream.read_exact(&mut answer[..length]).expect("an answer");
    };
    for (request, length) in kind.hello {
        ask(request, *length);
    }
    let requests = (kind.exchange)();
    for _ in 0..exchanges {
        for (request, length) in &requests {
            ask(request, *length);
        }
    }
}
