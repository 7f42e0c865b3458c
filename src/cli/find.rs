//! `tickbus find TARGET...`: who is on the network that the user names.

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::{Value, json};

use super::columns::aligned;
use super::json::{Format, print_document};
use super::{Outcome, print};
use tickbus_base::time::{Clock, Monotonic, Stop};
use tickbus_base::toml_text::{did_you_mean, shown};
use tickbus_driver_cfg::Kinds;
use tickbus_finder::{Device, Findings, Plan, RATE, Target, find};

/// Find the PLCs on a network: Modbus TCP, S7 and OPC UA.
///
/// Each address gets one connection per bus, and those that accept it are asked who they are. Nothing is written to anybody.
/// Only the addresses that you name are searched: a name, an address, a range such as 192.168.0.0/24 or 192.168.0.5-20, each with
/// a port behind a colon if it is not the usual one (not behind a slash).
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The addresses to search.
    #[arg(required = true, value_name = "TARGET", value_parser = target)]
    targets: Vec<Target>,

    /// Search for servers of these buses only: modbus, s7, opcua [default: all].
    #[arg(long, value_name = "BUS", value_delimiter = ',')]
    bus: Vec<String>,

    /// Search at this port instead of the usual ones (502, 102, 4840).
    #[arg(long, value_name = "PORT", value_parser = clap::value_parser!(u16).range(1..))]
    port: Option<u16>,

    /// Ask these Modbus units [default: 1, 255 and 0, until one answers].
    #[arg(long, value_name = "UNIT", value_delimiter = ',')]
    unit: Vec<u8>,

    /// Connect to this many addresses per second.
    #[arg(long, value_name = "N", default_value_t = RATE, value_parser = clap::value_parser!(u32).range(1..=2000))]
    rate: u32,

    /// Search for Modbus over UDP as well: up to three more packets per address.
    #[arg(long)]
    udp: bool,

    /// Print a `[fieldbus]` table for each device.
    #[arg(long, conflicts_with = "json")]
    cfg: bool,

    #[command(flatten)]
    format: Format,
}

/// The most rows for ports that speak none of the buses: some firewalls accept connections to every address.
const UNKNOWN: usize = 10;

fn target(text: &str) -> Result<Target, String> {
    text.parse()
        .map_err(|mistake: tickbus_base::Mistake| mistake.to_string())
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let stop = Stop::new();
    let handler = {
        let stop = stop.clone();
        move || stop.stop()
    };
    // Without it Ctrl-C ends the search without its findings so far.
    let _ = ctrlc::set_handler(handler);
    let clock: Arc<dyn Clock> = Monotonic::shared();
    let known: Vec<&str> = kinds.searches().iter().map(|search| search.bus).collect();
    if let Some(unknown) = arguments.bus.iter().find(|bus| !known.contains(&&***bus)) {
        let right = did_you_mean(unknown, "buses", &known);
        let why = format!(
            "find: no servers of \"{}\" can be found; {right}",
            shown(unknown)
        );
        return arguments.format.fail("find", &why, Outcome::Usage);
    }
    let is_wanted =
        |bus: &str| arguments.bus.is_empty() || arguments.bus.iter().any(|own| own == bus);
    let searches = kinds
        .searches()
        .into_iter()
        .filter(|search| is_wanted(search.bus));
    let searches: Vec<_> = searches
        .map(|search| (search, arguments.port.unwrap_or(search.port)))
        .collect();
    let plan = match Plan::of(&arguments.targets, searches, &*clock, &stop) {
        Ok(plan) => Plan {
            rate: arguments.rate,
            units: arguments.unit.clone(),
            udp: arguments.udp,
            ..plan
        },
        Err(error) => {
            return arguments
                .format
                .fail("find", &format!("find: {error}"), Outcome::WrongInput);
        }
    };
    let findings = match find(&plan, &clock, &stop) {
        Ok(findings) => findings,
        Err(error) => {
            return arguments
                .format
                .fail("find", &format!("find: {error}"), Outcome::BusFailed);
        }
    };
    let outcome = if findings.devices.is_empty() {
        Outcome::BusFailed
    } else {
        Outcome::Done
    };
    let printed = if arguments.format.is_json() {
        print_document("find", document(&findings))
    } else {
        print("find", &report(&findings, arguments.cfg))
    };
    if printed == Outcome::Done {
        outcome
    } else {
        printed
    }
}

fn facts(device: &Device) -> String {
    let facts = device
        .found
        .facts
        .iter()
        .map(|(name, text)| format!("{name} {text}"));
    facts.collect::<Vec<_>>().join(", ")
}

fn report(findings: &Findings, with_tables: bool) -> String {
    let mut out = String::new();
    let rows = findings.devices.iter().map(|device| {
        let identity = match &*device.found.identity {
            "" => "says nothing about itself",
            identity => identity,
        };
        vec![
            device.address.to_string(),
            device.bus.to_owned(),
            facts(device),
            identity.to_owned(),
        ]
    });
    let mut rows: Vec<Vec<String>> = rows.collect();
    rows.extend(findings.unknown.iter().take(UNKNOWN).map(|address| {
        let what = "accepts connections, and speaks none of these buses".to_owned();
        vec![address.to_string(), "?".to_owned(), String::new(), what]
    }));
    if !rows.is_empty() {
        out.push_str(&aligned(&["address", "bus", "where", "identity"], &rows));
        out.push('\n');
    }
    for device in &findings.devices {
        for url in &device.found.named {
            // Writing to a string cannot fail.
            let _ = writeln!(out, "{} names {url}", device.address);
        }
    }
    if with_tables {
        for device in &findings.devices {
            // Writing to a string cannot fail.
            let _ = writeln!(
                out,
                "# {} {}\n{}",
                device.address, device.found.identity, device.found.stanza
            );
        }
    }
    if let Some(more) = findings.unknown.len().checked_sub(UNKNOWN + 1) {
        let _ = writeln!(
            out,
            "{} more ports accept connections, and speak none of these buses",
            more + 1
        );
    }
    let swept = findings.swept;
    let _ = writeln!(
        out,
        "find: devices={} tried={} refused={} silent={} unreachable={}",
        findings.devices.len(),
        swept.attempts,
        swept.refused,
        swept.silent,
        swept.failed
    );
    out
}

fn document(findings: &Findings) -> Value {
    let devices = findings.devices.iter().map(|device| {
        let facts = device.found.facts.iter();
        json!({
            "address": device.address.ip().to_string(),
            "port": device.address.port(),
            "bus": device.bus,
            "identity": device.found.identity,
            "facts": facts.map(|(name, text)| ((*name).to_owned(), json!(text))).collect::<serde_json::Map<_, _>>(),
            "fieldbus": device.found.stanza,
            "names": device.found.named,
        })
    });
    let swept = findings.swept;
    json!({
        "ok": !findings.devices.is_empty(),
        "reason": findings.devices.is_empty().then_some("no device was found"),
        "devices": devices.collect::<Value>(),
        "unknown": findings.unknown.iter().map(ToString::to_string).collect::<Value>(),
        "tried": swept.attempts,
        "refused": swept.refused,
        "silent": swept.silent,
        "unreachable": swept.failed,
    })
}
