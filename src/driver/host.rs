//! A PLC program at the other end of a loopback: scanned by a thread of its own, or by the tick.

use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use crate::fieldbus::loopback::FreeLoopback;
use crate::fieldbus::{BusError, LinkState, LinkStatus, Port, Role, Stepped};
use crate::image::{BusEnd, Receiver, TickEnd, image};
use crate::plc::{Program, Scan};
use crate::signal::{Area, DataType, SignalTable};
use crate::time::{Clock, Nanos, Stop};

use super::Config;
use super::frames::directions;
use super::supervise::{BusThread, panic_text};

/// What the hosted program has seen and made, for comparison with the other end.
#[derive(Debug)]
pub(super) struct Tally {
    scans: AtomicU64,
    bits: Box<[Bit]>,
}

#[derive(Debug)]
struct Bit {
    name: String,
    area: Area,
    byte: usize,
    mask: u8,
    rises: AtomicU64,
}

impl Tally {
    fn new(table: &SignalTable) -> Self {
        let signals = table
            .signals
            .iter()
            .filter(|signal| signal.data_type == DataType::Bool);
        let bits = signals.map(|signal| Bit {
            name: signal.name.clone(),
            area: signal.area,
            byte: signal.byte,
            mask: 1 << signal.bit,
            rises: AtomicU64::new(0),
        });
        Self {
            scans: AtomicU64::new(0),
            bits: bits.collect(),
        }
    }

    /// Counts the rising edges from `before` to `now`.
    fn count(&self, area: Area, before: &[u8], now: &[u8]) {
        for bit in self.bits.iter().filter(|bit| bit.area == area) {
            if !before[bit.byte] & now[bit.byte] & bit.mask != 0 {
                bit.rises.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Appends one `plc.` line per count.
    pub(super) fn write(&self, text: &mut String) {
        let _ = writeln!(text, "plc.scans={}", self.scans.load(Ordering::Relaxed));
        for bit in &self.bits {
            let _ = writeln!(
                text,
                "plc.rises.{}={}",
                bit.name,
                bit.rises.load(Ordering::Relaxed)
            );
        }
    }
}

/// A program with the tick's end of its process image: a PLC without its bus.
struct Cpu {
    program: Box<dyn Program>,
    tick: TickEnd,
    inputs: Inputs,
    outputs: Box<[u8]>,
    outputs_before: Box<[u8]>,
    max_age: Nanos,
    tally: Arc<Tally>,
}

/// The inputs as the program sees them, and as it saw them a scan before.
struct Inputs {
    bytes: Box<[u8]>,
    before: Box<[u8]>,
}

impl Receiver for Inputs {
    fn levels(&mut self, bytes: &[u8]) {
        self.bytes.copy_from_slice(bytes);
    }

    fn edges(&mut self, _signal: usize, _count: u32) {}
}

impl Cpu {
    /// Inputs, program, outputs: one scan at `now`.
    fn scan(&mut self, now: Nanos) {
        let Self {
            program,
            tick,
            inputs,
            outputs,
            outputs_before,
            max_age,
            tally,
        } = self;
        let station = &mut tick.stations[0];
        inputs.before.copy_from_slice(&inputs.bytes);
        let arrival = station.read(now, inputs);
        tally.count(Area::Input, &inputs.before, &inputs.bytes);
        let alive = arrival.age <= *max_age;
        outputs_before.copy_from_slice(outputs);
        program.scan(&mut Scan {
            now,
            alive,
            inputs: &inputs.bytes,
            outputs,
        });
        tally.count(Area::Output, outputs_before, outputs);
        station.write(now, |frame| frame.copy_from_slice(outputs));
        tally.scans.fetch_add(1, Ordering::Relaxed);
    }
}

/// Makes the PLC's half: its processor, the bus's end of its image, and its tally.
fn plc(program: Box<dyn Program>, table: &SignalTable, max_age: Nanos) -> (Cpu, BusEnd) {
    let tally = Arc::new(Tally::new(table));
    let (tick, bus) = image(directions(table, Role::Controller));
    let station = &table.stations[0];
    let inputs = vec![0; station.input_bytes].into_boxed_slice();
    let outputs = vec![0; station.output_bytes].into_boxed_slice();
    let inputs = Inputs {
        before: inputs.clone(),
        bytes: inputs,
    };
    let cpu = Cpu {
        program,
        tick,
        inputs,
        outputs_before: outputs.clone(),
        outputs,
        max_age,
        tally,
    };
    (cpu, bus)
}

/// A hosted program on a thread of its own, with the bus thread of its end of the link; dropping it
/// stops both.
#[derive(Debug)]
pub(super) struct HostThread {
    tally: Arc<Tally>,
    fault: Arc<Mutex<Option<String>>>,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
    #[expect(dead_code, reason = "kept for its drop")]
    bus: BusThread,
}

impl HostThread {
    /// Starts scanning `program` every `interval`, with `bus` between it and the driver of `config`.
    pub(super) fn start(
        program: Box<dyn Program>,
        config: &Config,
        bus: FreeLoopback,
        interval: Nanos,
        clock: Arc<dyn Clock>,
    ) -> std::io::Result<Self> {
        let name = format!("plc {}", program.name());
        let (mut cpu, bus_end) = plc(program, &config.table, config.timing.max_age);
        let status = LinkStatus::new(&name);
        // A CPU whose program has died must not keep its last outputs on the bus.
        let watchdog = Some((interval + interval).max(config.timing.max_age));
        let port = Port::new(
            bus_end,
            Arc::clone(&clock),
            Role::Controller,
            watchdog,
            status.clone(),
        );
        let reconnect = config.timing.reconnect.clone();
        let bus = BusThread::start(Box::new(bus), port, reconnect, status, &name)?;
        let (tally, stop) = (Arc::clone(&cpu.tally), Stop::new());
        let fault = Arc::new(Mutex::new(None));
        let thread = std::thread::Builder::new().name(name).spawn({
            let (stop, fault) = (stop.clone(), Arc::clone(&fault));
            move || {
                let scans = || scan_until_stopped(&mut cpu, interval, &*clock, &stop);
                if let Err(panic) = catch_unwind(AssertUnwindSafe(scans)) {
                    let text = panic_text(&*panic).to_owned();
                    log::error!("the hosted PLC program panicked: {text}");
                    *fault.lock().unwrap_or_else(PoisonError::into_inner) = Some(text);
                }
            }
        })?;
        Ok(Self {
            tally,
            fault,
            stop,
            thread: Some(thread),
            bus,
        })
    }

    pub(super) fn tally(&self) -> &Tally {
        &self.tally
    }

    /// What the program's panic said, if it stopped by one.
    pub(super) fn fault(&self) -> Option<String> {
        self.fault
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Drop for HostThread {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(thread) = self.thread.take() {
            // Its panics are caught and recorded on the thread itself.
            let _ = thread.join();
        }
    }
}

fn scan_until_stopped(cpu: &mut Cpu, interval: Nanos, clock: &dyn Clock, stop: &Stop) {
    let mut deadline = clock.now();
    while !stop.is_stopped() {
        let now = clock.now();
        cpu.scan(now);
        // Like a PLC: a scan that comes late is late, and none is made up for.
        deadline = if deadline + interval > now {
            deadline + interval
        } else {
            now + interval
        };
        clock.wait_until(deadline, stop);
    }
}

/// The most scans that one exchange makes up for: 1,000 s of scans every 10 ms. A longer step is a wrong
/// time, and would keep the tick for as long as it takes to scan through it.
const MOST_SCANS: i64 = 100_000;

/// A hosted program that is scanned by the tick, on simulation time.
pub(super) struct SteppedHost {
    cpu: Cpu,
    port: Port,
    interval: Nanos,
    /// When the next scan is due; `None` before the first exchange.
    due: Option<Nanos>,
    /// One frame on its way from one port to the other.
    wire: Box<[u8]>,
}

impl SteppedHost {
    pub(super) fn new(
        program: Box<dyn Program>,
        table: &SignalTable,
        max_age: Nanos,
        interval: Nanos,
        clock: Arc<dyn Clock>,
    ) -> (Self, Arc<Tally>) {
        let (cpu, bus) = plc(program, table, max_age);
        let tally = Arc::clone(&cpu.tally);
        let status = LinkStatus::new(cpu.program.name());
        let port = Port::new(bus, clock, Role::Controller, None, status);
        let (tx, rx) = port.sizes(0);
        let wire = vec![0; tx.max(rx)].into();
        (
            Self {
                cpu,
                port,
                interval,
                due: None,
                wire,
            },
            tally,
        )
    }
}

/// Carries the frame that `from` sends over to `to`.
fn carry(from: &mut Port, to: &mut Port, now: Nanos, wire: &mut [u8]) {
    let frame = from.outgoing(0, now);
    let wire = &mut wire[..frame.len()];
    wire.copy_from_slice(frame);
    to.received(0, now, wire);
    from.sent(0);
}

impl Stepped for SteppedHost {
    fn exchange(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        port.enter(LinkState::Running, "the hosted program is there");
        carry(port, &mut self.port, now, &mut self.wire);
        let mut due = self.due.unwrap_or(now);
        if due + self.interval.times(MOST_SCANS) < now {
            self.due = Some(now);
            return Err(BusError::Refused(format!(
                "simulation time jumped from {due} to {now}, over more than {MOST_SCANS} scans of the \
                 hosted program; hand in the nanoseconds since the simulation began, tick by tick",
            )));
        }
        while due <= now {
            self.cpu.scan(due);
            due += self.interval;
        }
        self.due = Some(due);
        carry(&mut self.port, port, now, &mut self.wire);
        Ok(due)
    }
}
