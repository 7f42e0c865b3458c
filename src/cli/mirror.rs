//! `tickbus mirror FILE`: a machine without a simulator, for commissioning.

use std::path::PathBuf;

use super::Outcome;
use super::host::{self, Job, span};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Kinds;
use tickbus_fieldbus::Role;
use tickbus_programs::Mirror;

/// Simulate a machine that copies each %Q byte to the %I byte at the same offset.
///
/// When the PLC is gone, %Q signals with a `fail_safe` take that value. The others stay as they are, and the page marks them as stale.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the device.
    file: PathBuf,

    /// The interval at which the bytes are copied.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = span)]
    tick: Nanos,

    #[command(flatten)]
    host: host::Hosting,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let job = Job {
        title: "mirror",
        file: &arguments.file,
        kinds,
        role: Role::Device,
        program: Box::new(Mirror),
        interval: arguments.tick,
    };
    host::run(job, &arguments.host)
}
