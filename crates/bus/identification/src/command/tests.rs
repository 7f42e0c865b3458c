use proptest::prelude::*;

use super::*;

/// The examples of the manual: the bytes before the checksum, and the checksum.
const EXAMPLES: [(&str, u8); 8] = [
    ("a2", 0x93),
    ("A1", 0x72),
    ("W10705", 0x54),
    ("K20A03P+F", 0x12),
    ("L2007", 0x15),
    ("d3", 0x97),
    ("H1", 0x79),
    ("I1", 0x7A),
];

fn whole(text: &str) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    seal(&mut bytes, 0);
    bytes
}

const ONE: Heads = Heads::One(1);
const TWO: Heads = Heads::One(2);

const fn auto(heads: Heads, access: Access<'_>) -> Command<'_> {
    Command::Access {
        heads,
        is_auto: true,
        access,
    }
}

#[test]
fn the_examples_of_the_manual_have_its_checksums_and_meanings() {
    let meant = [
        Command::once(2, Access::ReadStart),
        auto(ONE, Access::ReadStart),
        auto(
            ONE,
            Access::Read {
                address: 7,
                length: 5,
            },
        ),
        auto(
            TWO,
            Access::Write {
                address: 10,
                data: b"P+F",
            },
        ),
        auto(TWO, Access::ReadPage(7)),
        Command::SetCarriers(Family::Imc40),
        auto(ONE, Access::Reset),
        auto(ONE, Access::ReadNumber),
    ];
    for ((text, sum), command) in EXAMPLES.into_iter().zip(meant) {
        let bytes = whole(text);
        assert_eq!(bytes[text.len()..], [sum, ETX], "{text}");
        let mut made = Vec::new();
        command.append(Family::Idc1K, &mut made);
        assert_eq!(made, bytes, "{text}");
        let parsed = Command::parse(&bytes, Family::Idc1K);
        assert_eq!(parsed, Ok(Some((command, bytes.len()))), "{text}");
        for end in 0..bytes.len() {
            assert_eq!(Command::parse(&bytes[..end], Family::Idc1K), Ok(None));
        }
    }
    // The manual's example of "M2007" with zeros has 15h, which is the sum of "L2007": by the manual's own rule it
    // should be 16h.
    let zeros = auto(
        TWO,
        Access::WritePage {
            page: 7,
            data: &[0; PAGE],
        },
    );
    let mut made = Vec::new();
    zeros.append(Family::Imc40, &mut made);
    assert_eq!(made[made.len() - 2..], [0x16, ETX]);
}

#[test]
fn the_pallets_of_the_cell_are_read_by_this_command() {
    let mut made = Vec::new();
    let read = Access::Read {
        address: 0,
        length: 21,
    };
    Command::once(2, read).append(Family::Idc1K, &mut made);
    assert_eq!(made, b"w20015\x6F\x03");
}

#[test]
fn data_and_checksum_may_be_etx() {
    let data = [ETX; 5];
    let write = Command::once(
        3,
        Access::Write {
            address: 0x10,
            data: &data,
        },
    );
    let mut made = Vec::new();
    write.append(Family::Idc, &mut made);
    assert_eq!(
        Command::parse(&made, Family::Idc),
        Ok(Some((write, made.len())))
    );
    let mut sums = Vec::new();
    for datum in 0..=u8::MAX {
        let data = [datum];
        let write = Command::once(
            1,
            Access::Write {
                address: 0,
                data: &data,
            },
        );
        made.clear();
        write.append(Family::Idc, &mut made);
        assert_eq!(
            Command::parse(&made, Family::Idc),
            Ok(Some((write, made.len())))
        );
        sums.push(made[made.len() - 2]);
    }
    assert!(sums.contains(&ETX));
}

#[test]
fn addresses_have_four_digits_for_the_large_carriers() {
    let read = Command::once(
        1,
        Access::Read {
            address: 0x1FFF,
            length: 1,
        },
    );
    let mut made = Vec::new();
    read.append(Family::Imc40, &mut made);
    assert_eq!(&made[..8], b"w11FFF01");
    assert_eq!(Command::parse(&made, Family::Imc40), Ok(Some((read, 10))));
}

#[test]
fn what_is_wrong_is_refused_with_its_status() {
    fn refused(bytes: &[u8]) -> Option<(Status, Option<usize>)> {
        let parsed = Command::parse(bytes, Family::Idc1K);
        parsed.err().map(|no| (no.status, no.length))
    }
    assert_eq!(refused(b"?1"), Some((Status::UNKNOWN_COMMAND, None)));
    assert_eq!(
        refused(b"a2\x94\x03"),
        Some((Status::LINE_CHECKSUM, Some(4)))
    );
    assert_eq!(refused(b"a2\x93\x04"), Some((Status::LINE_CHECKSUM, None)));
    assert_eq!(refused(&whole("a5")), Some((Status::NO_HEAD, Some(4))));
    assert_eq!(
        refused(&whole("w1zz01")),
        Some((Status::OUT_OF_RANGE, Some(8)))
    );
    assert_eq!(refused(b"k100zz"), Some((Status::OUT_OF_RANGE, None)));
    assert_eq!(refused(&whole("d2")), Some((Status::UNSUPPORTED, Some(4))));
}

#[test]
fn system_commands_may_be_capitals() {
    for (text, command) in [
        ("C", Command::CheckMemory),
        ("b", Command::DoubleSided),
        ("O", Command::ResetReader),
        ("q", Command::EndAuto),
        ("V", Command::Version),
        ("D1", Command::SetCarriers(Family::Idc)),
    ] {
        let bytes = whole(text);
        assert_eq!(
            Command::parse(&bytes, Family::Idc),
            Ok(Some((command, bytes.len())))
        );
    }
}

fn any_command() -> impl Strategy<Value = (u8, u16, Vec<u8>, Heads, bool, Family)> {
    let heads = prop_oneof![
        Just(Heads::Off),
        (1..=4u8).prop_map(Heads::One),
        Just(Heads::All)
    ];
    let family = prop_oneof![Just(Family::Idc), Just(Family::Imc40), Just(Family::Idc1K)];
    let data = proptest::collection::vec(any::<u8>(), 32..=128);
    (0..7u8, 0..0x100u16, data, heads, any::<bool>(), family)
}

proptest! {
    #[test]
    fn what_is_appended_parses_back_and_no_part_of_it_does(
        (kind, number, data, heads, is_auto, family) in any_command()
    ) {
        let page: &[u8; PAGE] = data[..PAGE].try_into().expect("enough");
        let access = match kind {
            0 => Access::ReadStart,
            1 => Access::Read { address: number, length: data[0] },
            2 => Access::Write { address: number, data: &data },
            3 => Access::ReadNumber,
            4 => Access::Reset,
            5 => Access::ReadPage(number),
            _ => Access::WritePage { page: number, data: page },
        };
        let command = Command::Access { heads, is_auto, access };
        let mut made = Vec::new();
        command.append(family, &mut made);
        prop_assert!(made.len() <= COMMAND_LIMIT);
        prop_assert_eq!(Command::parse(&made, family), Ok(Some((command, made.len()))));
        for end in 0..made.len() {
            prop_assert_eq!(Command::parse(&made[..end], family), Ok(None));
        }
    }

    #[test]
    fn any_bytes_are_parsed_without_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..64)) {
        for family in [Family::Idc, Family::Imc40, Family::Idc1K] {
            if let Ok(Some((command, length))) = Command::parse(&bytes, family) {
                let mut made = Vec::new();
                command.append(family, &mut made);
                prop_assert_eq!(made.len(), length);
            }
        }
    }
}
