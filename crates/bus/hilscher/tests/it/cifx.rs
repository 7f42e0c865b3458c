//! The bus `hilscher-cifx` against a library that stands in for the vendor's.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::Manual;
use tickbus_bus_hilscher::cifx::ERRORS;
use tickbus_conformance::conformance;
use tickbus_conformance::rig::{Bus, CYCLE, End, Liar, SIGNALS, await_that, pass};
use tickbus_conformance::standin::{self, StandIn, until, until_it_hangs};
use tickbus_driver::Code;
use tickbus_driver_cfg::{Kind, Kinds};
use tickbus_fieldbus::{BusError, Cause, Failing, Meaning, Verdict};

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_hilscher::cifx::Options>()]);

/// Two cards with connected process images.
struct Cards {
    library: Arc<StandIn>,
    extra: &'static str,
}

impl Cards {
    fn new() -> Self {
        Self::with(&[], "")
    }

    fn with(switches: &[&str], extra: &'static str) -> Self {
        let library = StandIn::build("standin_cifx.c", switches, "libcifx.so.3");
        Self {
            library: Arc::new(library),
            extra,
        }
    }

    fn open(&self, role: &str, clock: &Arc<Manual>) -> End {
        standin::open(self, role, self.extra, clock)
    }
}

impl Bus for Cards {
    fn kinds(&self) -> &'static Kinds {
        &KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let board = if role == "device" { "cifX0" } else { "cifX1" };
        let library = self.library.library();
        format!(
            "kind = \"hilscher-cifx\"\nlibrary = \"{library}\"\nboard = \"{board}\"\nbus_on_timeout = \"1ms\""
        )
    }

    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        let words = "xChannelIORead returned 0x8BADC0DE, a code that tickbus does not know; see the vendor's manual";
        standin::liar(&self.library, "xChannelIORead 0x8BADC0DE\n", words)
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"hilscher-cifx\"\nboard = 3", "name the board as"),
            ("kind = \"hilscher-cifx\"\nchannel = 6", "from 0 to 5"),
            (
                "kind = \"hilscher-cifx\"\nread_offset = 70000",
                "from 0 to 65535",
            ),
            (
                "kind = \"hilscher-cifx\"\nio_timeout = \"1us\"",
                "at least \"1ms\"",
            ),
            (
                "kind = \"hilscher-cifx\"\nbus_on_timeout = \"1h\"",
                "at most \"10min\"",
            ),
            (
                "kind = \"hilscher-cifx\"\nlibrary = \"./libnone.so\"",
                "libnone.so; check `library`",
            ),
        ]
    }
}

conformance!(suite, crate::cifx::Cards::new());

/// The calls in their order, and the calls that undo each, with the arguments of the first card.
const OPENING: [&str; 6] = [
    "cifXDriverInit(1, defaults, 0)",
    "xDriverOpen()",
    "xChannelOpen(driver, cifX0, 0)",
    "xChannelInfo(0, 164)",
    "xChannelHostState(0, 1, 1000)",
    "xChannelBusState(0, 1, 1)",
];
const MOVING: [&str; 2] = [
    "xChannelIOWrite(0, 0, 0, 6, 10)",
    "xChannelIORead(0, 0, 0, 6, 10)",
];
const CLOSING: [&str; 5] = [
    "xChannelBusState(0, 0, 1000)",
    "xChannelHostState(0, 0, 1000)",
    "xChannelClose(0)",
    "xDriverClose(driver)",
    "cifXDriverDeinit()",
];

/// The number of closing calls that follow when the function of this index fails.
const UNDONE: [usize; 8] = [0, 1, 2, 5, 4, 5, 5, 5];

fn function(call: &str) -> &str {
    call.split('(').next().expect("a name")
}

#[test]
fn calls_are_made_in_the_order_of_the_vendor_and_undone_in_the_reverse() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut end = cards.open("device", &clock);
    await_that("data are moved", || {
        clock.advance(CYCLE);
        cards.library.calls().len() > 8
    });
    assert_eq!(end.tick().code, Code::Stale);
    assert_eq!(
        end.statistic("card"),
        "cifX0, serial number 20123, firmware PROFIBUS DPS? 2.7.0.0"
    );
    assert_eq!(end.statistic("card.state"), "ready, run, bus on");
    end.driver.close();
    let calls = cards.library.calls();
    assert_eq!(calls[..6], OPENING);
    assert!(
        calls[6..calls.len() - 5]
            .chunks(2)
            .all(|pair| pair == MOVING || pair == &MOVING[..1])
    );
    assert_eq!(calls[calls.len() - 5..], CLOSING);
}

#[test]
fn a_call_that_fails_is_named_and_all_before_it_is_undone() {
    for (index, call) in OPENING.iter().chain(&MOVING).enumerate() {
        // Only for people.
        if index == 3 {
            continue;
        }
        let (cards, clock) = (Cards::new(), Manual::new());
        let name = function(call);
        cards.library.script(&format!("{name} 0x800A0009\n"));
        let mut end = cards.open("device", &clock);
        let reason = until(&mut end, &clock, "failed", "link");
        let right = format!(
            "the link failed: {name} returned CIFX_FUNCTION_FAILED (0x800A0009): the driver gives"
        );
        assert!(reason.starts_with(&right), "{reason}");
        let mut expected: Vec<&str> = OPENING
            .iter()
            .chain(&MOVING)
            .copied()
            .take(index + 1)
            .collect();
        expected.extend(&CLOSING[5 - UNDONE[index]..]);
        assert_eq!(cards.library.calls(), expected, "{name}");
    }
}

/// The effect of an error code at a function.
#[test]
fn each_error_code_at_each_call_is_told_with_its_name_and_what_to_do() {
    let cards = Cards::new();
    for meaning in ERRORS {
        for (index, call) in OPENING.iter().chain(&MOVING).enumerate() {
            let Meaning {
                code,
                name,
                verdict,
                words,
            } = *meaning;
            let function = function(call);
            if index == 3 {
                continue;
            }
            cards.library.script(&format!("{function} {code:#x}\n"));
            let clock = Manual::new();
            let mut end = cards.open("device", &clock);
            let is_moving = index >= OPENING.len();
            let text = format!("{function} returned {name} (0x{code:08X}): {words}");
            match verdict {
                Verdict::NoPeer if index >= 5 => {
                    let reason = until(&mut end, &clock, "opening", "waiting");
                    assert!(!reason.contains("returned"), "{reason}");
                    await_that("it is told", || {
                        clock.advance(CYCLE);
                        end.link().reason == format!("the bus is open; {words}")
                    });
                }
                // The other end is off, as the other direction reports.
                Verdict::Again if is_moving => await_that("it is counted", || {
                    clock.advance(CYCLE);
                    end.driver.statistics().contains("\nhilscher-cifx.no_com=")
                }),
                Verdict::Refused => {
                    let reason = until(&mut end, &clock, "failed", "refused");
                    assert!(
                        reason.starts_with(&format!("refused: {text}; next")),
                        "{reason}"
                    );
                }
                _ => {
                    let reason = until(&mut end, &clock, "failed", "link");
                    assert!(
                        reason.starts_with(&format!("the link failed: {text}; next")),
                        "{reason}"
                    );
                }
            }
        }
    }
}

#[test]
fn without_its_bus_a_card_gets_the_data_all_the_same_and_none_of_its_own_count() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut device = cards.open("device", &clock);
    let words = ERRORS
        .iter()
        .find(|row| row.code == 0x800C_0021)
        .expect("NO_COM")
        .words;
    device.set("position", 258.0);
    await_that("the value is in the card", || {
        clock.advance(CYCLE);
        assert_eq!(device.tick().code, Code::Stale);
        let image = std::fs::read(cards.library.file("image")).unwrap_or_default();
        image.len() == 512 && image[2..4] == [1, 2]
    });
    assert_eq!(device.link().reason, format!("the bus is open; {words}"));
    let controller = cards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    controller.driver.close();
    let reason = until(&mut device, &clock, "opening", "link");
    assert_eq!(
        reason,
        format!("the link failed: {words}; waiting for the next peer")
    );
    await_that("its data are stale", || {
        clock.advance(CYCLE);
        device.tick().code == Code::Stale
    });
    assert_eq!(device.get("speed"), -1.0, "the fail-safe value");
    let _controller = cards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    let count = device.statistic("hilscher-cifx.no_com").parse::<u64>();
    assert!(count.expect("a count") > 2);
}

#[test]
fn a_card_that_was_removed_is_opened_anew_when_it_is_back() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut device = cards.open("device", &clock);
    let _controller = cards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    cards
        .library
        .script("xChannelIORead 0x800B0034\nxDriverOpen 0x800B0030\n");
    let reason = until(&mut device, &clock, "failed", "link");
    assert!(
        reason.contains("xChannelIORead returned CIFX_DRV_NOT_OPENED"),
        "{reason}"
    );
    await_that("it is tried again", || {
        clock.advance(CYCLE);
        device
            .link()
            .reason
            .contains("xDriverOpen returned CIFX_DRV_DRIVER_NOT_LOADED")
    });
    cards.library.script("");
    until(&mut device, &clock, "running", "running");
}

#[test]
fn a_call_that_hangs_is_told_and_ends_when_it_returns() {
    for (function, by) in [
        ("xDriverOpen", "opening by"),
        ("xChannelIORead", "exchange by"),
    ] {
        let (cards, clock) = (Cards::new(), Manual::new());
        cards.library.script(&format!("{function} hang\n"));
        let mut end = cards.open("device", &clock);
        let what = format!("{by} libcifx.so.3");
        until_it_hangs(&end, &clock, &what);
        cards.library.script("");
        let _controller = cards.open("controller", &clock);
        until(&mut end, &clock, "running", "running");
    }
}

#[test]
fn the_card_s_watchdog_is_started_triggered_and_stopped_in_time() {
    let (cards, clock) = (Cards::with(&[], "card_watchdog = true"), Manual::new());
    let mut end = cards.open("device", &clock);
    let watchdog = |trigger: u8| format!("xChannelWatchdog(0, {trigger})");
    await_that("it is triggered", || {
        clock.advance(CYCLE);
        cards
            .library
            .calls()
            .iter()
            .filter(|call| **call == watchdog(1))
            .count()
            > 3
    });
    // Another program's call is active for a moment.
    cards.library.script("xChannelWatchdog 0x800B0004\n");
    let before = cards.library.calls().len();
    await_that("it goes on", || {
        clock.advance(CYCLE);
        end.tick();
        cards.library.calls().len() > before + 20
    });
    assert!(!cards.library.calls().contains(&CLOSING[0].to_owned()));
    cards.library.script("xChannelWatchdog 0x800C0013\n");
    let reason = until(&mut end, &clock, "failed", "link");
    assert!(
        reason.contains("xChannelWatchdog returned CIFX_DEV_WATCHDOG_FAILED"),
        "{reason}"
    );
    end.driver.close();
    let calls = cards.library.calls();
    let first = calls
        .iter()
        .position(|call| *call == watchdog(1))
        .expect("it was started");
    assert_eq!(calls[first - 1], OPENING[5]);
    let last = calls
        .iter()
        .rposition(|call| *call == watchdog(0))
        .expect("it was stopped");
    assert_eq!(calls[last + 1..], CLOSING);
}

#[test]
fn inputs_that_never_arrive_are_stale_although_the_card_takes_outputs() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut device = cards.open("device", &clock);
    let _controller = cards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    // The other end continues reading, so that this one can write.
    cards.library.script("xChannelIORead(0 0x800C0022\n");
    // Time waits for the bus threads here: late threads do not make the line stale.
    for _ in 0..400 {
        pass(&clock, 2);
        device.tick();
    }
    assert_eq!(device.link().cause, Cause::Silent);
    cards.library.script("");
    until(&mut device, &clock, "running", "running");
}

/// The same cards, by another path to the same library.
struct Detour<'a>(&'a Cards);

impl Bus for Detour<'_> {
    fn kinds(&self) -> &'static Kinds {
        &KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let path = self.0.library.file("");
        let folder = path.parent().and_then(Path::file_name).expect("a folder");
        let folder = folder.to_str().expect("a name");
        let there = format!("{folder}/../{folder}/");
        self.0.fieldbus(role).replace(&format!("{folder}/"), &there)
    }

    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        unreachable!("it is no bus of the suite")
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        Vec::new()
    }
}

#[test]
fn one_library_by_two_paths_is_started_once() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut device = cards.open("device", &clock);
    let mut controller = standin::open(&Detour(&cards), "controller", "", &clock);
    until(&mut device, &clock, "running", "running");
    until(&mut controller, &clock, "running", "running");
    let calls = cards.library.calls();
    let starts = calls
        .iter()
        .filter(|call| call.starts_with("cifXDriverInit"));
    assert_eq!(starts.count(), 1);
}

#[test]
fn signals_that_reach_beyond_the_card_s_image_are_refused() {
    for (extra, function) in [
        ("write_offset = 507", "xChannelIOWrite"),
        ("read_offset = 507", "xChannelIORead"),
    ] {
        let (cards, clock) = (Cards::with(&[], extra), Manual::new());
        let mut end = cards.open("device", &clock);
        let reason = until(&mut end, &clock, "failed", "refused");
        let right = format!(
            "refused: {function} returned CIFX_INVALID_ACCESS_SIZE (0x800A0008): the signals reach"
        );
        assert!(reason.starts_with(&right), "{reason}");
    }
}

#[test]
fn two_drivers_of_a_process_start_the_library_once_and_the_last_one_ends_it() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut device = cards.open("device", &clock);
    let mut controller = cards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    until(&mut controller, &clock, "running", "running");
    let count = |function: &str| {
        let calls = cards.library.calls();
        calls
            .iter()
            .filter(|call| call.starts_with(function))
            .count()
    };
    assert_eq!((count("cifXDriverInit"), count("xDriverOpen")), (1, 2));
    device.driver.close();
    assert_eq!((count("cifXDriverDeinit"), count("xDriverClose")), (0, 1));
    controller.driver.close();
    assert_eq!((count("cifXDriverDeinit"), count("xDriverClose")), (1, 2));
}

#[test]
fn a_library_that_is_missing_or_lacks_a_function_is_told_with_what_to_do() {
    let cards = Cards::with(&["-DWITHOUT_START"], "");
    let clock = Manual::new();
    let mut end = cards.open("device", &clock);
    let reason = until(&mut end, &clock, "failed", "link");
    assert!(
        reason.contains("it does not export cifXDriverInit; name the vendor's own library"),
        "{reason}"
    );
    let text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"hilscher-cifx\"\nlibrary = \"libnobodyhas.so.3\"\n{SIGNALS}"
    );
    let mut end = End::open(&text, &clock, &KINDS);
    let reason = until(&mut end, &clock, "failed", "link");
    assert!(
        reason.contains("the library libnobodyhas.so.3: it cannot be loaded: "),
        "{reason}"
    );
    assert!(reason.contains("; install the vendor's driver"), "{reason}");
}

#[test]
fn only_what_the_driver_cfg_can_change_is_refused() {
    let failing = |verdict| Failing {
        verdict,
        text: "x".to_owned(),
    };
    let refused = BusError::Refused("x".to_owned());
    assert_eq!(failing(Verdict::Refused).error(), refused);
    for verdict in [Verdict::NoPeer, Verdict::Again, Verdict::Broken] {
        assert_eq!(failing(verdict).error(), BusError::Link("x".to_owned()));
    }
}
