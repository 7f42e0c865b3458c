//! The server's half of the Modbus codec: any stream of TCP, RTU or ASCII telegrams against the tables of one unit.
//!
//! The first bytes choose role, window and sizes; the rest is the stream.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_bus_modbus::mbap::Telegram;
use tickbus_bus_modbus::{
    Done, Function, Identification, Map, PDU_LIMIT, Side, Table, Tables, answer, ascii, rtu,
};
use tickbus_base::time::Nanos;

fuzz_target!(|data: &[u8]| {
    let Some((header, stream)) = data.split_first_chunk::<4>() else {
        return;
    };
    let [flags, window, sends, holds] = *header;
    let input = if flags & 1 == 0 {
        Side::Sends
    } else {
        Side::Holds
    };
    let window = (flags & 2 != 0).then_some(usize::from(window) * 128);
    let holds_len = usize::from(holds) * if flags & 4 == 0 { 1 } else { 257 };
    let mut map = Map::of_areas(input, window, sends.into(), holds_len);
    if flags & 32 != 0 {
        map = map.with_extras(Some((Table::DiscreteInputs, sends.into())), &[0, 1, holds.into()]);
    }
    let mut unit = Unit {
        map,
        sends: (0..sends).collect(),
        holds: vec![0; holds_len.next_multiple_of(2)],
    };
    if flags & 8 == 0 {
        tcp(&mut unit, stream);
    } else if flags & 16 != 0 {
        characters(&mut unit, stream);
    } else {
        serial(&mut unit, stream);
    }
});

struct Unit {
    map: Map,
    sends: Vec<u8>,
    holds: Vec<u8>,
}

impl Unit {
    /// Answers, and checks what the standard requires of every answer.
    fn ask(&mut self, pdu: &[u8]) {
        let before = self.holds.clone();
        let mut tables = Tables {
            map: &self.map,
            sends: &self.sends,
            holds: &mut self.holds,
        };
        let mut reply = Vec::new();
        let identification = Identification::of_driver("fuzz");
        let done = answer(pdu, &mut tables, &identification, &mut reply);
        assert!(reply.len() <= PDU_LIMIT, "an answer longer than a PDU");
        let Done {
            wrote,
            read,
            refused,
        } = done;
        match refused {
            Some(exception) => {
                assert_eq!(reply, [pdu[0] | 0x80, exception.0]);
                assert!((1..=3).contains(&exception.0));
                assert_eq!((&wrote, &read), (&None, &None));
                assert_eq!(self.holds, before, "what is refused does nothing");
            }
            None => {
                assert_eq!(reply[0], pdu[0]);
                let function = Function::of(pdu[0]).expect("others are refused");
                assert_eq!(function.writes(), wrote.is_some());
            }
        }
        for bits in read.into_iter().flat_map(|elements| self.map.bits(Side::Sends, elements)) {
            assert!(bits.end <= self.sends.len() * 8);
        }
        // Nothing changes except the bits that were written.
        let mut expected = before;
        for bits in wrote.into_iter().flat_map(|elements| self.map.bits(Side::Holds, elements)) {
            assert!(bits.end <= self.holds.len() * 8);
            for bit in bits {
                let mask = 1 << (bit % 8);
                expected[bit / 8] = expected[bit / 8] & !mask | self.holds[bit / 8] & mask;
            }
        }
        assert_eq!(expected, self.holds, "a bit beside those written");
    }
}

fn tcp(unit: &mut Unit, mut stream: &[u8]) {
    while let Ok(Some((telegram, length))) = Telegram::parse(stream) {
        assert!(length <= stream.len() && !telegram.pdu.is_empty());
        unit.ask(telegram.pdu);
        stream = &stream[length..];
    }
}

/// Pieces of the stream as ASCII, each preceded by its length and the pause before it; long ones are also tried as the
/// bytes of a telegram, whose digits and checksum a fuzzer cannot guess.
fn characters(unit: &mut Unit, mut stream: &[u8]) {
    let mut framer = ascii::Framer::new(Nanos(16));
    let mut now = Nanos::ZERO;
    while let [pause, length, rest @ ..] = stream {
        now = now + Nanos(i64::from(*pause % 32));
        let (piece, after) = rest.split_at(usize::from(*length).min(rest.len()));
        stream = after;
        let mut whole = Vec::new();
        if (2..=PDU_LIMIT + 1).contains(&piece.len()) && *pause >= 128 {
            ascii::append(piece[0], &mut whole, |pdu| pdu.extend_from_slice(&piece[1..]));
            assert!(whole.len() <= ascii::ADU_LIMIT);
        }
        let is_whole = !whole.is_empty();
        let mut line = if is_whole { &whole[..] } else { piece };
        let mut asked = 0;
        loop {
            framer.arrived(now, &mut line);
            let taken = framer.take(now, |bytes| {
                if let Some((number, pdu)) = bytes.and_then(ascii::parse) {
                    unit.ask(pdu);
                    asked += 1;
                    assert!(!is_whole || (number, pdu) == (piece[0], &piece[1..]));
                }
            });
            if taken.is_none() {
                break;
            }
        }
        assert!(line.is_empty() && asked == usize::from(is_whole) || !is_whole);
        assert!(framer.deadline() > now);
    }
}

/// Pieces of the stream, each preceded by its length and the pause before it.
fn serial(unit: &mut Unit, mut stream: &[u8]) {
    let mut framer = rtu::Framer::new(Nanos(16));
    let mut now = Nanos::ZERO;
    while let [pause, length, rest @ ..] = stream {
        now = now + Nanos(i64::from(*pause % 32));
        let (piece, after) = rest.split_at(usize::from(*length).min(rest.len()));
        stream = after;
        framer.take(now, |telegram| {
            if let Some((_, pdu)) = telegram.and_then(rtu::parse) {
                unit.ask(pdu);
            }
        });
        // A fuzzer cannot guess checksums: the piece is also tried as a telegram on its own, if its length
        // permits.
        if (2..=PDU_LIMIT + 1).contains(&piece.len()) && *pause >= 128 {
            let mut whole = Vec::new();
            rtu::append(piece[0], &mut whole, |pdu| {
                pdu.extend_from_slice(&piece[1..])
            });
            assert_eq!(rtu::parse(&whole), Some((piece[0], &piece[1..])));
            unit.ask(&piece[1..]);
            framer.arrived(now, &whole);
        } else {
            framer.arrived(now, piece);
        }
        assert!(framer.deadline() > now || piece.is_empty());
    }
}
