//! The S7 buses: the conformance suite with a server and a client of ours, and specific tests.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod ends;
mod places;
mod state;

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};
use tickbus_conformance as conformance;
use tickbus_conformance::conformance;

use conformance::peers::{Alone, is_closed};
use conformance::rig::{await_that, config, logged, pass};
use ends::{CONFIRM, CONNECT, Client, Cpu, Pair, address, command, job, packet, request};
use tickbus_bus_s7::{ClientOptions, ServerOptions};
use tickbus_driver::Code;
use tickbus_driver_cfg::{Kind, Kinds};
use tickbus_image::Event;

/// The kinds of this crate.
static KINDS: Kinds = Kinds::new(&[Kind::of::<ServerOptions>(), Kind::of::<ClientOptions>()]);

conformance!(device_serves, crate::Pair::new("device", ""));
conformance!(device_dials, crate::Pair::new("controller", ""));
conformance!(
    by_data_blocks_and_small_units,
    crate::Pair::new("device", "pdu = 240").with_blocks()
);

const INPUTS: u8 = 0x81;
const OUTPUTS: u8 = 0x82;
const FLAGS: u8 = 0x83;

/// A Device that serves the conformance suite's signals at a port chosen by the system.
fn server(further: &str) -> (Alone, SocketAddr) {
    let pair = Pair {
        address: (Ipv4Addr::LOCALHOST, 0).into(),
        ..Pair::new("device", "")
    };
    let alone = Alone::open(&config(&pair, "device", further), &KINDS);
    let address = alone.address();
    (alone, address)
}

#[test]
fn a_write_is_seen_at_the_next_tick_and_what_was_never_written_is_fail_safe() {
    let (mut device, address) = server("");
    let mut client = Client::new(address);
    assert_eq!(client.read(OUTPUTS, 0, 6), [0, 0, 0xFF, 0xFF, 0, 0]);
    client.write(OUTPUTS, 4, &[0, 9]);
    device.end.tick();
    assert_eq!(
        (device.end.get("speed"), device.end.get("echo")),
        (-1.0, 9.0)
    );
    assert_eq!(client.read(OUTPUTS, 0, 6), [0, 0, 0xFF, 0xFF, 0, 9]);
    assert_eq!(
        device.end.statistic("bus_cycles"),
        "1",
        "one write, one commit"
    );
}

#[test]
fn the_items_of_a_job_are_one_commit() {
    let (mut device, at) = server("");
    let mut client = Client::new(at);
    let parameters = [
        &[5, 2][..],
        &address(OUTPUTS, 0, 2, 2),
        &address(OUTPUTS, 0, 4, 2),
    ];
    for value in 1..=50 {
        let data = [0, 4, 0, 16, 0, value, 0, 4, 0, 16, 0, value];
        client.ask(&job(&parameters.concat(), &data));
        device.end.tick();
        let seen = (device.end.get("speed"), device.end.get("echo"));
        assert_eq!(seen, (f64::from(value), f64::from(value)));
    }
    assert_eq!(device.end.statistic("bus_cycles"), "50");
}

fn events(device: &mut Alone) -> Vec<(u32, f64)> {
    let mut events = [Event::default(); 16];
    let count = device.end.driver.poll_events(&mut events);
    let event = |event: &Event| (event.signal, event.value.real());
    events[..count].iter().map(event).collect()
}

#[test]
fn events_are_changes_or_every_write_as_asked() {
    for (asked, expected) in [
        ("events = true", &[(1, 5.0), (0, 1.0)][..]),
        (
            "events = \"writes\"",
            &[(1, 5.0), (1, 5.0), (0, 1.0), (0, 1.0), (2, 0.0)],
        ),
    ] {
        let (mut device, at) = server(asked);
        let mut client = Client::new(at);
        for _ in 0..2 {
            client.write(OUTPUTS, 2, &[0, 5]);
        }
        for _ in 0..2 {
            // Only bit 0 of byte 0; its neighbours must not become events.
            let bit = [&[5, 1, 0x12, 10, 0x10, 1, 0, 1, 0, 0, OUTPUTS, 0, 0, 0][..]].concat();
            client.ask(&job(&bit, &[0, 3, 0, 1, 1]));
        }
        client.write(OUTPUTS, 4, &[0, 0]);
        assert_eq!(events(&mut device), expected, "{asked}");
    }
}

#[test]
fn what_is_read_is_the_latest_and_a_pulse_elsewhere_is_not_taken_as_seen() {
    let (mut device, at) = server("");
    let mut client = Client::new(at);
    device.end.set("position", 513.0);
    device.end.set("sensor", 1.0);
    device.end.tick();
    device.end.set("sensor", 0.0);
    device.end.tick();
    for _ in 0..3 {
        assert_eq!(client.read(INPUTS, 2, 2), [2, 1]);
    }
    // Another bit of the same byte.
    let beside = [4, 1, 0x12, 0x0A, 0x10, 1, 0, 1, 0, 0, INPUTS, 0, 0, 1];
    let beside = job(&beside, &[]);
    for _ in 0..3 {
        assert_eq!(client.ask(&beside).last(), Some(&0));
    }
    assert_eq!(
        client.read(INPUTS, 0, 1),
        [1],
        "the pulse is still to be seen"
    );
    await_that("it is over", || client.read(INPUTS, 0, 1) == [0]);
}

#[test]
fn a_pulse_behind_the_first_byte_is_over_once_its_own_bit_was_read() {
    let signals = "[[signal]]\nname = \"far\"\naddress = \"%IX3.2\"\nlatch = \"rising\"\n";
    let text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"s7-server\"\naddress = \"127.0.0.1:0\"\n{signals}"
    );
    let mut device = Alone::open(&text, &KINDS);
    let mut client = Client::new(device.address());
    let bit = |bit: u8| {
        job(
            &[4, 1, 0x12, 0x0A, 0x10, 1, 0, 1, 0, 0, INPUTS, 0, 0, bit],
            &[],
        )
    };
    for level in [1.0, 0.0] {
        device.end.set("far", level);
        device.end.tick();
    }
    for other in [2, 25, 27] {
        client.ask(&bit(other));
    }
    assert_eq!(client.ask(&bit(26)).last(), Some(&1));
    await_that("it is over", || client.ask(&bit(26)).last() == Some(&0));
}

#[test]
fn pulses_are_seen_by_a_client_that_asks_for_several_pieces_at_once() {
    let (mut device, at) = server("");
    let mut client = Client::new(at);
    for _ in 0..20 {
        for level in [1.0, 0.0] {
            device.end.set("sensor", level);
            device.end.tick();
        }
        client.send(&[request(INPUTS, 0, 1), request(INPUTS, 2, 2)].concat());
        let both = [(); 2].map(|()| client.receive().expect("an answer"));
        assert_eq!(both[0].last(), Some(&1));
        await_that("it is over", || client.read(INPUTS, 0, 1) == [0]);
    }
}

#[test]
fn inputs_are_not_written_and_flags_are_scratch() {
    let (mut device, at) = server("m_bytes = 16");
    let mut client = Client::new(at);
    let code = |answer: Vec<u8>| *answer.last().expect("a code");
    assert_eq!(code(client.ask(&command(INPUTS, 2, &[0, 1]))), 3);
    assert_eq!(code(client.ask(&command(OUTPUTS, 5, &[0, 1]))), 5);
    assert_eq!(code(client.ask(&command(FLAGS, 15, &[0, 1]))), 5);
    client.write(FLAGS, 14, &[3, 4]);
    assert_eq!(client.read(FLAGS, 13, 3), [0, 3, 4]);
    device.end.tick();
    assert_eq!(device.end.get("speed"), -1.0);
    assert_eq!(
        device.end.statistic("bus_cycles"),
        "0",
        "none of it was a cycle"
    );
}

#[test]
fn who_only_looks_does_not_keep_the_values_of_another_one_young() {
    logged::expect("each undoes what the other one does");
    let (mut device, at) = server("");
    let mut panel = Client::new(at);
    panel.read(INPUTS, 0, 6);
    assert_eq!(device.end.tick().code, Code::Unchanged, "somebody is there");
    let mut plc = Client::new(at);
    plc.write(OUTPUTS, 2, &[0, 7]);
    device.until_speed(7);
    drop(plc);
    device.until("the PLC's values are stale", |end| {
        panel.read(INPUTS, 0, 6);
        panel.read(OUTPUTS, 0, 6);
        end.tick().code == Code::Stale
    });
    assert_eq!(device.end.get("speed"), -1.0);
    // A write by the panel would be reported.
    panel.write(OUTPUTS, 2, &[0, 8]);
    device.until_speed(8);
}

#[test]
fn a_second_writer_is_counted_or_refused_until_the_first_one_has_left() {
    for (further, code, speed) in [("", 0xFF, 8), ("writers = 1", 3, 7)] {
        let (mut device, at) = server(further);
        let (mut first, mut second) = (Client::new(at), Client::new(at));
        first.write(OUTPUTS, 2, &[0, 7]);
        device.until_speed(7);
        second.write(OUTPUTS, 4, &[0, 9]);
        logged::expect("each undoes what the other one does");
        let answer = second.ask(&command(OUTPUTS, 2, &[0, 8]));
        assert_eq!(answer.last(), Some(&code), "{further}");
        device.until_speed(speed);
        assert_eq!(device.end.statistic("s7.second_writer"), "1");
        drop(first);
        device.until("the first one is gone", |_| {
            second.ask(&command(OUTPUTS, 2, &[0, 6])).last() == Some(&0xFF)
        });
        device.until_speed(6);
    }
}

#[test]
fn every_station_has_a_slot_and_blocks_of_its_own() {
    let text = "[driver]\nid = 1\nname = \"two\"\n[fieldbus]\nkind = \"s7-server\"\n\
        address = \"127.0.0.1:0\"\ndb = [{ number = 1, area = \"%Q\", station = \"lathe\" }]\n\
        [[station]]\nname = \"charger\"\nslot = 1\n[[station]]\nname = \"lathe\"\nslot = 2\n\
        [[station]]\nname = \"none\"\n\
        [[signal]]\nname = \"a\"\nstation = \"charger\"\naddress = \"%QB0\"\n\
        [[signal]]\nname = \"b\"\nstation = \"lathe\"\naddress = \"%QB0\"\n\
        [[signal]]\nname = \"c\"\nstation = \"none\"\naddress = \"%QB0\"\n";
    let mut device = Alone::open(text, &KINDS);
    let at = device.address();
    for (slot, value) in [(1, 11), (2, 12)] {
        let mut client = Client::in_slot(at, slot);
        client.write(OUTPUTS, 0, &[value]);
    }
    device.end.tick();
    assert_eq!((device.end.get("a"), device.end.get("b")), (11.0, 12.0));
    let mut stranger = Client::in_slot(at, 3);
    assert_eq!(stranger.ask(&command(OUTPUTS, 0, &[1])).last(), Some(&10));
    let block = [&[5, 1][..], &address(0x84, 1, 0, 1)].concat();
    assert_eq!(
        stranger.ask(&job(&block, &[0, 4, 0, 8, 13])).last(),
        Some(&0xFF)
    );
    device.end.tick();
    assert_eq!((device.end.get("a"), device.end.get("b")), (11.0, 13.0));
}

/// Whatever mistakes a client makes, other clients and the image are not affected.
#[test]
fn a_client_that_breaks_the_protocol_is_dropped_and_disturbs_nobody() {
    let (mut device, at) = server("");
    let mut good = Client::new(at);
    good.write(OUTPUTS, 2, &[0, 5]);
    device.until_speed(5);
    let connected = |further: &[u8]| [&CONNECT[..], further].concat();
    for (bytes, words) in [
        (b"GET / HTTP/1.1\r\n\r\n".to_vec(), "begins with 0x47"),
        (vec![3, 0, 0xFF, 0xFF, 0], "65535 bytes"),
        (vec![3, 0, 0, 6, 0, 0], "6 bytes"),
        (
            packet(&[0x32]),
            "before it asked for a transport connection",
        ),
        (connected(&CONNECT), "stands already"),
        (connected(&packet(&[0x72, 1, 0, 0])), "S7CommPlus"),
        (
            connected(&packet(&[0x32, 1, 0, 0, 0, 1, 0, 9, 0, 0, 4])),
            "do not add up",
        ),
        (connected(&[3, 0, 0, 7, 2, 0xF0, 0]), "in pieces"),
        (connected(&[3, 0, 0, 7, 0xFF, 0xF0, 0]), "malformed"),
        (connected(&[3, 0, 0, 8, 3, 0x10, 0, 0]), "0x10"),
    ] {
        let mut bad = Client::silent(at);
        bad.send(&bytes);
        await_that("it is dropped", || is_closed(&bad.0));
        assert_eq!(good.read(OUTPUTS, 2, 2), [0, 5], "{words}");
        device.end.tick();
        assert_eq!(device.end.get("speed"), 5.0);
    }
    let mut endless = Client::new(at);
    for _ in 0..10 {
        // The last of them may find the connection closed.
        let piece = [&[3, 0, 0, 107, 2, 0xF0, 0][..], &[0x32; 100]].concat();
        let _ = std::io::Write::write_all(&mut endless.0, &piece);
    }
    await_that("it is dropped", || is_closed(&endless.0));
    assert_eq!(good.read(OUTPUTS, 2, 2), [0, 5]);
}

#[test]
fn a_client_alone_that_breaks_the_protocol_is_told_in_words() {
    let (mut device, at) = server("");
    let mut bad = Client::silent(at);
    bad.send(&[&CONNECT[..], &packet(&[0x72, 1, 0, 0])].concat());
    let cause = device.until_reason("it speaks S7CommPlus");
    assert_eq!(cause, "protocol");
    let mut leaves = Client::new(at);
    leaves.send(&[3, 0, 0, 11, 6, 0x80, 0, 1, 0, 1, 0]);
    assert_eq!(
        device.until_reason("it ended the transport connection"),
        "left"
    );
}

#[test]
fn jobs_that_do_not_add_up_are_refused_and_nothing_of_them_is_done() {
    let (mut device, at) = server("");
    let mut client = Client::new(at);
    let item = address(OUTPUTS, 0, 2, 2);
    for (parameters, data) in [
        ([&[5, 255][..], &item].concat(), vec![0, 4, 0, 16, 0, 1]),
        (
            [&[5, 2][..], &item, &item].concat(),
            vec![0, 4, 0, 16, 0, 1],
        ),
        ([&[5, 1][..], &item].concat(), vec![0, 4, 255, 255, 0, 1]),
        ([&[4, 255][..], &item].concat(), Vec::new()),
        // The answer would exceed the negotiated length.
        (
            [&[4, 1][..], &address(FLAGS, 0, 0, 60_000)].concat(),
            Vec::new(),
        ),
        (
            [&[4, 40][..], &item.repeat(40), &[0; 400]].concat(),
            Vec::new(),
        ),
    ] {
        let answer = client.ask(&job(&parameters, &data));
        assert_eq!(answer[7..], [0x32, 2, 0, 0, 0, 7, 0, 0, 0, 0, 0x85, 0]);
    }
    client.read(INPUTS, 0, 1);
    device.end.tick();
    assert_eq!(device.end.get("speed"), -1.0);
}

#[test]
fn half_a_telegram_is_waited_for_and_not_for_ever() {
    let (mut device, at) = server("");
    let mut good = Client::new(at);
    let mut slow = Client::new(at);
    for byte in request(INPUTS, 0, 1) {
        slow.send(&[byte]);
    }
    assert!(slow.receive().is_some(), "byte by byte is one telegram");
    slow.send(&request(INPUTS, 0, 1)[..9]);
    await_that("it is given up", || {
        for _ in 0..100 {
            pass(&device.clock, 1);
        }
        is_closed(&slow.0)
    });
    assert_eq!(good.read(INPUTS, 0, 1), [0]);
    device.end.tick();
}

#[test]
fn a_flood_of_one_client_leaves_time_for_another() {
    let (mut device, at) = server("");
    let mut good = Client::new(at);
    let mut flood = Client::new(at);
    flood.0.set_nonblocking(true).expect("a TCP option");
    let many = request(INPUTS, 0, 6).repeat(1000);
    for value in 0..100 {
        // The client never reads, so at some point the server stops reading from it.
        let _ = std::io::Write::write(&mut flood.0, &many);
        good.write(OUTPUTS, 2, &[0, value]);
        device.end.tick();
        assert_eq!(device.end.get("speed"), f64::from(value));
    }
}

#[test]
fn two_hundred_clients_are_served_and_one_more_is_turned_away() {
    logged::expect("was turned away");
    let (mut device, at) = server("clients = 200");
    let mut clients: Vec<Client> = (0..200).map(|_| Client::new(at)).collect();
    for (value, client) in (0_u8..).zip(&mut clients) {
        client.write(OUTPUTS, 2, &[0, value]);
        device.end.tick();
        assert_eq!(device.end.get("speed"), f64::from(value));
    }
    let more = Client::silent(at);
    await_that("it is turned away", || is_closed(&more.0));
    assert_eq!(clients[0].read(OUTPUTS, 2, 2), [0, 199]);
    assert_eq!(device.end.statistic("clients"), "200");
    assert_eq!(device.end.statistic("clients.turned_away"), "1");
}

#[test]
fn a_client_of_ours_writes_nothing_into_a_cpu_that_was_not_named() {
    logged::expect("nothing is written into the PLC");
    let pair = Pair::new("device", "");
    let mut device = Alone::open(&config(&pair, "device", ""), &KINDS);
    let text = config(&pair, "controller", "");
    let mut plc = conformance::rig::End::open(
        &text.replace("write_to = \"tickbus device\"", "write_to = \"6ES7 315\""),
        &device.clock,
        &KINDS,
    );
    plc.set("speed", 5.0);
    device.end.set("position", 3.0);
    device.until("the client reads", |_| {
        plc.tick();
        plc.get("position") == 3.0
    });
    for _ in 0..50 {
        pass(&device.clock, 2);
        plc.tick();
        device.end.tick();
    }
    assert_eq!(device.end.get("speed"), -1.0);
    assert_eq!(plc.statistic("writes"), "blocked");
    assert_eq!(plc.statistic("identity"), "tickbus device");
    assert!(plc.link().reason.contains("tickbus device"));
}

/// A hand-written CPU that serves our client, and closes the connection when asked for its identity.
#[test]
fn a_cpu_that_hangs_up_when_it_is_asked_who_it_is_is_read_all_the_same() {
    logged::expect("nothing is written into the PLC");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let pair = Pair {
        address: listener.local_addr().expect("it is bound"),
        ..Pair::new("controller", "")
    };
    let mut device = Alone::open(&config(&pair, "device", ""), &KINDS);
    let cpu = std::thread::spawn(move || {
        let mut connections = 0;
        loop {
            connections += 1;
            let (stream, _) = listener.accept().expect("the client connects");
            let mut client = Client(stream);
            assert_eq!(client.receive().expect("it asks")[5], 0xE0);
            client.send(&CONFIRM);
            client.receive().expect("it asks for a length");
            client.send(&packet(&[
                0x32, 3, 0, 0, 0, 1, 0, 8, 0, 0, 0, 0, 0xF0, 0, 0, 1, 0, 1, 1, 0xE0,
            ]));
            let next = client.receive().expect("it asks for something");
            if next[8] == 7 {
                continue;
            }
            let answer = [
                &[0x32, 3, 0, 0, next[11], next[12], 0, 2, 0, 10, 0, 0, 4, 1][..],
                &[0xFF, 4, 0, 48, 0, 0, 0, 7, 0, 7],
            ];
            client.send(&packet(&answer.concat()));
            // Until the value was taken, and the client has left.
            while client.receive().is_some() {}
            return connections;
        }
    });
    device.until_speed(7);
    let who = device.end.statistic("identity");
    assert!(who.starts_with("S7 CPU at 127.0.0.1:"), "{who}");
    device.end.driver.close();
    assert_eq!(cpu.join().expect("no panic"), 3);
}

/// Two stations in one job per direction, and one with inputs only.
#[test]
fn the_stations_of_a_client_lie_where_their_tables_say() {
    let signals = "[[signal]]\nname = \"a\"\nstation = \"one\"\naddress = \"%QW0\"\n\
        [[signal]]\nname = \"b\"\nstation = \"two\"\naddress = \"%QB2\"\n\
        [[signal]]\nname = \"c\"\nstation = \"one\"\naddress = \"%IB0\"\n\
        [[signal]]\nname = \"d\"\nstation = \"three\"\naddress = \"%ID4\"\n";
    let head =
        "[driver]\nid = 1\nname = \"machine\"\n[fieldbus]\ncycle = \"1ms\"\nmax_age = \"300ms\"\n";
    let blocks = "db = [{ number = 1, area = \"%Q\", station = \"one\" }, { number = 2, area = \"%Q\", \
        station = \"two\" }, { number = 3, area = \"%I\", station = \"one\" }, { number = 4, area = \"%I\", \
        station = \"three\", offset = 2 }]";
    let mut device = Alone::open(
        &format!(
            "{head}kind = \"s7-server\"\naddress = \"127.0.0.1:0\"\n{blocks}\n\
         [[station]]\nname = \"one\"\n[[station]]\nname = \"two\"\n[[station]]\nname = \"three\"\n{signals}"
        ),
        &KINDS,
    );
    let at = device.address();
    let mut plc = conformance::rig::End::open(
        &format!(
            "{head}kind = \"s7-client\"\naddress = \"{at}\"\nrole = \"controller\"\n\
             write_to = \"tickbus machine\"\n\
             [[station]]\nname = \"one\"\noutput = \"DB1\"\ninput = \"DB3\"\n\
             [[station]]\nname = \"two\"\noutput = \"DB2\"\n\
             [[station]]\nname = \"three\"\ninput = \"DB4\"\ninput_bytes = 6\n{}",
            signals.replace("%ID4", "%ID2")
        ),
        &device.clock,
        &KINDS,
    );
    plc.set("a", 0x0102.into());
    plc.set("b", 3.0);
    device.end.set("c", 4.0);
    device.end.set("d", 5.0);
    let values = |end: &conformance::rig::End, names: [&str; 2]| names.map(|name| end.get(name));
    device.until("the values arrive", |end| {
        plc.tick();
        values(end, ["a", "b"]) == [258.0, 3.0] && values(&plc, ["c", "d"]) == [4.0, 5.0]
    });
    assert_eq!(plc.statistic("pdu"), "960");
}

/// Signals in the memory of a CPU in which every byte was 0xA5.
#[test]
fn nothing_is_written_but_the_bits_that_signals_cover() {
    let (device, at) = server("m_bytes = 256");
    let mut panel = Client::new(at);
    panel.write(FLAGS, 0, &[0xA5; 256]);
    let text = format!(
        "[driver]\nid = 1\nname = \"machine\"\n[fieldbus]\nkind = \"s7-client\"\naddress = \"{at}\"\n\
         cycle = \"1ms\"\nmax_age = \"300ms\"\nwrite_to = \"tickbus device\"\ninput = \"%MB100\"\n\
         [fieldbus.at]\n\"level\" = \"%MW20\"\n\"open\" = \"%M30.3\"\n\"shut\" = \"M30.4:BOOL\"\n\
         [[signal]]\nname = \"level\"\naddress = \"%IW0\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"open\"\naddress = \"%IX2.0\"\n\
         [[signal]]\nname = \"shut\"\naddress = \"%IX2.1\"\n\
         [[signal]]\nname = \"far\"\naddress = \"%IW8\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"echo\"\naddress = \"%QW4\"\ntype = \"INT\"\n"
    );
    let mut machine = conformance::rig::End::open(&text, &device.clock, &KINDS);
    machine.set("level", 0x0102.into());
    machine.set("open", 1.0);
    machine.set("shut", 1.0);
    machine.set("far", 0x0304.into());
    let mut expected = [0xA5; 256];
    expected[20..22].copy_from_slice(&[1, 2]);
    expected[30] = 0xA5 | 0b1_1000;
    expected[108..110].copy_from_slice(&[3, 4]);
    await_that("the values are there", || {
        pass(&device.clock, 2);
        machine.tick();
        panel.read(FLAGS, 20, 2) == [1, 2]
    });
    assert_eq!(panel.read(FLAGS, 0, 256), expected);
    machine.set("open", 0.0);
    // Adjacent bits written by another client in the meantime must be kept.
    panel.write(FLAGS, 30, &[0xFF]);
    expected[30] = !0b1000;
    await_that("the bit is cleared", || {
        pass(&device.clock, 2);
        machine.tick();
        panel.read(FLAGS, 30, 1) == [expected[30]]
    });
    assert_eq!(panel.read(FLAGS, 0, 256), expected);
}

#[test]
fn a_signal_is_read_where_its_line_says_and_else_in_its_area() {
    logged::expect("nothing is written into the PLC");
    let (mut device, at) = server("");
    let text = format!(
        "[driver]\nid = 1\nname = \"plc\"\n[fieldbus]\nkind = \"s7-client\"\naddress = \"{at}\"\nrole = \"controller\"\n\
         cycle = \"1ms\"\nmax_age = \"300ms\"\n[fieldbus.at]\n\"where\" = \"%IW2\"\n\"low\" = \"%I3.0\"\n\
         [[signal]]\nname = \"where\"\naddress = \"%IW100\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"low\"\naddress = \"%IX102.7\"\n\
         [[signal]]\nname = \"copy\"\naddress = \"%IW4\"\ntype = \"INT\"\n"
    );
    let mut plc = conformance::rig::End::open(&text, &device.clock, &KINDS);
    device.end.set("position", 515.0);
    device.end.set("copy", 7.0);
    device.until("the values arrive", |_| {
        plc.tick();
        (plc.get("where"), plc.get("low"), plc.get("copy")) == (515.0, 1.0, 7.0)
    });
}

/// A machine with two stations in data blocks 5 and 7 of `cpu`.
fn machine_of_two(cpu: Cpu) -> (Alone, Arc<Mutex<Cpu>>) {
    machine_with(cpu, "output = \"DB7\"", "%QB0")
}

/// The same with the right station at another place, and its signal, too.
fn machine_with(cpu: Cpu, right: &str, address: &str) -> (Alone, Arc<Mutex<Cpu>>) {
    logged::expect("nothing is written into the PLC");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let at = listener.local_addr().expect("it is bound");
    let cpu = Arc::new(Mutex::new(cpu));
    Cpu::serve(listener, Arc::clone(&cpu));
    let machine = Alone::open(
        &format!(
            "[driver]\nid = 1\nname = \"machine\"\n[fieldbus]\nkind = \"s7-client\"\naddress = \"{at}\"\ncycle = \"1ms\"\n\
         max_age = \"300ms\"\nreconnect = [\"10ms\"]\n\
         [[station]]\nname = \"left\"\noutput = \"DB5\"\n[[station]]\nname = \"right\"\n{right}\n\
         [[signal]]\nname = \"l\"\nstation = \"left\"\naddress = \"%QB0\"\nfail_safe = 99\n\
         [[signal]]\nname = \"r\"\nstation = \"right\"\naddress = \"{address}\"\nfail_safe = 99\n"
        ),
        &KINDS,
    );
    (machine, cpu)
}

fn both(end: &conformance::rig::End) -> (f64, f64) {
    (end.get("l"), end.get("r"))
}

#[test]
fn the_age_of_a_slot_is_its_own() {
    let text = "[driver]\nid = 1\nname = \"two\"\n[fieldbus]\nkind = \"s7-server\"\naddress = \"127.0.0.1:0\"\n\
        max_age = \"300ms\"\n[[station]]\nname = \"one\"\nslot = 1\n[[station]]\nname = \"two\"\nslot = 2\n\
        [[signal]]\nname = \"a\"\nstation = \"one\"\naddress = \"%QB0\"\nfail_safe = 99\n\
        [[signal]]\nname = \"b\"\nstation = \"two\"\naddress = \"%QB0\"\nfail_safe = 99\n";
    let mut device = Alone::open(text, &KINDS);
    let at = device.address();
    let mut one = Client::in_slot(at, 1);
    let mut two = Client::in_slot(at, 2);
    one.write(OUTPUTS, 0, &[11]);
    two.write(OUTPUTS, 0, &[12]);
    device.end.tick();
    assert_eq!((device.end.get("a"), device.end.get("b")), (11.0, 12.0));
    drop(one);
    device.until("the slot that is gone has its fail-safe value", |end| {
        two.write(OUTPUTS, 0, &[13]);
        end.tick();
        end.get("a") == 99.0
    });
    assert_eq!(device.end.get("b"), 13.0);
}
