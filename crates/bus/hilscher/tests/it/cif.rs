//! The bus `hilscher-cif` against a library that stands in for the vendor's.
#![cfg(target_os = "linux")]

use std::sync::Arc;

use tickbus_base::time::Manual;
use tickbus_bus_hilscher::cif::{ERRORS, meaning};
use tickbus_conformance::conformance;
use tickbus_conformance::rig::{Bus, CYCLE, End, Liar, SIGNALS, await_that};
use tickbus_conformance::standin::{self, StandIn, until, until_it_hangs};
use tickbus_driver::Code;
use tickbus_driver_cfg::{Kind, Kinds};
use tickbus_fieldbus::Verdict;

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_hilscher::cif::Options>()]);

/// Two cards with connected process images.
struct Cards {
    library: Arc<StandIn>,
    extra: &'static str,
}

impl Cards {
    fn new() -> Self {
        Self::with("")
    }

    fn with(extra: &'static str) -> Self {
        let library = StandIn::build("standin_cif.c", &[], "CIF32DLL.DLL");
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
        let library = self.library.library();
        let device = u8::from(role != "device");
        format!("kind = \"hilscher-cif\"\nlibrary = \"{library}\"\ndevice = {device}")
    }

    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        let words = "DevExchangeIO returned -77, a code that tickbus does not know; see the vendor's manual";
        standin::liar(&self.library, "DevExchangeIO -77\n", words)
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"hilscher-cif\"\ndevice = 4", "from 0 to 3"),
            (
                "kind = \"hilscher-cif\"\nreset = \"boot\"",
                "kinds of reset",
            ),
            (
                "kind = \"hilscher-cif\"\ncard_watchdog = 1",
                "write true or false",
            ),
            (
                "kind = \"hilscher-cif\"\nlibrary = \"./libnone.so\"",
                "libnone.so; check `library`",
            ),
        ]
    }
}

conformance!(suite, crate::cif::Cards::new());

const OPENING: [&str; 7] = [
    "DevOpenDriver(0)",
    "DevInitBoard(0, NULL)",
    "DevGetInfo(0, 3, 32)",
    "DevGetInfo(0, 6, 6)",
    "DevReset(0, 3, 5000)",
    "DevSetHostState(0, 1, 200)",
    "DevTriggerWatchDog(0, 1)",
];
const MOVING: &str = "DevExchangeIO(0, 0, 6, 0, 6, 100)";
const CLOSING: [&str; 4] = [
    "DevTriggerWatchDog(0, 0)",
    "DevSetHostState(0, 0, 200)",
    "DevExitBoard(0)",
    "DevCloseDriver(0)",
];

/// The number of closing calls that follow when the call of this index fails.
const UNDONE: [usize; 8] = [0, 1, 2, 2, 2, 3, 4, 4];

/// All calls of an opening with the card's watchdog, and one exchange.
fn all() -> Vec<&'static str> {
    OPENING.into_iter().chain([MOVING]).collect()
}

fn function(call: &str) -> &str {
    call.split('(').next().expect("a name")
}

#[test]
fn calls_are_made_in_the_order_of_the_vendor_and_undone_in_the_reverse() {
    let (cards, clock) = (Cards::with("card_watchdog = true"), Manual::new());
    let mut end = cards.open("device", &clock);
    await_that("data are moved", || {
        clock.advance(CYCLE);
        cards.library.calls().len() > 12
    });
    assert_eq!(end.tick().code, Code::Stale);
    let card = end.statistic("card");
    assert_eq!(card, "device 0, firmware DPS V01.150 01.01.01");
    end.driver.close();
    let calls = cards.library.calls();
    assert_eq!(calls[..7], OPENING);
    let between = &calls[7..calls.len() - 4];
    assert!(
        between
            .iter()
            .all(|call| call == MOVING || call == OPENING[6])
    );
    assert_eq!(calls[calls.len() - 4..], CLOSING);
}

#[test]
fn a_call_that_fails_is_named_and_all_before_it_is_undone() {
    for (index, call) in all().iter().enumerate() {
        // Information that is only for people may fail.
        if index == 2 || index == 3 {
            continue;
        }
        let (cards, clock) = (Cards::with("card_watchdog = true"), Manual::new());
        let name = function(call);
        cards.library.script(&format!("{name} -25\n"));
        let mut end = cards.open("device", &clock);
        let reason = until(&mut end, &clock, "failed", "link");
        let right = format!(
            "the link failed: {name} returned DRV_DEV_FUNCTION_FAILED (-25): the driver gives no reason"
        );
        assert!(reason.starts_with(&right), "{reason}");
        let mut expected: Vec<&str> = all().into_iter().take(index + 1).collect();
        expected.extend(&CLOSING[4 - UNDONE[index]..]);
        let mut calls = cards.library.calls();
        // A repeated call is recorded once: the watchdog is triggered when it starts, and in each cycle.
        calls.dedup();
        assert_eq!(calls, expected, "{name}");
    }
}

#[test]
fn each_error_code_at_each_call_is_told_with_its_name_and_what_to_do() {
    let cards = Cards::new();
    let codes = ERRORS.iter().map(|row| row.code.cast_signed());
    for code in codes.chain([-80, -83, -100, -105, -110, -128, 1000, 1017, 1255]) {
        for (index, call) in all().iter().enumerate() {
            // The watchdog is off, and information is only for people.
            if [2, 3, 6].contains(&index) {
                continue;
            }
            let row = meaning(code).expect("a known code");
            let function = function(call);
            cards.library.script(&format!("{function} {code}\n"));
            let clock = Manual::new();
            let mut end = cards.open("device", &clock);
            let text = format!(
                "{function} returned {} ({code}): {}; next",
                row.name, row.words
            );
            match row.verdict {
                Verdict::NoPeer if index >= 4 => await_that("it is told", || {
                    clock.advance(CYCLE);
                    end.link().reason == format!("the bus is open; {}", row.words)
                }),
                Verdict::Again if index == 7 => await_that("it is counted", || {
                    clock.advance(CYCLE);
                    end.driver.statistics().contains("\nhilscher-cif.again=")
                }),
                // The stand-in continues in spite of this code.
                Verdict::NoPeer => {}
                Verdict::Refused => {
                    let reason = until(&mut end, &clock, "failed", "refused");
                    assert!(reason.starts_with(&format!("refused: {text}")), "{reason}");
                }
                _ => {
                    let reason = until(&mut end, &clock, "failed", "link");
                    assert!(
                        reason.starts_with(&format!("the link failed: {text}")),
                        "{reason}"
                    );
                }
            }
        }
    }
    for unknown in [-7, -41, -84, -129, 1, 999, 1256] {
        assert_eq!(meaning(unknown), None, "{unknown}");
    }
}

#[test]
fn without_its_bus_a_card_gets_the_data_all_the_same_and_none_of_its_own_count() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut device = cards.open("device", &clock);
    let words = meaning(-21).expect("NO_COM").words;
    device.set("position", 258.0);
    await_that("the value is in the card", || {
        clock.advance(CYCLE);
        assert_eq!(device.tick().code, Code::Stale);
        let image = std::fs::read(cards.library.file("image")).unwrap_or_default();
        image.len() == 512 && image[2..4] == [1, 2]
    });
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
}

#[test]
fn a_card_that_was_removed_is_opened_anew_when_it_is_back_and_one_that_hangs_goes_on() {
    let (cards, clock) = (Cards::new(), Manual::new());
    let mut device = cards.open("device", &clock);
    let _controller = cards.open("controller", &clock);
    until(&mut device, &clock, "running", "running");
    cards.library.script("DevExchangeIO -10\nDevInitBoard -1\n");
    let reason = until(&mut device, &clock, "failed", "link");
    assert!(
        reason.contains("DevExchangeIO returned DRV_DEV_DPM_ACCESS_ERROR (-10)"),
        "{reason}"
    );
    await_that("it is tried again", || {
        clock.advance(CYCLE);
        device
            .link()
            .reason
            .contains("DevInitBoard returned DRV_BOARD_NOT_INITIALIZED (-1)")
    });
    cards.library.script("DevReset hang\n");
    until_it_hangs(&device, &clock, "opening by CIF32DLL.DLL");
    cards.library.script("");
    until(&mut device, &clock, "running", "running");
}

#[test]
fn signals_that_reach_beyond_the_card_s_image_are_refused() {
    for (extra, words) in [
        (
            "write_offset = 507",
            "this end writes up to byte 513, and the card has 512 bytes",
        ),
        (
            "read_offset = 600",
            "this end reads up to byte 606, and the card has 512 bytes",
        ),
    ] {
        let (cards, clock) = (Cards::with(extra), Manual::new());
        let mut end = cards.open("device", &clock);
        let reason = until(&mut end, &clock, "failed", "refused");
        assert!(reason.contains(words), "{reason}");
        assert_eq!(cards.library.calls()[4..], CLOSING[2..]);
    }
}

#[test]
fn a_system_without_the_driver_is_told_so() {
    let text =
        format!("[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"hilscher-cif\"\n{SIGNALS}");
    let config =
        tickbus_driver_cfg::Config::parse("driver.cfg", &text, &KINDS).expect("a right file");
    let refused = tickbus_driver::Driver::open(config, Manual::new()).expect_err("refused");
    assert!(
        refused.to_string().contains("is for Windows alone"),
        "{refused}"
    );
}
