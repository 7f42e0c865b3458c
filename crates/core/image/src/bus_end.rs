//! The bus's end of the image.

use std::ops::Range;

use super::frame::{Frame, Place, StationStreams};
use super::stale::{NEVER, age};
use super::swallowed::{Returns, Swallowed};
use super::sync::{Arc, AtomicI64, Ordering};
use super::{EdgeCounter, LatchedBit, Peers, Producer, PulseShaper, Reader, Writer, copy_frame};
use tickbus_base::time::Nanos;

/// The bus's end of a driver's image, for all its stations. The effects of [`received`](Self::received),
/// [`touch`](Self::touch) and [`set_valid`](Self::set_valid) reach the tick together, with the next
/// [`hand_over`](Self::hand_over).
#[derive(Debug)]
pub struct BusEnd {
    rx: Writer<Frame>,
    /// The frame to hand over next.
    staged: Frame,
    /// True if the frame differs from the one handed over last, and if it differs in received data.
    is_news: bool,
    is_cycle: bool,
    tx: Reader<Frame>,
    /// The number of frames taken over, and the bytes of one that the bus did not look at.
    taken: u64,
    unseen: Box<[u8]>,
    /// When the simulation last ticked.
    alive: Arc<AtomicI64>,
    /// The same at the last [`attend`](Self::attend): not later than the frame taken over then.
    ticked: i64,
    /// The shortest time from one tick to the next that was seen here since it was asked for, and how many were seen.
    tick: Nanos,
    ticks: u64,
    is_dead: bool,
    stations: Vec<BusStation>,
    peers: Peers,
    /// Where a bus reports the peer's writes.
    pub events: Producer,
}

/// One station of the bus's end.
#[derive(Debug)]
struct BusStation {
    rx: Place,
    rx_edges: EdgeCounter,
    rx_fail_safe: Box<[u8]>,
    /// True if the bytes are those of a peer whose place another one has taken, which has not been heard yet.
    expects_other: bool,
    tx: Place,
    tx_shaper: PulseShaper,
    tx_fail_safe: Box<[u8]>,
    /// The bytes sent last, or about to be sent.
    outgoing: Box<[u8]>,
    /// True if these are fail-safe values in place of the simulation's.
    is_instead: bool,
    /// The peer has taken frames.
    takes: bool,
    /// Of the frames shown to the bus, against those that the peer has; and the number of the one shown last.
    tx_returns: Returns,
    shown: u64,
    /// Of the frames handed over, against those that a tick has taken.
    rx_returns: Returns,
    /// The sequence number handed over last.
    handed: u64,
}

impl BusEnd {
    pub(super) fn new(
        (stations, swallowed): (Vec<StationStreams>, &Swallowed),
        (tx, sent): (Reader<Frame>, Vec<Place>),
        (rx, received, staged): (Writer<Frame>, Vec<Place>, Frame),
        (alive, peers, events): (Arc<AtomicI64>, Peers, Producer),
    ) -> Self {
        let unseen = tx.value().bytes.clone();
        let stations = stations.into_iter().zip(sent).zip(received);
        let stations = stations.map(|((streams, tx), rx)| BusStation {
            rx,
            rx_edges: EdgeCounter::new(&streams.rx_latched, &streams.rx_fail_safe),
            rx_fail_safe: streams.rx_fail_safe.clone(),
            expects_other: false,
            tx,
            tx_shaper: PulseShaper::new(streams.tx_latched, &streams.tx_fail_safe),
            outgoing: streams.tx_fail_safe.clone(),
            is_instead: true,
            takes: false,
            tx_returns: Returns::new(&streams.tx_counted, &streams.tx_fail_safe, swallowed),
            shown: 0,
            rx_returns: Returns::new(&streams.rx_counted, &streams.rx_fail_safe, swallowed),
            handed: 0,
            tx_fail_safe: streams.tx_fail_safe,
        });
        Self {
            rx,
            staged,
            is_news: false,
            is_cycle: false,
            tx,
            taken: 0,
            unseen,
            ticked: NEVER,
            tick: Nanos::MAX,
            ticks: 0,
            is_dead: false,
            alive,
            stations: stations.collect(),
            peers,
            events,
        }
    }

    /// The number of stations.
    #[inline]
    pub fn stations(&self) -> usize {
        self.stations.len()
    }

    /// Takes over the simulation's last values: all stations of one tick. From now on stations send the fail-safe bytes
    /// if the simulation has not ticked for longer than `watchdog`, or never.
    #[inline]
    pub fn attend(&mut self, now: Nanos, watchdog: Option<Nanos>) {
        // Before the frame, which the tick publishes first: so no old frame passes for one of a simulation that ticks
        // again.
        let ticked = self.alive.load(Ordering::Acquire);
        if ticked != self.ticked {
            self.tick = self.tick.min(age(Nanos(ticked), self.ticked));
            self.ticks += 1;
            self.ticked = ticked;
        }
        if self.tx.has_news() {
            self.take_over();
        }
        self.is_dead = watchdog.is_some_and(|limit| age(now, self.ticked) > limit);
    }

    /// Takes over a newer frame, and counts the changes of a frame before it that the bus did not look at.
    #[inline]
    fn take_over(&mut self) {
        let is_unseen = |station: &BusStation, taken| {
            station.shown != taken && station.takes && !station.tx_returns.is_empty()
        };
        let has_unseen = self.stations.iter().any(|one| is_unseen(one, self.taken));
        if has_unseen {
            self.unseen.copy_from_slice(&self.tx.value().bytes);
        }
        self.tx.update();
        if has_unseen {
            let frame = self.tx.value();
            for station in self
                .stations
                .iter()
                .filter(|one| is_unseen(one, self.taken))
            {
                let place = station.tx.bytes.clone();
                let (old, new) = (&self.unseen[place.clone()], &frame.bytes[place]);
                station.tx_returns.replaced(old, new);
            }
        }
        self.taken += 1;
    }

    /// The bytes of a station to send in an exchange at `now`: those that were [taken over](Self::attend), with their
    /// pulses shaped.
    ///
    /// A pulse counts as sent only when [`sent`](Self::sent) is called.
    pub fn outgoing(&mut self, station: usize, now: Nanos) -> &[u8] {
        if self.is_dead {
            return self.outgoing_instead(station);
        }
        let station = &mut self.stations[station];
        let (shaper, place, frame) = (&mut station.tx_shaper, &station.tx, self.tx.value());
        copy_frame(&mut station.outgoing, &frame.bytes[place.bytes.clone()]);
        station.is_instead = false;
        if station.shown != self.taken {
            station.shown = self.taken;
            if !station.tx_returns.is_empty() {
                let returns = &mut station.tx_returns;
                returns.observe(&station.outgoing, || station.takes);
            }
        }
        let edges = &frame.edges[place.edges.clone()];
        if shaper.needs_shaping(edges) {
            shaper.shape(edges, now, &mut station.outgoing);
        } else {
            shaper.pass(&station.outgoing);
        }
        &station.outgoing
    }

    /// The fail-safe bytes of a station to send in an exchange, whatever the simulation writes. They show no pulses.
    pub fn outgoing_instead(&mut self, station: usize) -> &[u8] {
        let station = &mut self.stations[station];
        station.tx_shaper.pass_instead(&station.tx_fail_safe);
        station.outgoing.copy_from_slice(&station.tx_fail_safe);
        station.is_instead = true;
        &station.outgoing
    }

    /// The exchange that carried the bytes of [`outgoing`](Self::outgoing) was completed.
    #[inline]
    pub fn sent(&mut self, station: usize) {
        let of = &mut self.stations[station];
        of.tx_shaper.confirm();
        if !of.is_instead {
            of.tx_returns.taken();
        }
        self.takes(station);
    }

    /// The exchange carried only these bits of [`outgoing`](Self::outgoing) and was completed; bit n of byte
    /// k is 8k + n.
    pub fn sent_bits(&mut self, station: usize, bits: &Range<usize>) {
        let of = &mut self.stations[station];
        of.tx_shaper.confirm_bits(bits);
        if !of.is_instead {
            of.tx_returns.taken_bits(bits);
        }
        self.takes(station);
    }

    /// The peer of a station takes frames.
    #[inline]
    fn takes(&mut self, station: usize) {
        if !std::mem::replace(&mut self.stations[station].takes, true) {
            self.peers.note_takes(station, true);
        }
    }

    /// The peer of a station is gone, or was never there: no change is swallowed until it takes frames again.
    pub fn peer_left(&mut self, station: usize) {
        if std::mem::take(&mut self.stations[station].takes) {
            self.peers.note_takes(station, false);
        }
    }

    /// The bytes of a station sent last, or about to be sent.
    #[inline]
    pub fn last_outgoing(&self, station: usize) -> &[u8] {
        &self.stations[station].outgoing
    }

    /// How old the values that were [taken over](Self::attend) are at `now`; [`Nanos::MAX`] before the first tick.
    #[inline]
    pub fn values_age(&self, now: Nanos) -> Nanos {
        age(now, self.ticked)
    }

    /// Time since the last tick of the simulation; [`Nanos::MAX`] before the first one.
    #[inline]
    pub fn tick_age(&self, now: Nanos) -> Nanos {
        age(now, self.alive.load(Ordering::Relaxed))
    }

    /// The number of ticks seen since the last call, and the shortest time between two of them. Where several ticks pass
    /// between two calls of [`attend`](Self::attend), only the last one is seen, so the time is then that between the calls.
    pub fn take_ticks(&mut self) -> (u64, Nanos) {
        let ticks = std::mem::take(&mut self.ticks);
        (ticks, std::mem::replace(&mut self.tick, Nanos::MAX))
    }

    /// Time since the peer of a station was last heard; [`Nanos::MAX`] if it never was.
    #[inline]
    pub fn peer_age(&self, station: usize, now: Nanos) -> Nanos {
        age(now, self.staged.heads[station].heard)
    }

    /// Whole bytes of a station have arrived, from a peer with valid data or not: counts the edges of valid data.
    ///
    /// # Panics
    ///
    /// When `bytes` is not exactly as long as the station's rx bytes: wire code must check lengths.
    pub fn received(&mut self, station: usize, now: Nanos, bytes: &[u8], is_valid: bool) {
        if self.stations[station].expects_other {
            self.other_peer(station);
        }
        let BusStation {
            rx,
            rx_edges,
            rx_returns,
            handed,
            ..
        } = &mut self.stations[station];
        let place = &mut self.staged.bytes[rx.bytes.clone()];
        assert_eq!(
            bytes.len(),
            place.len(),
            "a received frame must have the station's size"
        );
        // A frame that still waits is replaced.
        let is_waiting = self.staged.heads[station].sequence != *handed;
        if is_waiting && is_valid && self.alive.load(Ordering::Relaxed) != NEVER {
            rx_returns.replaced(place, bytes);
        }
        copy_frame(place, bytes);
        if is_valid {
            rx_edges.count(bytes, &mut self.staged.edges[rx.edges.clone()]);
        } else {
            rx_edges.pass(bytes);
        }
        let head = &mut self.staged.heads[station];
        head.sequence += 1;
        head.is_valid = is_valid;
        self.is_cycle = true;
        self.touch(station, now);
    }

    /// The peer of a station is alive, though it sent no new data.
    #[inline]
    pub fn touch(&mut self, station: usize, now: Nanos) {
        if self.stations[station].expects_other {
            self.other_peer(station);
            // Bytes of the same number are the same.
            self.staged.heads[station].sequence += 1;
        }
        let head = &mut self.staged.heads[station];
        self.is_news |= head.heard != now.0 || self.is_cycle;
        head.heard = now.0;
    }

    /// Other peers take the place of all stations' peers: nothing has arrived from them, so the data are stale. With their
    /// first sign of life the fail-safe bytes replace the last ones of the peers before, without edges.
    pub fn expect_other_peers(&mut self) {
        for (station, head) in self.stations.iter_mut().zip(&mut self.staged.heads) {
            (head.heard, head.is_valid) = (NEVER, true);
            station.expects_other = true;
        }
        (0..self.stations()).for_each(|station| self.peer_left(station));
        self.is_news = true;
    }

    /// The first sign of life of another peer.
    #[cold]
    fn other_peer(&mut self, station: usize) {
        let other = &mut self.stations[station];
        other.expects_other = false;
        let place = &mut self.staged.bytes[other.rx.bytes.clone()];
        copy_frame(place, &other.rx_fail_safe);
        other.rx_edges.pass(&other.rx_fail_safe);
    }

    /// Sets whether the data of a station's peer are valid.
    pub fn set_valid(&mut self, station: usize, is_valid: bool) {
        let head = &mut self.staged.heads[station];
        self.is_news |= head.is_valid != is_valid;
        head.is_valid = is_valid;
    }

    /// Hands over all changes since the last time, if there were any.
    #[inline]
    pub fn hand_over(&mut self) {
        if !std::mem::take(&mut self.is_news) {
            return;
        }
        self.staged.cycles += u64::from(std::mem::take(&mut self.is_cycle));
        let (staged, stations) = (&self.staged, &self.stations);
        self.rx.with_buffer(|frame| {
            frame.cycles = staged.cycles;
            let heads = frame.heads.iter_mut().zip(&staged.heads).zip(stations);
            for ((head, new), BusStation { rx, .. }) in heads {
                // Bytes and edges of the same number are the same.
                if head.sequence != new.sequence {
                    let bytes = rx.bytes.clone();
                    copy_frame(&mut frame.bytes[bytes.clone()], &staged.bytes[bytes]);
                    let edges = rx.edges.clone();
                    frame.edges[edges.clone()].copy_from_slice(&staged.edges[edges]);
                }
                *head = *new;
            }
        });
        let was_taken = self.rx.publish();
        self.peers.note(&self.staged.heads);
        for (station, head) in self.stations.iter_mut().zip(&self.staged.heads) {
            let is_new = std::mem::replace(&mut station.handed, head.sequence) != head.sequence;
            if station.rx_returns.is_empty() {
                continue;
            }
            let returns = &mut station.rx_returns;
            if was_taken {
                returns.taken();
            }
            if is_new {
                let bytes = &self.staged.bytes[station.rx.bytes.clone()];
                if head.is_valid {
                    returns.observe(bytes, || self.alive.load(Ordering::Relaxed) != NEVER);
                } else {
                    returns.pass(bytes);
                }
            }
        }
    }

    /// The latched bits of a station's outgoing bytes.
    pub fn tx_latched(&self, station: usize) -> &[LatchedBit] {
        self.stations[station].tx_shaper.bits()
    }

    /// Size of a station's incoming bytes.
    pub fn rx_len(&self, station: usize) -> usize {
        self.stations[station].rx.bytes.len()
    }

    /// Size of a station's outgoing bytes.
    pub fn tx_len(&self, station: usize) -> usize {
        self.stations[station].outgoing.len()
    }
}
