//! `tickbus bridge`: clients of the dispatcher that do not connect over TCP themselves.

#[cfg(unix)]
mod serial;

use clap::Subcommand;

use super::Outcome;

/// Let others take part in a virtual laboratory: a client at a serial line.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[cfg(unix)]
    Serial(serial::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    match &arguments.command {
        #[cfg(unix)]
        Command::Serial(arguments) => serial::run(arguments),
    }
}
