//! The bus `interbus-ddi` against a library that stands in for the vendor's.
#![cfg(target_os = "linux")]
#![allow(missing_docs, clippy::float_cmp, reason = "tests; small whole numbers")]

use std::sync::Arc;

use tickbus_base::time::Manual;
use tickbus_bus_interbus::ERRORS;
use tickbus_conformance::conformance;
use tickbus_conformance::rig::{Bus, CYCLE, End, Liar, await_that};
use tickbus_conformance::standin::{self, StandIn, until, until_it_hangs};
use tickbus_driver::Code;
use tickbus_driver_cfg::{Kind, Kinds};
use tickbus_fieldbus::Verdict;

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_interbus::Options>()]);

/// Two connected boards.
struct Boards {
    library: Arc<StandIn>,
    extra: &'static str,
}

impl Boards {
    fn new() -> Self {
        Self::with(&[], "")
    }

    fn with(switches: &[&str], extra: &'static str) -> Self {
        let library = StandIn::build("standin_ddi.c", switches, "Ibddiwnt.dll");
        Self {
            library: Arc::new(library),
            extra,
        }
    }

    fn open(&self, role: &str, clock: &Arc<Manual>) -> End {
        standin::open(self, role, self.extra, clock)
    }
}

impl Bus for Boards {
    fn kinds(&self) -> &'static Kinds {
        &KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let library = self.library.library();
        let board = if role == "device" { 1 } else { 2 };
        format!("kind = \"interbus-ddi\"\nlibrary = \"{library}\"\ndevice = \"IBB{board}N1\"")
    }

    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        let words = "GetIBSDiagnostic returned 0x1234, a code that tickbus does not know; see the vendor's manual";
        standin::liar(&self.library, "GetIBSDiagnostic 0x1234\n", words)
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"interbus-ddi\"", "has no \"library\""),
            (
                "kind = \"interbus-ddi\"\nlibrary = \"x\"\ndevice = 1",
                "name board and node",
            ),
            (
                "kind = \"interbus-ddi\"\nlibrary = \"x\"\nactivate = 0",
                "from 1 to 65535",
            ),
            (
                "kind = \"interbus-ddi\"\nlibrary = \"x\"\nstart_timeout = 3",
                "write a duration",
            ),
            (
                "kind = \"interbus-ddi\"\nlibrary = \"./libnone.so\"",
                "libnone.so; check `library`",
            ),
        ]
    }
}

conformance!(suite, crate::Boards::new());

/// All calls with the board's watchdog that are independent of the other board.
const CALLS: [&str; 11] = [
    "DDI_DevOpenNode(IBB1N1_M, 3)",
    "DDI_DevOpenNode(IBB1N1_D, 3)",
    "DDI_MXI_RcvMessage(11, 128)",
    "DDI_MXI_SndMessage(11, 0, 0, 0351 0002 0001 2240)",
    "DDI_MXI_RcvMessage(11, 128)",
    "DDI_MXI_SndMessage(11, 0, 0, 0711 0000)",
    "DDI_MXI_SndMessage(11, 0, 0, 0701 0000)",
    "GetIBSDiagnostic(10)",
    "EnableWatchDog(10)",
    "TriggerWatchDog(10)",
    "DDI_DTI_WriteData(10, 0, 6, 0)",
];
const READS: &str = "DDI_DTI_ReadData(10, 0, 6, 0)";
const CLOSING: [&str; 3] = [
    "ClearWatchDog(10)",
    "DDI_DevCloseNode(10)",
    "DDI_DevCloseNode(11)",
];

const WATCHED: &str = "card_watchdog = true\nactivate = 0x0711";

/// The calls of the first board.
fn calls_of_first(boards: &Boards) -> Vec<String> {
    let of_second = |call: &String| ["(2", "IBB2"].iter().any(|part| call.contains(part));
    let calls = boards.library.calls();
    let mut calls: Vec<String> = calls.into_iter().filter(|call| !of_second(call)).collect();
    calls.dedup();
    calls
}

#[test]
fn calls_are_made_in_the_order_of_the_vendor_and_undone_in_the_reverse() {
    let (boards, clock) = (Boards::with(&[], WATCHED), Manual::new());
    let mut device = boards.open("device", &clock);
    let _controller = boards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    assert_eq!(device.statistic("card"), "IBB1N1");
    assert_eq!(
        device.statistic("card.state"),
        "00E0 RUN ACTIVE READY, parameter 0007"
    );
    device.driver.close();
    let calls = calls_of_first(&boards);
    assert_eq!(calls[..11], CALLS);
    assert_eq!(calls[11], READS);
    let between = [CALLS[7], CALLS[9], CALLS[10], READS];
    let again = &calls[12..calls.len() - 3];
    assert!(
        again.iter().all(|call| between.contains(&call.as_str())),
        "{again:?}"
    );
    assert_eq!(calls[calls.len() - 3..], CLOSING);
}

/// The functions, each with the number of closing calls that follow when it fails.
const FUNCTIONS: [(&str, usize); 8] = [
    ("DDI_DevOpenNode(IBB1N1_D", 1),
    ("DDI_MXI_RcvMessage(11", 2),
    ("DDI_MXI_SndMessage(11", 2),
    ("GetIBSDiagnostic(10", 2),
    ("EnableWatchDog(10", 3),
    ("TriggerWatchDog(10", 3),
    ("DDI_DTI_WriteData(10", 3),
    ("DDI_DTI_ReadData(10", 3),
];

#[test]
fn each_error_code_at_each_call_is_told_with_its_name_and_what_to_do_and_what_was_opened_is_closed()
{
    for (switches, base) in [(&[][..], 0), (&["-DWINDOWS"], 0xE007_0000_u32)] {
        let boards = Boards::with(switches, WATCHED);
        for row in ERRORS {
            for (call, undone) in FUNCTIONS {
                // The code means that the answer has not come yet, and has a separate test.
                if row.code == 0x9B && call.starts_with("DDI_MXI_RcvMessage") {
                    continue;
                }
                let clock = Manual::new();
                let (code, name, words) = (row.code, row.name, row.words);
                boards.library.script(&format!("{call} {code:#x}\n"));
                let before = boards.library.calls().len();
                let mut device = boards.open("device", &clock);
                let controller = (undone == 3).then(|| boards.open("controller", &clock));
                let cause = if row.verdict == Verdict::Refused {
                    "refused"
                } else {
                    "link"
                };
                let reason = until(&mut device, &clock, "failed", cause);
                let function = call.split('(').next().expect("a name");
                let right = format!(
                    "{function} returned {name} (0x{:X}): {words}; next attempt",
                    code + base
                );
                assert!(reason.contains(&right), "{reason}, not {right}");
                device.driver.close();
                drop(controller);
                let calls = boards.library.calls();
                let is_closing = |call: &&String| CLOSING.contains(&call.as_str());
                let closing: Vec<&String> = calls[before..].iter().filter(is_closing).collect();
                assert_eq!(closing, CLOSING[3 - undone..], "{call}");
            }
        }
    }
}

#[test]
fn a_board_in_plug_and_play_mode_is_refused_and_one_that_does_not_know_it_is_not() {
    let (boards, clock) = (Boards::new(), Manual::new());
    boards.library.script("mode 1\n");
    let mut device = boards.open("device", &clock);
    let reason = until(&mut device, &clock, "failed", "refused");
    assert!(
        reason.contains("the board is in plug-and-play mode 1, in which nobody can write;"),
        "{reason}"
    );
    boards.library.script("mode 1\nanswer 8\n");
    let _controller = boards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
}

#[test]
fn a_bus_that_does_not_start_is_told_with_its_state_and_tried_again() {
    let (boards, clock) = (
        Boards::with(&[], "start_timeout = \"200ms\""),
        Manual::new(),
    );
    let mut device = boards.open("device", &clock);
    until(&mut device, &clock, "opening", "waiting");
    await_that("it says what it waits for", || {
        clock.advance(CYCLE);
        device.link().reason == "the bus is open; the board starts INTERBUS"
    });
    let reason = until(&mut device, &clock, "failed", "link");
    assert!(
        reason.contains(
            "INTERBUS did not start within 200ms, its state is 0080 READY, parameter 0007"
        ),
        "{reason}"
    );
    let _controller = boards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    assert!(
        device
            .statistic("interbus-ddi.no_bus")
            .parse::<u64>()
            .expect("a count")
            > 2
    );
}

#[test]
fn a_bus_that_stops_makes_its_data_stale_and_is_started_anew() {
    let (boards, clock) = (Boards::new(), Manual::new());
    let mut device = boards.open("device", &clock);
    let controller = boards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    controller.driver.close();
    let reason = until(&mut device, &clock, "failed", "link");
    assert!(
        reason.contains("INTERBUS stopped, its state is 0080 READY, parameter 0007"),
        "{reason}"
    );
    await_that("its data are stale", || {
        clock.advance(CYCLE);
        device.tick().code == Code::Stale
    });
    assert_eq!(device.get("speed"), -1.0, "the fail-safe value");
    let _controller = boards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
}

#[test]
fn words_are_big_endian_odd_places_are_moved_byte_by_byte_and_too_large_ones_refused() {
    let (boards, clock) = (
        Boards::with(&[], "write_offset = 3\nread_offset = 2"),
        Manual::new(),
    );
    let mut device = boards.open("device", &clock);
    let _controller = boards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    let calls = calls_of_first(&boards);
    for right in [
        "DDI_DTI_WriteData(10, 3, 6, 2)",
        "DDI_DTI_ReadData(10, 2, 6, 0)",
    ] {
        assert!(calls.iter().any(|call| call == right), "{right}");
    }
    let (boards, clock) = (Boards::with(&[], "read_offset = 508"), Manual::new());
    let mut device = boards.open("device", &clock);
    let _controller = boards.open("controller", &clock);
    let reason = until(&mut device, &clock, "failed", "refused");
    assert!(
        reason.contains("DDI_DTI_ReadData returned area exceeded (0x96): the signals reach"),
        "{reason}"
    );
}

#[test]
fn an_answer_that_does_not_come_and_a_call_that_hangs_are_told() {
    let extra = "start_timeout = \"200ms\"";
    let (boards, clock) = (Boards::with(&[], extra), Manual::new());
    boards.library.script("DDI_MXI_RcvMessage 0x9B\n");
    let mut device = boards.open("device", &clock);
    let reason = until(&mut device, &clock, "failed", "link");
    assert!(
        reason.contains("DDI_MXI_RcvMessage returned no message (0x9B): the board did not answer"),
        "{reason}"
    );
    boards.library.script("DDI_DevOpenNode hang\n");
    until_it_hangs(&device, &clock, "opening by Ibddiwnt.dll");
    boards.library.script("");
    let _controller = boards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
}
