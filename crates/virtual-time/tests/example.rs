//! The example of docs/sdsp.md, byte for byte.

use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_virtual_time::server::Server;
use tickbus_virtual_time::{Logic, Settings, StartCondition, hear, wire};

/// The lines of the example: who, whether it is sent to the server, the bytes.
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

#[test]
fn the_documented_example_is_what_the_server_does() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/sdsp.md");
    let text = std::fs::read_to_string(file).expect("it is there");
    let frames = frames(&text);
    assert_eq!(frames.len(), 12, "{frames:02x?}");
    let names = ["plc", "tank"].map(str::to_owned).to_vec();
    let settings = Settings {
        steps: Some(1),
        ..Settings::new(Nanos::from_millis(10), StartCondition::Names(names))
    };
    let now = Nanos::ZERO;
    let mut server = Server::new(settings, Logic::new(), now).expect("right settings");
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
