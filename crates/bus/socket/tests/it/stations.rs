//! One driver with a peer for each of its stations: an event at one peer does not affect the others.
#![cfg(unix)]

use std::fmt::Write as _;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::os::fd::AsRawFd as _;
use tickbus_conformance as conformance;

use crate::ends::KINDS;
use conformance::peers::{Alone, client, is_closed, leave};
use conformance::resources;
use conformance::rig::{await_that, logged};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tickbus_fieldbus::{Cause, LinkState};

/// A device that listens for the peers of its two stations.
fn device() -> (Alone, [SocketAddr; 2]) {
    let mut text = "[driver]\nid = 1\nname = \"two\"\n[fieldbus]\nkind = \"socket\"\n\
                    cycle = \"1ms\"\nmax_age = \"300ms\"\n"
        .to_owned();
    for name in ["a", "b"] {
        let _ = writeln!(
            text,
            "[[station]]\nname = \"{name}\"\naddress = \"127.0.0.1:0\""
        );
    }
    for name in ["a", "b"] {
        for (word, area) in [("to", 'Q'), ("from", 'I')] {
            let _ = writeln!(
                text,
                "[[signal]]\nname = \"{word} {name}\"\nstation = \"{name}\"\naddress = \"%{area}B0\""
            );
        }
    }
    let alone = Alone::open(&text, &KINDS);
    let mut addresses = Vec::new();
    await_that("it listens for both", || {
        let statistics = alone.end.driver.statistics();
        let mut lines = statistics.lines();
        let bound = lines.find_map(|line| line.strip_prefix("address="));
        let bound = bound.unwrap_or_default().split(' ');
        addresses = bound.filter_map(|address| address.parse().ok()).collect();
        addresses.len() == 2
    });
    (alone, [addresses[0], addresses[1]])
}

/// Sends `value` repeatedly from each of these peers, until it has arrived.
#[track_caller]
fn until_heard(device: &mut Alone, peers: &mut [(&str, &mut TcpStream)], value: u8) {
    device.until("the values arrive", |end| {
        let sent = |(name, peer): &mut (&str, &mut TcpStream)| {
            peer.write_all(&[value]).expect("the device reads");
            end.get(&format!("to {name}")) == f64::from(value)
        };
        // Every peer sends, whether or not the others have arrived.
        let arrived: Vec<bool> = peers.iter_mut().map(sent).collect();
        arrived.into_iter().all(|one| one)
    });
}

fn inject(device: &mut Alone, fault: &str) -> u32 {
    let id = device.end.driver.inject_text(fault);
    let id = id.unwrap_or_else(|why| panic!("{why}"));
    device.until("the fault is active", |end| {
        !end.statistic("fault.active").is_empty()
    });
    id
}

#[test]
fn a_fault_that_is_over_leaves_nothing_behind_on_a_station_whose_neighbour_is_away() {
    let (mut device, [_, b]) = device();
    let mut peer = client(b);
    until_heard(&mut device, &mut [("b", &mut peer)], 1);
    let fault = inject(
        &mut device,
        "kind = \"drop\"\nchance = 1\ndirection = \"in\"",
    );
    device.until("records get lost", |end| {
        peer.write_all(&[2]).expect("the device reads");
        end.statistic("fault.dropped") != "0"
    });
    assert_ne!(device.end.get("to b"), 2.0);
    assert!(device.end.driver.end_fault(fault));
    until_heard(&mut device, &mut [("b", &mut peer)], 3);
    let stale = |name: &str| device.end.statistic(&format!("station.{name}.stale"));
    assert_eq!((stale("a"), stale("b")), ("true".into(), "false".into()));
    assert_ne!(device.end.statistic("station.b.bus_cycles"), "0");
    assert_eq!(device.end.statistic("station.a.bus_cycles"), "0");
}

#[test]
fn each_station_has_the_octets_of_its_own_line() {
    let (mut device, addresses) = device();
    let [mut a, mut b] = addresses.map(client);
    a.write_all(&[1]).expect("the device reads");
    b.write_all(&[1, 2]).expect("the device reads");
    device.until("all records have come", |end| {
        end.driver.statistics().contains("\nline.data_in=3\n")
    });
    for (key, value) in [
        ("line.octets_in", "3"),
        ("station.a.line.octets_in", "1"),
        ("station.b.line.octets_in", "2"),
        ("station.b.line.data_in", "2"),
    ] {
        assert_eq!(device.end.statistic(key), value, "{key}");
    }
    // A new connection continues the counts.
    leave(a);
    let mut a = client(addresses[0]);
    a.write_all(&[3]).expect("the device reads");
    device.until("it is counted", |end| {
        end.statistic("station.a.line.octets_in") == "2"
    });
    assert_eq!(device.end.statistic("line.octets_in"), "4");
}

/// The records that have arrived since the last call.
fn records(mut peer: &TcpStream) -> usize {
    peer.set_nonblocking(true).expect("a TCP option");
    let count = peer.read(&mut [0; 4096]).unwrap_or(0);
    peer.set_nonblocking(false).expect("a TCP option");
    count
}

#[test]
fn a_station_that_is_down_sends_nothing_and_its_neighbour_does() {
    let (mut device, [a, b]) = device();
    let (mut a, mut b) = (client(a), client(b));
    until_heard(&mut device, &mut [("a", &mut a), ("b", &mut b)], 1);
    let fault = inject(&mut device, "kind = \"station-down\"\nstation = \"b\"");
    records(&a);
    device.until("a cycle passes", |_| records(&a) > 0);
    while records(&b) > 0 {}
    let mut sent = 0;
    device.until("20 cycles pass", |_| {
        sent += records(&a);
        sent > 20
    });
    assert_eq!(records(&b), 0);
    assert!(device.end.driver.end_fault(fault));
    device.until("it is back", |_| records(&b) > 0);
}

#[test]
fn a_line_that_becomes_stale_names_the_station_that_is_silent() {
    let (mut device, [a, b]) = device();
    let (mut a, mut b) = (client(a), client(b));
    until_heard(&mut device, &mut [("a", &mut a), ("b", &mut b)], 1);
    device.until("the line runs", |end| {
        a.write_all(&[1]).expect("the device reads");
        b.write_all(&[1]).expect("the device reads");
        end.link().state == LinkState::Running
    });
    device.until("the line is stale", |end| {
        a.write_all(&[1]).expect("the device reads");
        end.link().cause == Cause::Silent
    });
    let reason = device.end.link().reason;
    let said = reason.starts_with("nothing has come from station \"b\" for ");
    assert!(said && !reason.contains("\"a\""), "{reason}");
    assert_eq!(device.end.statistic("station.b.stale"), "true");
}

#[test]
fn a_record_that_is_held_back_is_handed_in_on_time_though_its_peer_has_left() {
    let (mut device, [_, b]) = device();
    inject(&mut device, "kind = \"delay\"\nby = \"100ms\"");
    let mut peer = client(b);
    peer.write_all(&[7]).expect("the device reads");
    leave(peer);
    device.until("it is handed in", |end| end.get("to b") == 7.0);
    assert_eq!(device.end.statistic("station.b.bus_cycles"), "1");
}

#[test]
fn a_system_without_descriptors_costs_the_served_peer_nothing() {
    let test = "a_system_without_descriptors_costs_the_served_peer_nothing";
    if !resources::alone(&format!("{}::{test}", module_path!())) {
        return;
    }
    let (mut device, [a, b]) = device();
    let mut a = client(a);
    until_heard(&mut device, &mut [("a", &mut a)], 1);
    logged::expect("a client could not be accepted");
    // Room for one more descriptor, which the client of b takes.
    let next = File::open("/dev/null").expect("it is there").as_raw_fd();
    let usual = getrlimit(Resource::Nofile);
    let one_more = Rlimit {
        current: Some(u64::try_from(next).expect("a number") + 1),
        ..usual
    };
    setrlimit(Resource::Nofile, one_more).expect("less is always allowed");
    let mut b = client(b);
    device.until("the system has no descriptor for it", |end| {
        let text = end.driver.statistics();
        text.contains("\nclients.not_accepted=")
    });
    until_heard(&mut device, &mut [("a", &mut a)], 2);
    setrlimit(Resource::Nofile, usual).expect("as it was");
    until_heard(&mut device, &mut [("b", &mut b)], 3);
    assert!(!is_closed(&a), "the same connection all the time");
}
