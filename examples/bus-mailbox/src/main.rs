//! The `tickbus` command with one more bus: a model for a custom program.

use std::process::ExitCode;

use tickbus_bus_mailbox as mailbox;
use tickbus_driver_cfg::{Kind, Kinds};

static KINDS: Kinds = tickbus::KINDS.and(&[Kind::of::<mailbox::Options>()]);

fn main() -> ExitCode {
    tickbus::cli::main(&KINDS)
}
