//! The report of an injected fault, as blocks of the extended diagnosis.

use tickbus_fieldbus::faults::{Diagnosis, Finding};

use crate::acyclic::Alarm;
use crate::configuration::Configuration;
use crate::station::Diagnosed;

/// The headers of the kinds of blocks, in the two upper bits.
const IDENTIFIER: u8 = 0x40;
const CHANNEL: u8 = 0x80;

/// The diagnosis that a station with these modules sends to its master.
pub(super) fn diagnosed<'a>(
    modules: &Configuration,
    all: impl Iterator<Item = &'a Diagnosis>,
) -> Diagnosed {
    let mut told = Diagnosed::default();
    let mut slots = Vec::new();
    let mut channels = Vec::new();
    for diagnosis in all {
        told.is_static |= diagnosis.is_static;
        match &diagnosis.finding {
            Finding::Device(octets) => told.blocks.push(with_header(0, octets.get())),
            Finding::Module(slot) => {
                let at = usize::from(slot - 1);
                slots.resize(slots.len().max(at / 8 + 1), 0);
                slots[at / 8] |= 1 << (at % 8);
            }
            Finding::Alarm { kind, slot, octets } => told.alarms.push(Alarm {
                kind: *kind,
                slot: *slot,
                data: octets.map_or_else(Vec::new, |octets| octets.get().to_vec()),
            }),
            Finding::Channel {
                slot,
                channel,
                error,
            } => {
                let (direction, unit) = modules.channel_kind(usize::from(*slot));
                channels.push(vec![
                    CHANNEL | (slot - 1),
                    direction << 6 | channel,
                    unit << 5 | *error as u8,
                ]);
            }
        }
    }
    if !slots.is_empty() {
        told.blocks.push(with_header(IDENTIFIER, &slots));
    }
    told.blocks.extend(channels);
    told
}

/// A block whose first octet holds its kind and length.
fn with_header(kind: u8, octets: &[u8]) -> Vec<u8> {
    let length = u8::try_from(octets.len() + 1).expect("a fault has few octets");
    let mut block = vec![kind | length];
    block.extend_from_slice(octets);
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_fieldbus::faults::{AlarmKind, ChannelError, Octets};

    #[test]
    fn findings_become_the_blocks_of_the_standard() {
        let modules = Configuration::of_bytes(&[0x13, 0x60, 0x71]).expect("whole");
        let finding = |finding| Diagnosis {
            station: 0,
            finding,
            is_static: false,
        };
        let channel = |slot, channel, error| {
            finding(Finding::Channel {
                slot,
                channel,
                error,
            })
        };
        let all = [
            channel(1, 5, ChannelError::LineBreak),
            finding(Finding::Module(3)),
            channel(2, 0, ChannelError::ShortCircuit),
            finding(Finding::Device(Octets::new(&[0x11, 0x22]).expect("two"))),
            Diagnosis {
                is_static: true,
                ..finding(Finding::Module(10))
            },
            channel(3, 63, ChannelError::Error),
            finding(Finding::Alarm {
                kind: AlarmKind::Process,
                slot: 0,
                octets: Octets::new(&[0x33]),
            }),
            // A module that the station does not have.
            channel(4, 1, ChannelError::Error),
        ];
        let mut told = diagnosed(&modules, all.iter());
        let alarm = Alarm {
            kind: AlarmKind::Process,
            slot: 0,
            data: vec![0x33],
        };
        assert_eq!(std::mem::take(&mut told.alarms), [alarm]);
        let blocks: [&[u8]; 6] = [
            &[0x03, 0x11, 0x22],
            &[0x43, 0b0000_0100, 0b0000_0010],
            &[0x80, 0x45, 0x26],
            &[0x81, 0x80, 0xA1],
            &[0x82, 0xFF, 0xA9],
            &[0x83, 0xC1, 0x29],
        ];
        assert_eq!(told.blocks, blocks);
        assert!(told.is_static);
        assert_eq!(diagnosed(&modules, [].iter()), Diagnosed::default());
    }
}
