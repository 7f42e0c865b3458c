//! `tickbus machine NAME`: training machines, which need no simulator.

mod folder;
mod shelf;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::host::{self, Job, span};
use super::json::print_document;
use super::{Outcome, print, test};
use folder::Unpacked;
use shelf::{BuiltIn, MACHINES};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::did_you_mean;
use tickbus_driver_cfg::Kinds;
use tickbus_fieldbus::Role;
use tickbus_programs::Idle;

/// Run a training machine, with its moving picture on the live page, for a PLC on any bus.
///
/// `tickbus machine list` lists the machines that are built in. A folder made by --to, or one of your own, is a machine as well; docs/machines.md describes what it has. --grade tests a PLC program by the exercises of the machine, without a bus.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// "list", the name of a machine, or the folder of one.
    #[arg(value_name = "NAME")]
    name: String,

    /// Use a bus of this kind, with its defaults, instead of the one in the machine's driver.cfg.
    #[arg(long, value_name = "KIND")]
    bus: Option<String>,

    /// The interval at which the machine moves.
    #[arg(long, value_name = "TIME", default_value = "5ms", value_parser = span)]
    tick: Nanos,

    /// Copy the machine to this folder, which is made, and end.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["bus", "grade"])]
    to: Option<PathBuf>,

    /// Test this PLC program by the exercises of the machine, and end: Structured Text (*.st), which iec2c and a C compiler
    /// build first, a shared object, or a built-in program.
    #[arg(long, value_name = "PROGRAM", conflicts_with = "bus")]
    grade: Option<String>,

    #[command(flatten)]
    host: host::Hosting,
}

/// The name that stands for all machines.
const LIST: &str = "list";

/// The file that makes a folder a machine.
const CONFIG: &str = "driver.cfg";

/// The folder with the exercises of a machine.
const EXERCISES: &str = "exercises";

/// The machine that the command line names.
enum Found {
    BuiltIn(&'static BuiltIn),
    Folder(PathBuf),
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    if arguments.name == LIST {
        return list(arguments.host.format.is_json());
    }
    match prepare_and_run(arguments, kinds) {
        Ok(outcome) => outcome,
        Err((reason, outcome)) => {
            let format = &arguments.host.format;
            format.fail("machine", &format!("machine: {reason}"), outcome)
        }
    }
}

fn prepare_and_run(
    arguments: &Arguments,
    kinds: &'static Kinds,
) -> Result<Outcome, (String, Outcome)> {
    let found = find(&arguments.name)?;
    if let Some(to) = &arguments.to {
        let Found::BuiltIn(machine) = found else {
            let reason =
                "--to copies a machine that is built in; copy a folder as you copy any other";
            return Err((reason.to_owned(), Outcome::Usage));
        };
        let failed = |error: String| (error, Outcome::WrongInput);
        machine.copy_to(to).map_err(failed)?;
        return Ok(print("machine", &copied(machine, to)));
    }
    let (folder, unpacked) = match found {
        Found::BuiltIn(machine) => {
            let failed = |error| (error, Outcome::BusFailed);
            let unpacked = Unpacked::new(machine).map_err(failed)?;
            (unpacked.path().to_owned(), Some(unpacked))
        }
        Found::Folder(folder) => (folder, None),
    };
    match &arguments.grade {
        Some(program) => {
            if let Some(unpacked) = &unpacked {
                unpacked.leave_when_interrupted();
            }
            grade(arguments, &folder, program, kinds)
        }
        None => Ok(host(arguments, (&folder, unpacked.is_some()), kinds)),
    }
}

/// The machine called `name`, or in the folder `name`.
fn find(name: &str) -> Result<Found, (String, Outcome)> {
    let folder = Path::new(name);
    if let Some(machine) = MACHINES.iter().find(|machine| machine.name == name) {
        if folder.join(CONFIG).is_file() {
            // Whoever closes standard error does not want the note.
            let _ = writeln!(
                std::io::stderr(),
                "note: this is the machine that is built in; the one in your folder is ./{name}"
            );
        }
        return Ok(Found::BuiltIn(machine));
    }
    if folder.is_dir() {
        if folder.join(CONFIG).is_file() {
            return Ok(Found::Folder(folder.to_owned()));
        }
        let reason = format!(
            "{name} has no {CONFIG}; name the folder of a machine, such as one made by tickbus machine {} --to FOLDER",
            MACHINES[0].name
        );
        return Err((reason, Outcome::WrongInput));
    }
    let names: Vec<&str> = MACHINES.iter().map(|machine| machine.name).collect();
    let right = did_you_mean(name, "machines", &names);
    let reason = format!("there is no machine and no folder \"{name}\"; {right}");
    Err((reason, Outcome::Usage))
}

fn list(as_json: bool) -> Outcome {
    if as_json {
        let machines = MACHINES.iter();
        let machines = machines
            .map(|machine| json!({ "name": machine.name, "title": machine.title() }))
            .collect::<Value>();
        return print_document("machine", json!({ "machines": machines }));
    }
    let mut text = String::new();
    let width = MACHINES.iter().map(|machine| machine.name.len()).max();
    let width = width.unwrap_or_default();
    for machine in MACHINES {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:width$}  {}", machine.name, machine.title());
    }
    print("machine", &text)
}

/// The advice after a machine was copied.
fn copied(machine: &BuiltIn, to: &Path) -> String {
    let shown = to.display();
    // The name of a machine that is built in, and "list", mean those.
    let mut names = MACHINES.iter().map(|machine| machine.name);
    let is_taken = to.to_str() == Some(LIST) || names.any(|name| to.to_str() == Some(name));
    let here = if is_taken { "./" } else { "" };
    format!(
        "machine: ok files={} folder={shown}\nRead {shown}/README.md; run it by: tickbus machine {here}{shown}\n",
        machine.files.len()
    )
}

fn grade(
    arguments: &Arguments,
    folder: &Path,
    program: &str,
    kinds: &'static Kinds,
) -> Result<Outcome, (String, Outcome)> {
    let exercises = folder.join(EXERCISES);
    if !exercises.is_dir() {
        let reason = format!(
            "{} has no folder \"{EXERCISES}\" with test files; docs/machines.md tells how exercises are written",
            folder.display()
        );
        return Err((reason, Outcome::WrongInput));
    }
    let format = arguments.host.format.same();
    let tests = test::Arguments::of_program(exercises, program, format);
    Ok(test::run(&tests, kinds))
}

fn host(
    arguments: &Arguments,
    (folder, is_unpacked): (&Path, bool),
    kinds: &'static Kinds,
) -> Outcome {
    let job = Job {
        title: "machine",
        file: &folder.join(CONFIG),
        kinds,
        role: Role::Device,
        program: Box::new(Idle),
        has_replies: true,
        bus: arguments.bus.as_deref(),
        interval: arguments.tick,
        keeps_lists: !is_unpacked,
    };
    host::run(job, &arguments.host)
}
