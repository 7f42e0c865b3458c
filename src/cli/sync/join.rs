//! `tickbus sync join`: a federation of another engine as a client of a run.

use std::path::PathBuf;

use super::gateway::address;
use super::{report, say, stop_on_ctrl_c};
use crate::cli::Outcome;
use crate::cli::host::span;
use tickbus_base::time::{Monotonic, Nanos};
use tickbus_federation::{Helics, HelicsOptions, Mapping};
use tickbus_virtual_time::Meeting;

/// Let a federation of another engine take part in a run.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    engine: Engine,
}

#[derive(Debug, clap::Subcommand)]
enum Engine {
    Helics(HelicsArguments),
}

/// Let a HELICS federation take part in a run, as one federate and one client.
///
/// FILE maps variables of the run to publications of the federation; docs/federations.md describes it. The library of
/// HELICS 3 is loaded: the one of the Python package (pip install helics), or of the system.
#[derive(Debug, clap::Args)]
struct HelicsArguments {
    /// The file with the table "helics".
    file: PathBuf,

    /// Where the server of the run listens.
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    server: Meeting,

    /// The library of HELICS [default: $HELICS_LIBRARY, the Python package's, or the system's].
    #[expect(clippy::doc_markdown, reason = "the help is plain text")]
    #[arg(long, value_name = "PATH")]
    library: Option<PathBuf>,

    /// How long the broker and the server may take to appear, and the federation to grant a time.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = span)]
    timeout: Nanos,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let Engine::Helics(arguments) = &arguments.engine;
    let mapping = match Mapping::load(&arguments.file) {
        Ok(mapping) => mapping,
        Err(mistakes) => {
            eprintln!("{mistakes}\nsync: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    let Some(stop) = stop_on_ctrl_c() else {
        return Outcome::BusFailed;
    };
    let options = HelicsOptions {
        library: arguments.library.clone(),
        timeout: arguments.timeout,
    };
    let helics = match Helics::open(mapping, options, Monotonic::shared(), &stop) {
        Ok(helics) => helics,
        Err(mistake) => {
            eprintln!("sync: {mistake}");
            return Outcome::WrongInput;
        }
    };
    say(&format!("HELICS {}", helics.version()));
    report(helics.take_part(&arguments.server, &mut say))
}
