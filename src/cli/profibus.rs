//! `tickbus profibus`: shows the traffic on a PROFIBUS line, and the times that its project should have.

// Measures on a pseudo-terminal.
#[cfg(unix)]
mod advise;
mod monitor;

use clap::Subcommand;

use super::Outcome;
use tickbus_driver_cfg::Kinds;

/// Inspect a PROFIBUS line.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Monitor(monitor::Arguments),
    #[cfg(unix)]
    Advise(advise::Arguments),
}

#[cfg_attr(not(unix), expect(unused_variables, reason = "for advise alone"))]
pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    match &arguments.command {
        Command::Monitor(arguments) => monitor::run(arguments),
        #[cfg(unix)]
        Command::Advise(arguments) => advise::run(arguments, kinds),
    }
}
