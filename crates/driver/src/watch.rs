//! A driver, as another thread sees it.

use std::fmt;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::{Clock, Nanos};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::{
    Begin, Effect, Fault, FaultBoard, FaultStatus, Lasts, Phase, Prepared, SignalEffect, Slots,
};
use tickbus_fieldbus::{Link, LinkStatus, Role};
use tickbus_image::signal::{Area, Slot};

use super::SlotMap;
use super::tap::Handle;
use super::tick_counters::TickTimes;
use super::view::View;

/// Looks at a driver or a hosted program from another thread, and forces its signals. Neither waits for the other.
///
/// What it sees is a copy that a tick made at its end, after it was [asked](Self::ask).
#[derive(Debug)]
pub struct Watch {
    pub(super) config: Arc<Config>,
    pub(super) role: Role,
    /// The slots that count edges.
    pub(super) slots: SlotMap,
    pub(super) handle: Handle,
    pub(super) status: LinkStatus,
    pub(super) board: Arc<FaultBoard>,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) figures: Box<dyn Figures>,
    /// The distributions that came last.
    pub(super) times: TickTimes,
}

/// What the copies of the ticks do not have.
pub(super) trait Figures: fmt::Debug + Send {
    /// The statistics at this moment.
    fn statistics(&self, now: Nanos, view: &View, times: &TickTimes) -> Statistics;

    /// Whether they are a driver's.
    fn is_driver(&self) -> bool;
}

impl Watch {
    /// What it was opened with.
    pub fn config(&self) -> &Arc<Config> {
        &self.config
    }

    /// Which end of the line it is.
    pub fn role(&self) -> Role {
        self.role
    }

    /// The area that it writes.
    pub fn writes(&self) -> Area {
        self.role.areas().0
    }

    /// Whether it is a simulation's driver, and not a PLC program.
    pub fn is_driver(&self) -> bool {
        self.figures.is_driver()
    }

    /// The clock of the line, which [`View::now`] and [`Link::since`] are on. On a stepped bus that is simulation time.
    pub fn clock(&self) -> &dyn Clock {
        &*self.clock
    }

    /// Asks for a copy at the end of the next tick; `with_times` for new distributions as well, which take the tick some
    /// microseconds.
    pub fn ask(&self, with_times: bool) {
        self.handle.ask(with_times);
    }

    /// Takes over the newest copy, if there is a new one.
    pub fn update(&mut self) -> bool {
        if !self.handle.update() {
            return false;
        }
        let times = &mut self.times;
        self.handle.with(|view| {
            if view.has_times {
                times.copy_from(&view.times);
            }
            // In case the bus cannot look at its line itself.
            let ages = view.stations.iter().map(|station| station.age);
            self.status.observe(view.now, ages);
        });
        true
    }

    /// The copy that was taken over last.
    pub fn view<R>(&self, read: impl FnOnce(&View) -> R) -> R {
        self.handle.with(read)
    }

    /// The state of the line at this moment.
    pub fn link(&self) -> Link {
        self.status.observe_call(self.clock.now());
        self.status.link()
    }

    /// The statistics: the line's at this moment, the tick's as of the last copy.
    pub fn statistics(&self) -> Statistics {
        let now = self.clock.now();
        self.view(|view| self.figures.statistics(now, view, &self.times))
    }

    /// The injected faults in order of injection; those that ended long ago may be missing.
    pub fn faults(&self) -> Vec<FaultStatus> {
        self.board.list()
    }

    /// Whether a fault waits or is active.
    pub fn is_fault_on(&self, id: u32) -> bool {
        let faults = self.board.list();
        faults
            .iter()
            .any(|fault| fault.id == id && fault.phase != Phase::Over)
    }

    /// Holds the signal with this index to a value from the next tick on: a fault of the kind "stuck", called
    /// `forced: <its name>`. Gives the fault's number.
    ///
    /// # Errors
    ///
    /// Too many faults wait or are active, or the simulation takes over no more orders.
    ///
    /// # Panics
    ///
    /// When there is no such signal.
    pub fn force(&mut self, signal: usize, value: Slot) -> Result<u32, Mistake> {
        let table = &self.config.table;
        let fault = Fault {
            name: format!("forced: {}", table.signals[signal].name),
            effect: Effect::Signal(signal, SignalEffect::Stuck(Some(value))),
            begin: Begin::AtOnce,
            lasts: Lasts::UntilEnded,
            times: 1,
            seed: 1,
        };
        let slots = Slots {
            table,
            writes: self.writes(),
            edges: &self.slots.edges,
        };
        let prepared = Prepared::new(&fault, slots, &self.board)?;
        let id = prepared.id();
        self.handle.inject(prepared)?;
        Ok(id)
    }

    /// Ends a fault at the next tick.
    ///
    /// # Errors
    ///
    /// The simulation takes over no more orders.
    pub fn end_fault(&mut self, id: u32) -> Result<(), Mistake> {
        self.handle.end(id)
    }

    /// How long no tick has come, going by the copy that was taken over last; [`Nanos::MAX`] before the first.
    pub fn silence(&self) -> Nanos {
        let now = self.clock.now();
        self.view(|view| match view.tick {
            0 => Nanos::MAX,
            _ => (now - view.now).max(Nanos::ZERO),
        })
    }
}
