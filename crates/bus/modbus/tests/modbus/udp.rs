//! Modbus over UDP, with hand-written clients.

use std::net::UdpSocket;
use std::time::Duration;

use super::conformance::peers::Alone;
use super::conformance::rig::{await_that, config};
use super::ends::request;
use super::{AnyPort, suffer};
use tickbus_base::time::Nanos;

fn device(further: &str) -> Alone {
    let further = format!("framing = \"udp\"\n{further}");
    let mut device = Alone::open(&config(&AnyPort, "device", &further), &crate::KINDS);
    device.end.tick();
    device
}

/// A client of the device.
fn client(device: &Alone) -> UdpSocket {
    let client = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    client.connect(device.address()).expect("a socket");
    let patience = Duration::from_secs(20);
    client.set_read_timeout(Some(patience)).expect("a socket");
    client
}

/// Sends a datagram, and receives the next one: its transaction and its PDU.
#[track_caller]
fn ask(client: &UdpSocket, transaction: u16, pdu: &[u8]) -> (u16, Vec<u8>) {
    client
        .send(&request(transaction, 1, pdu))
        .expect("it is sent");
    next(client)
}

#[track_caller]
fn next(client: &UdpSocket) -> (u16, Vec<u8>) {
    let mut answer = [0; 300];
    let count = client.recv(&mut answer).expect("an answer");
    let transaction = u16::from_be_bytes([answer[0], answer[1]]);
    (transaction, answer[7..count].to_vec())
}

#[test]
fn each_client_gets_its_answers_and_what_is_no_telegram_gets_none() {
    let mut device = device("unit = 1");
    let [one, two] = [client(&device), client(&device)];
    assert_eq!(ask(&one, 7, &[6, 0, 1, 0, 5]), (7, vec![6, 0, 1, 0, 5]));
    assert_eq!(ask(&two, 9, &[3, 0, 1, 0, 1]), (9, vec![3, 2, 0, 5]));
    device.until_speed(5);
    let whole = request(8, 1, &[6, 0, 1, 0, 6]);
    let long = [&whole[..], &[0]].concat();
    let much = [&whole[..], &[0; 2000]].concat();
    let twice = [&whole[..], &whole].concat();
    for bytes in [&whole[..11], &long, &much, &twice, b"GET / HTTP/1.1", &[]] {
        one.send(bytes).expect("it is sent");
    }
    // The answers are those to whole telegrams alone.
    one.send(&request(10, 2, &[3, 0, 1, 0, 1]))
        .expect("it is sent");
    assert_eq!(next(&one), (10, vec![0x83, 0x0B]));
    assert_eq!(ask(&one, 11, &[3, 0, 1, 0, 1]), (11, vec![3, 2, 0, 5]));
    assert_eq!(device.end.statistic("modbus-server.damaged"), "6");
    assert_eq!(device.end.statistic("modbus-server.unknown_unit"), "1");
}

#[test]
fn there_are_no_more_clients_than_were_allowed_unless_one_is_silent() {
    let mut device = device("clients = 1");
    let [one, two] = [client(&device), client(&device)];
    assert_eq!(ask(&one, 1, &[3, 0, 1, 0, 1]).0, 1);
    two.send(&request(1, 1, &[3, 0, 1, 0, 1]))
        .expect("it is sent");
    device.until("the second one is turned away", |end| {
        end.driver.statistics().contains("clients.turned_away=1")
    });
    device.clock.advance(Nanos::from_secs(1));
    await_that("it gets the place", || {
        two.send(&request(2, 1, &[3, 0, 1, 0, 1]))
            .expect("it is sent");
        two.set_read_timeout(Some(Duration::from_millis(50)))
            .expect("a socket");
        two.recv(&mut [0; 300]).is_ok()
    });
}

#[test]
fn a_late_answer_waits_alone_and_a_wrong_one_has_another_number() {
    let mut device = device("");
    let [one, two] = [client(&device), client(&device)];
    suffer(
        &mut device,
        "kind = \"answer-late\"\nby = \"1s\"\nfunction = 3",
    );
    one.send(&request(1, 1, &[3, 0, 1, 0, 1]))
        .expect("it is sent");
    one.send(&request(2, 1, &[4, 0, 1, 0, 1]))
        .expect("it is sent");
    assert_eq!(ask(&two, 3, &[4, 0, 1, 0, 1]).0, 3);
    one.set_nonblocking(true).expect("a socket");
    assert!(one.recv(&mut [0; 300]).is_err(), "both wait");
    one.set_nonblocking(false).expect("a socket");
    device.clock.advance(Nanos::from_secs(2));
    assert_eq!((next(&one).0, next(&one).0), (1, 2));
    suffer(
        &mut device,
        "kind = \"answer-wrong\"\nhow = \"transaction\"\nfunction = 4",
    );
    assert_eq!(ask(&two, 4, &[4, 0, 1, 0, 1]).0, 5);
}
