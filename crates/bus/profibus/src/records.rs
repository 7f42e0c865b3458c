//! The signals in the records of a station, and records with fixed octets.

use std::collections::BTreeMap;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_fieldbus::copy_bits;
use tickbus_image::signal::{Area, Signal};

use crate::acyclic::{RECORD_LIMIT, Record};
use crate::layout::{Move, Place};

/// The index of the record that has the device's nameplate.
const NAMEPLATE: u8 = 255;

/// A record as in `records` of a station: `slot 2 record 10 = 00 64`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fixed(pub(crate) Record);

impl FromStr for Fixed {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let read = || {
            let (head, octets) = text.split_once('=')?;
            let words: Vec<&str> = head.split_ascii_whitespace().collect();
            let ["slot", slot, "record", index] = words[..] else {
                return None;
            };
            let octets = octets.split_ascii_whitespace();
            let octets = octets.map(|octet| {
                let is_hex = octet.len() == 2 && octet.bytes().all(|c| c.is_ascii_hexdigit());
                is_hex.then(|| u8::from_str_radix(octet, 16).ok()).flatten()
            });
            Some(Record {
                slot: slot.parse().ok()?,
                index: index.parse().ok()?,
                octets: octets.collect::<Option<_>>()?,
                is_writable: true,
            })
        };
        match read() {
            Some(record) if (1..=RECORD_LIMIT).contains(&record.octets.len()) => Ok(Self(record)),
            Some(record) => Err(Mistake::new(
                format!("the record has {} octets", record.octets.len()),
                format!("a record has 1 to {RECORD_LIMIT}"),
            )),
            None => Err(Mistake::new(
                format!("\"{}\" is no record", shown(text)),
                "write the slot, the index and the octets in hexadecimal, such as \"slot 2 record 10 = 00 64\"",
            )),
        }
    }
}

/// The positions of signals in a record.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RecordLayout {
    inputs: Vec<Move>,
    outputs: Vec<Move>,
    /// Outputs that are shown, and not written.
    shown: Vec<Move>,
}

impl RecordLayout {
    /// Adds a signal of this area.
    pub(crate) fn push(&mut self, area: Area, own: Move) {
        match area {
            Area::Input => self.inputs.push(own),
            Area::Output => self.outputs.push(own),
        }
    }

    /// Adds bits of the image that masters read, of either area.
    pub(crate) fn show(&mut self, area: Area, own: Move) {
        match area {
            Area::Input => self.inputs.push(own),
            Area::Output => self.shown.push(own),
        }
    }

    /// Copies the outputs that are shown from the frame of the image into the record.
    pub(crate) fn reflect(&self, frame: &[u8], octets: &mut [u8]) {
        for own in &self.shown {
            copy_bits(frame, own.image, own.wire.len(), octets, own.wire.start);
        }
    }

    /// Copies the inputs from the frame of the image into the record.
    pub(crate) fn fill(&self, frame: &[u8], octets: &mut [u8]) {
        for own in &self.inputs {
            copy_bits(frame, own.image, own.wire.len(), octets, own.wire.start);
        }
    }

    /// Copies the outputs from the record into the frame of the image.
    pub(crate) fn take(&self, octets: &[u8], frame: &mut [u8]) {
        for own in &self.outputs {
            copy_bits(octets, own.wire.start, own.wire.len(), frame, own.image);
        }
    }
}

/// The records of a station: the fixed ones, and those with signals, each with its offset in the driver.cfg. The slots
/// reach to `slots`, and a record has at most `room` octets.
///
/// # Errors
///
/// The device has no such slot, a record is too long, or two signals would share bits.
pub(crate) fn records<'s>(
    fixed: &[(Fixed, usize)],
    signals: impl Iterator<Item = &'s Signal>,
    places: &BTreeMap<String, (Place, usize)>,
    slots: u8,
    room: usize,
) -> Result<Vec<(Record, RecordLayout)>, (usize, Mistake)> {
    let mut all: Vec<(Record, RecordLayout)> = Vec::new();
    let check = |slot: usize, index: u8, octets: usize| {
        if slot > usize::from(slots) {
            let right = format!("its slots are 0, the device itself, to {slots}");
            return Err(Mistake::new(
                format!("the station has no slot {slot}"),
                right,
            ));
        }
        if index == NAMEPLATE {
            return Err(Mistake::new(
                "record 255 is the device's nameplate",
                "give the record an index from 0 to 254",
            ));
        }
        if octets > room {
            return Err(Mistake::new(
                format!("the record would have {octets} octets"),
                format!("a record of this device has at most {room}"),
            ));
        }
        Ok(())
    };
    for (Fixed(record), at) in fixed {
        check(record.slot.into(), record.index, record.octets.len())
            .map_err(|mistake| (*at, mistake))?;
        if all
            .iter()
            .any(|(other, _)| (other.slot, other.index) == (record.slot, record.index))
        {
            let what = format!("slot {} has record {} twice", record.slot, record.index);
            return Err((*at, Mistake::new(what, "remove one of the two")));
        }
        all.push((record.clone(), RecordLayout::default()));
    }
    // The name of each signal so far, with its record and its bits.
    let mut taken: Vec<(&str, usize, Move)> = Vec::new();
    for signal in signals {
        let Some((
            Place::Record {
                slot,
                index,
                address,
            },
            at,
        )) = places.get(&signal.name)
        else {
            continue;
        };
        let (slot, index, at) = (*slot, *index, *at);
        let wire = address.bits();
        let length = wire.end.div_ceil(8);
        check(slot, index, length).map_err(|mistake| (at, mistake))?;
        let slot = u8::try_from(slot).expect("checked");
        let same = |(own, _): &(Record, RecordLayout)| (own.slot, own.index) == (slot, index);
        let number = all.iter().position(same).unwrap_or_else(|| {
            let record = Record {
                slot,
                index,
                ..Record::default()
            };
            all.push((record, RecordLayout::default()));
            all.len() - 1
        });
        let own = Move {
            image: signal.address().bits().start,
            wire,
        };
        let twin = taken.iter().find(|(_, other, bits)| {
            *other == number && bits.wire.start < own.wire.end && own.wire.start < bits.wire.end
        });
        if let Some((twin, ..)) = twin {
            let what = format!("\"{}\" is in the same bits of the record", shown(twin));
            return Err((at, Mistake::new(what, "give each signal bits of its own")));
        }
        taken.push((&signal.name, number, own.clone()));
        let (record, layout) = &mut all[number];
        record.octets.resize(record.octets.len().max(length), 0);
        record.is_writable |= signal.area == Area::Output;
        layout.push(signal.area, own);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::signal;
    use tickbus_image::signal::DataType;

    fn fixed(text: &str) -> (Fixed, usize) {
        (text.parse().expect("a record"), 7)
    }

    fn read(
        own: &[(Fixed, usize)],
        signals: &[Signal],
        places: &[&str],
    ) -> Result<Vec<(Record, RecordLayout)>, (usize, Mistake)> {
        let places = signals.iter().zip(places).enumerate();
        let places = places.map(|(at, (signal, place))| {
            (signal.name.clone(), (place.parse().expect("a place"), at))
        });
        records(own, signals.iter(), &places.collect(), 2, 4)
    }

    #[test]
    fn signals_share_records_with_each_other_and_with_fixed_octets() {
        let signals = [
            signal("ramp", "%QW4", DataType::Int),
            signal("on", "%QX6.1", DataType::Bool),
            signal("warm", "%IX2.0", DataType::Bool),
            signal("warmth", "%IW0", DataType::Int),
        ];
        let places = [
            "slot 1 record 10 %QW0",
            "slot 1 record 10 %QX2.7",
            "slot 1 record 10 %IX2.0",
            "slot 2 record 10 %IW0",
        ];
        let own = [
            fixed("slot 1 record 10 = 00 64 FF AA"),
            fixed("slot 0 record 0 = 01"),
        ];
        let all = read(&own, &signals, &places).expect("right");
        let [(first, layout), (second, _), (third, inputs)] = &all[..] else {
            panic!("{all:?}");
        };
        assert_eq!((first.octets.len(), first.is_writable), (4, true));
        assert_eq!((&second.octets[..], second.is_writable), (&[1][..], true));
        assert_eq!((&third.octets[..], third.is_writable), (&[0, 0][..], false));
        let mut octets = first.octets.clone();
        layout.fill(&[0, 0, 0], &mut octets);
        assert_eq!(octets, [0, 0x64, 0xFE, 0xAA], "the bit of the input");
        let mut frame = [0xFF; 7];
        layout.take(&[1, 2, 0x80, 0], &mut frame);
        assert_eq!(frame, [0xFF, 0xFF, 0xFF, 0xFF, 1, 2, 0xFF]);
        layout.take(&[1, 2, 0x7F, 0], &mut frame);
        assert_eq!(frame[6], 0xFD);
        let mut octets = third.octets.clone();
        inputs.fill(&[5, 6], &mut octets);
        assert_eq!(octets, [5, 6]);
    }

    #[test]
    fn mistakes_are_told_at_their_place() {
        let signals = [
            signal("ramp", "%QW4", DataType::Int),
            signal("warmth", "%IW0", DataType::Int),
        ];
        let first = "slot 1 record 10 %QW0";
        for (place, what) in [
            (
                "slot 1 record 10 %IW1",
                "\"ramp\" is in the same bits of the record",
            ),
            ("slot 3 record 10 %IW0", "the station has no slot 3"),
            ("slot 300 record 10 %IW0", "the station has no slot 300"),
            (
                "slot 1 record 255 %IW0",
                "record 255 is the device's nameplate",
            ),
            ("slot 1 record 11 %IW3", "the record would have 5 octets"),
        ] {
            let (at, mistake) = read(&[], &signals, &[first, place]).expect_err(place);
            assert_eq!((at, &*mistake.what), (1, what));
        }
        for (texts, what) in [
            (&["slot 3 record 1 = 01"][..], "the station has no slot 3"),
            (
                &["slot 1 record 1 = 01", "slot 1 record 1 = 02"],
                "slot 1 has record 1 twice",
            ),
            (
                &["slot 1 record 1 = 01 02 03 04 05"],
                "the record would have 5 octets",
            ),
        ] {
            let own: Vec<_> = texts.iter().map(|text| fixed(text)).collect();
            let (at, mistake) = read(&own, &[], &[]).expect_err("wrong");
            assert_eq!((at, &*mistake.what), (7, what));
        }
        for text in [
            "",
            "slot 1 record 1",
            "slot 1 record 1 =",
            "slot 1 record 256 = 01",
            "slot 1 record 1 = 1",
            "slot 1 record 1 = +1",
            "slot 1 record 1 = 01,02",
            "record 1 slot 1 = 01",
        ] {
            assert!(text.parse::<Fixed>().is_err(), "{text}");
        }
    }
}
