//! `tickbus logo`: a small controller that takes part in a virtual laboratory.

mod host;
mod patch;

use std::path::PathBuf;

use super::Outcome;
use super::host::span;
use super::lab::{self, dialled, key};
use tickbus_base::time::{Clock as _, Monotonic, Nanos};
use tickbus_base::toml_text::Mistakes;
use tickbus_dispatcher::client::{Client, Profile};
use tickbus_dispatcher::{Channel, Counts, Key, PORT, Role};
use tickbus_function_blocks::{Controller, Program, Terminals};
use tickbus_net::Address;

/// The time without news after which the client checks that the dispatcher is alive.
const KEEP_ALIVE: Nanos = Nanos::from_secs(5);

/// Run a small controller, like a LOGO!, in a virtual laboratory: a program of function blocks.
///
/// It is a client of `tickbus dispatch`. docs/virtual-lab.md has a lesson, and all blocks.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The program.
    file: PathBuf,

    /// The address of the dispatcher.
    #[arg(long, value_name = "HOST:PORT", default_value_t = Address::local(PORT), value_parser = dialled)]
    dispatcher: Address,

    /// The file with the key of the laboratory, if it has one.
    #[arg(long, value_name = "FILE", value_parser = key)]
    key_file: Option<Key>,

    /// The name of this controller in the laboratory.
    #[arg(long)]
    name: String,

    /// A file with CONNECT lines, which are sent each time the dispatcher accepts this controller.
    #[arg(long, value_name = "FILE")]
    patch: Option<PathBuf>,

    /// The number of inputs, from I1.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(0..=256))]
    inputs: u16,

    /// The number of outputs, from Q1.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(0..=256))]
    outputs: u16,

    /// The number of analog inputs, from AI1.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(0..=256))]
    analog_inputs: u16,

    /// The number of analog outputs, from AQ1.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(0..=256))]
    analog_outputs: u16,

    /// The scan interval.
    #[arg(long, value_name = "TIME", default_value = "10ms", value_parser = span)]
    cycle: Nanos,

    /// Stop after this time [default: at Ctrl-C].
    #[arg(long, value_name = "TIME", value_parser = span)]
    duration: Option<Nanos>,
}

fn say(line: &str) {
    lab::say("logo", line);
}

/// Reads the program and the connections.
fn read(arguments: &Arguments) -> Result<(Program, Client), Mistakes> {
    let terminals = Terminals {
        inputs: arguments.inputs.into(),
        outputs: arguments.outputs.into(),
        analog_inputs: arguments.analog_inputs.into(),
        analog_outputs: arguments.analog_outputs.into(),
    };
    let program = Program::load(&arguments.file, terminals)?;
    let counts = Counts::new(
        arguments.outputs,
        arguments.inputs,
        arguments.analog_outputs,
        arguments.analog_inputs,
    );
    let cables = match &arguments.patch {
        Some(file) => patch::load(file, counts)?,
        None => Vec::new(),
    };
    let profile = Profile {
        role: Role::Controller,
        name: arguments.name.clone(),
        counts,
        cables,
        alive: None,
        key: arguments.key_file.clone(),
    };
    let client = Client::new(profile, KEEP_ALIVE);
    let client = client.map_err(|mistake| Mistakes::of("--name", mistake))?;
    let names = program.names.iter();
    let names =
        names.filter_map(|(output, name)| Some((Channel::parse(output.as_bytes())?, &**name)));
    let client = client.with_labels(names);
    Ok((program, client))
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let (program, client) = match read(arguments) {
        Ok(read) => read,
        Err(mistakes) => {
            eprintln!("{mistakes}\nlogo: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    let stop = match lab::until_ctrl_c("logo") {
        Ok(stop) => stop,
        Err(outcome) => return outcome,
    };
    let clock = Monotonic::shared();
    let end = arguments
        .duration
        .map_or(Nanos::MAX, |span| clock.now() + span);
    let hosting = host::Hosting {
        address: &arguments.dispatcher,
        cycle: arguments.cycle,
        end,
        clock: &*clock,
        stop: &stop,
    };
    match host::run(Controller::new(program), client, &hosting) {
        Ok(counts) => {
            say(&format!(
                "ok scans={} joined={}",
                counts.scans, counts.joined
            ));
            Outcome::Done
        }
        Err(error) => {
            say(&format!(
                "failed reason=\"the system cannot wait for sockets: {error}\""
            ));
            Outcome::BusFailed
        }
    }
}
