//! `tickbus bridge`: connects programs and brokers that cannot connect to the dispatcher themselves.

mod bus;
mod mqtt;
mod serial;

use clap::Subcommand;

use super::Outcome;
use super::lab;
use tickbus_driver_cfg::Kinds;

/// Connect a device at any bus, a serial line or an MQTT broker to a virtual laboratory.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Bus(bus::Arguments),
    Mqtt(mqtt::Arguments),
    Serial(serial::Arguments),
}

fn say(line: &str) {
    lab::say("bridge", line);
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let stop = match lab::until_ctrl_c("bridge") {
        Ok(stop) => stop,
        Err(outcome) => return outcome,
    };
    match &arguments.command {
        Command::Bus(arguments) => bus::run(arguments, kinds, &stop),
        Command::Mqtt(arguments) => mqtt::run(arguments, &stop),
        Command::Serial(arguments) => serial::run(arguments, &stop),
    }
}
