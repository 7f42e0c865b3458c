//! Records, at the service access points of a station.

use super::*;

/// A device with a record in slot 1, which is read at the access point of the owner.
pub(super) fn with_records(dpv1: bool) -> Identity {
    Identity {
        dpv1,
        acyclic: Acyclic {
            class_1: true,
            connections: 1,
            send_timeout: 100,
            records: vec![crate::Record {
                slot: 1,
                index: 10,
                octets: vec![7],
                is_writable: true,
            }],
            ..Acyclic::default()
        },
        ..identity()
    }
}

/// Data exchange after parameters that begin with these octets of DPV1.
pub(super) fn exchanging_with(identity: Identity, [first, second, third]: [u8; 3]) -> Rig {
    let mut rig = Rig::new(identity);
    let parameters = [LOCK, 0, 0, 11, 0x80, 0xE0, 0, first, second, third];
    assert_eq!(rig.ask(61, &parameters), Came::Short);
    assert_eq!(rig.ask(62, &[0x50, 0x60]), Came::Short);
    rig
}

const READ: [u8; 4] = [0x5E, 1, 10, 240];

#[test]
fn the_owner_reads_records_if_its_parameters_enable_that_and_while_it_exchanges_data() {
    for (dpv1, status) in [(true, 0), (false, 0x80)] {
        let mut rig = exchanging_with(with_records(dpv1), [status, 0, 0]);
        assert_eq!(rig.from(51, Some(51), 0x5D, &READ), refused());
    }
    let mut rig = exchanging_with(with_records(true), [0x80, 0, 0]);
    assert_eq!(rig.from(51, Some(51), 0x5D, &READ), Came::Short);
    let answer = data(&[0x5E, 1, 10, 1, 7]);
    assert_eq!(rig.from(51, Some(51), 0x7D, &[]), answer);
    assert_eq!(rig.from(51, Some(51), 0x7D, &[]), answer, "repeated");
    assert_eq!(rig.from(51, Some(51), 0x5D, &[]), Came::Short, "fetched");
    rig.from(51, Some(51), 0x7D, &[0x5E, 1, 9, 1]);
    let [.., told] = &rig.machine.events[..] else {
        panic!("no event");
    };
    let (master, writes) = (MASTER, false);
    let (slot, index, why) = (1, 9, crate::Refusal::Index);
    let refusal = Event::RecordRefused {
        master,
        writes,
        slot,
        index,
        why,
    };
    assert_eq!(*told, refusal);
    // Another master, and the owner after it has released the station.
    rig.master = 3;
    assert_eq!(rig.from(51, Some(51), 0x5D, &READ), refused());
    rig.master = MASTER;
    rig.parameterise(0x40, 0);
    assert_eq!(rig.from(51, Some(51), 0x5D, &READ), refused());
}

#[test]
fn another_master_reads_records_by_a_connection_of_its_own_which_ends_with_time() {
    let mut rig = Rig::new(with_records(false));
    let mut initiate = [0; 20];
    (initiate[0], initiate[13], initiate[15]) = (0x57, 2, 2);
    let offer = data(&[0x56, 48, 0, 100]);
    assert_eq!(rig.from(50, Some(49), 0x5D, &initiate), offer);
    assert!(matches!(
        rig.from(50, Some(48), 0x7D, &[]),
        Came::Data(8, _)
    ));
    assert_eq!(rig.from(50, Some(48), 0x5D, &READ), Came::Short);
    let answer = data(&[0x5E, 1, 10, 1, 7]);
    assert_eq!(rig.from(50, Some(48), 0x7D, &[]), answer);
    rig.master = 3;
    let no_resource = Came::Data(0x02, Vec::new());
    assert_eq!(rig.from(50, Some(49), 0x5D, &initiate), no_resource);
    assert_eq!(rig.station.deadline(), Nanos::from_secs(2));
    rig.now = Nanos::from_secs(3);
    rig.master = MASTER;
    let ended = data(&[0x58, 0, 0x13]);
    assert_eq!(rig.from(50, Some(48), 0x5D, &[]), ended);
    assert_eq!(rig.from(50, Some(48), 0x7D, &[]), refused());
    assert_eq!(rig.station.deadline(), Nanos::MAX);
}
