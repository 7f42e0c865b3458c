use proptest::prelude::*;

use super::super::identification::Taken;
use super::super::{Map, Side};
use super::*;

/// A unit of three bytes of %I and five of %Q.
struct Unit {
    map: Map,
    sends: [u8; 3],
    holds: [u8; 6],
}

impl Unit {
    fn device() -> Self {
        Self {
            map: Map {
                input: Side::Sends,
                window: None,
            },
            sends: [0x12, 0x34, 0x81],
            holds: [0; 6],
        }
    }

    fn ask(&mut self, pdu: &[u8]) -> (Vec<u8>, Done) {
        let mut tables = Tables {
            map: self.map,
            sends: &self.sends,
            holds: &mut self.holds,
            holds_len: 5,
        };
        let mut reply = vec![0xEE];
        let identification = Identification::of_driver("Cell 4");
        let done = answer(pdu, &mut tables, &identification, &mut reply);
        assert_eq!(reply.remove(0), 0xEE, "what stood before it stays");
        (reply, done)
    }

    #[track_caller]
    fn answers(&mut self, pdu: &[u8], reply: &[u8]) -> Done {
        let (given, done) = self.ask(pdu);
        assert_eq!(given, reply, "to {pdu:02X?}");
        assert_eq!(done.refused, None);
        done
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
    assert_eq!(done.read, Some(0..16));
    // The last byte is half a register.
    let done = unit.answers(&[4, 0, 0, 0, 2], &[4, 4, 0x12, 0x34, 0x81, 0]);
    assert_eq!(done.read, Some(0..24));
    unit.refuses(&[4, 0, 0, 0, 3], 2);
    unit.refuses(&[4, 0, 2, 0, 1], 2);
}

#[test]
fn discrete_inputs_are_the_bits_of_i() {
    let mut unit = Unit::device();
    let done = unit.answers(&[2, 0, 1, 0, 10], &[2, 2, 0b0000_1001, 0b10]);
    assert_eq!(done.read, Some(1..11));
    unit.answers(&[2, 0, 23, 0, 1], &[2, 1, 1]);
    unit.answers(&[2, 0, 0, 0, 24], &[2, 3, 0x12, 0x34, 0x81]);
    unit.refuses(&[2, 0, 24, 0, 1], 2);
}

#[test]
fn nothing_lies_behind_the_last_address() {
    let (sends, mut holds) = ([0xFF; 9000], [0; 9000]);
    let mut tables = Tables {
        map: Unit::device().map,
        sends: &sends,
        holds: &mut holds,
        holds_len: 9000,
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
    assert_eq!((done.wrote, done.read), (Some(16..32), None));
    unit.answers(&[3, 0, 0, 0, 3], &[3, 6, 0, 0, 0xAB, 0xCD, 0, 0]);
    unit.answers(&[1, 0, 16, 0, 8], &[1, 1, 0xAB]);
    let done = unit.answers(&[15, 0, 18, 0, 3, 1, 0b1111_1101], &[15, 0, 18, 0, 3]);
    assert_eq!(done.wrote, Some(18..21));
    // 1010_1011 with bits 2 to 4 as 101.
    unit.answers(&[1, 0, 16, 0, 8], &[1, 1, 0b1011_0111]);
    let on = [5, 0, 39, 0xFF, 0];
    assert_eq!(unit.answers(&on, &on).wrote, Some(39..40));
    unit.answers(&[3, 0, 2, 0, 1], &[3, 2, 0x80, 0]);
    let off = [5, 0, 39, 0, 0];
    unit.answers(&off, &off);
    let done = unit.answers(&[16, 0, 0, 0, 2, 4, 1, 2, 3, 4], &[16, 0, 0, 0, 2]);
    assert_eq!(done.wrote, Some(0..32));
    unit.answers(&[3, 0, 0, 0, 2], &[3, 4, 1, 2, 3, 4]);
}

#[test]
fn a_mask_sets_and_clears_as_the_standard_reckons() {
    let mut unit = Unit::device();
    unit.holds[4..].copy_from_slice(&[0x00, 0x12]);
    // The standard's example: 12h, F2h and 25h give 17h.
    let echo = [22, 0, 2, 0x00, 0xF2, 0x00, 0x25];
    assert_eq!(unit.answers(&echo, &echo).wrote, Some(32..48));
    unit.answers(&[3, 0, 2, 0, 1], &[3, 2, 0x00, 0x17]);
    unit.refuses(&[22, 0, 3, 0, 0xF2, 0, 0x25], 2);
    unit.refuses(&[22, 0, 2, 0, 0xF2, 0], 3);
}

#[test]
fn read_and_write_writes_first() {
    let mut unit = Unit::device();
    let pdu = [23, 0, 0, 0, 2, 0, 1, 0, 1, 2, 0xAB, 0xCD];
    let done = unit.answers(&pdu, &[23, 4, 0, 0, 0xAB, 0xCD]);
    assert_eq!((done.wrote, done.read), (Some(16..32), None));
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
    unit.map.window = Some(4);
    let done = unit.answers(&[3, 0, 4, 0, 2], &[3, 4, 0x12, 0x34, 0x81, 0]);
    assert_eq!(done.read, Some(0..24));
    assert_eq!(unit.answers(&[1, 0, 65, 0, 1], &[1, 1, 1]).read, Some(1..2));
    unit.refuses(&[3, 0, 3, 0, 2], 2);
    unit.refuses(&[6, 0, 4, 0, 1], 2);
    let both = [23, 0, 4, 0, 1, 0, 0, 0, 1, 2, 7, 8];
    let done = unit.answers(&both, &[23, 2, 0x12, 0x34]);
    assert_eq!((done.wrote, done.read), (Some(0..16), Some(0..16)));
}

/// A PLC that is a server: its outputs are read, its inputs are written.
#[test]
fn a_controller_s_outputs_are_read_and_its_inputs_written() {
    let mut unit = Unit::device();
    unit.map = Map {
        input: Side::Holds,
        window: Some(8),
    };
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
        if Function::of(code).is_none() {
            Unit::device().refuses(&[code, 0, 0, 0, 1], 1);
        }
    }
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
fn a_long_name_is_told_in_two_answers() {
    let long = Identification::of_driver(&"é".repeat(120));
    assert_eq!(long.objects[1], "?".repeat(120));
    let long = Identification {
        objects: ["v".repeat(300), "p".repeat(200), "r".repeat(44)],
    };
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
        unit.map.window = window;
        if serves_inputs {
            unit.map.input = Side::Holds;
        }
        let before = unit.holds;
        let pdu = [&[function][..], &data].concat();
        let (reply, done) = unit.ask(&pdu);
        prop_assert!(reply.len() <= 253);
        let wrote = done.wrote.unwrap_or(0..0);
        if let Some(exception) = done.refused {
            prop_assert_eq!(reply, vec![function | 0x80, exception.0]);
            prop_assert!(wrote.is_empty());
        } else {
            prop_assert_eq!(reply[0], function);
        }
        for bit in (0..unit.holds.len() * 8).filter(|bit| !wrote.contains(bit)) {
            let mask = 1 << (bit % 8);
            prop_assert_eq!(before[bit / 8] & mask, unit.holds[bit / 8] & mask, "bit {}", bit);
        }
    }
}
