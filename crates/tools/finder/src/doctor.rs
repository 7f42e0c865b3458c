//! The examination of a line: the steps of its bus, and for a server what its clients do.

use std::sync::Arc;

use crate::device::Device;
use crate::finding::speaks;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_base::toml_text::printable;
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::examine::{Complaint, Examination, Step, Verdict};

/// The times of an examination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terms {
    /// How long values are watched.
    pub watch: Nanos,
    /// How long a server waits for its PLC; zero for not at all.
    pub wait: Nanos,
}

/// The interval of the ticks while a server serves its PLC.
const TICK: Nanos = Nanos::from_millis(10);

/// Goes along the line of a driver.cfg. Texts of the peer are without control characters. A server that is to wait for its
/// PLC answers it, with the fail-safe values; a client writes nothing.
pub fn examine(config: &Config, terms: Terms, clock: &Arc<dyn Clock>, stop: &Stop) -> Vec<Step> {
    let watches = config
        .life_signs
        .watches(&config.table, config.role, config.timing.max_age);
    let watched = watches.iter().filter_map(|watch| {
        let signal = config.table.position(&watch.name)?;
        Some((signal, watch.within))
    });
    let setup = config.bus_setup(clock, None);
    let mut examination = Examination::new(setup, watched.collect(), terms.watch, stop);
    examination.ok(
        "file",
        format!("{} is right: {}", config.path.display(), config.bus.kind()),
    );
    config.bus.examine(&mut examination);
    recognise(config, clock, &mut examination);
    if let Some(complaints) = config.bus.complaints()
        && terms.wait > Nanos::ZERO
        && !examination.has_failed()
    {
        serve(
            config,
            complaints,
            (terms.wait, clock, stop),
            &mut examination,
        );
    }
    let mut steps = examination.steps;
    for step in &mut steps {
        step.evidence = printable(&step.evidence);
        step.next = printable(&step.next);
        for detail in &mut step.details {
            *detail = printable(detail);
        }
    }
    steps
}

/// The cause of the first failure, or else of the first warning.
pub fn cause(steps: &[Step]) -> Option<&'static str> {
    let of = |verdict| steps.iter().find(|step| step.verdict == verdict)?.cause;
    of(Verdict::Fail).or_else(|| of(Verdict::Warn))
}

/// Finds out whether a peer that does not speak the bus of the file speaks another one.
fn recognise(config: &Config, clock: &Arc<dyn Clock>, examination: &mut Examination<'_>) {
    const STRANGE: [&str; 5] = [
        "silent",
        "connection-limit",
        "not-modbus",
        "not-s7",
        "not-opcua",
    ];
    let Some(address) = examination.reached else {
        return;
    };
    let is_strange = |step: &&mut Step| {
        step.name == "protocol" && step.cause.is_some_and(|cause| STRANGE.contains(&cause))
    };
    let Some(step) = examination.steps.iter_mut().find(is_strange) else {
        return;
    };
    let mut others = config.kinds.searches();
    others.retain(|search| !config.bus.kind().starts_with(search.bus));
    if let Some(device) = speaks(address, &others, clock) {
        let Device { bus, found, .. } = device;
        step.cause = Some("another-bus");
        step.evidence = format!(
            "{}; but it answers as {bus}: {}",
            step.evidence, found.identity
        );
        step.next = format!("correct the port, or the kind of bus: write kind = \"{bus}-client\"");
    }
}

/// Serves the PLC for a while, and reports what it asked for in vain: the steps `client` and `requests`.
fn serve(
    config: &Config,
    all: &[Complaint],
    (wait, clock, stop): (Nanos, &Arc<dyn Clock>, &Stop),
    examination: &mut Examination<'_>,
) {
    let mut driver = match Driver::open(config.clone(), Arc::clone(clock)) {
        Ok(driver) => driver,
        Err(error) => {
            let next = "correct what the message says";
            examination.fail("client", "cannot-listen", error.to_string(), next);
            return;
        }
    };
    // Without ticks a server answers nobody.
    let mut slots = driver.initial_slots();
    let end = clock.now() + wait;
    let mut was_there = false;
    while clock.now() < end && !stop.is_stopped() {
        let exchange = driver.exchange(None, &mut slots);
        was_there |= matches!(exchange.code, Code::Fresh | Code::Unchanged);
        was_there |= driver.fact("clients").is_some_and(|clients| clients != "0");
        clock.wait_until(end.min(clock.now() + TICK), stop);
    }
    let waited = if stop.is_stopped() {
        wait - (end - clock.now()).max(Nanos::ZERO)
    } else {
        wait
    };
    let waited = Nanos(waited.0 - waited.0 % 1_000_000);
    let count = |counter: &str| {
        let statistics = driver.statistics();
        let mut values = statistics.lines().filter_map(|line| line.split_once('='));
        let found = values.find(|(key, _)| *key == counter);
        let found = found.and_then(|(_, value)| value.parse::<u64>().ok());
        found.unwrap_or_default()
    };
    let accepted = count("clients.accepted");
    let mut complaints = Vec::new();
    for complaint in all {
        match count(complaint.counter) {
            0 => {}
            times => complaints.push((complaint, times)),
        }
    }
    driver.close();
    if accepted == 0 && complaints.is_empty() && !was_there {
        examination.fail(
            "client",
            "nobody-connects",
            format!("nobody has connected within {waited}"),
            "check the address and port in the PLC, whether it is in RUN, and the firewall of this computer",
        );
        return;
    }
    examination.ok("client", format!("somebody has connected within {waited}"));
    // Without counters nobody knows.
    if complaints.is_empty() && !all.is_empty() {
        examination.ok("requests", "all requests were answered");
    }
    for (complaint, times) in complaints {
        let evidence = format!("{} ({times} times)", complaint.what);
        examination.fail("requests", complaint.cause, evidence, complaint.next);
    }
}
