//! Any bytes as a client's requests to an S7 server, in pieces of any size.
//!
//! Nothing may panic; answers are the same however the bytes are split, well-formed, and within the
//! negotiated length; nothing is written except what was requested within bounds.

#![no_main]

use std::ops::Range;

use libfuzzer_sys::fuzz_target;
use tickbus_bus_s7::item::{ReturnCode, Object};
use tickbus_bus_s7::szl::{Facts, Identity};
use tickbus_bus_s7::pdu::Pdu;
use tickbus_bus_s7::transport::{self, Tpdu};
use tickbus_bus_s7::{ServerSession, ProtocolError, Memory};
use tickbus_base::time::Nanos;

fuzz_target!(|data: (u8, &[u8])| {
    let (piece, bytes) = data;
    let (answers, end) = talk(bytes, bytes.len().max(1));
    assert_eq!(talk(bytes, usize::from(piece).max(1)), (answers.clone(), end));
    check(&answers);
});

/// Outputs and data block 1 on the same bytes, and inputs that cannot be written.
struct Bytes {
    outputs: [u8; 64],
    inputs: [u8; 700],
}

impl Memory for Bytes {
    fn read(&mut self, object: Object, range: Range<usize>) -> Result<&[u8], ReturnCode> {
        let all = match object {
            Object::Inputs => &self.inputs[..],
            Object::Outputs | Object::Block(1) => &self.outputs[..],
            _ => return Err(ReturnCode::MISSING),
        };
        all.get(range).ok_or(ReturnCode::ADDRESS)
    }

    fn write(&mut self, object: Object, first: usize, values: &[u8]) -> Result<(), ReturnCode> {
        let outputs = match object {
            Object::Outputs | Object::Block(1) => &mut self.outputs,
            Object::Inputs => return Err(ReturnCode::ACCESS),
            _ => return Err(ReturnCode::MISSING),
        };
        outputs.get_mut(first..first + values.len()).ok_or(ReturnCode::ADDRESS)?.copy_from_slice(values);
        Ok(())
    }

    fn write_bit(&mut self, object: Object, byte: usize, bit: u8, on: bool) -> Result<(), ReturnCode> {
        assert!(bit < 8);
        let before = *self.outputs.get(byte).ok_or(ReturnCode::ADDRESS)?;
        self.write(object, byte, &[before & !(1 << bit) | u8::from(on) << bit])
    }

    fn done(&mut self) {}

    fn blocks(&self) -> &[(u16, usize)] {
        &[(1, 64)]
    }
}

/// All answers to `bytes`, passed in pieces of `piece` bytes, and how it ended.
fn talk(bytes: &[u8], piece: usize) -> (Vec<u8>, Option<ProtocolError>) {
    let mut conversation = ServerSession::default();
    let mut memory = Bytes { outputs: [0; 64], inputs: [7; 700] };
    let facts = Facts { identity: Identity::of_driver("fuzz"), pdu: 480, clients: 1, epoch: Facts::NEVER_SET };
    let (mut begun, mut answers) = (Vec::new(), Vec::new());
    for piece in bytes.chunks(piece) {
        begun.extend_from_slice(piece);
        loop {
            let mut reply = Vec::new();
            match conversation.packet(Nanos::ZERO, &begun, &facts, &mut memory, &mut reply) {
                Ok(0) => break,
                Ok(taken) => drop(begun.drain(..taken)),
                Err(fault) => return (answers, Some(fault)),
            }
            answers.extend_from_slice(&reply);
        }
    }
    (answers, None)
}

/// The answers are packets with whole PDUs.
fn check(mut answers: &[u8]) {
    let mut message = Vec::new();
    while !answers.is_empty() {
        let (length, tpdu) = transport::read(answers).expect("well made").expect("whole");
        answers = &answers[length..];
        match tpdu {
            Tpdu::ConnectConfirm(_) => {}
            Tpdu::Data { last, bytes } => {
                message.extend_from_slice(bytes);
                if last {
                    assert!(message.len() <= 960);
                    Pdu::read(&message).expect("well made");
                    message.clear();
                }
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(message.is_empty());
}
