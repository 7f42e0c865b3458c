//! Record 255: the functions for identification and maintenance (I&M), of PROFIBUS profile 3.502.
//!
//! A master writes a call that names one of several parts, and then reads the record, or writes the part along with the
//! call.

use super::pdu::Refusal;

/// The index of the record in each slot.
pub(super) const INDEX: u8 = 255;

/// A call, as against the other functions that the record could have.
const CALL: u8 = 0x08;

/// The number of part 0, the nameplate; parts 1 to 3 follow.
const FIRST: u16 = 65_000;

/// The octets before the contents of a part, for the maker's own use.
const HEAD: usize = 10;

/// The octets of a part that a master can write.
const NOTE: usize = 54;

/// The parts that a master can write: the place in the plant, the date of the installation, and remarks.
const NOTES: usize = 3;

/// `IM_SUPPORTED`: a bit for each part that can be written.
const SUPPORTED: u16 = 0b1110;

/// The profile of a device that follows none.
const GENERIC_DEVICE: u16 = 0xF600;

/// A device's nameplate.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Nameplate {
    /// The number that PROFIBUS & PROFINET International has given to the maker; 0 for none.
    pub manufacturer: u16,
    /// The order number, of which 20 characters are sent.
    pub order: String,
    /// The serial number, of which 16 characters are sent.
    pub serial: String,
}

/// The contents of record 255.
#[derive(Debug)]
pub(super) struct Identification {
    nameplate: Vec<u8>,
    notes: [[u8; NOTE]; NOTES],
}

impl Identification {
    pub(super) fn new(own: &Nameplate) -> Self {
        let mut nameplate = vec![0; HEAD];
        nameplate.extend(own.manufacturer.to_be_bytes());
        nameplate.extend(text::<20>(&own.order));
        nameplate.extend(text::<16>(&own.serial));
        nameplate.extend(1_u16.to_be_bytes()); // HARDWARE_REVISION
        nameplate.extend([b'V', 1, 0, 0]); // SOFTWARE_REVISION
        nameplate.extend(0_u16.to_be_bytes()); // REVISION_COUNTER
        nameplate.extend(GENERIC_DEVICE.to_be_bytes());
        nameplate.extend(0_u16.to_be_bytes()); // PROFILE_SPECIFIC_TYPE
        nameplate.extend([1, 1]); // IM_VERSION
        nameplate.extend(SUPPORTED.to_be_bytes());
        Self {
            nameplate,
            notes: [[b' '; NOTE]; NOTES],
        }
    }

    /// Takes what a master writes into the record; returns the part that it names.
    pub(super) fn call(&mut self, data: &[u8]) -> Result<u16, Refusal> {
        let (&[CALL, 0, high, low], contents) = data.split_first_chunk().ok_or(Refusal::Length)?
        else {
            return Err(Refusal::NotSupported);
        };
        let part = u16::from_be_bytes([high, low]);
        let note = match part.checked_sub(FIRST).map(usize::from) {
            Some(0) if contents.is_empty() => return Ok(part),
            Some(0) => return Err(Refusal::Access),
            Some(number) => self.notes.get_mut(number - 1),
            None => None,
        };
        let note = note.ok_or(Refusal::Index)?;
        if !contents.is_empty() {
            let new = contents.get(HEAD..).ok_or(Refusal::Length)?;
            *note = new.try_into().map_err(|_| Refusal::Length)?;
        }
        Ok(part)
    }

    /// The record with the part that the last call has named.
    pub(super) fn read(&self, part: u16) -> Result<Vec<u8>, Refusal> {
        let number = usize::from(part.checked_sub(FIRST).ok_or(Refusal::Index)?);
        let mut octets = vec![CALL, 0];
        octets.extend(part.to_be_bytes());
        match number.checked_sub(1) {
            None => octets.extend_from_slice(&self.nameplate),
            Some(note) => {
                octets.extend([0; HEAD]);
                octets.extend(self.notes.get(note).ok_or(Refusal::Index)?);
            }
        }
        Ok(octets)
    }
}

/// The beginning of a text, filled up with blanks; other characters than ASCII become question marks.
fn text<const LENGTH: usize>(text: &str) -> [u8; LENGTH] {
    let mut octets = [b' '; LENGTH];
    for (octet, character) in octets.iter_mut().zip(text.chars()) {
        let plain = character.is_ascii_graphic() || character == ' ';
        *octet = if plain { character as u8 } else { b'?' };
    }
    octets
}
