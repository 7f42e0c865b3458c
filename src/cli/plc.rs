//! `tickbus plc PROGRAM --config FILE`: runs a PLC program in a separate process.

use std::path::{Path, PathBuf};

use super::Outcome;
use super::host::{self, Job, span};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Kinds;
use tickbus_fieldbus::Role;
use tickbus_plc as plc;

/// Run a PLC program as the controller of a bus.
///
/// The programs are "rig" (the test rig), "mirror" (each %I byte comes back on the %Q byte of the same
/// offset) and "reaction" (measures how long the machine takes to answer; its options are output, input,
/// count, timeout, pause and tick), "charger" and "lathe" (the peeling line of plc/peeler; their options are hold and
/// blocks, and of the lathe `peeling_speed` and thickness). A path such as ./program.so hosts a program of your own, compiled by
/// iec2c (its options are addressing, alive and order); docs/own-plc-program.md tells how to build one.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The name of a built-in program, or the path of your own.
    #[arg(value_name = "PROGRAM")]
    program: String,

    /// The driver.cfg of the line; without a role, the same file serves both ends.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,

    /// Scan interval [default: 10ms; 100us for "reaction"; your own program's is compiled in].
    #[arg(long, value_name = "TIME", value_parser = span)]
    scan: Option<Nanos>,

    /// An option of the program; may be given several times.
    #[arg(long = "option", value_name = "KEY=VALUE", value_parser = pair)]
    options: Vec<(String, String)>,

    #[command(flatten)]
    host: host::Hosting,
}

fn pair(text: &str) -> Result<(String, String), String> {
    let pair = text.split_once('=').filter(|(key, _)| !key.is_empty());
    let (key, value) = pair.ok_or("write KEY=VALUE, such as la1_code=lsb-first")?;
    Ok((key.to_owned(), value.to_owned()))
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let program = match kinds
        .programs()
        .make(Path::new(""), &arguments.program, &arguments.options)
    {
        Ok(program) => program,
        Err(error) => {
            // A wrong name is a mistake on the command line; a wrong file is wrong input.
            let outcome = if plc::HostedProgram::is_path(&arguments.program) {
                Outcome::WrongInput
            } else {
                Outcome::Usage
            };
            return arguments
                .host
                .format
                .fail("plc", &format!("plc: {error}"), outcome);
        }
    };
    let interval = plc::interval(&*program, arguments.scan);
    let job = Job {
        title: "plc",
        file: &arguments.config,
        kinds,
        role: Role::Controller,
        program,
        has_replies: false,
        bus: None,
        interval,
        keeps_lists: true,
    };
    host::run(job, &arguments.host)
}
