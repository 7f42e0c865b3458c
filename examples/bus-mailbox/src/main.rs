//! The `tickbus` command with one more bus, as a program of your own would have it.

use std::process::ExitCode;

use tickbus_bus_mailbox as mailbox;
use tickbus_driver_cfg::{Kind, Kinds};

static KINDS: Kinds = tickbus::KINDS.and(&[Kind::of::<mailbox::Options>()]);

fn main() -> ExitCode {
    tickbus::cli::main(&KINDS)
}
