//! The tick's end of the image.
#![allow(
    clippy::inline_always,
    reason = "most ticks change nothing and find nothing, and should not pay for calls"
)]

use super::frame::{Frame, Head, Place, StationStreams};
use super::stale::{NEVER, age, is_stale};
use super::swallowed::{Returns, Swallowed};
use super::sync::{Arc, AtomicI64, Ordering};
use super::word::word_at;
use super::{Consumer, EVENT_CAPACITY, EdgeCounter, Peers, PulseShaper, Reader, Writer};
use tickbus_base::time::Nanos;

/// The number of bytes below which a memory comparison does not pay off.
const SMALL: usize = 8;

/// The tick's end of a driver's image, for all its stations, so that a tick hands over and takes over data that belong
/// together.
#[derive(Debug)]
pub struct TickEnd {
    tx: Writer<Frame>,
    sent: Vec<Sent>,
    /// When the simulation last ticked.
    alive: Arc<AtomicI64>,
    rx: Reader<Frame>,
    shown: Vec<Shown>,
    /// Of the frame taken over last.
    cycles: u64,
    /// The bus's notes about each peer, for statistics: a tick reads the same from its frame.
    pub peers: Peers,
    /// The changes that came and went between two frames that the other side took.
    pub swallowed: Swallowed,
    /// The peer's writes, for applications to which every write matters.
    pub events: Consumer,
}

/// The outgoing half of a station.
#[derive(Debug)]
struct Sent {
    place: Place,
    edges: EdgeCounter,
    /// The signals of the bits whose edges are counted.
    signals: Box<[usize]>,
    /// The bytes published last, up to eight, as a number whose least significant byte comes first.
    word: u64,
    /// The bytes of this tick, likewise.
    kept: u64,
    returns: Returns,
}

/// The incoming half of a station.
#[derive(Debug)]
struct Shown {
    place: Place,
    /// Of the frame taken over last.
    head: Head,
    /// The sequence number of the bytes that the simulation last saw.
    sequence: u64,
    shaper: PulseShaper,
    shaped: Box<[u8]>,
    /// True if the simulation sees anything other than the frame: shaped levels, or fail-safe values. Always true while
    /// the shaper has an edge to show.
    forced: bool,
}

/// Receives the data of [`TickEnd::read`].
pub trait Receiver {
    /// The station's bytes, with every edge made visible; called when they may have changed.
    fn levels(&mut self, bytes: &[u8]);

    /// How many edges of the latched signal with this index in the signal table have arrived since the last
    /// read; called for every latched signal whenever any count may have changed.
    fn edges(&mut self, signal: usize, count: u32);
}

/// The result of [`TickEnd::read`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// A whole new bus cycle has arrived since data were last shown.
    pub fresh: bool,
    /// The data are stale, and nothing was shown.
    pub stale: bool,
    /// Time since the peer was last heard; [`Nanos::MAX`] if it never was.
    pub age: Nanos,
    /// Frames received for this station so far.
    pub sequence: u64,
}

/// True if two frames differ. Small frames were just written byte by byte; a word-wide load would stall on store
/// forwarding.
#[inline]
fn differ(one: &[u8], other: &[u8]) -> bool {
    if one.len() == other.len() && one.len() <= SMALL {
        return one.iter().zip(other).any(|(one, other)| one != other);
    }
    one != other
}

impl TickEnd {
    pub(super) fn new(
        (stations, swallowed): (&[StationStreams], &Swallowed),
        (tx, sent): (Writer<Frame>, Vec<Place>),
        (rx, shown): (Reader<Frame>, Vec<Place>),
        (alive, peers, events): (Arc<AtomicI64>, Peers, Consumer),
    ) -> Self {
        let sent = stations.iter().zip(sent).map(|(streams, place)| Sent {
            place,
            edges: EdgeCounter::new(&streams.tx_latched, &streams.tx_fail_safe),
            signals: streams.tx_latched.iter().map(|bit| bit.signal).collect(),
            word: word_at(&streams.tx_fail_safe, 0),
            kept: 0,
            returns: Returns::new(&streams.tx_counted, &streams.tx_fail_safe, swallowed),
        });
        let shown = stations.iter().zip(shown).map(|(streams, place)| Shown {
            place,
            head: Head::NONE,
            sequence: 0,
            shaper: PulseShaper::new(streams.rx_latched.clone(), &streams.rx_fail_safe),
            shaped: streams.rx_fail_safe.clone(),
            forced: false,
        });
        Self {
            tx,
            sent: sent.collect(),
            alive,
            rx,
            shown: shown.collect(),
            cycles: 0,
            peers,
            swallowed: swallowed.clone(),
            events,
        }
    }

    /// The number of stations.
    pub fn stations(&self) -> usize {
        self.shown.len()
    }

    /// Lets `encode` write the whole bytes of each station; if that changed any, counts the edges and hands all of them
    /// to the bus at once. Most ticks change nothing, and need no hand-over.
    #[inline]
    pub fn write(&mut self, now: Nanos, mut encode: impl FnMut(usize, &mut [u8])) {
        let sent = &mut self.sent;
        let changed = self.tx.with_last(|frame, last| {
            for (index, Sent { place, .. }) in sent.iter().enumerate() {
                encode(index, &mut frame.bytes[place.bytes.clone()]);
            }
            let changed = differ(&frame.bytes, &last.bytes);
            if changed {
                count(sent, frame);
            }
            changed
        });
        if changed {
            self.publish();
        }
        self.ticks(now);
    }

    /// Like [`write`](Self::write), for stations of at most eight bytes whose bytes are available as a number, the least
    /// significant byte first: a tick that changes nothing then touches no frame. Writes nothing and returns false if
    /// `word` returns `None` for any station.
    #[inline(always)]
    pub fn write_words(&mut self, now: Nanos, mut word: impl FnMut(usize) -> Option<u64>) -> bool {
        let mut is_same = true;
        for (index, sent) in self.sent.iter_mut().enumerate() {
            let Some(word) = word(index) else {
                return false;
            };
            sent.kept = word;
            is_same &= sent.word == word;
        }
        if !is_same {
            self.publish_words();
        }
        self.ticks(now);
        true
    }

    /// Like [`write_words`](Self::write_words), for an image of one station.
    ///
    /// # Panics
    ///
    /// When the image has no station.
    #[inline]
    pub fn write_word(&mut self, now: Nanos, word: Option<u64>) -> bool {
        let Some(word) = word else {
            return false;
        };
        if self.sent[0].word != word {
            self.publish_word(word);
        }
        self.ticks(now);
        true
    }

    #[inline(never)]
    fn publish_word(&mut self, word: u64) {
        let Sent {
            edges,
            word: last,
            returns,
            ..
        } = &mut self.sent[0];
        *last = word;
        self.tx.with_buffer(|frame| {
            for (to, from) in frame.bytes.iter_mut().zip(word.to_le_bytes()) {
                *to = from;
            }
            edges.count(&frame.bytes, &mut frame.edges);
        });
        let was_taken = self.tx.publish();
        if !returns.is_empty() {
            if was_taken {
                returns.taken();
            }
            returns.observe_word(word, || self.peers.takes(0));
        }
    }

    #[inline(never)]
    fn publish_words(&mut self) {
        let sent = &mut self.sent;
        self.tx.with_buffer(|frame| {
            for station in sent {
                station.word = station.kept;
                let bytes = &mut frame.bytes[station.place.bytes.clone()];
                for (to, from) in bytes.iter_mut().zip(station.word.to_le_bytes()) {
                    *to = from;
                }
                let edges = &mut frame.edges[station.place.edges.clone()];
                station.edges.count(bytes, edges);
            }
        });
        self.publish();
    }

    /// Publishes the frame of a tick that changed something, and counts what no bus will see of the ones before.
    #[inline(never)]
    fn publish(&mut self) {
        let was_taken = self.tx.publish();
        let (sent, peers) = (&mut self.sent, &self.peers);
        self.tx.with_last(|_, frame| {
            for (index, Sent { place, returns, .. }) in sent.iter_mut().enumerate() {
                if returns.is_empty() {
                    continue;
                }
                if was_taken {
                    returns.taken();
                }
                let bytes = &frame.bytes[place.bytes.clone()];
                returns.observe(bytes, || peers.takes(index));
            }
        });
    }

    /// The simulation has ticked. Its values of this tick must be handed over before.
    #[inline]
    pub fn ticks(&self, now: Nanos) {
        // After the frame: a bus that sees this time and then looks for a frame finds one of at least this time.
        self.alive.store(now.0, Ordering::Release);
    }

    /// The bytes of a station that were published last, up to eight, as the number that the words of later ticks are
    /// compared with.
    #[cfg(test)]
    pub(super) fn published_word(&self, station: usize) -> u64 {
        self.sent[station].word
    }

    /// Takes over the newest frame of the peer, for all stations.
    #[inline]
    pub fn update(&mut self) {
        if self.rx.update() {
            self.take_over();
        }
    }

    #[inline(never)]
    fn take_over(&mut self) {
        let (shown, cycles) = (&mut self.shown, &mut self.cycles);
        self.rx.with(|frame| {
            *cycles = frame.cycles;
            for (station, head) in shown.iter_mut().zip(&frame.heads) {
                station.head = *head;
            }
        });
    }

    /// The age of a station's data, and whether they are valid, if [`read`](Self::read) would find nothing to show.
    #[inline]
    pub fn unchanged(&self, station: usize, now: Nanos) -> Option<(Nanos, bool)> {
        let shown = &self.shown[station];
        let Head {
            heard,
            sequence,
            is_valid,
        } = shown.head;
        if sequence != shown.sequence || shown.forced {
            return None;
        }
        Some((age(now, heard), is_valid))
    }

    /// Shows the data of a station in the frame that was [taken over](Self::update) last, if they count at `now` and
    /// there is anything new to show.
    ///
    /// Stale data are not shown, and their edges wait until data count again.
    #[inline]
    pub fn read(
        &mut self,
        station: usize,
        (now, max_age): (Nanos, Nanos),
        receiver: &mut impl Receiver,
    ) -> Arrival {
        let shown = &self.shown[station];
        let Head {
            heard,
            sequence,
            is_valid,
        } = shown.head;
        let age = age(now, heard);
        let arrival = Arrival {
            fresh: sequence != shown.sequence,
            stale: is_stale(age, max_age, is_valid),
            age,
            sequence,
        };
        // The most common tick finds nothing: the simulation ticks faster than the bus.
        if !arrival.stale && (arrival.fresh || shown.forced) {
            self.show(station, now, receiver);
        }
        arrival
    }

    #[inline(never)]
    fn show(&mut self, station: usize, now: Nanos, receiver: &mut impl Receiver) {
        let shown = &mut self.shown[station];
        shown.sequence = shown.head.sequence;
        let (shaper, shaped, forced) = (&mut shown.shaper, &mut shown.shaped, &mut shown.forced);
        let place = &shown.place;
        self.rx.with(|frame| {
            let bytes = &frame.bytes[place.bytes.clone()];
            let edges = &frame.edges[place.edges.clone()];
            let shapes = shaper.needs_shaping(edges);
            if shapes {
                for (bit, count) in shaper.bits().iter().zip(shaper.new_edges(edges)) {
                    receiver.edges(bit.signal, count);
                }
                shaped.copy_from_slice(bytes);
                shaper.shape(edges, now, shaped);
                shaper.confirm();
                receiver.levels(shaped);
            } else {
                if *forced {
                    // No edge now, but there were some at the last read.
                    no_edges(shaper, receiver);
                }
                shaper.pass(bytes);
                shaper.confirm();
                receiver.levels(bytes);
            }
            *forced = shapes;
        });
    }

    /// Records that the simulation sees levels other than the frame's (fail-safe values), without edges, so that the next
    /// [`read`](Self::read) of data that count shows the frame again.
    ///
    /// The shaper continues from what the peer showed last: if a level is on by its fail-safe value, and the
    /// peer switches it on when it returns, it must not drop in between to show that edge.
    pub fn shown_instead(&mut self, station: usize, receiver: &mut impl Receiver) {
        self.overridden(station);
        no_edges(&self.shown[station].shaper, receiver);
    }

    /// Like [`shown_instead`](Self::shown_instead), with edges that are not the frame's either.
    pub fn overridden(&mut self, station: usize) {
        self.shown[station].forced = true;
    }

    /// Forgets what the simulation has seen, for a simulation that restarts: the next [`read`](Self::read) of data that
    /// count shows the levels of the newest frame. Edges and events that no tick has shown yet are dropped.
    pub fn restart(&mut self) {
        self.update();
        let shown = &mut self.shown;
        self.rx.with(|frame| {
            for Shown {
                place,
                shaper,
                forced,
                ..
            } in shown
            {
                shaper.restart(&frame.edges[place.edges.clone()]);
                *forced = true;
            }
        });
        // At most a full ring: the bus may report further events meanwhile.
        for _ in 0..EVENT_CAPACITY {
            if self.events.pop().is_none() {
                break;
            }
        }
    }

    /// The last bytes of a station, stale or not.
    pub fn latest(&self, station: usize) -> &[u8] {
        &self.rx.value().bytes[self.shown[station].place.bytes.clone()]
    }

    /// Bus cycles whose data arrived up to the frame taken over last: a cycle counts once for all stations that it
    /// carries.
    #[inline]
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Calls `tell` for every latched signal of a station, with its index in the signal table and the number of its
    /// edges so far, in both directions; the counts wrap.
    pub fn edges(&self, station: usize, mut tell: impl FnMut(usize, u32)) {
        let (sent, shown) = (&self.sent[station], &self.shown[station]);
        for (signal, count) in sent.signals.iter().zip(sent.edges.counts()) {
            tell(*signal, *count);
        }
        self.rx.with(|frame| {
            let counts = &frame.edges[shown.place.edges.clone()];
            for (bit, count) in shown.shaper.bits().iter().zip(counts) {
                tell(bit.signal, *count);
            }
        });
    }
}

/// Counts the edges of a frame that is about to be published.
fn count(sent: &mut [Sent], frame: &mut Frame) {
    for Sent {
        place, edges, word, ..
    } in sent
    {
        let bytes = &frame.bytes[place.bytes.clone()];
        edges.count(bytes, &mut frame.edges[place.edges.clone()]);
        *word = word_at(bytes, 0);
    }
}

fn no_edges(shaper: &PulseShaper, receiver: &mut impl Receiver) {
    let bits = shaper.bits().iter();
    bits.for_each(|bit| receiver.edges(bit.signal, 0));
}

/// Before the first tick.
pub(super) fn never() -> Arc<AtomicI64> {
    Arc::new(AtomicI64::new(NEVER))
}
