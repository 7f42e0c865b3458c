use super::*;
use tickbus_base::time::Nanos;

/// The octets of a record that a machine provides, and what it was told.
#[derive(Default)]
struct Kept {
    first: u8,
    written: Vec<(usize, Vec<u8>)>,
    refused: Vec<(bool, u8, u8, Refusal)>,
}

impl Machine for Kept {
    fn read(&mut self, _record: usize, octets: &mut [u8]) {
        octets[0] = self.first;
    }

    fn written(&mut self, record: usize, octets: &[u8]) {
        self.written.push((record, octets.to_vec()));
    }

    fn refused(&mut self, writes: bool, slot: u8, index: u8, why: Refusal) {
        self.refused.push((writes, slot, index, why));
    }
}

const MASTER: Peer = Peer {
    address: 2,
    sap: Some(50),
};

const OTHER: Peer = Peer {
    address: 3,
    sap: Some(50),
};

/// The example of a maker's manual (Balluff BTL7-T500, tables 4-15 to 4-18), with the additional addresses that the
/// tables leave out.
const INITIATE: [u8; 20] = [
    0x57, 0, 0, 0, 0, 100, 0x01, 0, 0, 0, 0x03, 0x03, 0, 2, 0, 2, 7, 8, 0, 0,
];

fn server() -> Server {
    let record = |slot, index, octets: &[u8], is_writable| Record {
        slot,
        index,
        octets: octets.to_vec(),
        is_writable,
    };
    let own = Acyclic {
        class_1: true,
        connections: 2,
        send_timeout: 400,
        records: vec![
            record(0, 16, &[0, 1, 2], false),
            record(2, 10, &[0, 100], true),
        ],
        nameplate: Nameplate {
            manufacturer: 42,
            order: "Förderer".to_owned(),
            serial: "12345678901234567890".to_owned(),
        },
        ..Acyclic::default()
    };
    let mut server = Server::new(&own, 2);
    server.reset(true);
    server
}

/// The owner's request, and the answer that it fetches.
fn ask(server: &mut Server, machine: &mut Kept, request: &[u8]) -> Vec<u8> {
    assert_eq!(server.class_1(request, machine), Reply::Nothing);
    let Reply::Data(answer) = server.class_1(&[], machine) else {
        panic!("no answer to {request:02X?}");
    };
    assert_eq!(server.class_1(&[], machine), Reply::Nothing, "only once");
    answer
}

#[test]
fn the_owner_reads_and_writes_records() {
    let (mut server, mut machine) = (server(), Kept::default());
    machine.first = 9;
    for (request, answer) in [
        // As much as the request has room for.
        (&[0x5E, 0, 16, 240][..], &[0x5E, 0, 16, 3, 9, 1, 2][..]),
        (&[0x5E, 0, 16, 2], &[0x5E, 0, 16, 2, 9, 1]),
        (&[0x5F, 2, 10, 2, 3, 4], &[0x5F, 2, 10, 2]),
        (&[0x5E, 2, 10, 240], &[0x5E, 2, 10, 2, 9, 4]),
    ] {
        assert_eq!(ask(&mut server, &mut machine, request), answer);
    }
    assert_eq!(machine.written, [(1, vec![3, 4])]);
    assert_eq!(machine.refused, []);
}

#[test]
fn wrong_requests_are_refused_with_the_codes_of_the_standard() {
    let (mut server, mut machine) = (server(), Kept::default());
    for (request, code) in [
        (&[0x5E, 2, 11, 240][..], 0xB0),
        (&[0x5E, 3, 10, 240], 0xB2),
        (&[0x5E, 2, 10, 0], 0xB3),
        (&[0x5E, 2, 10], 0xB3),
        (&[0x5E, 2, 10, 1, 1], 0xB3),
        (&[0x5E, 0, 255, 68], 0xB5),
        (&[0x5F, 2, 11, 1, 1], 0xB0),
        (&[0x5F, 0, 16, 3, 1, 2, 3], 0xB6),
        (&[0x5F, 2, 10, 1, 1], 0xB1),
        (&[0x5F, 2, 10, 2, 1], 0xB1),
        (&[0x5F, 2, 10, 3, 1, 2, 3], 0xB1),
        (&[0x5F, 2, 10, 0], 0xB3),
        (&[0x5F, 0, 255, 4, 8, 0, 0, 1], 0xB0),
        (&[0x5F, 0, 255, 4, 9, 0, 0xFD, 0xE8], 0xA9),
        (&[0x51, 0, 1, 1, 1], 0xA9),
        (&[0x00], 0xA9),
    ] {
        let answer = ask(&mut server, &mut machine, request);
        assert_eq!(answer, [request[0] | 0x80, 128, code, 0], "{request:02X?}");
    }
    assert_eq!(machine.written, []);
    assert_eq!(machine.refused.len(), 14, "those for records");
    assert_eq!(machine.refused[0], (false, 2, 11, Refusal::Index));
}

/// Record 47 holds an answer after a request, once, for the master that sent it.
#[test]
fn the_parameters_of_a_drive_are_read_by_two_requests() {
    let own = Acyclic {
        class_1: true,
        parameters: vec![Parameter {
            number: 1121,
            format: Format::Unsigned16,
            is_array: false,
            octets: vec![0, 5],
            is_writable: false,
        }],
        ..Acyclic::default()
    };
    let mut server = Server::new(&own, 2);
    server.reset(true);
    let mut machine = Kept::default();
    let request = [0x5F, 1, 47, 10, 9, 1, 0, 1, 0x10, 1, 0x04, 0x61, 0, 0];
    let answer = [0x5E, 1, 47, 8, 9, 1, 0, 1, 6, 1, 0, 5];
    let none = [0xDE, 128, 0xB5, 0];
    let fetch = [0x5E, 1, 47, 240];
    assert_eq!(ask(&mut server, &mut machine, &fetch), none);
    assert_eq!(ask(&mut server, &mut machine, &request), request[..4]);
    assert_eq!(ask(&mut server, &mut machine, &fetch), answer);
    assert_eq!(ask(&mut server, &mut machine, &fetch), none);
    let wrong = [0x5F, 1, 47, 4, 9, 1, 0, 0];
    let refused = ask(&mut server, &mut machine, &wrong);
    assert_eq!(refused, [0xDF, 128, 0xB7, 0]);
    let slot = ask(&mut server, &mut machine, &[0x5E, 3, 47, 240]);
    assert_eq!(slot, [0xDE, 128, 0xB2, 0]);
}

#[test]
fn the_connection_of_the_owner_is_open_while_its_parameters_say_so() {
    let (mut server, mut machine) = (server(), Kept::default());
    server.class_1(&[0x5E, 2, 10, 240], &mut machine);
    server.reset(true);
    assert_eq!(server.class_1(&[], &mut machine), Reply::Nothing);
    // The answer to the last of two requests.
    server.class_1(&[0x5E, 2, 10, 240], &mut machine);
    server.class_1(&[0x5E, 0, 16, 1], &mut machine);
    let last = Reply::Data(vec![0x5E, 0, 16, 1, 0]);
    assert_eq!(server.class_1(&[], &mut machine), last);
    server.reset(false);
    assert_eq!(server.class_1(&[], &mut machine), Reply::Closed);
    let mut none = Server::new(&Acyclic::default(), 2);
    none.reset(true);
    assert_eq!(none.class_1(&[], &mut machine), Reply::Closed);
    assert_eq!(none.open(Nanos(0), MASTER, &INITIATE), Reply::Closed);
}

#[test]
fn the_nameplate_is_read_in_each_slot_after_a_call_and_the_notes_are_written() {
    let (mut server, mut machine) = (server(), Kept::default());
    let call = [0x5F, 1, 255, 4, 0x08, 0, 0xFD, 0xE8];
    assert_eq!(ask(&mut server, &mut machine, &call), call[..4]);
    let answer = ask(&mut server, &mut machine, &[0x5E, 1, 255, 68]);
    assert_eq!(answer.len(), 4 + 68);
    assert_eq!(answer[..8], [0x5E, 1, 255, 68, 0x08, 0, 0xFD, 0xE8]);
    let nameplate = &answer[8..];
    assert_eq!(nameplate[10..12], [0, 42], "MANUFACTURER_ID");
    assert_eq!(&nameplate[12..32], b"F?rderer            ");
    assert_eq!(&nameplate[32..48], b"1234567890123456");
    assert_eq!(nameplate[48..54], [0, 1, b'V', 1, 0, 0]);
    assert_eq!(nameplate[56..58], [0xF6, 0x00], "PROFILE_ID");
    assert_eq!(nameplate[60..], [1, 1, 0, 0b1110]);
    // Another slot, or a call that was refused: nothing to read.
    let other = ask(&mut server, &mut machine, &[0x5E, 2, 255, 68]);
    assert_eq!(other, [0xDE, 128, 0xB5, 0]);
    let wrong = [0x5F, 1, 255, 4, 0x08, 0, 0xFD, 0xEC];
    assert_eq!(ask(&mut server, &mut machine, &wrong), [0xDF, 128, 0xB0, 0]);
    let after = ask(&mut server, &mut machine, &[0x5E, 1, 255, 68]);
    assert_eq!(after, [0xDE, 128, 0xB5, 0]);
    // The place in the plant.
    let mut write = vec![0x5F, 0, 255, 68, 0x08, 0, 0xFD, 0xE9];
    write.extend([0; 10]);
    write.extend([b'x'; 54]);
    assert_eq!(ask(&mut server, &mut machine, &write), write[..4]);
    let read = ask(&mut server, &mut machine, &[0x5E, 0, 255, 68]);
    assert_eq!(read[4..], write[4..]);
    // The nameplate itself cannot be written, and a note has its length.
    write[7] = 0xE8;
    assert_eq!(ask(&mut server, &mut machine, &write), [0xDF, 128, 0xB6, 0]);
    let short = [0x5F, 0, 255, 5, 0x08, 0, 0xFD, 0xE9, 1];
    assert_eq!(ask(&mut server, &mut machine, &short), [0xDF, 128, 0xB1, 0]);
}

/// A connection, with the access point that it has got.
fn open(server: &mut Server, now: Nanos, peer: Peer) -> u8 {
    let Reply::Data(offer) = server.open(now, peer, &INITIATE) else {
        panic!("no offer");
    };
    let [0x56, sap, 0x01, 0x90] = offer[..] else {
        panic!("{offer:02X?}");
    };
    let answer = server.class_2(now, peer, sap, &[], &mut Kept::default());
    let accepted = vec![0x57, 240, 0x01, 0, 0, 0, 0x03, 0x03, 0, 2, 0, 2, 0, 0, 7, 8];
    assert_eq!(answer, Reply::Data(accepted));
    sap
}

#[test]
fn any_master_opens_a_connection_uses_it_and_closes_it() {
    let (mut server, mut machine) = (server(), Kept::default());
    server.reset(false);
    let now = Nanos(0);
    let offer = Reply::Data(vec![0x56, 48, 0x01, 0x90]);
    assert_eq!(server.open(now, MASTER, &[]), offer, "only asked");
    assert_eq!(
        server.class_2(now, MASTER, 48, &[], &mut machine),
        Reply::Closed
    );
    let sap = open(&mut server, now, MASTER);
    assert_eq!(sap, 48);
    let mut ask = |request: &[u8]| {
        assert_eq!(
            server.class_2(now, MASTER, sap, request, &mut machine),
            Reply::Nothing
        );
        server.class_2(now, MASTER, sap, &[], &mut machine)
    };
    for (request, answer) in [
        (&[0x5E, 2, 10, 240][..], &[0x5E, 2, 10, 2, 0, 100][..]),
        (&[0x5F, 2, 10, 2, 0, 7], &[0x5F, 2, 10, 2]),
        (&[0x5E, 2, 10, 240], &[0x5E, 2, 10, 2, 0, 7]),
        (&[0x5E, 9, 10, 240], &[0xDE, 128, 0xB2, 0]),
        (&[0x51, 0, 1, 1, 1], &[0xD1, 128, 0xA9, 0]),
        (&[0x48], &[0x48]),
    ] {
        assert_eq!(ask(request), Reply::Data(answer.to_vec()));
    }
    // Of another master, or at another access point.
    for (peer, sap) in [(OTHER, 48), (MASTER, 47), (MASTER, 40), (MASTER, 0)] {
        let answer = server.class_2(now, peer, sap, &[0x48], &mut machine);
        assert_eq!(answer, Reply::Closed);
    }
    let abort = server.class_2(now, MASTER, sap, &[0x58, 0, 0x20], &mut machine);
    assert_eq!(abort, Reply::Nothing);
    let after = server.class_2(now, MASTER, sap, &[], &mut machine);
    assert_eq!(after, Reply::Closed);
    assert_eq!(server.deadline(), Nanos::MAX);
}

#[test]
fn there_are_as_many_connections_as_the_device_has() {
    let mut server = server();
    let now = Nanos(0);
    assert_eq!(open(&mut server, now, MASTER), 48);
    assert_eq!(open(&mut server, now, OTHER), 47);
    assert_eq!(server.open(now, MASTER, &INITIATE), Reply::Full);
    let abort = [0x58, 0, 0x20];
    server.class_2(now, MASTER, 48, &abort, &mut Kept::default());
    assert_eq!(open(&mut server, now, OTHER), 48);
}

#[test]
fn a_silent_master_loses_its_connection() {
    let (mut server, mut machine) = (server(), Kept::default());
    // The longer of both ends: 4 s.
    open(&mut server, Nanos(0), MASTER);
    assert_eq!(server.deadline(), Nanos::from_secs(8));
    server.turn(Nanos::from_millis(7_999));
    let asked = Nanos::from_secs(8) - Nanos(1);
    assert_eq!(
        server.class_2(asked, MASTER, 48, &[0x48], &mut machine),
        Reply::Nothing
    );
    // The answer to the idle request is not fetched.
    let late = asked + Nanos::from_secs(4);
    assert_eq!(server.deadline(), late);
    server.turn(late);
    let told = server.class_2(late, MASTER, 48, &[], &mut machine);
    assert_eq!(told, Reply::Data(vec![0x58, 0, 0x13]));
    assert_eq!(
        server.class_2(late, MASTER, 48, &[], &mut machine),
        Reply::Closed
    );
    // Nobody fetches that either.
    open(&mut server, Nanos(0), MASTER);
    server.turn(Nanos::from_secs(8));
    server.turn(Nanos::from_secs(12));
    assert_eq!(server.deadline(), Nanos::MAX);
}

#[test]
fn what_is_no_request_ends_the_connection_with_a_reason() {
    let (mut server, mut machine) = (server(), Kept::default());
    let now = Nanos(0);
    open(&mut server, now, MASTER);
    let mut serve = |server: &mut Server, request: &[u8]| {
        server.class_2(now, MASTER, 48, request, &mut machine)
    };
    assert_eq!(serve(&mut server, &[0x77]), Reply::Nothing);
    let ended = |why| Reply::Data(vec![0x58, 0, why]);
    assert_eq!(serve(&mut server, &[]), ended(0x12));
    assert_eq!(serve(&mut server, &[]), Reply::Closed);
    // A second request before the first answer.
    open(&mut server, now, MASTER);
    assert_eq!(serve(&mut server, &[0x48]), Reply::Nothing);
    assert_eq!(serve(&mut server, &[0x48]), ended(0x11));
    assert_eq!(serve(&mut server, &[]), Reply::Closed);
    // Wrong requests to open one: another service, too short, a network, wrong lengths.
    let with = |changes: &[(usize, u8)]| {
        let mut request = INITIATE.to_vec();
        for (at, octet) in changes {
            request[*at] = *octet;
        }
        request
    };
    for (request, why) in [
        (vec![0x5E, 0, 0, 1], 0x12),
        (with(&[(0, 0x58)]), 0x12),
        (INITIATE[..15].to_vec(), 0x12),
        (INITIATE[..19].to_vec(), 0x17),
        (with(&[(13, 3)]), 0x12),
        (with(&[(12, 1), (13, 3)]), 0x17),
        (with(&[(14, 1)]), 0x17),
        (with(&[(15, 1)]), 0x12),
    ] {
        let offer = Reply::Data(vec![0x56, 48, 0x01, 0x90]);
        assert_eq!(server.open(now, MASTER, &request), offer);
        assert_eq!(serve(&mut server, &[]), ended(why), "{request:02X?}");
        assert_eq!(serve(&mut server, &[]), Reply::Closed);
    }
}

#[test]
fn a_device_with_little_room_cuts_what_is_read_and_refuses_what_is_written() {
    let own = Acyclic {
        class_1: true,
        connections: 1,
        max_data: 32,
        records: vec![Record {
            slot: 1,
            index: 1,
            octets: vec![1; 32],
            is_writable: true,
        }],
        parameters: vec![Parameter {
            number: 10,
            format: Format::Unsigned8,
            is_array: true,
            octets: vec![5; 32],
            is_writable: false,
        }],
        ..Acyclic::default()
    };
    let (mut server, mut machine) = (Server::new(&own, 1), Kept::default());
    server.reset(true);
    // The nameplate has 68 octets.
    ask(
        &mut server,
        &mut machine,
        &[0x5F, 0, 255, 4, 8, 0, 0xFD, 0xE8],
    );
    let read = ask(&mut server, &mut machine, &[0x5E, 0, 255, 240]);
    assert_eq!((read[3], read.len()), (32, 36));
    let mut write = vec![0x5F, 1, 1, 33];
    write.resize(4 + 33, 0);
    let refused = [0xDF, 128, 0xB1, 0];
    assert_eq!(ask(&mut server, &mut machine, &write), refused);
    // 27 values do not fit behind the heads of the answer, 26 do.
    for (elements, expected) in [
        (27, &[0x81, 0, 1, 0x44, 1, 0, 0x15][..]),
        (26, &[1, 0, 1, 5, 26]),
    ] {
        let request = [0x5F, 0, 47, 10, 7, 1, 0, 1, 0x10, elements, 0, 10, 0, 0];
        ask(&mut server, &mut machine, &request);
        let answer = ask(&mut server, &mut machine, &[0x5E, 0, 47, 240]);
        assert_eq!(answer[5..5 + expected.len()], *expected, "{elements}");
        assert!(answer.len() <= 36);
    }
    assert!(matches!(
        server.open(Nanos(0), MASTER, &INITIATE),
        Reply::Data(_)
    ));
    let Reply::Data(answer) = server.class_2(Nanos(0), MASTER, 48, &[], &mut machine) else {
        panic!("no answer");
    };
    assert_eq!(answer[..2], [0x57, 32]);
}
