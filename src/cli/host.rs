//! Shared by `tickbus plc` and `tickbus mirror`: hosts a PLC program at one end of a bus until stopped.

use std::fmt::Write as _;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Map, Value, json};

use super::Outcome;
use super::json::{Format, print_document};
pub(super) use super::reading::{PageAddress, page_address, recording};
use super::reading::{Reading, Wrong};
use crate::page::{self, PageError, Place, Shown};
use tickbus_base::statistics::entries;
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_driver::{Host, Watch};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::faults::{FaultStatus, Phase};
use tickbus_fieldbus::{Link, LinkState, Role};
use tickbus_net::Address;
use tickbus_plc::Program;
use tickbus_virtual_time::Controls;

/// The interval at which the command checks its line.
const LOOK: Nanos = Nanos::from_millis(20);

/// Arguments that both commands have.
#[derive(Debug, clap::Args)]
pub(super) struct Hosting {
    /// Use this address instead of the one in FILE.
    #[arg(long, value_name = "HOST:PORT")]
    address: Option<String>,

    /// Inject the faults in the `[[fault]]` sections of this file.
    #[arg(long, value_name = "FILE")]
    faults: Option<std::path::PathBuf>,

    /// Serve the live page, and print its address; without HOST:PORT, at the address in the page table of FILE, or at
    /// 127.0.0.1:20080.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "", value_parser = page_address)]
    page: Option<PageAddress>,

    /// Let the page edit FILE, and the line take its changes; serves the page as --page does. On this computer alone.
    #[arg(long)]
    edit: bool,

    /// Stop after this time [default: at Ctrl-C].
    #[arg(long, value_name = "TIME", value_parser = span)]
    duration: Option<Nanos>,

    /// Record every scan to this file: a name ending in .vcd or .csv.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,

    /// Print statistics at the end, and every INTERVAL if one is given (--stats=1s).
    #[arg(long, value_name = "INTERVAL", num_args = 0..=1, require_equals = false,
        default_missing_value = "", value_parser = stats)]
    stats: Option<Stats>,

    #[command(flatten)]
    pub(super) format: Format,
}

impl Hosting {
    /// Prints lines while the program runs: on stdout, or with `--json` on stderr.
    pub(super) fn say(&self, text: &str) -> io::Result<()> {
        let mut out: Box<dyn io::Write> = if self.format.is_json() {
            Box::new(io::stderr().lock())
        } else {
            Box::new(io::stdout().lock())
        };
        out.write_all(text.as_bytes()).and_then(|()| out.flush())
    }

    /// Returns true if a person reads what [`say`](Self::say) prints.
    fn is_terminal(&self) -> bool {
        if self.format.is_json() {
            io::stderr().is_terminal()
        } else {
            io::stdout().is_terminal()
        }
    }
}

/// Says when statistics are printed.
#[derive(Clone, Copy, Debug)]
enum Stats {
    AtEnd,
    Every(Nanos),
}

fn stats(text: &str) -> Result<Stats, String> {
    if text.is_empty() {
        return Ok(Stats::AtEnd);
    }
    span(text).map(Stats::Every)
}

/// Parses a duration on the command line.
pub(super) fn span(text: &str) -> Result<Nanos, String> {
    match text.parse() {
        Ok(Nanos::ZERO) => Err("this is no time at all; write a longer one".to_owned()),
        Ok(span) => Ok(span),
        Err(error) => Err(error.to_string()),
    }
}

/// The program that a command hosts.
pub(super) struct Job<'a> {
    /// The prefix of its output lines.
    pub(super) title: &'a str,
    pub(super) file: &'a Path,
    /// The kinds of bus that the file can name.
    pub(super) kinds: &'static Kinds,
    pub(super) role: Role,
    pub(super) program: Box<dyn Program>,
    /// True if the replies of the file are made.
    pub(super) has_replies: bool,
    /// The kind of bus in the place of the file's own.
    pub(super) bus: Option<&'a str>,
    pub(super) interval: Nanos,
    /// False if the folder of the file does not outlast the command.
    pub(super) keeps_lists: bool,
}

/// Returns how the driver.cfg of this job is read.
fn reading(job: &Job<'_>, arguments: &Hosting) -> Reading {
    Reading {
        file: job.file.to_owned(),
        kinds: job.kinds,
        role: job.role,
        has_replies: job.has_replies,
        bus: job.bus.map(str::to_owned),
        address: arguments.address.clone(),
        faults: arguments.faults.clone(),
        record: arguments.record.clone(),
        page: arguments.page.clone(),
        edit: arguments.edit,
    }
}

/// Reads the driver.cfg, hosts the program, and reports on stdout.
pub(super) fn run(job: Job<'_>, arguments: &Hosting) -> Outcome {
    let (title, format) = (job.title, &arguments.format);
    let reading = reading(&job, arguments);
    let config = match reading.read() {
        Ok(config) => config,
        Err(Wrong::Mistakes(mistakes)) => return format.refuse(title, &mistakes),
        Err(Wrong::Argument(reason)) => return format.fail(title, &reason, Outcome::WrongInput),
    };
    let stop = Stop::new();
    if let Err(error) = ctrlc::set_handler({
        let stop = stop.clone();
        move || stop.stop()
    }) {
        let reason = format!("{title}: Ctrl-C cannot be caught: {error}");
        return format.fail(title, &reason, Outcome::BusFailed);
    }
    let report = job.program.report();
    let clock = Monotonic::shared();
    let host = match Host::open(&config, job.program, job.interval, Arc::clone(&clock) as _) {
        Ok(host) => host,
        Err(error) => {
            let outcome = outcome_of(error.is_wrong_input());
            return format.fail(title, &format!("{title}: {error}"), outcome);
        }
    };
    let announce = |url: &str, invitation: &str| {
        let invitation = if arguments.is_terminal() {
            invitation
        } else {
            ""
        };
        let _ = arguments.say(&format!("{title}: page at {url}\n{invitation}"));
    };
    let shown = Shown {
        config: &config,
        watch: || host.watch(),
        line: host.line(),
        read: Some(Box::new(move || {
            reading.read().map_err(|wrong| wrong.to_string())
        })),
        setting: page::FLAG,
        keeps_lists: job.keeps_lists,
    };
    let _place = match page::show(shown, announce) {
        Ok(place) => place,
        Err(error) => {
            let outcome = outcome_of(error.is_wrong_input());
            return format.fail(title, &format!("{title}: {error}"), outcome);
        }
    };
    let is_done = || report.as_ref().is_some_and(|report| report.is_done());
    // The line keeps running even if the reader of stdout is gone (`| head`).
    let told = watch(title, &host, arguments, &*clock, &stop, &is_done);
    let statistics = host.statistics();
    let (scans, stale) = host.scans();
    // Only a run on virtual time has a hash.
    let hash = host.fact("sdsp.hash");
    let fault = host.fault();
    let unmet = host.has_only_failed().then(|| never_ran(&host.link()));
    // Closing detects a scan that never ends, even if the command was too short to detect it earlier.
    let unended = host.close();
    let fault = fault.or(unended);
    let failure = fault
        .or_else(|| report.as_ref().and_then(|report| report.failure()))
        .or(unmet);
    let summary = report
        .as_ref()
        .map(|report| report.summary())
        .unwrap_or_default();
    let mut printed = Outcome::Done;
    if format.is_json() {
        let of_program: Vec<&str> = summary.lines().collect();
        let document = json!({
            "ok": failure.is_none(),
            "reason": failure,
            "scans": scans,
            "stale": stale,
            "hash": hash,
            "statistics": entries(&statistics)
                .map(|(key, value)| (key, json!(value)))
                .collect::<Map<String, Value>>(),
            "summary": of_program,
        });
        printed = print_document(title, document);
    } else if told.is_ok() {
        let mut text = String::new();
        if arguments.stats.is_some() {
            text = format!("{statistics}\n");
        }
        text += &summary;
        let hash = hash.map(|hash| format!(" hash={hash}")).unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = match &failure {
            None => writeln!(text, "{title}: ok scans={scans} stale={stale}{hash}"),
            Some(failure) => writeln!(text, "{title}: failed reason={failure}"),
        };
        let _ = arguments.say(&text);
    }
    if failure.is_some() {
        Outcome::BusFailed
    } else {
        printed
    }
}

/// Returns why a command failed whose line has never come up.
pub(super) fn never_ran(link: &Link) -> String {
    format!("the line never ran: {}", link.reason)
}

/// Shows a command's driver or program on the page that its driver.cfg asks for, and prints the address.
pub(super) fn show(
    title: &str,
    config: &Config,
    watch: impl FnOnce() -> Option<Watch>,
) -> Result<Option<Place>, Outcome> {
    let shown = Shown {
        config,
        watch,
        line: None,
        read: None,
        setting: page::FLAG,
        keeps_lists: true,
    };
    page::show(shown, announce(title)).map_err(|error| not_shown(title, &error))
}

/// Shows a run on virtual time on the page and prints the address.
pub(super) fn show_run(
    title: &str,
    name: &str,
    listen: &Address,
    controls: Controls,
) -> Result<Place, Outcome> {
    page::show_run(name, listen, controls, announce(title))
        .map_err(|error| not_shown(title, &error))
}

fn not_shown(title: &str, error: &PageError) -> Outcome {
    eprintln!("{title}: {error}");
    outcome_of(error.is_wrong_input())
}

/// Prints the address of the page.
fn announce(title: &str) -> impl FnOnce(&str, &str) {
    move |url, invitation| super::lab::say_page(title, url, invitation)
}

/// Returns the outcome of a failure, which is the input's or the bus's.
fn outcome_of(is_wrong_input: bool) -> Outcome {
    if is_wrong_input {
        Outcome::WrongInput
    } else {
        Outcome::BusFailed
    }
}

/// Reports every change of the line, and the statistics when due, until stopped or done.
fn watch(
    title: &str,
    host: &Host,
    arguments: &Hosting,
    clock: &dyn Clock,
    stop: &Stop,
    is_done: &dyn Fn() -> bool,
) -> io::Result<()> {
    let begun = clock.now();
    let end = arguments.duration.map_or(Nanos::MAX, |span| begun + span);
    let every = match arguments.stats {
        Some(Stats::Every(every)) => every,
        _ => Nanos::MAX,
    };
    let mut next_stats = begun + every;
    let mut told: Option<Link> = None;
    let mut faults = ToldFaults::default();
    let mut result = Ok(());
    while !stop.is_stopped() && !is_done() && host.fault().is_none() {
        let now = clock.now();
        // Read before the link: the program's last reports are still to be printed.
        let is_over = now >= end || host.is_over();
        let link = host.link();
        let mut text = String::new();
        if is_news(told.as_ref(), &link) {
            text = format!("{title}: {}: {}\n", link.state.name(), link.reason);
            told = Some(link);
        }
        faults.tell(title, host.injected_faults(), &mut text);
        if now >= next_stats {
            text += &host.statistics();
            text.push('\n');
            next_stats = next_stats.max(now - every) + every;
        }
        if result.is_ok() && !text.is_empty() {
            result = arguments.say(&text);
        }
        if is_over {
            break;
        }
        clock.wait_until((now + LOOK).min(end).min(next_stats), stop);
    }
    result
}

/// The injected faults as last reported: how often each has begun, and its state.
#[derive(Debug, Default)]
pub(super) struct ToldFaults(Vec<(u64, Phase)>);

impl ToldFaults {
    /// Reports every fault that has begun or ended since the last call.
    pub(super) fn tell(&mut self, title: &str, faults: Vec<FaultStatus>, text: &mut String) {
        self.0.resize(faults.len(), (0, Phase::Waiting));
        for (told, fault) in self.0.iter_mut().zip(faults) {
            let is = (fault.begun, fault.phase);
            if std::mem::replace(told, is) != is {
                let FaultStatus { name, what, .. } = fault;
                let (state, begun) = (fault.phase.name(), fault.begun);
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{title}: fault \"{name}\" is {state} (begun so far: {begun}): {what}"
                );
            }
        }
    }
}

/// Returns true if a line's state is to be reported: the state has changed, or the thing that it waits for has.
pub(super) fn is_news(told: Option<&Link>, link: &Link) -> bool {
    let Some(told) = told else {
        // At the beginning every line is closed.
        return link.state != LinkState::Closed;
    };
    (told.state, told.cause, told.since) != (link.state, link.cause, link.since)
        || (link.state == LinkState::Opening && told.reason != link.reason)
}
