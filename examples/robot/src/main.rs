//! The robot's experiment as a command: the demo, and plant and PLC as separate processes.

mod demo;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use tickbus_robot::lock_step;
use tickbus_robot::participants::{Machine, Program};
use tickbus_virtual_time::{Meeting, Participant};

#[derive(Debug, Parser)]
#[command(
    version,
    about = "A servo robot and its PLC, in lock-step and free-wheeling"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run all experiments, and write the page about them
    Demo {
        /// Where the page goes
        #[arg(long, value_name = "FILE", default_value = "robot.html")]
        page: PathBuf,
        /// How many runs each experiment has
        #[arg(long, value_name = "COUNT", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..=100))]
        runs: u32,
    },
    /// Take part in a run in virtual time as the plant
    Plant {
        #[command(flatten)]
        server: Server,
        /// Print the position of the tool after each step
        #[arg(long)]
        positions: bool,
    },
    /// Take part in a run in virtual time as the PLC
    Plc {
        #[command(flatten)]
        server: Server,
    },
}

/// Where the server is.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Server {
    /// The server's address
    #[arg(long, value_name = "HOST:PORT|unix:PATH")]
    server: Option<Meeting>,
    /// The name of the shared memory in which the server is
    #[arg(long, value_name = "NAME")]
    shared_memory: Option<String>,
}

/// Takes part in a run, and returns the figures of the last line.
fn join(server: Server, participant: &mut dyn Participant) -> Result<String, String> {
    let name = || server.shared_memory.map(Meeting::SharedMemory);
    let server = server
        .server
        .or_else(name)
        .expect("clap demands one of them");
    let outcome = lock_step::join(&server, participant).map_err(|ended| ended.to_string())?;
    Ok(format!("steps={} hash={}", outcome.steps, outcome.hash))
}

fn plant(server: Server, prints_positions: bool) -> Result<String, String> {
    let mut machine = Machine::default();
    let line = join(server, &mut machine)?;
    if prints_positions {
        for [x, z] in machine.into_run() {
            println!("{x} {z}");
        }
    }
    Ok(line)
}

fn main() -> ExitCode {
    let (name, outcome) = match Arguments::parse().command {
        Command::Demo { page, runs } => ("demo-robot", demo::run(&page, runs)),
        Command::Plant { server, positions } => ("robot", plant(server, positions)),
        Command::Plc { server } => ("robot", join(server, &mut Program::default())),
    };
    match outcome {
        Ok(figures) => {
            println!("{name}: ok {figures}");
            ExitCode::SUCCESS
        }
        Err(reason) => {
            println!("{name}: failed reason={reason}");
            ExitCode::FAILURE
        }
    }
}
