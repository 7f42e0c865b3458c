//! A controller and a machine at the two ends of a pseudo-terminal: the bus `ivi-client` and the bus `ivi-reader`.
#![cfg(unix)]

use std::io::{Read as _, Write as _};

use tickbus_base::os::LinkedTerminal;
use tickbus_base::time::Monotonic;
use tickbus_base::time::{Clock as _, Nanos};
use tickbus_bus_identification::{
    Access, Carrier, CarrierType, Client, Command, Head, NO_ANSWER, Outcome, Reader, Timing,
};
use tickbus_conformance::rig::await_that;
use tickbus_driver::Code;
use tickbus_fieldbus::{Cause, LinkState};

use crate::ends::{Line, Pair};

#[test]
fn a_carrier_is_read_changed_and_written_and_leaves_with_what_was_written() {
    let mut pair = Pair::new();
    // ETX among the data, and as the last octet.
    let pallet: Vec<u8> = (0..20).chain([3]).collect();
    pair.put(&pallet);
    assert_eq!(pair.ask(b'w', 0, 21, &[]), (0, pallet.clone()));
    assert_eq!(pair.ask(b'k', 4, 3, &[3, 3, 7]), (0, vec![]));
    let mut changed = pallet;
    changed[4..7].copy_from_slice(&[3, 3, 7]);
    assert_eq!(pair.ask(b'w', 0, 21, &[]), (0, changed.clone()));
    assert_eq!(pair.machine.get("writes"), 1.0);
    // The same command again is a new one by its toggle bit.
    assert_eq!(pair.ask(b'w', 0, 21, &[]).0, 0);
    pair.machine.set("present", 0.0);
    pair.until("the carrier is gone", |pair| {
        pair.machine.get("taken") == 0.0 && pair.controller.get("present") == 0.0
    });
    for (index, octet) in changed.iter().enumerate() {
        assert_eq!(pair.machine.get(&format!("out {index}")), f64::from(*octet));
    }
    assert_eq!(pair.ask(b'w', 0, 1, &[]), (3, vec![]), "no carrier");
    assert_eq!(pair.controller.get("connected"), 1.0);
    // The next carrier has its own initial data.
    pair.put(&[9]);
    assert_eq!(pair.ask(b'w', 0, 2, &[]), (0, vec![9, 1]));
}

#[test]
fn each_command_of_a_head_is_answered_with_its_status() {
    let mut pair = Pair::with(&[2], "carrier = \"IDC-1K\"");
    pair.machine.set("number", f64::from(0x0A01_1C3E_u32));
    pair.put(&[1, 2, 3]);
    assert_eq!(pair.ask(b'i', 0, 0, &[]), (0, vec![0x0A, 1, 0x1C, 0x3E]));
    assert_eq!(pair.ask(b'h', 0, 0, &[]), (0, vec![]));
    assert_eq!(
        pair.ask(b'a', 0, 0, &[]).0,
        9,
        "32 octets have no room in 24"
    );
    assert_eq!(pair.ask(b'w', 0x7F, 2, &[]).0, 9, "beyond the carrier");
    assert_eq!(
        pair.ask(b'k', 0, 25, &[]).0,
        9,
        "more than there is room for"
    );
    assert_eq!(pair.ask(b'v', 0, 0, &[]).0, 1, "no command of a head");
    assert_eq!(pair.ask(0, 0, 0, &[]), (0, vec![]), "no command at all");
    for (signal, value, command, status) in [("protected", 1.0, b'k', 4), ("fault", 8.0, b'w', 8)] {
        pair.machine.set(signal, value);
        // The reader takes it over within a cycle.
        await_that("the reader takes it over", || {
            let found = pair.ask(command, 0, 1, &[5]).0;
            assert!([0, status].contains(&found));
            found == status
        });
        pair.machine.set(signal, 0.0);
    }
}

#[test]
fn a_head_that_is_unplugged_is_a_station_that_left_until_it_is_back() {
    let mut pair = Pair::with(&[1, 3], "");
    let present = |pair: &Pair, head: u8| pair.controller.get(&format!("{head} present")) == 1.0;
    pair.machine.set("1 present", 1.0);
    pair.machine.set("3 present", 1.0);
    pair.until("both carriers are seen", |pair| {
        present(pair, 1) && present(pair, 3)
    });
    pair.machine.set("3 unplugged", 1.0);
    pair.until("the station has left", |pair| {
        pair.controller.link().cause == Cause::Refused
    });
    let link = pair.controller.link();
    assert_eq!(link.state, LinkState::Stale);
    assert!(
        link.reason.contains("head 3 of the reader") && link.reason.contains("status 02"),
        "{}",
        link.reason
    );
    pair.until("its values are fail-safe", |pair| !present(pair, 3));
    assert!(present(&pair, 1), "the other head goes on");
    pair.machine.set("3 unplugged", 0.0);
    pair.until("it is back", |pair| {
        present(pair, 3) && pair.controller.link().state == LinkState::Running
    });
}

#[test]
fn a_line_that_is_unplugged_comes_back_by_itself() {
    let mut pair = Pair::new();
    pair.put(&[5]);
    assert_eq!(pair.ask(b'w', 0, 1, &[]), (0, vec![5]));
    let Pair {
        line,
        machine,
        mut controller,
        toggle,
    } = pair;
    drop(machine);
    await_that("the line has failed", || {
        controller.tick().code == Code::Stale && controller.link().state == LinkState::Failed
    });
    let reason = controller.link().reason;
    assert!(
        reason.contains("reader") && (reason.contains("gone") || reason.contains("cannot open")),
        "{reason}"
    );
    let machine = line.reader(&[1]);
    let mut pair = Pair {
        line,
        machine,
        controller,
        toggle,
    };
    pair.put(&[6]);
    assert_eq!(pair.ask(b'w', 0, 1, &[]), (0, vec![6]));
    assert!(pair.line.name().is_symlink());
}

/// A reader at the far end of a terminal that never answers writing commands.
struct Taciturn {
    terminal: LinkedTerminal,
    reader: Reader,
    writes: usize,
}

impl Taciturn {
    fn new(line: &Line) -> Self {
        let timing = Timing {
            baud: 9600,
            timeout: Nanos::ZERO,
        };
        let mut reader = Reader::new(Default::default(), timing);
        *reader.head_mut(1) = Head {
            is_connected: true,
            carrier: Some(Carrier::new(CarrierType::Idc1K, &[1])),
            ..Head::default()
        };
        Self {
            terminal: LinkedTerminal::open(&line.name()).expect("a terminal"),
            reader,
            writes: 0,
        }
    }

    /// Answers the received commands. A client that waits for an answer sends one command at a time.
    fn turn(&mut self) {
        let mut bytes = [0; 256];
        let Ok(count) = self.terminal.read(&mut bytes) else {
            return;
        };
        if bytes[0] == b'k' {
            self.writes += 1;
            return;
        }
        self.reader.hear(Monotonic::shared().now(), &bytes[..count]);
        let answer = self.reader.to_write().to_vec();
        self.terminal.write_all(&answer).expect("room");
        self.reader.wrote(answer.len());
    }
}

#[test]
fn a_silent_reader_is_told_and_a_command_without_an_answer_is_not_given_twice() {
    let line = Line::new();
    let mut far = Taciturn::new(&line);
    let mut controller = line.client(&[1], "timeout = \"100ms\"");
    await_that("the silence is told", || {
        controller.tick();
        let reason = controller.link().reason;
        reason.contains("did not answer within 100ms")
    });
    assert_eq!(controller.link().state, LinkState::Opening);
    await_that("it answers", || {
        far.turn();
        controller.tick();
        controller.get("present") == 1.0
    });
    controller.set("count", 1.0);
    controller.set("command", f64::from(b'k' | 0x80));
    await_that("the command is over", || {
        far.turn();
        controller.tick();
        controller.get("echo") == f64::from(b'k' | 0x80)
    });
    assert_eq!(controller.get("status"), f64::from(NO_ANSWER));
    // The next command is sent after it.
    controller.set("command", f64::from(b'w'));
    await_that("the next command is over", || {
        far.turn();
        controller.tick();
        controller.get("echo") == f64::from(b'w')
    });
    assert_eq!(far.writes, 1);
}

#[test]
fn a_reader_that_refuses_the_carriers_is_told_and_what_it_had_repeated_is_skipped() {
    let line = Line::new();
    let mut far = LinkedTerminal::open(&line.name()).expect("a terminal");
    let mut controller = line.client(&[1], "carrier = \"IMC-40-256K\"");
    let mut heard = Vec::new();
    await_that("the line has failed", || {
        controller.tick();
        let mut bytes = [0; 64];
        if let Ok(count) = far.read(&mut bytes) {
            heard.extend_from_slice(&bytes[..count]);
            let answer: &[u8] = match bytes[0] {
                // Another program's command was repeated until now.
                b'q' => b"W03\xBA\x03W03\xBA\x03q\x71\x03",
                _ => b"d0D\xD8\x03",
            };
            far.write_all(answer).expect("room");
        }
        controller.link().state == LinkState::Failed
    });
    assert!(heard.starts_with(b"q\x71\x03d3\x97\x03"), "{heard:?}");
    let link = controller.link();
    assert_eq!(link.cause, Cause::Refused);
    for words in [
        "does not work with carriers of type IMC-40-256K",
        "status 0D",
    ] {
        assert!(link.reason.contains(words), "{}", link.reason);
    }
}

#[test]
fn another_program_speaks_with_the_reader_as_with_a_serial_port() {
    let line = Line::new();
    let mut machine = line.reader(&[1]);
    machine.set("present", 1.0);
    machine.set("in 0", 3.0);
    let mut port = line.open_port(&mut machine);
    let clock = Monotonic::shared();
    let timing = Timing {
        baud: 9600,
        timeout: Nanos::from_secs(5),
    };
    let mut client = Client::new(CarrierType::Idc1K, timing);
    let read = Command::once(
        1,
        Access::Read {
            address: 0,
            length: 1,
        },
    );
    client.ask(clock.now(), &read);
    port.write_all(client.to_write()).expect("room");
    let mut found = None;
    await_that("the answer comes", || {
        machine.tick();
        let mut bytes = [0; 16];
        if let Ok(count) = port.read(&mut bytes) {
            client.hear(clock.now(), &bytes[..count]);
        }
        found = client.poll(clock.now());
        found.is_some()
    });
    assert!(
        matches!(found, Some(Outcome::Answered(answer)) if answer.status.is_done()),
        "{found:?}"
    );
    assert_eq!(client.data(), [3]);
    await_that("the machine sees that somebody asks", || {
        machine.tick();
        machine.get("taken") == 1.0 && machine.link().state == LinkState::Running
    });
}

#[test]
fn what_is_in_the_place_of_the_port_is_left_alone() {
    let line = Line::new();
    std::fs::write(line.name(), "precious").expect("a file");
    let machine = line.reader(&[1]);
    await_that("the line has failed", || {
        machine.link().state == LinkState::Failed
    });
    let reason = machine.link().reason;
    assert!(
        reason.contains("cannot make the pseudo-terminal"),
        "{reason}"
    );
    assert_eq!(
        std::fs::read(line.name()).expect("it is there"),
        b"precious"
    );
}
