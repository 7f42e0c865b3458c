//! Questions of the studio beside the file: why a line is not up, and which PLCs are on a network.

use std::sync::Arc;

use serde_json::{Value as Json, json};
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_base::toml_text::shown;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::examine::Step;
use tickbus_finder::{Device, Plan, Target, Terms, cause, examine, find};

/// How long values are watched.
const WATCH: Nanos = Nanos::from_secs(1);

/// How long a server waits for its PLC, to see what it asks for in vain.
const WAIT: Nanos = Nanos::from_secs(5);

/// A question that takes longer than a request may.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Question {
    /// Why the line of the file is not up.
    Line,
    /// Which devices are at these addresses.
    Network(Vec<Target>),
}

impl Question {
    /// The question that a page asks by this path, with this body; `None` for another path.
    pub(crate) fn asked(path: &str, body: &str) -> Option<Result<Self, String>> {
        match path {
            "/examine" => Some(Ok(Self::Line)),
            "/find" => Some(targets(body).map(Self::Network)),
            _ => None,
        }
    }

    /// The question as the page knows it.
    const fn name(&self) -> &'static str {
        match self {
            Self::Line => "examine",
            Self::Network(_) => "find",
        }
    }
}

/// The last examination and the last search.
#[derive(Debug, Default)]
pub(crate) struct Explored {
    /// The question that is under way, and its stop.
    busy: Option<(Question, Stop)>,
    steps: Vec<Step>,
    devices: Vec<Device>,
    /// The result of the search, in one line.
    told: String,
}

impl Explored {
    pub(crate) fn json(&self) -> Json {
        let steps = self.steps.iter().map(|step| {
            json!({
                "name": step.name,
                "verdict": step.verdict.name(),
                "evidence": step.evidence,
                "details": step.details,
                "next": step.next,
            })
        });
        let devices = self.devices.iter().map(|device| {
            let facts = device.found.facts.iter();
            json!({
                "address": device.address.to_string(),
                "bus": device.bus,
                "identity": device.found.identity,
                "facts": facts.map(|(name, text)| format!("{name} {text}")).collect::<Vec<_>>(),
                "hasTable": !device.found.stanza.is_empty(),
            })
        });
        json!({
            "busy": self.busy.as_ref().map(|(question, _)| question.name()),
            "steps": steps.collect::<Json>(),
            "cause": cause(&self.steps),
            "devices": devices.collect::<Json>(),
            "told": self.told,
        })
    }

    /// The `[fieldbus]` table of a found device.
    pub(crate) fn table(&self, index: usize) -> Option<&str> {
        let device = self.devices.get(index)?;
        Some(device.found.stanza.as_str()).filter(|table| !table.is_empty())
    }

    /// Notes that this question is under way, until [`end`](Self::end).
    ///
    /// # Errors
    ///
    /// Another one is under way.
    pub(crate) fn begin(&mut self, question: Question, stop: Stop) -> Result<(), String> {
        if self.busy.is_some() {
            return Err("something is looked for already; wait, or stop it".to_owned());
        }
        self.busy = Some((question, stop));
        Ok(())
    }

    /// Notes that no question is under way any more.
    pub(crate) fn end(&mut self) {
        self.busy = None;
    }

    /// Ends the question that is under way early.
    pub(crate) fn cancel(&self) {
        if let Some((_, stop)) = &self.busy {
            stop.stop();
        }
    }

    /// True while the line is examined, which needs the line for itself.
    pub(crate) fn is_examining(&self) -> bool {
        matches!(self.busy, Some((Question::Line, _)))
    }

    /// Takes over the steps of an examination.
    pub(crate) fn examined(&mut self, steps: Vec<Step>) {
        self.steps = steps;
    }

    /// Takes over what was found.
    pub(crate) fn found(&mut self, found: Result<(Vec<Device>, String), String>) {
        match found {
            Ok((devices, told)) => (self.devices, self.told) = (devices, told),
            Err(why) => (self.devices, self.told) = (Vec::new(), why),
        }
    }
}

/// Goes along the line of a driver.cfg; a server also waits for its PLC for some seconds.
pub(crate) fn look_along(config: &Config, stop: &Stop) -> Vec<Step> {
    let clock: Arc<dyn Clock> = Monotonic::shared();
    let wait = if config.bus.complaints().is_some() {
        WAIT
    } else {
        Nanos::ZERO
    };
    examine(config, Terms { watch: WATCH, wait }, &clock, stop)
}

/// The addresses, ranges and names in a text.
///
/// # Errors
///
/// One of them is none, or there is none at all.
fn targets(text: &str) -> Result<Vec<Target>, String> {
    let words = text.split([' ', ',', ';']).filter(|word| !word.is_empty());
    let targets: Vec<Target> = words
        .map(|word| {
            word.parse()
                .map_err(|mistake: tickbus_base::Mistake| mistake.to_string())
        })
        .collect::<Result<_, _>>()?;
    if targets.is_empty() {
        let why = "name the addresses to search, such as 192.168.0.10 or 192.168.0.0/24";
        return Err(why.to_owned());
    }
    Ok(targets)
}

/// Searches for servers of every bus.
pub(crate) fn search(
    targets: &[Target],
    kinds: &'static Kinds,
    stop: &Stop,
) -> Result<(Vec<Device>, String), String> {
    let clock: Arc<dyn Clock> = Monotonic::shared();
    let searches = kinds.searches().into_iter();
    let searches: Vec<_> = searches.map(|search| (search, search.port)).collect();
    let plan = Plan::of(targets, searches, &*clock, stop).map_err(|error| error.to_string())?;
    let findings = find(&plan, &clock, stop).map_err(|error| error.to_string())?;
    let mut told = match findings.devices.len() {
        0 => "nobody there speaks Modbus TCP, S7 or OPC UA at the usual ports; another port is written behind a colon".to_owned(),
        1 => "1 device".to_owned(),
        count => format!("{count} devices"),
    };
    if let Some(other) = findings.unknown.first() {
        told += "; ";
        told += &shown(&other.to_string());
        told += " accepts connections, and speaks none of the buses";
    }
    Ok((findings.devices, told))
}
