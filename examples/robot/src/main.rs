//! The robot's experiment as a command: the demo, and plant and PLC as processes of their own.

mod demo;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

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
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Demo { page, runs } => demo::run(&page, runs),
    };
    match outcome {
        Ok(line) => {
            println!("{line}");
            ExitCode::SUCCESS
        }
        Err(reason) => {
            println!("robot: failed reason={reason}");
            ExitCode::FAILURE
        }
    }
}
