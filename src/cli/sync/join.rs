//! `tickbus sync join`: a federation of another engine as a client of a run.

use std::path::PathBuf;

use super::gateway::address;
use super::{report, say, stop_on_ctrl_c};
use crate::cli::Outcome;
use crate::cli::host::span;
use tickbus_base::Mistake;
use tickbus_base::time::{Monotonic, Nanos, Stop};
use tickbus_base::toml_text::Mistakes;
use tickbus_federation::{
    Helics, HelicsMapping, HelicsOptions, SilKit, SilKitMapping, SilKitOptions,
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
    Helics(HelicsArguments),
    #[command(name = "silkit")]
    SilKit(SilKitArguments),
}

/// Let a HELICS federation take part in a run, as one federate and one client.
///
/// FILE maps variables of the run to publications of the federation; docs/federations.md describes it. The library of
/// HELICS 3 is loaded: the one of the Python package (pip install helics), or of the system.
#[derive(Debug, clap::Args)]
struct HelicsArguments {
    /// The file with the table "helics".
    file: PathBuf,

    #[command(flatten)]
    run: Run,

    /// The library of HELICS [default: $HELICS_LIBRARY, the Python package's, or the system's].
    #[expect(clippy::doc_markdown, reason = "the help is plain text")]
    #[arg(long, value_name = "PATH")]
    library: Option<PathBuf>,
}

/// Let a simulation of Vector SIL Kit take part in a run, as one participant and one client.
///
/// FILE maps variables of the run to topics of the simulation; docs/federations.md describes it. The library of a
/// release of SIL Kit 5 is loaded.
#[derive(Debug, clap::Args)]
struct SilKitArguments {
    /// The file with the table "silkit".
    file: PathBuf,

    #[command(flatten)]
    run: Run,

    /// The library of SIL Kit [default: $SILKIT_LIBRARY, or the system's].
    #[expect(clippy::doc_markdown, reason = "the help is plain text")]
    #[arg(long, value_name = "PATH")]
    library: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
struct Run {
    /// Where the server of the run listens.
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    server: Meeting,

    /// How long broker or registry and the server may take to appear, and the federation to come to a time.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = span)]
    timeout: Nanos,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    match &arguments.engine {
        Engine::Helics(HelicsArguments { file, run, library }) => join(
            HelicsMapping::load(file),
            |mapping, stop| {
                let options = HelicsOptions {
                    library: library.clone(),
                    timeout: run.timeout,
                };
                Helics::open(mapping, options, Monotonic::shared(), stop)
            },
            |helics| {
                say(&format!("HELICS {}", helics.version()));
                helics.take_part(&run.server, &mut say)
            },
        ),
        Engine::SilKit(SilKitArguments { file, run, library }) => join(
            SilKitMapping::load(file),
            |mapping, stop| {
                let options = SilKitOptions {
                    library: library.clone(),
                    timeout: run.timeout,
                };
                SilKit::open(mapping, options, Monotonic::shared(), stop)
            },
            |silkit| {
                say(&format!("SIL Kit {}", silkit.version()));
                silkit.take_part(&run.server, &mut say)
            },
        ),
    }
}

/// Opens an engine with its mapping, and lets it take part.
fn join<M, E>(
    mapping: Result<M, Mistakes>,
    open: impl FnOnce(M, &Stop) -> Result<E, Mistake>,
    take_part: impl FnOnce(&E) -> Result<virtual_time::Outcome, Ended>,
) -> Outcome {
    let mapping = match mapping {
        Ok(mapping) => mapping,
        Err(mistakes) => {
            eprintln!("{mistakes}\nsync: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    let Some(stop) = stop_on_ctrl_c() else {
        return Outcome::BusFailed;
    };
    match open(mapping, &stop) {
        Ok(engine) => report(take_part(&engine)),
        Err(mistake) => {
            eprintln!("sync: {mistake}");
            Outcome::WrongInput
        }
    }
}
