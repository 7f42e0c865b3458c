//! Rules: what a machine does once conditions hold.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use super::Condition;
use super::io::{Io, seconds};
use super::signal::Form;

/// One rule: a `[[reply]]` of the kind "rule", or a `[[machine.rule]]` of a test file.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The name of a `[[machine.rule]]`, by which a fit changes its times.
    pub name: Option<String>,
    /// All of these must hold. Never empty.
    pub when: Vec<Condition>,
    /// How long they must hold before the rule takes effect.
    pub after: Nanos,
    /// The values that it sets then, by index of the signal.
    pub set: Vec<(usize, Slot)>,
    /// The values that it sets when the conditions no longer hold.
    pub otherwise: Vec<(usize, Slot)>,
    /// The signal that moves while they hold.
    pub ramp: Option<Ramp>,
}

/// A signal that moves towards a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// The index of the signal.
    pub signal: usize,
    /// Where it goes.
    pub to: f64,
    /// Units per second. Positive.
    pub per_second: f64,
}

/// Values of signals, by index.
pub trait Values {
    /// Returns the value of a signal.
    fn value(&self, signal: usize) -> Slot;

    /// Sets the value of a signal.
    fn set(&mut self, signal: usize, value: Slot);
}

impl Values for [Slot] {
    fn value(&self, signal: usize) -> Slot {
        self[signal]
    }

    fn set(&mut self, signal: usize, value: Slot) {
        self[signal] = value;
    }
}

impl Values for Io<'_> {
    fn value(&self, signal: usize) -> Slot {
        self.slots[signal]
    }

    fn set(&mut self, signal: usize, value: Slot) {
        self.put_slot(signal, value);
    }
}

impl Rule {
    /// Returns true if a condition is about an edge: the rule then takes effect although it is over at once.
    pub fn is_of_edge(&self) -> bool {
        self.when.iter().any(Condition::is_edge)
    }
}

/// The state of a rule from tick to tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    /// True if the conditions held in the previous tick.
    held: bool,
    /// When the rule takes effect; `None` once it has, or while its conditions do not hold.
    due: Option<Nanos>,
    /// True if the rule has taken effect and its conditions still hold.
    done: bool,
}

impl Course {
    /// One tick that ends at `now` and has taken `passed`; `holds` is true if the conditions hold, edges among them.
    pub fn step<V: Values + ?Sized>(
        &mut self,
        rule: &Rule,
        holds: bool,
        (now, passed): (Nanos, Nanos),
        values: &mut V,
    ) {
        let is_edge = rule.is_of_edge();
        if is_edge {
            // An edge lasts no time, but its effect still takes place.
            if holds {
                self.due = Some(now + rule.after);
            }
        } else {
            if holds && !self.held {
                self.due = Some(now + rule.after);
            }
            if !holds {
                self.due = None;
                if std::mem::take(&mut self.done) {
                    assign(&rule.otherwise, values);
                }
            }
            self.held = holds;
        }
        if self.due.is_some_and(|due| due <= now) {
            self.due = None;
            self.done = true;
            assign(&rule.set, values);
        }
        let moves = if is_edge {
            self.done
        } else {
            holds && self.done
        };
        if let (Some(ramp), true) = (rule.ramp, moves) {
            let at = values.value(ramp.signal).real();
            let far = ramp.per_second * seconds(passed);
            let next = if at < ramp.to {
                (at + far).min(ramp.to)
            } else {
                (at - far).max(ramp.to)
            };
            values.set(ramp.signal, Slot::from_real(next));
        }
    }
}

fn assign<V: Values + ?Sized>(assigned: &[(usize, Slot)], values: &mut V) {
    for (signal, value) in assigned {
        values.set(*signal, *value);
    }
}

/// A rule among replies, with its state. Edges are those of the values that the ticks see.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ruled {
    pub(crate) rule: Rule,
    /// The form of the signal of each condition.
    pub(crate) forms: Vec<Form>,
    pub(crate) course: Course,
    /// The slot of each condition's signal in the previous tick; `None` before the first.
    pub(crate) before: Vec<Option<Slot>>,
}

impl Ruled {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let mut holds = true;
        for (place, (condition, form)) in self.rule.when.iter().zip(&self.forms).enumerate() {
            let slot = io.slots[condition.signal];
            let value = form.real(slot);
            let before = self.before[place].replace(slot).unwrap_or(slot);
            holds &= if condition.is_edge() {
                condition.holds_between((before, form.real(before)), (slot, value))
            } else {
                condition.holds_for(value, io.slots)
            };
        }
        let moment = (io.now, io.passed);
        self.course.step(&self.rule, holds, moment, io);
        // A rule counts its times in each tick.
        io.now
    }
}
