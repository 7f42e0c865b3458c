use proptest::prelude::*;

use super::*;
use crate::{Client, Outcome};

const TIMING: Timing = Timing {
    baud: 9600,
    timeout: Nanos::from_secs(1),
};

/// A reader with two heads, and the client at the other end of its line.
struct Line {
    reader: Reader,
    client: Client,
    now: Nanos,
}

impl Line {
    fn new(kind: CarrierType) -> Self {
        let mut heads: [Head; HEADS] = Default::default();
        for head in &mut heads[..2] {
            head.is_connected = true;
        }
        heads[0].carrier = Some(Carrier::new(kind, b"\x03one"));
        let mut line = Self {
            reader: Reader::new(heads, TIMING),
            client: Client::new(kind, TIMING),
            now: Nanos::from_secs(1),
        };
        let set = Command::SetCarriers(kind.family());
        assert_eq!(line.ask(&set), vec![(None, 0, vec![])]);
        line
    }

    /// Carries bytes both ways until the client has an outcome that is not one of several answers.
    fn ask(&mut self, command: &Command<'_>) -> Vec<(Option<u8>, u8, Vec<u8>)> {
        self.client.ask(self.now, command);
        let mut answers = Vec::new();
        while self.client.is_busy() {
            self.carry();
            while let Some(outcome) = self.client.poll(self.now) {
                match outcome {
                    Outcome::Answered(answer) => {
                        answers.push((answer.head, answer.status.0, self.client.data().to_vec()));
                    }
                    Outcome::Over => {}
                    Outcome::Silent => panic!("no answer to {command:?}"),
                }
            }
            self.now += Nanos::from_millis(10);
        }
        answers
    }

    fn carry(&mut self) {
        let request = self.client.to_write().to_vec();
        self.client.wrote(request.len());
        self.reader.hear(self.now, &request);
        let reply = self.reader.to_write().to_vec();
        self.reader.wrote(reply.len());
        if !reply.is_empty() {
            self.client.hear(self.now, &reply);
        }
    }

    fn access(&mut self, head: u8, access: Access<'_>) -> (u8, Vec<u8>) {
        let mut answers = self.ask(&Command::once(head, access));
        assert_eq!(answers.len(), 1);
        let (shown, status, data) = answers.remove(0);
        assert_eq!(shown, None);
        (status, data)
    }

    fn carrier(&mut self) -> &mut Carrier {
        self.reader
            .head_mut(1)
            .carrier
            .as_mut()
            .expect("it is there")
    }
}

const fn read(address: u16, length: u8) -> Access<'static> {
    Access::Read { address, length }
}

#[test]
fn carriers_are_read_and_written_by_octets_and_pages() {
    let mut line = Line::new(CarrierType::Imc64K);
    assert_eq!(line.access(1, read(0, 4)), (0, b"\x03one".to_vec()));
    let data = [3; 128];
    let write = Access::Write {
        address: 0x1F80,
        data: &data,
    };
    assert_eq!(line.access(1, write), (0, vec![]));
    assert_eq!(line.access(1, read(0x1F80, 128)), (0, data.to_vec()));
    let page = [7; PAGE];
    let write = Access::WritePage {
        page: 0xFF,
        data: &page,
    };
    assert_eq!(line.access(1, write), (0, vec![]));
    assert_eq!(line.access(1, Access::ReadPage(0xFF)), (0, page.to_vec()));
    assert_eq!(line.access(1, Access::ReadPage(0x100)).0, 9);
    assert_eq!(line.access(1, Access::ReadStart).1.len(), 32);
    assert_eq!(line.access(1, Access::Reset).0, 0x0D);
    assert_eq!(line.reader.head(1).writes, 2);
}

#[test]
fn each_type_has_its_limits_and_functions() {
    for (_, kind) in CarrierType::ALL {
        let mut line = Line::new(kind);
        let last = u16::try_from(kind.size() - 1).expect("small");
        assert_eq!(line.access(1, read(last, 1)), (0, vec![0]), "{kind:?}");
        assert_eq!(line.access(1, read(last, 2)).0, 9);
        assert_eq!(line.access(1, read(0, 0)).0, 9);
        let most = u8::try_from(kind.most()).expect("small");
        assert_eq!(line.access(1, read(0, most)).1.len(), kind.most());
        assert_eq!(line.access(1, read(0, most + 1)).0, 9);
        let pages = line.access(1, Access::ReadPage(0)).0;
        assert_eq!(pages, if kind == CarrierType::Idc { 0x0D } else { 0 });
    }
    let mut line = Line::new(CarrierType::Idc);
    assert_eq!(line.access(1, Access::Reset).0, 0);
    let (_, data) = line.access(1, Access::ReadStart);
    assert_eq!(data[..4], [0xAA, 0xAB, 0xAA, 0xAB]);
    assert_eq!(data[30..], [0xAA, 0xAA]);
    // The reset of an IDC-1K keeps its data.
    let mut line = Line::new(CarrierType::Idc1K);
    assert_eq!(line.access(1, Access::Reset).0, 0);
    assert_eq!(line.access(1, read(0, 4)).1, b"\x03one");
    let page = Access::WritePage {
        page: 0,
        data: &[0; PAGE],
    };
    assert_eq!(line.access(1, page).0, 0x0D);
}

#[test]
fn what_fails_says_why() {
    let mut line = Line::new(CarrierType::Idc1K);
    assert_eq!(line.access(2, read(0, 1)), (3, vec![]), "no carrier");
    assert_eq!(line.access(3, read(0, 1)), (2, vec![]), "no head");
    assert_eq!(line.access(1, Access::ReadNumber), (0x0D, vec![]));
    line.carrier().number = vec![0xA0, 3];
    assert_eq!(line.access(1, Access::ReadNumber), (0, vec![0xA0, 3]));
    line.carrier().is_protected = true;
    let write = Access::Write {
        address: 0,
        data: b"x",
    };
    assert_eq!(line.access(1, write), (4, vec![]));
    assert_eq!(
        line.access(1, read(1, 1)),
        (0, b"o".to_vec()),
        "nothing was written"
    );
    line.carrier().is_protected = false;
    for code in 1..=0x11 {
        line.reader.head_mut(1).fault = Some(Status(code));
        let expected = if code == 0x10 { b"o".to_vec() } else { vec![] };
        assert_eq!(line.access(1, read(1, 1)), (code, expected));
    }
    line.reader.head_mut(1).fault = None;
    assert_eq!(
        line.ask(&Command::SetCarriers(Family::Idc)),
        [(None, 0, vec![])]
    );
    assert_eq!(
        line.access(1, read(0, 1)).0,
        0x0D,
        "a carrier of another type"
    );
}

#[test]
fn all_heads_are_asked_in_turn() {
    let mut line = Line::new(CarrierType::Idc1K);
    let all = |access| Command::Access {
        heads: Heads::All,
        is_auto: false,
        access,
    };
    line.reader.head_mut(2).carrier = Some(Carrier::new(CarrierType::Idc1K, b"two"));
    let both = line.ask(&all(read(0, 3)));
    assert_eq!(
        both,
        [
            (Some(1), 0, b"\x03on".to_vec()),
            (Some(2), 0, b"two".to_vec())
        ]
    );
    let written = line.ask(&all(Access::Write {
        address: 0,
        data: b"X",
    }));
    assert_eq!(written, [(Some(1), 0, vec![])], "the first that is found");
    assert_eq!(line.access(2, read(0, 1)).1, b"t");
    line.reader.head_mut(1).carrier = None;
    line.reader.head_mut(2).carrier = None;
    assert_eq!(line.ask(&all(read(0, 1))), [(None, 3, vec![])]);
    let off = Command::Access {
        heads: Heads::Off,
        is_auto: false,
        access: read(0, 3),
    };
    assert_eq!(line.ask(&off), [(None, 0, vec![])]);
}

#[test]
fn system_commands_are_answered() {
    let mut line = Line::new(CarrierType::Imc64K);
    for command in [Command::CheckMemory, Command::DoubleSided, Command::EndAuto] {
        assert_eq!(line.ask(&command), [(None, 0, vec![])], "{command:?}");
    }
    assert_eq!(line.ask(&Command::Version), [(None, 0, VERSION.to_vec())]);
    // A restarted reader expects an IDC-1K, whose addresses are shorter.
    assert_eq!(line.ask(&Command::ResetReader), [(None, 0, vec![])]);
    line.client = Client::new(CarrierType::Idc1K, TIMING);
    assert_eq!(line.access(1, read(0, 1)).0, 0x0D);
}

#[test]
fn a_capital_is_repeated_until_q() {
    let mut line = Line::new(CarrierType::Idc1K);
    let first = line.ask(&Command::Access {
        heads: Heads::One(1),
        is_auto: true,
        access: read(0, 1),
    });
    assert_eq!(first, [(None, 0, vec![3])]);
    let repeated = |line: &mut Line| {
        line.now += REPEAT;
        line.carry();
        let mut found = Vec::new();
        while let Some(Outcome::Answered(answer)) = line.client.poll(line.now) {
            found.push((answer.command, answer.status.0, line.client.data().to_vec()));
        }
        found
    };
    assert_eq!(repeated(&mut line), [(b'W', 0, vec![3])]);
    line.carrier().octets[0] = 9;
    assert_eq!(repeated(&mut line), [(b'W', 0, vec![9])]);
    line.reader.head_mut(1).carrier = None;
    assert_eq!(repeated(&mut line), [(b'W', 3, vec![])]);
    line.ask(&Command::EndAuto);
    assert_eq!(repeated(&mut line), []);
    assert_eq!(line.reader.deadline(), Nanos::MAX);
}

#[test]
fn after_garbage_the_next_command_is_understood() {
    let at = Nanos::from_millis;
    for (garbage, answer) in [
        (b"?\x03abc".as_slice(), b"?01".as_slice()),
        (b"w1000", b"w06"),
        (b"a2\x93\x04", b"a06"),
    ] {
        let mut line = Line::new(CarrierType::Idc1K);
        let start = line.now + at(1);
        line.reader.hear(start, garbage);
        line.reader.hear(start + at(1), b"a");
        assert!(line.reader.to_write().is_empty());
        let silent = line.reader.deadline();
        assert_eq!(
            line.reader.turn(silent),
            Heard {
                commands: 0,
                damaged: 1
            }
        );
        assert!(line.reader.to_write().starts_with(answer), "{garbage:?}");
        let count = line.reader.to_write().len();
        line.reader.wrote(count);
        line.now = silent;
        assert_eq!(line.access(1, read(0, 1)), (0, vec![3]));
    }
}

#[test]
fn a_line_that_is_plugged_in_again_begins_with_a_whole_command() {
    for before in [b"?".as_slice(), b"w1", b"c\x63\x03"] {
        let mut line = Line::new(CarrierType::Imc64K);
        line.reader.hear(line.now, before);
        line.reader.unplug();
        assert!(line.reader.to_write().is_empty());
        assert_eq!(line.reader.deadline(), Nanos::MAX);
        assert_eq!(line.access(1, read(0, 1)), (0, vec![3]), "{before:?}");
    }
}

proptest! {
    #[test]
    fn any_bytes_are_survived_and_the_next_command_is_understood(
        pieces in proptest::collection::vec(
            proptest::collection::vec(prop_oneof![Just(b'k'), Just(b'W'), Just(b'1'), Just(b'0'), any::<u8>()], 0..40),
            0..10)
    ) {
        let mut line = Line::new(CarrierType::Idc1K);
        for piece in pieces {
            line.now += Nanos::from_millis(30);
            line.reader.hear(line.now, &piece);
            let count = line.reader.to_write().len();
            line.reader.wrote(count);
        }
        line.now += Nanos::from_secs(1);
        line.reader.turn(line.now);
        let count = line.reader.to_write().len();
        line.reader.wrote(count);
        line.reader.auto = None;
        line.reader.carriers = Family::Idc1K;
        line.carrier().octets[5] = 0x77;
        prop_assert_eq!(line.access(1, read(5, 1)), (0, vec![0x77]));
    }
}
