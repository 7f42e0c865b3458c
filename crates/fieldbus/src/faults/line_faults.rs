//! Frames that are lost, repeated or held back on the line.

mod outgoing;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use self::outgoing::{Given, Outgoing};
use super::ring::Ring;
use super::{Diagnosis, FaultBoard, LineEffect, LineFault, Phase};
use tickbus_base::time::Nanos;

/// The combined effect of the active faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sum {
    /// Nothing is sent or received.
    down: bool,
    /// How long incoming frames are held back.
    delay: Nanos,
    /// How long outgoing frames are held back.
    slow: Nanos,
}

/// What happens to an incoming frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It is lost.
    Lost,
    /// It is delivered this many times.
    Passes(u32),
    /// It has to wait; see [`LineFaults::release`].
    Held,
}

/// The line between an image and its bus, with its injected faults.
#[derive(Debug)]
pub struct LineFaults {
    board: Arc<FaultBoard>,
    faults: Vec<LineFault>,
    stations: Vec<Wire>,
    sum: Sum,
    /// What was decided at random for the frames of the current incoming cycle.
    fate: Fate,
    /// Whether the frames of the current outgoing cycle repeat those of the previous one.
    repeats: bool,
    /// The active faults, as text.
    active: String,
    /// What the stations report, in the order of the faults, and whether that is new.
    diagnoses: Vec<Diagnosis>,
    is_diagnosis_new: bool,
}

/// The part of the line that belongs to one station.
#[derive(Debug)]
struct Wire {
    dead: bool,
    /// Whether the station has had its turn in the current incoming, and in the current outgoing cycle. When
    /// it comes again, the next cycle has begun, whichever station is its first.
    came: bool,
    went: bool,
    out: Outgoing,
    /// The outcome of the newest received frame.
    newest: Outcome,
    /// Received frames that are held back.
    waiting: Option<Ring>,
    /// When the last of them came.
    released: Nanos,
    rx_len: usize,
}

/// When a bus took the image of a station last, or repeated it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Taken {
    /// Not yet.
    #[default]
    Never,
    /// At this time, by the present connection.
    At(Nanos),
    /// By a connection before the present one.
    Before,
}

impl Taken {
    /// The bus opens its line again.
    pub fn reopen(&mut self) {
        if *self != Self::Never {
            *self = Self::Before;
        }
    }
}

/// The outcome of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// Handed on, or held back.
    Handed,
    /// Lost by a fault that is still active.
    Lost,
}

/// The shape of one station's frames.
#[derive(Clone, Debug)]
pub struct Shape {
    /// What it sent last.
    pub last_sent: Box<[u8]>,
    /// When the bus took that.
    pub taken: Taken,
    /// The mask of the bits of which the peer has to see each change.
    pub latched: Box<[u8]>,
    /// Size of the frames that come in, in bytes.
    pub rx_len: usize,
}

impl LineFaults {
    /// The line to stations of these shapes, without any fault.
    pub fn new(board: Arc<FaultBoard>, stations: impl Iterator<Item = Shape>) -> Self {
        let wire = |shape: Shape| Wire {
            dead: false,
            came: true,
            went: true,
            out: Outgoing::new(shape.last_sent, shape.latched, shape.taken),
            newest: Outcome::Handed,
            waiting: None,
            released: Nanos(i64::MIN),
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
            diagnoses: Vec::new(),
            is_diagnosis_new: false,
        }
    }

    /// Adopts a fault, and allocates everything that it will need.
    pub fn adopt(&mut self, fault: LineFault) {
        for wire in &mut self.stations {
            match fault.trouble {
                LineEffect::Delay(_) => {
                    wire.waiting.get_or_insert_with(|| Ring::new(wire.rx_len));
                }
                LineEffect::SlowAnswers(_) => {
                    let size = wire.out.current.len();
                    wire.out.waiting.get_or_insert_with(|| Ring::new(size));
                }
                _ => {}
            }
        }
        // Reserved for all of them now, so that a tick at which one begins need not allocate.
        let titles = self.faults.iter().chain([&fault]);
        let room = titles.map(|fault| fault.cell.title_len() + 2).sum();
        self.active.clear();
        self.active.reserve(room);
        self.diagnoses.reserve(self.faults.len() + 1);
        self.faults.push(fault);
    }

    /// Lets the diagnoses count as new.
    pub fn report_diagnoses_anew(&mut self) {
        self.is_diagnosis_new = true;
    }

    /// Looks up which faults are active.
    pub fn look(&mut self) {
        let mut sum = Sum::default();
        // The fates of frames are drawn anew: a fault that is over must not leave anything behind.
        for wire in &mut self.stations {
            (wire.dead, wire.came, wire.went) = (false, true, true);
        }
        let mut loses = false;
        let mut diagnoses = 0;
        let mut report = |diagnosis, all: &mut Vec<Diagnosis>| {
            let is_new = all.get(diagnoses) != Some(&diagnosis);
            if is_new {
                all.truncate(diagnoses);
                all.push(diagnosis);
            }
            diagnoses += 1;
            is_new
        };
        self.faults.retain(|fault| {
            let phase = fault.cell.phase();
            if phase == Phase::Active {
                match fault.trouble {
                    LineEffect::Delay(by) => sum.delay += by,
                    LineEffect::SlowAnswers(by) => sum.slow += by,
                    LineEffect::LinkDown => sum.down = true,
                    LineEffect::StationDown(station) => {
                        if let Some(wire) = self.stations.get_mut(station) {
                            wire.dead = true;
                        }
                    }
                    LineEffect::Diagnosis(own) => {
                        self.is_diagnosis_new |= report(own, &mut self.diagnoses);
                    }
                    LineEffect::Drop(_, direction) => loses |= direction.comes_in(),
                    LineEffect::Duplicate(..) => {}
                }
            }
            phase != Phase::Over
        });
        self.is_diagnosis_new |= self.diagnoses.len() > diagnoses;
        self.diagnoses.truncate(diagnoses);
        self.sum = sum;
        for wire in &mut self.stations {
            if !loses {
                wire.newest = Outcome::Handed;
            }
        }
        if sum.down {
            self.carries_nothing();
        }
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

    /// The line is interrupted: the next cycle neither repeats nor delays what the bus sent before.
    pub fn carries_nothing(&mut self) {
        for wire in &mut self.stations {
            wire.out.taken = Taken::Before;
        }
    }

    /// Whether nothing goes out and nothing comes in.
    pub fn is_down(&self) -> bool {
        self.sum.down
    }

    /// Draws for each active fault for which `is_meant` gives a probability; tells whether any of them hits.
    fn draw(faults: &mut [LineFault], is_meant: impl Fn(LineEffect) -> Option<f64>) -> bool {
        let mut happens = false;
        for fault in faults {
            if fault.cell.phase() == Phase::Active
                && let Some(chance) = is_meant(fault.trouble)
            {
                // Every fault draws, whether or not another one hit: its sequence of numbers must not depend
                // on the others.
                happens |= fault.random.happens(chance);
            }
        }
        happens
    }

    /// Whether the frames of the cycle that is about to go out get lost.
    pub fn loses_cycle(&mut self) -> bool {
        let lost = Self::draw(&mut self.faults, |trouble| match trouble {
            LineEffect::Drop(chance, direction) if direction.goes_out() => Some(chance),
            _ => None,
        });
        if lost {
            self.board.dropped.fetch_add(1, Ordering::Relaxed);
        }
        lost
    }

    /// Returns true if the previous frames are sent again at `now` instead of new ones. One decision holds for all stations
    /// of a cycle.
    pub fn repeats(&mut self, station: usize, now: Nanos) -> bool {
        if std::mem::replace(&mut self.stations[station].went, true) {
            for (index, wire) in self.stations.iter_mut().enumerate() {
                wire.went = index == station;
            }
            self.repeats = Self::draw(&mut self.faults, |trouble| match trouble {
                LineEffect::Duplicate(chance, direction) if direction.goes_out() => Some(chance),
                _ => None,
            });
            self.repeats &= !self.stations[station].out.has_paused(now);
            if self.repeats {
                self.board.duplicated.fetch_add(1, Ordering::Relaxed);
            }
        }
        let is_cut = self.is_cut(station);
        let out = &mut self.stations[station].out;
        // A station that is asked separately may have paused alone.
        out.repeats = self.repeats && !is_cut && !out.has_paused(now);
        if out.repeats {
            out.taken = Taken::At(now);
        }
        out.repeats
    }

    /// Whether nothing gets through to or from the station.
    pub fn is_cut(&self, station: usize) -> bool {
        self.sum.down || self.stations[station].dead
    }

    /// What the bus sends while the station is cut off: the bytes that it sent before.
    pub fn frozen(&mut self, station: usize) -> &[u8] {
        let out = &mut self.stations[station].out;
        out.given = Given::Nothing;
        &out.current
    }

    /// Takes the image's outgoing bytes; true if the image may regard them as sent.
    pub fn takes(&mut self, station: usize, now: Nanos, image: &[u8]) -> bool {
        let slow = self.sum.slow;
        let out = &mut self.stations[station].out;
        if out.is_through(slow) {
            out.catches_up(now);
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

    /// The bytes to send: the same as last time, or those chosen by [`takes`](Self::takes).
    pub fn outgoing(&self, station: usize) -> &[u8] {
        &self.stations[station].out.current
    }

    /// The peer has these bits (bit n of byte k is 8k + n) of what the bus was given last, `None` for all; true if
    /// the image must be told.
    pub fn sent(&mut self, station: usize, bits: Option<&Range<usize>>) -> bool {
        let out = &mut self.stations[station].out;
        match bits {
            _ if out.given == Given::Nothing => {}
            None => {
                out.sent.copy_from_slice(&out.current);
                out.read.fill(0xFF);
            }
            Some(bits) => {
                for bit in bits.start..bits.end.min(8 * out.sent.len()) {
                    let (byte, mask) = (bit / 8, 1 << (bit % 8));
                    out.sent[byte] = out.sent[byte] & !mask | out.current[byte] & mask;
                    out.read[byte] |= mask;
                }
                out.reads = true;
            }
        }
        out.given == Given::Image
    }

    /// Whether the bus was given the image's newest bytes: no fault holds them back or repeats others.
    pub fn gives_newest(&self, station: usize) -> bool {
        let out = &self.stations[station].out;
        !out.repeats && out.given != Given::Nothing && out.current == out.newest
    }

    /// Decides what happens to a frame that arrived at `now`, and stores it if it has to wait.
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
        let wire = &mut self.stations[station];
        wire.newest = match self.fate {
            Fate::Lost => Outcome::Lost,
            _ => Outcome::Handed,
        };
        let Fate::Passes(times) = self.fate else {
            return self.fate;
        };
        let Some(ring) = &mut wire.waiting else {
            return self.fate;
        };
        if self.sum.delay == Nanos::ZERO && ring.is_empty() {
            return self.fate;
        }
        for _ in 0..times {
            // Callers release before they hand in, so the ring has room; if it is full even so, order is kept
            // and the frame lost.
            if !ring.is_full() {
                ring.push(now, bytes);
            }
        }
        Fate::Held
    }

    fn decide(&mut self) -> Fate {
        let lost = Self::draw(&mut self.faults, |trouble| match trouble {
            LineEffect::Drop(chance, direction) if direction.comes_in() => Some(chance),
            _ => None,
        });
        let twice = Self::draw(&mut self.faults, |trouble| match trouble {
            LineEffect::Duplicate(chance, direction) if direction.comes_in() => Some(chance),
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

    /// The next held frame that is due by `now`, and when it came: where nobody looked for long, as while the process was
    /// suspended, that was long ago. When the ring is nearly full, the oldest frame is released early: the order is kept, and
    /// every edge is counted.
    pub fn release(&mut self, station: usize, now: Nanos, into: &mut [u8]) -> Option<Nanos> {
        let delay = self.sum.delay;
        let wire = &mut self.stations[station];
        let ring = wire.waiting.as_mut()?;
        let (taken, bytes) = ring.front()?;
        let came = taken + delay;
        let early = came > now && ring.is_nearly_full();
        if came > now && !early {
            return None;
        }
        // A delay that has become shorter lets nothing come before what came already.
        let came = came.max(wire.released).min(now);
        wire.released = came;
        into.copy_from_slice(bytes);
        ring.pop();
        if early {
            self.board.hurried.fetch_add(1, Ordering::Relaxed);
        }
        Some(came)
    }

    /// Whether the newest frame of the station has not been delivered: it is held back, or was lost.
    pub fn withholds(&self, station: usize) -> bool {
        let wire = &self.stations[station];
        let ring = wire.waiting.as_ref();
        wire.newest == Outcome::Lost || ring.is_some_and(|ring| !ring.is_empty())
    }

    /// When the next received frame is due; [`Nanos::MAX`] if none is held back.
    pub fn due(&self) -> Nanos {
        let rings = self
            .stations
            .iter()
            .filter_map(|wire| wire.waiting.as_ref());
        let fronts = rings.filter_map(|ring| ring.front());
        let dues = fronts.map(|(taken, _)| taken + self.sum.delay);
        dues.min().unwrap_or(Nanos::MAX)
    }

    /// What the stations report to their masters, if that has changed since the last call.
    pub fn take_diagnoses(&mut self) -> Option<&[Diagnosis]> {
        std::mem::take(&mut self.is_diagnosis_new).then_some(&self.diagnoses)
    }

    /// The active faults, as text: `"cable" (link-down)`.
    pub fn active(&self) -> &str {
        &self.active
    }
}

#[cfg(test)]
mod tests;
