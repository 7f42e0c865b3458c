use std::collections::BTreeSet;

use super::*;
use crate::PDU_LIMIT;
use proptest::prelude::*;

const HOLDING: Table = Table::HoldingRegisters;
const USUAL: Capabilities = Capabilities::new(true, usize::MAX);

fn piece(table: Table, wire: usize, bit: usize, bits: usize, fills: bool) -> Piece {
    Piece {
        table,
        wire,
        bit,
        bits,
        fills,
    }
}

/// The first `count` words of a frame, in consecutive registers.
fn words(table: Table, first: usize, count: usize) -> Vec<Piece> {
    let word = |word| piece(table, (first + word) * 16, word * 16, 16, true);
    (0..count).map(word).collect()
}

/// The queries as in messages.
fn told(queries: &[Request]) -> Vec<String> {
    queries.iter().map(Request::to_string).collect()
}

fn spans(queries: &[Request]) -> Vec<(usize, usize)> {
    let span = |query: &Request| {
        let region = query.write().or(query.read()).expect("it does one of both");
        (region.span.first, region.span.count)
    };
    queries.iter().map(span).collect()
}

#[test]
fn an_image_is_split_at_the_limits_of_each_function() {
    let write = queries(&[], &words(HOLDING, 10, 200), &USUAL);
    assert_eq!(spans(&write), [(10, 123), (133, 77)]);
    let bits = |table, first, count| -> Vec<Piece> {
        let bit = |bit| piece(table, first + bit, bit, 1, true);
        (0..count).map(bit).collect()
    };
    let coils = queries(&[], &bits(Table::Coils, 3, 2400), &USUAL);
    assert_eq!(spans(&coils), [(3, 1968), (1971, 432)]);
    let inputs = queries(&bits(Table::DiscreteInputs, 0, 2001), &[], &USUAL);
    assert_eq!(spans(&inputs), [(0, 2000), (2000, 1)]);
    let inputs = queries(&words(Table::InputRegisters, 0, 127), &[], &USUAL);
    assert_eq!(spans(&inputs), [(0, 125), (125, 2)]);
    assert!(queries(&[], &[], &USUAL).is_empty());
}

#[test]
fn one_request_writes_and_reads_where_both_are_holding_registers() {
    let (reads, writes) = (words(HOLDING, 0, 64), words(HOLDING, 1024, 64));
    assert_eq!(
        told(&queries(&reads, &writes, &USUAL)),
        [
            "write holding-register offset:1024 (4x01025) to 1087 and read holding-register offset:0 (4x00001) to 63 \
             (function 23)"
        ]
    );
    let apart = queries(&reads, &writes, &Capabilities::new(false, 0));
    assert_eq!(
        told(&apart),
        [
            "write holding-register offset:1024 (4x01025) to 1087 (function 16)",
            "read holding-register offset:0 (4x00001) to 63 (function 3)"
        ]
    );
    let inputs = words(Table::InputRegisters, 0, 64);
    assert_eq!(queries(&inputs, &writes, &USUAL).len(), 2);
    let long = queries(&reads, &words(HOLDING, 1024, 122), &USUAL);
    assert_eq!(spans(&long), [(1024, 121), (1145, 1)]);
    assert!(long[0].read().is_some() && long[1].read().is_none());
}

#[test]
fn no_value_is_divided_between_two_requests_if_that_can_be() {
    // Values of four registers: 30 fit into a request, which writes 123 registers.
    let longs: Vec<Piece> = (0..40)
        .map(|n| piece(HOLDING, 64 * n, 64 * n, 64, true))
        .collect();
    assert_eq!(spans(&queries(&[], &longs, &USUAL)), [(0, 120), (120, 40)]);
    assert_eq!(spans(&queries(&longs, &[], &USUAL)), [(0, 124), (124, 36)]);
}

#[test]
fn gaps_are_read_and_never_written() {
    let two = [
        piece(HOLDING, 100 * 16, 0, 16, true),
        piece(HOLDING, 104 * 16, 64, 16, true),
    ];
    assert_eq!(spans(&queries(&two, &[], &USUAL)), [(100, 5)]);
    let far = Capabilities::new(true, 2 * 16);
    assert_eq!(spans(&queries(&two, &[], &far)), [(100, 1), (104, 1)]);
    assert_eq!(spans(&queries(&[], &two, &USUAL)), [(100, 1), (104, 1)]);
    let coils = [
        piece(Table::Coils, 7, 0, 1, true),
        piece(Table::Coils, 9, 1, 1, true),
    ];
    assert_eq!(spans(&queries(&[], &coils, &USUAL)), [(7, 1), (9, 1)]);
}

#[test]
fn a_register_of_which_signals_have_some_bits_is_masked_and_one_of_which_they_have_all_is_written()
{
    let bit = |bit| piece(HOLDING, 16 + bit, bit, 1, false);
    let some: Vec<Piece> = (0..15).map(bit).collect();
    assert_eq!(
        told(&queries(&[], &some[..1], &USUAL)),
        ["write bit 8 of holding-register offset:1 (4x00002) (function 22)"]
    );
    assert!(matches!(
        queries(&[], &some, &USUAL).as_slice(),
        [Request::Mask(_)]
    ));
    let all: Vec<Piece> = (0..16).map(bit).collect();
    assert_eq!(
        told(&queries(&[], &all, &USUAL)),
        ["write holding-register offset:1 (4x00002) (function 16)"]
    );
}

#[test]
fn a_device_without_the_functions_for_many_is_written_one_by_one() {
    let able = Capabilities {
        many_coils: false,
        many_registers: false,
        ..USUAL
    };
    let coils = [
        piece(Table::Coils, 4, 0, 1, true),
        piece(Table::Coils, 5, 1, 1, true),
    ];
    assert_eq!(
        told(&queries(&[], &coils, &able)),
        [
            "write coil offset:4 (0x00005) (function 5)",
            "write coil offset:5 (0x00006) (function 5)"
        ]
    );
    let both = queries(&words(HOLDING, 0, 1), &words(HOLDING, 8, 2), &able);
    assert_eq!(
        told(&both),
        [
            "write holding-register offset:8 (4x00009) (function 6)",
            "write holding-register offset:9 (4x00010) (function 6)",
            "read holding-register offset:0 (4x00001) (function 3)"
        ]
    );
}

/// Consecutive signals of a frame, anywhere in a table; those that are written do not overlap.
fn pieces(writes: bool) -> impl Strategy<Value = Vec<Piece>> {
    let one = (
        0_usize..4,
        0_usize..700,
        0_usize..6,
        any::<bool>(),
        0_usize..16,
    );
    prop::collection::vec(one, 0..120).prop_map(move |all| {
        let (mut pieces, mut frame) = (Vec::new(), 0_usize);
        let mut claimed = BTreeSet::new();
        for (table, first, size, fills, within) in all {
            let table = if writes {
                [Table::Coils, HOLDING][table % 2]
            } else {
                Table::ALL[table]
            };
            let bits = if table.is_bits() {
                1
            } else {
                [1, 8, 16, 32, 64, 64][size]
            };
            // A piece of a whole area may start at any byte, a separately placed one only at a register.
            let within = match (table.is_bits(), bits, fills) {
                (true, ..) => 0,
                (_, 1, _) => within,
                (_, 8, _) | (_, _, true) => within / 8 * 8,
                _ => 0,
            };
            if bits >= 8 {
                frame = frame.next_multiple_of(8);
            }
            let piece = piece(table, first * table.width() + within, frame, bits, fills);
            let claim = piece.claim().map(|bit| (table.digit(), bit));
            if writes && claim.clone().any(|bit| claimed.contains(&bit)) {
                continue;
            }
            claimed.extend(claim);
            frame += bits;
            pieces.push(piece);
        }
        pieces
    })
}

proptest! {
    /// Every signal is read and written once, nothing else is written, and all limits are kept.
    #[test]
    fn a_plan_carries_every_signal_once_and_touches_nothing_that_none_names(
        reads in pieces(false), writes in pieces(true), combine: bool, gap in 0_usize..600, many: bool,
    ) {
        let able = Capabilities { many_coils: many, many_registers: many, ..Capabilities::new(combine, gap) };
        let queries = queries(&reads, &writes, &able);
        let long = |pieces: &[Piece]| pieces.iter().map(|piece| piece.bit + piece.bits).max().unwrap_or(0);
        let sends: Vec<u8> = (0..long(&writes).div_ceil(8)).map(|byte| byte.to_le_bytes()[0] | 1).collect();
        let (mut read, mut written) = (BTreeSet::new(), BTreeSet::new());
        let mut touched = BTreeSet::new();
        for query in &queries {
            let mut pdu = Vec::new();
            query.append(&sends, &mut pdu);
            prop_assert!(pdu.len() <= PDU_LIMIT, "{query}");
            prop_assert!(query.answer_length() <= PDU_LIMIT, "{query}");
            let carry = |region: &Region, carried: &mut BTreeSet<(usize, char, usize)>| {
                for piece in &region.pieces {
                    for n in 0..piece.bits {
                        let is_new = carried.insert((piece.bit + n, region.table.digit(), piece.wire + n));
                        assert!(is_new, "{query} carries a bit again");
                    }
                }
            };
            if let Some(region) = query.read() {
                let most = if region.table.is_bits() { 2000 } else { 125 };
                prop_assert!((1..=most).contains(&region.span.count), "{query}");
                carry(region, &mut read);
            }
            if let Some(region) = query.write() {
                let most = match query {
                    Request::Both { .. } => 121,
                    Request::WriteOne(_) | Request::Mask(_) => 1,
                    _ if region.table.is_bits() => 1968,
                    _ => 123,
                };
                prop_assert!((1..=most).contains(&region.span.count), "{query}");
                carry(region, &mut written);
                let width = region.table.width();
                let begin = region.span.first * width;
                if matches!(query, Request::Mask(_)) {
                    let of = |piece: &Piece| piece.wire..piece.wire + piece.bits;
                    touched.extend(region.pieces.iter().flat_map(of).map(|bit| (region.table.digit(), bit)));
                } else {
                    let all = begin..begin + region.span.count * width;
                    touched.extend(all.map(|bit| (region.table.digit(), bit)));
                }
            }
        }
        let bits = |pieces: &[Piece]| -> BTreeSet<(usize, char, usize)> {
            let of = |piece: &Piece| {
                let piece = *piece;
                (0..piece.bits).map(move |n| (piece.bit + n, piece.table.digit(), piece.wire + n))
            };
            pieces.iter().flat_map(of).collect()
        };
        prop_assert_eq!(read, bits(&reads));
        prop_assert_eq!(written, bits(&writes));
        let claims = writes.iter().flat_map(|piece| {
            let digit = piece.table.digit();
            piece.claim().map(move |bit| (digit, bit))
        });
        prop_assert_eq!(touched, claims.collect::<BTreeSet<_>>());
    }
}
