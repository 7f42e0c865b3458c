//! `tickbus bridge`: clients of the dispatcher that do not connect with it themselves.

mod mqtt;
#[cfg(unix)]
mod serial;

use std::io::{self, Write as _};

use clap::Subcommand;

use super::Outcome;
use tickbus_base::time::Stop;

/// Let others take part in a virtual laboratory: a program at a serial line, or the topics of an MQTT broker.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Mqtt(mqtt::Arguments),
    #[cfg(unix)]
    Serial(serial::Arguments),
}

/// Prints a line. If the reader of stdout is gone, the bridge goes on.
fn say(line: &str) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "bridge: {line}").and_then(|()| out.flush());
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let stop = Stop::new();
    let caught = ctrlc::set_handler({
        let stop = stop.clone();
        move || stop.stop()
    });
    if let Err(error) = caught {
        say(&format!(
            "failed reason=\"Ctrl-C cannot be caught: {error}\""
        ));
        return Outcome::BusFailed;
    }
    match &arguments.command {
        Command::Mqtt(arguments) => mqtt::run(arguments, &stop),
        #[cfg(unix)]
        Command::Serial(arguments) => serial::run(arguments, &stop),
    }
}
