//! A real PLC as a client of a run on virtual time: the gateway between its bus and the server.
//!
//! The PLC needs no library of ours. Two signals keep it in step: the gateway writes what the PLC reads and the time,
//! and with them a new value of `sync.go`; the PLC runs one step, and answers with the same value in `sync.done`. In
//! between it may take any time. A bus that transfers them in several requests can have a second copy of each at the
//! other end of the block: a value counts when both copies agree.

use std::num::NonZeroU32;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_bus_sdsp::{Variables, connect};
use tickbus_driver::{DriverError, Host, Watch};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{Link, LinkState};
use tickbus_image::signal::{Area, DataType, Signal, Width};
use tickbus_plc::{Program, Scan};
use tickbus_virtual_time::{Declaration, Ended, Meeting, Outcome, Participant, Step};

/// The signal whose new value begins a step of the PLC.
const GO: &str = "sync.go";

/// The signal with which the PLC tells that it has finished a step.
const DONE: &str = "sync.done";

/// The second copy of [`GO`], behind what the PLC reads, if there is one.
const GO_END: &str = "sync.go_end";

/// The second copy of [`DONE`], in front of or behind what the PLC writes, if there is one.
const DONE_END: &str = "sync.done_end";

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
        let own = [GO, GO_END, DONE, DONE_END, TIME];
        let shared = names.filter(|(_, variable)| !own.contains(&&*variable.name));
        let shared = shared.map(|(slot, _)| slot).collect();
        let slots = vec![0; variables.iter().len()];
        Self {
            shared,
            slots,
            frame: vec![0; config.table.stations[0].bytes(area)],
            variables,
        }
    }

    /// The slot of one of the signals that synchronise, if there is such a signal.
    fn slot(&mut self, name: &str) -> Option<&mut u64> {
        let mut variables = self.variables.iter();
        let slot = variables.position(|variable| variable.name == name);
        slot.map(|slot| &mut self.slots[slot])
    }

    /// Sets one of them.
    fn set(&mut self, name: &str, value: u32) {
        if let Some(slot) = self.slot(name) {
            *slot = value.into();
        }
    }

    /// The value of [`DONE`], unless a second copy has another one.
    fn done(&mut self) -> Option<u32> {
        let done = self.slot(DONE).map(|slot| low(*slot))?;
        let copy = self.slot(DONE_END).map(|slot| low(*slot));
        copy.is_none_or(|copy| copy == done).then_some(done)
    }
}

/// The values that the gateway and the scan of its image hand to each other.
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

/// The stand-in for the machine's program.
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
            // On a busy computer scans come late. The PLC waits for the next step then, and must not read other values.
            host: Host::open_patient(config, program, INTERVAL, Arc::clone(&clock))?,
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
        let done = self.wait_for(|frames, side| side.done().filter(|_| frames.alive))?;
        // A PLC that was not restarted has finished steps before.
        self.set_go(done);
        self.publish();
        Ok(())
    }

    fn set_go(&mut self, go: u32) {
        self.inputs.set(GO, go);
        self.inputs.set(GO_END, go);
    }

    /// Takes part in the run of the server at `meeting`, as soon as that is there, until the run ends.
    ///
    /// # Errors
    ///
    /// The run was broken off, or the server did not appear within the time-out.
    pub fn take_part(&mut self, meeting: &Meeting) -> Result<Outcome, Ended> {
        let connection = connect(
            (meeting, &self.clock),
            self.timeout,
            &self.declaration,
            &self.stop,
        )?;
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

    /// Waits until `look` finds something in the PLC's outputs, which are in the slots then.
    fn wait_for<T>(
        &mut self,
        mut look: impl FnMut(&Frames, &mut Side) -> Option<T>,
    ) -> Result<T, String> {
        let end = self.clock.now() + self.timeout;
        loop {
            let frames = self.desk.lock();
            let side = &mut self.outputs;
            side.variables.take(0, &frames.outputs);
            side.variables.get(&mut side.slots);
            if let Some(found) = look(&frames, side) {
                return Ok(found);
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

    /// The missing parts, as text for users.
    fn missing(&mut self) -> String {
        let (timeout, link) = (self.timeout, self.host.link());
        let go = self.go;
        let done = |side: &mut Side, name| side.slot(name).map_or(0, |slot| *slot);
        let done = match self.outputs.done() {
            Some(done) => format!("{DONE} {done}"),
            None => format!(
                "{DONE} {} but {DONE_END} {}",
                done(&mut self.outputs, DONE),
                done(&mut self.outputs, DONE_END)
            ),
        };
        let Some(go) = go else {
            return format!("the PLC did not appear within {timeout}: {}", link.reason);
        };
        let line = match link.state {
            LinkState::Running => {
                "see whether it is in RUN, and its scheduler is called in each cycle".to_owned()
            }
            state => format!("the line is {}: {}", state.name(), link.reason),
        };
        format!("the PLC did not finish its step within {timeout} ({GO} is {go}, {done}); {line}")
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
        let last = match self.go {
            Some(go) => go,
            // As it is now: the PLC may have been restarted since it was awaited.
            None => self.wait_for(|_, side| side.done())?,
        };
        // 0 is what a PLC reads where no gateway is.
        let go = last.checked_add(1).unwrap_or(1);
        self.go = Some(go);
        for (slot, read) in self.inputs.shared.iter().zip(reads) {
            self.inputs.slots[*slot] = *read;
        }
        self.inputs.set(TIME, low(millis.cast_unsigned()));
        self.set_go(go);
        self.publish();
        self.wait_for(|_, outputs| (outputs.done()? == go).then_some(()))?;
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
    for (name, area, is_needed, what) in [
        (GO, Area::Input, true, "begins a step of the PLC"),
        (
            TIME,
            Area::Input,
            true,
            "has the virtual time in milliseconds",
        ),
        (
            DONE,
            Area::Output,
            true,
            "tells that the PLC has finished a step",
        ),
        (GO_END, Area::Input, false, "repeats sync.go"),
        (DONE_END, Area::Output, false, "repeats sync.done"),
    ] {
        let right = format!(
            "add it as a UDINT in {area}, such as address = \"{area}D0\" and type = \"UDINT\": it {what}"
        );
        let Some(signal) = table.position(name).map(|at| &table.signals[at]) else {
            if !is_needed {
                continue;
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Monotonic;
    use tickbus_driver::Driver;
    use tickbus_driver_cfg::Kinds;

    const LINE: &str = "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"loopback\"\ncycle = \"100us\"\n\
        max_age = \"80ms\"\nlink = \"starved\"\n";

    const SIGNALS: [(&str, &str); 5] = [
        ("sync.go", "%ID0"),
        ("sync.time", "%ID4"),
        ("sync.go_end", "%ID8"),
        ("sync.done", "%QD0"),
        ("sync.done_end", "%QD4"),
    ];

    fn config(role: &str) -> Config {
        let mut text = format!("{LINE}role = \"{role}\"\n");
        if role == "controller" {
            // A real PLC holds its answer; this one is not to begin again at 0 when its own data become stale.
            text.push_str("while_stale = \"hold\"\n");
        }
        for (name, address) in SIGNALS {
            let lines = [
                format!("name = \"{name}\""),
                format!("address = \"{address}\""),
            ];
            text.extend(["[[signal]]\n", &lines.join("\n"), "\ntype = \"UDINT\"\n"]);
        }
        Config::parse("driver.cfg", &text, &Kinds::LOOPBACK)
            .unwrap_or_else(|wrong| panic!("{wrong}"))
    }

    #[test]
    fn a_plc_reads_the_same_step_while_the_scans_of_the_gateway_are_starved() {
        let clock = Monotonic::shared();
        let mut plc = Driver::open(config("controller"), Arc::clone(&clock) as _).expect("opens");
        let stop = Stop::new();
        let mut slots = plc.initial_slots();
        let mut tick = |done: (f64, f64)| {
            slots[3] = tickbus_image::signal::Slot::from_real(done.0);
            slots[4] = tickbus_image::signal::Slot::from_real(done.1);
            plc.exchange(clock.now(), &mut slots);
            clock.wait_until(clock.now() + INTERVAL, &stop);
            (slots[0].real(), slots[2].real())
        };
        // One copy of the answer alone does not count: the gateway is not to begin with 387.
        tick((386.0, 385.0));
        let options = GatewayOptions {
            client: None,
            multiple: NonZeroU32::MIN,
            timeout: Nanos::from_secs(20),
        };
        let mut gateway = Gateway::open(&config("device"), options, Arc::clone(&clock) as _, &stop)
            .expect("opens");
        std::thread::scope(|scope| {
            let desk = Arc::clone(&gateway.desk);
            let step = scope.spawn(move || {
                gateway.await_plc().expect("the PLC is there");
                let step = Step {
                    sequence: 1,
                    time: Nanos::ZERO,
                };
                gateway.run(step, &[], &mut []).expect("the PLC answers");
                gateway.close();
            });
            while tick((385.0, 385.0)) != (386.0, 386.0) {
                assert!(!step.is_finished(), "the step was not waited for");
            }
            {
                let _starved = desk.lock();
                let end = clock.now() + Nanos::from_millis(200);
                while clock.now() < end {
                    assert_eq!(tick((385.0, 385.0)), (386.0, 386.0));
                }
            }
            while !step.is_finished() {
                tick((386.0, 386.0));
            }
            step.join().expect("it was in step");
        });
    }
}
