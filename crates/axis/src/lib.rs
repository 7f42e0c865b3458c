//! Axes of a simulated machine: each a structure of commands from the PLC and one of feedback to it.
//!
//! An `[[axis]]` table of a driver.cfg stands for some fifteen signals, whose places [`Field`] knows. What a
//! machine has to do on every tick beside its own model, so that the PLC gets more than these bits and
//! numbers, is the work of [`Reflexes`]. [`Profile`] and [`Drive`] are motion as such: how a move goes on over time,
//! and what a command means to an axis.

mod command;
mod drive;
mod field;
mod profile;
mod reflexes;
pub mod section;

use std::collections::HashMap;

use tickbus_image::signal::{SignalTable, Slot};

pub use command::{Command, Mode, Motion};
pub use drive::{Demand, Drive, Feedback};
pub use field::{COMMAND_BYTES, EXTENDED_FEEDBACK_BYTES, FEEDBACK_BYTES, Field};
pub use profile::{Limits, Profile};
pub use reflexes::{Reflexes, UNKNOWN_COMMAND};

/// What an axis is for: which commands make sense to it, and what two of its bits are called.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Moves to positions.
    #[default]
    Position,
    /// Turns at speeds.
    Speed,
    /// Opens and closes with a pressure.
    Torque,
    /// Follows something else in the machine, and moves to positions.
    Tracking,
}

impl Kind {
    /// All of them, with their names in a driver.cfg.
    pub const ALL: [(&'static str, Self); 4] = [
        ("position", Self::Position),
        ("speed", Self::Speed),
        ("torque", Self::Torque),
        ("tracking", Self::Tracking),
    ];

    /// Its name in a driver.cfg.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.into_iter().find(|(_, kind)| *kind == self);
        found.map_or("", |(name, _)| name)
    }
}

/// One `[[axis]]` of a driver.cfg.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name, the beginning of the names of its signals.
    pub name: String,
    /// What it is for.
    pub kind: Kind,
    /// Unit of its position, for people.
    pub unit: Option<String>,
    /// Least and greatest position, in its unit.
    pub limits: Option<[f64; 2]>,
    /// Whether positions on the wire count from the other end.
    pub inverted: bool,
    /// Offset of its command structure in `%Q`.
    pub command: usize,
    /// Offset of its feedback structure in `%I`.
    pub feedback: usize,
    /// Size of its feedback structure.
    pub feedback_bytes: usize,
    /// The commands that the PLC gives by their number.
    pub commands: Vec<Command>,
    /// Its end switches.
    pub switches: Vec<Switch>,
    /// Where each field stands in the table of signals, by [`Field::index`].
    slots: [Option<usize>; Field::COUNT],
}

/// An end switch: a bit that the driver makes from the position.
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// Name of its signal.
    pub name: String,
    /// The position at which it trips, in the unit of the axis.
    pub at: f64,
    /// Whether it is on above that position, or below.
    pub above: bool,
    /// How far the axis has to come back before it is off again, in the unit of the axis.
    pub hysteresis: f64,
    /// Where its signal stands in the table.
    slot: usize,
}

impl Axis {
    /// Where a field stands among the signals of its driver; `None` for fields that this axis does not have.
    pub fn slot(&self, field: Field) -> Option<usize> {
        self.slots[field.index()]
    }

    /// The name of the signal of one of its fields.
    pub fn signal(&self, field: Field) -> String {
        format!("{}.{}", self.name, field.name(self.kind))
    }
}

impl Axis {
    /// What the PLC asks of it, as it stands in the slots of a machine.
    pub fn demand(&self, slots: &[Slot]) -> Demand {
        let value = |field| self.slot(field).map_or(0.0, |slot| slots[slot].real());
        let on = |field| value(field) != 0.0;
        Demand {
            execute: on(Field::Execute),
            tracking: on(Field::Tracking),
            torque_control: on(Field::TorqueControl),
            speed_control: on(Field::SpeedControl),
            enable: on(Field::Enable),
            motion: Motion {
                position: value(Field::TargetPosition),
                speed: value(Field::Speed),
                acceleration: value(Field::Acceleration),
                deceleration: value(Field::Deceleration),
                torque: value(Field::Torque),
            },
            jerk: value(Field::Jerk),
        }
    }

    /// Puts what it tells the PLC into the slots of a machine.
    pub fn tell(&self, told: &Feedback, slots: &mut [Slot]) {
        let bit = |on: bool| f64::from(u8::from(on));
        for (field, value) in [
            (Field::Healthy, bit(told.healthy)),
            (Field::InPosition, bit(told.in_position)),
            (Field::ActualPosition, told.position),
            (Field::ActualSpeed, told.speed),
            (Field::Status, f64::from(told.status)),
            (Field::Error, f64::from(told.error)),
        ] {
            if let Some(slot) = self.slot(field) {
                slots[slot] = Slot::from_real(value);
            }
        }
    }
}

/// Finds the signals of `axes` in the table that was made of them.
///
/// What is not found is left as not there: then the driver.cfg has mistakes, and nobody will use it.
pub fn resolve(axes: &mut [Axis], table: &SignalTable) {
    let places: HashMap<&str, usize> = (table.signals.iter().enumerate())
        .map(|(place, signal)| (signal.name.as_str(), place))
        .collect();
    for axis in axes {
        for field in Field::ALL {
            axis.slots[field.index()] = places.get(axis.signal(field).as_str()).copied();
        }
        for switch in &mut axis.switches {
            switch.slot = places.get(switch.name.as_str()).copied().unwrap_or(0);
        }
    }
}
