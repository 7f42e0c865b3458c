//! The layer beneath the faults: the image, the validity of its data, and the state of the line.

use std::ops::Range;

use tickbus_base::time::Nanos;
use tickbus_image::{BusEnd, Event, is_stale};

use super::ending::Ending;
use crate::swallowed::LOOK;
use crate::validity::Validity;
use crate::{Cause, ChangeEvents, LinkState, LinkStatus, PlcState, SwallowedSignals};

/// A bus's access to the image and to the state of its line, without injected faults.
#[derive(Debug)]
pub(super) struct ImagePort {
    pub(super) image: BusEnd,
    pub(super) watchdog: Option<Nanos>,
    /// One watcher per station, if changes are reported as events.
    pub(super) changes: Vec<ChangeEvents>,
    pub(super) status: LinkStatus,
    pub(super) validity: Validity,
    /// When the first station's last frame arrived while the line was running.
    pub(super) last_cycle: Option<Nanos>,
    /// True if the data handed in belong together with data still to come.
    pub(super) is_held: bool,
    /// Per station, true if the last cycle found the peer stale; `None` if staleness does not change the sent values.
    pub(super) blind: Option<Box<[bool]>>,
    pub(super) ending: Option<Ending>,
    /// A running line cannot become stale before this time.
    pub(super) fresh_until: Nanos,
    /// Logs the signals whose changes were swallowed, at this time.
    pub(super) swallowed: Option<SwallowedSignals>,
    pub(super) next_log: Nanos,
    /// The age of the values taken is not recorded before this time.
    pub(super) next_age: Nanos,
}

/// The shortest time between two values of the distribution of ages: a busy server answers without a rest.
const AGES: Nanos = Nanos::from_millis(1);

impl ImagePort {
    #[inline]
    pub(super) fn stations(&self) -> usize {
        self.image.stations()
    }

    /// The bytes that a station sends at `now`.
    #[inline]
    pub(super) fn outgoing(&mut self, station: usize, now: Nanos) -> &[u8] {
        if self.is_untrusted(station, now) {
            self.image.outgoing_instead(station)
        } else {
            self.image.outgoing(station, now)
        }
    }

    /// Returns true if the fail-safe values must be sent although the simulation ticks.
    fn is_untrusted(&mut self, station: usize, now: Nanos) -> bool {
        let is_ending = self.ending.as_mut().is_some_and(|ending| {
            ending.is_used(station);
            ending.is_begun()
        });
        let Some(blind) = &mut self.blind else {
            return is_ending;
        };
        let age = self.image.peer_age(station, now);
        let is_stale = is_stale(age, self.status.max_age(), self.validity.is_valid(station));
        // A process that was held up finds everything stale once, before it has polled its peers again.
        let was_stale = std::mem::replace(&mut blind[station], is_stale);
        is_ending || (is_stale && was_stale)
    }

    /// The peer has these bits of the bytes that [`outgoing`](Self::outgoing) returned last; `None` for all.
    #[inline]
    pub(super) fn sent(&mut self, station: usize, bits: Option<&Range<usize>>) {
        match bits {
            None => self.image.sent(station),
            Some(bits) => self.image.sent_bits(station, bits),
        }
    }

    /// A whole frame arrived.
    pub(super) fn received(&mut self, station: usize, now: Nanos, bytes: &[u8]) {
        if station == 0
            && let Some(last) = self.last_cycle.replace(now)
        {
            self.status.cycle(now - last);
        }
        self.is_heard(now);
        // The validity is updated before the frame: edges of invalid data do not count.
        let is_news = self.validity.arrived(station, now, bytes);
        let is_valid = self.validity.is_valid(station);
        self.image.received(station, now, bytes, is_valid);
        if is_news {
            self.update_validity(station, now);
        }
        self.hand_over();
        if let Some(changes) = self.changes.get_mut(station) {
            changes.observe(now, bytes, &mut self.image.events);
        }
    }

    /// The peer wrote these ranges of bits in the next frame of the station.
    pub(super) fn written(&mut self, station: usize, bits: impl IntoIterator<Item = Range<usize>>) {
        let mut changes = self.changes.get_mut(station);
        for bits in bits {
            if let Some(changes) = &mut changes {
                changes.written(bits);
            }
        }
    }

    /// The peer of a station was alive.
    #[inline]
    pub(super) fn touch(&mut self, station: usize, now: Nanos) {
        self.image.touch(station, now);
        self.is_heard(now);
        if self.validity.heard(station) {
            self.update_validity(station, now);
        }
        self.hand_over();
    }

    /// Takes the values that the simulation wrote last.
    #[inline]
    pub(super) fn attend(&mut self, now: Nanos) {
        self.image.attend(now, self.watchdog);
    }

    /// Records how old the values are that the bus takes at `now`.
    #[inline]
    pub(super) fn note_age(&mut self, now: Nanos) {
        if now < self.next_age {
            return;
        }
        let age = self.image.values_age(now);
        if age != Nanos::MAX {
            self.next_age = now + AGES;
            self.status.sends(age);
        }
    }

    /// Passes the data handed in to the tick, unless more data belong to them.
    #[inline]
    pub(super) fn hand_over(&mut self) {
        if !self.is_held {
            self.image.hand_over();
        }
    }

    pub(super) fn plc_state(&mut self, station: usize, now: Nanos, state: PlcState) {
        if !self.validity.plc_state(station, state) {
            return;
        }
        self.tell_facts();
        if state == PlcState::Stop {
            self.update_validity(station, now);
            self.hand_over();
        }
    }

    /// The peer of a station is gone, for this reason.
    pub(super) fn station_left(&mut self, station: usize, now: Nanos, cause: Cause, why: &str) {
        self.image.peer_left(station);
        self.validity.plc_state(station, PlcState::Stop);
        self.validity.station_left(station, cause, why);
        self.tell_facts();
        self.update_validity(station, now);
        self.hand_over();
    }

    fn tell_facts(&self) {
        for (key, fact) in self.validity.facts() {
            self.status.tell(key, fact);
        }
    }

    pub(super) fn event(&mut self, event: Event) {
        self.image.events.push(event);
    }

    /// Checks if data have become stale, or are no longer stale.
    pub(super) fn observe(&mut self, now: Nanos) {
        while let Some(station) = self.validity.look(now) {
            self.update_validity(station, now);
        }
        self.hand_over();
        if now >= self.next_log {
            self.log_swallowed(now);
        }
        if now < self.fresh_until && self.status.state() == LinkState::Running {
            return;
        }
        let (status, ages) = self.ages(now);
        status.observe(now, ages.clone());
        let oldest = ages.max().unwrap_or(Nanos::ZERO);
        self.fresh_until = now + (self.status.max_age() - oldest) + Nanos(1);
    }

    #[cold]
    fn log_swallowed(&mut self, now: Nanos) {
        self.next_log = self.swallowed.as_ref().map_or(Nanos::MAX, |_| now + LOOK);
        if let Some(swallowed) = &self.swallowed {
            swallowed.log();
            swallowed.log_ticks(self.image.take_ticks());
        }
    }

    /// Data of this time have arrived, perhaps older ones than before.
    #[inline]
    fn is_heard(&mut self, at: Nanos) {
        self.fresh_until = self.fresh_until.min(at + self.status.max_age() + Nanos(1));
    }

    /// Passes the validity of `station`'s data to the image and the line.
    fn update_validity(&mut self, station: usize, now: Nanos) {
        let is_valid = self.validity.is_valid(station);
        self.image.set_valid(station, is_valid);
        let (status, ages) = self.ages(now);
        status.doubt(now, self.validity.doubt(), ages);
    }

    /// The line, and the age of each station's data.
    fn ages(&self, now: Nanos) -> (&LinkStatus, impl Iterator<Item = Nanos> + Clone) {
        let stations = 0..self.stations();
        (
            &self.status,
            stations.map(move |station| self.image.peer_age(station, now)),
        )
    }

    /// The bus reports this state of its line.
    pub(super) fn enter(&mut self, now: Nanos, line: Report<'_>) {
        if line.state == LinkState::Running {
            self.status.running(now, line.reason);
        } else {
            self.status.enter(now, line.state, line.cause, line.reason);
        }
    }
}

/// A report of a bus about its line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Report<'a> {
    pub(super) state: LinkState,
    pub(super) cause: Cause,
    pub(super) reason: &'a str,
}
