//! The examination of a line: the steps of its bus, and for a server what its clients do.

use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_base::toml_text::printable;
use tickbus_driver::Driver;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::BusSetup;
use tickbus_fieldbus::examine::{Examination, Step, Verdict};

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
    let setup = BusSetup {
        name: &config.name,
        id: config.id,
        folder: config.folder(),
        role: config.role,
        table: &config.table,
        cycle: config.timing.cycle,
        max_age: config.timing.max_age,
        events: config.events,
        clock,
        hosted: None,
    };
    let mut examination = Examination::new(setup, watched.collect(), terms.watch, stop);
    examination.ok(
        "file",
        format!("{} is right: {}", config.path.display(), config.bus.kind()),
    );
    config.bus.examine(&mut examination);
    let listens = !config.bus.complaints().is_empty() && !examination.has_failed();
    if listens && terms.wait > Nanos::ZERO {
        serve(config, terms.wait, clock, stop, &mut examination);
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

/// Serves the PLC for a while, and reports what it asked for in vain: the steps `client` and `requests`.
fn serve(
    config: &Config,
    wait: Nanos,
    clock: &Arc<dyn Clock>,
    stop: &Stop,
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
    while clock.now() < end && !stop.is_stopped() {
        driver.exchange(None, &mut slots);
        clock.wait_until(end.min(clock.now() + TICK), stop);
    }
    let count = |counter: &str| {
        let statistics = driver.statistics();
        let mut values = statistics.lines().filter_map(|line| line.split_once('='));
        let found = values.find(|(key, _)| *key == counter);
        let found = found.and_then(|(_, value)| value.parse::<u64>().ok());
        found.unwrap_or_default()
    };
    let accepted = count("clients.accepted");
    let mut complaints = Vec::new();
    for complaint in config.bus.complaints() {
        match count(complaint.counter) {
            0 => {}
            times => complaints.push((complaint, times)),
        }
    }
    driver.close();
    if accepted == 0 {
        examination.fail(
            "client",
            "nobody-connects",
            format!("nobody has connected within {wait}"),
            "check the address and port in the PLC, whether it is in RUN, and the firewall of this computer",
        );
        return;
    }
    examination.ok("client", format!("{accepted} connections within {wait}"));
    if complaints.is_empty() {
        examination.ok("requests", "all requests were answered");
    }
    for (complaint, times) in complaints {
        let evidence = format!("{} ({times} times)", complaint.what);
        examination.fail("requests", complaint.cause, evidence, complaint.next);
    }
}
