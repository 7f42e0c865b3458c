//! `tickbus mirror FILE`: a machine without a simulator, for commissioning.

use std::path::PathBuf;

use super::Outcome;
use super::host::{self, Job, span};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds};
use tickbus_fieldbus::Role;
use tickbus_programs::{Idle, Mirror};

/// Simulate a machine that copies each %Q byte to the %I byte at the same offset, or that replies as FILE says.
///
/// When the PLC is gone, %Q signals with a `fail_safe` take that value. The others stay as they are, and the page marks them as stale.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the device.
    file: PathBuf,

    /// The interval at which the bytes are copied.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = span)]
    tick: Nanos,

    /// Make the `[[reply]]` signals of FILE instead of copying bytes.
    #[arg(long)]
    replies: bool,

    #[command(flatten)]
    host: host::Hosting,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    if arguments.replies {
        let asked = CommandLineEnd {
            role: Role::Device,
            moved: true,
        };
        // The host reads the file again, and reports its mistakes.
        let config = Config::load_as(&arguments.file, Some(asked), kinds);
        if config.is_ok_and(|config| config.replies.is_empty()) {
            let file = arguments.file.display();
            let reason =
                format!("mirror: {file} has no [[reply]]; write some, or leave --replies out");
            return (arguments.host.format).fail("mirror", &reason, Outcome::WrongInput);
        }
    }
    let job = Job {
        title: "mirror",
        file: &arguments.file,
        kinds,
        role: Role::Device,
        program: if arguments.replies {
            Box::new(Idle)
        } else {
            Box::new(Mirror)
        },
        has_replies: arguments.replies,
        bus: None,
        interval: arguments.tick,
        keeps_lists: true,
    };
    host::run(job, &arguments.host)
}
