//! Frames of the line, lost, repeated and held back.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::board::Cell;
use super::random::Random;
use super::ring::Ring;
use super::{Board, Phase, Trouble};
use tickbus_base::time::Nanos;

/// How long a pulse holds up the frames behind it while the peer reads other bits only. Peers poll faster than that.
const PATIENCE: Nanos = Nanos::from_secs(1);

/// One trouble of the line, as the bus's side has it.
#[derive(Debug)]
pub struct LineFault {
    trouble: Trouble,
    cell: Arc<Cell>,
    random: Random,
}

impl LineFault {
    pub(super) fn new(trouble: Trouble, cell: Arc<Cell>, random: Random) -> Self {
        Self {
            trouble,
            cell,
            random,
        }
    }
}

/// What the active faults come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sum {
    /// Nothing goes out or comes in.
    down: bool,
    /// So long is held back what comes in.
    delay: Nanos,
    /// So long is held back what goes out.
    slow: Nanos,
}

/// What becomes of a frame that came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It never came.
    Lost,
    /// It is handed in as often as this.
    Passes(u32),
    /// It waits; see [`Wires::release`].
    Held,
}

/// The line between an image and its bus, with all that can happen to it.
#[derive(Debug)]
pub struct Wires {
    board: Arc<Board>,
    faults: Vec<LineFault>,
    stations: Vec<Wire>,
    sum: Sum,
    /// What chance has decided for the frames of the cycle that comes in.
    fate: Fate,
    /// Whether it has decided that the frames of the cycle that goes out repeat those of the last one.
    repeats: bool,
    /// The active troubles, in words.
    active: String,
}

/// One station's part of the line.
#[derive(Debug)]
struct Wire {
    dead: bool,
    /// Whether its part of the cycle that comes in, and of the one that goes out, is over: when it comes again, another
    /// cycle has begun, whichever station is the first of it.
    came: bool,
    went: bool,
    out: Outgoing,
    /// Received frames that wait.
    waiting: Option<Ring>,
    rx_len: usize,
}

/// Frames on their way out.
#[derive(Debug)]
struct Outgoing {
    /// The latched bits, whose every change has to be seen by the peer.
    latched: Box<[u8]>,
    /// The image's newest bytes.
    newest: Box<[u8]>,
    /// What the bus is given.
    current: Box<[u8]>,
    /// What the peer got last.
    sent: Box<[u8]>,
    /// The bits that the peer reads: all, until it leaves one out for [`PATIENCE`].
    read: Box<[u8]>,
    /// Whether the peer has read anything since `current` took its place, and since when a pulse in it has held up
    /// the frames behind it nonetheless.
    reads: bool,
    held_up: Option<Nanos>,
    /// Changes that wait.
    waiting: Option<Ring>,
    /// Whose bytes the bus was given: that decides who is told that they were sent.
    given: Given,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Given {
    /// The image's: it keeps its pulses until they were sent.
    Image,
    /// Held ones: the image has let go of them long ago.
    Held,
    /// Old ones, so that the bus has something to send.
    Nothing,
}

/// What one station's frames are like.
#[derive(Clone, Debug)]
pub struct Shape {
    /// What it sent last.
    pub last_sent: Box<[u8]>,
    /// The bits of it whose every change has to be seen by the peer.
    pub latched: Box<[u8]>,
    /// Size of the frames that come in, in bytes.
    pub rx_len: usize,
}

impl Wires {
    /// The line of stations of these shapes, with nothing wrong yet.
    pub fn new(board: Arc<Board>, stations: impl Iterator<Item = Shape>) -> Self {
        let wire = |shape: Shape| Wire {
            dead: false,
            came: true,
            went: true,
            out: Outgoing {
                latched: shape.latched,
                newest: shape.last_sent.clone(),
                current: shape.last_sent.clone(),
                read: vec![0xFF; shape.last_sent.len()].into(),
                sent: shape.last_sent,
                reads: false,
                held_up: None,
                waiting: None,
                given: Given::Image,
            },
            waiting: None,
            rx_len: shape.rx_len,
        };
        Self {
            board,
            faults: Vec::new(),
            stations: stations.map(wire).collect(),
            sum: Sum::default(),
            fate: Fate::Passes(1),
            repeats: false,
            active: String::new(),
        }
    }

    /// Takes over a fault, with all the memory that it will need.
    pub fn adopt(&mut self, fault: LineFault) {
        for wire in &mut self.stations {
            match fault.trouble {
                Trouble::Delay(_) => {
                    wire.waiting.get_or_insert_with(|| Ring::new(wire.rx_len));
                }
                Trouble::SlowAnswers(_) => {
                    let size = wire.out.current.len();
                    wire.out.waiting.get_or_insert_with(|| Ring::new(size));
                }
                _ => {}
            }
        }
        // Room for all of them at once, so that a tick that lets one begin need not make it.
        let titles = self.faults.iter().chain([&fault]);
        let room = titles.map(|fault| fault.cell.title_len() + 2).sum();
        self.active.clear();
        self.active.reserve(room);
        self.faults.push(fault);
    }

    /// Looks which faults are active.
    pub fn look(&mut self) {
        let mut sum = Sum::default();
        // Chance decides anew: of a fault that is over nothing is left behind.
        (self.fate, self.repeats) = (Fate::Passes(1), false);
        for wire in &mut self.stations {
            (wire.dead, wire.came, wire.went) = (false, true, true);
        }
        self.faults.retain(|fault| {
            let phase = fault.cell.phase();
            if phase == Phase::Active {
                match fault.trouble {
                    Trouble::Delay(by) => sum.delay += by,
                    Trouble::SlowAnswers(by) => sum.slow += by,
                    Trouble::LinkDown => sum.down = true,
                    Trouble::StationDown(station) => {
                        if let Some(wire) = self.stations.get_mut(station) {
                            wire.dead = true;
                        }
                    }
                    Trouble::Drop(..) | Trouble::Duplicate(..) => {}
                }
            }
            phase != Phase::Over
        });
        self.sum = sum;
        self.active.clear();
        for fault in &self.faults {
            if fault.cell.phase() == Phase::Active {
                if !self.active.is_empty() {
                    self.active.push_str(", ");
                }
                fault.cell.write_title(&mut self.active);
            }
        }
    }

    /// Whether nothing goes out and nothing comes in.
    pub fn is_down(&self) -> bool {
        self.sum.down
    }

    /// Throws for the active faults that `is_meant` picks the chance of.
    fn throw(faults: &mut [LineFault], is_meant: impl Fn(Trouble) -> Option<f64>) -> bool {
        let mut happens = false;
        for fault in faults {
            if fault.cell.phase() == Phase::Active
                && let Some(chance) = is_meant(fault.trouble)
            {
                // Each one throws, whatever the others threw: its numbers stay its own.
                happens |= fault.random.happens(chance);
            }
        }
        happens
    }

    /// Whether the frames of the cycle that is about to go out get lost.
    pub fn loses_cycle(&mut self) -> bool {
        let lost = Self::throw(&mut self.faults, |trouble| match trouble {
            Trouble::Drop(chance, direction) if direction.goes_out() => Some(chance),
            _ => None,
        });
        if lost {
            self.board.dropped.fetch_add(1, Ordering::Relaxed);
        }
        lost
    }

    /// Whether the frames that went out last go out again in place of new ones. Decided once for all stations of a
    /// cycle.
    pub fn repeats(&mut self, station: usize) -> bool {
        if std::mem::replace(&mut self.stations[station].went, true) {
            for (index, wire) in self.stations.iter_mut().enumerate() {
                wire.went = index == station;
            }
            self.repeats = Self::throw(&mut self.faults, |trouble| match trouble {
                Trouble::Duplicate(chance, direction) if direction.goes_out() => Some(chance),
                _ => None,
            });
            if self.repeats {
                self.board.duplicated.fetch_add(1, Ordering::Relaxed);
            }
        }
        self.repeats
    }

    /// Whether nothing of the station gets through.
    pub fn is_cut(&self, station: usize) -> bool {
        self.sum.down || self.stations[station].dead
    }

    /// What the bus sends where nothing of the station gets through: what it sent before.
    pub fn frozen(&mut self, station: usize) -> &[u8] {
        let out = &mut self.stations[station].out;
        out.given = Given::Nothing;
        &out.current
    }

    /// Takes the image's bytes on their way out; true if the image may take them for sent.
    pub fn takes(&mut self, station: usize, now: Nanos, image: &[u8]) -> bool {
        let slow = self.sum.slow;
        let out = &mut self.stations[station].out;
        if out.is_through(slow) {
            out.newest.copy_from_slice(image);
            out.current.copy_from_slice(image);
            out.given = Given::Image;
            return false;
        }
        if out.hold(now, slow, image) {
            self.board.hurried.fetch_add(1, Ordering::Relaxed);
        }
        true
    }

    /// What goes out: the same as last time, or what [`takes`](Self::takes) made of it.
    pub fn outgoing(&self, station: usize) -> &[u8] {
        &self.stations[station].out.current
    }

    /// The peer has what the bus was given last; true if the image has to know.
    pub fn sent(&mut self, station: usize) -> bool {
        let out = &mut self.stations[station].out;
        if out.given != Given::Nothing {
            out.sent.copy_from_slice(&out.current);
            out.read.fill(0xFF);
        }
        out.given == Given::Image
    }

    /// As [`sent`](Self::sent), for a peer that has these bits alone (bit n of byte k is 8k + n).
    pub fn sent_bits(&mut self, station: usize, bits: &Range<usize>) -> bool {
        let out = &mut self.stations[station].out;
        if out.given != Given::Nothing {
            for bit in bits.start..bits.end.min(8 * out.sent.len()) {
                let (byte, mask) = (bit / 8, 1 << (bit % 8));
                out.sent[byte] = out.sent[byte] & !mask | out.current[byte] & mask;
                out.read[byte] |= mask;
            }
            out.reads = true;
        }
        out.given == Given::Image
    }

    /// Decides what becomes of a frame that came in at `now`, and keeps it if it has to wait.
    pub fn arrives(&mut self, station: usize, now: Nanos, bytes: &[u8]) -> Fate {
        if !self.sum.down && std::mem::replace(&mut self.stations[station].came, true) {
            for (index, wire) in self.stations.iter_mut().enumerate() {
                wire.came = index == station;
            }
            self.fate = self.decide();
        }
        if self.is_cut(station) {
            return Fate::Lost;
        }
        let Fate::Passes(times) = self.fate else {
            return self.fate;
        };
        let Some(ring) = &mut self.stations[station].waiting else {
            return self.fate;
        };
        if self.sum.delay == Nanos::ZERO && ring.is_empty() {
            return self.fate;
        }
        for _ in 0..times {
            // Who hands frames in releases before; a ring that is full nonetheless keeps its order.
            if !ring.is_full() {
                ring.push(now, bytes);
            }
        }
        Fate::Held
    }

    fn decide(&mut self) -> Fate {
        let lost = Self::throw(&mut self.faults, |trouble| match trouble {
            Trouble::Drop(chance, direction) if direction.comes_in() => Some(chance),
            _ => None,
        });
        let twice = Self::throw(&mut self.faults, |trouble| match trouble {
            Trouble::Duplicate(chance, direction) if direction.comes_in() => Some(chance),
            _ => None,
        });
        if lost {
            self.board.dropped.fetch_add(1, Ordering::Relaxed);
            Fate::Lost
        } else if twice {
            self.board.duplicated.fetch_add(1, Ordering::Relaxed);
            Fate::Passes(2)
        } else {
            Fate::Passes(1)
        }
    }

    /// The next received frame whose time has come by `now`. When the ring has hardly room left, the oldest
    /// goes early: the order stays, and every edge is counted.
    pub fn release(&mut self, station: usize, now: Nanos, into: &mut [u8]) -> bool {
        let delay = self.sum.delay;
        let Some(ring) = &mut self.stations[station].waiting else {
            return false;
        };
        let Some((taken, bytes)) = ring.front() else {
            return false;
        };
        let due = delay == Nanos::ZERO || taken + delay <= now;
        let early = !due && ring.is_nearly_full();
        if !due && !early {
            return false;
        }
        into.copy_from_slice(bytes);
        ring.pop();
        if early {
            self.board.hurried.fetch_add(1, Ordering::Relaxed);
        }
        true
    }

    /// Whether received frames of the station wait.
    pub fn holds_back(&self, station: usize) -> bool {
        let ring = self.stations[station].waiting.as_ref();
        ring.is_some_and(|ring| !ring.is_empty())
    }

    /// When the next received frame has waited long enough; [`Nanos::MAX`] if none waits.
    pub fn due(&self) -> Nanos {
        let rings = self
            .stations
            .iter()
            .filter_map(|wire| wire.waiting.as_ref());
        let fronts = rings.filter_map(|ring| ring.front());
        let dues = fronts.map(|(taken, _)| taken + self.sum.delay);
        dues.min().unwrap_or(Nanos::MAX)
    }

    /// The active troubles, in words: `"cable" (link-down)`.
    pub fn active(&self) -> &str {
        &self.active
    }
}

impl Outgoing {
    /// Whether the image's bytes go straight to the bus.
    fn is_through(&self, slow: Nanos) -> bool {
        slow == Nanos::ZERO
            && self.waiting.as_ref().is_none_or(Ring::is_empty)
            && !(self.given == Given::Held && self.has_unseen(&self.current))
    }

    /// Whether a latched bit of `current`, which the peer has not seen, would be lost if `next` took its place.
    fn loses(&self, next: &[u8]) -> bool {
        let bytes = self.current.iter().zip(&self.sent).zip(next);
        let mut bits = bytes.zip(self.watched());
        bits.any(|(((current, sent), next), watched)| {
            (current ^ sent) & (current ^ next) & watched != 0
        })
    }

    /// The latched bits that the peer reads.
    fn watched(&self) -> impl Iterator<Item = u8> {
        let bytes = self.latched.iter().zip(&self.read);
        bytes.map(|(latched, read)| latched & read)
    }

    /// Whether the peer has read on for so long without the pulse in `current` that it does not read that at all.
    /// What it does read must not wait for ever.
    fn is_left_out(&mut self, now: Nanos) -> bool {
        if !self.reads {
            return false;
        }
        if now < *self.held_up.get_or_insert(now) + PATIENCE {
            return false;
        }
        let bytes = self.current.iter().zip(&self.sent);
        for (read, (current, sent)) in self.read.iter_mut().zip(bytes) {
            *read &= !(current ^ sent);
        }
        true
    }

    /// Whether `bytes` have a latched bit that differs from what the peer has seen.
    fn has_unseen(&self, bytes: &[u8]) -> bool {
        let mut bits = bytes.iter().zip(&self.sent).zip(self.watched());
        bits.any(|((bytes, sent), watched)| (bytes ^ sent) & watched != 0)
    }

    /// Holds the image's bytes back and finds what is due by `now`; true if something had to go early.
    fn hold(&mut self, now: Nanos, slow: Nanos, image: &[u8]) -> bool {
        let mut hurried = false;
        self.given = Given::Held;
        if *image != *self.newest {
            self.newest.copy_from_slice(image);
            if self.waiting.as_ref().is_some_and(Ring::is_full) {
                hurried = true;
                self.advance();
            }
            if let Some(ring) = &mut self.waiting {
                ring.push(now, image);
            }
        }
        while let Some((taken, next)) = self.waiting.as_ref().and_then(Ring::front) {
            let due = slow == Nanos::ZERO || taken + slow <= now;
            if !due {
                break;
            }
            if self.loses(next) {
                if !self.is_left_out(now) {
                    break;
                }
                hurried = true;
            }
            self.advance();
        }
        if slow == Nanos::ZERO {
            // The fault is over: values are true at once, edges are shown one by one.
            let bytes = self.current.iter_mut().zip(&self.newest);
            for ((current, newest), latched) in bytes.zip(&self.latched) {
                *current = (*current & latched) | (newest & !latched);
            }
        }
        hurried
    }

    /// The oldest change that waits becomes what the bus is given.
    fn advance(&mut self) {
        if let Some(ring) = &mut self.waiting
            && let Some((_, next)) = ring.front()
        {
            self.current.copy_from_slice(next);
            ring.pop();
            (self.reads, self.held_up) = (false, None);
        }
    }
}

#[cfg(test)]
mod tests;
