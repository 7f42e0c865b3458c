//! The program "mirror": a loop-back plug in the form of a PLC.

use tickbus_image::copy_frame;
use tickbus_plc::{Program, ProgramError, Scan};

/// Copies every `%I` byte to the `%Q` byte at the same offset, as far as both images reach.
///
/// Stale inputs are copied as well, as a plug would do. If a mirror stands in for a machine, `%Q` signals with a stated
/// `fail_safe` have that value meanwhile.
/// have that value meanwhile.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mirror;

impl Mirror {
    /// The name in [`program`](super::program).
    pub const NAME: &'static str = "mirror";

    /// A mirror; it has no options.
    ///
    /// # Errors
    ///
    /// Any option is given.
    pub fn new(options: &[(String, String)]) -> Result<Self, ProgramError> {
        match options.first() {
            None => Ok(Self),
            Some((option, _)) => Err(ProgramError::UnknownOption {
                program: Self::NAME,
                option: option.clone(),
                known: &[],
            }),
        }
    }
}

impl Program for Mirror {
    fn name(&self) -> &str {
        Self::NAME
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn for_another_station(&self, _station: usize) -> Option<Box<dyn Program>> {
        Some(Box::new(*self))
    }

    fn can_hang(&self) -> bool {
        false
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        let bytes = scan.inputs.len().min(scan.outputs.len());
        copy_frame(&mut scan.outputs[..bytes], &scan.inputs[..bytes]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Nanos;

    fn mirrored(inputs: &[u8], mut outputs: Vec<u8>) -> Vec<u8> {
        Mirror.scan(&mut Scan {
            now: Nanos::ZERO,
            alive: true,
            cycle: 0,
            inputs,
            outputs: &mut outputs,
        });
        outputs
    }

    #[test]
    fn every_byte_comes_back_at_its_offset() {
        assert_eq!(mirrored(&[1, 2, 3], vec![9; 3]), [1, 2, 3]);
    }

    #[test]
    fn images_of_different_sizes_share_what_they_have() {
        assert_eq!(mirrored(&[1, 2], vec![9; 4]), [1, 2, 9, 9]);
        assert_eq!(mirrored(&[1, 2, 3], vec![9; 1]), [1]);
        assert_eq!(mirrored(&[], vec![]), []);
    }
}
