//! A PLC program at an end of a bus: scanned by a thread of its own, or by the simulation's tick.

use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver as EndReceiver, RecvTimeoutError::Timeout, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use crate::faults::{Board, Injected};
use crate::fieldbus::{Bus, BusError, Free, Link, LinkStatus, Port, Role, Stepped};
use crate::image::{BusEnd, Receiver, TickEnd, image};
use crate::plc::{Program, Report, Scan};
use crate::record;
use crate::signal::{Area, DataType, SignalTable};
use crate::time::{Clock, Manual, Nanos, Pace, Spans, Stop};

use super::bus;
use super::faults::FrameFaults;
use super::frames::{area_bytes, directions};
use super::supervise::{BusThread, panic_text};
use super::tape::Tape;
use super::{Code, Config, DriverError};

/// What the hosted program has seen and made, for comparison with the other end.
#[derive(Debug)]
pub(super) struct Tally {
    scans: AtomicU64,
    /// Scans that found the data stale.
    stale: AtomicU64,
    /// Age of the data that the scans found.
    age: Mutex<Spans>,
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
            stale: AtomicU64::new(0),
            age: Mutex::new(Spans::new()),
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

    /// Takes down a scan whose data were of `age`.
    fn scanned(&self, age: Nanos, alive: bool) {
        self.scans.fetch_add(1, Ordering::Relaxed);
        if alive {
            self.lock_age().record(age);
        } else {
            self.stale.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn lock_age(&self) -> MutexGuard<'_, Spans> {
        // A histogram is whole between any two of its changes.
        self.age.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Appends one `plc.` line per count.
    pub(super) fn write(&self, text: &mut String) {
        let _ = writeln!(text, "plc.scans={}", self.scans.load(Ordering::Relaxed));
        let _ = writeln!(text, "plc.stale={}", self.stale.load(Ordering::Relaxed));
        self.lock_age().write("plc.age", text);
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
    /// The areas that it writes and reads.
    areas: (Area, Area),
    tally: Arc<Tally>,
    /// The faults to inject at this end.
    faults: Option<FrameFaults>,
    tape: Option<Tape>,
}

/// The inputs as the program sees them, and as it saw them a scan before.
struct Inputs {
    bytes: Box<[u8]>,
    before: Box<[u8]>,
}

/// Takes the inputs over, and their edges where they are recorded.
struct Taking<'a> {
    inputs: &'a mut Inputs,
    tape: Option<&'a mut Tape>,
}

impl Receiver for Taking<'_> {
    fn levels(&mut self, bytes: &[u8]) {
        self.inputs.bytes.copy_from_slice(bytes);
    }

    fn edges(&mut self, signal: usize, count: u32) {
        if let Some(tape) = &mut self.tape {
            tape.edges(signal, count);
        }
    }
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
            areas: (writes, reads),
            tally,
            faults,
            tape,
        } = self;
        let station = &mut tick.stations[0];
        inputs.before.copy_from_slice(&inputs.bytes);
        if let Some(faults) = faults {
            faults.begin_scan(now, &mut inputs.bytes, outputs);
        }
        let arrival = station.read(
            now,
            &mut Taking {
                inputs,
                tape: tape.as_mut(),
            },
        );
        if let Some(faults) = faults {
            faults.received(&mut inputs.bytes);
        }
        tally.count(*reads, &inputs.before, &inputs.bytes);
        let alive = arrival.age <= *max_age;
        outputs_before.copy_from_slice(outputs);
        program.scan(&mut Scan {
            now,
            alive,
            cycle: arrival.sequence,
            inputs: &inputs.bytes,
            outputs,
        });
        tally.count(*writes, outputs_before, outputs);
        station.write(now, |frame| {
            frame.copy_from_slice(outputs);
            if let Some(faults) = faults {
                faults.sending(frame);
            }
        });
        tally.scanned(arrival.age, alive);
        if let Some(tape) = tape {
            let code = match arrival.fresh {
                _ if !alive => Code::Stale,
                true => Code::Fresh,
                false => Code::Unchanged,
            };
            tape.scan(now, code, &inputs.bytes, outputs);
        }
    }
}

/// Makes the half of a line that has the program: its processor, the bus's end of its image, its tally.
fn half(
    program: Box<dyn Program>,
    table: &SignalTable,
    role: Role,
    max_age: Nanos,
) -> (Cpu, BusEnd) {
    let tally = Arc::new(Tally::new(table));
    let (tick, bus) = image(directions(table, role));
    let (writes, reads) = role.areas();
    let frame = |area| vec![0; area_bytes(table, 0, area)].into_boxed_slice();
    let (inputs, outputs) = (frame(reads), frame(writes));
    let cpu = Cpu {
        program,
        tick,
        inputs: Inputs {
            before: inputs.clone(),
            bytes: inputs,
        },
        outputs_before: outputs.clone(),
        outputs,
        max_age,
        areas: (writes, reads),
        tally,
        faults: None,
        tape: None,
    };
    (cpu, bus)
}

/// A PLC program at one end of a bus, scanned on its interval: a PLC without its box.
///
/// In the role Device, a program takes the machine's place: `%Q` are its inputs, `%I` its outputs.
#[derive(Debug)]
pub struct Host(HostThread);

impl Host {
    /// Opens the bus that `config` describes and starts scanning `program` every `interval`. It does not
    /// wait for the peer: scans begin at once, and say that nobody is there.
    ///
    /// # Errors
    ///
    /// Program and signal table do not fit, the bus is one that a simulation must step, the recording cannot be
    /// made, or the system refused a thread.
    pub fn open(
        config: &Config,
        mut program: Box<dyn Program>,
        interval: Nanos,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, DriverError> {
        bus::check_fit(config, &mut *program, config.role)?;
        let (Bus::Free(bus), None) = bus::open(config, &clock)? else {
            return Err(DriverError::Config(format!(
                "{}: this bus runs on the ticks of a simulation, so that no PLC program can run on it \
                 by itself; choose mode = \"free\" and a \"link\", or another kind of bus",
                config.path.display()
            )));
        };
        let title = format!("plc {}", program.name());
        let role = config.role;
        let hosted = Hosted {
            program,
            interval,
            tape: Tape::start(config, role)?,
        };
        HostThread::start(hosted, title, config, role, bus, clock)
            .map(Self)
            .map_err(DriverError::Thread)
    }

    /// How the line is doing.
    pub fn link(&self) -> Link {
        self.0.status.observe_call(self.0.clock.now());
        self.0.status.link()
    }

    /// What was counted, and how the line is doing, one `key=value` a line.
    pub fn statistics(&self) -> String {
        let now = self.0.clock.now();
        let mut text = String::new();
        self.0.status.observe_call(now);
        self.0.status.write(now, &mut text);
        self.0.board.tell(self.0.status.driver());
        self.0.board.write(&mut text);
        self.0.write(&mut text);
        text
    }

    /// The injected faults of this end.
    pub fn injected_faults(&self) -> Vec<Injected> {
        self.0.board.list()
    }

    /// Scans so far, and how many of them found the data stale.
    pub fn scans(&self) -> (u64, u64) {
        let tally = &self.0.tally;
        (
            tally.scans.load(Ordering::Relaxed),
            tally.stale.load(Ordering::Relaxed),
        )
    }

    /// Why the program does not scan any more, if it does not: it panicked, or a scan does not end.
    pub fn fault(&self) -> Option<String> {
        self.0.fault()
    }

    /// Stops scanning and closes the bus.
    pub fn close(self) {
        drop(self);
    }
}

/// The longest time that a scan is waited for. A PLC's own watchdog stops it far earlier.
const LONGEST_SCAN: Nanos = Nanos::from_secs(3);

/// Since when the program has been in a scan.
#[derive(Debug)]
struct Scanning(AtomicI64);

impl Scanning {
    /// No time at all.
    const NONE: i64 = i64::MIN;

    fn set(&self, since: Option<Nanos>) {
        let since = since.map_or(Self::NONE, |since| since.0);
        self.0.store(since, Ordering::Relaxed);
    }

    /// How long the present scan has taken, once that is too long.
    fn too_long(&self, now: Nanos) -> Option<Nanos> {
        let since = self.0.load(Ordering::Relaxed);
        let span = now - Nanos(since);
        (since != Self::NONE && span > LONGEST_SCAN).then_some(span)
    }
}

/// A program, and how it is scanned.
pub(super) struct Hosted {
    pub(super) program: Box<dyn Program>,
    pub(super) interval: Nanos,
    /// Where its scans are recorded.
    pub(super) tape: Option<Tape>,
}

/// A program on a thread of its own, with the bus thread of its end of the line; dropping it stops both.
#[derive(Debug)]
pub(super) struct HostThread {
    tally: Arc<Tally>,
    fault: Arc<Mutex<Option<String>>>,
    scanning: Arc<Scanning>,
    /// Disconnected when the thread ends.
    ended: EndReceiver<()>,
    report: Option<Arc<dyn Report>>,
    record: Option<Arc<record::Tally>>,
    clock: Arc<dyn Clock>,
    status: LinkStatus,
    board: Arc<Board>,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
    #[expect(dead_code, reason = "kept for its drop")]
    bus: BusThread,
}

impl HostThread {
    /// Starts scanning the `hosted` program as the end with `role`, with `bus` between it and its peer.
    /// `name` is the thread's.
    pub(super) fn start(
        hosted: Hosted,
        name: String,
        config: &Config,
        role: Role,
        bus: Box<dyn Free>,
        clock: Arc<dyn Clock>,
    ) -> std::io::Result<Self> {
        let max_age = config.timing.max_age;
        let interval = hosted.interval;
        let report = hosted.program.report();
        let (mut cpu, bus_end) = half(hosted.program, &config.table, role, max_age);
        cpu.tape = hosted.tape;
        let record = cpu.tape.as_ref().map(Tape::tally);
        let status = LinkStatus::new(&name, max_age);
        // A CPU whose program has died must not keep its last outputs on the bus.
        let watchdog = Some((interval + interval).max(max_age));
        let mut port = Port::new(bus_end, Arc::clone(&clock), role, watchdog, status.clone());
        let board = Arc::<Board>::default();
        // A program behind the bus of a driver is not the end whose faults these are.
        if role == config.role {
            let (faults, board) = (&config.faults, Arc::clone(&board));
            let inputs = &cpu.inputs.bytes;
            cpu.faults = FrameFaults::new(faults, &config.table, cpu.areas, inputs, board);
        }
        port.suffer_from(Arc::clone(&board));
        let reconnect = config.timing.reconnect.clone();
        let bus = BusThread::start(bus, port, reconnect, status.clone(), &name)?;
        let (tally, stop) = (Arc::clone(&cpu.tally), Stop::new());
        let fault = Arc::new(Mutex::new(None));
        let scanning = Arc::new(Scanning(AtomicI64::new(Scanning::NONE)));
        let (end, ended) = mpsc::channel();
        let thread = std::thread::Builder::new().name(name).spawn({
            let (stop, fault, clock) = (stop.clone(), Arc::clone(&fault), Arc::clone(&clock));
            let scanning = Arc::clone(&scanning);
            move || {
                let _end: Sender<()> = end;
                let scans = || scan_until_stopped(&mut cpu, interval, &*clock, &stop, &scanning);
                let result = catch_unwind(AssertUnwindSafe(scans));
                scanning.set(None);
                if let Err(panic) = result {
                    let text = format!("the PLC program panicked: {}", panic_text(&*panic));
                    log::error!("{text}");
                    *fault.lock().unwrap_or_else(PoisonError::into_inner) = Some(text);
                }
            }
        })?;
        Ok(Self {
            tally,
            fault,
            scanning,
            ended,
            report,
            record,
            clock,
            status,
            board,
            stop,
            thread: Some(thread),
            bus,
        })
    }

    /// Appends what the program has counted, and its fault.
    pub(super) fn write(&self, text: &mut String) {
        self.tally.write(text);
        if let Some(report) = &self.report {
            report.write(text);
        }
        if let Some(fault) = self.fault() {
            let fault = fault.split_whitespace().collect::<Vec<_>>().join(" ");
            let _ = writeln!(text, "plc.fault={fault}");
        }
        if let Some(record) = &self.record {
            record.write(text);
        }
    }

    fn fault(&self) -> Option<String> {
        if let Some(span) = self.scanning.too_long(self.clock.now()) {
            let span = span.rounded();
            return Some(format!("the PLC program has been in one scan for {span}"));
        }
        self.fault
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Drop for HostThread {
    fn drop(&mut self) {
        self.stop.stop();
        if self.ended.recv_timeout(LONGEST_SCAN.to_duration()) == Err(Timeout) {
            log::error!(
                "a PLC program's scan did not end within {LONGEST_SCAN}, and its thread is left behind"
            );
            return;
        }
        if let Some(thread) = self.thread.take() {
            // Its panics are caught and recorded on the thread itself.
            let _ = thread.join();
        }
    }
}

fn scan_until_stopped(
    cpu: &mut Cpu,
    interval: Nanos,
    clock: &dyn Clock,
    stop: &Stop,
    scanning: &Scanning,
) {
    // Like a PLC: a scan that comes late is late, and none is made up for.
    let mut pace = Pace::new(clock.now(), interval);
    while !stop.is_stopped() {
        let now = clock.now();
        if pace.take(now) {
            scanning.set(Some(now));
            cpu.scan(now);
            scanning.set(None);
        }
        clock.wait_until(pace.due(), stop);
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
        config: &Config,
        interval: Nanos,
    ) -> (Self, Arc<Tally>) {
        let max_age = config.timing.max_age;
        let (cpu, bus) = half(program, &config.table, Role::Controller, max_age);
        let tally = Arc::clone(&cpu.tally);
        let status = LinkStatus::new(cpu.program.name(), max_age);
        let port = Port::new(bus, Manual::new(), Role::Controller, None, status);
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
    if !from.sends(now) {
        return;
    }
    let frame = from.outgoing(0, now);
    let wire = &mut wire[..frame.len()];
    wire.copy_from_slice(frame);
    to.received(0, now, wire);
    from.sent(0);
}

impl Stepped for SteppedHost {
    fn exchange(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        port.running("the hosted program is there");
        let is_down = port.is_down(now);
        if !is_down {
            carry(port, &mut self.port, now, &mut self.wire);
        }
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
        if !is_down {
            carry(&mut self.port, port, now, &mut self.wire);
        }
        Ok(due)
    }
}
