//! The `tickbus` command.
//!
//! One file for each subcommand: its arguments, and `run`, which answers with an `Outcome`.

mod check;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Puts a simulated machine on a real PLC's fieldbus.
#[derive(Debug, Parser)]
#[command(name = "tickbus", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Check(check::Arguments),
}

/// How a command ended, as its exit code tells. Code 2 is wrong usage, which clap reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// 0: done.
    Done,
    /// 1: the input was wrong.
    WrongInput,
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        Self::from(match outcome {
            Outcome::Done => 0,
            Outcome::WrongInput => 1,
        })
    }
}

/// Runs the command with the arguments of the process.
pub fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Check(arguments) => check::run(&arguments),
    }
    .into()
}
