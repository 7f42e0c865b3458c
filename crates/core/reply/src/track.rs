//! Parts on a belt: they move together past sensors, and leave it at exits.

use tickbus_base::time::Nanos;

use super::io::Io;
use super::levels::Levels;
use super::numbers::Speed;
use super::signal::Output;

/// `kind = "track"`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Track {
    pub(crate) speed: Speed,
    /// Parts enter while these hold; without them, always.
    pub(crate) enters: Option<Levels>,
    pub(crate) length: f64,
    /// The length of a part.
    pub(crate) size: f64,
    /// The least distance between the fronts of two parts.
    pub(crate) gap: f64,
    /// The heights of the parts that enter, one after the other, and again from the beginning.
    pub(crate) parts: Box<[f64]>,
    /// The number of parts that have entered, up to `parts.len()`.
    pub(crate) entered: usize,
    pub(crate) sensors: Box<[Sensor]>,
    pub(crate) exits: Box<[Exit]>,
    /// A place for each part that can be on the track.
    pub(crate) lanes: Box<[Lane]>,
}

/// A range of heights, both limits included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub(crate) above: f64,
    pub(crate) below: f64,
}

/// A sensor, which is on while a part is there.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sensor {
    pub(crate) signal: Output,
    pub(crate) at: f64,
    pub(crate) span: Span,
}

/// A place at which parts leave the track.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Exit {
    pub(crate) at: f64,
    pub(crate) when: Option<Levels>,
    pub(crate) span: Span,
    /// The number of parts that have left here.
    pub(crate) signal: Option<Output>,
    pub(crate) count: f64,
}

/// A place for one part, and its signals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lane {
    pub(crate) position: Output,
    pub(crate) height: Option<Output>,
    pub(crate) part: Option<OnTrack>,
}

/// A part on the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OnTrack {
    /// The position of its front.
    front: f64,
    height: f64,
}

impl OnTrack {
    /// True if a part of this size covers the point `at`, and its height is within the span.
    fn is_at(self, at: f64, size: f64, span: Span) -> bool {
        (self.front - size..=self.front).contains(&at)
            && (span.above..=span.below).contains(&self.height)
    }
}

impl Track {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let way = self.speed.now(io.slots) * io.seconds;
        for part in self.lanes.iter_mut().filter_map(|lane| lane.part.as_mut()) {
            // A speed that is no number moves nothing.
            if way.is_finite() {
                part.front += way;
            }
        }
        for exit in &mut self.exits {
            if !exit.when.as_ref().is_none_or(|when| when.hold(io.slots)) {
                continue;
            }
            for lane in &mut self.lanes {
                let leaves = |part: &OnTrack| part.is_at(exit.at, self.size, exit.span);
                if lane.part.take_if(|part| leaves(part)).is_some() {
                    exit.count += 1.0;
                }
            }
        }
        for lane in &mut self.lanes {
            let (size, length) = (self.size, self.length);
            // It has left at one of the ends.
            lane.part
                .take_if(|part| part.front < 0.0 || part.front - size > length);
        }
        // A belt that runs backwards takes no part along.
        if way >= 0.0 {
            self.enter(io);
        }
        for sensor in &self.sensors {
            let mut parts = self.lanes.iter().filter_map(|lane| lane.part);
            let on = parts.any(|part| part.is_at(sensor.at, self.size, sensor.span));
            io.put_bit(sensor.signal, on);
        }
        for exit in &self.exits {
            if let Some(signal) = exit.signal {
                io.put(signal, exit.count);
            }
        }
        for lane in &self.lanes {
            let (front, height) = lane
                .part
                .map_or((-self.size, 0.0), |part| (part.front, part.height));
            io.put(lane.position, front);
            if let Some(signal) = lane.height {
                io.put(signal, height);
            }
        }
        // What it reads may have changed behind it in this tick.
        io.now
    }

    /// Lets a part enter if there is room for it.
    fn enter(&mut self, io: &Io<'_>) {
        let wanted = self
            .enters
            .as_ref()
            .is_none_or(|enters| enters.hold(io.slots));
        let mut parts = self.lanes.iter().filter_map(|lane| lane.part);
        if !wanted || parts.any(|part| part.front < self.gap) {
            return;
        }
        let Some(lane) = self.lanes.iter_mut().find(|lane| lane.part.is_none()) else {
            return;
        };
        lane.part = Some(OnTrack {
            front: 0.0,
            height: self.parts[self.entered % self.parts.len()],
        });
        self.entered = (self.entered + 1) % self.parts.len();
    }
}
