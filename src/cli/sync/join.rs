//! `tickbus sync join`: a federation of another engine as a client of a run.

use std::path::PathBuf;

use super::gateway::address;
use super::{report, say, stop_on_ctrl_c};
use crate::cli::Outcome;
use crate::cli::host::span;
use tickbus_base::time::{Monotonic, Nanos};
use tickbus_federation::{
    self as federation, EngineLibrary, Helics, Mapping, Opened, Options, SilKit,
};
use tickbus_virtual_time::{self as virtual_time, Ended, Meeting};

/// Let a federation of another engine take part in a run.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    engine: Engine,
}

#[derive(Debug, clap::Subcommand)]
enum Engine {
    /// Let a HELICS federation take part in a run, as one federate and one client.
    ///
    /// FILE maps variables of the run to publications of the federation; docs/federations.md describes it. The library
    /// of HELICS 3 is loaded: the one of the Python package (pip install helics), or of the system.
    Helics(Member),
    /// Let a simulation of Vector SIL Kit take part in a run, as one participant and one client.
    ///
    /// FILE maps variables of the run to topics of the simulation; docs/federations.md describes it. The library of a
    /// release of SIL Kit 5 is loaded.
    #[command(name = "silkit")]
    SilKit(Member),
}

#[derive(Debug, clap::Args)]
struct Member {
    /// The file with the table "helics" or "silkit".
    file: PathBuf,

    /// Where the server of the run listens.
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    server: Meeting,

    /// How long broker or registry and the server may take to appear, and the federation to come to a time.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = span)]
    timeout: Nanos,

    /// The engine's library [default: $HELICS_LIBRARY or $SILKIT_LIBRARY, that of HELICS's Python package, or the
    /// system's].
    #[expect(clippy::doc_markdown, reason = "the help is plain text")]
    #[arg(long, value_name = "PATH")]
    library: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    match &arguments.engine {
        Engine::Helics(member) => join("HELICS", member, Helics::take_part),
        Engine::SilKit(member) => join("SIL Kit", member, SilKit::take_part),
    }
}

/// Opens an engine with its mapping, and lets it take part.
fn join<E: federation::Engine, L: EngineLibrary>(
    engine: &str,
    member: &Member,
    take_part: impl FnOnce(
        &Opened<E, L>,
        &Meeting,
        &mut dyn FnMut(&str),
    ) -> Result<virtual_time::Outcome, Ended>,
) -> Outcome {
    let mapping = match Mapping::load(&member.file) {
        Ok(mapping) => mapping,
        Err(mistakes) => {
            eprintln!("{mistakes}\nsync: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    let Some(stop) = stop_on_ctrl_c() else {
        return Outcome::BusFailed;
    };
    let options = Options {
        library: member.library.clone(),
        timeout: member.timeout,
    };
    match Opened::open(mapping, options, Monotonic::shared(), &stop) {
        Ok(opened) => {
            say(&format!("{engine} {}", opened.version()));
            report(take_part(&opened, &member.server, &mut say))
        }
        Err(mistake) => {
            eprintln!("sync: {mistake}");
            Outcome::WrongInput
        }
    }
}
