//! The bus's end of the image.

use std::ops::Range;

use super::frame::{Frame, Place, StationStreams};
use super::stale::{NEVER, age};
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
    /// When the simulation last ticked.
    alive: Arc<AtomicI64>,
    /// The same at the last [`attend`](Self::attend): not later than the frame taken over then.
    ticked: i64,
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
    tx: Place,
    tx_shaper: PulseShaper,
    tx_fail_safe: Box<[u8]>,
    /// The bytes sent last, or about to be sent.
    outgoing: Box<[u8]>,
}

impl BusEnd {
    pub(super) fn new(
        stations: Vec<StationStreams>,
        (tx, sent): (Reader<Frame>, Vec<Place>),
        (rx, received, staged): (Writer<Frame>, Vec<Place>, Frame),
        (alive, peers, events): (Arc<AtomicI64>, Peers, Producer),
    ) -> Self {
        let stations = stations.into_iter().zip(sent).zip(received);
        let stations = stations.map(|((streams, tx), rx)| BusStation {
            rx,
            rx_edges: EdgeCounter::new(&streams.rx_latched, &streams.rx_fail_safe),
            tx,
            tx_shaper: PulseShaper::new(streams.tx_latched, &streams.tx_fail_safe),
            outgoing: streams.tx_fail_safe.clone(),
            tx_fail_safe: streams.tx_fail_safe,
        });
        Self {
            rx,
            staged,
            is_news: false,
            is_cycle: false,
            tx,
            ticked: NEVER,
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
        self.ticked = self.alive.load(Ordering::Acquire);
        self.tx.update();
        self.is_dead = watchdog.is_some_and(|limit| age(now, self.ticked) > limit);
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
        &station.outgoing
    }

    /// The exchange that carried the bytes of [`outgoing`](Self::outgoing) was completed.
    #[inline]
    pub fn sent(&mut self, station: usize) {
        self.stations[station].tx_shaper.confirm();
    }

    /// The exchange carried only these bits of [`outgoing`](Self::outgoing) and was completed; bit n of byte
    /// k is 8k + n.
    pub fn sent_bits(&mut self, station: usize, bits: &Range<usize>) {
        self.stations[station].tx_shaper.confirm_bits(bits);
    }

    /// The bytes of a station sent last, or about to be sent.
    #[inline]
    pub fn last_outgoing(&self, station: usize) -> &[u8] {
        &self.stations[station].outgoing
    }

    /// Time since the last tick of the simulation; [`Nanos::MAX`] before the first one.
    #[inline]
    pub fn tick_age(&self, now: Nanos) -> Nanos {
        age(now, self.alive.load(Ordering::Relaxed))
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
        let BusStation { rx, rx_edges, .. } = &mut self.stations[station];
        let place = &mut self.staged.bytes[rx.bytes.clone()];
        assert_eq!(
            bytes.len(),
            place.len(),
            "a received frame must have the station's size"
        );
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
        let head = &mut self.staged.heads[station];
        self.is_news |= head.heard != now.0 || self.is_cycle;
        head.heard = now.0;
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
        self.rx.publish();
        self.peers.note(&self.staged.heads);
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
