//! Names of transport ends (TSAP): which CPU of a rack a client connects to.

use std::fmt;
use std::str::FromStr;

use super::transport::LONGEST_TSAP;
use tickbus_base::toml_text::shown;

/// The kind of connection, the first byte of a TSAP with rack and slot.
const PROGRAMMING_DEVICE: u8 = 1;

/// A TSAP: a string of bytes, usually two.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Tsap {
    length: u8,
    bytes: [u8; LONGEST_TSAP],
}

impl Tsap {
    /// The TSAP with these bytes, truncated if too long.
    pub fn new(name: &[u8]) -> Self {
        let length = name.len().min(LONGEST_TSAP);
        let mut bytes = [0; LONGEST_TSAP];
        bytes[..length].copy_from_slice(&name[..length]);
        Self {
            length: u8::try_from(length).expect("it was cut"),
            bytes,
        }
    }

    /// The CPU in a rack and slot, as addressed by programming devices and libraries: 0x01 and rack · 32 +
    /// slot.
    pub fn of_slot(rack: u8, slot: u8) -> Self {
        Self::new(&[PROGRAMMING_DEVICE, rack * 32 + slot])
    }

    /// The bytes.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// Rack and slot, if the TSAP has them.
    pub fn slot(&self) -> Option<(u8, u8)> {
        match self.as_bytes() {
            [_, place] => Some((place / 32, place % 32)),
            _ => None,
        }
    }
}

impl Default for Tsap {
    fn default() -> Self {
        Self::new(&[])
    }
}

impl fmt::Display for Tsap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, byte) in self.as_bytes().iter().enumerate() {
            let dot = if index > 0 { "." } else { "" };
            write!(f, "{dot}{byte:02X}")?;
        }
        Ok(())
    }
}

impl fmt::Debug for Tsap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tsap({self})")
    }
}

/// Reads a TSAP as engineering tools show it: two hexadecimal numbers with a dot, such as `03.01`.
impl FromStr for Tsap {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("\"{}\" is no TSAP", shown(text));
        let bytes: Option<Vec<u8>> = text
            .split('.')
            .map(|part| {
                let digits = part.bytes().all(|byte| byte.is_ascii_hexdigit());
                let number = u8::from_str_radix(part, 16).ok();
                number.filter(|_| digits && part.len() == 2)
            })
            .collect();
        let bytes = bytes.filter(|bytes| bytes.len() <= LONGEST_TSAP);
        bytes.map(|bytes| Self::new(&bytes)).ok_or_else(wrong)
    }
}

/// The valid racks.
pub(super) const RACK: std::ops::RangeInclusive<i128> = 0..=7;
/// The slots of a rack.
pub(super) const SLOT: std::ops::RangeInclusive<i128> = 0..=31;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_and_write_themselves() {
        for text in ["01.00", "03.01", "10.0A", "53"] {
            let tsap: Tsap = text.parse().expect(text);
            assert_eq!(tsap.to_string(), text);
        }
        for text in ["", "1.0", "0x03.01", "03.01.", "+3.01", "03,01", "GG.00"] {
            assert!(text.parse::<Tsap>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_slot_is_found_in_the_name_that_was_made_of_it() {
        assert_eq!(Tsap::of_slot(0, 1).as_bytes(), [1, 1]);
        assert_eq!(Tsap::of_slot(2, 3).as_bytes(), [1, 0x43]);
        assert_eq!(Tsap::of_slot(7, 31).slot(), Some((7, 31)));
        assert_eq!(Tsap::new(b"SIMATIC-ROOT-OTHER").slot(), None);
        assert_eq!(Tsap::default().slot(), None);
    }
}
