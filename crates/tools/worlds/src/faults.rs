//! Injected faults and forced signals: those active in a tick of an end, and their effects on values.

use tickbus_base::time::Nanos;

use crate::random::Random;
use crate::stamp::{Stamp, level, real, whole};

/// The signals beside each stamp that faults affect: their names, and their fail-safe values.
const SIGNALS: [(&str, f64); 3] = [("level", 0.0), ("whole", -7.0), ("real", 2.5)];

/// The effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effect {
    /// The signal of this index and area stays at this value, or at its current one.
    Stuck(usize, char, Option<f64>),
    /// A BOOL is inverted.
    Invert(char),
    /// A number is added to a signal.
    Offset(usize, char, f64),
    /// A random number up to this one is added to a signal or subtracted from it.
    Noise(usize, char, f64),
    /// A BOOL is inverted now and then.
    Flicker(char),
    /// Received frames are held back.
    Delay(Nanos),
    /// Sent frames are held back.
    LateValues(Nanos),
    /// Frames of this direction are lost.
    Drop(&'static str),
    /// Frames of this direction come twice.
    Duplicate(&'static str),
    /// No frames are sent or received.
    LinkDown,
}

/// The way in which a fault is injected and ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// By a section in driver.cfg, with `tick` and `ticks`.
    File,
    /// While the driver ticks, with `ticks`.
    Injected,
    /// While the driver ticks; a call ends the fault.
    Ended,
    /// By a viewer, as the live page does: a stuck signal.
    Forced,
}

/// A fault of an end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultPlan {
    /// The index of the end.
    pub end: usize,
    /// The effect of the fault.
    pub effect: Effect,
    /// The way in which the fault is injected and ended.
    pub way: Way,
    /// The first tick of the fault in each life of the driver.
    pub first: u64,
    /// The duration of the fault, in ticks.
    pub ticks: u64,
}

/// The state of a fault in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Activity {
    No,
    /// The tick may or may not know of the fault.
    Maybe,
    Yes,
}

/// The minimum and the maximum value that may be shown.
pub(crate) type Span = (f64, f64);

impl FaultPlan {
    /// Draws some faults: of signals, of the line, and forced signals, as far as the world can have them.
    pub(crate) fn draw(random: &mut Random, numbers: bool, max_age: i64) -> Vec<Self> {
        let count = random.within(1, 4);
        let mut used = Vec::new();
        let mut faults = Vec::new();
        for _ in 0..count {
            let end = usize::try_from(random.below(2)).expect("small");
            let signal = usize::try_from(random.below(if numbers { 3 } else { 1 })).expect("small");
            let area = random.of(&['I', 'Q']);
            let by: f64 = random.of(&[-40.0, 0.5, 30_000.0]);
            let direction = random.of(&["in", "out", "both"]);
            let stuck = random.once_in(2).then_some([1.0, 77.0, -1.5][signal]);
            let held = Nanos(random.within(1_000_000, max_age * 2));
            let way = random.of(&[Way::File, Way::Injected, Way::Ended, Way::Forced]);
            let effect = match (way, random.below(10)) {
                (Way::Forced, _) => Effect::Stuck(signal, area, stuck.or(Some(0.0))),
                (_, 0 | 1) => Effect::Stuck(signal, area, stuck),
                (_, 2) if signal == 0 => Effect::Flicker(area),
                (_, 2) => Effect::Noise(signal, area, by.abs()),
                (_, 3) if signal == 0 => Effect::Invert(area),
                (_, 3) => Effect::Offset(signal, area, by),
                (_, 4) => Effect::Delay(held),
                (_, 5) => Effect::LateValues(held),
                (_, 6) => Effect::Drop(direction),
                (_, 7) => Effect::Duplicate(direction),
                _ => Effect::LinkDown,
            };
            let fault = Self {
                end,
                effect,
                way,
                first: random.below(60) + 1,
                ticks: random.below(60) + 1,
            };
            // Two faults of one signal at one end would act one after the other.
            let place = (end, fault.signal());
            if place.1.is_none() || !used.contains(&place) {
                used.push(place);
                faults.push(fault);
            }
        }
        faults
    }

    /// The signal that the fault affects: its index and area.
    pub(crate) fn signal(&self) -> Option<(usize, char)> {
        match self.effect {
            Effect::Stuck(signal, area, _)
            | Effect::Offset(signal, area, _)
            | Effect::Noise(signal, area, _) => Some((signal, area)),
            Effect::Invert(area) | Effect::Flicker(area) => Some((0, area)),
            _ => None,
        }
    }

    /// The name of the signal that the fault affects: that of station 0.
    pub(crate) fn signal_name(&self) -> Option<String> {
        let (signal, area) = self.signal()?;
        Some(format!("{}{area}0", SIGNALS[signal].0))
    }

    /// The time for which the fault holds frames back, in ns.
    pub(crate) fn held(&self) -> i64 {
        match self.effect {
            Effect::Delay(by) | Effect::LateValues(by) => by.0,
            _ => 0,
        }
    }

    /// Returns true for a fault of the line.
    pub(crate) fn is_of_line(&self) -> bool {
        self.signal().is_none()
    }

    /// Returns the state of the fault in a tick of its end.
    pub(crate) fn activity(&self, tick: u64) -> Activity {
        let over = self.first + self.ticks;
        // A tick takes over orders from outside at its end, so that the next tick is the first to know them.
        let is_forced = self.way == Way::Forced;
        if is_forced && (tick == self.first || tick == over) {
            return Activity::Maybe;
        }
        if (self.first..over).contains(&tick) {
            Activity::Yes
        } else {
            Activity::No
        }
    }

    /// Returns true if the fault has no more effect from a tick on.
    pub(crate) fn is_over(&self, tick: u64) -> bool {
        tick > self.first + self.ticks
    }

    /// The section of the fault, without the keys for its time.
    pub(crate) fn section(&self) -> String {
        let name = self.signal_name().unwrap_or_default();
        match self.effect {
            Effect::Stuck(0, _, Some(value)) => format!(
                "kind = \"stuck\"\nsignal = \"{name}\"\nvalue = {}\n",
                value == 1.0
            ),
            Effect::Stuck(_, _, Some(value)) => {
                format!("kind = \"stuck\"\nsignal = \"{name}\"\nvalue = {value}\n")
            }
            Effect::Stuck(_, _, None) => format!("kind = \"stuck\"\nsignal = \"{name}\"\n"),
            Effect::Invert(_) => format!("kind = \"invert\"\nsignal = \"{name}\"\n"),
            Effect::Offset(_, _, by) => {
                format!("kind = \"offset\"\nsignal = \"{name}\"\nby = {by}\n")
            }
            Effect::Noise(_, _, by) => {
                format!("kind = \"noise\"\nsignal = \"{name}\"\namplitude = {by}\n")
            }
            Effect::Flicker(_) => {
                format!("kind = \"noise\"\nsignal = \"{name}\"\nchance = 0.5\n")
            }
            Effect::Delay(by) => format!("kind = \"delay\"\nby = \"{by}\"\n"),
            Effect::LateValues(by) => format!("kind = \"values-late\"\nby = \"{by}\"\n"),
            Effect::Drop(direction) => {
                format!("kind = \"drop\"\nchance = 0.3\ndirection = \"{direction}\"\n")
            }
            Effect::Duplicate(direction) => {
                format!("kind = \"duplicate\"\nchance = 0.3\ndirection = \"{direction}\"\n")
            }
            Effect::LinkDown => "kind = \"link-down\"\n".to_owned(),
        }
    }

    /// The possible results of the fault for a value; `was` has the possible values at which the fault began.
    fn bend(&self, (least, most): Span, was: &[f64]) -> Vec<Span> {
        match self.effect {
            Effect::Stuck(_, _, Some(value)) => vec![(value, value)],
            Effect::Stuck(_, _, None) => was.iter().map(|value| known(*value)).collect(),
            Effect::Invert(_) => vec![(1.0 - most, 1.0 - least)],
            Effect::Offset(_, _, by) => vec![(least + by, most + by)],
            Effect::Noise(_, _, by) => vec![(least - by, most + by)],
            Effect::Flicker(_) => vec![(0.0, 0.0), (1.0, 1.0)],
            _ => vec![(least, most)],
        }
    }
}

/// The span of a value that was seen; if it was not seen, any value.
fn known(value: f64) -> Span {
    if value.is_nan() {
        (f64::NEG_INFINITY, f64::INFINITY)
    } else {
        (value, value)
    }
}

/// The values beside a stamp, or the fail-safe values.
pub(crate) fn values(stamp: Option<u64>) -> [f64; 3] {
    match stamp {
        None => SIGNALS.map(|(_, fail_safe)| fail_safe),
        Some(stamp) => [
            f64::from(u8::from(level(stamp))),
            whole(stamp).into(),
            real(stamp),
        ],
    }
}

/// The codec's result for a signal's value: an INT is rounded and saturated; a REAL may lose its last digits.
fn on_line(signal: usize, (least, most): Span) -> Span {
    match signal {
        0 => (least, most),
        1 => {
            let int = |value: f64| {
                value
                    .round()
                    .clamp(f64::from(i16::MIN), f64::from(i16::MAX))
            };
            (int(least), int(most))
        }
        _ if least < most => (least - 0.01, most + 0.01),
        _ => (least, most),
    }
}

/// The values beside a stamp that the end that reads a station may show in its own tick `tick`. `held` returns the
/// values shown when its own faults began, or NaN if they were not seen.
pub(crate) fn expected(
    (faults, hosted): (&[FaultPlan], Option<usize>),
    (area, station): (char, usize),
    stamp: Option<u64>,
    tick: u64,
    held: impl Fn(usize, usize) -> Vec<f64>,
) -> [Vec<Span>; 3] {
    let reader = usize::from(area == 'I');
    let mut all = values(stamp).map(|value| vec![(value, value)]);
    let faults = faults.iter().enumerate();
    // A program reads bytes, which its faults affect.
    let reads_bytes = hosted == Some(reader);
    // The faults of the writing end come first, whatever their order in the list.
    let (own, others): (Vec<_>, Vec<_>) = faults.partition(|(_, fault)| fault.end == reader);
    for (index, fault) in others.into_iter().chain(own) {
        let Some((signal, of)) = fault.signal() else {
            continue;
        };
        if of != area || station > 0 {
            continue;
        }
        let spans = &mut all[signal];
        let (at, was) = if fault.end == reader {
            (Some(tick), held(index, signal))
        } else {
            // The writing end sends fail-safe values without faults.
            let written = stamp.map(Stamp::of);
            let at = written.map(|stamp| stamp.tick);
            let first = |tick| {
                let stamp = written.filter(|_| tick > 0);
                let begun = stamp.map(|stamp| Stamp { tick, ..stamp }.number());
                values(begun)[signal]
            };
            let was = vec![first(fault.first), first(fault.first - 1)];
            (at, was)
        };
        let activity = at.map_or(Activity::No, |tick| fault.activity(tick));
        let bent: Vec<Span> = spans
            .iter()
            .flat_map(|span| fault.bend(*span, &was))
            .map(|span| {
                if fault.end == reader && !reads_bytes {
                    span
                } else {
                    on_line(signal, span)
                }
            })
            .collect();
        match activity {
            Activity::No => {}
            Activity::Maybe => spans.extend(bent),
            Activity::Yes => *spans = bent,
        }
    }
    all
}
