//! Polling over UDP, where a datagram can be lost, and as ASCII on a serial line.

use super::*;

/// Unit and PDU of a telegram on a serial line.
#[track_caller]
pub(super) fn unit_and_pdu(coding: Coding, mut telegram: &[u8]) -> (u8, Vec<u8>) {
    let mut bytes = telegram.to_vec();
    if coding == Coding::Ascii {
        let mut framer = ascii::Framer::new(ascii::SILENCE);
        framer.arrived(Nanos::ZERO, &mut telegram);
        let whole = framer.take(Nanos::ZERO, |bytes| bytes.map(<[u8]>::to_vec));
        bytes = whole.expect("a whole one").expect("of usual length");
    }
    let (unit, pdu) = coding.parse(&bytes).expect("undamaged");
    (unit, pdu.to_vec())
}

fn udp() -> Framing {
    Framing::Udp {
        transaction: 0,
        again: Nanos::ZERO,
    }
}

fn ascii() -> Framing {
    Framing::Serial {
        coding: Coding::Ascii,
        inbox: Vec::new(),
        ascii: ascii::Framer::new(ascii::SILENCE),
        character: Nanos(1),
        silence: Nanos::ZERO,
        quiet_until: Nanos::ZERO,
        echo: None,
    }
}

impl Line<'_> {
    fn count(&self, key: &str) -> String {
        self.statistic(key).unwrap_or_default()
    }
}

#[test]
fn a_lost_datagram_is_sent_again_as_it_was_and_the_second_answer_is_not_waited_for() {
    let mut client = Client::new(1, &[register(5)], &[], None);
    let mut line = client.connect(udp());
    assert_eq!(line.asked(), READ);
    let first = line.transaction;
    let began = line.now;
    for _ in 0..2 {
        assert_eq!(line.asked(), READ);
        assert_eq!(line.transaction, first);
    }
    assert_eq!(line.now - began, Nanos(TIMEOUT.0 / 2));
    assert_eq!(line.count("modbus-client.repeated"), "2");
    line.answer(&[3, 2, 0, 7]);
    // The answers to the other two come as well.
    line.answer(&[3, 2, 0, 7]);
    assert_eq!(line.count("modbus-client.unasked"), "1");
    assert_eq!(line.asked(), READ);
    assert_ne!(line.transaction, first);
    line.answer(&[3, 2, 0, 8]);
}

#[test]
fn a_datagram_that_is_no_telegram_harms_nothing() {
    let mut client = Client::new(1, &[register(5)], &[], None);
    let mut line = client.connect(udp());
    assert_eq!(line.asked(), READ);
    let mut long = Vec::new();
    mbap::append(line.transaction, 1, &mut long, |pdu| {
        pdu.extend([3, 2, 0, 9]);
    });
    long.push(0);
    for bytes in [&long[..], &long[..9], b"GET / HTTP/1.1", &[0]] {
        line.hear(bytes).expect("it goes on");
    }
    assert_eq!(line.count("modbus-client.damaged"), "4");
    line.answer(&[3, 2, 0, 7]);
}

#[test]
fn ascii_is_asked_and_heard_in_pieces_and_a_damaged_answer_is_told() {
    let mut client = Client::new(1, &[register(5)], &[], None);
    let mut line = client.connect(ascii());
    assert_eq!(line.asked(), READ);
    let mut answer = b"noise".to_vec();
    ascii::append(1, &mut answer, |pdu| pdu.extend([3, 2, 0, 7]));
    for piece in answer.chunks(3) {
        line.hear(piece).expect("it goes on");
    }
    assert_eq!(line.asked(), READ);
    line.hear(b":0103020007F4\r\n").expect("it goes on");
    assert_eq!(line.count("modbus-client.damaged"), "1");
    assert_eq!(line.asked(), READ);
    line.answer(&[3, 2, 0, 7]);
}
