//! `tickbus axes FILE`: the axes of a machine without a simulator, for commissioning.

use std::path::PathBuf;

use super::Outcome;
use super::host::{self, Job, span};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds};
use tickbus_fieldbus::Role;
use tickbus_plc::Axes;

/// Simulate the machine: each axis in FILE is an ideal drive that follows its commands.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the device.
    file: PathBuf,

    /// The interval at which the drives are updated.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = span)]
    tick: Nanos,

    #[command(flatten)]
    host: host::Hosting,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let role = Role::Device;
    let asked = CommandLineEnd { role, moved: true };
    // The host reads the file again, and reports its mistakes.
    let config = Config::load_as(&arguments.file, Some(asked), kinds);
    let axes = config.map(|config| config.axes).unwrap_or_default();
    let job = Job {
        title: "axes",
        file: &arguments.file,
        kinds,
        role,
        program: Box::new(Axes::new(&axes)),
        has_replies: true,
        bus: None,
        interval: arguments.tick,
        keeps_lists: true,
    };
    host::run(job, &arguments.host)
}
