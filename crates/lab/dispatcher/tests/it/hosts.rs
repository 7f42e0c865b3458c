//! Several dispatchers as one laboratory, without a network: letters are carried, lost and cut by hand.

use std::collections::{BTreeMap, BTreeSet};

use crate::common::hosts::{Hosts, NAMES, id, number, order, pin};
use proptest::prelude::*;
use tickbus_base::time::Nanos;
use tickbus_dispatcher::{Device, OnLoss, Order, Pin, Settings};

const NOTHING: [&str; 0] = [];

/// A day without a line is no reason to disconnect.
fn settings(on_loss: OnLoss) -> Settings {
    Settings {
        idle: Nanos::from_secs(86_400),
        on_loss,
        ..Settings::default()
    }
}

pub(crate) fn hosts() -> Hosts {
    Hosts::new(settings(OnLoss::FailSafe))
}

/// The time after which a silent host is cut off.
pub(crate) const SILENCE: i64 = 6;

fn refused(heard: &[String], code: u16) -> String {
    let [line] = heard else {
        panic!("{heard:?}");
    };
    assert!(line.starts_with(&format!("ERR {code} ")), "{line}");
    line.clone()
}

#[test]
fn clients_of_all_hosts_are_in_the_list_with_their_hosts_and_are_connected_by_name() {
    let mut hosts = hosts();
    let pump = hosts.join(0, "VP PUMP Q02 I02");
    hosts.ask(0, pump, "P Q1=20");
    let logo = hosts.join(1, "VR LOGO Q01 I02 V=2");
    let here = "VR:LOGO:Q01:I02:AQ00:AI00:192.168.0.20:4330";
    let there = "VP:PUMP:Q02:I02:AQ00:AI00:192.168.0.20:3330";
    assert_eq!(
        hosts.ask(1, logo, "LIST"),
        ["OK LIST", &format!("{there}@alpha"), here, "END 2"]
    );
    assert_eq!(
        hosts.ask(0, pump, "LIST"),
        [there, here],
        "version 1 sees what the paper describes"
    );
    assert_eq!(
        hosts.ask(1, logo, "CONNECT I1:PUMP:Q1 I2:P1:Q2"),
        ["OK CONNECT", "P I1=20"],
        "with the value of now; by number as well"
    );
    assert_eq!(hosts.patch(1), ["LOGO:I1 = PUMP:Q1", "LOGO:I2 = PUMP:Q2"]);
    assert_eq!(
        hosts.patch(0),
        NOTHING,
        "it belongs to the host of the sink"
    );
    hosts.ask(0, pump, "P Q1=1 Q2=2\r\nP Q1=0\r\nP Q1=1");
    assert_eq!(
        hosts.hear(1, logo),
        ["P I1=1 I2=2", "P I1=0", "P I1=1"],
        "what came together arrives together, and no pulse is lost"
    );
    assert_eq!(
        hosts.ask(1, logo, "DISCONNECT I1"),
        ["P I1=0", "OK DISCONNECT"]
    );
    hosts.ask(0, pump, "P Q1=5");
    assert_eq!(hosts.hear(1, logo), NOTHING);
    assert_eq!(
        hosts.ask(1, logo, "CONNECT I1:PUMP:Q1"),
        ["OK CONNECT", "P I1=5"],
        "not the value that was known when it was cut"
    );
    let third = hosts.labs[2].connect();
    let told = hosts.ask(2, third, "VP PUMP Q01");
    assert!(refused(&told, 409).contains("already on alpha"), "{told:?}");
    hosts.labs[0].dispatcher.gone(pump);
    assert_eq!(hosts.hear(1, logo), ["P I1=0 I2=0"]);
    hosts.join(2, "VP PUMP Q01");
}

#[test]
fn an_output_is_connected_with_an_input_elsewhere_and_the_other_side_answers() {
    let mut hosts = hosts();
    let logo = hosts.join(1, "VR LOGO I03");
    let other = hosts.join(2, "VR OTHER I01");
    let pump = hosts.join(0, "VP PUMP Q02 I01 V=2");
    hosts.ask(0, pump, "P Q1=20");
    assert_eq!(hosts.ask(0, pump, "CONNECT Q1:LOGO:I1"), ["OK CONNECT"]);
    assert_eq!(hosts.hear(1, logo), ["P I1=20"]);
    assert_eq!(hosts.patch(1), ["LOGO:I1 = PUMP:Q1"]);
    assert_eq!(hosts.patch(0), NOTHING);
    assert_eq!(hosts.ask(0, pump, "CONNECT Q1:LOGO:I1"), ["OK CONNECT"]);
    refused(&hosts.ask(0, pump, "CONNECT Q2:LOGO:I1"), 409);
    refused(&hosts.ask(0, pump, "CONNECT Q2:LOGO:I4"), 404);
    refused(&hosts.ask(0, pump, "CONNECT Q2:LOGO@beta:I2"), 404);
    assert_eq!(
        hosts.ask(0, pump, "CONNECT Q1:PUMP:I1 Q1:LOGO:I2 Q2:OTHER:I1"),
        ["OK CONNECT", "P I1=20"],
        "three hosts in a line"
    );
    assert_eq!(hosts.hear(1, logo), ["P I2=20"]);
    assert_eq!(
        hosts.ask(0, pump, "DISCONNECT Q1"),
        ["P I1=0", "OK DISCONNECT"]
    );
    assert_eq!(hosts.hear(1, logo), ["P I1=0 I2=0"]);
    assert_eq!(hosts.patch(1), NOTHING);
    assert_eq!(hosts.patch(2), ["OTHER:I1 = PUMP:Q2"]);
    refused(&hosts.ask(0, pump, "DISCONNECT Q1"), 404);
    // The connection sleeps; cutting it still works.
    hosts.labs[2].dispatcher.gone(other);
    hosts.settle();
    assert_eq!(hosts.ask(0, pump, "DISCONNECT Q2"), ["OK DISCONNECT"]);
    assert_eq!(hosts.patch(2), NOTHING);
}

#[test]
fn when_one_host_refuses_the_others_undo_what_they_did() {
    let mut hosts = hosts();
    let logo = hosts.join(1, "VR LOGO I01");
    let other = hosts.join(2, "VR OTHER Q01 I01");
    let pump = hosts.join(0, "VP PUMP Q02 I01 V=2");
    // The letter on its way is not known here yet: the line passes here, and fails there.
    hosts.labs[2].say(other, "CONNECT I1:OTHER:Q1");
    let told = hosts.ask(0, pump, "CONNECT Q1:LOGO:I1 Q1:OTHER:I1 Q2:PUMP:I1");
    assert!(refused(&told, 409).contains("OTHER:I1 is connected to OTHER:Q1"));
    assert_eq!(hosts.patch(0), NOTHING);
    assert_eq!(hosts.patch(1), NOTHING);
    assert_eq!(hosts.patch(2), ["OTHER:I1 = OTHER:Q1"]);
    hosts.ask(0, pump, "P Q1=3");
    assert_eq!(hosts.hear(1, logo), NOTHING);
    // The client leaves while the request is on its way.
    hosts.labs[0].say(pump, "CONNECT Q1:LOGO:I1");
    hosts.labs[1].dispatcher.gone(logo);
    refused(&hosts.hear(0, pump), 404);
    assert_eq!(hosts.patch(1), NOTHING);
}

#[test]
fn a_client_that_leaves_before_all_hosts_have_answered_is_connected_wholly() {
    let mut hosts = hosts();
    hosts.join(1, "VR LOGO Q01 I01");
    let pump = hosts.join(0, "VP PUMP Q01 I01");
    hosts.labs[0].say(pump, "CONNECT I1:LOGO:Q1 Q1:LOGO:I1");
    hosts.labs[0].dispatcher.gone(pump);
    hosts.settle();
    hosts.labs[0].settle();
    assert_eq!(hosts.patch(1), ["LOGO:I1 = PUMP:Q1"]);
    assert_eq!(hosts.patch(0), ["PUMP:I1 = LOGO:Q1"]);
}

#[test]
fn a_client_that_waits_for_a_host_that_is_cut_off_is_answered() {
    let mut hosts = hosts();
    hosts.join(1, "VR LOGO I01");
    let pump = hosts.join(0, "VP PUMP Q01 V=2");
    hosts.cut(0, 1);
    assert_eq!(hosts.ask(0, pump, "CONNECT Q1:LOGO:I1\r\nPING"), NOTHING);
    hosts.wait(SILENCE);
    let heard = hosts.hear(0, pump);
    assert!(
        heard[0].starts_with("ERR 404 beta was cut off"),
        "{heard:?}"
    );
    assert_eq!(heard[1..], ["OK PING"]);
    refused(&hosts.ask(0, pump, "CONNECT Q1:LOGO:I1"), 404);
    // A single lost letter is requested again.
    hosts.heal();
    hosts.wait(2);
    hosts.to_lose = 1;
    assert_eq!(hosts.ask(0, pump, "CONNECT Q1:LOGO:I1"), NOTHING);
    hosts.wait(3);
    assert_eq!(hosts.hear(0, pump), ["OK CONNECT"]);
    assert_eq!(hosts.patch(1), ["LOGO:I1 = PUMP:Q1"]);
}

#[test]
fn connections_sleep_while_a_host_is_cut_off_and_wake_with_the_value_of_now() {
    for on_loss in [OnLoss::FailSafe, OnLoss::Hold] {
        let mut hosts = Hosts::new(settings(on_loss));
        let pump = hosts.join(0, "VP PUMP Q01");
        let logo = hosts.join(1, "VR LOGO I02 V=2");
        let near = hosts.join(1, "VP NEAR Q01");
        hosts.ask(0, pump, "P Q1=7");
        hosts.ask(1, logo, "CONNECT I1:PUMP:Q1 I2:NEAR:Q1");
        hosts.cut(0, 1);
        hosts.cut(0, 2);
        hosts.wait(SILENCE);
        let lost = hosts.hear(1, logo);
        match on_loss {
            OnLoss::FailSafe => assert_eq!(lost, ["P I1=0"]),
            OnLoss::Hold => assert_eq!(lost, NOTHING),
        }
        assert_eq!(hosts.ask(1, logo, "LIST").len(), 4, "it is not in the list");
        hosts.ask(0, pump, "P Q1=8");
        hosts.ask(1, near, "P Q1=1");
        assert_eq!(hosts.hear(1, logo), ["P I2=1"], "the rest goes on");
        assert_eq!(hosts.patch(1).len(), 2, "it sleeps");
        hosts.heal();
        assert_eq!(hosts.hear(1, logo), ["P I1=8"]);
        assert_eq!(
            hosts.news(1),
            [
                "the dispatcher of alpha is here; its clients: 0",
                "the dispatcher of gamma is here; its clients: 0",
                "the dispatcher of alpha is gone; connections with its clients sleep",
                "the dispatcher of alpha is here; its clients: 1",
            ]
        );
        // A dispatcher that ends is gone at once.
        hosts.labs[1].dispatcher.host_vanished(id(0));
        assert_eq!(
            hosts.hear(1, logo).len(),
            usize::from(on_loss == OnLoss::FailSafe)
        );
    }
}

#[test]
fn letters_that_get_lost_are_noticed_and_nobody_is_cut_off() {
    let mut hosts = hosts();
    let pump = hosts.join(0, "VP PUMP Q01");
    let logo = hosts.join(1, "VR LOGO I01");
    hosts.ask(1, logo, "CONNECT I1:PUMP:Q1");
    hosts.ask(0, pump, "P Q1=1");
    hosts.hear(1, logo);
    hosts.wait(2);
    for value in 2..6 {
        hosts.to_lose = 1;
        hosts.ask(0, pump, &format!("P Q1={value}"));
        assert_eq!(hosts.hear(1, logo), NOTHING);
        hosts.wait(2);
        assert_eq!(hosts.hear(1, logo), [format!("P I1={value}")]);
    }
    hosts.to_lose = 1;
    hosts.ask(0, pump, "P Q1=6");
    hosts.ask(0, pump, "P Q1=7");
    hosts.wait(2);
    assert_eq!(hosts.hear(1, logo), ["P I1=7"]);
    assert_eq!(hosts.news(1).len(), 2);
}

#[test]
fn of_two_clients_with_one_name_the_first_keeps_it_and_the_other_gets_it_back() {
    let mut hosts = hosts();
    let watch = hosts.join(2, "VP WATCH I02");
    hosts.cut(0, 1);
    hosts.cut(1, 2);
    hosts.wait(SILENCE);
    let late = hosts.join(1, "VP OWN I01");
    hosts.wait(1);
    let first = hosts.join(0, "VP PUMP Q01");
    hosts.wait(1);
    let second = hosts.join(1, "VP PUMP Q01 I01 V=2");
    hosts.ask(0, first, "P Q1=1");
    hosts.ask(1, second, "P Q1=2");
    assert_eq!(hosts.ask(1, late, "CONNECT I1:PUMP:Q1"), ["P I1=2"]);
    hosts.ask(2, watch, "CONNECT I1:PUMP:Q1");
    hosts.hear(2, watch);
    for host in 0..3 {
        hosts.news(host);
    }
    hosts.heal();
    hosts.settle();
    let told = "two clients are named PUMP; the later one is PUMP@beta until the other leaves";
    for host in 0..3 {
        let news = hosts.news(host);
        assert!(news.iter().any(|line| line == told), "{news:?}");
    }
    assert_eq!(
        hosts.hear(1, late),
        ["P I1=0", "P I1=1"],
        "the name goes on"
    );
    assert_eq!(hosts.hear(2, watch), NOTHING);
    let list = hosts.ask(1, second, "LIST");
    let names: Vec<_> = list
        .iter()
        .filter_map(|line| line.split(':').nth(1))
        .collect();
    assert_eq!(names, ["WATCH", "OWN", "PUMP", "PUMP@beta"]);
    // The client takes part under its long name.
    assert_eq!(hosts.ask(2, watch, "CONNECT I2:PUMP@beta:Q1"), ["P I2=2"]);
    assert_eq!(
        hosts.ask(1, second, "CONNECT I1:PUMP:Q1"),
        ["OK CONNECT", "P I1=1"]
    );
    assert_eq!(
        hosts.patch(1),
        ["OWN:I1 = PUMP:Q1", "PUMP@beta:I1 = PUMP:Q1"]
    );
    let third = hosts.labs[2].connect();
    refused(&hosts.ask(2, third, "VP PUMP Q01"), 409);
    hosts.labs[0].dispatcher.gone(first);
    assert_eq!(hosts.hear(1, late), ["P I1=0", "P I1=2"]);
    assert_eq!(hosts.hear(2, watch), ["P I1=0", "P I2=0", "P I1=2"]);
    assert_eq!(hosts.news(2), ["PUMP@beta has the name PUMP now"]);
}

#[test]
fn hosts_of_one_name_are_told_apart() {
    let mut hosts = hosts();
    for (one, other) in [(0, 1), (0, 2), (1, 2)] {
        hosts.cut(one, other);
    }
    hosts.wait(SILENCE);
    for host in 0..3 {
        // The second and the third dispatcher claim to be the same computer.
        let identity = tickbus_dispatcher::Identity::new(id(host), ["a", "b?", "b?"][host], 0);
        hosts.labs[host].dispatcher.federate(identity);
        hosts.join(host, "VP PUMP Q01");
        hosts.wait(1);
    }
    hosts.heal();
    hosts.wait(2);
    for host in 0..3 {
        let seat = hosts.join(host, &format!("VP WATCH{host} Q01"));
        let list = hosts.ask(host, seat, "LIST");
        let names: Vec<_> = list
            .iter()
            .filter_map(|line| line.split(':').nth(1))
            .collect();
        assert_eq!(names[..3], ["PUMP", "PUMP@b-", "PUMP@b-@2"]);
    }
}

#[test]
fn an_operator_patches_clients_of_all_hosts_and_forces_those_of_one() {
    let mut hosts = hosts();
    let pump = hosts.join(0, "VP PUMP Q02");
    let logo = hosts.join(1, "VR LOGO I02");
    hosts.ask(0, pump, "P Q1=3");
    let joint = || Order::Connect(pin("PUMP:Q1"), pin("LOGO:I1"));
    assert_eq!(order(&mut hosts, 2, joint()), Ok(()), "both are elsewhere");
    assert_eq!(order(&mut hosts, 2, joint()), Ok(()));
    let other = Order::Connect(pin("PUMP:Q2"), pin("LOGO:I1"));
    let told = order(&mut hosts, 2, other).expect_err("it has a source");
    assert!(
        told.starts_with("ERR 409 LOGO:I1 is connected to PUMP:Q1"),
        "{told}"
    );
    assert_eq!(hosts.hear(1, logo), ["P I1=3"]);
    assert_eq!(hosts.patch(1), ["LOGO:I1 = PUMP:Q1"]);

    for (host, name) in NAMES.iter().enumerate() {
        let seen = hosts.labs[host].dispatcher.snapshot();
        let of: Vec<_> = seen
            .clients
            .iter()
            .map(|client| client.host.as_deref())
            .collect();
        let expected = [Some("alpha"), Some("beta")].map(|it| it.filter(|it| it != name));
        assert_eq!(of, expected);
        let [connection] = &seen.connections[..] else {
            panic!("{seen:?}");
        };
        assert!(connection.is_awake);
        assert_eq!(connection.sink, pin("LOGO:I1"));
    }

    let force = |value: &str| Order::Force(pin("PUMP:Q1"), number(value));
    let told = order(&mut hosts, 1, force("7")).expect_err("it is not here");
    assert!(told.contains("on alpha"), "{told}");
    assert_eq!(order(&mut hosts, 0, force("7")), Ok(()));
    assert_eq!(hosts.hear(1, logo), ["P I1=7"]);
    hosts.ask(0, pump, "P Q1=4");
    assert_eq!(hosts.hear(1, logo), NOTHING);
    // A new sink gets the forced value.
    let late = hosts.join(2, "VR LATE I01");
    assert_eq!(hosts.ask(2, late, "CONNECT I1:PUMP:Q1"), ["P I1=7"]);
    assert_eq!(order(&mut hosts, 0, Order::Release(pin("PUMP:Q1"))), Ok(()));
    assert_eq!(hosts.hear(1, logo), ["P I1=4"]);
    assert_eq!(hosts.hear(2, late), ["P I1=4"]);
    hosts.ask(0, pump, "P Q1=5");
    assert_eq!(hosts.hear(1, logo), ["P I1=5"]);

    let cut = Order::Disconnect(pin("PUMP:Q1"));
    assert_eq!(order(&mut hosts, 0, cut), Ok(()), "at two hosts");
    assert_eq!(hosts.hear(1, logo), ["P I1=0"]);
    assert_eq!(hosts.patch(1).len() + hosts.patch(2).len(), 0);
    let told = order(&mut hosts, 0, Order::Disconnect(pin("LOGO:I1")));
    assert_eq!(told, Err("ERR 404 LOGO:I1 is not connected".to_owned()));
}

#[test]
fn a_letter_of_another_version_is_told_once() {
    let mut hosts = hosts();
    hosts.news(0);
    for _ in 0..3 {
        let now = hosts.labs[0].now;
        hosts.labs[0].dispatcher.letter_arrived(now, &[9, 1, 2]);
    }
    let news = hosts.news(0);
    assert_eq!(news.len(), 1, "{news:?}");
    assert!(news[0].contains("version 9"), "{news:?}");
}

#[derive(Clone, Debug)]
enum Step {
    Join(usize, usize),
    Leave(usize),
    Set(usize, u16, u8),
    Connect(usize, Vec<(u16, usize, u16)>),
    Disconnect(usize, u16),
    Name(usize, u16, u8),
    Cut(usize, usize),
    Heal,
    Mend,
    Lose(usize),
    Carry(usize),
    Wait(i64),
}

/// Names of clients; each can be in use on every host while that is cut off.
const CLIENTS: [&str; 3] = ["A", "B", "C"];

/// Clients are numbered: 3 names on each of 3 hosts.
fn step() -> impl Strategy<Value = Step> {
    let client = 0..9_usize;
    let channel = 1..3_u16;
    let joint = (channel.clone(), 0..3_usize, channel.clone());
    prop_oneof![
        4 => (client.clone(), 0..2_usize).prop_map(|(client, shape)| Step::Join(client, shape)),
        1 => client.clone().prop_map(Step::Leave),
        6 => (client.clone(), channel.clone(), 0..4_u8).prop_map(|(client, at, value)| Step::Set(client, at, value)),
        6 => (client.clone(), prop::collection::vec(joint, 1..3)).prop_map(|(client, joints)| Step::Connect(client, joints)),
        1 => (client.clone(), channel.clone()).prop_map(|(client, channel)| Step::Disconnect(client, channel)),
        2 => (client, channel, 0..4_u8).prop_map(|(client, channel, name)| Step::Name(client, channel, name)),
        2 => (0..3_usize, 1..3_usize).prop_map(|(one, by)| Step::Cut(one, (one + by) % 3)),
        1 => Just(Step::Heal),
        1 => Just(Step::Mend),
        2 => (1..4_usize).prop_map(Step::Lose),
        6 => (1..20_usize).prop_map(Step::Carry),
        3 => (1..8_i64).prop_map(Step::Wait),
    ]
}

/// The last state that a client sent and received.
#[derive(Default)]
struct Client {
    host: usize,
    seat: usize,
    port: u16,
    said: BTreeMap<u16, u8>,
    heard: BTreeMap<u16, u8>,
    /// The numbers in the names of its inputs.
    named: BTreeMap<u16, u8>,
}

impl Client {
    fn hear(&mut self, lines: &[String]) {
        let words = lines.iter().filter_map(|line| line.strip_prefix("P "));
        for word in words.flat_map(|line| line.split(' ')) {
            let (channel, value) = word.split_once('=').expect(word);
            let channel = channel[1..].parse().expect(channel);
            self.heard.insert(channel, value.parse().expect(value));
        }
    }
}

#[derive(Default)]
struct Clients(BTreeMap<usize, Client>);

impl Clients {
    fn listen(&mut self, hosts: &mut Hosts) {
        for client in self.0.values_mut() {
            let heard = hosts.labs[client.host].hear(client.seat);
            client.hear(&heard);
        }
    }

    fn take(&mut self, hosts: &mut Hosts, step: &Step) {
        match step {
            Step::Join(at, shape) => {
                let host = at / CLIENTS.len();
                if self.0.contains_key(at) {
                    return;
                }
                let port = hosts.labs[host].next_port;
                let seat = hosts.labs[host].connect();
                let shape = ["Q02 I02", "Q01 I02"][*shape];
                let name = CLIENTS[at % CLIENTS.len()];
                let told = hosts.labs[host].ask(seat, &format!("VP {name} {shape}"));
                if told[0].starts_with("ERR") {
                    hosts.labs[host].dispatcher.gone(seat);
                    return;
                }
                let mut client = Client {
                    host,
                    seat,
                    port,
                    ..Client::default()
                };
                client.hear(&told);
                self.0.insert(*at, client);
            }
            Step::Leave(at) => {
                if let Some(client) = self.0.remove(at) {
                    hosts.labs[client.host].dispatcher.gone(client.seat);
                }
            }
            Step::Set(at, channel, value) => {
                let line = format!("P Q{channel}={value}");
                let Some(client) = self.0.get_mut(at) else {
                    return;
                };
                // A client that waits for an answer is not read.
                if hosts.labs[client.host].dispatcher.wants_bytes(client.seat) {
                    let refused = hosts.labs[client.host].dispatcher.traffic().refused;
                    hosts.labs[client.host].say(client.seat, &line);
                    if hosts.labs[client.host].dispatcher.traffic().refused == refused {
                        client.said.insert(*channel, *value);
                    }
                }
            }
            Step::Connect(at, joints) => {
                let joints = joints.iter().map(|(own, peer, channel)| {
                    // Half of the connections are requested from the output's side.
                    let (own_kind, kind) = if own % 2 == 0 { ("I", "Q") } else { ("Q", "I") };
                    format!(" {own_kind}{own}:{}:{kind}{channel}", CLIENTS[*peer])
                });
                let line = format!("CONNECT{}", joints.collect::<String>());
                if let Some(client) = self.0.get(at)
                    && hosts.labs[client.host].dispatcher.wants_bytes(client.seat)
                {
                    hosts.labs[client.host].say(client.seat, &line);
                }
            }
            Step::Disconnect(at, channel) => {
                if let Some(client) = self.0.get(at)
                    && hosts.labs[client.host].dispatcher.wants_bytes(client.seat)
                {
                    let line = format!("DISCONNECT Q{channel}");
                    hosts.labs[client.host].say(client.seat, &line);
                }
            }
            Step::Name(at, channel, name) => {
                if let Some(client) = self.0.get_mut(at)
                    && hosts.labs[client.host].dispatcher.wants_bytes(client.seat)
                {
                    let line = format!("NAME I{channel} {name}");
                    hosts.labs[client.host].say(client.seat, &line);
                    client.named.insert(*channel, *name);
                }
            }
            Step::Cut(one, other) => hosts.cut(*one, *other),
            Step::Heal => hosts.heal(),
            Step::Mend => hosts.mend(),
            Step::Lose(count) => hosts.to_lose = *count,
            Step::Carry(count) => drop((0..*count).all(|_| hosts.carry_one())),
            Step::Wait(seconds) => {
                let lost = hosts.to_lose;
                hosts.wait(*seconds);
                hosts.to_lose = hosts.to_lose.min(lost);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn after_healing_all_boards_agree_and_each_input_has_the_newest_value(
        holds: bool,
        is_said: bool,
        steps in prop::collection::vec(step(), 1..60),
    ) {
        let mut hosts = Hosts::new(settings(if holds { OnLoss::Hold } else { OnLoss::FailSafe }));
        let mut clients = Clients::default();
        for step in &steps {
            clients.take(&mut hosts, step);
            clients.listen(&mut hosts);
        }
        if is_said {
            hosts.heal();
        } else {
            hosts.mend();
        }
        hosts.wait(2 * SILENCE);
        clients.listen(&mut hosts);

        let mut boards = Vec::new();
        for host in 0..NAMES.len() {
            let seat = hosts.labs[host].connect();
            // Version 1 shows no hosts; the last line is the client that asks.
            hosts.labs[host].ask(seat, &format!("VP WATCH{host} Q01"));
            let mut list = hosts.labs[host].ask(seat, "LIST NAMES");
            list.pop();
            hosts.labs[host].dispatcher.gone(seat);
            boards.push(list);
        }
        prop_assert_eq!(&boards[0], &boards[1]);
        prop_assert_eq!(&boards[0], &boards[2]);
        let (names, list): (Vec<_>, Vec<_>) = boards.swap_remove(0).into_iter().partition(|line| line.starts_with("NAME "));
        let boards = [list];
        prop_assert_eq!(boards[0].len(), clients.0.len());

        // Identified by the port from which it connected.
        let mut by_name: BTreeMap<String, (&Client, Device)> = BTreeMap::new();
        for client in clients.0.values() {
            let line = boards[0].iter().find(|line| {
                let device = Device::parse(line.as_bytes()).expect(line);
                device.peer.port() == client.port
            });
            let device = Device::parse(line.expect("it is in the list").as_bytes()).expect("a device");
            by_name.insert(device.name.clone(), (client, device));
        }
        let said = by_name.iter().flat_map(|(name, (client, _))| {
            client.named.iter().map(move |(channel, label)| format!("NAME {name}:I{channel} {label}"))
        });
        prop_assert_eq!(names.into_iter().collect::<BTreeSet<_>>(), said.collect());
        for host in 0..NAMES.len() {
            for (sink, source) in hosts.labs[host].dispatcher.patch().iter() {
                let Some((client, _)) = by_name.get(&sink.client).filter(|(client, _)| client.host == host) else {
                    continue;
                };
                let value = |pin: &Pin| {
                    let (client, device) = by_name.get(&pin.client)?;
                    let has = device.counts.of(pin.channel.kind) >= pin.channel.number;
                    client.said.get(&pin.channel.number).filter(|_| has).copied()
                };
                let heard = client.heard.get(&sink.channel.number).copied();
                match value(source) {
                    Some(value) => prop_assert_eq!(heard, Some(value), "{} = {}", sink, source),
                    None if !holds => prop_assert!(heard.is_none_or(|it| it == 0), "{} = {}: {:?}", sink, source, heard),
                    None => {}
                }
            }
        }
    }

    #[test]
    fn no_letter_is_too_strange(mut bytes: Vec<u8>, at: u8, with: u8) {
        let mut hosts = hosts();
        hosts.join(0, "VP PUMP Q01 I01");
        let now = hosts.labs[0].now;
        hosts.labs[0].dispatcher.letter_arrived(now, &bytes);
        bytes.insert(0, 2);
        hosts.labs[0].dispatcher.letter_arrived(now, &bytes);
        // A valid letter with one wrong byte.
        let logo = hosts.labs[1].join("VR LOGO Q01 I01");
        hosts.labs[1].say(logo, "NAME I1 Start");
        while let Some((_, mut letter)) = hosts.labs[1].dispatcher.next_letter() {
            let at = usize::from(at) % letter.len();
            letter[at] = with;
            hosts.labs[0].dispatcher.letter_arrived(now, &letter);
            while hosts.labs[0].dispatcher.next_letter().is_some() {}
        }
    }
}
