//! The work of the machine's side on every tick for its axes, apart from the machine's own model.

use super::{Axis, Command, Field, Mode};
use tickbus_base::Threshold;
use tickbus_image::signal::Slot;

/// The value of the word `Error` while the PLC asks for a command that is not in the table.
pub const UNKNOWN_COMMAND: u16 = 3;

/// The reflexes of all axes of a driver in the role Device: acknowledging, commands by number, end switches.
///
/// The reflexes work on slots, between the simulation and the codec, and the simulation need not know about them: a
/// command given by number appears in the slots as if the PLC had sent all of its values. The reflexes allocate
/// nothing.
#[derive(Debug)]
pub struct Reflexes {
    axes: Box<[Reflex]>,
}

#[derive(Debug)]
struct Reflex {
    execute: usize,
    /// True if the simulation has seen `Execute`.
    delivered: bool,
    acknowledge: Option<usize>,
    numbers: Option<Numbers>,
    switches: Box<[Trip]>,
}

/// Commands by number.
#[derive(Debug)]
struct Numbers {
    commands: Box<[Command]>,
    number: usize,
    done: usize,
    error: Option<usize>,
    in_position: usize,
    bits: [usize; 3],
    values: [usize; 5],
    /// The command that the simulation is executing.
    pending: Option<u16>,
    /// The requested command is not in the table.
    unknown: bool,
    /// The simulation's own error, while another one is in its slot.
    error_of_simulation: Option<Slot>,
}

#[derive(Debug)]
struct Trip {
    slot: usize,
    position: usize,
    threshold: Threshold,
}

const fn level(on: bool) -> Slot {
    Slot::from_real(if on { 1.0 } else { 0.0 })
}

impl Reflexes {
    /// The reflexes for `axes`; `None` if no axis needs any.
    pub fn new(axes: &[Axis]) -> Option<Self> {
        let axes: Box<[Reflex]> = axes.iter().filter_map(Reflex::new).collect();
        (!axes.is_empty()).then_some(Self { axes })
    }

    /// Before the simulation's values are encoded.
    pub fn sending(&mut self, slots: &mut [Slot]) {
        for axis in &mut self.axes {
            axis.sending(slots);
        }
    }

    /// After they were encoded: restores the values of the simulation that were replaced for sending.
    pub fn sent(&mut self, slots: &mut [Slot]) {
        for axis in &mut self.axes {
            if let Some(numbers) = &mut axis.numbers {
                numbers.sent(slots);
            }
        }
    }

    /// After the PLC's values were decoded.
    pub fn received(&mut self, slots: &mut [Slot]) {
        for axis in &mut self.axes {
            axis.received(slots);
        }
    }
}

impl Reflex {
    fn new(axis: &Axis) -> Option<Self> {
        let slot = |field| axis.slot(field);
        let position = slot(Field::ActualPosition)?;
        let numbers = || {
            Some(Numbers {
                commands: axis.commands.clone().into(),
                number: slot(Field::CommandNumber)?,
                done: slot(Field::CommandDone)?,
                error: slot(Field::Error),
                in_position: slot(Field::InPosition)?,
                bits: [
                    slot(Field::Tracking)?,
                    slot(Field::TorqueControl)?,
                    slot(Field::SpeedControl)?,
                ],
                values: [
                    slot(Field::TargetPosition)?,
                    slot(Field::Speed)?,
                    slot(Field::Acceleration)?,
                    slot(Field::Deceleration)?,
                    slot(Field::Torque)?,
                ],
                pending: None,
                unknown: false,
                error_of_simulation: None,
            })
        };
        let switches = axis.switches.iter().map(|switch| Trip {
            slot: switch.slot,
            position,
            threshold: Threshold::new(switch.at, switch.above, switch.hysteresis),
        });
        let reflex = Self {
            execute: slot(Field::Execute)?,
            delivered: false,
            acknowledge: slot(Field::Acknowledge),
            numbers: numbers(),
            switches: switches.collect(),
        };
        let asked =
            reflex.acknowledge.is_some() || reflex.numbers.is_some() || !reflex.switches.is_empty();
        asked.then_some(reflex)
    }

    fn sending(&mut self, slots: &mut [Slot]) {
        if let Some(acknowledge) = self.acknowledge {
            slots[acknowledge] = level(self.delivered);
        }
        if let Some(numbers) = &mut self.numbers {
            numbers.sending(slots);
        }
        for switch in &mut self.switches {
            let position = slots[switch.position].real();
            slots[switch.slot] = level(switch.threshold.update(position));
        }
    }

    fn received(&mut self, slots: &mut [Slot]) {
        if let Some(numbers) = &mut self.numbers {
            numbers.received(slots, self.execute);
        }
        let executes = slots[self.execute].real() != 0.0;
        if let Some(numbers) = &mut self.numbers
            && executes
            && !self.delivered
        {
            numbers.begin(slots);
        }
        self.delivered = executes;
    }
}

impl Numbers {
    /// Replaces the PLC's values by the command with the requested number.
    fn received(&mut self, slots: &mut [Slot], execute: usize) {
        self.unknown = false;
        let number = slots[self.number].real();
        if number == 0.0 {
            return;
        }
        let commands = self.commands.iter();
        let Some(command) = commands
            .copied()
            .find(|command| f64::from(command.number).total_cmp(&number).is_eq())
        else {
            self.unknown = true;
            slots[execute] = level(false);
            return;
        };
        for (slot, on) in self.bits.into_iter().zip(Mode::bits(command.mode)) {
            slots[slot] = level(on);
        }
        let motion = command.motion;
        let values = [
            motion.position,
            motion.speed,
            motion.acceleration,
            motion.deceleration,
            motion.torque,
        ];
        for (slot, value) in self.values.into_iter().zip(values) {
            if let Some(value) = value {
                slots[slot] = Slot::from_real(value);
            }
        }
    }

    /// A new command for the simulation.
    fn begin(&mut self, slots: &[Slot]) {
        let number = slots[self.number].real();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "decoded from 16 bits"
        )]
        let number = number as u16;
        self.pending = (number != 0).then_some(number);
    }

    fn sending(&mut self, slots: &mut [Slot]) {
        let there = slots[self.in_position].real() != 0.0;
        let done = self.pending.filter(|_| there).unwrap_or(0);
        slots[self.done] = Slot::from_real(f64::from(done));
        if let Some(error) = self.error
            && self.unknown
        {
            self.error_of_simulation = Some(slots[error]);
            slots[error] = Slot::from_real(f64::from(UNKNOWN_COMMAND));
        }
    }

    /// Restores the simulation's own error.
    fn sent(&mut self, slots: &mut [Slot]) {
        if let (Some(error), Some(own)) = (self.error, self.error_of_simulation.take()) {
            slots[error] = own;
        }
    }
}
