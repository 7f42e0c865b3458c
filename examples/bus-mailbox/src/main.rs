//! The `tickbus` command with a further bus: what a program of your own needs to have one.

use std::process::ExitCode;

use tickbus_bus_mailbox as mailbox;
use tickbus_driver_cfg::{Kind, Kinds};

static KINDS: Kinds = tickbus::KINDS.and(&[Kind::of::<mailbox::Options>()]);

fn main() -> ExitCode {
    tickbus::cli::main(&KINDS)
}
