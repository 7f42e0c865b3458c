use super::*;
use crate::{Capabilities, Identification, Map, Side, Tables, answer, queries};
use proptest::prelude::*;

const HOLDING: Table = Table::HoldingRegisters;

/// The first bytes of a frame in pieces of one byte, as of an area placed as a whole.
fn image(table: Table, first: usize, bytes: usize) -> Vec<Piece> {
    let piece = |byte| Piece {
        table,
        wire: first * table.width() + 8 * byte,
        bit: 8 * byte,
        bits: 8,
        fills: true,
    };
    (0..bytes).map(piece).collect()
}

fn region(table: Table, first: usize, bytes: usize) -> Region {
    let count = table.elements(bytes);
    let mut region = Region::new(table, Span { first, count });
    for piece in image(table, first, bytes) {
        region.take(piece);
    }
    region
}

/// The two halves of the codec against each other.
#[test]
fn a_server_answers_what_a_client_asks() {
    let image_bytes: Vec<u8> = (0..=255).chain(0..=254).collect();
    let usual = Capabilities::new(true, usize::MAX);
    let apart = Capabilities::new(false, usize::MAX);
    let one_by_one = Capabilities {
        many_coils: false,
        many_registers: false,
        ..apart
    };
    for able in [usual, apart, one_by_one] {
        for (table, at) in [(HOLDING, 1024), (Table::Coils, 16_384)] {
            let (mut held, mut read) = (vec![0; 512], vec![0; 511]);
            for query in queries(&image(table, 0, 511), &image(table, at, 511), &able) {
                let mut tables = Tables {
                    map: &Map::of_areas(Side::Holds, Some(1024), 511, 511),
                    sends: &image_bytes,
                    holds: &mut held,
                };
                let (mut request, mut reply) = (Vec::new(), Vec::new());
                query.append(&image_bytes, &mut request);
                assert!(request.len() <= 253, "{query}");
                let identification = Identification::default();
                let done = answer(&request, &mut tables, &identification, &mut reply);
                assert_eq!(done.refused, None, "{query}");
                assert_eq!(length(&reply), Some(reply.len()), "{query}");
                assert!(reply.len() <= query.answer_length(), "{query}");
                query
                    .take(&request, &reply, &mut read)
                    .expect("the right answer");
            }
            assert_eq!(read, image_bytes);
            assert_eq!(held[..511], image_bytes);
        }
    }
}

#[test]
fn a_mask_writes_the_bits_of_its_pieces_and_leaves_the_others() {
    let bit = |wire, bit| Piece {
        table: HOLDING,
        wire,
        bit,
        bits: 1,
        fills: false,
    };
    // Bits 0 and 9 of register 1: bit 0 of its low byte, and bit 1 of its high one.
    let pieces = [bit(16 + 8, 3), bit(16 + 1, 0)];
    let queries = queries(&[], &pieces, &Capabilities::new(true, 0));
    let [query] = queries.as_slice() else {
        panic!("{queries:?}");
    };
    assert_eq!(
        query.to_string(),
        "write bits 0, 9 of holding-register offset:1 (4x00002) (function 22)"
    );
    let mut request = Vec::new();
    query.append(&[0b1000], &mut request);
    assert_eq!(request, [22, 0, 1, 0xFD, 0xFE, 0, 1]);
    let mut held = [0, 0, 0xAA, 0xAA];
    let mut tables = Tables {
        map: &Map::of_areas(Side::Sends, None, 0, 4),
        sends: &[],
        holds: &mut held,
    };
    let mut reply = Vec::new();
    answer(
        &request,
        &mut tables,
        &Identification::default(),
        &mut reply,
    );
    assert_eq!(query.take(&request, &reply, &mut []), Ok(()));
    assert_eq!(held, [0, 0, 0xA8, 0xAB]);
}

#[test]
fn a_refusal_is_no_malformed_answer() {
    let query = Request::Read(region(HOLDING, 0, 2));
    let refused = query.take(&[], &[0x83, 2], &mut [0, 0]);
    assert_eq!(refused, Err(AnswerError::Refused(Exception(2))));
    for wrong in [
        &[][..],
        &[0x83],
        &[0x83, 2, 0],
        &[4, 2, 0, 0],
        &[3],
        &[3, 2, 0],
        &[3, 2, 0, 0, 0],
        &[3, 4, 0, 0, 0, 0],
        &[3, 1, 0, 0],
    ] {
        let taken = query.take(&[], wrong, &mut [0, 0]);
        assert!(matches!(taken, Err(AnswerError::Malformed(_))), "{wrong:?}");
    }
    let query = Request::Write(region(HOLDING, 1, 2));
    let mut asked = Vec::new();
    query.append(&[0, 7], &mut asked);
    assert_eq!(query.take(&asked, &[16, 0, 1, 0, 1], &mut []), Ok(()));
    for wrong in [&[16, 0, 1, 0, 2][..], &[16, 0, 1, 0], &[16, 0, 1, 0, 1, 0]] {
        let taken = query.take(&asked, wrong, &mut []);
        assert!(matches!(taken, Err(AnswerError::Malformed(_))), "{wrong:?}");
    }
    let query = Request::WriteOne(region(HOLDING, 1, 2));
    let mut asked = Vec::new();
    query.append(&[0, 7], &mut asked);
    assert_eq!(asked, [6, 0, 1, 0, 7]);
    assert_eq!(query.take(&asked, &asked, &mut []), Ok(()));
    let other = query.take(&asked, &[6, 0, 1, 0, 8], &mut []);
    assert!(matches!(other, Err(AnswerError::Malformed(_))), "{other:?}");
}

proptest! {
    #[test]
    fn nothing_that_a_server_says_makes_a_client_panic(
        pdu in prop::collection::vec(any::<u8>(), 0..260), bytes in 1_usize..246, bits: bool, both: bool,
    ) {
        let table = if bits { Table::Coils } else { HOLDING };
        let of = region(table, 0, bytes.min(242));
        let query = if both {
            Request::Both { write: of.clone(), read: of.clone() }
        } else {
            Request::Read(of.clone())
        };
        let mut receives = vec![0; bytes];
        let _ = query.take(&[], &pdu, &mut receives);
        let _ = Request::Write(of).take(&[], &pdu, &mut receives);
        let _ = length(&pdu);
    }
}
