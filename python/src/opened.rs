//! Open drivers, by checked numbers.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tickbus::page::{self, Place};
use tickbus_base::time::Nanos;
use tickbus_binding::{Handles, Refusal, Reload, SignalDescription, closing, open};
use tickbus_driver::{Code, Driver, Exchange, Snapshot};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::{Fault, FaultBoard};
use tickbus_image::Event;
use tickbus_image::signal::Slot;
use tickbus_kinds::KINDS;
use tickbus_testing::Session;

use crate::block::Block;
use crate::memory::Memory;
use crate::signal::Description;

/// The drivers that are open in this process.
static DRIVERS: Handles<Opened> = Handles::new();

/// The number of forks of this process and its ancestors.
static FORKS: AtomicU64 = AtomicU64::new(0);

/// The most events that a call returns: the capacity of the driver's ring.
const MOST_EVENTS: usize = 4096;
/// The most events that are taken at once.
const EVENTS: usize = 64;

/// Notes a fork; called in the child process.
pub(crate) fn forked() {
    FORKS.fetch_add(1, Ordering::Relaxed);
    page::forked();
}

/// A tick, or one of its halves.
#[derive(Clone, Copy)]
pub(crate) enum Half {
    Exchange,
    Receive,
    Send,
}

/// An open driver with its own slots.
struct Opened {
    driver: Driver,
    slots: Vec<Slot>,
    memory: Arc<Memory>,
    /// The slots that this end writes, and those that it reads.
    written: Vec<Range<usize>>,
    read: Vec<Range<usize>>,
    /// The driver's place on the live page; rows of a vector have none.
    shown: Option<Place>,
}

impl Opened {
    fn tick(&mut self, half: Half, time: Option<Nanos>) -> Code {
        if !matches!(half, Half::Send) {
            self.memory.count();
        }
        if !matches!(half, Half::Receive) {
            self.gather();
        }
        let done = match half {
            Half::Exchange => self.driver.exchange(time, &mut self.slots),
            Half::Receive => self.driver.receive(time, &mut self.slots),
            Half::Send => self.driver.send(&mut self.slots),
        };
        if !matches!(half, Half::Send) {
            self.scatter();
        }
        self.tell(done)
    }

    /// One exchange under the eyes of a sweep. Returns its code, and true if the run is over.
    fn swept(&mut self, sweep: &mut Session, time: Nanos) -> Result<(Code, bool), Refusal> {
        self.memory.count();
        self.gather();
        sweep
            .before(&mut self.driver, &mut self.slots)
            .map_err(|mistake| Refusal::new(Code::BadArgument, mistake))?;
        let done = self.driver.exchange(Some(time), &mut self.slots);
        let is_over = sweep.after(&mut self.slots);
        self.scatter();
        Ok((self.tell(done), is_over))
    }

    fn reset(&mut self) -> Result<(), Refusal> {
        self.gather();
        self.driver.reset(&mut self.slots)?;
        self.memory.restart(&self.slots);
        Ok(())
    }

    fn gather(&mut self) {
        for range in &self.written {
            self.memory.gather(range, &mut self.slots);
        }
    }

    fn scatter(&self) {
        for range in &self.read {
            self.memory.scatter(range, &self.slots);
        }
    }

    fn tell(&self, done: Exchange) -> Code {
        self.memory.tell(done);
        done.code
    }

    fn events(&mut self) -> Vec<Event> {
        let mut found = Vec::new();
        let mut events = [Event::default(); EVENTS];
        while found.len() < MOST_EVENTS {
            let count = self.driver.poll_events(&mut events);
            found.extend_from_slice(&events[..count]);
            if count < EVENTS {
                break;
            }
        }
        found
    }

    fn close(mut self) {
        self.gather();
        self.driver.end_tick(&self.slots);
        self.driver.close();
    }
}

/// Returns the slots for which `wanted` is true, in runs.
fn runs(count: usize, wanted: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for slot in (0..count).filter(|&slot| wanted(slot)) {
        match runs.last_mut() {
            Some(run) if run.end == slot => run.end += 1,
            _ => runs.push(slot..slot + 1),
        }
    }
    runs
}

/// Ticks each of these drivers once, without an end at the first failure; `done` gets the place of each and its code.
pub(crate) fn tick_each(
    handles: &[Handle],
    half: Half,
    time: impl Fn(usize) -> Option<Nanos>,
    mut done: impl FnMut(usize, Code),
) {
    // All were opened before the vector was made.
    if handles.iter().any(Handle::is_forked) {
        (0..handles.len()).for_each(|at| done(at, Code::NotOpen));
        return;
    }
    let numbers = handles.iter().map(|handle| handle.number);
    DRIVERS.tick_each(numbers, |at, opened| opened.tick(half, time(at)), done);
}

/// An opened driver. Dropping the handle leaves the driver open.
#[derive(Clone)]
pub(crate) struct Handle {
    number: i64,
    forks: u64,
    pub(crate) memory: Arc<Memory>,
    pub(crate) is_stepped: bool,
}

/// The facts about a driver when it has been opened.
pub(crate) struct Facts {
    pub(crate) handle: Handle,
    pub(crate) id: i32,
    pub(crate) name: String,
    pub(crate) signals: Vec<Description>,
}

/// Returns why a forked child cannot use its parent's driver.
fn forked_child() -> Refusal {
    let text = "this driver was opened by the parent process, and a forked child has none of its threads; \
                open it in the child, or start the child by \"spawn\"";
    Refusal::new(Code::NotOpen, text)
}

impl Handle {
    /// Opens the driver that a driver.cfg describes, with `tables` in place of its own, and its values in a row of a
    /// vector if one is given.
    pub(crate) fn open(
        path: &Path,
        tables: &str,
        row: Option<(&Block, usize)>,
    ) -> Result<Facts, Refusal> {
        Refusal::instead_of_panic(|| {
            tickbus_base::os::log_to_stderr(log::LevelFilter::Warn);
            let place = DRIVERS.reserve()?;
            let mut driver = open(path, tables, &KINDS)?;
            let config = Arc::clone(driver.config());
            // A page for each of a thousand drivers would have a thread and a history for each.
            let shown = match row {
                None => page::show_driver(&mut driver)?,
                Some(_) => None,
            };
            let signals: Vec<Description> = (0..config.table.signals.len())
                .map(|index| Description::of(&SignalDescription::of(&driver, index), &config))
                .collect();
            let is_written =
                |slot: usize| signals.get(slot).is_some_and(|signal| signal.is_written);
            let slots = driver.initial_slots();
            let memory = Arc::new(match row {
                Some((block, row)) => block.row(row, &slots)?,
                None => Memory::new(&slots),
            });
            let is_stepped = driver.is_stepped();
            let opened = Opened {
                written: runs(slots.len(), is_written),
                read: runs(slots.len(), |slot| !is_written(slot)),
                driver,
                slots,
                memory: Arc::clone(&memory),
                shown,
            };
            let number = place.fill(&config.name, opened);
            Ok(Facts {
                handle: Self {
                    number,
                    forks: FORKS.load(Ordering::Relaxed),
                    memory,
                    is_stepped,
                },
                id: config.id,
                name: config.name.clone(),
                signals,
            })
        })
    }

    /// Returns true if this process is a forked child of the one that opened the driver.
    pub(crate) fn is_forked(&self) -> bool {
        self.forks != FORKS.load(Ordering::Relaxed)
    }

    /// Calls `work` with the driver, if it is open and belongs to this process; waits for a running tick.
    fn visit<R>(&self, work: impl FnOnce(&mut Opened) -> R) -> Result<R, Refusal> {
        if self.is_forked() {
            return Err(forked_child());
        }
        DRIVERS.visit(self.number, work)
    }

    /// Does a tick or a half of one; returns a code below zero if it failed. Waits for another thread's tick.
    pub(crate) fn tick(&self, half: Half, time: Option<Nanos>) -> Code {
        if self.is_forked() {
            return Code::NotOpen;
        }
        let tick = |opened: &mut Opened| opened.tick(half, time);
        match DRIVERS.tick(self.number, tick) {
            Err(Code::Busy) => DRIVERS
                .visit(self.number, tick)
                .unwrap_or_else(|refusal| refusal.code),
            done => done.unwrap_or_else(|refused| refused),
        }
    }

    /// One exchange of a run of a sweep; returns true if the run is over.
    pub(crate) fn swept(&self, sweep: &mut Session, time: Nanos) -> Result<bool, Refusal> {
        let (code, is_over) = self.visit(|opened| opened.swept(sweep, time))??;
        if code.code() < 0 {
            return Err(self.reason(code));
        }
        Ok(is_over)
    }

    /// Calls `work` with the present values.
    pub(crate) fn with_slots<R>(&self, work: impl FnOnce(&[Slot]) -> R) -> Result<R, Refusal> {
        self.visit(|opened| {
            opened.gather();
            work(&opened.slots)
        })
    }

    /// Returns why a call failed with this code.
    #[cold]
    pub(crate) fn reason(&self, code: Code) -> Refusal {
        match self.visit(|opened| opened.driver.snapshot()) {
            Ok(snapshot) => Refusal::of_tick(code, &snapshot),
            Err(refusal) => refusal,
        }
    }

    pub(crate) fn reset(&self) -> Result<(), Refusal> {
        self.visit(Opened::reset)?
    }

    pub(crate) fn reload(&self) -> Result<bool, Refusal> {
        // Without the driver: the ticks go on meanwhile.
        self.visit(|opened| Reload::of(&opened.driver))?.run()
    }

    pub(crate) fn snapshot(&self) -> Result<Snapshot, Refusal> {
        self.visit(|opened| opened.driver.snapshot())
    }

    /// Returns the address of the page on which the driver is shown.
    pub(crate) fn page(&self) -> Result<Option<String>, Refusal> {
        let is_shown = self.visit(|opened| opened.shown.is_some())?;
        Ok(is_shown.then(page::url).flatten())
    }

    pub(crate) fn swallowed(&self) -> Result<String, Refusal> {
        self.visit(|opened| tickbus_binding::swallowed(&opened.driver))
    }

    pub(crate) fn is_over(&self) -> Result<bool, Refusal> {
        self.visit(|opened| opened.driver.is_over())
    }

    /// Calls `work` with the driver, between two ticks.
    pub(crate) fn with_driver<R>(&self, work: impl FnOnce(&Driver) -> R) -> Result<R, Refusal> {
        self.visit(|opened| work(&opened.driver))
    }

    pub(crate) fn config(&self) -> Result<Arc<Config>, Refusal> {
        self.visit(|opened| Arc::clone(opened.driver.config()))
    }

    pub(crate) fn events(&self) -> Result<Vec<Event>, Refusal> {
        self.visit(Opened::events)
    }

    pub(crate) fn inject(&self, fault: &Fault) -> Result<u32, Refusal> {
        self.visit(|opened| tickbus_binding::inject(&mut opened.driver, fault))?
    }

    pub(crate) fn declare_model_faults(&self, names: Vec<String>) -> Result<(), Refusal> {
        self.visit(|opened| tickbus_binding::declare_model_faults(&mut opened.driver, names))?
    }

    /// The changes of the model's faults since the last call: the place of the fault, and its value.
    pub(crate) fn model_changes(&self) -> Result<Vec<(usize, f64)>, Refusal> {
        self.visit(|opened| {
            let changes = std::iter::from_fn(|| opened.driver.next_model_change());
            changes
                .map(|(place, value)| (place, value.unwrap_or_default()))
                .collect()
        })
    }

    pub(crate) fn end_fault(&self, id: u32) -> Result<bool, Refusal> {
        self.visit(|opened| opened.driver.end_fault(id))
    }

    pub(crate) fn board(&self) -> Result<Arc<FaultBoard>, Refusal> {
        self.visit(|opened| Arc::clone(opened.driver.board()))
    }

    /// Closes the driver; does nothing if it is closed already or belongs to the parent process.
    pub(crate) fn close(&self) -> Result<(), Refusal> {
        if self.is_forked() {
            return Ok(());
        }
        Refusal::instead_of_panic(|| {
            match closing(|| DRIVERS.close(self.number, Opened::close)) {
                Ok(()) | Err(Code::Closed | Code::NotOpen) => {}
                Err(code) => return Err(Refusal::plain(code)),
            }
            self.memory.close();
            Ok(())
        })
    }
}
