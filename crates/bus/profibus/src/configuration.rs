//! The modules of a station: their identifiers, as in `Chk_Cfg` and `Get_Cfg`.

use std::fmt::Write as _;
use std::ops::Range;

use tickbus_base::toml_text::shown;

/// The most octets that a message shows.
const SHOWN_OCTETS: usize = 16;

/// The longest data block of one identifier, in bytes.
const BLOCK: usize = 16;

/// The modules of a station, in the order of their slots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Configuration {
    modules: Vec<SlotModule>,
    bytes: Vec<u8>,
    inputs: usize,
    outputs: usize,
    /// Accept any modules of the same sizes.
    sizes_only: bool,
}

/// A module in its slot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlotModule {
    /// The name in the GSD file; empty if unknown.
    pub name: String,
    /// The identifiers.
    pub identifiers: Vec<u8>,
    /// The position of its bytes among those that the station sends.
    pub inputs: Range<usize>,
    /// The position of its bytes among those that the station receives.
    pub outputs: Range<usize>,
}

/// One identifier: its number of bytes, and the I/O that it describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Identifier {
    length: usize,
    inputs: usize,
    outputs: usize,
}

impl Identifier {
    /// Reads the identifier at the start of `bytes`; `None` if it is incomplete.
    fn read(bytes: &[u8]) -> Option<Self> {
        let first = *bytes.first()?;
        let size = |octet: u8, count: u8| {
            let unit = if octet & 0x40 == 0 { 1 } else { 2 };
            unit * (usize::from(octet & count) + 1)
        };
        if first & 0x30 != 0 {
            let bytes = size(first, 0x0F);
            return Some(Self {
                length: 1,
                inputs: if first & 0x10 == 0 { 0 } else { bytes },
                outputs: if first & 0x20 == 0 { 0 } else { bytes },
            });
        }
        let (has_outputs, has_inputs) = (first & 0x80 != 0, first & 0x40 != 0);
        let mut length = 1;
        // The length of the outputs precedes that of the inputs.
        let mut read = |is_there: bool| {
            if !is_there {
                return Some(0);
            }
            let octet = *bytes.get(length)?;
            length += 1;
            Some(size(octet, 0x3F))
        };
        let (outputs, inputs) = (read(has_outputs)?, read(has_inputs)?);
        // 15 means that vendor-specific octets are not compared; none follow.
        let vendors = match first & 0x0F {
            0x0F => 0,
            count => usize::from(count),
        };
        let length = length + vendors;
        (length <= bytes.len()).then_some(Self {
            length,
            inputs,
            outputs,
        })
    }
}

impl Configuration {
    /// The configuration of these modules, each with its name and its identifiers.
    ///
    /// # Errors
    ///
    /// An identifier is incomplete: the message names its module.
    pub fn of_modules<'a>(
        modules: impl IntoIterator<Item = (&'a str, &'a [u8])>,
    ) -> Result<Self, String> {
        let mut all = Self::default();
        for (name, identifiers) in modules {
            let mut rest = identifiers;
            let (inputs, outputs) = (all.inputs, all.outputs);
            while !rest.is_empty() {
                let Some(one) = Identifier::read(rest) else {
                    return Err(format!(
                        "the identifier {} of slot {} ends in its midst",
                        brief(rest),
                        all.modules.len() + 1
                    ));
                };
                all.inputs += one.inputs;
                all.outputs += one.outputs;
                rest = &rest[one.length..];
            }
            all.bytes.extend_from_slice(identifiers);
            all.modules.push(SlotModule {
                name: name.to_owned(),
                identifiers: identifiers.to_vec(),
                inputs: inputs..all.inputs,
                outputs: outputs..all.outputs,
            });
        }
        Ok(all)
    }

    /// The configuration of these bytes, one slot for each identifier.
    ///
    /// # Errors
    ///
    /// The last identifier is incomplete.
    pub fn of_bytes(bytes: &[u8]) -> Result<Self, String> {
        let mut slots = Vec::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let length = Identifier::read(rest).map_or(rest.len(), |one| one.length);
            let (slot, behind) = rest.split_at(length);
            slots.push(("", slot));
            rest = behind;
        }
        Self::of_modules(slots)
    }

    /// A configuration of these sizes in bytes, for a station with unknown modules: it accepts any other with the same
    /// sizes.
    pub fn of_sizes(inputs: usize, outputs: usize) -> Self {
        let mut bytes = Vec::new();
        for (size, kind) in [(inputs, 0x10), (outputs, 0x20)] {
            for at in (0..size).step_by(BLOCK) {
                let length = BLOCK.min(size - at);
                bytes.push(kind | u8::try_from(length - 1).expect("at most 15"));
            }
        }
        let mut all = Self::of_bytes(&bytes).expect("whole identifiers");
        all.sizes_only = true;
        all
    }

    /// The identifiers.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The modules: that of slot 1, and so on.
    pub fn modules(&self) -> &[SlotModule] {
        &self.modules
    }

    /// The highest slot; any that a station can have if its modules are unknown.
    pub fn slots(&self) -> u8 {
        if self.sizes_only {
            return u8::MAX - 1;
        }
        u8::try_from(self.modules.len()).unwrap_or(u8::MAX - 1)
    }

    /// True if any other modules of the same sizes are accepted.
    pub fn has_sizes_only(&self) -> bool {
        self.sizes_only
    }

    /// The bytes that the station sends.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// The bytes that the station receives.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// The kind of the channels of the module in `slot`, from 1, as a diagnosis encodes it: 1 for inputs, 2 for
    /// outputs, 3 for both; and 1 for bits, 5 for words.
    pub(crate) fn channel_kind(&self, slot: usize) -> (u8, u8) {
        let module = slot.checked_sub(1).and_then(|at| self.modules.get(at));
        let first = module.and_then(|module| module.identifiers.first());
        match first {
            Some(first) if first & 0x30 != 0 => {
                ((first & 0x30) >> 4, if first & 0x40 == 0 { 1 } else { 5 })
            }
            _ => (3, 1),
        }
    }

    /// Why the modules in `received` are not those of this station; `None` if they are.
    pub fn difference(&self, received: &[u8]) -> Option<String> {
        if received == self.bytes {
            return None;
        }
        if self.sizes_only {
            return match Self::of_bytes(received) {
                Ok(other) if (other.inputs, other.outputs) == (self.inputs, self.outputs) => None,
                Ok(other) => Some(format!(
                    "expected {} and {} in all, received {} ({} and {})",
                    inputs(self.inputs),
                    outputs(self.outputs),
                    brief(received),
                    inputs(other.inputs),
                    outputs(other.outputs),
                )),
                Err(why) => Some(why),
            };
        }
        let mut rest = received;
        for (number, module) in (1..).zip(&self.modules) {
            if let Some(behind) = rest.strip_prefix(&module.identifiers[..]) {
                rest = behind;
                continue;
            }
            let mut text = format!("slot {number}: expected ");
            if !module.name.is_empty() {
                let _ = write!(text, "\"{}\", ", shown(&module.name));
            }
            let _ = write!(text, "{}, received ", in_words(&module.identifiers));
            match Identifier::read(rest) {
                _ if rest.is_empty() => text.push_str("no module"),
                Some(one) => text.push_str(&in_words(&rest[..one.length])),
                None => text.push_str(&brief(rest)),
            }
            return Some(text);
        }
        let next = Identifier::read(rest).map_or(rest, |one| &rest[..one.length]);
        Some(format!(
            "slot {}: expected no module, received {}",
            self.modules.len() + 1,
            in_words(next)
        ))
    }
}

/// Describes identifiers: their bytes and meaning.
fn in_words(identifiers: &[u8]) -> String {
    let (mut ins, mut outs) = (0, 0);
    let mut rest = identifiers;
    while let Some(one) = Identifier::read(rest) {
        ins += one.inputs;
        outs += one.outputs;
        rest = &rest[one.length..];
    }
    let what = match (ins, outs) {
        (0, 0) => "no I/O".to_owned(),
        (ins, 0) => inputs(ins),
        (0, outs) => outputs(outs),
        (ins, outs) => format!("{}, {}", inputs(ins), outputs(outs)),
    };
    format!("{} ({what})", brief(identifiers))
}

fn inputs(bytes: usize) -> String {
    format!("{} of inputs", count(bytes))
}

fn outputs(bytes: usize) -> String {
    format!("{} of outputs", count(bytes))
}

fn count(bytes: usize) -> String {
    format!("{bytes} byte{}", if bytes == 1 { "" } else { "s" })
}

/// Octets in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    let octets: Vec<String> = bytes.iter().map(|octet| format!("{octet:02X}")).collect();
    octets.join(" ")
}

/// Like [`hex`], shortened for a message.
fn brief(bytes: &[u8]) -> String {
    if bytes.len() <= SHOWN_OCTETS {
        return hex(bytes);
    }
    format!("{} … ({} octets)", hex(&bytes[..SHOWN_OCTETS]), bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sizes(bytes: &[u8]) -> (usize, usize) {
        let all = Configuration::of_bytes(bytes).expect("whole identifiers");
        (all.inputs(), all.outputs())
    }

    #[test]
    fn identifiers_tell_the_sizes() {
        assert_eq!(sizes(&[0x50]), (2, 0));
        assert_eq!(sizes(&[0x60]), (0, 2));
        assert_eq!(sizes(&[0x70]), (2, 2));
        assert_eq!(sizes(&[0x1F, 0x20]), (16, 1));
        assert_eq!(sizes(&[0xD3, 0xE1]), (8, 4));
        // An empty slot with four vendor-specific octets, and one with both lengths.
        assert_eq!(sizes(&[0x04, 0x00, 0x00, 0xAD, 0xC0]), (0, 0));
        assert_eq!(sizes(&[0xC1, 0x43, 0x81, 0xAA]), (2, 8));
        assert_eq!(sizes(&[0x42, 0x00, 0x01, 0x02, 0x8F, 0x3F]), (1, 64));
    }

    #[test]
    fn an_identifier_that_ends_early_is_refused() {
        for bytes in [&[0x40][..], &[0x04, 0, 0, 0], &[0x50, 0xC0, 0x01]] {
            let why = Configuration::of_bytes(bytes).expect_err("it ends early");
            assert!(why.contains("ends in its midst"), "{why}");
        }
    }

    #[test]
    fn a_difference_names_the_slot_and_both_sides() {
        let modules = [("1 word in", &[0x50][..]), ("1 word out", &[0x60])];
        let expected = Configuration::of_modules(modules).expect("whole");
        assert_eq!(expected.difference(&[0x50, 0x60]), None);
        for (received, words) in [
            (
                &[0x50, 0x50][..],
                "slot 2: expected \"1 word out\", 60 (2 bytes of outputs), received 50 (2 bytes of inputs)",
            ),
            (
                &[0x50],
                "slot 2: expected \"1 word out\", 60 (2 bytes of outputs), received no module",
            ),
            (
                &[0x50, 0x60, 0x10],
                "slot 3: expected no module, received 10 (1 byte of inputs)",
            ),
            (
                &[0x50, 0x40],
                "slot 2: expected \"1 word out\", 60 (2 bytes of outputs), received 40",
            ),
        ] {
            assert_eq!(expected.difference(received).as_deref(), Some(words));
        }
    }

    #[test]
    fn a_difference_is_short_however_long_the_modules_are() {
        let name = "n".repeat(1000);
        let expected = Configuration::of_modules([(&*name, &[0x50; 200][..])]).expect("whole");
        let why = expected.difference(&[0x40; 244]).expect("other modules");
        assert!(why.len() < 300, "{why}");
        assert!(
            why.contains("50 50 … (200 octets) (400 bytes of inputs)"),
            "{why}"
        );
    }

    #[test]
    fn each_module_has_its_bytes_in_the_order_of_the_slots() {
        let modules = [
            ("", &[0x50][..]),
            ("", &[0x00]),
            ("", &[0x70]),
            ("", &[0x10, 0x22]),
        ];
        let all = Configuration::of_modules(modules).expect("whole");
        let bytes: Vec<_> = all
            .modules()
            .iter()
            .map(|m| (m.inputs.clone(), m.outputs.clone()))
            .collect();
        assert_eq!(
            bytes,
            [(0..2, 0..0), (2..2, 0..0), (2..4, 0..2), (4..5, 2..5)]
        );
    }

    #[test]
    fn sizes_alone_take_any_modules_that_have_them() {
        let own = Configuration::of_sizes(20, 3);
        assert_eq!(own.bytes(), [0x1F, 0x13, 0x22]);
        assert_eq!((own.inputs(), own.outputs()), (20, 3));
        assert_eq!(own.difference(&[0x22, 0x59,]), None);
        let why = own.difference(&[0x22]).expect("no inputs");
        assert_eq!(
            why,
            "expected 20 bytes of inputs and 3 bytes of outputs in all, received 22 \
             (0 bytes of inputs and 3 bytes of outputs)"
        );
        assert!(own.difference(&[0x40]).is_some());
    }
}
