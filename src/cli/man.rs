//! `tickbus man DIR`: the manual pages.

use std::path::PathBuf;

use clap::CommandFactory as _;

use super::Outcome;

/// Write the manual pages to DIR: one for the command, and one for each subcommand.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The folder, such as /usr/local/share/man/man1; it is made if it does not exist.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let folder = &arguments.folder;
    let written = std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(super::Arguments::command(), folder));
    match written {
        Ok(()) => Outcome::Done,
        Err(error) => {
            eprintln!(
                "man: failed: the pages cannot be written to {}: {error}; name another folder",
                folder.display()
            );
            Outcome::WrongInput
        }
    }
}
