//! `tickbus doctor FILE`: goes along the line of a driver.cfg step by step.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Value, json};

use super::host::span;
use super::json::{Format, print_document};
use super::{Outcome, print};
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::examine::{Step, Verdict};
use tickbus_finder::{Terms, cause, examine};

/// Find out why a line is not up: file, name, route, port, protocol, identity, addresses, order of bytes, RUN, age.
///
/// Each step prints its evidence, and what to try next if it fails. Steps that make no sense after a failure are left out.
/// Nothing is written into the PLC. End your simulation before: many PLCs serve one client at a time.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg.
    file: PathBuf,

    /// Use this address instead of the one in FILE.
    #[arg(long, value_name = "HOST:PORT")]
    address: Option<String>,

    /// How long values are watched for changes.
    #[arg(long, value_name = "TIME", default_value = "1s", value_parser = span)]
    watch: Nanos,

    /// As a server: serve the PLC for this time, and report what it asks for in vain. The PLC reads fail-safe values.
    #[arg(long, value_name = "TIME", value_parser = span)]
    wait: Option<Nanos>,

    #[command(flatten)]
    format: Format,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let mut config = match Config::load(&arguments.file, kinds) {
        Ok(config) => config,
        Err(mistakes) => return arguments.format.refuse("doctor", &mistakes),
    };
    if let Some(address) = &arguments.address
        && let Err(mistake) = config.bus.set_address(address)
    {
        let why = format!("doctor: {mistake}");
        return arguments.format.fail("doctor", &why, Outcome::Usage);
    }
    if arguments.wait.is_some() && config.bus.complaints().is_none() {
        let why = format!(
            "doctor: --wait is for a server, to which the PLC connects, and {} is no server; leave it out",
            config.bus.kind()
        );
        return arguments.format.fail("doctor", &why, Outcome::Usage);
    }
    let clock: Arc<dyn Clock> = Monotonic::shared();
    let terms = Terms {
        watch: arguments.watch,
        wait: arguments.wait.unwrap_or_default(),
    };
    let stop = Stop::new();
    let handler = {
        let stop = stop.clone();
        move || stop.stop()
    };
    // Without it Ctrl-C ends the examination without its steps so far.
    let _ = ctrlc::set_handler(handler);
    let steps = examine(&config, terms, &clock, &stop);
    let has_failed = steps.iter().any(|step| step.verdict == Verdict::Fail);
    let printed = if arguments.format.is_json() {
        print_document("doctor", document(&config, &steps))
    } else {
        print("doctor", &report(&steps))
    };
    match printed {
        Outcome::Done if has_failed => Outcome::BusFailed,
        printed => printed,
    }
}

fn report(steps: &[Step]) -> String {
    let mut out = String::new();
    for step in steps {
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "{:4}  {:9}  {}",
            step.verdict.name(),
            step.name,
            step.evidence
        );
        for detail in &step.details {
            let _ = writeln!(out, "{:17}{detail}", "");
        }
        if !step.next.is_empty() {
            let _ = writeln!(out, "{:17}→ {}", "", step.next);
        }
    }
    let count = |verdict| steps.iter().filter(|step| step.verdict == verdict).count();
    let _ = writeln!(
        out,
        "\ndoctor: {} steps={} warnings={} failures={}",
        cause(steps).unwrap_or("ok"),
        steps.len(),
        count(Verdict::Warn),
        count(Verdict::Fail)
    );
    out
}

fn document(config: &Config, steps: &[Step]) -> Value {
    let list = steps.iter().map(|step| {
        json!({
            "step": step.name,
            "verdict": step.verdict.name(),
            "cause": step.cause,
            "evidence": step.evidence,
            "details": step.details,
            "next": (!step.next.is_empty()).then_some(&step.next),
        })
    });
    let failed = steps.iter().find(|step| step.verdict == Verdict::Fail);
    json!({
        "ok": failed.is_none(),
        "reason": failed.map(|step| &step.evidence),
        "version": env!("CARGO_PKG_VERSION"),
        "file": config.path.display().to_string(),
        "kind": config.bus.kind(),
        "cause": cause(steps),
        "steps": list.collect::<Value>(),
    })
}
