//! Frames that are lost, repeated or held back on the line.

mod outgoing;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use self::outgoing::{Given, Outgoing};
use super::ring::Ring;
use super::{Diagnosis, FaultBoard, LineEffect, LineFault, Phase, Request, Spoilt};
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
    /// Answers are wrong.
    spoils: bool,
}

/// The fate of an incoming frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// The frame is lost.
    Lost,
    /// The frame is delivered this many times.
    Passes(u32),
    /// The frame has to wait; see [`LineFaults::release`].
    Held,
}

/// The line between an image and its bus, with its injected faults.
#[derive(Debug)]
pub struct LineFaults {
    board: Arc<FaultBoard>,
    faults: Vec<LineFault>,
    stations: Vec<Wire>,
    sum: Sum,
    /// The random decision for the frames of the current incoming cycle.
    fate: Fate,
    /// True if the frames of the current outgoing cycle repeat those of the previous one.
    repeats: bool,
    /// The cycle's repetition is counted.
    is_counted: bool,
    /// The active faults, as text.
    active: String,
    /// The reports of the stations, in the order of the faults; `is_diagnosis_new` is true if they are new.
    diagnoses: Vec<Diagnosis>,
    is_diagnosis_new: bool,
}

/// The part of the line that belongs to one station.
#[derive(Debug)]
struct Wire {
    dead: bool,
    /// True if the station has had its turn in the current incoming cycle (`came`) or outgoing cycle (`went`). Its next
    /// turn begins the next cycle, whichever station is first in that cycle.
    came: bool,
    went: bool,
    out: Outgoing,
    /// The outcome of the newest received frame.
    newest: Outcome,
    /// Received frames that are held back.
    waiting: Option<Ring>,
    /// When the last released frame arrived.
    released: Nanos,
    rx_len: usize,
}

/// When a bus last took or repeated the image of a station.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Taken {
    /// Not yet.
    #[default]
    Never,
    /// At this time, on the current connection.
    At(Nanos),
    /// On a connection before the current one.
    Before,
}

impl Taken {
    /// The bus reopens its line.
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
    /// The bytes that the station sent last.
    pub last_sent: Box<[u8]>,
    /// When the bus took these bytes.
    pub taken: Taken,
    /// The mask of the bits whose every change the peer must see.
    pub latched: Box<[u8]>,
    /// The size of incoming frames, in bytes.
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
            is_counted: false,
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
                LineEffect::LateValues(_) => {
                    let size = wire.out.current.len();
                    wire.out.waiting.get_or_insert_with(|| Ring::new(size));
                }
                _ => {}
            }
        }
        // Memory for all titles is reserved now, so that the tick at which a fault begins need not allocate.
        let titles = self.faults.iter().chain([&fault]);
        let room = titles.map(|fault| fault.cell.title_len() + 2).sum();
        self.active.clear();
        self.active.reserve(room);
        self.diagnoses.reserve(self.faults.len() + 1);
        self.faults.push(fault);
    }

    /// Marks the diagnoses as new.
    pub fn report_diagnoses_anew(&mut self) {
        self.is_diagnosis_new = true;
    }

    /// Reads from the board which faults are active.
    pub fn look(&mut self) {
        let mut sum = Sum::default();
        // The fates of frames are drawn again: a fault that is over must leave nothing behind.
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
                    LineEffect::LateValues(by) => sum.slow += by,
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
                    LineEffect::Answer(_) => sum.spoils = true,
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

    /// The line is interrupted: the next cycle neither repeats nor delays earlier frames of the bus.
    pub fn carries_nothing(&mut self) {
        for wire in &mut self.stations {
            wire.out.taken = Taken::Before;
        }
    }

    /// Returns true if no frames are sent or received.
    pub fn is_down(&self) -> bool {
        self.sum.down
    }

    /// Draws a random number for each active fault for which `is_meant` returns a probability; returns true if any of
    /// them hits.
    fn draw(faults: &mut [LineFault], is_meant: impl Fn(LineEffect) -> Option<f64>) -> bool {
        let mut happens = false;
        for fault in faults {
            if fault.cell.phase() == Phase::Active
                && let Some(chance) = is_meant(fault.trouble)
            {
                // Every fault draws, even if another one hit: its sequence of numbers must not depend on the others.
                happens |= fault.random.happens(chance);
            }
        }
        happens
    }

    /// How the answer to a request is spoilt.
    pub fn answer(&mut self, request: Request<'_>) -> Spoilt {
        let mut spoilt = Spoilt::default();
        if !self.sum.spoils {
            return spoilt;
        }
        for fault in &mut self.faults {
            if fault.cell.phase() == Phase::Active
                && let Some((chance, trouble)) = fault.trouble.on_answer(request)
                && fault.random.happens(chance)
            {
                spoilt.add(trouble);
            }
        }
        if spoilt != Spoilt::default() {
            self.board.spoilt.fetch_add(1, Ordering::Relaxed);
        }
        spoilt
    }

    /// Returns true if the frames of the next outgoing cycle get lost.
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

    /// Returns true if the previous frames are sent again at `now` instead of new ones. One decision applies to all
    /// stations of a cycle.
    pub fn repeats(&mut self, station: usize, now: Nanos) -> bool {
        if std::mem::replace(&mut self.stations[station].went, true) {
            for (index, wire) in self.stations.iter_mut().enumerate() {
                wire.went = index == station;
            }
            self.repeats = Self::draw(&mut self.faults, |trouble| match trouble {
                LineEffect::Duplicate(chance, direction) if direction.goes_out() => Some(chance),
                _ => None,
            });
            self.is_counted = false;
        }
        let is_cut = self.is_cut(station);
        let out = &mut self.stations[station].out;
        // Each station pauses alone: it was cut off, or is polled separately.
        out.repeats = self.repeats && !is_cut && !out.has_paused(now);
        out.is_cut = is_cut;
        if is_cut {
            out.taken = Taken::Before;
        }
        if out.repeats {
            out.taken = Taken::At(now);
            if !std::mem::replace(&mut self.is_counted, true) {
                self.board.duplicated.fetch_add(1, Ordering::Relaxed);
            }
        }
        out.repeats
    }

    /// Returns true if nothing gets through to or from the station.
    pub fn is_cut(&self, station: usize) -> bool {
        self.sum.down || self.stations[station].dead
    }

    /// The bytes that the bus sends while the station is cut off: the ones that it sent before.
    pub fn frozen(&self, station: usize) -> &[u8] {
        &self.stations[station].out.current
    }

    /// Takes the image's outgoing bytes; returns true if the image may regard them as sent.
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

    /// The peer has these bits (bit n of byte k is 8k + n) of the bytes that the bus was given last, `None` for all.
    /// Returns true if the image must be notified.
    pub fn sent(&mut self, station: usize, bits: Option<&Range<usize>>) -> bool {
        let out = &mut self.stations[station].out;
        match bits {
            _ if out.is_cut => return false,
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

    /// Returns true if the bus was given the image's newest bytes: no fault holds them back or repeats others.
    pub fn gives_newest(&self, station: usize) -> bool {
        let out = &self.stations[station].out;
        !out.repeats && !out.is_cut && out.current == out.newest
    }

    /// Decides the fate of a frame that arrived at `now`, and stores the frame if it has to wait.
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
            // Callers release frames before they hand one in, so the ring has room. If the ring is full nevertheless,
            // the order is kept and the frame is lost.
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

    /// Releases the next held frame that is due by `now`, and returns the time that counts for it. After a long pause,
    /// such as while the process was suspended, that time is long ago. When the ring is nearly full, the oldest frame
    /// is released early: the order is kept, and every edge is counted.
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
        // With a delay that has become shorter, no frame arrives before an earlier one.
        let came = came.max(wire.released).min(now);
        wire.released = came;
        into.copy_from_slice(bytes);
        ring.pop();
        if early {
            self.board.hurried.fetch_add(1, Ordering::Relaxed);
        }
        Some(came)
    }

    /// Returns true if the newest frame of the station has not been delivered, but is held back or was lost.
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

    /// The reports of the stations to their masters, if they have changed since the last call.
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
