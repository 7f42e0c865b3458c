//! `tickbus completions SHELL`: the script with which a shell completes the command.

use clap::{Command, CommandFactory as _};
use clap_complete::Shell;

use super::{Outcome, print};

/// Print the script with which a shell completes this command.
///
/// docs/command.md describes where each shell looks for it.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The shell.
    shell: Shell,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let mut script = Vec::new();
    let all = super::Arguments::command();
    // The scripts would have the subcommands that are not for people, too.
    let for_people = all
        .get_subcommands()
        .filter(|command| !command.is_hide_set());
    let mut command = Command::new("tickbus")
        .version(env!("CARGO_PKG_VERSION"))
        .subcommands(for_people.cloned());
    clap_complete::generate(arguments.shell, &mut command, "tickbus", &mut script);
    print("completions", &String::from_utf8_lossy(&script))
}
