//! Opening a driver, and closing it.

use std::sync::Arc;

use crate::fieldbus::loopback::{self, FreeLoopback, Mode, Peer, SteppedLoopback, private_link};
use crate::fieldbus::{Bus, ChangeEvents, LinkState, LinkStatus, Options, Port, Role, Stepped};
use crate::image::{Consumer, Event, image};
use crate::plc;
use crate::signal::Slot;
use crate::time::{Clock, CoarseTime, Nanos};

use super::frames::{areas, directions};
use super::host::{HostThread, SteppedHost, Tally};
use super::station::Station;
use super::supervise::BusThread;
use super::{Code, Config, Counters, SlotMap};

/// The bus cycle of a loopback whose driver.cfg names none.
const LOOPBACK_CYCLE: Nanos = Nanos::from_millis(1);

/// An open driver: one device, or one controller, on its bus.
#[derive(Debug)]
pub struct Driver {
    pub(super) config: Config,
    pub(super) slots: SlotMap,
    pub(super) stations: Vec<Station>,
    pub(super) line: Line,
    pub(super) time: CoarseTime,
    #[expect(dead_code, reason = "the coarse time stands still without its clock")]
    clock: Arc<dyn Clock>,
    pub(super) max_age: Nanos,
    pub(super) status: LinkStatus,
    pub(super) counters: Counters,
    events: Consumer,
    program: Option<Program>,
}

/// Where the bus runs.
pub(super) enum Line {
    /// On a thread of its own; dropping it ends that.
    #[expect(dead_code, reason = "kept for its drop")]
    Free(BusThread),
    /// On the tick.
    Stepped { bus: Box<dyn Stepped>, port: Port },
}

impl std::fmt::Debug for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Free(_) => "Free",
            Self::Stepped { .. } => "Stepped",
        })
    }
}

/// The PLC program hosted at the other end.
#[derive(Debug)]
enum Program {
    Thread(HostThread),
    Stepped(Arc<Tally>),
}

/// Why a driver cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// The system refused a thread.
    #[error(
        "the system refused a thread for the bus: {0}; close other programs or raise the limit"
    )]
    Thread(#[from] std::io::Error),
    /// The hosted program does not exist, or does not take its options.
    #[error("{file}: {source}")]
    Program {
        /// The driver.cfg.
        file: String,
        /// What is wrong with it.
        source: plc::ProgramError,
    },
    /// What the program needs and what the signal table has do not fit.
    #[error("{0}")]
    Config(String),
}

impl DriverError {
    /// The status code for it.
    pub fn code(&self) -> Code {
        match self {
            Self::Thread(_) => Code::BusFailed,
            Self::Program { .. } | Self::Config(_) => Code::BadConfig,
        }
    }
}

impl Driver {
    /// Opens the driver that `config` describes. A free bus starts on a thread of its own and keeps
    /// trying until its peer is there; opening does not wait for it.
    ///
    /// # Errors
    ///
    /// The hosted program and the signal table do not fit, or the system refused a thread.
    pub fn open(config: Config, clock: Arc<dyn Clock>) -> Result<Self, DriverError> {
        let (tx, rx) = areas(config.role);
        let directions = directions(&config.table, config.role);
        let fail_safe: Vec<_> = directions
            .iter()
            .map(|one| one.rx_fail_safe.clone())
            .collect();
        let (tick, bus_end) = image(directions);
        let status = LinkStatus::new(&config.name);
        let watchdog = config.timing.watchdog;
        let mut port = Port::new(
            bus_end,
            Arc::clone(&clock),
            config.role,
            watchdog,
            status.clone(),
        );
        let Options::Loopback(options) = &config.bus;
        if options.events {
            let stations = 0..config.table.stations.len();
            port.watch_changes(
                stations
                    .map(|station| ChangeEvents::new(&config.table, station, rx))
                    .collect(),
            );
        }
        let (bus, program) = open_loopback(&config, options, &port, &clock)?;
        let line = match bus {
            Bus::Free(bus) => {
                let reconnect = config.timing.reconnect.clone();
                Line::Free(BusThread::start(
                    bus,
                    port,
                    reconnect,
                    status.clone(),
                    &config.name,
                )?)
            }
            Bus::Stepped(bus) => Line::Stepped { bus, port },
        };
        let stations = tick.stations.into_iter().zip(fail_safe).enumerate();
        let stations = stations
            .map(|(index, (tick, fail_safe))| {
                Station::new(tick, &config.table, index, (tx, rx), fail_safe)
            })
            .collect();
        Ok(Self {
            slots: SlotMap::new(&config.table, config.role),
            stations,
            line,
            time: clock.coarse(),
            clock,
            max_age: config.timing.max_age,
            status,
            counters: Counters::default(),
            events: tick.events,
            program,
            config,
        })
    }

    /// What the driver was opened with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Where each value stands among the slots.
    pub fn slots(&self) -> &SlotMap {
        &self.slots
    }

    /// Slots as they are before the first exchange: every signal at its fail-safe value.
    pub fn initial_slots(&self) -> Vec<Slot> {
        let mut slots = vec![Slot::default(); self.slots.count];
        for (slot, signal) in slots.iter_mut().zip(&self.config.table.signals) {
            *slot = signal.fail_safe;
        }
        slots
    }

    /// What was counted, and how the line is doing, as one `key=value` per line.
    pub fn statistics(&self) -> String {
        use std::fmt::Write as _;

        let cycles: u64 = self.stations.iter().map(Station::cycles).sum();
        let mut text = self.counters.to_string();
        let (state, reason) = (self.status.state().name(), one_line(&self.status.reason()));
        let lost = self.events.lost();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "bus_cycles={cycles}\nevents_lost={lost}\nstate={state}\nreason={reason}\n"
        );
        match &self.program {
            Some(Program::Thread(host)) => {
                host.tally().write(&mut text);
                if let Some(fault) = host.fault() {
                    let _ = writeln!(text, "plc.fault={}", one_line(&fault));
                }
            }
            Some(Program::Stepped(tally)) => tally.write(&mut text),
            None => {}
        }
        text
    }

    /// Takes the oldest events, as many as fit; gives how many it took.
    pub fn poll_events(&mut self, into: &mut [Event]) -> usize {
        let mut taken = 0;
        while let Some(place) = into.get_mut(taken) {
            match self.events.pop() {
                Some(event) => *place = event,
                None => break,
            }
            taken += 1;
        }
        taken
    }

    /// Closes the driver: stops its threads and waits for their end.
    pub fn close(self) {
        let status = self.status.clone();
        drop(self);
        status.enter(LinkState::Closed, "closed");
    }
}

/// A text with its line breaks as spaces: the text of a panic often has some.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn open_loopback(
    config: &Config,
    options: &loopback::Options,
    port: &Port,
    clock: &Arc<dyn Clock>,
) -> Result<(Bus, Option<Program>), DriverError> {
    let cycle = config.timing.cycle.unwrap_or(LOOPBACK_CYCLE);
    let max_age = config.timing.max_age;
    let (name, program_options, scan) = match (&options.peer, options.mode) {
        (Peer::Link(name), Mode::Free) => {
            return Ok((Bus::Free(Box::new(FreeLoopback::named(name, cycle))), None));
        }
        (Peer::Link(name), Mode::Stepped) => {
            return Ok((Bus::Stepped(Box::new(SteppedLoopback::named(name))), None));
        }
        (
            Peer::Program {
                name,
                options,
                scan,
            },
            _,
        ) => (name, options, *scan),
    };
    let file = || config.path.display().to_string();
    let program = plc::program(name, program_options).map_err(|source| DriverError::Program {
        file: file(),
        source,
    })?;
    check_fit(config, &*program)
        .map_err(|what| DriverError::Config(format!("{}: {what}", file())))?;
    let clock = Arc::clone(clock);
    if options.mode == Mode::Stepped {
        let (host, tally) = SteppedHost::new(program, &config.table, max_age, scan, clock);
        return Ok((Bus::Stepped(Box::new(host)), Some(Program::Stepped(tally))));
    }
    let (device, controller) = private_link(&[port.sizes(0)]);
    let bus = |end| FreeLoopback::over(end, cycle);
    let host = HostThread::start(program, config, bus(controller), scan, clock)?;
    Ok((
        Bus::Free(Box::new(bus(device))),
        Some(Program::Thread(host)),
    ))
}

/// Whether the program finds the image that it needs.
fn check_fit(config: &Config, program: &dyn plc::Program) -> Result<(), String> {
    let name = program.name();
    let [station] = &config.table.stations[..] else {
        return Err(format!(
            "the PLC program \"{name}\" serves one station, but this driver has {}; use one \
             driver.cfg per station",
            config.table.stations.len()
        ));
    };
    if config.role != Role::Device {
        return Err(format!(
            "the PLC program \"{name}\" is the controller of its link, so this driver must have \
             role = \"device\""
        ));
    }
    for (area, has, needs) in [
        ("%I", station.input_bytes, program.input_bytes()),
        ("%Q", station.output_bytes, program.output_bytes()),
    ] {
        if has < needs {
            return Err(format!(
                "the PLC program \"{name}\" works on {needs} bytes of {area}, but the signals of \
                 this driver cover {has}; complete the signal table"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Manual;

    #[test]
    fn statistics_have_one_line_per_key_whatever_the_reason_says() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\n\
                    link = \"statistics\"\nmode = \"stepped\"\n\
                    [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n";
        let config = Config::parse("driver.cfg", text).expect("a right driver.cfg");
        let driver = Driver::open(config, Manual::new()).expect("opens");
        driver.status.enter(
            LinkState::Failed,
            "assertion `left == right` failed\n  left: 1\n right: 2",
        );
        let statistics = driver.statistics();
        assert!(
            statistics.contains("\nreason=assertion `left == right` failed left: 1 right: 2\n"),
            "{statistics}"
        );
        assert!(
            statistics.lines().all(|line| line.contains('=')),
            "{statistics}"
        );
    }
}
