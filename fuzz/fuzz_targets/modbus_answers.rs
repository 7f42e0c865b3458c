//! The client's half of the Modbus codec: addresses as people write them, requests planned for signals
//! anywhere, and arbitrary answers to them.
//!
//! The first bytes are the device's capabilities and the number of signals, each of which has five bytes; then
//! come answers, each preceded by its length. The same input is also read as the text of an address.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_bus_modbus::{
    Capabilities, AnswerError, Identification, Map, PDU_LIMIT, Piece, Request, Side, TagAddress, Table, Tables,
    answer, queries,
};

fuzz_target!(|data: &[u8]| {
    if let Ok(text) = std::str::from_utf8(data) {
        address(text);
    }
    let Some((&[flags, gap, reads, writes], rest)) = data.split_first_chunk::<4>() else {
        return;
    };
    let able = Capabilities {
        many_coils: flags & 2 == 0,
        many_registers: flags & 4 == 0,
        ..Capabilities::new(flags & 1 == 1, usize::from(gap) * 16)
    };
    let (reads, rest) = pieces(usize::from(reads % 64), rest, false);
    let (writes, mut answers) = pieces(usize::from(writes % 64), rest, true);
    let sends: Vec<u8> = (0..length(&writes)).map(|byte| byte.to_le_bytes()[0]).collect();
    let mut receives = vec![0; length(&reads)];
    for query in queries(&reads, &writes, &able) {
        let mut request = Vec::new();
        query.append(&sends, &mut request);
        assert!(request.len() <= PDU_LIMIT, "{query}");
        serve(&query, &request, &mut receives);
        let Some((length, rest)) = answers.split_first() else {
            continue;
        };
        let (pdu, after) = rest.split_at(usize::from(*length).min(rest.len()));
        answers = after;
        let before = receives.clone();
        match query.take(&request, pdu, &mut receives) {
            Ok(()) => assert_eq!(pdu[0], request[0]),
            Err(fault) => {
                assert_eq!(receives, before, "what is refused brings nothing");
                if let AnswerError::Refused(_) = fault {
                    assert_eq!(pdu[0], request[0] | 0x80);
                }
            }
        }
    }
});

/// A valid address is also valid in the notation used in messages.
fn address(text: &str) {
    let Ok(spot) = text.parse::<TagAddress>() else {
        return;
    };
    let place = spot.place;
    assert!(place.offset < 0x1_0000);
    assert!(spot.bit.is_none_or(|bit| bit < 16 && !place.table.is_bits()));
    let element = place.table.element();
    for same in [
        format!("{element} offset:{}", place.offset),
        format!("{element}:{}", place.offset + 1),
        format!("{}{:05}", place.table.digit(), place.offset + 1),
    ] {
        assert_eq!(same.parse::<TagAddress>().map(|spot| spot.place), Ok(place));
    }
}

/// Signals at consecutive places in the frame; those that are written do not overlap.
fn pieces(count: usize, mut data: &[u8], writes: bool) -> (Vec<Piece>, &[u8]) {
    let (mut pieces, mut frame) = (Vec::<Piece>::new(), 0_usize);
    for _ in 0..count {
        let Some((&[table, high, low, size, within], rest)) = data.split_first_chunk::<5>() else {
            break;
        };
        data = rest;
        let table = if writes {
            [Table::Coils, Table::HoldingRegisters][usize::from(table % 2)]
        } else {
            Table::ALL[usize::from(table % 4)]
        };
        let first = usize::from(u16::from_be_bytes([high, low]) % 0x7FF0);
        let bits = if table.is_bits() { 1 } else { [1, 8, 16, 32, 64][usize::from(size % 5)] };
        let fills = size & 128 != 0;
        let within = match (table.is_bits(), bits, fills) {
            (true, ..) => 0,
            (_, 1, _) => usize::from(within % 16),
            (_, 8, _) | (_, _, true) => usize::from(within % 2) * 8,
            _ => 0,
        };
        if bits > 1 {
            frame = frame.next_multiple_of(8);
        }
        let piece = Piece {
            table,
            wire: first * table.width() + within,
            bit: frame,
            bits,
            fills,
        };
        // Rounded to whole registers, so that no two share one.
        let meets = |other: &Piece| {
            let (one, two) = (piece.span(), other.span());
            other.table == table && one.first < two.end() && two.first < one.end()
        };
        if writes && pieces.iter().any(meets) {
            continue;
        }
        frame += bits;
        pieces.push(piece);
    }
    (pieces, data)
}

/// The length of frame that these signals need.
fn length(pieces: &[Piece]) -> usize {
    let ends = pieces.iter().map(|piece| (piece.bit + piece.bits).div_ceil(8));
    ends.max().unwrap_or_default()
}

/// Our server accepts every request, and only what the query says changes in it.
fn serve(query: &Request, request: &[u8], receives: &mut [u8]) {
    const BEFORE: [u8; 0x1_0000] = [0x55; 0x1_0000];
    let mut holds = BEFORE.to_vec();
    let map = Map::of_areas(Side::Sends, None, BEFORE.len(), BEFORE.len());
    let mut tables = Tables {
        map: &map,
        sends: &BEFORE,
        holds: &mut holds,
    };
    let mut reply = Vec::new();
    let done = answer(request, &mut tables, &Identification::default(), &mut reply);
    assert_eq!(done.refused, None, "{query}");
    query
        .take(request, &reply, receives)
        .expect("an honest answer");
    let Some(write) = query.write() else {
        assert!(holds == BEFORE, "{query}");
        return;
    };
    let width = write.table.width();
    let all = write.span.first * width..write.span.end() * width;
    let is_masked = matches!(query, Request::Mask(_));
    let is_own = |bit: usize| {
        let mut own = write.pieces.iter();
        if is_masked {
            own.any(|piece| (piece.wire..piece.wire + piece.bits).contains(&bit))
        } else {
            all.contains(&bit)
        }
    };
    // What is the same is compared at once, in pieces: there is much of it.
    const PIECE: usize = 64;
    let pieces = holds.chunks(PIECE).zip(BEFORE.chunks(PIECE)).enumerate();
    for (piece, (now, before)) in pieces.filter(|(_, (now, before))| now != before) {
        for (at, (now, before)) in now.iter().zip(before).enumerate() {
            for bit in 0..8 {
                let is_kept = now >> bit & 1 == before >> bit & 1;
                let place = (piece * PIECE + at) * 8 + bit;
                assert!(is_kept || is_own(place), "{query} changes another bit");
            }
        }
    }
}
