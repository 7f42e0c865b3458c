//! A real PLC as a client of a run on virtual time: the gateway between its bus and the server.
//!
//! The PLC needs no library of ours. Two signals keep it in step: the gateway writes what the PLC reads and the time,
//! and with them a new value of `sync.go`; the PLC runs one step, and answers with the same value in `sync.done`. In
//! between it may take any time.

use std::num::NonZeroU32;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_bus_sdsp::{Variables, connect};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{Link, LinkState};
use tickbus_image::signal::{Area, DataType, Signal, Width};
use tickbus_plc::{Program, Scan};
use tickbus_virtual_time::{Declaration, Ended, Meeting, Outcome, Participant, Step};

use super::{DriverError, Host, Watch};

/// The signal whose new value begins a step of the PLC.
const GO: &str = "sync.go";

/// The signal with which the PLC tells that it has finished a step.
const DONE: &str = "sync.done";

/// The signal with the virtual time of a step, in milliseconds; it wraps, as the PLC's TIME does.
const TIME: &str = "sync.time";

/// How often the image is taken over.
const INTERVAL: Nanos = Nanos::from_micros(500);

/// One millisecond.
const MILLI: i64 = 1_000_000;

/// How a gateway takes part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GatewayOptions {
    /// The PLC's name in the run; by default that of the driver with " PLC" behind it.
    pub client: Option<String>,
    /// How many steps of the server one step of the PLC takes.
    pub multiple: NonZeroU32,
    /// How long the PLC may take for a step, and to appear at first.
    pub timeout: Nanos,
}

/// A real PLC, behind any bus on which it finds the machine's end, as a client of a run.
#[derive(Debug)]
pub struct Gateway {
    host: Host,
    desk: Arc<Desk>,
    declaration: Declaration,
    timeout: Nanos,
    clock: Arc<dyn Clock>,
    stop: Stop,
    inputs: Side,
    outputs: Side,
    /// The value of [`GO`] in the last step; `None` before the first.
    go: Option<u32>,
}

/// The frame of one direction and its signals.
#[derive(Debug)]
struct Side {
    variables: Variables,
    /// One per signal.
    slots: Vec<u64>,
    frame: Vec<u8>,
    /// The slots of those that are variables of the run.
    shared: Vec<usize>,
}

impl Side {
    fn new(config: &Config, area: Area) -> Self {
        let variables = Variables::new(&config.table, area, |signal| Some(signal.name.clone()));
        let names = variables.iter().enumerate();
        let shared = names.filter(|(_, variable)| ![GO, DONE, TIME].contains(&&*variable.name));
        let shared = shared.map(|(slot, _)| slot).collect();
        let slots = vec![0; variables.iter().len()];
        Self {
            shared,
            slots,
            frame: vec![0; config.table.stations[0].bytes(area)],
            variables,
        }
    }

    /// The slot of one of the signals that synchronise.
    fn slot(&mut self, name: &str) -> &mut u64 {
        let mut variables = self.variables.iter();
        let slot = variables.position(|variable| variable.name == name);
        &mut self.slots[slot.expect("checked when it was opened")]
    }
}

/// What the gateway and the scan of its image hand each other.
#[derive(Debug, Default)]
struct Desk {
    frames: Mutex<Frames>,
    /// Wakes the gateway when a scan is over.
    scanned: Stop,
}

#[derive(Debug, Default)]
struct Frames {
    /// To the PLC.
    inputs: Vec<u8>,
    /// From the PLC.
    outputs: Vec<u8>,
    /// The PLC has been heard.
    alive: bool,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, Frames> {
        // Frames are copied whole.
        self.frames.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What stands where a machine's program would.
#[derive(Debug)]
struct Desktop(Arc<Desk>);

impl Program for Desktop {
    fn name(&self) -> &'static str {
        "gateway"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        let mut frames = self.0.lock();
        scan.outputs.copy_from_slice(&frames.inputs);
        frames.outputs.copy_from_slice(scan.inputs);
        frames.alive = scan.alive;
        drop(frames);
        self.0.scanned.wake();
    }
}

impl Gateway {
    /// Opens the PLC's bus. When `stop` is stopped, the gateway waits no longer and leaves the run.
    ///
    /// # Errors
    ///
    /// The driver.cfg does not fit a gateway, or [`Host::open`] fails.
    pub fn open(
        config: &Config,
        options: GatewayOptions,
        clock: Arc<dyn Clock>,
        stop: &Stop,
    ) -> Result<Self, DriverError> {
        check(config).map_err(|mistake| DriverError::Fit {
            file: config.path.display().to_string(),
            mistake,
        })?;
        let inputs = Side::new(config, Area::Input);
        let outputs = Side::new(config, Area::Output);
        let name = options.client;
        let name = name.unwrap_or_else(|| format!("{} PLC", config.name));
        let variables = |side: &Side| {
            let all: Vec<_> = side.variables.iter().cloned().collect();
            side.shared
                .iter()
                .map(|slot| all[*slot].clone())
                .collect::<Vec<_>>()
        };
        let reads = variables(&inputs).into_iter();
        let declaration = Declaration {
            multiple: options.multiple,
            writes: variables(&outputs),
            reads: reads.map(|variable| variable.name).collect(),
            ..Declaration::new(name)
        };
        let desk = Arc::new(Desk {
            frames: Mutex::new(Frames {
                inputs: inputs.frame.clone(),
                outputs: outputs.frame.clone(),
                alive: false,
            }),
            scanned: Stop::new(),
        });
        let program = Box::new(Desktop(Arc::clone(&desk)));
        Ok(Self {
            host: Host::open(config, program, INTERVAL, Arc::clone(&clock))?,
            desk,
            declaration,
            timeout: options.timeout,
            clock,
            stop: stop.clone(),
            inputs,
            outputs,
            go: None,
        })
    }

    /// Waits until the PLC is there. Join the run afterwards, so that it does not begin without the PLC.
    ///
    /// # Errors
    ///
    /// It does not appear within the time-out, or the gateway was stopped.
    pub fn await_plc(&mut self) -> Result<(), String> {
        let is_there = |frames: &Frames, _: &mut Side| frames.alive;
        self.wait_until(is_there)?;
        // A PLC that was not restarted has finished steps before; and any new value would be one more.
        let done = *self.outputs.slot(DONE);
        *self.inputs.slot(GO) = done;
        self.publish();
        Ok(())
    }

    /// Takes part in the run of the server at `meeting`, as soon as that is there, until the run ends.
    ///
    /// # Errors
    ///
    /// The run was broken off, or the server did not appear within the time-out.
    pub fn take_part(&mut self, meeting: &Meeting) -> Result<Outcome, Ended> {
        let connection = connect(meeting, self.timeout, &self.declaration, &self.stop)?;
        connection.run(self)
    }

    /// As [`Host::fact`], of the PLC's bus.
    pub fn fact(&self, key: &'static str) -> Option<String> {
        self.host.fact(key)
    }

    /// The state of the PLC's line.
    pub fn link(&self) -> Link {
        self.host.link()
    }

    /// Lets another thread look at the PLC's signals; see [`Host::watch`].
    pub fn watch(&self) -> Option<Watch> {
        self.host.watch()
    }

    /// Closes the PLC's bus.
    pub fn close(self) {
        self.host.close();
    }

    /// Hands the inputs to the PLC's bus.
    fn publish(&mut self) {
        let Side {
            variables,
            slots,
            frame,
            ..
        } = &mut self.inputs;
        variables.set(slots);
        variables.give(0, frame);
        self.desk.lock().inputs.copy_from_slice(frame);
    }

    /// Waits until the PLC's outputs are as `is_right` wants them, which has them in the slots then.
    fn wait_until(
        &mut self,
        mut is_right: impl FnMut(&Frames, &mut Side) -> bool,
    ) -> Result<(), String> {
        let end = self.clock.now() + self.timeout;
        loop {
            let frames = self.desk.lock();
            let side = &mut self.outputs;
            side.variables.take(0, &frames.outputs);
            side.variables.get(&mut side.slots);
            if is_right(&frames, side) {
                return Ok(());
            }
            drop(frames);
            if self.stop.is_stopped() {
                return Err("it was stopped".to_owned());
            }
            if let Some(fault) = self.host.fault() {
                return Err(fault);
            }
            let now = self.clock.now();
            if now >= end {
                return Err(self.missing());
            }
            // Woken by the next scan.
            self.clock
                .wait_until((now + INTERVAL.times(100)).min(end), &self.desk.scanned);
        }
    }

    /// What is missing, for people.
    fn missing(&mut self) -> String {
        let (timeout, link) = (self.timeout, self.host.link());
        let go = self.go;
        let done = *self.outputs.slot(DONE);
        let Some(go) = go else {
            return format!("the PLC did not appear within {timeout}: {}", link.reason);
        };
        let line = match link.state {
            LinkState::Running => {
                "see whether it is in RUN, and its scheduler is called in each cycle".to_owned()
            }
            state => format!("the line is {}: {}", state.name(), link.reason),
        };
        format!(
            "the PLC did not finish its step within {timeout} ({GO} is {go}, {DONE} {done}); {line}"
        )
    }
}

impl Participant for Gateway {
    fn declare(&self) -> Declaration {
        self.declaration.clone()
    }

    fn initial(&mut self, _writes: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        let (millis, rest) = (step.time.0 / MILLI, step.time.0 % MILLI);
        if rest != 0 {
            return Err(format!(
                "the time of its step, {}, is no whole number of milliseconds, in which {TIME} counts; give it a \
                 --multiple that makes one, or the server another step",
                step.time
            ));
        }
        if self.go.is_none() {
            // As it is now: the PLC may have been restarted since it was awaited.
            self.wait_until(|_, _| true)?;
        }
        let go = self.go.unwrap_or_else(|| low(*self.outputs.slot(DONE)));
        let go = go.wrapping_add(1);
        self.go = Some(go);
        for (slot, read) in self.inputs.shared.iter().zip(reads) {
            self.inputs.slots[*slot] = *read;
        }
        *self.inputs.slot(TIME) = low(millis.cast_unsigned()).into();
        *self.inputs.slot(GO) = go.into();
        self.publish();
        self.wait_until(|_, outputs| low(*outputs.slot(DONE)) == go)?;
        for (slot, write) in self.outputs.shared.iter().zip(writes) {
            *write = self.outputs.slots[*slot];
        }
        Ok(())
    }
}

/// The low 32 bits.
#[expect(clippy::cast_possible_truncation, reason = "the low bits are meant")]
const fn low(word: u64) -> u32 {
    word as u32
}

/// Checks that a driver.cfg has the signals that synchronise, and none whose value depends on when it is looked at.
fn check(config: &Config) -> Result<(), Mistake> {
    let table = &config.table;
    for (name, area, what) in [
        (GO, Area::Input, "begins a step of the PLC"),
        (TIME, Area::Input, "has the virtual time in milliseconds"),
        (DONE, Area::Output, "tells that the PLC has finished a step"),
    ] {
        let right = format!(
            "add it as a UDINT in {area}, such as address = \"{area}D0\" and type = \"UDINT\": it {what}"
        );
        let Some(signal) = table.position(name).map(|at| &table.signals[at]) else {
            return Err(Mistake::new(
                format!("there is no signal \"{name}\""),
                right,
            ));
        };
        let fits = |signal: &Signal| {
            let data_type = signal.data_type;
            signal.area == area && data_type.width() == Width::Double && data_type != DataType::Real
        };
        if !fits(signal) {
            let found = (signal.data_type, signal.area);
            let what = format!("the signal \"{name}\" is a {} in {}", found.0, found.1);
            return Err(Mistake::new(what, right));
        }
    }
    let latched = table.signals.iter().find(|signal| signal.latch.is_some());
    if let Some(signal) = latched {
        return Err(Mistake::new(
            format!("the signal \"{}\" has a \"latch\"", signal.name),
            "remove it: in lock-step each value of each step is seen, and a latch shows a pulse in a later one",
        ));
    }
    Ok(())
}
