//! Alarms in the diagnosis of a station, and their acknowledgement.

use tickbus_fieldbus::faults::AlarmKind;

use super::records::{exchanging_with, with_records};
use super::*;
use crate::{Alarm, AlarmSupport};

fn with_alarms() -> Identity {
    let mut identity = with_records(true);
    identity.acyclic.alarms = AlarmSupport::ALL;
    identity
}

fn raise(rig: &mut Rig, blocks: &[&[u8]], alarms: &[(AlarmKind, u8)]) {
    let alarms = alarms.iter().map(|(kind, slot)| Alarm {
        kind: *kind,
        slot: *slot,
        data: vec![0x11, 0x22],
    });
    rig.station.diagnose(&Diagnosed {
        blocks: blocks.iter().map(|block| block.to_vec()).collect(),
        is_static: false,
        alarms: alarms.collect(),
    });
}

/// A request at an access point of the owner, and the answer that it fetches.
fn acyclic(rig: &mut Rig, sap: u8, request: &[u8]) -> Came {
    let control = rig.toggle();
    assert_eq!(rig.from(51, Some(sap), control, request), Came::Short);
    let control = rig.toggle();
    rig.from(51, Some(sap), control, &[])
}

const HIGH: u8 = 0x0A;
const LOW: u8 = 0x08;

#[test]
fn an_alarm_is_announced_read_once_and_acknowledged_before_the_next_of_its_type() {
    let mut rig = exchanging_with(with_alarms(), [0x80, 0xE0, 0]);
    assert_eq!(rig.exchange(&[1, 2]), data(&[0, 0]));
    raise(
        &mut rig,
        &[],
        &[(AlarmKind::Process, 1), (AlarmKind::Process, 2)],
    );
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(HIGH, vec![0, 0]));
    // No error: Ext_Diag is off.
    let head = [0, 0x04, 0, MASTER, 0x80, 0xE0];
    let alarm = [&head[..], &[6, 2, 1, 0, 0x11, 0x22]].concat();
    assert_eq!(rig.diagnosis(), alarm);
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(LOW, vec![0, 0]));
    assert_eq!(rig.diagnosis(), head, "the other one waits");
    for (request, code) in [
        (&[0x5C, 2, 2, 0][..], 0xB5),
        (&[0x5C, 1, 1, 0], 0xB5),
        (&[0x5C, 1, 2], 0xB3),
    ] {
        let answer = data(&[0xDC, 128, code, 0]);
        assert_eq!(acyclic(&mut rig, 51, request), answer, "{request:02X?}");
    }
    assert_eq!(
        acyclic(&mut rig, 51, &[0x5C, 1, 2, 0]),
        data(&[0x5C, 1, 2, 0])
    );
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(HIGH, vec![0, 0]));
    assert_eq!(rig.diagnosis()[6..], [6, 2, 2, 0, 0x11, 0x22]);
    // The other access point, which has no records.
    let refused = data(&[0xDE, 128, 0xA9, 0]);
    assert_eq!(acyclic(&mut rig, 50, &[0x5E, 1, 10, 9]), refused);
    assert_eq!(
        acyclic(&mut rig, 50, &[0x5C, 2, 2, 0]),
        data(&[0x5C, 2, 2, 0])
    );
    let again = data(&[0xDC, 128, 0xB5, 0]);
    assert_eq!(acyclic(&mut rig, 50, &[0x5C, 2, 2, 0]), again);
}

#[test]
fn a_diagnosis_alarm_is_an_error_beside_other_blocks_and_leaves_with_it() {
    let identity = Identity {
        max_diagnosis: 14,
        ..with_alarms()
    };
    let mut rig = exchanging_with(identity, [0x80, 0x20, 7]);
    let block: &[u8] = &[0x03, 0x99, 0x98];
    raise(&mut rig, &[block], &[(AlarmKind::Diagnosis, 3)]);
    let told = rig.diagnosis();
    assert_eq!((told[0], told[2]), (0x08, 0x80), "no room for both");
    assert_eq!(told[6..], [6, 1, 3, 1, 0x11, 0x22]);
    let told = rig.diagnosis();
    assert_eq!((told[0], told[2], &told[6..]), (0x08, 0, block));
    raise(&mut rig, &[], &[]);
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(HIGH, vec![0, 0]));
    let told = rig.diagnosis();
    assert_eq!(
        (told[0], &told[6..]),
        (0, &[6, 1, 3, 2 | 1 << 3, 0x11, 0x22][..])
    );
}

#[test]
fn alarms_wait_for_the_exchange_and_are_gone_with_the_master_or_without_its_consent() {
    let mut rig = Rig::new(with_alarms());
    raise(&mut rig, &[], &[(AlarmKind::Process, 1)]);
    rig.ask(61, &[LOCK, 0, 0, 11, 0x80, 0xE0, 0, 0x80, 0x40, 0]);
    assert_eq!(rig.diagnosis().len(), 6);
    assert_eq!(rig.from(51, Some(50), 0x5D, &[0x5C, 1, 2, 0]), refused());
    rig.ask(62, &[0x50, 0x60]);
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(HIGH, vec![0, 0]));
    assert_eq!(rig.diagnosis().len(), 12);
    // The master leaves without an acknowledgement, and comes back.
    rig.parameterise(0x40, 0);
    rig.ask(61, &[LOCK, 0, 0, 11, 0x80, 0xE0, 0, 0x80, 0x40, 0]);
    rig.ask(62, &[0x50, 0x60]);
    let answer = data(&[0xDC, 128, 0xB5, 0]);
    assert_eq!(acyclic(&mut rig, 51, &[0x5C, 1, 2, 0]), answer);
    // A type that it has not enabled.
    raise(&mut rig, &[], &[(AlarmKind::Diagnosis, 4)]);
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(LOW, vec![0, 0]));
    let (kind, slot) = (AlarmKind::Diagnosis, 4);
    assert_eq!(
        rig.machine.events.last(),
        Some(&Event::AlarmDropped { kind, slot })
    );
}
