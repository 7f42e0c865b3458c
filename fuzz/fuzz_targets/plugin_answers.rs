//! Any bytes as the answers of a helper process: they are accepted or refused without a panic, in the same
//! way however they are split, and what is read is the same after it was written again.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_bus_plugin::Answer;
use tickbus_net::{Inbox, Message, WireError};

fuzz_target!(|data: (u8, &[u8])| {
    let (piece, bytes) = data;
    let (answers, end) = read(bytes, bytes.len().max(1));
    assert_eq!(read(bytes, usize::from(piece).max(1)), (answers.clone(), end));
    let written: Vec<u8> = answers.iter().flat_map(Message::write).collect();
    assert_eq!(read(&written, written.len().max(1)), (answers.clone(), None));
    assert!(answers.iter().all(|answer| answer.write().len() <= Answer::MOST + 4));
});

/// All answers in `bytes`, passed in pieces of `piece` bytes, and how it ended.
fn read(bytes: &[u8], piece: usize) -> (Vec<Answer>, Option<WireError>) {
    let (mut inbox, mut answers) = (Inbox::new(), Vec::new());
    for piece in bytes.chunks(piece) {
        inbox.push(piece);
        loop {
            match inbox.take() {
                Ok(Some(answer)) => answers.push(answer),
                Ok(None) => break,
                Err(error) => return (answers, Some(error)),
            }
        }
    }
    (answers, None)
}
