//! A controller and a machine at the two ends of a pseudo-terminal: the bus `ivi-client` and the bus `ivi-reader`.
#![cfg(unix)]
#![allow(
    missing_docs,
    clippy::float_cmp,
    clippy::format_push_string,
    reason = "tests; the values are small whole numbers"
)]

use std::path::PathBuf;

use tempfile::TempDir;
use tickbus_base::os::{LinkedTerminal, Parity, SerialPort, SerialSettings};
use tickbus_base::time::Monotonic;
use tickbus_base::time::{Clock as _, Nanos};
use tickbus_bus_identification::{
    Access, CarrierType, Client, Command, NO_ANSWER, Outcome, Timing,
};
use tickbus_conformance::rig::{End, await_that};
use tickbus_driver::Code;
use tickbus_fieldbus::{Cause, LinkState};

/// Octets of data at both ends.
const DATA: usize = 24;

/// Both ends of a line, which has a folder of its own.
struct Line {
    folder: TempDir,
}

impl Line {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a folder"),
        }
    }

    fn name(&self) -> PathBuf {
        self.folder.path().join("reader")
    }

    fn open(
        &self,
        kind: &str,
        device: &str,
        heads: &[u8],
        extra: &str,
        signals: &[(&str, &str)],
    ) -> End {
        let mut text = format!(
            "[driver]\nid = 1\nname = \"{kind}\"\n[fieldbus]\nkind = \"{kind}\"\ndevice = \"{device}{}\"\n\
             reconnect = [\"10ms\"]\n{extra}\n",
            self.name().display()
        );
        if let [head] = heads {
            text += &format!("head = {head}\n");
        } else {
            for head in heads {
                text += &format!("[[station]]\nname = \"{head}\"\nhead = {head}\n");
            }
        }
        for head in heads {
            let (at, of) = if heads.len() > 1 {
                (format!("station = \"{head}\"\n"), format!("{head} "))
            } else {
                Default::default()
            };
            for (name, address) in signals {
                text +=
                    &format!("[[signal]]\n{at}name = \"{of}{name}\"\naddress = \"{address}\"\n");
            }
            for (area, first, name) in [('I', 4, "in"), ('Q', 4, "out")] {
                let first = if kind == "ivi-reader" { 8 } else { first };
                for octet in 0..DATA {
                    text += &format!(
                        "[[signal]]\n{at}name = \"{of}{name} {octet}\"\naddress = \"%{area}B{}\"\n",
                        first + octet
                    );
                }
            }
        }
        End::open(&text, &Monotonic::shared())
    }

    fn reader(&self, heads: &[u8]) -> End {
        self.open(
            "ivi-reader",
            "pty:",
            heads,
            "",
            &[
                ("present", "%IX0.0"),
                ("unplugged", "%IX0.1"),
                ("protected", "%IX0.2"),
                ("fault", "%IB1"),
                ("number", "%ID4"),
                ("taken", "%QX0.0"),
                ("writes", "%QB1"),
            ],
        )
    }

    fn client(&self, heads: &[u8], extra: &str) -> End {
        let role = format!("role = \"controller\"\n{extra}");
        self.open(
            "ivi-client",
            "",
            heads,
            &role,
            &[
                ("echo", "%IB0"),
                ("status", "%IB1"),
                ("present", "%IX2.0"),
                ("connected", "%IX2.1"),
                ("length", "%IB3"),
                ("command", "%QB0"),
                ("count", "%QB1"),
                ("address", "%QW2"),
            ],
        )
    }
}

/// Machine and controller.
struct Pair {
    line: Line,
    machine: End,
    controller: End,
    toggle: u8,
}

impl Pair {
    fn new() -> Self {
        Self::with(&[1], "")
    }

    fn with(heads: &[u8], extra: &str) -> Self {
        let line = Line::new();
        let machine = line.reader(heads);
        let controller = line.client(heads, extra);
        Self {
            line,
            machine,
            controller,
            toggle: 0,
        }
    }

    #[track_caller]
    fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        await_that(what, || {
            self.machine.tick();
            self.controller.tick();
            done(self)
        });
    }

    /// The machine puts a carrier before the head.
    #[track_caller]
    fn put(&mut self, octets: &[u8]) {
        for (index, octet) in octets.iter().enumerate() {
            self.machine.set(&format!("in {index}"), f64::from(*octet));
        }
        self.machine.set("present", 1.0);
        self.until("the carrier is seen", |pair| {
            pair.machine.get("taken") == 1.0 && pair.controller.get("present") == 1.0
        });
    }

    fn command(&mut self, command: u8, address: u16, count: u8, data: &[u8]) {
        self.toggle ^= 0x80;
        for (index, octet) in data.iter().enumerate() {
            self.controller
                .set(&format!("out {index}"), f64::from(*octet));
        }
        self.controller.set("address", f64::from(address));
        self.controller.set("count", f64::from(count));
        self.controller
            .set("command", f64::from(command | self.toggle));
    }

    /// Gives a command and waits for its answer: the status, and the data.
    #[track_caller]
    fn ask(&mut self, command: u8, address: u16, count: u8, data: &[u8]) -> (u8, Vec<u8>) {
        self.command(command, address, count, data);
        self.answer(command)
    }

    #[track_caller]
    fn answer(&mut self, command: u8) -> (u8, Vec<u8>) {
        let echo = f64::from(command | self.toggle);
        self.until("the answer comes", |pair| {
            pair.controller.get("echo") == echo
        });
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "octets"
        )]
        let octet = |name: &str| self.controller.get(name) as u8;
        let data = (0..octet("length")).map(|index| octet(&format!("in {index}")));
        (octet("status"), data.collect())
    }
}

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
    // The same command once more is a new one by its toggle bit.
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
    // The next one begins with what it brings.
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
        let mut found = 0;
        // The reader takes it over within a cycle.
        while found != status {
            found = pair.ask(command, 0, 1, &[5]).0;
            assert!([0, status].contains(&found));
        }
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

#[test]
fn a_silent_reader_is_told_and_a_command_without_an_answer_is_not_given_twice() {
    let line = Line::new();
    // A reader that is switched off: the line is there.
    let off = LinkedTerminal::open(&line.name()).expect("a terminal");
    let mut controller = line.client(&[1], "timeout = \"20ms\"");
    await_that("the silence is told", || {
        controller.tick();
        controller
            .link()
            .reason
            .contains("did not answer within 20ms")
    });
    assert_eq!(controller.link().state, LinkState::Opening);
    drop(off);
    let machine = line.reader(&[1]);
    let mut pair = Pair {
        line,
        machine,
        controller,
        toggle: 0,
    };
    pair.put(&[1]);
    assert_eq!(pair.ask(b'w', 0, 1, &[]), (0, vec![1]));
    // The next command meets a line that carries nothing.
    let cut = pair.machine.driver.inject_text("kind = \"link-down\"");
    let cut = cut.expect("a fault");
    await_that("it carries nothing", || {
        pair.machine.tick();
        pair.machine.link().cause == Cause::Injected
    });
    pair.command(b'k', 0, 1, &[2]);
    await_that("the command is given up", || {
        pair.machine.tick();
        pair.controller.tick();
        pair.controller.link().reason.contains("did not answer")
    });
    assert!(pair.machine.driver.end_fault(cut));
    assert_eq!(pair.answer(b'k'), (NO_ANSWER, vec![]));
    assert_eq!(
        pair.ask(b'w', 0, 1, &[]),
        (0, vec![1]),
        "it was not written"
    );
}

#[test]
fn another_program_speaks_with_the_reader_as_with_a_serial_port() {
    let line = Line::new();
    let mut machine = line.reader(&[1]);
    machine.set("present", 1.0);
    machine.set("in 0", 3.0);
    let settings = SerialSettings {
        baud: 9600,
        parity: Parity::None,
        two_stop_bits: false,
        rs485: false,
    };
    let mut port = None;
    await_that("the port is there", || {
        machine.tick();
        port = SerialPort::open(&line.name(), settings).ok();
        port.is_some()
    });
    let mut port = port.expect("it is there");
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
    std::io::Write::write_all(&mut port, client.to_write()).expect("room");
    let mut found = None;
    await_that("the answer comes", || {
        machine.tick();
        let mut bytes = [0; 16];
        if let Ok(count) = std::io::Read::read(&mut port, &mut bytes) {
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
