//! What goes wrong between a controller and a machine at the two ends of a pseudo-terminal, and what must not come of it.
#![cfg(unix)]
#![allow(
    missing_docs,
    clippy::float_cmp,
    clippy::format_push_string,
    reason = "tests; the values are small whole numbers"
)]

mod ends;

use std::io::{Read as _, Write as _};

use tickbus_base::os::LinkedTerminal;
use tickbus_base::time::{Clock as _, Manual, Monotonic, Nanos};
use tickbus_bus_identification::Access;
use tickbus_conformance::rig::{await_that, statistic};
use tickbus_fieldbus::LinkState;

use ends::{Line, Pair, command};

const READ: Access<'_> = Access::Read {
    address: 0,
    length: 1,
};

#[test]
fn the_machine_sees_what_a_repeated_command_does_though_the_client_only_listens() {
    let line = Line::new();
    let mut machine = line.reader(&[1]);
    machine.set("present", 1.0);
    let mut port = line.open_port(&mut machine);
    let write = Access::Write {
        address: 0,
        data: b"x",
    };
    port.write_all(&command(true, write)).expect("room");
    await_that("the repetitions are counted", || {
        machine.tick();
        machine.get("writes") >= 3.0
    });
    assert_eq!(machine.link().state, LinkState::Running);
}
