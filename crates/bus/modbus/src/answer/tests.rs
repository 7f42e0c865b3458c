use proptest::prelude::*;

use super::super::identification::Taken;
use super::super::{Map, Side};
use super::*;

/// Ranges of bits, each with its end.
type Bits = Vec<(usize, usize)>;

/// A unit of three bytes of %I and five of %Q.
struct Unit {
    map: Map,
    sends: [u8; 3],
    holds: [u8; 6],
}

/// Both areas of the unit as wholes.
fn map(input: Side, window: Option<usize>) -> Map {
    Map::of_areas(input, window, 3, 5)
}

impl Unit {
    fn device() -> Self {
        Self {
            map: map(Side::Sends, None),
            sends: [0x12, 0x34, 0x81],
            holds: [0; 6],
        }
    }

    fn ask(&mut self, pdu: &[u8]) -> (Vec<u8>, Done) {
        let mut tables = Tables {
            map: &self.map,
            sends: &self.sends,
            holds: &mut self.holds,
        };
        let mut reply = vec![0xEE];
        let identification = Identification::of_driver("Cell 4");
        let done = answer(pdu, &mut tables, &identification, &mut reply);
        assert_eq!(reply.remove(0), 0xEE, "what stood before it stays");
        (reply, done)
    }

    /// The bits of the frames that a request has written, and those in its answer that clients cannot write.
    fn touched(&self, done: &Done) -> (Bits, Bits) {
        let bits = |side, elements: Option<_>| {
            let bits = elements.into_iter();
            let bits = bits.flat_map(|elements| self.map.bits(side, elements));
            let bits = bits.map(|bits| (bits.start, bits.end));
            bits.collect()
        };
        (bits(Side::Holds, done.wrote), bits(Side::Sends, done.read))
    }

    #[track_caller]
    fn answers(&mut self, pdu: &[u8], reply: &[u8]) -> (Bits, Bits) {
        let (given, done) = self.ask(pdu);
        assert_eq!(given, reply, "to {pdu:02X?}");
        assert_eq!(done.refused, None);
        self.touched(&done)
    }

    #[track_caller]
    fn refuses(&mut self, pdu: &[u8], exception: u8) {
        let before = self.holds;
        let (given, done) = self.ask(pdu);
        assert_eq!(given, [pdu[0] | 0x80, exception], "to {pdu:02X?}");
        assert_eq!(done.refused, Some(Exception(exception)));
        assert_eq!((done.wrote, done.read), (None, None));
        assert_eq!(self.holds, before, "what is refused does nothing");
    }
}

#[test]
fn input_registers_are_the_bytes_of_i() {
    let mut unit = Unit::device();
    let done = unit.answers(&[4, 0, 0, 0, 1], &[4, 2, 0x12, 0x34]);
    assert_eq!(done, (vec![], vec![(0, 16)]));
    // The last byte is half a register.
    let done = unit.answers(&[4, 0, 0, 0, 2], &[4, 4, 0x12, 0x34, 0x81, 0]);
    assert_eq!(done, (vec![], vec![(0, 24)]));
    unit.refuses(&[4, 0, 0, 0, 3], 2);
    unit.refuses(&[4, 0, 2, 0, 1], 2);
}

#[test]
fn discrete_inputs_are_the_bits_of_i() {
    let mut unit = Unit::device();
    let done = unit.answers(&[2, 0, 1, 0, 10], &[2, 2, 0b0000_1001, 0b10]);
    assert_eq!(done, (vec![], vec![(1, 11)]));
    unit.answers(&[2, 0, 23, 0, 1], &[2, 1, 1]);
    unit.answers(&[2, 0, 0, 0, 24], &[2, 3, 0x12, 0x34, 0x81]);
    unit.refuses(&[2, 0, 24, 0, 1], 2);
}

#[test]
fn nothing_lies_behind_the_last_address() {
    let (sends, mut holds) = ([0xFF; 9000], [0; 9000]);
    let mut tables = Tables {
        map: &Map::of_areas(Side::Sends, None, 9000, 9000),
        sends: &sends,
        holds: &mut holds,
    };
    let identification = Identification::default();
    for (pdu, expected) in [
        ([2, 0xFF, 0xFF, 0, 1], &[2, 1, 1][..]),
        ([2, 0xFF, 0xFF, 0, 2], &[0x82, 2]),
        ([1, 0xFF, 0xF8, 0, 8], &[1, 1, 0]),
        ([1, 0xFF, 0xF8, 0, 9], &[0x81, 2]),
    ] {
        let mut reply = Vec::new();
        answer(&pdu, &mut tables, &identification, &mut reply);
        assert_eq!(reply, expected, "{pdu:02X?}");
    }
}

#[test]
fn holding_registers_and_coils_give_back_what_was_written() {
    let mut unit = Unit::device();
    let echo = [6, 0, 1, 0xAB, 0xCD];
    let done = unit.answers(&echo, &echo);
    assert_eq!(done, (vec![(16, 32)], vec![]));
    unit.answers(&[3, 0, 0, 0, 3], &[3, 6, 0, 0, 0xAB, 0xCD, 0, 0]);
    unit.answers(&[1, 0, 16, 0, 8], &[1, 1, 0xAB]);
    let done = unit.answers(&[15, 0, 18, 0, 3, 1, 0b1111_1101], &[15, 0, 18, 0, 3]);
    assert_eq!(done, (vec![(18, 21)], vec![]));
    // 1010_1011 with bits 2 to 4 as 101.
    unit.answers(&[1, 0, 16, 0, 8], &[1, 1, 0b1011_0111]);
    let on = [5, 0, 39, 0xFF, 0];
    assert_eq!(unit.answers(&on, &on).0, [(39, 40)]);
    unit.answers(&[3, 0, 2, 0, 1], &[3, 2, 0x80, 0]);
    let off = [5, 0, 39, 0, 0];
    unit.answers(&off, &off);
    let done = unit.answers(&[16, 0, 0, 0, 2, 4, 1, 2, 3, 4], &[16, 0, 0, 0, 2]);
    assert_eq!(done, (vec![(0, 32)], vec![]));
    unit.answers(&[3, 0, 0, 0, 2], &[3, 4, 1, 2, 3, 4]);
}

#[test]
fn a_mask_sets_and_clears_as_the_standard_reckons() {
    let mut unit = Unit::device();
    unit.holds[4..].copy_from_slice(&[0x00, 0x12]);
    // The standard's example: 12h, F2h and 25h give 17h.
    let echo = [22, 0, 2, 0x00, 0xF2, 0x00, 0x25];
    assert_eq!(unit.answers(&echo, &echo).0, [(32, 48)]);
    unit.answers(&[3, 0, 2, 0, 1], &[3, 2, 0x00, 0x17]);
    unit.refuses(&[22, 0, 3, 0, 0xF2, 0, 0x25], 2);
    unit.refuses(&[22, 0, 2, 0, 0xF2, 0], 3);
}

#[test]
fn read_and_write_writes_first() {
    let mut unit = Unit::device();
    let pdu = [23, 0, 0, 0, 2, 0, 1, 0, 1, 2, 0xAB, 0xCD];
    let done = unit.answers(&pdu, &[23, 4, 0, 0, 0xAB, 0xCD]);
    assert_eq!(done, (vec![(16, 32)], vec![]));
    // If the read is impossible, nothing is written.
    unit.refuses(&[23, 0, 3, 0, 1, 0, 0, 0, 1, 2, 1, 2], 2);
    unit.refuses(&[23, 0, 0, 0, 1, 0, 3, 0, 1, 2, 1, 2], 2);
    unit.refuses(&[23, 0, 0, 0, 1, 0, 0, 0, 1, 3, 1, 2, 3], 3);
    unit.refuses(&[23, 0, 0, 0, 0, 0, 0, 0, 1, 2, 1, 2], 3);
    unit.refuses(&[23, 0, 0, 0, 126, 0, 0, 0, 1, 2, 1, 2], 3);
    unit.refuses(&[23, 0, 0, 0, 1, 0, 0, 0, 0, 0], 3);
}

#[test]
fn a_window_shows_the_inputs_among_the_holding_registers() {
    let mut unit = Unit::device();
    unit.map = map(Side::Sends, Some(4));
    let done = unit.answers(&[3, 0, 4, 0, 2], &[3, 4, 0x12, 0x34, 0x81, 0]);
    assert_eq!(done, (vec![], vec![(0, 24)]));
    assert_eq!(unit.answers(&[1, 0, 65, 0, 1], &[1, 1, 1]).1, [(1, 2)]);
    unit.refuses(&[3, 0, 3, 0, 2], 2);
    unit.refuses(&[6, 0, 4, 0, 1], 2);
    let both = [23, 0, 4, 0, 1, 0, 0, 0, 1, 2, 7, 8];
    let done = unit.answers(&both, &[23, 2, 0x12, 0x34]);
    assert_eq!(done, (vec![(0, 16)], vec![(0, 16)]));
}

/// A PLC that is a server: its outputs are read, its inputs are written.
#[test]
fn a_controller_s_outputs_are_read_and_its_inputs_written() {
    let mut unit = Unit::device();
    unit.map = Map::of_areas(Side::Holds, Some(8), 3, 5);
    unit.answers(&[3, 0, 0, 0, 1], &[3, 2, 0x12, 0x34]);
    unit.refuses(&[6, 0, 0, 0, 1], 2);
    unit.refuses(&[5, 0, 0, 0xFF, 0], 2);
    unit.answers(&[6, 0, 8, 5, 6], &[6, 0, 8, 5, 6]);
    assert_eq!(unit.holds[..2], [5, 6]);
    unit.answers(&[4, 0, 0, 0, 1], &[4, 2, 5, 6]);
    unit.answers(&[5, 0, 129, 0xFF, 0], &[5, 0, 129, 0xFF, 0]);
    assert_eq!(unit.holds[0], 7);
}

#[test]
fn quantities_and_values_are_judged_before_addresses() {
    let mut unit = Unit::device();
    for code in [1, 2, 3, 4] {
        unit.refuses(&[code, 0xFF, 0xFF, 0, 0], 3);
        unit.refuses(&[code, 0xFF, 0xFF, 0x07, 0xD1], 3);
        unit.refuses(&[code, 0xFF, 0xFF, 0, 1], 2);
        unit.refuses(&[code, 0xFF, 0xFF, 0, 2], 2);
        unit.refuses(&[code, 0, 0, 0], 3);
        unit.refuses(&[code, 0, 0, 0, 1, 0], 3);
        unit.refuses(&[code], 3);
    }
    unit.refuses(&[3, 0, 0, 0, 126], 3);
    unit.refuses(&[1, 0, 0, 7, 0xD0], 2);
    unit.refuses(&[5, 0xFF, 0xFF, 0xFF, 1], 3);
    unit.refuses(&[5, 0xFF, 0xFF, 0xFF, 0], 2);
    unit.refuses(&[6, 0xFF, 0xFF, 0xFF, 0], 2);
    unit.refuses(&[15, 0, 0, 0, 0, 0], 3);
    unit.refuses(&[15, 0, 0, 0, 9, 1, 0], 3);
    unit.refuses(&[15, 0, 0, 0, 8, 2, 0, 0], 3);
    unit.refuses(&[15, 0, 0, 0, 8, 1], 3);
    unit.refuses(&[15, 0, 39, 0, 2, 1, 0], 2);
    unit.refuses(&[16, 0, 0, 0, 1, 1, 0], 3);
    unit.refuses(&[16, 0, 0, 0, 1, 4, 0, 0, 0, 0], 3);
    unit.refuses(&[16, 0, 2, 0, 2, 4, 0, 0, 0, 0], 2);
    let mut much = vec![16, 0, 0, 0, 124, 248];
    much.extend([0; 248]);
    unit.refuses(&much, 3);
}

#[test]
fn functions_that_are_not_there_are_illegal() {
    for code in 0..=u8::MAX {
        if Function::of(code).is_none() || matches!(code, 7 | 8 | 11 | 12 | 17 | 20 | 21 | 24) {
            Unit::device().refuses(&[code, 0, 0, 0, 1], 1);
        }
    }
}

#[test]
fn eight_bits_are_the_exception_status_where_the_device_has_them() {
    let mut unit = Unit::device();
    unit.map = map(Side::Sends, None).with_extras(Some((Table::DiscreteInputs, 8)), &[]);
    let touched = unit.answers(&[7], &[7, 0x34]);
    assert_eq!(touched, (vec![], vec![(8, 16)]));
    unit.refuses(&[7, 0], 3);
    // There are 24 bits.
    for (first, is_there) in [(16, true), (17, false)] {
        unit.map = map(Side::Sends, None).with_extras(Some((Table::DiscreteInputs, first)), &[]);
        assert_eq!(unit.map.exception_status().is_some(), is_there);
    }
    unit.refuses(&[7], 1);
}

#[test]
fn a_queue_is_a_register_that_counts_those_behind_it() {
    let mut unit = Unit::device();
    let queues = [0, 2, 9];
    unit.map = map(Side::Sends, None).with_extras(None, &queues);
    assert_eq!(unit.map.queues(), [0, 2], "there is no register 9");
    unit.holds = [0, 2, 0x12, 0x34, 0x56, 0];
    let answer = [24, 0, 6, 0, 2, 0x12, 0x34, 0x56, 0];
    unit.answers(&[24, 0, 0], &answer);
    unit.answers(&[24, 0, 0], &answer);
    unit.holds = [0, 0, 0, 0, 0, 0];
    unit.answers(&[24, 0, 0], &[24, 0, 2, 0, 0]);
    unit.refuses(&[24, 0, 1], 2);
    unit.refuses(&[24, 0], 3);
    unit.refuses(&[24, 0, 0, 0], 3);
    // More than a queue can have, and more than there are registers.
    unit.holds = [0, 32, 0, 0, 0, 0];
    unit.refuses(&[24, 0, 0], 3);
    unit.holds = [0, 3, 0, 0, 0, 0];
    unit.refuses(&[24, 0, 0], 2);
}

#[test]
fn a_device_says_who_it_is() {
    let mut unit = Unit::device();
    let head = |access: u8, count: u8| vec![43, 14, access, 0x81, 0, 0, count];
    let vendor = [&[0, 7][..], b"tickbus"].concat();
    let product = [&[1, 6][..], b"Cell 4"].concat();
    let all = [head(1, 3), vendor.clone(), product.clone(), vec![2, 0]].concat();
    unit.answers(&[43, 14, 1, 0], &all);
    let all = [head(3, 3), vendor, product.clone(), vec![2, 0]].concat();
    unit.answers(&[43, 14, 3, 99], &all);
    unit.answers(&[43, 14, 4, 1], &[head(4, 1), product.clone()].concat());
    unit.answers(&[43, 14, 2, 1], &[head(2, 2), product, vec![2, 0]].concat());
    unit.refuses(&[43, 14, 4, 3], 2);
    unit.refuses(&[43, 14, 0, 0], 3);
    unit.refuses(&[43, 14, 5, 0], 3);
    unit.refuses(&[43, 14, 1], 3);
    unit.refuses(&[43, 13, 1, 0], 1);
    unit.refuses(&[43], 3);
}

#[test]
fn a_device_has_the_names_that_its_maker_gave_it() {
    let names = ["ACME", "FD-7", "V2.1", "", "Frequency drive", "", "Line 3"].map(str::to_owned);
    let who = Identification {
        objects: names,
        server_id: Some(b"FD7\xFF".to_vec()),
    };
    let ask = |pdu: &[u8]| {
        let map = map(Side::Sends, None);
        let mut tables = Tables {
            map: &map,
            sends: &[0; 3],
            holds: &mut [0; 6],
        };
        let mut reply = Vec::new();
        answer(pdu, &mut tables, &who, &mut reply);
        reply
    };
    let object = |id: u8, text: &str| {
        let length = u8::try_from(text.len()).expect("short");
        [&[id, length][..], text.as_bytes()].concat()
    };
    let basic = [object(0, "ACME"), object(1, "FD-7"), object(2, "V2.1")].concat();
    let regular = [object(4, "Frequency drive"), object(6, "Line 3")].concat();
    let head = |access, count| vec![43, 14, access, 0x82, 0, 0, count];
    assert_eq!(ask(&[43, 14, 1, 0]), [head(1, 3), basic.clone()].concat());
    assert_eq!(
        ask(&[43, 14, 2, 0]),
        [head(2, 5), basic.clone(), regular.clone()].concat()
    );
    assert_eq!(ask(&[43, 14, 3, 4]), [head(3, 2), regular].concat());
    // A stream from an object that does not exist.
    assert_eq!(ask(&[43, 14, 1, 4]), [head(1, 3), basic].concat());
    assert_eq!(
        ask(&[43, 14, 4, 6]),
        [head(4, 1), object(6, "Line 3")].concat()
    );
    assert_eq!(ask(&[43, 14, 4, 5]), [0xAB, 2]);
    assert_eq!(ask(&[43, 14, 4, 7]), [0xAB, 2]);
    assert_eq!(ask(&[17]), [17, 4, b'F', b'D', b'7', 0xFF]);
    assert_eq!(ask(&[17, 0]), [0x91, 3]);
    assert_eq!(who.line(), "ACME FD-7 V2.1");
}

#[test]
fn a_long_name_is_told_in_two_answers() {
    let long = Identification::of_driver(&"é".repeat(120));
    assert_eq!(long.objects[1], "?".repeat(120));
    let mut long = Identification::default();
    for (object, text) in
        long.objects
            .iter_mut()
            .zip(["v".repeat(300), "p".repeat(200), "r".repeat(44)])
    {
        *object = text;
    }
    let (mut heard, mut next, mut answers) = (Identification::default(), Some(0), 0);
    while let Some(object) = next {
        let mut reply = Vec::new();
        long.answer(&[14, 1, object], &mut reply)
            .expect("it answers");
        assert!(reply.len() <= 253, "{} bytes", reply.len());
        next = match heard.take(&reply[1..]).expect("it is well formed") {
            Taken::Whole => None,
            Taken::MoreFrom(object) => Some(object),
        };
        answers += 1;
    }
    assert_eq!(answers, 3);
    assert_eq!(heard.objects[0], "v".repeat(244));
    assert_eq!(heard.objects[1..], long.objects[1..]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    /// Every request gets an answer, and changes nothing except what the answer reports.
    #[test]
    fn every_request_is_answered_or_refused_and_nothing_else_happens(
        function in prop::sample::select(Function::ALL.map(Function::code).to_vec()),
        data in prop::collection::vec(prop_oneof![Just(0_u8), 0..8_u8, any::<u8>()], 0..252),
        window in prop::option::of(0..8_usize), serves_inputs: bool,
    ) {
        let mut unit = Unit::device();
        let input = if serves_inputs { Side::Holds } else { Side::Sends };
        unit.map = map(input, window);
        let before = unit.holds;
        let pdu = [&[function][..], &data].concat();
        let (reply, done) = unit.ask(&pdu);
        prop_assert!(reply.len() <= 253);
        let wrote = unit.touched(&done).0;
        if let Some(exception) = done.refused {
            prop_assert_eq!(reply, vec![function | 0x80, exception.0]);
            prop_assert!(wrote.is_empty());
        } else {
            prop_assert_eq!(reply[0], function);
        }
        for bit in (0..unit.holds.len() * 8).filter(|bit| !wrote.iter().any(|(first, end)| (*first..*end).contains(bit))) {
            let mask = 1 << (bit % 8);
            prop_assert_eq!(before[bit / 8] & mask, unit.holds[bit / 8] & mask, "bit {}", bit);
        }
    }
}

/// The same requests by a map that looks up single elements, as the reference: every piece at its place, all else 02.
mod placed {
    use super::*;
    use crate::Piece;

    fn piece(table: Table, wire: usize, bit: usize, bits: usize) -> Piece {
        Piece {
            table,
            wire,
            bit,
            bits,
            fills: false,
        }
    }

    /// %I: a word in holding register 8500 and a bit in discrete input 7; %Q: a double word in 8501, a WORD in 900 and
    /// its bit 0 once more, a coil at 65535. Holding registers 8490 to 8499 are reserved.
    fn unit() -> Unit {
        let pieces = [
            (
                Side::Sends,
                piece(Table::HoldingRegisters, 8500 * 16, 0, 16),
            ),
            (Side::Sends, piece(Table::DiscreteInputs, 7, 23, 1)),
            (
                Side::Holds,
                piece(Table::HoldingRegisters, 8501 * 16, 0, 32),
            ),
            (
                Side::Holds,
                piece(Table::HoldingRegisters, 900 * 16, 16, 16),
            ),
            (
                Side::Holds,
                piece(Table::HoldingRegisters, 900 * 16 + 8, 39, 1),
            ),
            (Side::Holds, piece(Table::Coils, 65535, 38, 1)),
        ];
        let reserved = (
            Table::HoldingRegisters,
            Span {
                first: 8490,
                count: 10,
            },
        );
        Unit {
            map: Map::of_places(&pieces, &[reserved]),
            ..Unit::device()
        }
    }

    #[test]
    fn elements_are_where_they_were_placed_and_nowhere_else() {
        let mut unit = unit();
        // 8499 is reserved, 8500 is sent, 8501 and 8502 are written.
        let read = [3, 0x21, 0x33, 0, 4];
        let done = unit.answers(&read, &[3, 8, 0, 0, 0x12, 0x34, 0, 0, 0, 0]);
        assert_eq!(done, (vec![], vec![(0, 16)]));
        let write = [16, 0x21, 0x35, 0, 2, 4, 1, 2, 3, 4];
        let done = unit.answers(&write, &write[..5]);
        assert_eq!(done, (vec![(0, 32)], vec![]));
        unit.answers(&read, &[3, 8, 0, 0, 0x12, 0x34, 1, 2, 3, 4]);
        assert_eq!(unit.answers(&[2, 0, 7, 0, 1], &[2, 1, 1]).1, [(23, 24)]);
        for refused in [
            &[3, 0x21, 0x33, 0, 5][..],
            &[3, 0x21, 0x29, 0, 1],
            &[3, 0, 0, 0, 1],
            &[4, 0x21, 0x34, 0, 1],
            &[1, 0x21, 0x34, 0, 1],
            &[2, 0, 6, 0, 1],
            &[2, 0, 7, 0, 2],
            &[6, 0x21, 0x34, 0, 1],
            &[16, 0x21, 0x34, 0, 2, 4, 1, 2, 3, 4],
            &[5, 0xFF, 0xFE, 0xFF, 0],
        ] {
            unit.refuses(refused, 2);
        }
        let coil = [5, 0xFF, 0xFF, 0xFF, 0];
        assert_eq!(unit.answers(&coil, &coil).0, [(38, 39)]);
        // What is reserved takes what is written, and forgets it.
        let reserved = [6, 0x21, 0x2A, 0xAB, 0xCD];
        assert_eq!(unit.answers(&reserved, &reserved), (vec![], vec![]));
        unit.answers(&[3, 0x21, 0x2A, 0, 1], &[3, 2, 0, 0]);
    }

    #[test]
    fn a_word_and_its_bit_hear_the_same_write() {
        let mut unit = unit();
        let write = [6, 0x03, 0x84, 0x00, 0x01];
        let done = unit.answers(&write, &write);
        assert_eq!(done.0, [(16, 32), (39, 40)]);
        assert_eq!(
            (unit.holds[2..4].to_vec(), unit.holds[4]),
            (vec![0, 1], 0x80)
        );
        let mask = [22, 0x03, 0x84, 0xFF, 0xFE, 0, 0];
        unit.answers(&mask, &mask);
        assert_eq!((unit.holds[2..4].to_vec(), unit.holds[4]), (vec![0, 0], 0));
    }

    proptest! {
        /// Reads and writes of any elements do the same as element by element.
        #[test]
        fn a_request_does_what_its_elements_do_one_by_one(
            starts in prop::collection::vec((0..40_usize, 0..4_usize, any::<bool>()), 1..12),
            first in 0..44_usize, count in 1..20_usize,
            frame in prop::collection::vec(any::<u8>(), 48),
            values in prop::collection::vec(any::<u8>(), 40),
        ) {
            let mut taken = [false; 64];
            let mut pieces = Vec::new();
            for (index, (register, size, sends)) in starts.iter().enumerate() {
                let bits = [1_usize, 8, 16, 32][*size];
                let registers = *register..*register + bits.div_ceil(16);
                if taken[registers.clone()].contains(&true) {
                    continue;
                }
                taken[registers].fill(true);
                let side = if *sends { Side::Sends } else { Side::Holds };
                pieces.push((side, piece(Table::HoldingRegisters, register * 16, index * 32, bits)));
            }
            let map = Map::of_places(&pieces, &[]);
            let span = Span { first, count };
            let ask = |span, holds: &mut Vec<u8>, write: Option<&[u8]>| {
                let mut tables = Tables { map: &map, sends: &frame, holds };
                let mut reply = Vec::new();
                let done = match write {
                    None => tables.read(Table::HoldingRegisters, span, &mut reply),
                    Some(values) => tables.put(Table::HoldingRegisters, span, values),
                };
                done.map(|()| reply)
            };
            let one = |offset| Span { first: offset, count: 1 };
            let mut whole = frame.clone();
            let read = ask(span, &mut whole, None);
            let singly: Result<Vec<_>, _> =
                (first..first + count).map(|offset| ask(one(offset), &mut whole, None)).collect();
            prop_assert_eq!(read, singly.map(|all| all.concat()));
            let mut singly = frame.clone();
            let written = ask(span, &mut whole, Some(&values[..count * 2]));
            let each: Vec<_> = (0..count)
                .map(|n| ask(one(first + n), &mut singly, Some(&values[n * 2..n * 2 + 2])))
                .collect();
            if written.is_ok() {
                prop_assert_eq!(whole, singly);
            } else {
                prop_assert!(each.iter().any(Result::is_err));
                prop_assert_eq!(whole, frame, "what is refused changes nothing");
            }
        }
    }
}
