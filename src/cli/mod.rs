//! The `tickbus` command.
//!
//! Each subcommand has one file, with its arguments and `run`, which returns an `Outcome`.

/// Like the macro of `std`, which panics if the reader of stderr is gone (`2>&1 | head`).
macro_rules! eprintln {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr().lock(), $($text)*);
    }};
}

mod axes;
mod bridge;
mod check;
mod columns;
mod compare;
mod completions;
mod dispatch;
mod doctor;
mod export;
mod find;
mod fmu_helper;
mod gsd;
mod host;
mod import;
#[cfg(feature = "doors")]
mod in_library;
mod json;
mod lab;
mod latency;
mod logo;
mod machine;
mod man;
mod mirror;
mod new;
mod observe;
mod play;
mod plc;
mod plugin_helper;
mod profibus;
mod progress;
mod reading;
mod report;
mod run;
mod schema;
mod show;
mod studio;
mod sync;
mod test;
mod version;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::OnceLock;

use clap::{Parser, Subcommand};

use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Kinds;

/// Puts a simulated machine on a real PLC's fieldbus.
#[derive(Debug, Parser)]
#[command(name = "tickbus", version, long_version = version::long(), about, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// The meaning of the exit codes, for the help and the manual page; see [`Outcome`].
const EXIT_CODES: &str = "\
Exit codes:
    0  done
    1  the input is wrong, a test has failed, or a limit is exceeded
    2  the command line is wrong
    3  the bus or the peer has failed
  130  interrupted";

#[derive(Debug, Subcommand)]
enum Command {
    Axes(axes::Arguments),
    Bridge(bridge::Arguments),
    Check(check::Arguments),
    Compare(compare::Arguments),
    Completions(completions::Arguments),
    Dispatch(dispatch::Arguments),
    Doctor(doctor::Arguments),
    Export(export::Arguments),
    Find(find::Arguments),
    Gsd(gsd::Arguments),
    Import(import::Arguments),
    Latency(latency::Arguments),
    Logo(logo::Arguments),
    Machine(machine::Arguments),
    Man(man::Arguments),
    Mirror(mirror::Arguments),
    New(new::Arguments),
    Observe(observe::Arguments),
    Play(play::Arguments),
    Plc(plc::Arguments),
    Profibus(profibus::Arguments),
    Report(report::Arguments),
    Run(run::Arguments),
    Schema(schema::Arguments),
    Show(show::Arguments),
    Studio(studio::Arguments),
    Sync(sync::Arguments),
    Test(test::Arguments),
    /// Call a plug-in for the process that starts this; not for people.
    #[command(hide = true)]
    PluginHelper,
    /// Run an FMU for the process that starts this; not for people.
    #[command(hide = true)]
    FmuHelper,
}

/// Says how a command ended, for its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// 0: done.
    Done,
    /// 1: the input was wrong.
    WrongInput,
    /// 2: the command line was wrong. clap reports most such mistakes.
    Usage,
    /// 3: the bus or the peer failed.
    BusFailed,
}

impl Outcome {
    fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::WrongInput => 1,
            Self::Usage => 2,
            Self::BusFailed => 3,
        }
    }
}

/// Writes a report to stdout. A reader that is gone (`| head`) is not reported; a full disk is.
fn print(title: &str, text: &str) -> Outcome {
    use std::io::Write as _;
    let mut stdout = std::io::stdout().lock();
    let written = stdout
        .write_all(text.as_bytes())
        .and_then(|()| stdout.flush());
    match written {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            eprintln!("{title}: failed: standard output cannot be written: {error}");
            Outcome::WrongInput
        }
        _ => Outcome::Done,
    }
}

/// The longest time that the process waits at its end for the log to reach stderr.
const LOG_FLUSH_LIMIT: Nanos = Nanos::from_secs(1);

/// The name by which the command was called.
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// The path of the command, for lines that users copy: the program of this process, or the script that runs the command in
/// the process of its interpreter.
fn own_program() -> PathBuf {
    let called = PROGRAM.get().cloned();
    let called = called.unwrap_or_else(|| PathBuf::from("tickbus"));
    let whole = called.canonicalize().unwrap_or_else(|_| called.clone());
    match std::env::current_exe() {
        Ok(own) if own.file_stem() == whole.file_stem() => own,
        _ => called,
    }
}

/// The exit code of a Rust program that panics.
const PANICKED: u8 = 101;

/// Runs the command with the arguments of the process. A driver.cfg can name these `kinds` of bus.
pub fn main(kinds: &'static Kinds) -> ExitCode {
    command(kinds, std::env::args_os()).into()
}

/// Runs the command within a process of any language, and returns its exit code. The first of the arguments is the name
/// of the program.
pub fn command(kinds: &'static Kinds, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if let Some(name) = arguments.first() {
        // A second command in one process is called by the same name.
        let _ = PROGRAM.set(PathBuf::from(name));
    }
    // The hook has reported the panic.
    std::panic::catch_unwind(|| run(kinds, arguments)).unwrap_or(PANICKED)
}

fn run(kinds: &'static Kinds, arguments: Vec<OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        // Help and version, too.
        Err(other) => {
            // A reader that is gone needs no text.
            let _ = other.print();
            return u8::try_from(other.exit_code()).unwrap_or(Outcome::Usage.code());
        }
    };
    // Events on the line are reported on stdout.
    tickbus_base::os::log_to_stderr(log::LevelFilter::Error);
    let outcome = match arguments.command {
        Command::Axes(arguments) => axes::run(&arguments, kinds),
        Command::Bridge(arguments) => bridge::run(&arguments, kinds),
        Command::Check(arguments) => check::run(&arguments, kinds),
        Command::Compare(arguments) => compare::run(&arguments, kinds),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Dispatch(arguments) => dispatch::run(&arguments),
        Command::Doctor(arguments) => doctor::run(&arguments, kinds),
        Command::Export(arguments) => export::run(&arguments, kinds),
        Command::Find(arguments) => find::run(&arguments, kinds),
        Command::Gsd(arguments) => gsd::run(&arguments, kinds),
        Command::Import(arguments) => import::run(&arguments, kinds),
        Command::Latency(arguments) => latency::run(&arguments),
        Command::Logo(arguments) => logo::run(&arguments),
        Command::Machine(arguments) => machine::run(&arguments, kinds),
        Command::Man(arguments) => man::run(&arguments),
        Command::Mirror(arguments) => mirror::run(&arguments, kinds),
        Command::New(arguments) => new::run(&arguments, kinds),
        Command::Observe(arguments) => observe::run(&arguments, kinds),
        Command::Play(arguments) => play::run(&arguments, kinds),
        Command::Plc(arguments) => plc::run(&arguments, kinds),
        Command::Profibus(arguments) => profibus::run(&arguments, kinds),
        Command::Report(arguments) => report::run(&arguments),
        Command::Run(arguments) => run::run(&arguments, kinds),
        Command::Schema(arguments) => schema::run(&arguments, kinds),
        Command::Show(arguments) => show::run(&arguments, kinds),
        Command::Studio(arguments) => studio::run(&arguments, kinds),
        Command::Sync(arguments) => sync::run(&arguments, kinds),
        Command::Test(arguments) => test::run(&arguments, kinds),
        Command::PluginHelper => plugin_helper::run(),
        Command::FmuHelper => fmu_helper::run(),
    };
    tickbus_base::os::flush_log(LOG_FLUSH_LIMIT);
    outcome.code()
}
