//! A bus's view of its driver.

use std::fmt::Arguments;
use std::ops::Range;
use std::sync::Arc;

use crate::faults::{Fate, FaultBoard};
use tickbus_base::time::{Clock, Nanos};
use tickbus_image::{BusEnd, Event};

use super::port_faults::Troubles;
use super::validity::Validity;
use super::{BusError, Cause, ChangeEvents, LinkState, LinkStatus, PlcState, Role, Watch};

/// A bus's access to the image, the clock and the state of its driver.
#[derive(Debug)]
pub struct Port {
    image: BusEnd,
    clock: Arc<dyn Clock>,
    role: Role,
    watchdog: Option<Nanos>,
    changes: Vec<ChangeEvents>,
    status: LinkStatus,
    /// When the first station's last frame arrived while the line was running.
    last_cycle: Option<Nanos>,
    troubles: Troubles,
    vitals: Validity,
}

impl Port {
    /// A port over the bus's end of an image.
    ///
    /// If the simulation has not ticked for longer than `watchdog`, fail-safe bytes are sent.
    pub fn new(
        image: BusEnd,
        clock: Arc<dyn Clock>,
        role: Role,
        watchdog: Option<Nanos>,
        status: LinkStatus,
    ) -> Self {
        Self {
            vitals: Validity::new(image.stations.len()),
            image,
            clock,
            role,
            watchdog,
            changes: Vec::new(),
            status,
            last_cycle: None,
            troubles: Troubles::default(),
        }
    }

    /// Applies the faults on `board` to the line.
    pub fn suffer_from(&mut self, board: Arc<FaultBoard>) {
        self.troubles = Troubles::of(board);
    }

    /// Sets the stations' names for reasons and statistics, in the order of the signal table.
    pub fn name_stations<'a>(&mut self, names: impl IntoIterator<Item = &'a str>) {
        self.vitals.name_stations(names.into_iter());
    }

    /// Makes the data of a station valid only as long as these signals keep changing.
    pub fn watch_life(&mut self, watches: Vec<Watch>) {
        self.vitals.watch(watches);
    }

    /// Reports every change between received frames as an event; `changes` has one watcher per station.
    pub fn watch_changes(&mut self, changes: Vec<ChangeEvents>) {
        assert_eq!(changes.len(), self.stations(), "one watcher per station");
        self.changes = changes;
    }

    /// Which end of the line this is.
    pub fn role(&self) -> Role {
        self.role
    }

    /// The driver's clock, to wait on.
    pub fn clock(&self) -> &Arc<dyn Clock> {
        &self.clock
    }

    /// The number of stations.
    pub fn stations(&self) -> usize {
        self.image.stations.len()
    }

    /// Sizes in bytes of the frames that a station sends and receives.
    pub fn sizes(&self, station: usize) -> (usize, usize) {
        let station = &self.image.stations[station];
        (station.tx_len(), station.rx_len())
    }

    /// Whether an injected fault holds the line down, so that nothing is to be sent or taken at `now`.
    ///
    /// A bus that does not ask sends what it sent before, and what it hands in is lost.
    pub fn is_down(&mut self, now: Nanos) -> bool {
        self.attend(now);
        self.troubles.wires().is_some_and(|wires| wires.is_down())
    }

    /// Whether frames are sent in the cycle at `now`. Ask once per cycle, before
    /// [`outgoing`](Self::outgoing): if an injected fault loses the cycle, its frames must not be sent.
    pub fn sends(&mut self, now: Nanos) -> bool {
        self.sends_of(0..self.stations(), now)
    }

    /// As [`sends`](Self::sends), for a bus whose `stations` have a cycle of their own.
    pub fn sends_of(&mut self, stations: Range<usize>, now: Nanos) -> bool {
        if self.is_down(now) {
            return false;
        }
        if !self.troubles.decides_to_lose_a_cycle() {
            return true;
        }
        for station in stations {
            self.outgoing(station, now);
            self.sent(station);
        }
        false
    }

    /// The bytes that a station sends at `now`: the latest values, with every edge, or the fail-safe values
    /// if the simulation has stopped. Call [`sent`](Self::sent) once the peer has them.
    pub fn outgoing(&mut self, station: usize, now: Nanos) -> &[u8] {
        if station == 0 {
            self.observe(now);
        }
        let image = &mut self.image.stations[station];
        let Some(wires) = self.troubles.wires() else {
            return image.outgoing(now, self.watchdog);
        };
        let repeats = wires.repeats(station);
        if wires.is_cut(station) {
            return wires.frozen(station);
        }
        if !repeats && wires.takes(station, now, image.outgoing(now, self.watchdog)) {
            image.sent();
        }
        wires.outgoing(station)
    }

    /// The peer has received what [`outgoing`](Self::outgoing) returned last, or will unless the line breaks:
    /// for a stream this is when the system has accepted all of it. Data in transit when a line breaks are
    /// lost, pulses included.
    pub fn sent(&mut self, station: usize) {
        if self
            .troubles
            .wires()
            .is_none_or(|wires| wires.sent(station))
        {
            self.image.stations[station].sent();
        }
    }

    /// As [`sent`](Self::sent), for a peer that received only these bytes of the frame: pulses elsewhere do
    /// not count as seen.
    pub fn sent_part(&mut self, station: usize, bytes: Range<usize>) {
        self.sent_bits(station, bytes.start * 8..bytes.end * 8);
    }

    /// As [`sent_part`](Self::sent_part), for a peer that received only these bits (bit n of byte k is 8k +
    /// n): other bits of the same bytes do not count as seen.
    pub fn sent_bits(&mut self, station: usize, bits: Range<usize>) {
        if self
            .troubles
            .wires()
            .is_none_or(|wires| wires.sent_bits(station, &bits))
        {
            self.image.stations[station].sent_bits(&bits);
        }
    }

    /// Hands in a whole frame that arrived at `now`.
    ///
    /// # Panics
    ///
    /// When the frame does not have the station's size.
    pub fn received(&mut self, station: usize, now: Nanos, bytes: &[u8]) {
        self.attend(now);
        let times = match self.troubles.wires() {
            None => 1,
            Some(wires) => match wires.arrives(station, now, bytes) {
                Fate::Lost | Fate::Held => {
                    // If the frame is held back, its changes become events when it is released.
                    if let Some(changes) = self.changes.get_mut(station) {
                        changes.forget();
                    }
                    0
                }
                Fate::Passes(times) => times,
            },
        };
        for _ in 0..times {
            self.hand_in(station, now, bytes);
        }
    }

    /// Hands in a whole frame that arrived at `now` and of which the peer wrote only these bits (bit n of
    /// byte k is 8k + n). If events are enabled, each signal within them is reported, even if its value is
    /// unchanged.
    ///
    /// # Panics
    ///
    /// When the frame does not have the station's size.
    pub fn received_part(
        &mut self,
        station: usize,
        now: Nanos,
        bytes: &[u8],
        written: Range<usize>,
    ) {
        self.received_parts(station, now, bytes, [written]);
    }

    /// As [`received_part`](Self::received_part), for a peer that wrote several ranges of bits at once.
    ///
    /// # Panics
    ///
    /// When the frame does not have the station's size.
    pub fn received_parts(
        &mut self,
        station: usize,
        now: Nanos,
        bytes: &[u8],
        written: impl IntoIterator<Item = Range<usize>>,
    ) {
        // Frames held back earlier are handed in first: these writes do not belong to them.
        self.attend(now);
        if let Some(changes) = self.changes.get_mut(station) {
            written.into_iter().for_each(|bits| changes.written(bits));
        }
        self.received(station, now, bytes);
    }

    fn hand_in(&mut self, station: usize, now: Nanos, bytes: &[u8]) {
        if station == 0
            && let Some(last) = self.last_cycle.replace(now)
        {
            self.status.cycle(now - last);
        }
        self.image.stations[station].received(now, bytes);
        if self.vitals.arrived(station, now, bytes) {
            self.doubt(station, now);
        }
        if let Some(changes) = self.changes.get_mut(station) {
            changes.observe(now, bytes, &mut self.image.events);
        }
    }

    /// Reports that the peer was alive at `now`. After a STOP has ended, the station's data are valid again
    /// from then on; if the station is read, hand in its first frame before this call.
    pub fn touch(&mut self, station: usize, now: Nanos) {
        let wires = self.troubles.wires();
        // While frames are held back, the peer must not seem more alive than the data that have arrived.
        if wires.is_none_or(|wires| !wires.is_cut(station) && !wires.holds_back(station)) {
            self.image.stations[station].touch(now);
            if self.vitals.heard(station) {
                self.doubt(station, now);
            }
        }
    }

    /// The PLC of `station` reports that it runs its program, or that it does not: then the station is stale
    /// at once, however recent its data are. It becomes fresh with the first data after the PLC reports that
    /// it runs. Call it as often as the PLC reports; the last report stays valid when the line breaks.
    pub fn plc_state(&mut self, station: usize, now: Nanos, state: PlcState) {
        if !self.vitals.plc_says(station, state) {
            return;
        }
        for (key, fact) in self.vitals.facts() {
            self.status.tell(key, fact);
        }
        if state == PlcState::Stop {
            self.doubt(station, now);
        }
    }

    /// Passes the validity of `station`'s data on to image and line.
    fn doubt(&mut self, station: usize, now: Nanos) {
        let is_valid = self.vitals.is_valid(station);
        self.image.stations[station].set_valid(is_valid);
        let stations = self.image.stations.iter();
        let ages = stations.map(|station| station.peer_age(now));
        self.status.doubt(now, self.vitals.doubt(), ages);
    }

    /// When the port itself has to act next, by a call of [`observe`](Self::observe); [`Nanos::MAX`] for
    /// never.
    pub fn due(&self) -> Nanos {
        self.troubles.due().min(self.vitals.due())
    }

    /// Handles injected faults: adopts new ones, and hands in frames that were held back long enough. Without
    /// faults it costs one comparison.
    #[inline]
    fn attend(&mut self, now: Nanos) {
        if self.troubles.any() {
            self.attend_to_troubles(now);
        }
    }

    #[cold]
    fn attend_to_troubles(&mut self, now: Nanos) {
        self.troubles.look(now, &self.image, &self.status);
        for station in 0..self.stations() {
            // Taken out while its frames are handed in, and put back afterwards.
            let mut frame = self.troubles.take_frame(station);
            while self.troubles.release(station, now, &mut frame) {
                self.hand_in(station, now, &frame);
            }
            self.troubles.put_frame(station, frame);
        }
    }

    /// Reports a write by the peer, for buses on which every write matters.
    pub fn event(&mut self, event: Event) {
        if self.troubles.wires().is_some_and(|wires| wires.is_down()) {
            return;
        }
        self.image.events.push(event);
    }

    /// The limit of age: older data are stale.
    pub fn max_age(&self) -> Nanos {
        self.status.max_age()
    }

    /// The time since the most silent station was heard from; [`Nanos::MAX`] if it never was.
    pub fn silence(&self, now: Nanos) -> Nanos {
        let ages = self.image.stations.iter();
        ages.map(|station| station.peer_age(now))
            .max()
            .unwrap_or_default()
    }

    /// The time since the peer of a station was heard from; [`Nanos::MAX`] if it never was.
    pub fn peer_age(&self, station: usize, now: Nanos) -> Nanos {
        self.image.stations[station].peer_age(now)
    }

    /// When the next station becomes stale if it stays silent; [`Nanos::MAX`] if all are stale.
    pub fn stale_at(&self, now: Nanos) -> Nanos {
        let limit = self.max_age();
        let ages = self.image.stations.iter();
        let ages = ages.map(|station| station.peer_age(now));
        let oldest = ages.filter(|age| *age <= limit).max();
        // Data are stale when older than the limit, not when equal.
        oldest.map_or(Nanos::MAX, |age| now + (limit - age) + Nanos(1))
    }

    /// The time since the last tick of the simulation; [`Nanos::MAX`] if there was none.
    pub fn tick_age(&self, station: usize, now: Nanos) -> Nanos {
        self.image.stations[station].tick_age(now)
    }

    /// How long the simulation may pause before fail-safe bytes are sent; `None` for any time.
    pub fn watchdog(&self) -> Option<Nanos> {
        self.watchdog
    }

    /// Checks whether the line has become stale, or is no longer stale. [`outgoing`](Self::outgoing) does
    /// this as well; this is for buses that rarely send.
    pub fn observe(&mut self, now: Nanos) {
        self.attend(now);
        while let Some(station) = self.vitals.look(now) {
            self.doubt(station, now);
        }
        let stations = self.image.stations.iter();
        let ages = stations.map(|station| station.peer_age(now));
        self.status.observe(now, ages);
    }

    /// The bus connects, or waits for its peer.
    pub fn opening(&mut self, reason: &str) {
        self.last_cycle = None;
        self.enter(LinkState::Opening, Cause::Waiting, reason);
    }

    /// The peer was lost because of `error`, and the bus continues without a pause, as `next` says.
    pub fn lost(&mut self, error: &BusError, next: &str) {
        self.last_cycle = None;
        let reason = format!("{error}; {next}");
        self.enter(LinkState::Opening, error.into(), &reason);
    }

    /// The peer is there. The port itself checks that it sends: a line that is silent for too long becomes
    /// stale.
    pub fn running(&mut self, reason: &str) {
        // Said in every cycle of some buses.
        if !self.troubles.any() && self.status.is_up() {
            return;
        }
        self.enter(LinkState::Running, Cause::Running, reason);
    }

    fn enter(&mut self, state: LinkState, cause: Cause, reason: &str) {
        let now = self.clock.now();
        let said = (state, cause, reason);
        if self.troubles.hides(now, said, &self.status) {
            return;
        }
        if state == LinkState::Running {
            self.status.running(now, reason);
        } else {
            self.status.enter(now, state, cause, reason);
        }
    }

    /// Sets a fact for the statistics, such as the bound address.
    pub fn tell(&self, key: &'static str, fact: &str) {
        self.status.tell(key, fact);
    }

    /// Increments a counter of the statistics; keys are `<kind of bus>.<what>`.
    pub fn count(&self, key: &'static str) {
        self.status.count(key);
    }

    /// Logs a message that a peer can cause any number of times; see [`LinkStatus::log`].
    pub fn log(&self, level: log::Level, kind: &'static str, message: Arguments<'_>) {
        self.status.log(level, kind, message);
    }

    /// Lets another thread supervise the [calls](Self::calling) of this one.
    pub fn call_watch(&self) -> CallWatch {
        CallWatch {
            status: self.status.clone(),
            clock: Arc::clone(&self.clock),
        }
    }

    /// Makes a library call that may not return; the statistics report it if it lasts longer than `limit`.
    pub fn calling<R>(&self, what: &Arc<str>, limit: Nanos, call: impl FnOnce() -> R) -> R {
        /// Ends the call in any case: one that panics has not hung.
        struct Ends<'a>(&'a Port);

        impl Drop for Ends<'_> {
            fn drop(&mut self) {
                self.0.status.call_ends(self.0.clock.now());
            }
        }

        self.status.call_begins(self.clock.now(), what, limit);
        let _ends = Ends(self);
        call()
    }
}

/// Supervises a bus thread's library calls from another thread.
#[derive(Clone, Debug)]
pub struct CallWatch {
    status: LinkStatus,
    clock: Arc<dyn Clock>,
}

impl CallWatch {
    /// Makes the line stale, and logs that, when a call exceeds its limit.
    pub fn look(&self) {
        self.status.observe_call(self.clock.now());
    }
}
