//! RTU over TCP.

use super::*;

fn rtu_over_tcp() -> Framing {
    Framing::RtuOverTcp { inbox: Vec::new() }
}

#[test]
fn rtu_telegrams_in_a_stream_may_be_cut_and_merged_and_come_late() {
    let mut client = Client::new(2, &[register(5)], &[], None);
    let mut line = client.connect(rtu_over_tcp());
    assert_eq!(line.asked_of(), (1, READ.to_vec()));
    for byte in seven(1) {
        line.hear(&[byte]).expect("it goes on");
    }
    // There is no need to wait for silence: the next request goes out at once.
    assert_eq!(line.poll.to_write(line.now)[0], 2);
    assert_eq!(line.asked_of(), (2, READ.to_vec()));
    line.stay_silent();
    assert_eq!(line.asked_of(), (1, READ.to_vec()));
    let late = seven(2);
    line.hear(&late[..3]).expect("it goes on");
    let merged = [&late[3..], &seven(1)].concat();
    line.hear(&merged).expect("it goes on");
    assert_eq!(
        line.statistic("modbus-client.unasked").as_deref(),
        Some("1")
    );
    assert_eq!(line.asked_of(), (1, READ.to_vec()), "it was answered");
}

#[test]
fn a_damaged_telegram_or_silence_ends_a_stream_of_rtu() {
    let mut client = Client::new(1, &[register(5)], &[], None);
    let mut flipped = seven(1);
    flipped[3] ^= 1;
    for (bytes, expected) in [
        (
            &flipped[..],
            "of the line: its telegram has a wrong checksum",
        ),
        (&[1, 66], "of the line: its telegram has the function 66"),
    ] {
        let mut line = client.connect(rtu_over_tcp());
        assert_eq!(line.asked(), READ);
        let heard = line.hear(bytes).expect_err("no telegram");
        assert!(matches!(heard, BusError::Protocol(_)), "{heard:?}");
        assert!(heard.to_string().contains(expected), "{heard}");
    }
    let mut line = client.connect(rtu_over_tcp());
    assert_eq!(line.asked(), READ);
    line.stay_silent();
    let turned = line.poll.turn(line.now, line.port);
    assert!(matches!(turned, Err(BusError::Link(_))), "{turned:?}");
}
