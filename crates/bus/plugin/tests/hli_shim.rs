//! `examples/interbus-hli-shim`, compiled with a header that stands in for the vendor's.
#![cfg(target_os = "linux")]
#![allow(missing_docs, clippy::float_cmp, reason = "tests; small whole numbers")]

use std::process::Command;
use std::sync::Arc;

use tickbus_base::time::Manual;
use tickbus_conformance::rig::{CYCLE, End, SIGNALS, await_that};
use tickbus_conformance::standin::{StandIn, until};
use tickbus_driver_cfg::{Kind, Kinds};

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_plugin::Options>()]);

const SHIM: &str = "../../examples/interbus-hli-shim/shim.c";
const HEADER: &str = concat!(
    "-DHLI_CELL=\"",
    env!("CARGO_MANIFEST_DIR"),
    "/../../../tests/plugins/hli_cell.h\""
);

/// A driver with the shim, compiled with these switches.
fn open(switches: &[&str], clock: &Arc<Manual>) -> (StandIn, End) {
    let switches: Vec<&str> = [HEADER].iter().chain(switches).copied().collect();
    let shim = StandIn::build(SHIM, &switches, "libhlishim.so");
    let library = shim.library();
    let text = format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"plugin\"\nlibrary = \"{library}\"\n\
         role = \"controller\"\ncycle = \"1ms\"\n{SIGNALS}"
    );
    let end = End::open(&text, clock, &KINDS);
    (shim, end)
}

#[test]
fn bits_and_words_are_moved_both_ways() {
    let clock = Manual::new();
    let (_shim, mut end) = open(&[], &clock);
    end.set("run", 1.0);
    end.set("speed", 1234.0);
    await_that("they come back", || {
        clock.advance(CYCLE);
        end.tick();
        end.get("sensor") == 1.0 && end.get("position") == 1234.0
    });
}

#[test]
fn what_its_functions_return_is_told() {
    for (switch, words) in [
        (
            "-DINIT=17",
            "libhlishim.so: the bus did not start: its function returned 17; see",
        ),
        (
            "-DCYCLE=18",
            "libhlishim.so: the cycle failed: its function returned 18; see",
        ),
    ] {
        let clock = Manual::new();
        let (_shim, mut end) = open(&[switch], &clock);
        let reason = until(&mut end, &clock, "failed", "link");
        assert!(reason.contains(words), "{reason}");
    }
    let clock = Manual::new();
    let (_shim, mut end) = open(&["-DWORD=6"], &clock);
    let reason = until(&mut end, &clock, "failed", "refused");
    assert!(
        reason.contains("cell.h has bytes to receive, up to byte 8; add"),
        "{reason}"
    );
    let (_shim, end) = open(&["-DRUNS=0"], &clock);
    await_that("it waits for its bus", || {
        clock.advance(CYCLE);
        end.link().reason == "the bus is open; waiting for the peer"
    });
}

#[test]
fn without_the_header_it_says_what_it_needs() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../examples/interbus-hli-shim/shim.c"
    );
    for (switch, words) in [
        (
            "-DNOTHING",
            "no header of the vendor's: write cell.h as the head of shim.c says",
        ),
        (
            "-DHLI_CELL=<stddef.h>",
            "cell.h has to define HLI_INIT, HLI_CYCLE, HLI_EXIT and HLI_RUNS",
        ),
    ] {
        let compiler = Command::new("cc")
            .args(["-fsyntax-only", switch, file])
            .output();
        let told = compiler.expect("a C compiler");
        assert!(!told.status.success());
        let told = String::from_utf8_lossy(&told.stderr);
        assert!(told.contains(words), "{told}");
    }
}
