//! The example of docs/sdsp.md, byte for byte.

use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_virtual_time::server::Server;
use tickbus_virtual_time::{Logic, Settings, StartCondition, hear, wire};

/// The lines of the example: client, true if sent to the server, bytes.
fn lines(text: &str) -> Vec<(&str, bool, Vec<u8>)> {
    text.lines()
        .filter_map(|line| {
            let (line, _) = line.split_once(';')?;
            let (who, bytes) = line.split_once(['>', '<'])?;
            let bytes = bytes.split_whitespace();
            let bytes = bytes.map(|byte| u8::from_str_radix(byte, 16));
            let bytes: Result<Vec<u8>, _> = bytes.collect();
            Some((who.trim(), line.contains('>'), bytes.ok()?))
        })
        .collect()
}

/// Joins lines that continue the frame of the line before.
fn frames(text: &str) -> Vec<(&str, bool, Vec<u8>)> {
    let mut frames: Vec<(&str, bool, Vec<u8>)> = Vec::new();
    for (who, up, bytes) in lines(text) {
        match frames.last_mut() {
            Some((last, last_up, frame))
                if *last == who
                    && *last_up == up
                    && wire::frame(frame).expect("a frame").is_none() =>
            {
                frame.extend(bytes);
            }
            _ => frames.push((who, up, bytes)),
        }
    }
    frames
}

fn documented() -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../docs/sdsp.md");
    std::fs::read_to_string(file).expect("it is there")
}

/// The server of the example.
fn server() -> Server<'static> {
    let names = ["plc", "tank"].map(str::to_owned).to_vec();
    let settings = Settings {
        steps: Some(1),
        hang: HANG,
        join: HANG,
        ..Settings::new(Nanos::from_millis(10), StartCondition::Names(names))
    };
    Server::new(settings, Logic::new(), Nanos::ZERO).expect("right settings")
}

const HANG: Nanos = Nanos::from_secs(1);

#[test]
fn the_documented_example_is_what_the_server_does() {
    let text = documented();
    let frames = frames(&text);
    assert_eq!(frames.len(), 12, "{frames:02x?}");
    let now = Nanos::ZERO;
    let mut server = server();
    let mut seats: Vec<&str> = Vec::new();
    let mut sent: Vec<(usize, Vec<u8>)> = Vec::new();
    for (who, up, bytes) in &frames {
        let seat = seats.iter().position(|seat| seat == who);
        let seat = seat.unwrap_or_else(|| {
            seats.push(who);
            server.connected(now)
        });
        if *up {
            let frame = wire::frame(bytes).expect("right").expect("complete");
            assert_eq!(bytes.len(), wire::HEADER + frame.len(), "{who}");
            hear(&mut server, now, seat, frame);
            while let Some((seat, message)) = server.poll() {
                let mut out = Vec::new();
                wire::to_client(&mut out, &message);
                sent.push((seat, out));
            }
        } else {
            let at = sent.iter().position(|(to, _)| *to == seat);
            let (_, out) = sent.remove(at.expect("the server has sent something"));
            assert_eq!(out, *bytes, "to {who}: {out:02x?}");
        }
    }
    assert!(sent.is_empty());
    assert!(matches!(server.outcome(), Some(Ok(_))));
}

/// Plays the example to its end, with the client's bytes changed by `change`; frames for a client that has gone are
/// dropped, and silence follows. Returns how the run ended, and whether it hung on a client.
fn play(frames: &[(&str, bool, Vec<u8>)], mut change: impl FnMut(usize, &mut Vec<u8>)) -> Ending {
    let now = Nanos::ZERO;
    let mut server = server();
    let seats = ["tank", "plc"].map(|_| server.connected(now));
    // The received bytes of each client that are no whole frame yet; `None` once the client got the end.
    let mut streams = [Some(Vec::new()), Some(Vec::new())];
    let sent = frames.iter().filter(|(_, up, _)| *up).enumerate();
    for (number, (who, _, bytes)) in sent {
        let at = usize::from(*who == "plc");
        let mut bytes = bytes.clone();
        change(number, &mut bytes);
        if let Some(stream) = &mut streams[at] {
            stream.extend(bytes);
        }
        let mut taken = 0;
        while let Some(stream) = &streams[at] {
            match wire::frame(&stream[taken..]) {
                Ok(Some(frame)) => {
                    taken += wire::HEADER + frame.len();
                    hear(&mut server, now, seats[at], frame);
                }
                Ok(None) => break,
                Err(why) => {
                    server.violated(seats[at], &why);
                    break;
                }
            }
            while let Some((seat, message)) = server.poll() {
                if matches!(message, tickbus_virtual_time::server::ToClient::End(_)) {
                    streams[usize::from(seat != seats[0])] = None;
                }
            }
        }
        if let Some(stream) = &mut streams[at] {
            stream.drain(..taken.min(stream.len()));
        }
    }
    server.tick(HANG);
    server.outcome().expect("no run hangs").clone()
}

type Ending = Result<tickbus_virtual_time::Outcome, tickbus_virtual_time::Ended>;

#[test]
fn any_bit_that_flips_changes_the_hash_or_ends_the_run_with_a_reason() {
    let text = documented();
    let frames = frames(&text);
    let right = play(&frames, |_, _| {}).expect("it is right");
    let sent = frames.iter().filter(|(_, up, _)| *up);
    let lengths: Vec<usize> = sent.map(|(.., bytes)| bytes.len()).collect();
    let mut ended = 0;
    for (number, length) in lengths.iter().enumerate() {
        for bit in 0..8 * length {
            let flip = |at: usize, bytes: &mut Vec<u8>| {
                if at == number {
                    bytes[bit / 8] ^= 1 << (bit % 8);
                }
            };
            match play(&frames, flip) {
                Ok(outcome) => {
                    // The multiple in a run of one step is part of the hash; the client's reads are not.
                    let has_no_effect = match (number, bit / 8) {
                        (0 | 1, byte) if byte > length - 6 => true,
                        // The PLC's multiple, which its interval replaces; the step after the last one.
                        (1, 11..15) | (5, 13..21) => true,
                        _ => false,
                    };
                    assert!(
                        outcome.hash != right.hash || has_no_effect,
                        "{number} {bit}"
                    );
                }
                Err(why) => {
                    assert!(!why.reason.is_empty());
                    ended += 1;
                }
            }
        }
    }
    assert!(ended > 500, "{ended}");
}

#[test]
fn a_client_that_breaks_off_anywhere_is_named() {
    let text = documented();
    let frames = frames(&text);
    let sent: Vec<_> = frames.iter().filter(|(_, up, _)| *up).collect();
    for (number, (who, _, bytes)) in sent.iter().enumerate() {
        for length in 0..bytes.len() {
            let cut = |at: usize, bytes: &mut Vec<u8>| {
                if at == number {
                    bytes.truncate(length);
                } else if at > number {
                    // Nobody gets requests any more.
                    bytes.clear();
                }
            };
            let ended = play(&frames, cut).expect_err("it is cut off");
            assert!(
                ended.to_string().contains(who),
                "{ended} for {who} at {number}"
            );
        }
    }
}
