//! What a bus sees of its driver.

use std::fmt::Arguments;
use std::ops::Range;
use std::sync::Arc;

use crate::faults::{Board, Fate};
use crate::image::{BusEnd, Event};
use crate::time::{Clock, Nanos};

use super::troubles::Troubles;
use super::vitals::Vitals;
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
    /// When the first station's last frame arrived, while the line is running.
    last_cycle: Option<Nanos>,
    troubles: Troubles,
    vitals: Vitals,
}

impl Port {
    /// A port over the bus's end of an image.
    ///
    /// When the simulation has not ticked for longer than `watchdog`, fail-safe bytes go out.
    pub fn new(
        image: BusEnd,
        clock: Arc<dyn Clock>,
        role: Role,
        watchdog: Option<Nanos>,
        status: LinkStatus,
    ) -> Self {
        Self {
            vitals: Vitals::new(image.stations.len()),
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

    /// Lets the line suffer from the faults on `board`.
    pub fn suffer_from(&mut self, board: Arc<Board>) {
        self.troubles = Troubles::of(board);
    }

    /// Gives the stations the names that reasons and statistics call them, in the order of the signal table.
    pub fn name_stations<'a>(&mut self, names: impl IntoIterator<Item = &'a str>) {
        self.vitals.name_stations(names.into_iter());
    }

    /// Lets the data of a station count only while these signals change.
    pub fn watch_life(&mut self, watches: Vec<Watch>) {
        self.vitals.watch(watches);
    }

    /// Reports every change between received frames as an event; one watcher per station.
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

    /// How many stations there are.
    pub fn stations(&self) -> usize {
        self.image.stations.len()
    }

    /// Sizes in bytes of the frames that a station sends and receives.
    pub fn sizes(&self, station: usize) -> (usize, usize) {
        let station = &self.image.stations[station];
        (station.tx_len(), station.rx_len())
    }

    /// Whether an injected fault holds the line down: nothing is to be sent or taken at `now`.
    ///
    /// A bus that does not ask sends what it sent before, and what it hands in is lost.
    pub fn is_down(&mut self, now: Nanos) -> bool {
        self.attend(now);
        self.troubles.wires().is_some_and(|wires| wires.is_down())
    }

    /// Whether frames go out in the cycle at `now`. To be asked once a cycle, before
    /// [`outgoing`](Self::outgoing): an injected fault may swallow them, and what was to be sent is lost.
    pub fn sends(&mut self, now: Nanos) -> bool {
        self.sends_of(0..self.stations(), now)
    }

    /// The same for a bus whose `stations` have a cycle of their own.
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

    /// The bytes that a station sends at `now`: latest values, no edge lost, fail-safe when the
    /// simulation has stopped. Follow with [`sent`](Self::sent) once the peer has them.
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

    /// The peer has what [`outgoing`](Self::outgoing) gave last, or will get it unless the line breaks: for a
    /// stream that is when the system has taken the whole of it. What is under way when a line breaks is lost,
    /// pulses too.
    pub fn sent(&mut self, station: usize) {
        if self
            .troubles
            .wires()
            .is_none_or(|wires| wires.sent(station))
        {
            self.image.stations[station].sent();
        }
    }

    /// As [`sent`](Self::sent), for a peer that has only these bytes of the frame: no pulse elsewhere counts as
    /// seen by it.
    pub fn sent_part(&mut self, station: usize, bytes: Range<usize>) {
        self.sent_bits(station, bytes.start * 8..bytes.end * 8);
    }

    /// As [`sent_part`](Self::sent_part), for a peer that has only these bits (bit n of byte k is 8k + n): the other
    /// bits of their bytes are news to it.
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
    /// When the frame has not the station's size.
    pub fn received(&mut self, station: usize, now: Nanos, bytes: &[u8]) {
        self.attend(now);
        let times = match self.troubles.wires() {
            None => 1,
            Some(wires) => match wires.arrives(station, now, bytes) {
                Fate::Lost | Fate::Held => {
                    // When a held frame comes in, its changes are events.
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

    /// Hands in a whole frame that arrived at `now` and of which the peer wrote these bits alone (bit n of byte k
    /// is 8k + n). Where events are wanted, each signal within them is one, even if its value is the same.
    ///
    /// # Panics
    ///
    /// When the frame has not the station's size.
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
    /// When the frame has not the station's size.
    pub fn received_parts(
        &mut self,
        station: usize,
        now: Nanos,
        bytes: &[u8],
        written: impl IntoIterator<Item = Range<usize>>,
    ) {
        // What was held back comes in first: these writes are none of its own.
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

    /// Says that the peer was alive at `now`. After a STOP that is over, the data of the station count again from
    /// then on; where something of it is read, its first frame has to be handed in before.
    pub fn touch(&mut self, station: usize, now: Nanos) {
        let wires = self.troubles.wires();
        // Who is late must not seem alive by what has not come yet.
        if wires.is_none_or(|wires| !wires.is_cut(station) && !wires.holds_back(station)) {
            self.image.stations[station].touch(now);
            if self.vitals.heard(station) {
                self.doubt(station, now);
            }
        }
    }

    /// The PLC of `station` says that it runs its program, or that it does not: then the station is stale at once,
    /// however young its data are. Fresh again is what comes after it said that it runs. To be called as often as
    /// the PLC says it; what it said last stays when the line breaks.
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

    /// Lets image and line follow what is known of the data of `station`.
    fn doubt(&mut self, station: usize, now: Nanos) {
        let is_valid = self.vitals.is_valid(station);
        self.image.stations[station].set_valid(is_valid);
        let stations = self.image.stations.iter();
        let ages = stations.map(|station| station.peer_age(now));
        self.status.doubt(now, self.vitals.doubt(), ages);
    }

    /// When the port itself has something to do next, for which [`observe`](Self::observe) is to be called;
    /// [`Nanos::MAX`] if nothing.
    pub fn due(&self) -> Nanos {
        self.troubles.due().min(self.vitals.due())
    }

    /// Looks after the injected faults: takes over new ones, and hands in what was held back long enough.
    /// Costs one look at a number while there are none.
    #[inline]
    fn attend(&mut self, now: Nanos) {
        if self.troubles.are_there() {
            self.attend_to_troubles(now);
        }
    }

    #[cold]
    fn attend_to_troubles(&mut self, now: Nanos) {
        self.troubles.look(now, &self.image, &self.status);
        for station in 0..self.stations() {
            // Taken out while frames are handed in, and put back.
            let mut frame = self.troubles.take_frame(station);
            while self.troubles.release(station, now, &mut frame) {
                self.hand_in(station, now, &frame);
            }
            self.troubles.put_frame(station, frame);
        }
    }

    /// Reports a write of the peer, for buses whose every write matters.
    pub fn event(&mut self, event: Event) {
        if self.troubles.wires().is_some_and(|wires| wires.is_down()) {
            return;
        }
        self.image.events.push(event);
    }

    /// The limit of age: what is older is stale.
    pub fn max_age(&self) -> Nanos {
        self.status.max_age()
    }

    /// How long ago the station that has been silent longest was heard of; [`Nanos::MAX`] for never.
    pub fn silence(&self, now: Nanos) -> Nanos {
        let ages = self.image.stations.iter();
        ages.map(|station| station.peer_age(now))
            .max()
            .unwrap_or_default()
    }

    /// How long ago the peer of a station was heard of; [`Nanos::MAX`] for never.
    pub fn peer_age(&self, station: usize, now: Nanos) -> Nanos {
        self.image.stations[station].peer_age(now)
    }

    /// When the next station becomes stale if nothing comes from it; [`Nanos::MAX`] if all are.
    pub fn stale_at(&self, now: Nanos) -> Nanos {
        let limit = self.max_age();
        let ages = self.image.stations.iter();
        let ages = ages.map(|station| station.peer_age(now));
        let oldest = ages.filter(|age| *age <= limit).max();
        // One more than the limit is stale.
        oldest.map_or(Nanos::MAX, |age| now + (limit - age) + Nanos(1))
    }

    /// How long ago the simulation ticked last; [`Nanos::MAX`] for never.
    pub fn tick_age(&self, station: usize, now: Nanos) -> Nanos {
        self.image.stations[station].tick_age(now)
    }

    /// For how long the simulation may not tick before fail-safe bytes go out; `None` for ever.
    pub fn watchdog(&self) -> Option<Nanos> {
        self.watchdog
    }

    /// Looks whether the line has become stale, or is so no more. [`outgoing`](Self::outgoing) does it, too;
    /// this is for buses that have nothing to send for long.
    pub fn observe(&mut self, now: Nanos) {
        self.attend(now);
        while let Some(station) = self.vitals.look(now) {
            self.doubt(station, now);
        }
        let stations = self.image.stations.iter();
        let ages = stations.map(|station| station.peer_age(now));
        self.status.observe(now, ages);
    }

    /// The line is on its way, or waits for its peer.
    pub fn opening(&mut self, reason: &str) {
        self.last_cycle = None;
        self.enter(LinkState::Opening, Cause::Waiting, reason);
    }

    /// The peer was lost for `error`, and the bus goes on without a pause, as `next` says.
    pub fn lost(&mut self, error: &BusError, next: &str) {
        self.last_cycle = None;
        let reason = format!("{error}; {next}");
        self.enter(LinkState::Opening, error.into(), &reason);
    }

    /// The peer is there. Whether it also says anything is looked after by the port: a line that is silent
    /// for too long becomes stale by itself.
    pub fn running(&mut self, reason: &str) {
        // Said in every cycle of some buses.
        if !self.troubles.are_there() && self.status.is_up() {
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

    /// Notes a fact for the statistics, such as the address that was bound.
    pub fn tell(&self, key: &'static str, fact: &str) {
        self.status.tell(key, fact);
    }

    /// Counts something for the statistics; keys are `<kind of bus>.<what>`.
    pub fn count(&self, key: &'static str) {
        self.status.count(key);
    }

    /// Writes a message of which a peer can cause as many as it likes; see [`LinkStatus::log`].
    pub fn log(&self, level: log::Level, kind: &'static str, message: Arguments<'_>) {
        self.status.log(level, kind, message);
    }

    /// What another thread needs to look after the [calls](Self::calling) of this one.
    pub fn call_watch(&self) -> CallWatch {
        CallWatch {
            status: self.status.clone(),
            clock: Arc::clone(&self.clock),
        }
    }

    /// Makes a call into a library that may not return, and lets the statistics tell when it lasts for longer
    /// than `limit`.
    pub fn calling<R>(&self, what: &Arc<str>, limit: Nanos, call: impl FnOnce() -> R) -> R {
        /// Ends the call, however it ends: one that panics has not hung.
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

/// Looks after the calls into a library that a bus thread makes, from another thread.
#[derive(Clone, Debug)]
pub struct CallWatch {
    status: LinkStatus,
    clock: Arc<dyn Clock>,
}

impl CallWatch {
    /// Lets the line be stale, and the log say so, when a call lasts longer than it may.
    pub fn look(&self) {
        self.status.observe_call(self.clock.now());
    }
}
