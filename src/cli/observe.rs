//! `tickbus observe FILE`: looks at a PLC that runs, and writes nothing.

use std::path::PathBuf;

use super::Outcome;
use super::host::{self, Job, span};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Kinds;
use tickbus_fieldbus::Role;
use tickbus_programs::Idle;

/// Watch and record the %I and %Q of a PLC that runs, without writing anything.
///
/// FILE has role = "observer", or no role. The record table of a file with that role is used; --record FILE takes its place. While the PLC is in STOP or gone, the values stay as they are, and recording and page mark them as stale.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the observer.
    file: PathBuf,

    /// The interval at which the values are taken, which is also that of the recording.
    #[arg(long, value_name = "TIME", default_value = "10ms", value_parser = span)]
    tick: Nanos,

    #[command(flatten)]
    host: host::Hosting,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let job = Job {
        has_replies: false,
        title: "observe",
        file: &arguments.file,
        kinds,
        role: Role::Observer,
        program: Box::new(Idle),
        bus: None,
        interval: arguments.tick,
        keeps_lists: true,
    };
    host::run(job, &arguments.host)
}
