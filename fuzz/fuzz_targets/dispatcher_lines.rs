//! Any bytes from two clients of a dispatcher, in pieces of any size.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_base::time::Nanos;
use tickbus_dispatcher::{Device, Dispatcher, Patch, Settings};

fuzz_target!(|data: &[u8]| {
    let Some((piece, bytes)) = data.split_first() else {
        return;
    };
    // How the bytes are cut does not change what is answered.
    let whole = talk(bytes, usize::MAX);
    assert_eq!(whole, talk(bytes, 1 + usize::from(*piece)));
    for heard in &whole {
        check(heard);
    }
});

/// Returns the bytes that two clients get, of which the first sends `bytes`.
fn talk(bytes: &[u8], piece: usize) -> [Vec<u8>; 2] {
    let mut dispatcher = Dispatcher::new(Settings::default(), Patch::new());
    let peer = "127.0.0.1:1".parse().expect("an address");
    let mut heard = [Vec::new(), Vec::new()];
    let seats = [0; 2].map(|_| dispatcher.connected(Nanos::ZERO, peer).expect("there is room"));
    dispatcher.arrived(Nanos::ZERO, seats[1], b"VP B Q02 I02 AQ02 AI02\n");
    hear(&mut dispatcher, &seats, &mut heard);
    for piece in bytes.chunks(piece.min(bytes.len().max(1))) {
        if !dispatcher.is_closing(seats[0]) {
            dispatcher.arrived(Nanos::ZERO, seats[0], piece);
            hear(&mut dispatcher, &seats, &mut heard);
        }
    }
    heard
}

/// Lets both clients read until nothing is left to be done.
fn hear(dispatcher: &mut Dispatcher, seats: &[usize; 2], heard: &mut [Vec<u8>; 2]) {
    loop {
        dispatcher.tick(Nanos::ZERO);
        if dispatcher.unsaved().is_some() {
            dispatcher.saved(&Ok(()));
        }
        let mut is_quiet = dispatcher.deadline() > Nanos::ZERO;
        for (seat, heard) in seats.iter().zip(&mut *heard) {
            let bytes = dispatcher.to_write(*seat);
            heard.extend_from_slice(bytes);
            let count = bytes.len();
            if count > 0 {
                is_quiet = false;
                dispatcher.wrote(*seat, count);
            }
        }
        if is_quiet {
            return;
        }
    }
}

/// Every line is one that the protocol has.
fn check(heard: &[u8]) {
    let text = std::str::from_utf8(heard).expect("text");
    assert!(text.is_empty() || text.ends_with("\r\n"));
    for line in text.split_terminator("\r\n") {
        assert!(line.len() <= 4094, "{line}");
        let is_known = ["P ", "OK ", "ERR ", "END ", "NAME "].iter().any(|word| line.starts_with(word));
        assert!(is_known || Device::parse(line.as_bytes()).is_some(), "{line}");
    }
}
