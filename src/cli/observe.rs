//! `tickbus observe FILE`: looks at a PLC that runs, and writes nothing.

use std::path::PathBuf;

use super::Outcome;
use super::host::{self, Job, span};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Kinds;
use tickbus_fieldbus::Role;
use tickbus_plc::{Program, Scan};

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
        program: Box::new(Onlooker),
        interval: arguments.tick,
    };
    host::run(job, &arguments.host)
}

/// The program at an end that only looks: it has inputs alone, and does nothing with them.
#[derive(Clone, Copy, Debug)]
struct Onlooker;

impl Program for Onlooker {
    fn name(&self) -> &'static str {
        "observer"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn for_another_station(&self, _station: usize) -> Option<Box<dyn Program>> {
        Some(Box::new(*self))
    }

    fn can_hang(&self) -> bool {
        false
    }

    fn scan(&mut self, _scan: &mut Scan<'_>) {}
}
