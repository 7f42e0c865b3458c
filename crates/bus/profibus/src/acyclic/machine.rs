//! The machine behind the records.

use super::pdu::Refusal;

/// The machine behind the records of a station; its parameters as a drive count as records, behind the others.
pub(crate) trait Machine {
    /// Fills in the octets of the record that the machine provides; the others stay.
    fn read(&mut self, record: usize, octets: &mut [u8]);

    /// A master has written these octets into the record.
    fn written(&mut self, record: usize, octets: &[u8]);

    /// A master's request for a record was refused.
    fn refused(&mut self, writes: bool, slot: u8, index: u8, why: Refusal);
}
