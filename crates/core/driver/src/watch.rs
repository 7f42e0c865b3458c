//! A driver, as another thread sees it.

use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::{Clock, Nanos};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::{
    Begin, Effect, Fault, FaultStatus, Lasts, Phase, Prepared, SignalEffect, Slots,
};
use tickbus_fieldbus::{LineEvent, Link, Role};
use tickbus_image::signal::{Area, Slot};
use tickbus_record::{History, Recorder};

use super::SlotMap;
use super::statistics::{Figures, LineEnd, TickFigures};
use super::tap::{Handle, Tap, tap};
use super::tick_counters::TickTimes;
use super::view::View;

/// How a signal is forced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Force {
    /// The index of the signal.
    pub signal: usize,
    /// The change of its value.
    pub effect: SignalEffect,
    /// When it ends without a request.
    pub lasts: Lasts,
}

/// Looks at a driver or a hosted program from another thread, and forces its signals. Neither thread waits for the
/// other.
///
/// The watch sees a copy that a tick made at its end, after a [request](Self::ask).
#[derive(Debug)]
pub struct Watch {
    config: Arc<Config>,
    /// The slots that count edges.
    slots: SlotMap,
    handle: Handle,
    clock: Arc<dyn Clock>,
    /// The data that the copies of the ticks do not contain.
    figures: Figures,
    history: Option<Arc<History>>,
    is_driver: bool,
    /// The distributions that arrived last.
    times: TickTimes,
    /// The time of the request for a copy that has not arrived yet.
    asked: Option<Nanos>,
}

impl Watch {
    /// Creates a watch on the end that `config` describes, and the tap for its ticks.
    pub(super) fn new(
        config: Arc<Config>,
        clock: Arc<dyn Clock>,
        (figures, recorder): (Figures, Option<&Recorder>),
        is_driver: bool,
    ) -> (Tap, Self) {
        let table = &config.table;
        let slots = SlotMap::new(table, config.role);
        let initial = table.signals.iter().map(|signal| signal.fail_safe);
        let (tap, handle) = tap(&View::new(initial.collect(), table.stations.len()));
        let watch = Self {
            config,
            slots,
            handle,
            clock,
            figures,
            history: recorder.and_then(Recorder::history).map(Arc::clone),
            is_driver,
            times: TickTimes::default(),
            asked: None,
        };
        (tap, watch)
    }

    /// Returns the configuration that the driver or program was opened with.
    pub fn config(&self) -> &Arc<Config> {
        &self.config
    }

    /// Returns the end of the line that is watched.
    pub fn role(&self) -> Role {
        self.config.role
    }

    /// Returns the age beyond which data are stale at present: the line may have other settings than
    /// [`config`](Self::config).
    pub fn max_age(&self) -> Nanos {
        self.figures.status.max_age()
    }

    /// Returns the kind of bus that the line has at present.
    pub fn bus_kind(&self) -> &'static str {
        self.figures.bus.get().kind
    }

    /// Returns which end of its connection the line is at present; `None` for a bus without connections.
    pub fn line_end(&self) -> Option<LineEnd> {
        self.figures.bus.get().end
    }

    /// Returns the host and port where the line connects or listens at present, as configured; `None` for a bus without
    /// one.
    pub fn address(&self) -> Option<String> {
        self.figures.bus.get().address
    }

    /// Returns how long the ticks can pause at present before the peer gets fail-safe values; `None` for any time.
    pub fn watchdog(&self) -> Option<Nanos> {
        self.figures.bus.get().watchdog
    }

    /// Returns the area that this end writes.
    pub fn writes(&self) -> Area {
        self.role().areas().0
    }

    /// Returns true for a simulation's driver, and false for a PLC program.
    pub fn is_driver(&self) -> bool {
        self.is_driver
    }

    /// Returns the recording of the ticks in memory, if the live page of the driver.cfg has one.
    pub fn history(&self) -> Option<&Arc<History>> {
        self.history.as_ref()
    }

    /// Returns the clock of the line, on which [`View::now`] and [`Link::since`] are. On a stepped bus that is
    /// simulation time.
    pub fn clock(&self) -> &dyn Clock {
        &*self.clock
    }

    /// Asks for a copy at the end of the next tick. `with_times` asks for new distributions as well, which cost the
    /// tick some microseconds.
    pub fn ask(&mut self, with_times: bool) {
        let now = self.clock.now();
        self.asked.get_or_insert(now);
        self.handle.ask(with_times);
    }

    /// Takes over the newest copy, if there is a new one.
    pub fn update(&mut self) -> bool {
        if !self.handle.update() {
            return false;
        }
        self.asked = None;
        let status = &self.figures.status;
        let since = status.link().since;
        let times = &mut self.times;
        self.handle.with(|view| {
            if view.has_times {
                times.copy_from(&view.times);
            }
            // In case the bus cannot check its line itself. A copy that is older than the state of the line does not
            // change the state.
            if view.now >= since {
                let ages = view.stations.iter().map(|station| station.age);
                status.observe(view.now, ages);
            }
        });
        true
    }

    /// Reads the copy that was taken over last.
    pub fn view<R>(&self, read: impl FnOnce(&View) -> R) -> R {
        self.handle.with(read)
    }

    /// Returns the state of the line at this moment.
    pub fn link(&self) -> Link {
        self.figures.status.observe_call(self.clock.now());
        self.figures.status.link()
    }

    /// Returns the last events of the line, the oldest first.
    pub fn events(&self) -> Vec<LineEvent> {
        self.figures.status.events()
    }

    /// Returns true if the line has come up with its present settings.
    pub fn has_run(&self) -> bool {
        self.figures.status.has_run()
    }

    /// Returns when the bus is tried again after a failure; `None` if it does not wait for that.
    pub fn next_attempt(&self) -> Option<Nanos> {
        self.figures.status.next_attempt()
    }

    /// Returns the statistics: the line's at this moment, the tick's as of the last copy.
    pub fn statistics(&self) -> Statistics {
        let now = self.clock.now();
        self.view(|view| {
            let ticks = self.is_driver.then(|| TickFigures {
                config: Arc::clone(&self.config),
                counters: view.counters,
                stations: (view.stations.iter())
                    .map(|station| (station.age, station.is_valid, station.cycles))
                    .collect(),
                events_lost: view.events_lost,
                samples: self.times.clone(),
            });
            self.figures.statistics(now, ticks.as_ref())
        })
    }

    /// Returns the injected faults in order of injection; faults that ended long ago may be missing.
    pub fn faults(&self) -> Vec<FaultStatus> {
        self.figures.board.list()
    }

    /// Returns true if a fault is waiting or active.
    pub fn is_fault_on(&self, id: u32) -> bool {
        let faults = self.figures.board.list();
        faults
            .iter()
            .any(|fault| fault.id == id && fault.phase != Phase::Over)
    }

    /// Holds the signal with this index at a value, by a fault of the kind "stuck" called `forced: <its name>`. The
    /// driver reads the order at the end of the next tick, so the tick after that is the first that shows the value.
    /// Returns the fault's number.
    ///
    /// # Errors
    ///
    /// Too many faults are waiting or active, or the simulation no longer takes orders.
    ///
    /// # Panics
    ///
    /// When there is no such signal.
    pub fn force(&mut self, signal: usize, value: Slot) -> Result<u32, Mistake> {
        let name = format!("forced: {}", self.config.table.signals[signal].name);
        let effect = Effect::Signal(signal, SignalEffect::Stuck(Some(value)));
        self.inject(name, effect)
    }

    /// Changes signals by faults called `forced: <the signal's name>`, all from the same tick on, and ends the faults
    /// with the numbers `end` in that tick. The driver reads the order at the end of the next tick, so the tick after
    /// that is the first that shows the values. Returns the numbers of the new faults.
    ///
    /// # Errors
    ///
    /// Too many faults are waiting or active, those of `end` included, or the simulation no longer takes orders; then
    /// nothing is changed.
    ///
    /// # Panics
    ///
    /// When there is no such signal.
    pub fn force_all(&mut self, forces: &[Force], end: Vec<u32>) -> Result<Vec<u32>, Mistake> {
        // A prepared fault stays on the list until the tick has seen it, so none is prepared in vain.
        let (room, needed) = (self.figures.board.room(), forces.len());
        if needed > room {
            return Err(Mistake::new(
                format!("there is room for {room} more faults, and not for {needed}"),
                "end some of them",
            ));
        }
        let mut begin: Vec<Prepared> = Vec::with_capacity(forces.len());
        for force in forces {
            let name = format!("forced: {}", self.config.table.signals[force.signal].name);
            match self.prepared(
                name,
                Effect::Signal(force.signal, force.effect),
                force.lasts,
            ) {
                Ok(fault) => begin.push(fault),
                Err(why) => {
                    begin.into_iter().for_each(Prepared::cancel);
                    return Err(why);
                }
            }
        }
        let ids = begin.iter().map(Prepared::id).collect();
        self.handle.replace(begin, end)?;
        Ok(ids)
    }

    /// Returns the value that a ramp has reached, by the number of its fault; `None` before it begins.
    pub fn ramp_value(&self, fault: u32) -> Option<Slot> {
        self.figures.board.ramp_value(fault)
    }

    /// Returns the faults that the simulation's model has declared, in its order.
    pub fn model_faults(&self) -> Arc<[String]> {
        self.figures.board.model_faults()
    }

    /// Gives the simulation's model a fault, as by a fault of the kind "model", in the tick after the next one. Returns
    /// the fault's number.
    ///
    /// # Errors
    ///
    /// The model has not declared the fault, or as for [`force`](Self::force).
    pub fn inject_model_fault(&mut self, name: &str, value: f64) -> Result<u32, Mistake> {
        self.figures.board.check_model_fault(name)?;
        self.inject(name.to_owned(), Effect::Model(value))
    }

    fn inject(&mut self, name: String, effect: Effect) -> Result<u32, Mistake> {
        let prepared = self.prepared(name, effect, Lasts::UntilEnded)?;
        let id = prepared.id();
        self.handle.inject(prepared)?;
        Ok(id)
    }

    fn prepared(&self, name: String, effect: Effect, lasts: Lasts) -> Result<Prepared, Mistake> {
        self.role().check_faults()?;
        let fault = Fault {
            name,
            effect,
            begin: Begin::AtOnce,
            lasts,
            times: 1,
            seed: 1,
        };
        let slots = Slots {
            table: &self.config.table,
            writes: self.writes(),
            edges: &self.slots.edges,
        };
        Prepared::new(&fault, slots, &self.figures.board)
    }

    /// Ends a fault. The next tick reads the order at its end, and the tick after that is the first without the fault.
    ///
    /// # Errors
    ///
    /// The simulation no longer takes orders.
    pub fn end_fault(&mut self, id: u32) -> Result<(), Mistake> {
        self.handle.end(id)
    }

    /// Returns how long a requested copy has been overdue; [`Nanos::MAX`] before the first tick. Returns zero if the
    /// copy requested last has arrived, however long ago: later ticks are unknown.
    pub fn silence(&self) -> Nanos {
        let now = self.clock.now();
        self.view(|view| match (view.tick, self.asked) {
            (0, _) => Nanos::MAX,
            (_, None) => Nanos::ZERO,
            (_, Some(asked)) => (now - asked.max(view.now)).max(Nanos::ZERO),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Driver;
    use tickbus_base::time::Manual;
    use tickbus_fieldbus::{Cause, LinkState};

    const TEXT: &str = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
                        program = \"mirror\"\nscan = \"1ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n\
                        [[signal]]\nname = \"b\"\naddress = \"%QB0\"\n";

    /// Returns a driver that has ticked once, and a watch on it.
    fn watched() -> (Driver, Watch, Vec<Slot>) {
        let config =
            Config::parse("driver.cfg", TEXT, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        let mut driver = Driver::open(config, Manual::new()).expect("opens");
        let mut watch = driver.watch();
        let mut slots = driver.initial_slots();
        watch.ask(false);
        driver.exchange(Nanos::from_millis(1), &mut slots);
        (driver, watch, slots)
    }

    #[test]
    fn a_copy_that_nobody_took_over_for_long_is_no_silence() {
        let (mut driver, mut watch, mut slots) = watched();
        // The driver continues to tick, and nobody asks.
        driver.exchange(Nanos::from_millis(400), &mut slots);
        assert!(watch.update());
        assert_eq!(watch.silence(), Nanos::ZERO);
        // The driver owes a copy, here because nobody takes the copy over.
        watch.ask(false);
        let asked = watch.clock().now();
        driver.exchange(Nanos::from_millis(700), &mut slots);
        let owed = watch.clock().now() - asked;
        assert!(owed > Nanos::ZERO);
        assert_eq!(watch.silence(), owed);
    }

    #[test]
    fn an_old_copy_does_not_change_a_newer_state_of_the_line() {
        let (mut driver, mut watch, mut slots) = watched();
        driver.exchange(Nanos::from_millis(400), &mut slots);
        let now = watch.clock().now();
        let (state, cause) = (LinkState::Stale, Cause::Silent);
        let status = watch.figures.status.clone();
        status.enter(now, state, cause, "nothing has come");
        assert!(watch.update());
        assert_eq!(status.state(), LinkState::Stale);
        // A newer copy does.
        watch.ask(false);
        driver.exchange(Nanos::from_millis(401), &mut slots);
        assert!(watch.update());
        assert_eq!(status.state(), LinkState::Running);
    }

    #[test]
    fn several_forces_without_room_change_nothing() {
        let (mut driver, mut watch, mut slots) = watched();
        let force = Force {
            signal: 0,
            effect: SignalEffect::Stuck(Some(Slot::from_real(1.0))),
            lasts: Lasts::UntilEnded,
        };
        let held = watch.force_all(&[force; 40], Vec::new()).expect("room");
        driver.exchange(Nanos::from_millis(2), &mut slots);
        // The old ones are on the list until the tick has ended them.
        let before = watch.faults().len();
        let refused = watch.force_all(&[force; 40], held.clone());
        let right = "there is room for 24 more faults, and not for 40; end some of them";
        assert_eq!(refused.expect_err("no room").to_string(), right);
        assert_eq!(watch.faults().len(), before);
        assert!(held.iter().all(|id| watch.is_fault_on(*id)));
        watch.force_all(&[force; 24], held).expect("room");
        for tick in 3..5 {
            driver.exchange(Nanos::from_millis(tick), &mut slots);
        }
        watch.force_all(&[force; 40], Vec::new()).expect("room");
    }
}
