//! The socket bus: the conformance suite, and its own tests with foreign peers.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::time::Duration;
use tickbus_conformance as conformance;
use tickbus_conformance::conformance;

use crate::ends::{KINDS, RECORD, Tcp, device, record};
use conformance::peers::{Alone, client, is_closed, leave};
use conformance::rig::{CYCLE, End, MAX_AGE, await_that, config, logged, pass, patiently};
use socket2::SockRef;
use tickbus_base::time::{Manual, Nanos};
use tickbus_driver::Code;
use tickbus_fieldbus::LinkState;

conformance!(cyclic, crate::ends::Tcp::new("", ""));
conformance!(
    on_change,
    crate::ends::Tcp::new("send = \"on-change\"", "send = \"on-change\"")
);
conformance!(reply, crate::ends::Tcp::new("send = \"reply\"", ""));
conformance!(
    device_connects,
    crate::ends::Tcp::new("role_tcp = \"connect\"", "role_tcp = \"listen\"")
);

#[test]
fn a_record_that_comes_byte_by_byte_is_one_record() {
    let (mut device, address) = device("");
    let mut peer = client(address);
    for byte in record(258) {
        peer.write_all(&[byte]).expect("the device reads");
    }
    device.until_speed(258);
    assert_eq!(device.end.statistic("bus_cycles"), "1");
}

#[test]
fn what_a_browser_sends_is_no_record() {
    let (mut device, address) = device("");
    let body = "a".repeat(20 * RECORD);
    for head in [
        b"POST / HTTP/1.1\r\nContent-Type: text/plain\r\n\r\n".as_slice(),
        // With https:, and to a relay of WebRTC.
        b"\x16\x03\x01\x07\x6b\x01\x00\x07\x67\x03\x03",
        b"\x00\x03\x00\x08\x21\x12\xa4\x42",
    ] {
        let mut browser = client(address);
        browser
            .write_all(&[head, body.as_bytes()].concat())
            .expect("it is taken");
        let at = browser.local_addr().expect("it is connected");
        device.until_reason(&format!("refused {at}: this is an HTTP request"));
        assert_eq!(device.end.statistic("bus_cycles"), "0");
    }
    let mut plc = client(address);
    plc.write_all(&record(1)).expect("the device reads");
    device.until_speed(1);
}

#[test]
fn records_that_come_together_are_handed_in_one_by_one() {
    let (mut device, address) = device("events = true");
    let mut peer = client(address);
    let three = [record(1), record(2), record(3)].concat();
    peer.write_all(&three).expect("the device reads");
    device.until_speed(3);
    assert_eq!(device.end.statistic("bus_cycles"), "3");
    let mut events = [tickbus_image::Event::default(); 16];
    let count = device.end.driver.poll_events(&mut events);
    let speeds = events[..count].iter().filter(|event| event.signal == 1);
    let speeds: Vec<f64> = speeds.map(|event| event.value.real()).collect();
    assert_eq!(speeds, [1.0, 2.0, 3.0]);
}

#[test]
fn stations_follow_one_another_in_a_record() {
    let mut device = Alone::open(
        "[driver]\nid = 1\nname = \"two\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
         send = \"reply\"\nmax_age = \"24h\"\n[[station]]\nname = \"a\"\n[[station]]\nname = \"b\"\n\
         [[signal]]\nname = \"from a\"\nstation = \"a\"\naddress = \"%IB0\"\n\
         [[signal]]\nname = \"to b\"\nstation = \"b\"\naddress = \"%QW0\"\n\
         [[signal]]\nname = \"to a\"\nstation = \"a\"\naddress = \"%QB0\"\n\
         [[signal]]\nname = \"from b\"\nstation = \"b\"\naddress = \"%IW0\"\n",
        &KINDS,
    );
    let mut peer = client(device.address());
    device.end.set("from a", 1.0);
    device.end.set("from b", 515.0);
    device.end.tick();
    peer.write_all(&[9, 1, 2]).expect("the device reads");
    let mut reply = [0; 3];
    peer.read_exact(&mut reply).expect("a reply");
    assert_eq!(reply, [1, 2, 3]);
    device.end.tick();
    assert_eq!(
        (device.end.get("to a"), device.end.get("to b")),
        (9.0, 258.0)
    );
}

#[test]
fn a_peer_that_leaves_within_a_record_is_told_by_its_bytes() {
    let (mut device, address) = device("");
    let mut peer = client(address);
    peer.write_all(&record(7)).expect("the device reads");
    device.until_speed(7);
    peer.write_all(&record(8)[..4]).expect("the device reads");
    leave(peer);
    let cause = device.until_reason("left in the middle of a record: 4 of 6 bytes had come");
    assert_eq!(cause, "protocol");
    assert_eq!(device.end.get("speed"), 7.0, "half a record does not count");
    assert_eq!(device.end.link().state, LinkState::Opening);
}

/// A stream of two records, truncated after every byte.
#[test]
fn every_truncation_of_a_stream_is_told_as_what_it_is() {
    let stream = [record(7), record(8)].concat();
    for cut in 0..=stream.len() {
        let (mut device, address) = device("");
        let mut peer = client(address);
        peer.write_all(&stream[..cut]).expect("the device reads");
        leave(peer);
        let (words, cause) = match (cut, cut % RECORD) {
            (0, _) => ("before it had sent anything".to_owned(), "left"),
            (_, 0) => ("closed the connection; listening".to_owned(), "left"),
            (_, rest) => (format!(": {rest} of 6 bytes had come"), "protocol"),
        };
        assert_eq!(device.until_reason(&words), cause, "{cut} bytes");
        let cycles = (cut / RECORD).to_string();
        assert_eq!(device.end.statistic("bus_cycles"), cycles, "{cut} bytes");
    }
}

#[test]
fn a_record_left_incomplete_ends_the_connection_after_max_age() {
    let (mut device, address) = device("");
    let mut peer = client(address);
    peer.write_all(&record(7)[..3]).expect("the device reads");
    let cause = device.until_reason("did not complete it within 300ms: 3 of 6 bytes have come");
    assert_eq!(cause, "protocol");
    await_that("the connection is closed", || is_closed(&peer));
}

#[test]
fn a_client_that_says_nothing_is_given_up_after_four_max_ages() {
    let (mut device, address) = device("");
    let peer = client(address);
    device.until_reason("has connected; waiting for its first record");
    let before = device.now();
    let cause = device.until_reason("has been silent for 1200ms");
    assert_eq!(cause, "link");
    assert!(device.now() - before >= MAX_AGE.times(4));
    await_that("the connection is closed", || is_closed(&peer));
    assert_eq!(device.end.statistic("link.running"), "0");
    assert_eq!(
        device.end.link().state,
        LinkState::Opening,
        "it listens again"
    );
}

#[test]
fn a_client_that_falls_silent_is_stale_first_and_then_given_up() {
    let (mut device, address) = device("");
    let mut peer = client(address);
    peer.write_all(&record(7)).expect("the device reads");
    device.until_speed(7);
    assert_eq!(device.end.link().state, LinkState::Running);
    device.until("the line is stale", |end| {
        end.link().state == LinkState::Stale
    });
    assert!(!is_closed(&peer), "it has the time to come back");
    peer.write_all(&record(8)).expect("the device reads");
    device.until("the line runs again", |end| {
        end.link().state == LinkState::Running
    });
    device.until_reason("has been silent for 1200ms");
    assert!(is_closed(&peer));
}

#[test]
fn a_client_that_never_reads_is_given_up_with_its_byte_count() {
    let text = "[driver]\nid = 1\nname = \"large\"\n[fieldbus]\nkind = \"socket\"\n\
                address = \"127.0.0.1:0\"\ncycle = \"1ms\"\nmax_age = \"300ms\"\n\
                input_bytes = 65536\n[[signal]]\nname = \"in\"\naddress = \"%IW0\"\n\
                [[signal]]\nname = \"speed\"\naddress = \"%QW0\"\n";
    let mut device = Alone::open(text, &KINDS);
    let mut peer = client(device.address());
    let clock = std::sync::Arc::clone(&device.clock);
    let mut reason = String::new();
    // Some hundred cycles, and not one.
    let given_up = patiently(|| {
        // The peer sends, so it is not silent, but it does not read.
        let _ = peer.write_all(&[0, 1]);
        pass(&clock, 1);
        device.end.tick();
        reason = device.end.link().reason;
        reason.contains("does not read").then_some(())
    });
    assert!(given_up.is_some(), "{reason}");
    assert!(reason.contains("of 65536 bytes within 300ms"), "{reason}");
    assert_eq!(device.end.link().cause.name(), "link");
    let skipped: u64 = device
        .end
        .statistic("socket.skipped")
        .parse()
        .expect("a number");
    assert!(skipped >= 299, "{skipped} cycles were skipped");
}

#[test]
fn a_second_client_is_turned_away_and_the_first_goes_on() {
    logged::expect("was turned away");
    let (mut device, address) = device("");
    let mut first = client(address);
    first.write_all(&record(1)).expect("the device reads");
    device.until_speed(1);
    for turned_away in 1..=3 {
        let second = client(address);
        await_that("the second is turned away", || is_closed(&second));
        let counted = format!("socket.turned_away={turned_away}\n");
        await_that("it is counted", || {
            device.end.driver.statistics().contains(&counted)
        });
    }
    first.write_all(&record(2)).expect("the device reads");
    device.until_speed(2);
    assert_eq!(device.end.statistic("link.running"), "1");
}

#[test]
fn a_second_client_takes_the_place_of_a_silent_one() {
    let (mut device, address) = device("");
    let mut first = client(address);
    first.write_all(&record(1)).expect("the device reads");
    device.until_speed(1);
    device.until("the first is stale", |end| end.tick().code == Code::Stale);
    let mut second = client(address);
    second.write_all(&record(2)).expect("the device reads");
    device.until_speed(2);
    assert!(is_closed(&first));
    assert_eq!(device.end.statistic("cause.link"), "1");
    assert!(!device.end.driver.statistics().contains("turned_away"));
}

#[test]
fn a_client_that_comes_back_at_once_is_not_turned_away() {
    let (mut device, address) = device("");
    for speed in 1..=50 {
        let mut peer = client(address);
        peer.write_all(&record(speed)).expect("the device reads");
        device.until_speed(speed);
        // More than one read takes, right before the peer leaves and returns.
        let many = record(speed).repeat(8_000);
        peer.write_all(&many).expect("the device reads");
    }
    let mut last = client(address);
    last.write_all(&record(99)).expect("the device reads");
    device.until_speed(99);
    assert!(!device.end.driver.statistics().contains("turned_away"));
    assert_eq!(device.address(), address, "the listener has stayed");
    assert_eq!(device.end.statistic("link.running"), "51");
}

#[test]
fn a_reset_connection_is_lost_and_the_next_one_served() {
    let (mut device, address) = device("");
    let mut peer = client(address);
    peer.write_all(&record(1)).expect("the device reads");
    device.until_speed(1);
    SockRef::from(&peer)
        .set_linger(Some(Duration::ZERO))
        .expect("a TCP option");
    drop(peer);
    assert_eq!(device.until_reason("broke ("), "link");
    let mut next = client(address);
    next.write_all(&record(2)).expect("the device reads");
    device.until_speed(2);
}

#[test]
fn a_client_that_closes_in_good_order_has_left() {
    let (mut device, address) = device("");
    let mut peer = client(address);
    peer.write_all(&record(1)).expect("the device reads");
    device.until_speed(1);
    leave(peer);
    let cause = device.until_reason("closed the connection; listening on 127.0.0.1:");
    assert_eq!(cause, "left");
}

#[test]
fn a_device_that_replies_says_nothing_by_itself_and_answers_each_record() {
    let (mut device, address) = device("send = \"reply\"");
    let mut peer = client(address);
    device.end.set("position", 513.0);
    device.end.tick();
    for _ in 0..20 {
        pass(&device.clock, 1);
    }
    let mut reply = [0xFF; RECORD];
    peer.write_all(&record(5)).expect("the device reads");
    peer.read_exact(&mut reply).expect("a reply");
    assert_eq!(reply, [0, 0, 2, 1, 0, 0]);
    let three = [record(6), record(7), record(8)].concat();
    peer.write_all(&three).expect("the device reads");
    let mut replies = [0; 3 * RECORD];
    peer.read_exact(&mut replies).expect("three replies");
    device.until_speed(8);
    assert_eq!(device.end.statistic("bus_cycles"), "4");
    peer.set_nonblocking(true).expect("a TCP option");
    assert!(peer.read(&mut reply).is_err(), "and not one more");
}

#[test]
fn on_change_sends_what_has_left_its_dead_band_and_signs_of_life() {
    let text = "[driver]\nid = 1\nname = \"band\"\n[fieldbus]\nkind = \"socket\"\n\
                address = \"127.0.0.1:0\"\nsend = \"on-change\"\ncycle = \"1ms\"\nmax_age = \"300ms\"\n\
                [[signal]]\nname = \"level\"\naddress = \"%IW0\"\ntype = \"INT\"\ndead_band = 10\n\
                [[signal]]\nname = \"speed\"\naddress = \"%QB0\"\n";
    let mut device = Alone::open(text, &KINDS);
    let mut peer = client(device.address());
    peer.write_all(&[0]).expect("the device reads");
    device.until("the line runs", |end| {
        end.link().state == LinkState::Running
    });
    let mut first = [0xFF; 2];
    peer.read_exact(&mut first).expect("a first record");
    assert_eq!(first, [0, 0]);
    let mut heard: Vec<(Nanos, [u8; 2])> = Vec::new();
    let mut go_on = |device: &mut Alone, level: f64, cycles: u32| {
        device.end.set("level", level);
        for _ in 0..cycles {
            // The peer sends, so that it is not silent, and records the received data.
            peer.write_all(&[0]).expect("the device reads");
            device.end.tick();
            pass(&device.clock, 1);
            peer.set_nonblocking(true).expect("a TCP option");
            let mut bytes = [0; 2];
            while peer.read_exact(&mut bytes).is_ok() {
                heard.push((device.now(), bytes));
            }
            peer.set_nonblocking(false).expect("a TCP option");
        }
        std::mem::take(&mut heard)
    };
    let small: Vec<_> = go_on(&mut device, 10.0, 20);
    assert!(small.is_empty(), "within the dead band: {small:?}");
    let left = go_on(&mut device, 11.0, 20);
    assert_eq!(left.len(), 1, "{left:?}");
    assert_eq!(left[0].1, [0, 11]);
    let life = go_on(&mut device, 11.0, 250);
    assert_eq!(life.len(), 2, "signs of life: {life:?}");
    assert_eq!(life[1].0 - life[0].0, Nanos::from_millis(100));
}

#[test]
fn a_device_without_outputs_runs_for_as_long_as_somebody_listens() {
    let text = "[driver]\nid = 1\nname = \"mute\"\n[fieldbus]\nkind = \"socket\"\n\
                address = \"127.0.0.1:0\"\ncycle = \"1ms\"\nmax_age = \"300ms\"\n\
                [[signal]]\nname = \"in\"\naddress = \"%IB0\"\n";
    let mut device = Alone::open(text, &KINDS);
    let mut peer = client(device.address());
    device.until("the line runs", |end| {
        end.link().state == LinkState::Running
    });
    for _ in 0..1_000 {
        pass(&device.clock, 1);
        device.end.tick();
        assert_ne!(device.end.link().state, LinkState::Stale);
    }
    let mut byte = [0xFF];
    peer.read_exact(&mut byte).expect("a record of one byte");
    peer.write_all(&[1]).expect("the device is there");
    assert_eq!(
        device.until_reason("this end has nothing to receive"),
        "protocol"
    );
}

#[test]
fn a_refused_connection_is_told_and_tried_again() {
    let (bus, clock) = (Tcp::new("", ""), Manual::new());
    let mut controller = End::open(&config(&bus, "controller", ""), &clock, &KINDS);
    await_that("the controller says so", || {
        controller.link().state == LinkState::Failed
    });
    let reason = controller.link().reason;
    let expected = format!("cannot connect to {}", bus.address);
    assert!(reason.contains(&expected), "{reason}");
    assert!(
        reason.contains("start the program that listens there"),
        "{reason}"
    );
    let mut device = End::open(&config(&bus, "device", ""), &clock, &KINDS);
    await_that("they find each other", || {
        pass(&clock, 2);
        device.tick();
        controller.tick().code == Code::Fresh
    });
}

#[test]
fn a_second_device_on_one_address_is_told_so() {
    let (bus, clock) = (Tcp::new("", ""), Manual::new());
    let first = End::open(&config(&bus, "device", ""), &clock, &KINDS);
    await_that("the first listens", || {
        first.link().reason.contains("listening on")
    });
    let second = End::open(&config(&bus, "device", ""), &clock, &KINDS);
    await_that("the second is told", || {
        second.link().reason.contains("cannot listen on")
    });
    assert_eq!(second.link().cause.name(), "link");
    first.driver.close();
    await_that("the second takes the place", || {
        clock.advance(CYCLE);
        second.link().reason.contains("listening on")
    });
}

/// A listener that accepts no more connections: the system does not answer further attempts.
#[cfg(target_os = "linux")]
fn unanswering() -> (socket2::Socket, Vec<socket2::Socket>, std::net::SocketAddr) {
    use socket2::{Domain, Socket, Type};

    let address = conformance::peers::own_address();
    let new = || Socket::new(Domain::IPV4, Type::STREAM, None).expect("a socket");
    let listener = new();
    listener.bind(&address.into()).expect("its own address");
    listener.listen(0).expect("it is bound");
    let crowd: Vec<Socket> = (0..4)
        .map(|_| {
            let socket = new();
            socket.set_nonblocking(true).expect("an option");
            // The attempt only needs to be in progress.
            let _ = socket.connect(&address.into());
            socket
        })
        .collect();
    (listener, crowd, address)
}

#[test]
#[cfg(target_os = "linux")]
fn an_address_that_does_not_answer_is_given_up_and_holds_up_no_close() {
    let (_listener, _crowd, address) = unanswering();
    let bus = Tcp {
        address,
        device: "",
        controller: "",
    };
    let clock = Manual::new();
    let controller = End::open(&config(&bus, "controller", ""), &clock, &KINDS);
    await_that("it waits for an answer", || clock.is_settled(1));
    assert_eq!(controller.link().reason, format!("connecting to {address}"));
    for _ in 0..5 {
        clock.advance(Nanos::from_secs(1));
    }
    await_that("the controller gives up", || {
        controller.link().state == LinkState::Failed
    });
    let reason = controller.link().reason;
    let expected = format!("no answer from {address} within 5s");
    assert!(reason.contains(&expected), "{reason}");

    let controller = End::open(&config(&bus, "controller", ""), &clock, &KINDS);
    await_that("another one waits for an answer", || {
        controller.link().reason.contains("connecting")
    });
    // The clock stands still.
    controller.driver.close();
}

#[test]
fn a_controller_whose_server_turns_it_away_says_what_to_do() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let bus = Tcp {
        address: listener.local_addr().expect("it is bound"),
        device: "",
        controller: "",
    };
    let clock = Manual::new();
    let controller = End::open(&config(&bus, "controller", ""), &clock, &KINDS);
    for graceful in [true, false] {
        let (stream, _) = listener.accept().expect("it connects");
        if graceful {
            leave(stream);
        } else {
            // Data from the controller are unread, so closing resets the connection.
            await_that("a record has come", || stream.peek(&mut [0; 1]).is_ok());
            drop(stream);
        }
        let cause = if graceful { "left" } else { "link" };
        await_that("it says what to do", || {
            let link = controller.link();
            link.cause.name() == cause && link.reason.contains("if it serves another client")
        });
        // The pause before it tries again.
        clock.advance(Nanos::from_millis(10));
    }
    assert_eq!(controller.statistic("link.running"), "0");
}

#[test]
fn a_device_that_has_no_records_to_reply_to_says_so() {
    let device = Alone::open(
        "[driver]\nid = 1\nname = \"mute\"\n[fieldbus]\nkind = \"socket\"\n\
         address = \"127.0.0.1:0\"\nsend = \"reply\"\n[[signal]]\nname = \"in\"\naddress = \"%IB0\"\n",
        &KINDS,
    );
    await_that("it says so", || {
        device.end.link().reason.contains("this end receives none")
    });
    assert_eq!(device.end.link().cause.name(), "refused");
}

#[test]
fn closing_during_a_look_up_does_not_wait_for_it() {
    let text = config(&Tcp::new("", ""), "controller", "");
    let address = text
        .lines()
        .find(|line| line.starts_with("address"))
        .expect("an address");
    let named = text.replace(address, "address = \"no-such-host.invalid:1\"");
    let controller = Alone::open(&named, &KINDS);
    controller.end.driver.close();
}
