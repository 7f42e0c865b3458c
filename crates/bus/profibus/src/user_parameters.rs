//! The user parameters: the octets of `Set_Prm` after the standard's own, as a GSD file describes them.

use std::collections::BTreeMap;
use std::fmt;
use std::fmt::Write as _;
use std::ops::{Range, RangeInclusive};
use std::sync::Arc;

use tickbus_base::toml_text::shown;

/// The most such octets in one telegram.
pub(crate) const LIMIT: usize = 237;

/// The most values of a list that a message names.
const SHOWN_VALUES: usize = 8;

/// A parameter that an engineer can set in the PLC's project.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The name.
    pub name: String,
    /// The encoding in the octets.
    pub kind: ParameterKind,
    /// The default.
    pub default: i64,
    /// The allowed values.
    pub allowed: Allowed,
    /// The meaning of single values, in words.
    pub texts: Arc<BTreeMap<i64, String>>,
    /// True if an engineer may change the parameter.
    pub is_changeable: bool,
    /// True if an engineer sees the parameter.
    pub is_visible: bool,
}

/// The encoding of a parameter in the octets; with several octets the high one comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// A number without a sign, of 1, 2 or 4 octets.
    Unsigned(usize),
    /// A number with a sign, of 1, 2 or 4 octets.
    Signed(usize),
    /// Bits of one octet; bit 0 is the lowest.
    Bits {
        /// The lowest.
        first: u8,
        /// The highest, at most 7.
        last: u8,
    },
}

impl ParameterKind {
    /// The number of octets that the parameter occupies.
    pub const fn octets(self) -> usize {
        match self {
            Self::Unsigned(octets) | Self::Signed(octets) => octets,
            Self::Bits { .. } => 1,
        }
    }

    /// The values that fit.
    pub fn range(self) -> RangeInclusive<i64> {
        match self {
            Self::Unsigned(octets) => 0..=(1 << (8 * octets)) - 1,
            Self::Signed(octets) => -(1 << (8 * octets - 1))..=(1 << (8 * octets - 1)) - 1,
            Self::Bits { first, last } => 0..=(1 << (last - first + 1)) - 1,
        }
    }

    /// The parameter's bits in each of its octets.
    fn mask(self) -> u8 {
        match self {
            Self::Unsigned(_) | Self::Signed(_) => 0xFF,
            Self::Bits { first, last } => (0xFF >> (7 - (last - first))) << first,
        }
    }

    /// Reads the parameter from the start of `octets`, which must be long enough.
    fn read(self, octets: &[u8]) -> i64 {
        let own = octets[..self.octets()].iter();
        let value = own.fold(0, |value, octet| {
            value << 8 | i64::from(octet & self.mask())
        });
        match self {
            Self::Unsigned(_) => value,
            Self::Signed(count) => {
                let unused = 64 - 8 * count;
                value << unused >> unused
            }
            Self::Bits { first, .. } => value >> first,
        }
    }

    /// Writes the parameter at the start of `octets`, which must be long enough. The value must fit.
    fn write(self, value: i64, octets: &mut [u8]) {
        if let Self::Bits { first, .. } = self {
            let bits = value.to_be_bytes()[7] << first;
            octets[0] = octets[0] & !self.mask() | bits & self.mask();
        } else {
            let all = value.to_be_bytes();
            octets[..self.octets()].copy_from_slice(&all[8 - self.octets()..]);
        }
    }
}

/// The allowed values of a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Allowed {
    /// All that fit the kind.
    Any,
    /// From the first to the second.
    Range(i64, i64),
    /// These values.
    List(Vec<i64>),
}

impl Parameter {
    /// True if the file allows `value`. A device always accepts the default, too.
    pub fn allows(&self, value: i64) -> bool {
        match &self.allowed {
            Allowed::Any => true,
            Allowed::Range(least, most) => (*least..=*most).contains(&value),
            Allowed::List(values) => values.contains(&value),
        }
    }

    /// A value with its meaning.
    fn value(&self, value: i64) -> String {
        match self.texts.get(&value) {
            Some(text) => format!("{value} ({})", shown(text)),
            None => value.to_string(),
        }
    }
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => f.write_str("any value"),
            Self::Range(least, most) => write!(f, "{least} to {most}"),
            Self::List(values) => {
                let texts: Vec<String> = values.iter().map(i64::to_string).collect();
                f.write_str(&texts[..texts.len().min(SHOWN_VALUES)].join(", "))?;
                f.write_str(if texts.len() > SHOWN_VALUES {
                    ", …"
                } else {
                    ""
                })
            }
        }
    }
}

/// The parameters of a device itself, or of one module.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ParameterBlock {
    /// The number of octets; nothing extends beyond.
    pub length: usize,
    /// Octets that the PLC's tool sends unchanged, each piece with its offset.
    pub constants: Vec<(usize, Vec<u8>)>,
    /// The parameters among them, each with its offset.
    pub parameters: Vec<(usize, Arc<Parameter>)>,
}

impl ParameterBlock {
    /// The octets that a PLC's tool sends by default.
    pub fn defaults(&self) -> Vec<u8> {
        let mut octets = vec![0; self.length];
        for (at, constant) in &self.constants {
            octets[*at..at + constant.len()].copy_from_slice(constant);
        }
        for (at, parameter) in &self.parameters {
            parameter.kind.write(parameter.default, &mut octets[*at..]);
        }
        octets
    }

    /// The bits of each octet that belong to no parameter.
    fn constant_bits(&self) -> Vec<u8> {
        let mut bits = vec![0xFF; self.length];
        for (at, parameter) in &self.parameters {
            for octet in &mut bits[*at..at + parameter.kind.octets()] {
                *octet &= !parameter.kind.mask();
            }
        }
        bits
    }
}

/// The parameters of a device with its modules, in the order of the slots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UserParameters {
    parts: Vec<Part>,
    /// The octets that a PLC's tool sends by default for the device and all modules.
    defaults: Vec<u8>,
}

/// The parameters of the device itself or of one module.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Part {
    /// The name in messages.
    label: String,
    at: usize,
    block: Arc<ParameterBlock>,
}

impl Part {
    fn octets(&self) -> Range<usize> {
        self.at..self.at + self.block.length
    }
}

impl UserParameters {
    /// Appends the parameters of `module`, or of the device itself.
    pub(crate) fn push(&mut self, module: Option<(usize, &str)>, block: &Arc<ParameterBlock>) {
        if block.length == 0 {
            return;
        }
        self.parts.push(Part {
            label: module.map_or_else(
                || "the device".to_owned(),
                |(slot, name)| format!("slot {slot} \"{}\"", shown(name)),
            ),
            at: self.defaults.len(),
            block: Arc::clone(block),
        });
        self.defaults.extend(block.defaults());
    }

    /// The octets that a PLC's tool sends by default.
    pub fn defaults(&self) -> &[u8] {
        &self.defaults
    }

    /// The parameters with their defaults, in words: a line for the device and for each module that has any.
    pub fn in_words(&self) -> impl Iterator<Item = String> {
        let with_parameters = self.parts.iter();
        let with_parameters = with_parameters.filter(|part| !part.block.parameters.is_empty());
        with_parameters.map(|part| {
            let mut text = part.label.clone();
            for (index, (_, parameter)) in part.block.parameters.iter().enumerate() {
                let (separator, default) = (
                    if index == 0 { ": " } else { ", " },
                    parameter.value(parameter.default),
                );
                let _ = write!(text, "{separator}{} = {default}", shown(&parameter.name));
            }
            text
        })
    }

    /// Why a device refuses the octets in `received`; otherwise a remark on unusual ones, if any.
    ///
    /// Different constants are unusual: engineers change them by hand, in tools that do not know the parameters.
    ///
    /// # Errors
    ///
    /// There are too few octets, or a parameter has a value that the GSD file does not allow.
    pub fn check(&self, received: &[u8]) -> Result<Option<String>, String> {
        if let Some(part) = self
            .parts
            .iter()
            .find(|part| part.octets().end > received.len())
        {
            return Err(format!(
                "expected {} octets of user parameters, received {}; those of {} are missing",
                self.defaults.len(),
                received.len(),
                part.label
            ));
        }
        for part in &self.parts {
            for (at, parameter) in &part.block.parameters {
                let at = part.at + at;
                let value = parameter.kind.read(&received[at..]);
                // If a file puts two parameters into the same bits, the tool sends the later one.
                let is_default = value == parameter.kind.read(&self.defaults[at..]);
                if !is_default && !parameter.allows(value) {
                    return Err(format!(
                        "{}: parameter \"{}\" is {value}; the GSD allows {}",
                        part.label,
                        shown(&parameter.name),
                        parameter.allowed
                    ));
                }
            }
        }
        Ok(self.unusual(received))
    }

    fn unusual(&self, received: &[u8]) -> Option<String> {
        for part in &self.parts {
            for (at, bits) in part.block.constant_bits().into_iter().enumerate() {
                let (own, other) = (self.defaults[part.at + at], received[part.at + at]);
                if (own ^ other) & bits != 0 {
                    return Some(format!(
                        "{}: octet {at} of its parameters is {other:02X}; the GSD's constant is {own:02X}",
                        part.label
                    ));
                }
            }
        }
        let more = received.len().saturating_sub(self.defaults.len());
        (!self.parts.is_empty() && more > 0)
            .then(|| format!("{more} octets of user parameters more than the GSD has"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(
        name: &str,
        kind: ParameterKind,
        default: i64,
        allowed: Allowed,
    ) -> Arc<Parameter> {
        Arc::new(Parameter {
            name: name.to_owned(),
            kind,
            default,
            allowed,
            texts: Arc::new(BTreeMap::from([(1, "4 to 20 mA".to_owned())])),
            is_changeable: true,
            is_visible: true,
        })
    }

    fn bits(first: u8, last: u8) -> ParameterKind {
        ParameterKind::Bits { first, last }
    }

    /// Two octets of the device, and four of a module.
    fn own() -> UserParameters {
        let device = ParameterBlock {
            length: 2,
            constants: vec![(0, vec![0xC0, 0x08])],
            parameters: vec![],
        };
        let module = ParameterBlock {
            length: 4,
            constants: vec![(0, vec![0x81])],
            parameters: vec![
                (
                    0,
                    parameter("Output range", bits(1, 3), 1, Allowed::Range(0, 3)),
                ),
                (
                    1,
                    parameter("Limit", ParameterKind::Signed(2), -2, Allowed::Any),
                ),
                (
                    3,
                    parameter(
                        "Filter",
                        ParameterKind::Unsigned(1),
                        10,
                        Allowed::List(vec![1, 10]),
                    ),
                ),
            ],
        };
        let mut own = UserParameters::default();
        own.push(None, &Arc::new(device));
        own.push(Some((1, "empty")), &Arc::new(ParameterBlock::default()));
        own.push(Some((2, "4 AO")), &Arc::new(module));
        own
    }

    #[test]
    fn the_defaults_are_constants_and_parameters_module_by_module() {
        let own = own();
        assert_eq!(own.defaults(), [0xC0, 0x08, 0x83, 0xFF, 0xFE, 10]);
        assert_eq!(own.check(own.defaults()), Ok(None));
        let words: Vec<String> = own.in_words().collect();
        let right = "slot 2 \"4 AO\": Output range = 1 (4 to 20 mA), Limit = -2, Filter = 10";
        assert_eq!(words, [right]);
    }

    #[test]
    fn what_a_device_refuses_is_said_by_slot_and_name() {
        for (received, words) in [
            (
                &[0xC0, 0x08, 0x83][..],
                "expected 6 octets of user parameters, received 3; those of slot 2 \"4 AO\" are missing",
            ),
            (
                &[],
                "expected 6 octets of user parameters, received 0; those of the device are missing",
            ),
            (
                &[0xC0, 0x08, 0x8F, 0, 0, 1],
                "slot 2 \"4 AO\": parameter \"Output range\" is 7; the GSD allows 0 to 3",
            ),
            (
                &[0xC0, 0x08, 0x83, 0, 0, 2],
                "slot 2 \"4 AO\": parameter \"Filter\" is 2; the GSD allows 1, 10",
            ),
        ] {
            assert_eq!(own().check(received), Err(words.to_owned()));
        }
    }

    #[test]
    fn other_constants_and_more_octets_are_accepted_and_noted() {
        let noted = |received: &[u8]| own().check(received).expect("accepted");
        assert_eq!(noted(&[0xC0, 0x08, 0x81, 0x80, 0, 1]), None);
        let constant = noted(&[0xC0, 0x00, 0x83, 0, 0, 1]).expect("another constant");
        assert_eq!(
            constant,
            "the device: octet 1 of its parameters is 00; the GSD's constant is 08"
        );
        // In an octet that is shared with a parameter, the other bits count.
        let shared = noted(&[0xC0, 0x08, 0x02, 0, 0, 1]).expect("bits 0 and 7");
        assert!(shared.contains("slot 2 \"4 AO\": octet 0"), "{shared}");
        let more = noted(&[0xC0, 0x08, 0x83, 0, 0, 1, 0]).expect("more");
        assert_eq!(more, "1 octets of user parameters more than the GSD has");
        assert_eq!(UserParameters::default().check(&[1, 2, 3]), Ok(None));
    }

    #[test]
    fn the_defaults_are_accepted_whatever_the_file_allows() {
        let range = parameter("range", bits(0, 1), 3, Allowed::Range(0, 1));
        let beside = parameter("beside", bits(1, 2), 2, Allowed::Any);
        for parameters in [vec![(0, Arc::clone(&range))], vec![(0, range), (0, beside)]] {
            let block = ParameterBlock {
                length: 1,
                constants: vec![],
                parameters,
            };
            let mut own = UserParameters::default();
            own.push(None, &Arc::new(block));
            assert_eq!(own.check(own.defaults()), Ok(None));
            assert!(own.check(&[2]).is_err());
        }
    }

    #[test]
    fn every_kind_reads_what_it_writes() {
        use ParameterKind::{Signed, Unsigned};
        let all = [1, 2, 4]
            .into_iter()
            .flat_map(|octets| [Unsigned(octets), Signed(octets)]);
        let all = all.chain((0..8).flat_map(|last| (0..=last).map(move |first| bits(first, last))));
        for kind in all {
            for value in [*kind.range().start(), *kind.range().end(), 0, 1] {
                for before in [0x00, 0xFF] {
                    let mut octets = [before; 5];
                    kind.write(value, &mut octets);
                    assert_eq!(kind.read(&octets), value, "{kind:?}");
                    assert_eq!(octets[0] & !kind.mask(), before & !kind.mask(), "{kind:?}");
                    assert_eq!(octets[4], before, "{kind:?}");
                }
            }
        }
    }
}
