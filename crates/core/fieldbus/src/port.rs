//! A bus's view of its driver.
//!
//! The types enforce the order of calls. A driver gives the [`Port`] its faults and watchers before the bus gets the
//! port. A bus [takes](Port::take) the [`Frames`] of a cycle, and only these give the [`Receipt`] that informs
//! [`sent`](Port::sent) which frames the peer has.

mod calls;
mod ending;
mod faults;
mod frames;
mod image;
mod looks;
mod next_bus;

pub use calls::CallWatch;
pub use ending::{Farewell, Outputs};
pub use frames::{Frames, Receipt};

use std::fmt::Arguments;
use std::ops::Range;
use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_image::{BusEnd, Event};

use super::validity::Validity;
use super::{
    BusError, Cause, ChangeEvents, LinkState, LinkStatus, Medium, PlcState, Role, SwallowedSignals,
    Watch,
};
use crate::faults::{Diagnosis, FaultBoard, Request, Spoilt, WrongAnswer};
use crate::traffic::{Traffic, Way};
use faults::FaultLayer;
use image::{ImagePort, Report};
use looks::Looks;

/// A bus's access to the image, the clock and the state of its driver.
#[derive(Debug)]
pub struct Port {
    image: ImagePort,
    looks: Looks,
    faults: FaultLayer,
    /// How faults spoil the answer that the bus is making.
    spoilt: Spoilt,
    /// The stations whose answer to the last request is late.
    late: Vec<usize>,
    clock: Arc<dyn Clock>,
    role: Role,
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
            faults: FaultLayer::new(Arc::default(), image.stations()),
            spoilt: Spoilt::default(),
            late: Vec::new(),
            looks: Looks::new(status.max_age()),
            image: ImagePort {
                validity: Validity::new(image.stations()),
                image,
                watchdog,
                changes: Vec::new(),
                status,
                last_cycle: None,
                is_held: false,
                blind: None,
                ending: None,
                fresh_until: Nanos::ZERO,
                swallowed: None,
                next_log: Nanos::ZERO,
                next_age: Nanos::ZERO,
            },
            clock,
            role,
        }
    }

    /// The same port with the faults on `board` on its line.
    #[must_use]
    pub fn with_faults(mut self, board: Arc<FaultBoard>) -> Self {
        self.faults = FaultLayer::new(board, self.image.stations());
        self
    }

    /// The same port with the stations' names, in the order of the signal table, for reasons and statistics.
    #[must_use]
    pub fn with_names<'a>(mut self, names: impl IntoIterator<Item = &'a str>) -> Self {
        self.image.validity.name_stations(names.into_iter());
        self
    }

    /// The same port with data that are valid only as long as these signals keep changing.
    #[must_use]
    pub fn with_life_signs(mut self, watches: Vec<Watch>) -> Self {
        self.image.validity.watch(watches);
        self
    }

    /// The same port, which logs the signals whose changes were swallowed.
    #[must_use]
    pub fn with_swallowed(mut self, swallowed: SwallowedSignals) -> Self {
        self.image.swallowed = Some(swallowed);
        self
    }

    /// The same port, which reports every change between received frames as an event; `changes` has one watcher per
    /// station.
    ///
    /// # Panics
    ///
    /// If `changes` has a different number of watchers.
    #[must_use]
    pub fn with_changes(mut self, changes: Vec<ChangeEvents>) -> Self {
        assert_eq!(changes.len(), self.stations(), "one watcher per station");
        self.image.changes = changes;
        self
    }

    /// The end of the line that this port serves.
    pub fn role(&self) -> Role {
        self.role
    }

    /// The driver's clock.
    pub fn clock(&self) -> &Arc<dyn Clock> {
        &self.clock
    }

    /// Waits until `deadline`, until the port itself is [due](Self::due), or until `stop` wakes it.
    pub fn wait_until(&self, deadline: Nanos, stop: &Stop) {
        self.clock.wait_until(deadline.min(self.due()), stop);
    }

    /// The number of stations.
    #[inline]
    pub fn stations(&self) -> usize {
        self.image.stations()
    }

    /// The sizes in bytes of the frames that a station sends and receives.
    pub fn sizes(&self, station: usize) -> (usize, usize) {
        let image = &self.image.image;
        (image.tx_len(station), image.rx_len(station))
    }

    /// Returns true if the line can carry anything at `now`. While it cannot, the bus must not answer the peer, and
    /// data handed in are lost.
    #[inline]
    pub fn is_up(&mut self, now: Nanos) -> bool {
        self.look_for_end();
        self.faults.attend(now, &mut self.image);
        !self.faults.is_down()
    }

    /// The frames that these stations send in a cycle at `now`. `None` if nothing is to be sent in this cycle, because
    /// the line is not [up](Self::is_up) or loses the frames.
    #[inline]
    pub fn take(&mut self, stations: Range<usize>, now: Nanos) -> Option<Frames<'_>> {
        if !self.is_up(now) {
            return None;
        }
        self.image.attend(now);
        self.image.note_age(now);
        if self.faults.loses_cycle() {
            self.lose(stations, now);
            return None;
        }
        Some(Frames {
            port: self,
            stations,
            now,
        })
    }

    /// Marks these frames as sent, although an injected fault loses them.
    #[cold]
    fn lose(&mut self, stations: Range<usize>, now: Nanos) {
        for station in stations {
            self.outgoing(station, now);
            self.faults.sent(station, None, &mut self.image);
        }
    }

    /// The frames of these stations at `now`, to check if there is anything to send, or for a peer that reads at any
    /// time; `None` while the line is not [up](Self::is_up).
    pub fn look(&mut self, stations: Range<usize>, now: Nanos) -> Option<Frames<'_>> {
        if !self.is_up(now) {
            return None;
        }
        self.image.attend(now);
        Some(Frames {
            port: self,
            stations,
            now,
        })
    }

    /// As [`take`](Self::take), of all stations.
    #[inline]
    pub fn take_all(&mut self, now: Nanos) -> Option<Frames<'_>> {
        self.take(0..self.stations(), now)
    }

    #[inline]
    fn outgoing(&mut self, station: usize, now: Nanos) -> &[u8] {
        if station == 0 {
            // Taking the frames has updated the faults.
            self.image.observe(now);
        }
        self.faults.outgoing(station, now, &mut self.image)
    }

    /// The peer has received the frames of this receipt, or will unless the line breaks. For a stream this is so once
    /// the system has accepted all bytes. Data in transit when a line breaks are lost, pulses included.
    #[inline]
    pub fn sent(&mut self, receipt: &Receipt) {
        self.had(receipt);
        for station in receipt.stations.clone() {
            let bits = receipt.bits.as_ref();
            let whole = self.image.image.tx_len(station);
            let octets = bits.map_or(whole, |bits| bits.len().div_ceil(8));
            self.traffic().data(station, Way::Out, octets);
            self.faults.sent(station, bits, &mut self.image);
        }
    }

    /// The bus begins to read from a line that is new at `now`. The bus promises to [look](Self::look_at_line) at the
    /// line by [`next_look`](Self::next_look), even if nothing arrives.
    ///
    /// A clock that does not [advance automatically](Clock::passes_alone) needs no promise: its time does not pass
    /// while the process is suspended.
    pub fn begin_to_look(&mut self, now: Nanos) {
        if self.clock.passes_alone() {
            self.looks.begin(now);
        }
    }

    /// The bus looks at the line at `now`, and then hands in the data found. If the look is much later than promised,
    /// because the process was suspended or the processors were busy, the data may have waited all that time: they
    /// count as having arrived right after the previous look.
    pub fn look_at_line(&mut self, now: Nanos) {
        self.looks.look(now);
    }

    /// This look leaves some of the waiting data to the next one.
    pub fn look_leaves_some(&mut self) {
        self.looks.leaves_some();
    }

    /// The data that the bus hands in next arrived at `at`. For a bus that knows this time and does not
    /// [look](Self::look_at_line).
    pub fn came_at(&mut self, at: Nanos) {
        self.looks.came(at);
    }

    /// The time by which the bus must look at its line even if nothing arrives; [`Nanos::MAX`] for never.
    pub fn next_look(&self) -> Nanos {
        self.looks.next()
    }

    /// Hands in data that belong together: the frames of all stations in one message of the peer, and signs of life. A
    /// tick sees everything that `hand_in` hands in, or nothing of it. An injected fault that begins or ends meanwhile
    /// does not affect these data.
    pub fn together<R>(&mut self, hand_in: impl FnOnce(&mut Self) -> R) -> R {
        let is_part = std::mem::replace(&mut self.image.is_held, true);
        if !is_part {
            self.faults.begin_together();
        }
        let result = hand_in(self);
        self.image.is_held = is_part;
        self.image.hand_over();
        result
    }

    /// Hands in a whole frame that arrived at `now`. Frames of several stations that arrived in one message must be
    /// handed in [together](Self::together).
    ///
    /// # Panics
    ///
    /// If the frame does not have the station's size.
    #[inline]
    pub fn received(&mut self, station: usize, now: Nanos, bytes: &[u8]) {
        self.received_with(station, now, bytes, bytes.len());
    }

    /// As [`received`](Self::received), for a frame of which the peer sent only as many octets as `sent`.
    ///
    /// # Panics
    ///
    /// If the frame does not have the station's size.
    #[inline]
    pub fn received_with(&mut self, station: usize, now: Nanos, bytes: &[u8], sent: usize) {
        self.traffic().data(station, Way::In, sent);
        self.faults.attend(now, &mut self.image);
        let arrival = self.looks.arrival(now);
        self.faults
            .received(station, arrival, bytes, &mut self.image);
    }

    /// As [`received`](Self::received), for a frame of which the peer wrote only these ranges of bits (bit n of byte k
    /// is 8k + n). If events are enabled, each signal within these ranges is reported, even if its value is unchanged.
    ///
    /// # Panics
    ///
    /// If the frame does not have the station's size.
    pub fn received_parts(
        &mut self,
        station: usize,
        now: Nanos,
        bytes: &[u8],
        written: impl IntoIterator<Item = Range<usize>>,
    ) {
        // Frames held back earlier are handed in first, since these writes do not belong to them.
        self.faults.attend(now, &mut self.image);
        let mut octets = 0;
        let written = written.into_iter();
        let counted = written.inspect(|bits| octets += bits.len().div_ceil(8));
        self.image.written(station, counted);
        self.received_with(station, now, bytes, octets);
    }

    /// Reports that the peer was alive at `now`. After a STOP has ended, the station's data are valid again
    /// from then on; if the station is read, hand in its first frame before this call.
    #[inline]
    pub fn touch(&mut self, station: usize, now: Nanos) {
        let arrival = self.looks.arrival(now);
        self.faults.touch(station, arrival, &mut self.image);
    }

    /// The PLC of `station` reports that it runs its program, or that it does not. In the latter case the station is
    /// stale at once, however recent its data are. The station becomes fresh with the first data after the PLC reports
    /// that it runs. Call this as often as the PLC reports; the last report stays valid when the line breaks.
    pub fn plc_state(&mut self, station: usize, now: Nanos, state: PlcState) {
        self.image.plc_state(station, now, state);
    }

    /// Reports a write by the peer, for buses on which every write matters.
    pub fn event(&mut self, event: Event) {
        self.faults.event(event, &mut self.image);
    }

    /// The peer of `station` exchanges no data any more, for this reason: as [`plc_state`](Self::plc_state) with
    /// [`PlcState::Stop`], but with a cause and a reason from the bus.
    pub fn station_left(&mut self, station: usize, now: Nanos, cause: Cause, why: &str) {
        self.image.station_left(station, now, cause, why);
    }

    /// Returns true if injected line faults are active, or if frames that they held back have yet to arrive: the data
    /// handed in are then not the data that the tick gets.
    #[inline]
    pub fn is_distorted(&mut self, now: Nanos) -> bool {
        self.faults.attend(now, &mut self.image);
        self.faults.is_distorting()
    }

    /// Returns true if the line can carry anything to and from this station at `now`.
    pub fn is_station_up(&mut self, station: usize, now: Nanos) -> bool {
        self.faults.attend(now, &mut self.image);
        !self.faults.is_cut(station)
    }

    /// A station answers a request with this function code. Returns the error with which it has to refuse the request by
    /// an injected fault; for buses that [have answers](super::BusOptions::has_answers). Whoever makes the answer's
    /// telegram then [takes](Self::take_wrong) what is wrong with it, and who sends it [holds it
    /// back](Self::take_lateness).
    #[inline]
    pub fn answer(&mut self, station: usize, function: u8, now: Nanos) -> Option<u8> {
        let names = &|_| false;
        self.answer_request(
            Request {
                station,
                function,
                names,
            },
            now,
        )
    }

    /// As [`answer`](Self::answer), for a bus whose faults depend on the elements of a request.
    #[inline]
    pub fn answer_request(&mut self, request: Request<'_>, now: Nanos) -> Option<u8> {
        let code = self.any_answer(request, now)?;
        // A bus whose codes are bytes reads no others.
        u8::try_from(code).ok()
    }

    /// As [`answer`](Self::answer), for a bus whose codes are longer.
    #[inline]
    pub fn answer_status(&mut self, station: usize, function: u8, now: Nanos) -> Option<u32> {
        let names = &|_| false;
        self.any_answer(
            Request {
                station,
                function,
                names,
            },
            now,
        )
    }

    #[inline]
    fn any_answer(&mut self, request: Request<'_>, now: Nanos) -> Option<u32> {
        if self.faults.any() {
            self.answer_by_faults(request, now)
        } else {
            None
        }
    }

    #[cold]
    fn answer_by_faults(&mut self, request: Request<'_>, now: Nanos) -> Option<u32> {
        self.faults.attend(now, &mut self.image);
        let spoilt = self.faults.answer(request);
        if self.spoilt.late == Nanos::ZERO {
            // The lateness of the answer before was taken.
            self.late.clear();
        }
        if spoilt.late > Nanos::ZERO {
            self.late.push(request.station);
        }
        self.spoilt.late = self.spoilt.late.max(spoilt.late);
        self.spoilt.pause = self.spoilt.pause.max(spoilt.pause);
        self.spoilt.wrong = self.spoilt.wrong.or(spoilt.wrong);
        spoilt.error
    }

    /// The way in which the answer that was made last is malformed; only the first call returns it.
    #[inline]
    pub fn take_wrong(&mut self) -> Option<WrongAnswer> {
        self.spoilt.wrong.take()
    }

    /// How much later the answer that was made last goes out; only the first call returns it.
    #[inline]
    pub fn take_lateness(&mut self) -> Nanos {
        std::mem::take(&mut self.spoilt.late)
    }

    /// The time between two bytes of the answer that was made last; only the first call returns it.
    #[inline]
    pub fn take_pause(&mut self) -> Nanos {
        std::mem::take(&mut self.spoilt.pause)
    }

    /// The stations whose answer that was made last is late; only the first call returns them.
    #[inline]
    pub fn take_late_stations(&mut self) -> Vec<usize> {
        std::mem::take(&mut self.late)
    }

    /// Makes the next [`take_diagnoses`](Self::take_diagnoses) repeat its last report, for stations that restart.
    pub fn report_diagnoses_anew(&mut self) {
        self.faults.report_diagnoses_anew();
    }

    /// The reports of the stations to their master, from injected faults, if they have changed since the last call; for
    /// buses that [have a diagnosis](super::BusOptions::has_diagnosis).
    pub fn take_diagnoses(&mut self, now: Nanos) -> Option<&[Diagnosis]> {
        self.faults.attend(now, &mut self.image);
        self.faults.take_diagnoses()
    }

    /// The time of the port's next own action, for which the bus calls [`observe`](Self::observe); [`Nanos::MAX`] for
    /// never.
    pub fn due(&self) -> Nanos {
        self.faults.due().min(self.image.validity.due())
    }

    /// Checks if the line has become stale, or is no longer stale. The frames of the first station do this as well;
    /// this call is for buses that rarely send.
    pub fn observe(&mut self, now: Nanos) {
        self.faults.attend(now, &mut self.image);
        self.image.observe(now);
    }

    /// The limit of age: older data are stale.
    pub fn max_age(&self) -> Nanos {
        self.image.status.max_age()
    }

    /// The time since the peer of a station was heard from; [`Nanos::MAX`] if it never was.
    pub fn peer_age(&self, station: usize, now: Nanos) -> Nanos {
        self.image.image.peer_age(station, now)
    }

    /// When the next station becomes stale if it stays silent; [`Nanos::MAX`] if all are stale.
    pub fn stale_at(&self, now: Nanos) -> Nanos {
        let limit = self.max_age();
        let ages = (0..self.stations()).map(|station| self.peer_age(station, now));
        let oldest = ages.filter(|age| *age <= limit).max();
        // Data are stale when older than the limit, not when equal.
        oldest.map_or(Nanos::MAX, |age| now + (limit - age) + Nanos(1))
    }

    /// The time since the last tick of the simulation; [`Nanos::MAX`] before the first tick.
    pub fn tick_age(&self, now: Nanos) -> Nanos {
        self.image.image.tick_age(now)
    }

    /// How long the simulation may pause before fail-safe bytes are sent; `None` for no limit.
    pub fn watchdog(&self) -> Option<Nanos> {
        self.image.watchdog
    }

    /// The bus connects, or waits for its peer.
    pub fn opening(&mut self, reason: &str) {
        self.opening_of(0..self.stations(), reason);
    }

    /// As [`opening`](Self::opening), where only these stations have no peer: those of others may be there.
    pub fn opening_of(&mut self, stations: Range<usize>, reason: &str) {
        self.image.last_cycle = None;
        // A bus that panicked may have left something half handed in.
        self.image.is_held = false;
        self.peers_left(stations);
        self.enter(LinkState::Opening, Cause::Waiting, reason);
    }

    /// The peer was lost because of `error`, and the bus continues without a pause, as `next` describes.
    pub fn lost(&mut self, error: &BusError, next: &str) {
        self.lost_of(0..self.stations(), error, next);
    }

    /// As [`lost`](Self::lost), where only these stations have lost their peer.
    pub fn lost_of(&mut self, stations: Range<usize>, error: &BusError, next: &str) {
        self.image.last_cycle = None;
        self.peers_left(stations);
        let reason = format!("{error}; {next}");
        self.enter(LinkState::Opening, error.into(), &reason);
    }

    fn peers_left(&mut self, stations: Range<usize>) {
        stations.for_each(|station| self.image.image.peer_left(station));
    }

    /// The peer is present. The port checks that the peer sends: a line that is silent for too long becomes stale.
    #[inline]
    pub fn running(&mut self, reason: &str) {
        // Some buses call this in every cycle.
        if !self.faults.any() && self.image.status.is_up() {
            return;
        }
        self.enter(LinkState::Running, Cause::Running, reason);
    }

    fn enter(&mut self, state: LinkState, cause: Cause, reason: &str) {
        let report = Report {
            state,
            cause,
            reason,
        };
        let now = self.clock.now();
        self.faults.enter(now, report, &mut self.image);
    }

    #[inline]
    fn traffic(&self) -> &Traffic {
        self.image.status.traffic()
    }

    /// States the medium of the line, for a bus whose frames carry the process data that it hands in and reports as
    /// [sent](Self::sent). Without a medium the statistics have octets, and neither frames nor an efficiency.
    pub fn carried_by(&self, medium: Medium) {
        self.traffic().carried_by(medium);
    }

    /// The bus has written these octets to the line of a station, or to its only line (0). `completes`: they are a
    /// telegram, or the end of one.
    #[inline]
    pub fn wrote(&self, line: usize, octets: usize, completes: bool) {
        self.traffic().moved(line, Way::Out, octets, completes);
    }

    /// The bus has read these octets from the line of a station, or from its only line (0).
    #[inline]
    pub fn read(&self, line: usize, octets: usize) {
        self.traffic().moved(line, Way::In, octets, false);
    }

    /// This many telegrams have arrived on a serial line, where reads end anywhere.
    pub fn read_telegrams(&self, count: u64) {
        self.traffic().frames_in(count);
    }

    /// This many of the octets read from a serial line are this end's own echo, or marks of the serial port.
    pub fn not_from_peer(&self, octets: usize) {
        self.traffic().not_from_peer(octets);
    }

    /// Sets a fact for the statistics, such as the bound address.
    pub fn tell(&self, key: &'static str, fact: &str) {
        self.image.status.tell(key, fact);
    }

    /// Increments a counter of the statistics; keys are `<kind of bus>.<what>`.
    pub fn count(&self, key: &'static str) {
        self.image.status.count(key);
    }

    /// Logs a message that a peer can cause any number of times; see [`LinkStatus::log`].
    pub fn log(&self, level: log::Level, kind: &'static str, message: Arguments<'_>) {
        self.image.status.log(level, kind, message);
    }
}

#[cfg(all(test, not(loom)))]
mod tests;
