//! `tickbus bridge`: connects programs and brokers that cannot connect to the dispatcher themselves.

mod mqtt;
#[cfg(unix)]
mod serial;

use clap::Subcommand;

use super::Outcome;
use super::lab;

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

fn say(line: &str) {
    lab::say("bridge", line);
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let stop = match lab::until_ctrl_c("bridge") {
        Ok(stop) => stop,
        Err(outcome) => return outcome,
    };
    match &arguments.command {
        Command::Mqtt(arguments) => mqtt::run(arguments, &stop),
        #[cfg(unix)]
        Command::Serial(arguments) => serial::run(arguments, &stop),
    }
}
