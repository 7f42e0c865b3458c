//! The positions of signals in the telegrams: at their image addresses, or where `[fieldbus.at]` puts them in a module.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{Address, Addressing, Area, Signal};

use crate::configuration::Configuration;

const EXAMPLE: &str = "write the slot and the address in its module, such as \"slot 2 %IW0\", or in one of its records, \
                       such as \"slot 2 record 10 %IW0\"";

/// A position in a module or a record, as in `[fieldbus.at]`: `slot 2 %IW0`, `slot 2 record 10 %IW0`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) slot: usize,
    /// The index of the record.
    pub(crate) record: Option<u8>,
    pub(crate) address: Address,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "slot {} ", self.slot)?;
        if let Some(record) = self.record {
            write!(f, "record {record} ")?;
        }
        self.address.fmt(f)
    }
}

impl FromStr for Place {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let parts = match words[..] {
            ["slot", slot, address] => slot.parse().ok().map(|slot| (slot, None, address)),
            ["slot", slot, "record", record, address] => {
                let numbers = slot.parse().ok().zip(record.parse().ok());
                numbers.map(|(slot, record)| (slot, Some(record), address))
            }
            _ => None,
        };
        let Some((slot, record, address)) = parts else {
            let what = format!("\"{}\" is no place in a module", shown(text));
            return Err(Mistake::new(what, EXAMPLE));
        };
        Ok(Self {
            slot,
            record,
            address: Address::parse(address, Addressing::Bytes)?,
        })
    }
}

impl Place {
    /// Checks that the position suits the signal; the module is checked elsewhere.
    pub(crate) fn suits(self, signal: &Signal) -> Result<(), Mistake> {
        let own = signal.address();
        if (self.address.area, self.address.width) == (own.area, own.width) {
            return Ok(());
        }
        Err(Mistake::new(
            format!(
                "\"{}\" is at {own}, and its place in the module is {}",
                shown(&signal.name),
                self.address
            ),
            "give both the same letters",
        ))
    }

    /// The position's bits among all those of the station.
    fn bits(self, modules: &Configuration) -> Result<Range<usize>, Mistake> {
        let count = modules.modules().len();
        let module = self
            .slot
            .checked_sub(1)
            .and_then(|slot| modules.modules().get(slot));
        let Some(module) = module.filter(|_| !modules.has_sizes_only()) else {
            let what = format!("the station has no slot {}", self.slot);
            return Err(Mistake::new(
                what,
                if modules.has_sizes_only() {
                    "write \"config\", which says what its modules are".to_owned()
                } else {
                    format!("its slots are 1 to {count}")
                },
            ));
        };
        let bytes = match self.address.area {
            Area::Input => &module.inputs,
            Area::Output => &module.outputs,
        };
        let own = self.address.bits();
        if own.end > 8 * bytes.len() {
            return Err(Mistake::new(
                format!(
                    "{} lies beyond the module in slot {}",
                    self.address, self.slot
                ),
                format!(
                    "the module has {} bytes of {}",
                    bytes.len(),
                    self.address.area
                ),
            ));
        }
        Ok(8 * bytes.start + own.start..8 * bytes.start + own.end)
    }
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
            // A signal in a record is in no telegram of the exchange.
            if place.is_some_and(|(place, _)| place.record.is_some()) {
                continue;
            }
            let wire = match place {
                Some((place, at)) => place.bits(modules).map_err(|mistake| (*at, mistake))?,
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
            copy(frame, own.image, wire, own.wire.start, own.wire.len());
        }
    }

    /// The frame of the image from a telegram; `frame` has its size and serves as a buffer.
    pub(crate) fn receive<'f>(&self, wire: &'f [u8], frame: &'f mut [u8]) -> &'f [u8] {
        let Some(moves) = &self.moves else {
            return &wire[..frame.len()];
        };
        frame.fill(0);
        for own in moves {
            copy(wire, own.wire.start, frame, own.image, own.wire.len());
        }
        frame
    }
}

/// Copies a signal: a bit, or whole bytes.
pub(crate) fn copy(from: &[u8], source: usize, to: &mut [u8], target: usize, bits: usize) {
    if bits == 1 {
        let bit = from[source / 8] >> (source % 8) & 1;
        let octet = &mut to[target / 8];
        *octet = *octet & !(1 << (target % 8)) | bit << (target % 8);
        return;
    }
    let (source, target, bytes) = (source / 8, target / 8, bits / 8);
    to[target..target + bytes].copy_from_slice(&from[source..source + bytes]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::DataType;

    fn signal(name: &str, address: &str, data_type: DataType) -> Signal {
        let address: Address = address.parse().expect("right");
        let mut signal = Signal::new(name, address.area, address.byte, data_type);
        signal.bit = address.bit;
        signal
    }

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
        let place: Place = "slot 1 %IW0".parse().expect("a place");
        let why = place.bits(&sizes).expect_err("any modules").to_string();
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
    fn other_text_and_another_width_are_no_place() {
        for text in ["2.IW0", "slot two %IW0", "slot 2", "slot 2 IW0", "%IW0"] {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
        let place: Place = " slot 12  %QX3.5".parse().expect("a place");
        assert_eq!(
            (place.slot, place.address.to_string().as_str()),
            (12, "%QX3.5")
        );
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
