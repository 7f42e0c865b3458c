//! `tickbus sync FILE`: the server of a run in lock-step, for clients in other processes.

mod diff;
mod gateway;
mod join;
mod prepare;

use std::io::{self, BufRead as _, Write as _};
use std::path::{Path, PathBuf};
use std::thread;

use super::Outcome;
use super::host::{PageAddress, page_address, recording, show_run};
use tickbus_base::time::{Monotonic, Stop};
use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::Kinds;
use tickbus_net::LocalAddress;
use tickbus_virtual_time as virtual_time;
use virtual_time::server::Control;
#[cfg(unix)]
use virtual_time::shared_memory;
use virtual_time::{
    Cause, Controls, Ended, Hosting, Logic, Meeting, RecordedRun, RunFile, Save, SavedRun, tcp,
};

/// Serve virtual time: clients advance in lock-step, and every run gives the same result.
///
/// Type a command per line while it runs: pause, step (or step 10), run, save, stop. docs/sdsp.md describes the rules,
/// and the protocol for your own clients.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct Arguments {
    #[command(subcommand)]
    other: Option<Other>,

    /// The file of the run; docs/sdsp.md describes its table "sync".
    #[arg(required = true)]
    file: Option<PathBuf>,

    /// Start paused, and wait for commands on stdin.
    #[arg(long)]
    paused: bool,

    /// Record what is read in each step to this file: a name ending in .vcd or .csv.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,

    /// Keep what a saved run needs, and save the run to this file: on the command save, or at --save-at.
    #[arg(long, value_name = "FILE")]
    save_to: Option<PathBuf>,

    /// Save the run after this step; 0 is the initial values.
    #[arg(long, value_name = "STEP", requires = "save_to")]
    save_at: Option<u64>,

    /// Continue the run that was saved to this file; its clients join as ever.
    #[arg(long, value_name = "FILE")]
    restore: Option<PathBuf>,

    /// Serve the live page of the run, and print its address; without HOST:PORT, at 127.0.0.1:20080.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "", value_parser = page_address)]
    page: Option<PageAddress>,
}

/// Other commands for a run in lock-step.
#[derive(Debug, clap::Subcommand)]
enum Other {
    Diff(diff::Arguments),
    Gateway(gateway::Arguments),
    Join(join::Arguments),
    Prepare(prepare::Arguments),
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let path = match (&arguments.other, &arguments.file) {
        (Some(Other::Gateway(arguments)), _) => return gateway::run(arguments, kinds),
        (Some(Other::Join(arguments)), _) => return join::run(arguments),
        (Some(Other::Diff(arguments)), _) => return diff::run(arguments),
        (Some(Other::Prepare(arguments)), _) => return prepare::run(arguments),
        (None, file) => file.as_ref().expect("it is required"),
    };
    let mut file = match RunFile::load(path) {
        Ok(file) => file,
        Err(mistakes) => {
            eprintln!("{mistakes}\nsync: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    file.settings.paused = arguments.paused;
    file.settings.save = arguments.save_to.clone().map(|file| Save {
        file,
        at: arguments.save_at,
    });
    let restored = arguments.restore.as_deref().map(SavedRun::load);
    file.settings.restore = match restored.transpose() {
        Ok(restored) => restored,
        Err(mistake) => {
            eprintln!("{mistake}\nsync: failed mistakes=1");
            return Outcome::WrongInput;
        }
    };
    let logic = match file.logic.as_deref().map(script).transpose() {
        Ok(logic) => logic.unwrap_or_default(),
        Err(mistakes) => {
            eprintln!("{mistakes}\nsync: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    let (logic, recorded) = match &arguments.record {
        None => (logic, RecordedRun::default()),
        Some(record) => match attach(logic, record, &file, path) {
            Ok(attached) => attached,
            Err(why) => {
                eprintln!("sync: --record: {why}\nsync: failed mistakes=1");
                return Outcome::WrongInput;
            }
        },
    };
    let Some(stop) = stop_on_ctrl_c() else {
        return Outcome::BusFailed;
    };
    let controls = Controls::new(&stop);
    let show = |page: &PageAddress| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        show_run("sync", &name, &page.listen(), controls.clone())
    };
    let _place = match arguments.page.as_ref().map(show).transpose() {
        Ok(place) => place,
        Err(outcome) => return outcome,
    };
    let commands = thread::Builder::new().name("tickbus-commands".to_owned());
    let spawned = commands.spawn({
        let controls = controls.clone();
        // The thread ends with the process: a read of stdin cannot be cancelled.
        move || obey(&controls)
    });
    if let Err(error) = spawned {
        eprintln!("sync: commands on stdin cannot be read: {error}");
    }
    let outcome = serve(file, logic, &controls);
    if controls.unsaved().is_some() {
        report(outcome);
        return Outcome::BusFailed;
    }
    if let Some(why) = recorded.error() {
        eprintln!("sync: --record: {why}");
        report(outcome);
        return Outcome::BusFailed;
    }
    report(outcome)
}

/// Lets `logic` record the run of the file at `path`.
fn attach<'l>(
    logic: Logic<'l>,
    record: &Path,
    file: &RunFile,
    path: &Path,
) -> Result<(Logic<'l>, RecordedRun), String> {
    let options = recording(record)?;
    let run = path.file_stem().unwrap_or_default().to_string_lossy();
    let clock = Monotonic::shared() as _;
    RecordedRun::attach(logic, &options, &run, file.settings.steps, &clock)
        .map_err(|error| error.to_string())
}

/// Returns a stop that Ctrl-C triggers.
fn stop_on_ctrl_c() -> Option<Stop> {
    let stop = Stop::new();
    let caught = ctrlc::set_handler({
        let stop = stop.clone();
        move || stop.stop()
    });
    caught
        .inspect_err(|error| eprintln!("sync: Ctrl-C cannot be caught: {error}"))
        .ok()?;
    Some(stop)
}

/// Prints a line. The run continues even if the reader of stdout is gone.
fn say(line: &str) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "sync: {line}").and_then(|()| out.flush());
}

#[cfg(feature = "script")]
fn script(path: &Path) -> Result<Logic<'static>, Mistakes> {
    virtual_time::script::load(path)
}

#[cfg(not(feature = "script"))]
fn script(path: &Path) -> Result<Logic<'static>, Mistakes> {
    Err(Mistakes::of_file(
        &path.display().to_string(),
        "this tickbus was built without scripts",
        "build it with --features script, or remove \"logic\"",
    ))
}

fn serve(
    file: RunFile,
    logic: Logic<'_>,
    controls: &Controls,
) -> Result<virtual_time::Outcome, Ended> {
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        controls,
        news: &mut say,
    };
    let failed = |reason: String| Ended {
        cause: Cause::System,
        client: None,
        reason,
        steps: 0,
    };
    match file.meeting {
        Meeting::Tcp(address) => {
            let listener = tcp::Listener::bind(&address)
                .map_err(|error| failed(format!("cannot listen on {address}: {error}")))?;
            say(&format!("listening on {}", listener.place()));
            listener.run(file.settings, logic, hosting)
        }
        Meeting::Unix(address) => {
            let listener = tcp::Listener::bind_local(&address)
                .map_err(|error| failed(no_socket(&address, &error)))?;
            say(&format!("listening on {}", listener.place()));
            listener.run(file.settings, logic, hosting)
        }
        #[cfg(unix)]
        Meeting::SharedMemory(name) => {
            let listener = shared_memory::Listener::bind(&name, &file.settings)
                .map_err(|error| failed(format!("cannot offer the memory \"{name}\": {error}")))?;
            say(&format!("waiting in the shared memory \"{name}\""));
            listener.run(file.settings, logic, hosting)
        }
        #[cfg(not(unix))]
        Meeting::SharedMemory(_) => {
            let reason = "this system has no shared memory for clients; use listen";
            Err(failed(reason.to_owned()))
        }
    }
}

/// Says why the server cannot listen at a Unix socket, and what to do.
fn no_socket(address: &LocalAddress, error: &io::Error) -> String {
    let right = match error.kind() {
        io::ErrorKind::AddrInUse => "stop that server, or write another address",
        io::ErrorKind::AlreadyExists => "write a path that is free",
        io::ErrorKind::NotFound => "make its folder first, or write another path",
        io::ErrorKind::Unsupported => "write HOST:PORT",
        _ => "write a path where you may make files",
    };
    format!("cannot listen on {address}: {error}; {right}")
}

/// Prints the last line: the result of the run. Its texts come from clients, so a quote or a line break in them is
/// written as `\"` or `\n`.
fn report(outcome: Result<virtual_time::Outcome, Ended>) -> Outcome {
    let ended = match outcome {
        Ok(outcome) => {
            let virtual_time::Outcome { steps, time, hash } = outcome;
            say(&format!("ok steps={steps} time={time} hash={hash}"));
            return Outcome::Done;
        }
        Err(ended) => ended,
    };
    let client = ended
        .client
        .map_or_else(String::new, |client| format!(" client={client:?}"));
    let (cause, steps, reason) = (ended.cause, ended.steps, ended.reason);
    say(&format!(
        "failed cause={}{client} steps={steps} reason={reason:?}",
        cause.name()
    ));
    match cause {
        Cause::Configuration | Cause::Logic => Outcome::WrongInput,
        _ => Outcome::BusFailed,
    }
}

/// Reads commands until stdin ends.
fn obey(controls: &Controls) {
    for line in io::stdin().lock().lines() {
        let Ok(line) = line else {
            return;
        };
        let mut words = line.split_whitespace();
        let control = match (words.next(), words.next(), words.next()) {
            (None, ..) => continue,
            (Some("pause"), None, _) => Some(Control::Pause),
            (Some("run"), None, _) => Some(Control::Run),
            (Some("stop"), None, _) => Some(Control::Stop),
            (Some("save"), None, _) => Some(Control::Save),
            (Some("step"), None, _) => Some(Control::Step(1)),
            (Some("step"), Some(count), None) => count.parse().ok().map(Control::Step),
            _ => None,
        };
        match control {
            Some(control) => controls.send(control),
            None => say(&format!(
                "\"{}\" is not a command; commands are pause, step, step NUMBER, run, save and stop",
                tickbus_base::toml_text::shown(&line)
            )),
        }
    }
}
