//! The names of channels on several hosts.

use crate::common::hosts::Hosts;
use crate::hosts::{SILENCE, hosts};

/// The names of channels as a host lists them.
fn names(hosts: &mut Hosts, host: usize, seat: usize) -> Vec<String> {
    let mut lines = hosts.ask(host, seat, "LIST NAMES");
    lines.retain(|line| line.starts_with("NAME "));
    lines
}

#[test]
fn the_names_of_channels_are_the_same_on_all_hosts() {
    let mut hosts = hosts();
    let pump = hosts.join(0, "VP PUMP Q02 AQ1 V=2");
    let logo = hosts.join(1, "VR LOGO I01 V=2");
    hosts.ask(0, pump, "NAME Q1 Pumpe läuft");
    hosts.ask(0, pump, "NAME AQ0 Level");
    hosts.ask(1, logo, "NAME I1 Start");
    let all = [
        "NAME PUMP:Q1 Pumpe läuft",
        "NAME PUMP:AQ0 Level",
        "NAME LOGO:I1 Start",
    ];
    for (host, seat) in [(0, pump), (1, logo)] {
        assert_eq!(names(&mut hosts, host, seat), all);
    }
    // The page of a third one shows them.
    let seen = hosts.labs[2].dispatcher.snapshot();
    let channels = seen.clients.iter().flat_map(|client| &client.channels);
    let labels = channels.filter_map(|channel| channel.label.as_ref());
    assert_eq!(
        labels.map(ToString::to_string).collect::<Vec<_>>(),
        ["Pumpe läuft", "Level", "Start"]
    );

    // A name that changes while a host is cut off, or whose letter is lost.
    hosts.cut(0, 1);
    hosts.ask(0, pump, "NAME Q1 Pump");
    hosts.wait(SILENCE);
    assert_eq!(names(&mut hosts, 1, logo), ["NAME LOGO:I1 Start"]);
    hosts.heal();
    hosts.wait(1);
    assert_eq!(names(&mut hosts, 1, logo)[0], "NAME PUMP:Q1 Pump");
    hosts.to_lose = 2;
    hosts.ask(0, pump, "NAME Q2 Alarm");
    hosts.wait(SILENCE);
    assert_eq!(names(&mut hosts, 1, logo)[1], "NAME PUMP:Q2 Alarm");

    // They leave with their client.
    hosts.labs[0].dispatcher.gone(pump);
    hosts.settle();
    hosts.join(2, "VP PUMP Q02 AQ1");
    assert_eq!(names(&mut hosts, 1, logo), ["NAME LOGO:I1 Start"]);
}

#[test]
fn a_client_that_renames_its_channels_without_end_fills_no_queue() {
    let mut hosts = hosts();
    let pump = hosts.join(0, "VP PUMP Q02 V=2");
    for count in 0..20_000 {
        let told = hosts.labs[0].ask(pump, &format!("NAME Q{} n{count}", 1 + count % 2));
        assert_eq!(told, ["OK NAME"]);
    }
    let mut letters = 0;
    while hosts.carry_one() {
        letters += 1;
    }
    assert!(letters <= 4, "{letters} letters");
    let logo = hosts.join(1, "VR LOGO I01");
    assert_eq!(
        names(&mut hosts, 1, logo),
        ["NAME PUMP:Q1 n19998", "NAME PUMP:Q2 n19999"]
    );
}
