//! A program scanned at a fixed interval by its own thread.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::DriverError;
use crate::line::{Ends, FreeLine, Line, Owner};
use crate::real_time;
use crate::statistics::{BusFacts, Counters, Figures, ProgramCounters};
use crate::supervise::{BusThread, panic_text};
use crate::watch::Watch;
use tickbus_base::statistics::Statistics;
use tickbus_base::thread::Thread;
use tickbus_base::time::{Clock, Manual, Nanos, Pace, Stop};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{
    Bus, BusError, Free, Lead, LinkState, LinkStatus, MaxAge, Outputs, Port, Role, Stepped,
    SwallowedSignals,
};
use tickbus_image::Peers;
use tickbus_plc::{Program, Report};
use tickbus_record::Recorder;

use super::ScanCounters;
use super::cpu::{Cpu, half};
use super::own_end::OwnEnd;

/// The longest time that a scan can take before it counts as hung. A real PLC's watchdog trips far earlier.
const LONGEST_SCAN: Nanos = Nanos::from_secs(3);

/// The start of the current scan.
#[derive(Debug)]
struct Scanning(AtomicI64);

impl Scanning {
    /// Marks that no scan is running.
    const NONE: i64 = i64::MIN;

    fn set(&self, since: Option<Nanos>) {
        let since = since.map_or(Self::NONE, |since| since.0);
        self.0.store(since, Ordering::Relaxed);
    }

    /// Returns how long the current scan has taken, if that is too long.
    fn too_long(&self, now: Nanos) -> Option<Nanos> {
        let since = self.0.load(Ordering::Relaxed);
        let span = now - Nanos(since);
        (since != Self::NONE && span > LONGEST_SCAN).then_some(span)
    }
}

/// A program and its scan settings.
pub(crate) struct ScanSetup {
    pub(crate) program: Box<dyn Program>,
    pub(crate) interval: Nanos,
    /// True if a late scan counts as a broken line, so that fail-safe values replace the outputs.
    pub(crate) has_watchdog: bool,
    /// Records its scans.
    pub(crate) recorder: Option<Recorder>,
    /// Counts the changes that are swallowed at its end of the line.
    pub(crate) swallowed: SwallowedSignals,
    /// At the end that the driver.cfg describes: the owner of the line, and the program's watchdog, [`Nanos::MAX`] for
    /// none, which the owner may change.
    pub(crate) own: Option<(Box<dyn Owner>, MaxAge)>,
}

/// The counters and the state that a program's thread publishes.
#[derive(Debug)]
pub(crate) struct HostCounters {
    pub(crate) scan_counters: Arc<ScanCounters>,
    fault: Mutex<Option<String>>,
    scanning: Scanning,
    /// True if a scan that takes too long is a fault.
    can_hang: bool,
    report: Option<Arc<dyn Report>>,
    /// The clock of the line.
    pub(crate) clock: Arc<dyn Clock>,
    /// The clock that measures hung scans.
    wall: Arc<dyn Clock>,
}

/// A program on its own thread, with the bus thread of its end of the line; dropping this stops both.
#[derive(Debug)]
pub(crate) struct HostThread {
    pub(crate) counters: Arc<HostCounters>,
    pub(crate) figures: Figures,
    peers: Peers,
    /// Looks at the program's image, until someone takes it.
    pub(crate) watch: Mutex<Option<Watch>>,
    stop: Stop,
    thread: Option<Thread>,
    /// `None` if the program's thread steps the bus.
    bus: Option<HostBus>,
}

/// The bus thread of a program.
#[derive(Debug)]
enum HostBus {
    /// At the end that the driver.cfg describes.
    Own(FreeLine),
    /// At the other end.
    #[expect(dead_code, reason = "kept for its drop")]
    Other(BusThread),
}

impl HostThread {
    /// Starts scanning the `hosted` program as the end with `role`; the bus connects it to its peer. A free bus has a
    /// thread of its own, and scans have a fixed interval. A stepped one hands out the time, and waits no longer once the
    /// stop is stopped; `wall` then only detects a hung scan.
    pub(crate) fn start(
        hosted: ScanSetup,
        (config, role): (&Config, Role),
        (bus, stop): (Bus, Stop),
        wall: Arc<dyn Clock>,
    ) -> Result<Self, DriverError> {
        let name = &format!("plc {}", hosted.program.name());
        let (max_age, interval) = (config.timing.max_age, hosted.interval);
        let (report, can_hang) = (hosted.program.report(), hosted.program.can_hang());
        let (mut cpu, bus_end) = half(hosted.program, (config, role), hosted.swallowed.counts());
        let status = LinkStatus::new(name, max_age);
        // The faults in a driver.cfg apply to its own end, not to a program behind its bus. The same is true of a
        // `Watch`.
        let is_own = role == config.role;
        let watchdog = watchdog(config, (is_own, role), interval);
        let watchdog = watchdog.filter(|_| hosted.has_watchdog);
        let virtual_time = Manual::new();
        let (clock, limit) = match &bus {
            Bus::Free(_) => (Arc::clone(&wall), watchdog),
            Bus::Stepped(_) => (Arc::clone(&virtual_time) as _, None),
        };
        let board = Arc::<FaultBoard>::default();
        let mut port = Port::new(bus_end, Arc::clone(&clock), role, limit, status.clone())
            .with_faults(Arc::clone(&board));
        let counters = Arc::new(HostCounters {
            scan_counters: Arc::clone(&cpu.scan_counters),
            fault: Mutex::new(None),
            scanning: Scanning(AtomicI64::new(Scanning::NONE)),
            can_hang,
            report,
            clock,
            wall,
        });
        let peers = cpu.peers().clone();
        let figures = Figures {
            status: status.clone(),
            board: Arc::clone(&board),
            swallowed: hosted.swallowed.clone(),
            program: ProgramCounters::new(Some(Arc::clone(&counters) as _)),
            record: hosted.recorder.as_ref().map(|it| Arc::clone(it.counters())),
            bus: BusFacts::of(config),
        };
        let mut watch = None;
        if is_own {
            port = port.with_swallowed(hosted.swallowed);
            let (config, clock) = (Arc::new(config.clone()), Arc::clone(&counters.clock));
            let seen = (figures.clone(), hosted.recorder.as_ref());
            let (tap, own) = Watch::new(Arc::clone(&config), clock, seen, false);
            watch = Some(own);
            let end = OwnEnd::new(config, &board, tap, hosted.recorder);
            let mut end = end.map_err(DriverError::Fault)?;
            (end.max_age, cpu.max_age) = (status.limit(), status.limit());
            cpu.own = Some(end);
        }
        let ends = ends_of(name, &counters, &figures);
        let (owner, pause) = match hosted.own {
            Some((owner, pause)) => (Some(owner), pause),
            None => (None, MaxAge::new(watchdog.unwrap_or(Nanos::MAX))),
        };
        let (scanned, stopped) = (Arc::clone(&counters), stop.clone());
        let (bus, mut scans): (_, Box<dyn FnMut() -> Result<(), String> + Send>) = match bus {
            Bus::Free(bus) => {
                let (real_time, scanning) = (config.real_time, status.clone());
                let swallowed = figures.swallowed.clone();
                let bus = start_bus((bus, port), (config, role), (ends, owner), swallowed)?;
                let scans = move || {
                    real_time::begin(real_time, "the PLC program", &scanning, &*scanned.wall);
                    scan_until_stopped(&mut cpu, (interval, &pause), &stopped, &scanned);
                    Ok(())
                };
                (Some(bus), Box::new(scans))
            }
            Bus::Stepped(mut bus) => {
                let mut port = ends.equipped_as(role, port, config);
                let scans = move || {
                    let line = (&mut *bus, &mut port, &*virtual_time);
                    let ended = scan_in_steps(&mut cpu, line, &scanned, &stopped);
                    ended.map_err(|error| {
                        let reason = error.to_string();
                        let (now, cause) = (virtual_time.now(), (&error).into());
                        status.enter(now, LinkState::Failed, cause, &reason);
                        reason
                    })
                };
                (None, Box::new(scans))
            }
        };
        let scanned = Arc::clone(&counters);
        let spawned = Thread::spawn(&*counters.wall, name, move || {
            let result = catch_unwind(AssertUnwindSafe(&mut scans));
            scanned.scanning.set(None);
            // Dropping the bus can send a farewell to the peer, and closing waits for that.
            drop(scans);
            if let Some(fault) = fault_of(result) {
                *scanned.lock_fault() = Some(fault);
            }
        });
        let thread = spawned.map_err(|source| DriverError::no_thread("the PLC program", source))?;
        Ok(Self {
            counters,
            figures,
            peers,
            watch: Mutex::new(watch),
            stop,
            thread: Some(thread),
            bus,
        })
    }
}

/// Returns the end of a line that a program scans.
fn ends_of(name: &str, counters: &HostCounters, figures: &Figures) -> Ends {
    Ends {
        name: name.to_owned(),
        clock: Arc::clone(&counters.wall),
        status: figures.status.clone(),
        bus_facts: figures.bus.clone(),
        reports_events: false,
    }
}

/// Starts the bus thread of the end with `role`, which has an owner if it is the one that the driver.cfg describes.
fn start_bus(
    (bus, port): (Box<dyn Free>, Port),
    (config, role): (&Config, Role),
    (ends, owner): (Ends, Option<Box<dyn Owner>>),
    swallowed: SwallowedSignals,
) -> Result<HostBus, DriverError> {
    if let Some(owner) = owner {
        let config = Arc::new(config.clone());
        let line = FreeLine::start(&config, (bus, port), (None, swallowed), (ends, owner))?;
        return Ok(HostBus::Own(line));
    }
    // The machine at the other end of this line closes with the program.
    let mut config = config.clone();
    (config.timing.at_close, config.timing.while_stale) = (Outputs::Hold, Outputs::Hold);
    let port = ends.equipped_as(role, port, &config);
    Ok(HostBus::Other(ends.start(&config, bus, port)?))
}

/// Returns why scanning ended, if it should not have ended.
fn fault_of(result: std::thread::Result<Result<(), String>>) -> Option<String> {
    match result {
        Ok(ended) => ended.err(),
        Err(panic) => {
            let text = format!("the PLC program panicked: {}", panic_text(&*panic));
            log::error!("{text}");
            Some(text)
        }
    }
}

/// Returns how long a program can pause between two scans: a CPU whose program has died must not keep its last outputs
/// on the bus.
pub(crate) fn watchdog(
    config: &Config,
    (is_own_end, role): (bool, Role),
    interval: Nanos,
) -> Option<Nanos> {
    let two_scans = interval + interval;
    match config.timing.watchdog.filter(|_| is_own_end) {
        Some(stated) => Some(stated.max(two_scans)),
        None if is_own_end && role == Role::Controller => None,
        None => Some(two_scans.max(config.timing.max_age)),
    }
}

impl Counters for HostCounters {
    /// Adds the program's counters, and its fault.
    fn write(&self, statistics: &mut Statistics) {
        self.scan_counters.write(statistics);
        if let Some(report) = &self.report {
            report.write(statistics);
        }
        if let Some(fault) = self.fault() {
            statistics.text("plc.fault", &fault);
        }
    }
}

impl HostCounters {
    pub(crate) fn fault(&self) -> Option<String> {
        let too_long = self.scanning.too_long(self.wall.now());
        if let Some(span) = too_long.filter(|_| self.can_hang) {
            let span = span.rounded();
            return Some(format!("the PLC program has been in one scan for {span}"));
        }
        self.lock_fault().clone()
    }

    fn lock_fault(&self) -> MutexGuard<'_, Option<String>> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl HostThread {
    /// Returns the line, if its bus has a thread and the driver.cfg describes this end.
    pub(crate) fn line(&self) -> Option<Line> {
        match &self.bus {
            Some(HostBus::Own(line)) => Some(line.handle()),
            Some(HostBus::Other(_)) | None => None,
        }
    }

    /// Checks the state of the line, in case the bus itself cannot, and returns the time. In the steps of a bus, only the
    /// bus knows whether data are late.
    pub(crate) fn observe(&self) -> Nanos {
        let now = self.counters.clock.now();
        if self.bus.is_some() {
            self.figures.status.observe(now, self.peers.ages(now));
        }
        now
    }

    /// Returns true if the program is no longer scanned, for whatever reason.
    pub(crate) fn is_over(&self) -> bool {
        !self.thread.as_ref().is_some_and(Thread::is_running)
    }

    /// Stops scanning. If the program did not end, returns why; its thread is then left behind.
    pub(crate) fn end(&mut self) -> Option<String> {
        let thread = self.thread.take()?;
        self.stop.stop();
        if !thread.join_within(&*self.counters.wall, LONGEST_SCAN) {
            let why = format!("the PLC program's scan did not end within {LONGEST_SCAN}");
            log::error!("{why}, and its thread is left behind");
            return Some(why);
        }
        None
    }
}

impl Drop for HostThread {
    fn drop(&mut self) {
        self.end();
    }
}

fn scan_until_stopped(
    cpu: &mut Cpu,
    (interval, watchdog): (Nanos, &MaxAge),
    stop: &Stop,
    HostCounters {
        clock, scanning, ..
    }: &HostCounters,
) {
    // As in a PLC: a late scan stays late, and missed scans are not made up for.
    let mut pace = Pace::new(clock.now(), interval);
    let mut last = None;
    while !stop.is_stopped() {
        let now = clock.now();
        if pace.take(now) {
            scanning.set(Some(now));
            let limit = watchdog.get();
            cpu.scan(now, last.is_none_or(|last| now - last <= limit));
            last = Some(now);
            scanning.set(None);
        }
        clock.wait_until(pace.due(), stop);
    }
}

/// Scans once in each step that the bus hands out, until its proper end.
fn scan_in_steps(
    cpu: &mut Cpu,
    (bus, port, time): (&mut (dyn Stepped + 'static), &mut Port, &Manual),
    HostCounters { wall, scanning, .. }: &HostCounters,
    stop: &Stop,
) -> Result<(), BusError> {
    while !stop.is_stopped() {
        let now = time.now();
        let next = match bus.receive(now, port) {
            // The bus was stopped.
            Err(_) if stop.is_stopped() => return Ok(()),
            received => received?,
        };
        if bus.lead() == Lead::Ended {
            return Ok(());
        }
        scanning.set(Some(wall.now()));
        cpu.scan(now, true);
        scanning.set(None);
        bus.send(now, port)?;
        time.set(next);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
