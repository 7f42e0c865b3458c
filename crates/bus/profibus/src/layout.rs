//! The positions of signals in the telegrams: at their image addresses, or where `[fieldbus.at]` puts them in a module.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_fieldbus::copy_bits;
use tickbus_image::signal::{Address, Addressing, Area, DataType, Signal};

use crate::acyclic::{ELEMENT_LIMIT, Format};
use crate::configuration::Configuration;

const EXAMPLE: &str = "write the slot and the address in its module, such as \"slot 2 %IW0\", in one of its records, \
                       such as \"slot 2 record 10 %IW0\", or a drive's parameter, such as \"parameter 1121\"";

/// A position, as in `[fieldbus.at]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// In a module: `slot 2 %IW0`.
    Module { slot: usize, address: Address },
    /// In a record: `slot 2 record 10 %IW0`.
    Record {
        slot: usize,
        index: u8,
        address: Address,
    },
    /// A parameter of a drive, or an element of one: `parameter 1121`, `parameter 945[0]`.
    Parameter { number: u16, element: Option<usize> },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Module { slot, address } => write!(f, "slot {slot} {address}"),
            Self::Record {
                slot,
                index,
                address,
            } => write!(f, "slot {slot} record {index} {address}"),
            Self::Parameter {
                number,
                element: None,
            } => write!(f, "parameter {number}"),
            Self::Parameter {
                number,
                element: Some(element),
            } => write!(f, "parameter {number}[{element}]"),
        }
    }
}

impl FromStr for Place {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let wrong = || {
            Mistake::new(
                format!("\"{}\" is no place in a module", shown(text)),
                EXAMPLE,
            )
        };
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let (slot, index, address) = match words[..] {
            ["slot", slot, address] => (slot, None, address),
            ["slot", slot, "record", index, address] => (slot, Some(index), address),
            ["parameter", number] => return parameter(number).ok_or_else(wrong),
            _ => return Err(wrong()),
        };
        let slot = slot.parse().map_err(|_| wrong())?;
        let index = index.map(str::parse).transpose().map_err(|_| wrong())?;
        let address = Address::parse(address, Addressing::Bytes)?;
        Ok(match index {
            None => Self::Module { slot, address },
            Some(index) => Self::Record {
                slot,
                index,
                address,
            },
        })
    }
}

/// A parameter's number, and its element in brackets.
fn parameter(text: &str) -> Option<Place> {
    let (number, element) = match text.strip_suffix(']') {
        Some(text) => {
            let (number, element) = text.split_once('[')?;
            let element = element.parse().ok().filter(|own| *own < ELEMENT_LIMIT)?;
            (number, Some(element))
        }
        None => (text, None),
    };
    let number = number.parse().ok().filter(|number| *number > 0)?;
    Some(Place::Parameter { number, element })
}

impl Place {
    /// True for a position in a module, which the exchange of data carries.
    pub(crate) fn is_exchanged(self) -> bool {
        matches!(self, Self::Module { .. })
    }

    /// Checks that the position suits the signal; the device is checked elsewhere.
    pub(crate) fn suits(self, signal: &Signal) -> Result<(), Mistake> {
        let own = signal.address();
        let (address, what) = match self {
            Self::Module { address, .. } => (address, "module"),
            Self::Record { address, .. } => (address, "record"),
            Self::Parameter { .. } if format_of(signal.data_type).is_some() => return Ok(()),
            Self::Parameter { .. } => {
                let what = format!(
                    "\"{}\" has a type of 8 bytes, which no parameter has",
                    shown(&signal.name)
                );
                return Err(Mistake::new(what, "give it a type of at most 4"));
            }
        };
        if (address.area, address.width) == (own.area, own.width) {
            return Ok(());
        }
        Err(Mistake::new(
            format!(
                "\"{}\" is at {own}, and its place in the {what} is {address}",
                shown(&signal.name),
            ),
            "give both the same letters",
        ))
    }
}

/// The format of a parameter that a signal of this type can be.
pub(crate) fn format_of(data_type: DataType) -> Option<Format> {
    match data_type {
        DataType::Bool => Some(Format::Boolean),
        DataType::Sint => Some(Format::Integer8),
        DataType::Int => Some(Format::Integer16),
        DataType::Dint => Some(Format::Integer32),
        DataType::Byte | DataType::Usint => Some(Format::Unsigned8),
        DataType::Word | DataType::Uint => Some(Format::Unsigned16),
        DataType::Dword | DataType::Udint => Some(Format::Unsigned32),
        DataType::Real => Some(Format::FloatingPoint),
        DataType::Lword | DataType::Lint | DataType::Ulint | DataType::Lreal => None,
    }
}

/// The bits of a position in a module among all those of the station.
fn bits(slot: usize, address: Address, modules: &Configuration) -> Result<Range<usize>, Mistake> {
    let count = modules.modules().len();
    let module = slot
        .checked_sub(1)
        .and_then(|slot| modules.modules().get(slot));
    let Some(module) = module.filter(|_| !modules.has_sizes_only()) else {
        let what = format!("the station has no slot {slot}");
        return Err(Mistake::new(
            what,
            if modules.has_sizes_only() {
                "write \"config\", which says what its modules are".to_owned()
            } else {
                format!("its slots are 1 to {count}")
            },
        ));
    };
    let bytes = match address.area {
        Area::Input => &module.inputs,
        Area::Output => &module.outputs,
    };
    let own = address.bits();
    if own.end > 8 * bytes.len() {
        return Err(Mistake::new(
            format!("{address} lies beyond the module in slot {slot}"),
            format!("the module has {} bytes of {}", bytes.len(), address.area),
        ));
    }
    Ok(8 * bytes.start + own.start..8 * bytes.start + own.end)
}

/// A signal's bits in the image, and in the telegram or record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Move {
    pub(crate) image: usize,
    pub(crate) wire: Range<usize>,
}

/// The positions of the signals of one area of a station in its telegrams.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Layout {
    /// `None`: as in the image.
    moves: Option<Vec<Move>>,
}

impl Layout {
    /// The layout of these signals of one area of a station. Some have their own positions, given with their offset in
    /// the driver.cfg.
    ///
    /// # Errors
    ///
    /// The modules do not have such a position, or two signals would share bits.
    pub(crate) fn new<'s>(
        signals: impl Iterator<Item = &'s Signal>,
        places: &BTreeMap<String, (Place, usize)>,
        modules: &Configuration,
        area: Area,
    ) -> Result<Self, (usize, Mistake)> {
        let mut all: Vec<(Move, &Signal, Option<usize>)> = Vec::new();
        let mut first = None;
        for signal in signals {
            let image = signal.address().bits();
            let place = places.get(&signal.name);
            first = first.or(place.map(|(_, at)| *at));
            let wire = match place {
                Some((Place::Module { slot, address }, at)) => {
                    bits(*slot, *address, modules).map_err(|mistake| (*at, mistake))?
                }
                // No telegram of the exchange has it.
                Some(_) => continue,
                None => image.clone(),
            };
            let moved = Move {
                image: image.start,
                wire,
            };
            all.push((moved, signal, place.map(|(_, at)| *at)));
        }
        let Some(first) = first else {
            return Ok(Self::default());
        };
        let bytes = match area {
            Area::Input => modules.inputs(),
            Area::Output => modules.outputs(),
        };
        if let Some((_, signal, _)) = all.iter().find(|(own, ..)| own.wire.end > 8 * bytes) {
            let what = format!(
                "\"{}\" has no place in a module, and its address {} lies beyond the {bytes} bytes of them all",
                shown(&signal.name),
                signal.address()
            );
            return Err((
                first,
                Mistake::new(what, "give it a line in [fieldbus.at], too"),
            ));
        }
        all.sort_by_key(|(own, ..)| own.wire.start);
        let pairs = all.iter().zip(all.iter().skip(1));
        let twice = pairs.filter(|_| area == Area::Input);
        let mut twice = twice.filter(|((one, ..), (other, ..))| one.wire.end > other.wire.start);
        if let Some(((_, one, one_at), (_, other, at))) = twice.next() {
            let (at, other) = match at {
                Some(at) => (*at, one),
                None => (one_at.unwrap_or(first), other),
            };
            let what = format!("\"{}\" is sent there, too", shown(&other.name));
            return Err((at, Mistake::new(what, "give each signal bits of its own")));
        }
        let moves = all.into_iter().map(|(own, ..)| own);
        Ok(Self {
            moves: Some(moves.collect()),
        })
    }

    /// Copies the frame of the image into a telegram, which may be longer.
    pub(crate) fn send(&self, frame: &[u8], wire: &mut [u8]) {
        let Some(moves) = &self.moves else {
            wire[..frame.len()].copy_from_slice(frame);
            return;
        };
        wire.fill(0);
        for own in moves {
            copy_bits(frame, own.image, own.wire.len(), wire, own.wire.start);
        }
    }

    /// The frame of the image from a telegram; `frame` has its size and serves as a buffer.
    pub(crate) fn receive<'f>(&self, wire: &'f [u8], frame: &'f mut [u8]) -> &'f [u8] {
        let Some(moves) = &self.moves else {
            return &wire[..frame.len()];
        };
        frame.fill(0);
        for own in moves {
            copy_bits(wire, own.wire.start, own.wire.len(), frame, own.image);
        }
        frame
    }

    /// Copies the frame of the image out of a telegram.
    pub(crate) fn take(&self, wire: &[u8], frame: &mut [u8]) {
        if self.moves.is_some() {
            self.receive(wire, frame);
        } else {
            let count = frame.len();
            frame.copy_from_slice(&wire[..count]);
        }
    }
}

/// Signals for tests.
#[cfg(test)]
pub(crate) fn signal(name: &str, address: &str, data_type: DataType) -> Signal {
    let address: Address = address.parse().expect("right");
    let mut signal = Signal::new(name, address.area, address.byte, data_type);
    signal.bit = address.bit;
    signal
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two words in, one word out, one word in and a byte out.
    fn modules() -> Configuration {
        Configuration::of_modules([("", &[0x51][..]), ("", &[0x60]), ("", &[0x50, 0x20])])
            .expect("whole")
    }

    fn layout(
        signals: &[Signal],
        lines: &[(&str, &str)],
        area: Area,
    ) -> Result<Layout, (usize, Mistake)> {
        let places = lines.iter().enumerate().map(|(line, (name, place))| {
            ((*name).to_owned(), (place.parse().expect("a place"), line))
        });
        Layout::new(signals.iter(), &places.collect(), &modules(), area)
    }

    #[test]
    fn signals_go_to_their_modules_and_the_others_to_their_addresses() {
        let signals = [
            signal("word", "%IW0", DataType::Int),
            signal("bit", "%IX2.0", DataType::Bool),
            signal("byte", "%IB3", DataType::Byte),
        ];
        let lines = [("word", "slot 3 %IW0"), ("bit", "slot 1 %IX0.7")];
        let layout = layout(&signals, &lines, Area::Input).expect("right");
        let mut wire = [0xFF; 6];
        layout.send(&[0x12, 0x34, 0x01, 0x56], &mut wire);
        assert_eq!(wire, [0x80, 0, 0, 0x56, 0x12, 0x34]);
        let mut frame = [0xFF; 4];
        assert_eq!(layout.receive(&wire, &mut frame), [0x12, 0x34, 0x01, 0x56]);
        let plain = Layout::default();
        plain.send(&[1, 2], &mut wire);
        assert_eq!(wire[..3], [1, 2, 0]);
        assert_eq!(plain.receive(&wire, &mut frame), [1, 2, 0, 0x56]);
    }

    #[test]
    fn a_place_that_the_modules_do_not_have_is_refused() {
        let signals = [
            signal("a", "%IW0", DataType::Int),
            signal("b", "%IW2", DataType::Int),
            signal("far", "%IW6", DataType::Int),
        ];
        for (count, lines, line, words) in [
            (
                2,
                &[("a", "slot 4 %IW0")][..],
                0,
                "the station has no slot 4; its slots are 1 to 3",
            ),
            (
                2,
                &[("a", "slot 0 %IW0")],
                0,
                "the station has no slot 0; its slots are 1 to 3",
            ),
            (
                2,
                &[("a", "slot 3 %IW1")],
                0,
                "%IW1 lies beyond the module in slot 3; the module has 2 bytes of %I",
            ),
            (
                2,
                &[("a", "slot 2 %IW0")],
                0,
                "%IW0 lies beyond the module in slot 2; the module has 0 bytes of %I",
            ),
            (
                2,
                &[("a", "slot 1 %IW1")],
                0,
                "\"b\" is sent there, too; give each signal bits of its own",
            ),
            (
                2,
                &[("a", "slot 1 %IW0"), ("b", "slot 1 %IW0")],
                1,
                "\"a\" is sent there, too; give each signal bits of its own",
            ),
            (
                3,
                &[("b", "slot 1 %IW2")],
                0,
                "\"far\" has no place in a module, and its address %IW6 lies beyond the 6 bytes of them all; give it a \
                 line in [fieldbus.at], too",
            ),
        ] {
            let (at, mistake) = layout(&signals[..count], lines, Area::Input).expect_err(words);
            assert_eq!((at, mistake.to_string().as_str()), (line, words));
        }
        let sizes = Configuration::of_sizes(4, 4);
        let address = "%IW0".parse().expect("an address");
        let why = bits(1, address, &sizes).expect_err("any modules");
        let why = why.to_string();
        assert!(why.contains("write \"config\""), "{why}");
    }

    #[test]
    fn signals_that_are_received_may_share_bits() {
        let signals = [
            signal("a", "%QW0", DataType::Int),
            signal("b", "%QX2.0", DataType::Bool),
        ];
        let lines = [("a", "slot 2 %QW0"), ("b", "slot 2 %QX1.0")];
        let layout = layout(&signals, &lines, Area::Output).expect("right");
        let mut frame = [0; 3];
        assert_eq!(
            layout.receive(&[0x12, 0x35, 0], &mut frame),
            [0x12, 0x35, 1]
        );
    }

    #[test]
    fn a_frame_without_places_is_taken_out_of_a_telegram_too() {
        let mut frame = [0; 2];
        Layout::default().take(&[1, 2, 3], &mut frame);
        assert_eq!(frame, [1, 2]);
    }

    #[test]
    fn other_text_and_another_width_are_no_place() {
        for text in [
            "2.IW0",
            "slot two %IW0",
            "slot 2",
            "slot 2 IW0",
            "%IW0",
            "slot 2 record 256 %IW0",
            "slot 2 record %IW0",
            "parameter 0",
            "parameter 65536",
            "parameter 945[117]",
            "parameter 945[0",
            "parameter 945 %IW0",
        ] {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
        let place: Place = " slot 12  %QX3.5".parse().expect("a place");
        assert_eq!(place.to_string(), "slot 12 %QX3.5");
        for text in [
            "slot 0 record 254 %IW0",
            "parameter 1121",
            "parameter 945[116]",
        ] {
            let place: Place = text.parse().expect("a place");
            assert_eq!(place.to_string(), text);
            let of_8_bytes = place.suits(&signal("a", "%IL0", DataType::Lreal));
            assert!(of_8_bytes.is_err());
        }
        assert!(place.suits(&signal("a", "%QX0.0", DataType::Bool)).is_ok());
        let why = place
            .suits(&signal("a", "%QW0", DataType::Int))
            .expect_err("a word")
            .to_string();
        assert_eq!(
            why,
            "\"a\" is at %QW0, and its place in the module is %QX3.5; give both the same letters"
        );
    }
}
