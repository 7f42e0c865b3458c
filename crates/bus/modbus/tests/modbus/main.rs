//! The Modbus buses: the conformance suite in both directions, and hand-written clients that misbehave.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod client;
mod ends;
mod places;
mod plc;
#[cfg(unix)]
#[path = "../../../../../tests/peers/pty.rs"]
mod pty;
mod rtu;
mod udp;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;
use tickbus_base::os::raise_open_files;
use tickbus_conformance as conformance;
use tickbus_conformance::conformance;

use conformance::peers::{Alone, client, is_closed, leave};
use conformance::rig::{MAX_AGE, await_that, logged, pass};
use ends::{Tcp, request};
use plc::{Habit, Plc};
use socket2::SockRef;
use tickbus_base::time::Nanos;
use tickbus_bus_modbus::{ClientOptions, ServerOptions};
use tickbus_driver::Code;
use tickbus_driver_cfg::{Kind, Kinds};
use tickbus_fieldbus::LinkState;

/// The kinds of this crate.
static KINDS: Kinds = Kinds::new(&[Kind::of::<ServerOptions>(), Kind::of::<ClientOptions>()]);

conformance!(device_serves, crate::Tcp::device_serves());
conformance!(device_serves_places, crate::Tcp::device_serves_places());
conformance!(controller_serves, crate::Tcp::controller_serves());
conformance!(device_serves_rtu, crate::Tcp::device_serves_rtu());

/// A Device that listens on a port chosen by the system, with the signals of the suite: `speed` is holding
/// register 1.
fn device(further: &str) -> (Alone, TcpStream) {
    let mut device = Alone::open(
        &conformance::rig::config(&AnyPort, "device", further),
        &KINDS,
    );
    device.end.tick();
    let stream = client(device.address());
    (device, stream)
}

struct AnyPort;

impl conformance::rig::Bus for AnyPort {
    fn kinds(&self) -> &'static tickbus_driver_cfg::Kinds {
        &KINDS
    }

    fn fieldbus(&self, _role: &str) -> String {
        "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"".to_owned()
    }

    fn liar(&self, _: &std::sync::Arc<tickbus_base::time::Manual>) -> conformance::rig::Liar {
        unreachable!("it is no bus of the suite")
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        Vec::new()
    }
}

/// Sends a request and receives the answer's PDU.
#[track_caller]
fn ask(stream: &mut TcpStream, transaction: u16, pdu: &[u8]) -> Vec<u8> {
    stream
        .write_all(&request(transaction, 1, pdu))
        .expect("the server reads");
    answer(stream, transaction)
}

#[track_caller]
fn answer(stream: &mut TcpStream, transaction: u16) -> Vec<u8> {
    let mut header = [0; 7];
    stream.read_exact(&mut header).expect("a header");
    let [high, low] = transaction.to_be_bytes();
    assert_eq!(header[..4], [high, low, 0, 0], "{header:?}");
    let length = usize::from(u16::from_be_bytes([header[4], header[5]]));
    let mut pdu = vec![0; length - 1];
    stream.read_exact(&mut pdu).expect("a PDU");
    pdu
}

/// Writes a speed, as an honest client does, and sees it arrive.
#[track_caller]
fn is_served(device: &mut Alone, stream: &mut TcpStream, speed: i16) {
    let [high, low] = speed.to_be_bytes();
    let write = [6, 0, 1, high, low];
    assert_eq!(ask(stream, 4711, &write), write);
    device.until_speed(speed);
    device.end.set("position", f64::from(speed));
    device.end.tick();
    assert_eq!(ask(stream, 4712, &[4, 0, 1, 0, 1]), [4, 2, high, low]);
}

#[test]
fn each_write_is_one_commit_and_reading_back_gives_it() {
    let (mut device, mut stream) = device("events = true");
    let write = [16, 0, 1, 0, 2, 4, 0, 5, 0, 5];
    assert_eq!(ask(&mut stream, 1, &write), write[..5]);
    let both = [23, 0, 1, 0, 2, 0, 1, 0, 2, 4, 0, 6, 0, 6];
    assert_eq!(ask(&mut stream, 2, &both), [23, 4, 0, 6, 0, 6]);
    device.until_speed(6);
    assert_eq!(device.end.statistic("bus_cycles"), "2");
    assert_eq!(device.end.get("echo"), 6.0);
    // A read is not a cycle, but a sign of life.
    ask(&mut stream, 3, &[3, 0, 1, 0, 1]);
    assert_eq!(device.end.statistic("bus_cycles"), "2");
}

#[test]
fn the_statistics_have_the_octets_on_the_line_and_the_process_data_in_them() {
    let (mut device, mut stream) = device("");
    let write = [6, 0, 1, 0, 5];
    assert_eq!(ask(&mut stream, 1, &write), write);
    device.until_speed(5);
    assert_eq!(ask(&mut stream, 2, &[4, 0, 1, 0, 1]).len(), 4);
    // The client may have the answer before the server counts it.
    device.until("it is counted", |end| {
        end.driver.statistics().contains("\nline.data_out=2\n")
    });
    for (key, value) in [
        ("octets_in", "24"),
        ("octets_out", "23"),
        ("frames_in", "2"),
        ("frames_out", "2"),
        ("data_in", "2"),
        // Of 24 and 23 octets, and twice 66 of TCP, IP and Ethernet.
        ("efficiency_in_percent", "1.3"),
        ("efficiency_out_percent", "1.3"),
    ] {
        assert_eq!(device.end.statistic(&format!("line.{key}")), value, "{key}");
    }
}

#[test]
fn a_write_to_a_unit_that_is_cut_off_is_lost_and_is_not_read_back() {
    let text = format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n{TWO_UNITS}"
    );
    let mut device = Alone::open(&text, &KINDS);
    let mut stream = client(device.address());
    let mut reader = stream.try_clone().expect("a socket");
    let mut send = |unit, pdu: &[u8]| {
        let sent = stream.write_all(&request(1, unit, pdu));
        sent.expect("the server reads");
    };
    let (on, off, read) = ([6, 0, 0, 0, 7], [6, 0, 0, 0, 0], [3, 0, 0, 0, 1]);
    send(3, &on);
    assert_eq!(answer(&mut reader, 1), on);
    device.until("it is there", |end| end.get("press") == 7.0);
    let cut = device
        .end
        .driver
        .inject_text("kind = \"station-down\"\nstation = \"press\"");
    device.end.tick();
    send(3, &off);
    // The only answer is that of the other unit: by then, the request before it has been served.
    send(7, &on);
    assert_eq!(answer(&mut reader, 1), on);
    assert!(device.end.driver.end_fault(cut.expect("a right fault")));
    device.end.tick();
    send(3, &read);
    assert_eq!(answer(&mut reader, 1), [3, 2, 0, 7]);
}

#[test]
fn a_late_answer_is_lost_if_its_unit_is_cut_off_before() {
    let text = format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n{TWO_UNITS}"
    );
    let mut device = Alone::open(&text, &KINDS);
    let mut stream = client(device.address());
    suffer(
        &mut device,
        "kind = \"answer-late\"\nby = \"1s\"\nstation = \"press\"",
    );
    let on = [6, 0, 0, 0, 7];
    for (unit, pdu) in [(3, &[3, 0, 0, 0, 1][..]), (7, &on)] {
        let sent = stream.write_all(&request(1, unit, pdu));
        sent.expect("the server reads");
    }
    device.until("both are served", |end| end.get("oven") == 7.0);
    suffer(&mut device, "kind = \"station-down\"\nstation = \"press\"");
    device.clock.advance(Nanos::from_secs(2));
    assert_eq!(answer(&mut stream, 1), on, "the only answer");
}

#[test]
fn changes_are_events_or_every_write_is() {
    for (events, expected) in [
        ("true", vec![5.0, 6.0]),
        ("\"writes\"", vec![5.0, 5.0, 6.0]),
    ] {
        let (mut device, mut stream) = device(&format!("events = {events}"));
        for speed in [5, 5, 6] {
            ask(&mut stream, 1, &[6, 0, 1, 0, speed]);
        }
        // A coil of another signal, and a byte without signals.
        ask(&mut stream, 1, &[5, 0, 9, 0xFF, 0]);
        device.until_speed(6);
        let mut events = [tickbus_image::Event::default(); 16];
        let count = device.end.driver.poll_events(&mut events);
        let speeds = events[..count].iter().filter(|event| event.signal == 1);
        let speeds: Vec<f64> = speeds.map(|event| event.value.real()).collect();
        assert_eq!(speeds, expected, "{events:?}");
    }
}

#[test]
fn what_nobody_has_written_is_fail_safe() {
    let (mut device, mut stream) = device("");
    assert_eq!(ask(&mut stream, 1, &[3, 0, 1, 0, 1]), [3, 2, 0xFF, 0xFF]);
    ask(&mut stream, 2, &[5, 0, 0, 0xFF, 0]);
    device.until("the coil is on", |end| end.get("run") == 1.0);
    assert_eq!(device.end.get("speed"), -1.0);
}

#[test]
fn a_pulse_is_held_until_a_client_has_read_it() {
    let (mut device, mut stream) = device("");
    for level in [1.0, 0.0] {
        device.end.set("sensor", level);
        device.end.tick();
    }
    // Reading another place shows no pulse.
    for _ in 0..3 {
        assert_eq!(ask(&mut stream, 1, &[4, 0, 1, 0, 2])[0], 4);
    }
    // Nor does reading the other bits of its byte.
    for _ in 0..3 {
        assert_eq!(ask(&mut stream, 1, &[2, 0, 1, 0, 7])[0], 2);
    }
    assert_eq!(ask(&mut stream, 2, &[2, 0, 0, 0, 1]), [2, 1, 1]);
    assert_eq!(ask(&mut stream, 3, &[2, 0, 0, 0, 1]), [2, 1, 0]);
}

/// Starts a line fault.
fn suffer(device: &mut Alone, fault: &str) {
    let injected = device.end.driver.inject_text(fault);
    injected.unwrap_or_else(|why| panic!("{why}"));
    device.end.tick();
}

#[test]
fn a_pulse_in_slow_answers_is_held_until_a_client_has_read_it() {
    let (mut device, mut stream) = device("");
    suffer(&mut device, "kind = \"values-late\"\nby = \"20ms\"");
    for level in [1.0, 0.0] {
        device.end.set("sensor", level);
        device.end.tick();
        assert_eq!(ask(&mut stream, 1, &[2, 0, 0, 0, 1]), [2, 1, 0]);
    }
    device.clock.advance(Nanos::from_millis(25));
    for _ in 0..3 {
        assert_eq!(ask(&mut stream, 2, &[4, 0, 1, 0, 2])[0], 4);
        assert_eq!(ask(&mut stream, 2, &[2, 0, 1, 0, 7])[0], 2);
    }
    assert_eq!(ask(&mut stream, 3, &[2, 0, 0, 0, 1]), [2, 1, 1]);
    assert_eq!(ask(&mut stream, 4, &[2, 0, 0, 0, 1]), [2, 1, 0]);
}

#[test]
fn writes_that_are_held_back_are_events_with_their_own_values() {
    let (mut device, mut stream) = device("events = \"writes\"");
    suffer(&mut device, "kind = \"delay\"\nby = \"50ms\"");
    ask(&mut stream, 1, &[6, 0, 1, 0, 5]);
    device.clock.advance(Nanos::from_millis(40));
    ask(&mut stream, 2, &[5, 0, 0, 0xFF, 0]);
    device.clock.advance(Nanos::from_millis(20));
    ask(&mut stream, 3, &[6, 0, 2, 0, 9]);
    device.until("all is there", |end| end.get("echo") == 9.0);
    let mut events = [tickbus_image::Event::default(); 16];
    let count = device.end.driver.poll_events(&mut events);
    let seen = events[..count].iter();
    let seen: Vec<_> = seen
        .map(|event| (event.signal, event.value.real()))
        .collect();
    assert_eq!(seen, [(1, 5.0), (0, 1.0), (2, 9.0)]);
}

#[test]
fn telegrams_that_come_together_or_in_pieces_are_answered_one_by_one() {
    let (mut device, mut stream) = device("");
    let all: Vec<u8> = (0..300)
        .flat_map(|number| request(number, 1, &[3, 0, 1, 0, 1]))
        .collect();
    stream.write_all(&all).expect("the server reads");
    for number in 0..300 {
        assert_eq!(answer(&mut stream, number).len(), 4);
    }
    for byte in request(7, 1, &[6, 0, 1, 0, 9]) {
        stream.write_all(&[byte]).expect("the server reads");
    }
    assert_eq!(answer(&mut stream, 7), [6, 0, 1, 0, 9]);
    device.until_speed(9);
}

/// Clients that violate the protocol are disconnected, each with its reason; an honest one is not affected.
#[test]
fn a_client_that_breaks_the_rules_is_dropped_alone() {
    let (mut device, mut honest) = device("");
    is_served(&mut device, &mut honest, 1);
    let floods: [(&str, Vec<u8>); 5] = [
        ("another protocol", b"GET / HTTP/1.1\r\n\r\n".to_vec()),
        ("no length", vec![0, 1, 0, 0, 0, 0, 1]),
        ("too long", vec![0, 1, 0, 0, 0xFF, 0xFF, 1, 3]),
        ("no function", vec![0, 1, 0, 0, 0, 1, 1]),
        (
            "noise",
            (0..=255_u8)
                .rev()
                .cycle()
                .take(100_000)
                .map(|byte| byte | 1)
                .collect(),
        ),
    ];
    for ((what, bytes), speed) in floods.into_iter().zip(2..) {
        let mut liar = client(device.address());
        let _ = liar.write_all(&bytes);
        await_that(what, || is_closed(&liar));
        is_served(&mut device, &mut honest, speed);
    }
    assert_eq!(device.end.statistic("clients.dropped"), "5");
    assert_eq!(device.end.statistic("link.running"), "1");
}

#[test]
fn a_client_that_leaves_half_a_telegram_is_given_up_alone() {
    let (mut device, mut honest) = device("");
    let mut slow = client(device.address());
    slow.write_all(&request(1, 1, &[3, 0, 0, 0, 1])[..9])
        .expect("the server reads");
    is_served(&mut device, &mut honest, 1);
    let mut speed = 1;
    await_that("it is given up", || {
        pass(&device.clock, 1);
        speed = speed % 1000 + 1;
        is_served(&mut device, &mut honest, speed);
        is_closed(&slow)
    });
    assert!(device.now() >= MAX_AGE);
    assert_eq!(device.end.statistic("link.running"), "1");
}

/// Half-open connections: one client has gone silently, another one never reads; neither keeps the others
/// waiting.
#[test]
fn clients_that_do_not_read_or_are_gone_hold_nobody_up() {
    let (mut device, mut honest) = device("");
    let mut deaf = client(device.address());
    deaf.set_write_timeout(Some(Duration::from_millis(50)))
        .expect("an option");
    let all = request(1, 1, &[3, 0, 0, 0, 3]).repeat(400);
    // Until neither system has buffer space left.
    while deaf.write_all(&all).is_ok() {}
    let gone = client(device.address());
    SockRef::from(&gone)
        .set_linger(Some(Duration::ZERO))
        .expect("an option");
    drop(gone);
    for speed in 1..100 {
        is_served(&mut device, &mut honest, speed);
    }
    await_that("the deaf one is given up", || {
        pass(&device.clock, 1);
        is_served(&mut device, &mut honest, 7);
        device.end.statistic("clients") == "1"
    });
}

#[test]
fn a_thousand_clients_are_served_side_by_side() {
    let (mut device, mut honest) = device("");
    let address = device.address();
    // Both ends of each connection are in this process.
    let count = 1000.min(raise_open_files().saturating_sub(100) / 2);
    let mut crowd: Vec<TcpStream> = (0..count).map(|_| client(address)).collect();
    for stream in &mut crowd {
        let bytes = request(9, 1, &[6, 0, 2, 0, 3]);
        stream.write_all(&bytes).expect("the server reads");
    }
    for stream in &mut crowd {
        assert_eq!(answer(stream, 9), [6, 0, 2, 0, 3]);
    }
    is_served(&mut device, &mut honest, 5);
    assert_eq!(device.end.statistic("clients"), (count + 1).to_string());
    assert_eq!(device.end.get("echo"), 3.0);
    drop(crowd);
    await_that("they are gone", || device.end.statistic("clients") == "1");
    is_served(&mut device, &mut honest, 6);
}

#[test]
fn clients_beyond_the_limit_are_turned_away() {
    logged::expect("was turned away");
    let (mut device, mut honest) = device("clients = 2");
    is_served(&mut device, &mut honest, 1);
    let mut second = client(device.address());
    is_served(&mut device, &mut second, 2);
    let third = client(device.address());
    await_that("it is turned away", || is_closed(&third));
    is_served(&mut device, &mut honest, 3);
    assert_eq!(device.end.statistic("clients"), "2");
}

#[test]
fn who_only_looks_does_not_keep_the_values_of_another_one_young() {
    let (mut device, mut panel) = device("");
    ask(&mut panel, 1, &[3, 0, 1, 0, 1]);
    assert_eq!(device.end.tick().code, Code::Unchanged, "somebody is there");
    let mut plc = client(device.address());
    assert_eq!(ask(&mut plc, 1, &[6, 0, 1, 0, 7])[0], 6);
    device.until_speed(7);
    leave(plc);
    device.until("the PLC's values are stale", |end| {
        ask(&mut panel, 2, &[3, 0, 1, 0, 1]);
        ask(&mut panel, 3, &[4, 0, 1, 0, 1]);
        end.tick().code == Code::Stale
    });
    assert_eq!(device.end.get("speed"), -1.0);
    // A write by the panel would be reported.
    ask(&mut panel, 4, &[6, 0, 1, 0, 8]);
    device.until_speed(8);
}

#[test]
fn a_client_that_returns_and_reads_before_it_writes_does_not_bring_its_old_values_back() {
    const READ: [u8; 5] = [4, 0, 1, 0, 1];
    let (mut device, mut stream) = device("");
    is_served(&mut device, &mut stream, 7);
    device.clock.advance(MAX_AGE + Nanos::from_millis(10));
    for transaction in 1..4 {
        ask(&mut stream, transaction, &READ);
        assert_eq!(device.end.tick().code, Code::Stale, "{transaction}");
        assert_eq!(device.end.get("speed"), -1.0);
    }
    // A client that writes only changes has nothing to write.
    device.clock.advance(MAX_AGE);
    ask(&mut stream, 4, &READ);
    device.until_speed(7);
    device.clock.advance(MAX_AGE + Nanos::from_millis(10));
    ask(&mut stream, 5, &READ);
    assert_eq!(device.end.tick().code, Code::Stale);
    is_served(&mut device, &mut stream, 8);
}

#[test]
fn the_line_runs_while_a_client_talks_and_is_stale_when_none_does() {
    let (mut device, mut stream) = device("");
    // A refused request is not a sign of life: it may have been meant for another server.
    ask(&mut stream, 1, &[3, 0, 99, 0, 1]);
    ask(&mut stream, 2, &[3, 0, 0, 0, 1]);
    device.until("it runs", |end| end.link().state == LinkState::Running);
    device.until("it is stale", |end| end.link().state == LinkState::Stale);
    ask(&mut stream, 3, &[43, 14, 1, 0]);
    device.until("it runs again", |end| {
        end.link().state == LinkState::Running
    });
    leave(stream);
    device.until("it waits for the next one", |end| {
        end.link().state == LinkState::Opening
    });
}

/// A machine with two stations, each with a register to read whose fail-safe value is -1.
const TWO_UNITS: &str = "[[station]]\nname = \"press\"\nunit = 3\n[[station]]\nname = \"oven\"\nunit = 7\n\
     [[signal]]\nname = \"press\"\nstation = \"press\"\naddress = \"%QW0\"\ntype = \"INT\"\nfail_safe = -1\n\
     [[signal]]\nname = \"oven\"\nstation = \"oven\"\naddress = \"%QW0\"\ntype = \"INT\"\nfail_safe = -1\n";

#[test]
fn a_client_that_leaves_takes_the_values_of_its_unit_alone() {
    let mut device = Alone::open(
        &format!(
            "[driver]\nid = 1\nname = \"machine\"\n[fieldbus]\nkind = \"modbus-server\"\n\
         address = \"127.0.0.1:0\"\ncycle = \"1ms\"\nmax_age = \"300ms\"\n{TWO_UNITS}"
        ),
        &KINDS,
    );
    let write = |stream: &mut TcpStream, unit, value| {
        let pdu = [6, 0, 0, 0, value];
        stream
            .write_all(&request(1, unit, &pdu))
            .expect("the server reads");
        assert_eq!(answer(stream, 1), pdu);
    };
    let [mut press, mut oven] = [(); 2].map(|()| client(device.address()));
    write(&mut press, 3, 5);
    write(&mut oven, 7, 6);
    device.until("both have theirs", |end| {
        end.get("press") == 5.0 && end.get("oven") == 6.0
    });
    leave(press);
    device.until("the press is fail-safe", |end| {
        write(&mut oven, 7, 6);
        end.tick();
        end.get("press") == -1.0
    });
    assert_eq!(device.end.get("oven"), 6.0);
}

#[test]
fn a_second_writer_is_counted_or_refused_until_the_first_one_has_left() {
    for (further, refused) in [("", false), ("writers = 1", true)] {
        let (mut device, mut first) = device(further);
        let mut second = client(device.address());
        let (speed, echo) = ([6, 0, 1, 0, 9], [6, 0, 2, 0, 9]);
        assert_eq!(ask(&mut first, 1, &speed), speed);
        assert_eq!(ask(&mut second, 1, &echo), echo, "that is no one else's");
        let other = [6, 0, 1, 0, 8];
        logged::expect("each undoes what the other one does");
        let answer = ask(&mut second, 2, &other);
        assert_eq!(
            answer,
            if refused {
                vec![0x86, 6]
            } else {
                other.to_vec()
            }
        );
        device.until_speed(if refused { 9 } else { 8 });
        assert_eq!(device.end.statistic("modbus-server.second_writer"), "1");
        leave(first);
        device.until("the first one is gone", |_| {
            ask(&mut second, 3, &other) == other
        });
        device.until_speed(8);
    }
}

#[test]
fn a_writer_of_any_number_of_single_places_is_the_only_one_at_each_of_them() {
    const COILS: u16 = 200;
    let text = "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"modbus-server\"\n\
        address = \"127.0.0.1:0\"\nmax_age = \"20s\"\nwriters = 1\noutput_bytes = 25\n\
        [[signal]]\nname = \"run\"\naddress = \"%QX0.0\"\n";
    let device = Alone::open(text, &KINDS);
    let (mut first, mut second) = (client(device.address()), client(device.address()));
    let coil = |at: u16, value| {
        let [high, low] = at.to_be_bytes();
        [5, high, low, value, 0]
    };
    for at in 0..COILS {
        let on = coil(at, 0xFF);
        assert_eq!(ask(&mut first, at, &on), on, "coil {at}");
    }
    logged::expect("each undoes what the other one does");
    for at in 0..COILS {
        assert_eq!(ask(&mut second, at, &coil(at, 0)), [0x85, 6], "coil {at}");
    }
}

#[test]
fn function_3_reads_the_inputs_behind_the_outputs() {
    let (mut device, mut stream) = device("");
    device.end.set("position", 5.0);
    device.end.tick();
    assert_eq!(ask(&mut stream, 1, &[3, 4, 1, 0, 1]), [3, 2, 0, 5]);
    let both = [23, 4, 1, 0, 1, 0, 1, 0, 1, 2, 0, 9];
    assert_eq!(ask(&mut stream, 2, &both), [23, 2, 0, 5]);
    device.until_speed(9);
    // The registers are read-only.
    assert_eq!(ask(&mut stream, 3, &[6, 4, 1, 0, 1]), [0x86, 2]);
}
