//! Axes of a simulated machine: each has a command structure from the PLC and a feedback structure to it.
//!
//! An `[[axis]]` table of a driver.cfg expands into about fifteen signals, whose addresses [`Field`] has. [`Reflexes`]
//! does the routine work of a machine on every tick: acknowledging commands, looking them up by number, end switches.
//! [`Profile`] and [`Drive`] are the motion itself: the course of a move over time, and the effect of commands on an
//! axis. [`profidrive`] is a drive behind a telegram of PROFIdrive, which a `[[drive]]` table describes.

mod command;
mod drive;
mod field;
pub mod profidrive;
mod profile;
mod ramp;
mod reflexes;
pub mod section;

use std::collections::HashMap;

use tickbus_image::signal::{SignalTable, Slot, Structure};

pub use command::{Command, Mode, Motion};
pub use drive::{Demand, Drive, Feedback};
pub use field::{COMMAND_BYTES, EXTENDED_FEEDBACK_BYTES, FEEDBACK_BYTES, Field};
pub use profile::{Limits, Profile};
pub use reflexes::{Reflexes, UNKNOWN_COMMAND};

/// The purpose of an axis: determines which commands make sense, and the names of two of its bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AxisKind {
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

impl AxisKind {
    /// All kinds, with their names in a driver.cfg.
    pub const ALL: [(&'static str, Self); 4] = [
        ("position", Self::Position),
        ("speed", Self::Speed),
        ("torque", Self::Torque),
        ("tracking", Self::Tracking),
    ];

    /// The name in a driver.cfg.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.into_iter().find(|(_, kind)| *kind == self);
        found.map_or("", |(name, _)| name)
    }
}

/// One `[[axis]]` of a driver.cfg.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The name, the first part of the names of its signals.
    pub name: String,
    /// The kind.
    pub kind: AxisKind,
    /// Unit of the position, for people.
    pub unit: Option<String>,
    /// Lowest and highest position, in the unit.
    pub limits: Option<[f64; 2]>,
    /// True if positions on the wire are counted from the opposite end.
    pub inverted: bool,
    /// Offset of the command structure in `%Q`.
    pub command: usize,
    /// Offset of the feedback structure in `%I`.
    pub feedback: usize,
    /// Size of the feedback structure.
    pub feedback_bytes: usize,
    /// The commands that the PLC gives by number.
    pub commands: Vec<Command>,
    /// The end switches.
    pub switches: Vec<Switch>,
    /// The index of each field's signal in the signal table, by [`Field::index`].
    slots: [Option<usize>; Field::COUNT],
}

/// An end switch: a bit that the driver derives from the position.
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// Name of the signal.
    pub name: String,
    /// The position at which it trips, in the unit of the axis.
    pub at: f64,
    /// True if the switch is on above that position, rather than below.
    pub above: bool,
    /// How far the axis has to move back before the switch goes off, in the unit of the axis.
    pub hysteresis: f64,
    /// The index of the signal in the signal table.
    slot: usize,
}

impl Axis {
    /// The index of a field's signal in the signal table; `None` for fields that this axis does not have.
    pub fn slot(&self, field: Field) -> Option<usize> {
        self.slots[field.index()]
    }

    /// The bytes of the feedback structure, and those of the command structure.
    pub fn structure(&self) -> Structure {
        Structure {
            inputs: self.feedback..self.feedback + self.feedback_bytes,
            outputs: self.command..self.command + COMMAND_BYTES,
        }
    }

    /// The name of a field's signal.
    pub fn signal(&self, field: Field) -> String {
        format!("{}.{}", self.name, field.name(self.kind))
    }
}

impl Axis {
    /// The PLC's command, read from a machine's slots.
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

    /// Writes the feedback to a machine's slots.
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

/// Finds the signals of `axes` in the signal table that was made from them.
///
/// A missing signal stays `None`: the driver.cfg then has mistakes and will not be used.
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
