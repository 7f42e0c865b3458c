//! The bus at a real dispatcher, over TCP: the conformance suite, and its own tests.
#![cfg(unix)]
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod laboratory;

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::sync::Arc;
use std::thread;

use laboratory::{KINDS, Laboratory};
use tickbus_base::time::{Clock as _, Manual, Monotonic, Nanos};
use tickbus_conformance::conformance;
use tickbus_conformance::rig::{self, End, await_that, pass};
use tickbus_driver::Code;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{Cause, LinkState};

conformance!(laboratory_suite, crate::laboratory::Laboratory::patched());

/// A client by hand.
struct Hand {
    stream: TcpStream,
    lines: BufReader<TcpStream>,
}

impl Hand {
    fn join(laboratory: &Laboratory, identification: &str) -> Self {
        let stream = TcpStream::connect(laboratory.address()).expect("it listens");
        stream.set_nodelay(true).expect("a TCP option");
        let lines = BufReader::new(stream.try_clone().expect("a descriptor"));
        let mut hand = Self { stream, lines };
        hand.say(&format!("{identification} V=2"));
        hand.until("END");
        hand
    }

    fn say(&mut self, line: &str) {
        writeln!(self.stream, "{line}").expect("it reads");
    }

    fn until(&mut self, start: &str) -> String {
        loop {
            let mut line = String::new();
            let count = self.lines.read_line(&mut line).expect("a further line");
            assert_ne!(count, 0, "it was closed before {start}");
            if line.starts_with(start) {
                return line.trim_end().to_owned();
            }
        }
    }
}

/// A machine with its own clock.
struct Machine {
    end: End,
    clock: Arc<Manual>,
}

impl Machine {
    fn open(laboratory: &Laboratory, extra: &str) -> Self {
        let clock = Manual::new();
        let text = laboratory.config("device", extra);
        let end = End::open(&text, &clock, &KINDS);
        Self { end, clock }
    }

    #[track_caller]
    fn until(&mut self, what: &str, mut done: impl FnMut(&mut End) -> bool) {
        await_that(what, || {
            pass(&self.clock, 1);
            self.end.tick();
            done(&mut self.end)
        });
    }

    /// Lets time pass until a client by hand has received such a line.
    fn until_heard(&mut self, hand: &mut Hand, start: &str) -> String {
        thread::scope(|scope| {
            let hearing = scope.spawn(|| hand.until(start));
            while !hearing.is_finished() {
                self.end.tick();
                pass(&self.clock, 1);
            }
            hearing.join().expect("it is heard")
        })
    }

    #[track_caller]
    fn until_reason(&mut self, part: &str) -> Cause {
        self.until(part, |end| end.link().reason.contains(part));
        self.end.link().cause
    }
}

const PLC: &str = "VR device-PLC Q01 I01 AQ02 AI02";

#[test]
fn volts_have_hysteresis_and_numbers_a_range() {
    let laboratory = Laboratory::patched();
    laboratory.serve();
    let mut machine = Machine::open(&laboratory, "");
    machine.until_reason("no input has a source yet; connect one in the dispatcher");
    assert_eq!(machine.end.tick().code, Code::Stale);
    assert_eq!(machine.end.get("speed"), -1.0, "fail-safe");
    let mut plc = Hand::join(&laboratory, PLC);
    let volts = [
        (0.0, "0"),
        (0.0, "5"),
        (0.0, "8"),
        (1.0, "8.1"),
        (1.0, "8"),
        (1.0, "5"),
        (0.0, "4.9"),
    ];
    for (mark, (run, volts)) in volts.into_iter().enumerate() {
        plc.say(&format!("P Q1={volts} AQ1={mark}"));
        let mark = f64::from(u32::try_from(mark).expect("small"));
        machine.until(volts, |end| end.get("speed") == mark);
        assert_eq!(machine.end.get("run"), run, "{volts} V");
    }
    assert_eq!(machine.end.link().state, LinkState::Running);
    rig::logged::expect("AI1 got 40000, which no INT holds");
    plc.say("P AQ1=40000 AQ2=1");
    machine.until("the rest of the line counts", |end| end.get("echo") == 1.0);
    assert_eq!(machine.end.get("speed"), 6.0, "out of range");
    assert_eq!(machine.end.statistic("dispatcher.out_of_range"), "1");
    plc.say("P AQ1=-12.5 AQ2=2");
    machine.until("the next one", |end| end.get("echo") == 2.0);
    assert_eq!(machine.end.get("speed"), -13.0, "rounded");
    machine.end.set("sensor", 1.0);
    machine.end.set("position", -7.0);
    let line = machine.until_heard(&mut plc, "P I1=24");
    assert_eq!(line, "P I1=24 AI1=-7");
    machine.end.set("sensor", 0.0);
    assert_eq!(machine.until_heard(&mut plc, "P I1"), "P I1=0");
}

#[test]
fn an_input_without_its_source_has_its_fail_safe_value_and_without_all_it_is_stale() {
    let laboratory = Laboratory::patched();
    laboratory.serve();
    let mut machine = Machine::open(&laboratory, "");
    let mut plc = Hand::join(&laboratory, PLC);
    plc.say("P Q1=24 AQ1=5 AQ2=6");
    machine.until("values", |end| end.get("echo") == 6.0);
    plc.say("DISCONNECT AQ1");
    machine.until("fail-safe", |end| end.get("speed") == -1.0);
    assert_eq!(
        (machine.end.get("run"), machine.end.get("echo")),
        (1.0, 6.0)
    );
    assert_ne!(machine.end.tick().code, Code::Stale);
    assert_eq!(machine.end.link().state, LinkState::Running);
    assert_eq!(machine.end.statistic("dispatcher.lost"), "1");
    drop(plc);
    assert_eq!(
        machine.until_reason("no input has a source any more"),
        Cause::Left
    );
    machine.until("it is stale", |end| end.tick().code == Code::Stale);
    assert_eq!(machine.end.get("run"), 0.0);
    // The connections of clients that have left sleep, and wake by the name.
    let mut plc = Hand::join(&laboratory, PLC);
    plc.say("P Q1=24 AQ2=8");
    machine.until("it is back", |end| {
        end.get("echo") == 8.0 && end.tick().code != Code::Stale
    });
    assert_eq!(
        (machine.end.get("run"), machine.end.get("speed")),
        (1.0, -1.0)
    );
    assert_eq!(machine.end.link().state, LinkState::Running);
}

#[test]
fn the_last_line_of_a_controller_has_the_fail_safe_values() {
    // An input whose source has left is 0.
    let both = ["P AI1=-1", "P AI1=0"];
    for (further, heard) in [("", &both[..]), ("at_close = \"hold\"", &both[1..])] {
        let laboratory = Laboratory::patched();
        laboratory.serve();
        let mut machine = Hand::join(&laboratory, "VR device Q01 I01 AQ02 AI02");
        machine.say("P Q1=24 AQ1=7 AQ2=7");
        let text = laboratory
            .config("controller", further)
            .replace("300ms", "20s");
        let mut controller = End::open(&text, &Monotonic::shared(), &KINDS);
        // While the data are stale, the controller sends fail-safe values as well.
        while controller.tick().code == Code::Stale {
            thread::yield_now();
        }
        thread::scope(|scope| {
            let hearing = scope.spawn(|| while !machine.until("P").contains("AI1=10") {});
            while !hearing.is_finished() {
                controller.set("speed", 10.0);
                controller.tick();
                thread::yield_now();
            }
        });
        controller.driver.close();
        for line in heard {
            assert_eq!(machine.until("P"), *line, "{further}");
        }
    }
}

#[test]
fn connections_are_asked_for_until_the_other_client_comes() {
    let laboratory = Laboratory::empty();
    laboratory.serve();
    let mut machine = Machine::open(&laboratory, "connect = [\"AI1:PLC:AQ1\", \"Q1:PLC:I1\"]");
    let reason = "no input has a source yet; Q1:PLC:I1 was refused: there is no client PLC; LIST shows who is here (ERR 404)";
    machine.until_reason(reason);
    let mut plc = Hand::join(&laboratory, "VR PLC I01 AQ01");
    plc.say("P AQ1=3");
    machine.end.set("sensor", 1.0);
    machine.clock.advance(Nanos::from_secs(5));
    machine.until("it is connected", |end| end.get("speed") == 3.0);
    machine.until("its own, too", |end| end.link().state == LinkState::Running);
    machine.until_heard(&mut plc, "P I1=24");
}

#[test]
fn a_dispatcher_that_restarts_is_joined_again() {
    let laboratory = Laboratory::patched();
    laboratory.serve();
    let mut machine = Machine::open(&laboratory, "");
    machine.end.set("position", 9.0);
    let mut plc = Hand::join(&laboratory, PLC);
    plc.say("P AQ1=3");
    machine.until("a value", |end| end.get("speed") == 3.0);
    laboratory.stop();
    machine.until("it is gone", |end| end.link().state != LinkState::Running);
    machine.until("it is stale", |end| end.tick().code == Code::Stale);
    assert_eq!(machine.end.get("speed"), -1.0);
    laboratory.serve();
    let mut plc = Hand::join(&laboratory, PLC);
    plc.say("P AQ1=4");
    machine.until("a value again", |end| end.get("speed") == 4.0);
    let line = plc.until("P");
    assert!(line.contains("AI1=9"), "all is said anew: {line}");
}

#[test]
fn a_name_that_is_taken_is_told_and_tried_again() {
    let laboratory = Laboratory::patched();
    laboratory.serve();
    let other = Hand::join(&laboratory, "VP device Q01");
    let mut machine = Machine::open(&laboratory, "");
    let reason =
        "the dispatcher has another client \"device\"; give this one a \"name\" of its own";
    assert_eq!(machine.until_reason(reason), Cause::Refused);
    drop(other);
    let mut plc = Hand::join(&laboratory, PLC);
    plc.say("P AQ1=3");
    machine.until("it has joined", |end| end.get("speed") == 3.0);
}

#[test]
fn a_name_that_no_dispatcher_takes_is_found_when_it_opens() {
    let text = Laboratory::empty()
        .config("device", "")
        .replace("\"device\"\n[", "\"Line 3\"\n[");
    let config = Config::parse("driver.cfg", &text, &KINDS).expect("a right file");
    let error = tickbus_driver::Driver::open(config, Manual::new())
        .expect_err("a blank")
        .to_string();
    assert!(
        error.contains("the driver's name makes \"Line 3\", which no dispatcher takes; write a \"name\" of 1 to 63"),
        "{error}"
    );
}

#[test]
fn a_machine_that_only_reads_stays_fresh_while_nothing_changes() {
    let laboratory = Laboratory::patched();
    laboratory.serve();
    let mut machine = Machine::open(&laboratory, "");
    let mut plc = Hand::join(&laboratory, PLC);
    plc.say("P AQ1=3");
    machine.until("a value", |end| end.get("speed") == 3.0);
    let begun = machine.clock.now();
    while machine.clock.now() - begun < rig::MAX_AGE.times(10) {
        machine.until("it is fresh", |end| end.tick().code != Code::Stale);
    }
}

#[test]
fn the_simulator_of_the_document_joins_as_it_is_written() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/dispatcher.md");
    let document = std::fs::read_to_string(path).expect("the document");
    let (_, section) = document
        .split_once("\n## A Java simulator joins\n")
        .expect("its section");
    let block = |start: &str| {
        let (_, block) = section.split_once(start).expect(start);
        block.split_once("\n```").expect("an end").0
    };
    let laboratory = Laboratory::empty();
    laboratory.serve();
    let kind = "kind    = \"dispatcher\"\n";
    let moved = format!("{kind}address = \"{}\"\n", laboratory.address());
    let text = format!("{}\n", block("```toml\n")).replace(kind, &moved);
    let clock = Manual::new();
    let mut machine = Machine {
        end: End::open(&text, &clock, &KINDS),
        clock,
    };
    machine.until_reason("no input has a source yet");
    let mut logo = Hand::join(&laboratory, "VR LOGO Q08 I08 AQ02 AI03");
    logo.say("LIST");
    assert!(logo.until("VP:PUMP:Q01:I01:AQ01:AI00:").len() > 20);
    for line in block("```text\n").lines() {
        match line.strip_prefix("> ") {
            Some(said) => logo.say(said),
            None => assert_eq!(logo.until(line), line),
        }
    }
    machine.until("Motor on", |end| end.get("Motor on") == 1.0);
}
