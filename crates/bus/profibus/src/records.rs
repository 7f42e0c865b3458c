//! The signals in the records of a station, and records with fixed octets.

use std::collections::BTreeMap;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{Area, Signal};

use crate::acyclic::{RECORD_LIMIT, Record};
use crate::layout::{Move, Place, copy};

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
            let octets = octets.map(|octet| match octet.len() {
                2 => u8::from_str_radix(octet, 16).ok(),
                _ => None,
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
}

impl RecordLayout {
    /// Copies the inputs from the frame of the image into the record.
    pub(crate) fn fill(&self, frame: &[u8], octets: &mut [u8]) {
        for own in &self.inputs {
            copy(frame, own.image, octets, own.wire.start, own.wire.len());
        }
    }

    /// Copies the outputs from the record into the frame of the image.
    pub(crate) fn take(&self, octets: &[u8], frame: &mut [u8]) {
        for own in &self.outputs {
            copy(octets, own.wire.start, frame, own.image, own.wire.len());
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
        let Some((place, index, at)) = places.get(&signal.name).and_then(|(place, at)| {
            let index = place.record?;
            Some((place, index, *at))
        }) else {
            continue;
        };
        let wire = place.address.bits();
        let length = wire.end.div_ceil(8);
        check(place.slot, index, length).map_err(|mistake| (at, mistake))?;
        let slot = u8::try_from(place.slot).expect("checked");
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
        if signal.area == Area::Input {
            layout.inputs.push(own);
        } else {
            record.is_writable = true;
            layout.outputs.push(own);
        }
    }
    Ok(all)
}
