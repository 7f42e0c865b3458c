//! The tick's part in letting another thread look at a driver.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use super::bus_handle::{BusHandle, SteppedBus};
use super::recording::remember;
use super::tick::Tick;
use super::view::{FailSafeValues, StationView, View};
use super::watch::Watch;
use super::{Code, Driver};

impl Driver {
    /// Lets another thread look at this driver and force its signals. While the watch asks for nothing, a tick only
    /// checks one word. An earlier handle receives nothing new from now on.
    ///
    /// If the live page of the driver.cfg has a history, the ticks are recorded in memory from now on; without memory
    /// or a thread for it, the driver runs on without one.
    pub fn watch(&mut self) -> Watch {
        self.extras.make_room(&self.board);
        let (config, clock) = (Arc::clone(&self.config), Arc::clone(&self.clock));
        let (sent, stepped) = (Some(config.role.areas().0), self.is_stepped());
        let remembered = remember(
            &config,
            &self.slots,
            sent,
            &mut self.recorder,
            (stepped, &self.real),
        );
        if let Err(error) = remembered {
            log::warn!(
                "driver \"{}\": the live page has no history: {error}",
                config.name
            );
        }
        self.shape = self.fitting_shape();
        let seen = (self.figures(), self.recorder.as_ref());
        let (tap, watch) = Watch::new(config, clock, seen, true);
        self.tap = Some(tap);
        watch
    }

    /// Serves the requests at the end of a tick.
    #[cold]
    #[inline(never)]
    pub(super) fn serve_watch(&mut self, tick: Tick, code: Code, slots: &[Slot]) {
        let Some(mut tap) = self.tap.take() else {
            return;
        };
        let wanted = tap.take_wanted();
        if wanted.orders() {
            self.extras.obey(&mut tap);
            self.shape = self.fitting_shape();
        }
        if wanted.values() {
            // The simulation's clock stands still during a tick, and other clocks can be read.
            let now = self.clock.now();
            tap.show(|view| self.fill(view, wanted.times(), (now, tick.time), code, slots));
        }
        self.tap = Some(tap);
    }

    fn fill(
        &self,
        view: &mut View,
        with_times: bool,
        (now, time): (Nanos, Nanos),
        code: Code,
        slots: &[Slot],
    ) {
        let signals = view.slots.len();
        view.slots.copy_from_slice(&slots[..signals]);
        let stations = view.stations.iter_mut().zip(&self.stations);
        for (index, (seen, station)) in stations.enumerate() {
            *seen = StationView {
                status: station.status,
                age: self.image.peers.age(index, now),
                is_valid: self.image.peers.is_valid(index),
                fail_safe: if station.stale {
                    FailSafeValues::All
                } else {
                    FailSafeValues::None
                },
                cycles: self.image.peers.received(index),
            };
            self.image
                .edges(index, |signal, count| view.edges[signal] = count);
        }
        if let BusHandle::Stepped {
            bus: SteppedBus::Replay(replay),
            ..
        } = &self.line
        {
            replay.edges(|signal, count| view.edges[signal] = count);
        }
        view.now = now;
        view.tick = self.counters.ticks;
        view.recorded_before = self.recorded.before();
        view.time = time;
        view.code = code;
        view.counters = self.counters;
        view.events_lost = self.image.events.lost();
        view.has_times = with_times;
        if with_times {
            view.times.copy_from(&self.samples);
        }
    }
}
