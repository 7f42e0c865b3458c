//! The layout of the rig's process image: the meaning of every bit.
//!
//! Both words are big-endian; the offsets are those of the rig's `driver.cfg`.

/// Bytes of `%I`: status word, panel, a spare byte, two lift positions (not used by the program, for which
/// the switches suffice).
pub(super) const INPUT_BYTES: usize = 8;
/// Bytes of `%Q`: command word, panel, phase, step, cycles.
pub(super) const OUTPUT_BYTES: usize = 8;

/// Bits of the command word, `%QW0`.
pub(super) mod command {
    /// Index wheel 1 by +90°, on the rising edge.
    pub(crate) const IM1_INDEX: u16 = 1 << 0;
    /// Index wheel 1 turns slowly while on.
    pub(crate) const IM1_JOG: u16 = 1 << 1;
    /// Lift 1 moves as its code says.
    pub(crate) const LA1_RUN: u16 = 1 << 2;
    /// The code of lift 1, MSB first: 00 = + big, 01 = − small, 10 = + small, 11 = − big.
    pub(crate) const LA1_CODE: u16 = LA1_CODE_LOW | LA1_CODE_HIGH;
    /// The low bit of the code.
    pub(crate) const LA1_CODE_LOW: u16 = 1 << 3;
    /// The high bit of the code.
    pub(crate) const LA1_CODE_HIGH: u16 = 1 << 4;
    /// The suction cup of lift 1 holds.
    pub(crate) const SC1: u16 = 1 << 5;
    /// Index wheel 2 by 180°, on the rising edge.
    pub(crate) const IM2_INDEX: u16 = 1 << 7;
    /// Index wheel 2 turns slowly while on.
    pub(crate) const IM2_JOG: u16 = 1 << 8;
    /// Lift 2 moves: down, unless [`LA2_UP`] is on.
    pub(crate) const LA2_RUN: u16 = 1 << 10;
    /// Lift 2 moves up.
    pub(crate) const LA2_UP: u16 = 1 << 11;
    /// The suction cup of lift 2 holds.
    pub(crate) const SC2: u16 = 1 << 12;
    /// The lamp.
    pub(crate) const LAMP: u16 = 1 << 13;
    /// Clears a fault, on the rising edge.
    pub(crate) const ACKNOWLEDGE: u16 = 1 << 15;
    /// Both suction cups.
    pub(crate) const SUCTION: u16 = SC1 | SC2;
}

/// Bits of the status word, `%IW0`; bits 0 to 5 are "step 1 complete" to "step 6 complete".
mod status {
    pub(super) const STEP_2: u16 = 1 << 1;
    pub(super) const PACKAGE_1: u16 = 1 << 11;
    pub(super) const PACKAGE_2: u16 = 1 << 12;
    pub(super) const HOME_1: u16 = 1 << 13;
    pub(super) const HOME_2: u16 = 1 << 14;
    pub(super) const NOT_OK: u16 = 1 << 15;
}

/// Bits of the panel's input byte, `%IB2`.
mod button {
    pub(super) const START: u8 = 1 << 0;
    pub(super) const STOP: u8 = 1 << 1;
    pub(super) const RESET: u8 = 1 << 2;
    pub(super) const LA1_BOTTOM: u8 = 1 << 3;
    pub(super) const LA2_BOTTOM: u8 = 1 << 4;
}

/// Bits of the panel's output byte, `%QB2`.
pub(super) mod lamp {
    /// Ready for Start.
    pub(crate) const READY: u8 = 1 << 0;
    /// The drum turns.
    pub(crate) const RUNNING: u8 = 1 << 1;
    /// Stopped by a fault; waits for Reset.
    pub(crate) const FAULT: u8 = 1 << 2;
    /// Finalised: the rig may be switched off.
    pub(crate) const PARKED: u8 = 1 << 3;
}

/// The inputs of one scan.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inputs {
    /// The whole status word.
    pub(super) status: u16,
    panel: u8,
}

impl Inputs {
    /// Reads the inputs from `%I`; missing bytes read as 0.
    pub(super) fn read(image: &[u8]) -> Self {
        let byte = |offset: usize| image.get(offset).copied().unwrap_or(0);
        Self {
            status: u16::from_be_bytes([byte(0), byte(1)]),
            panel: byte(2),
        }
    }

    /// The beam across the path of lift 1 is interrupted.
    pub(super) fn package_1(self) -> bool {
        self.status & status::PACKAGE_1 != 0
    }

    /// The beam across the path of lift 2 is interrupted.
    pub(super) fn package_2(self) -> bool {
        self.status & status::PACKAGE_2 != 0
    }

    /// Wheel 1 is at its index zero.
    pub(super) fn home_1(self) -> bool {
        self.status & status::HOME_1 != 0
    }

    /// Wheel 2 is at its index zero.
    pub(super) fn home_2(self) -> bool {
        self.status & status::HOME_2 != 0
    }

    /// The machine reports a collision or a jam that is not acknowledged.
    pub(super) fn not_ok(self) -> bool {
        self.status & status::NOT_OK != 0
    }

    /// The Start button is pressed.
    pub(super) fn start(self) -> bool {
        self.panel & button::START != 0
    }

    /// The Stop button is pressed.
    pub(super) fn stop(self) -> bool {
        self.panel & button::STOP != 0
    }

    /// The Reset button is pressed.
    pub(super) fn reset(self) -> bool {
        self.panel & button::RESET != 0
    }

    /// Lift 1 is on its bottom switch.
    pub(super) fn la1_bottom(self) -> bool {
        self.panel & button::LA1_BOTTOM != 0
    }

    /// Lift 2 is on its bottom switch.
    pub(super) fn la2_bottom(self) -> bool {
        self.panel & button::LA2_BOTTOM != 0
    }

    /// Lift 1 is up at the sleeve: the word of step 2 is complete, no matter why it was commanded.
    pub(super) fn fetched(self) -> bool {
        self.status & status::STEP_2 != 0
    }

    /// Both lifts are on their bottom switches.
    pub(super) fn at_bottom(self) -> bool {
        self.la1_bottom() && self.la2_bottom()
    }
}

/// The outputs of one scan.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outputs {
    /// The command word.
    pub(super) command: u16,
    /// The panel's lamps.
    pub(super) lamps: u8,
    /// The number of the phase.
    pub(super) phase: u8,
    /// The drum's active step; 0 outside run.
    pub(super) step: u16,
    /// Cycles completed since the program started; wraps from 65,535 to 0.
    pub(super) cycles: u16,
}

impl Outputs {
    /// Writes all outputs to `%Q`; bytes beyond its end are dropped.
    pub(super) fn write(self, image: &mut [u8]) {
        let [command_high, command_low] = self.command.to_be_bytes();
        let [step_high, step_low] = self.step.to_be_bytes();
        let [cycles_high, cycles_low] = self.cycles.to_be_bytes();
        let bytes: [u8; OUTPUT_BYTES] = [
            command_high,
            command_low,
            self.lamps,
            self.phase,
            step_high,
            step_low,
            cycles_high,
            cycles_low,
        ];
        for (to, from) in image.iter_mut().zip(bytes) {
            *to = from;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Read = fn(Inputs) -> bool;

    #[test]
    fn every_input_has_its_own_bit() {
        let all: [(Read, usize, u8); 11] = [
            (Inputs::fetched, 1, 1),
            (Inputs::package_1, 0, 3),
            (Inputs::package_2, 0, 4),
            (Inputs::home_1, 0, 5),
            (Inputs::home_2, 0, 6),
            (Inputs::not_ok, 0, 7),
            (Inputs::start, 2, 0),
            (Inputs::stop, 2, 1),
            (Inputs::reset, 2, 2),
            (Inputs::la1_bottom, 2, 3),
            (Inputs::la2_bottom, 2, 4),
        ];
        for (index, (_, byte, bit)) in all.iter().enumerate() {
            let mut image = [0; INPUT_BYTES];
            image[*byte] = 1 << bit;
            let inputs = Inputs::read(&image);
            for (other, (read, ..)) in all.iter().enumerate() {
                assert_eq!(
                    read(inputs),
                    other == index,
                    "%IX{byte}.{bit} and input {other}"
                );
            }
        }
        assert_eq!(
            Inputs::read(&[0, 0b0010_0000]).status,
            1 << 5,
            "step 6 complete is %IX1.5"
        );
    }

    #[test]
    fn outputs_lie_where_the_configuration_says() {
        let outputs = Outputs {
            command: command::IM1_INDEX | command::ACKNOWLEDGE,
            lamps: lamp::FAULT,
            phase: 4,
            step: 6,
            cycles: 258,
        };
        let mut image = [0xFF; 9];
        outputs.write(&mut image);
        assert_eq!(image, [0x80, 0x01, 4, 4, 0, 6, 1, 2, 0xFF]);
        let mut short = [0; 3];
        outputs.write(&mut short);
        assert_eq!(short, [0x80, 0x01, 4]);
    }
}
