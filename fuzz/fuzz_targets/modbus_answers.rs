//! A Modbus client's half of the codec: whatever a server answers to whatever it was asked.
//!
//! The first bytes choose what is polled; what follows are answers, each behind its length.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus::fieldbus::modbus::{
    Block, Fault, Identification, Map, PDU_LIMIT, Query, Side, Table, Tables, answer, queries,
};

fuzz_target!(|data: &[u8]| {
    let Some((header, mut answers)) = data.split_first_chunk::<6>() else {
        return;
    };
    let [tables, first, reads, writes, wide, combine] = *header;
    let table = |number: u8| Table::ALL[usize::from(number) % 4];
    let bytes = |number: u8| usize::from(number) * if wide & 1 == 0 { 1 } else { 9 };
    let first = usize::from(first) * 16;
    let read = Block {
        table: table(tables),
        first,
        byte: 0,
        bytes: bytes(reads),
    };
    let written = if tables & 16 == 0 {
        Table::Coils
    } else {
        Table::HoldingRegisters
    };
    let write = Block {
        table: written,
        first,
        byte: 0,
        bytes: bytes(writes),
    };
    let sends: Vec<u8> = (0..write.bytes).map(|byte| byte.to_le_bytes()[0]).collect();
    let mut receives = vec![0; read.bytes];
    for query in queries(&[read], &[write], combine & 1 == 1) {
        let mut request = Vec::new();
        query.append(&sends, &mut request);
        assert!(request.len() <= PDU_LIMIT, "{query}");
        serve(query, &request, &mut receives);
        let Some((length, rest)) = answers.split_first() else {
            continue;
        };
        let (pdu, after) = rest.split_at(usize::from(*length).min(rest.len()));
        answers = after;
        let before = receives.clone();
        match query.take(pdu, &mut receives) {
            Ok(()) => assert_eq!(pdu[0], request[0]),
            Err(fault) => {
                assert_eq!(receives, before, "what is refused brings nothing");
                if let Fault::Refused(_) = fault {
                    assert_eq!(pdu[0], request[0] | 0x80);
                }
            }
        }
    }
});

/// A server of ours takes every request, unless it writes what nobody can.
fn serve(query: Query, request: &[u8], receives: &mut [u8]) {
    let mut holds = vec![0; 0x1_0000];
    let mut tables = Tables {
        map: Map {
            input: Side::Sends,
            window: None,
        },
        sends: &[0x55; 0x1_0000],
        holds_len: holds.len(),
        holds: &mut holds,
    };
    let mut reply = Vec::new();
    let done = answer(request, &mut tables, &Identification::default(), &mut reply);
    assert_eq!(done.refused, None, "{query}");
    query.take(&reply, receives).expect("an honest answer");
}
