//! A laboratory with a key.

use std::net::SocketAddr;

use crate::common::Lab;
use tickbus_base::time::Nanos;
use tickbus_dispatcher::{Key, Patch, Settings};

const KEY: &str = "sesame+open/you=0";

fn closed() -> Lab {
    let mut lab = Lab::new();
    lab.dispatcher.require(Key::parse(KEY).expect("a key"));
    lab
}

/// A client at another address.
fn connect_from(lab: &mut Lab, last: u8) -> usize {
    let peer = SocketAddr::from(([192, 168, 1, last], 4000));
    lab.dispatcher.connected(lab.now, peer).expect("room")
}

#[test]
fn a_client_that_states_the_key_first_is_served_as_ever() {
    let mut lab = closed();
    let pump = lab.connect();
    assert_eq!(lab.ask(pump, &format!("key  {KEY} ")), ["OK KEY"]);
    assert_eq!(lab.ask(pump, "VP PUMP Q01 V=2")[0], "OK VP");
    let logo = lab.connect();
    // In one piece, as programs send it.
    lab.send(logo, format!("KEY {KEY}\nVR LOGO I01 V=2\n").as_bytes());
    assert_eq!(lab.hear(logo)[..2], ["OK KEY", "OK VR"]);
    lab.wait(Nanos::from_secs(30));
    assert_eq!(lab.ask(pump, "PING"), ["OK PING"]);
    assert_eq!(lab.dispatcher.wrong_keys(), 0);
    assert_eq!(lab.dispatcher.next_news(), None);
}

#[test]
fn a_client_that_begins_with_another_line_is_cut_off() {
    for line in ["VP PUMP Q01", "PING", "LIST", "P Q1=24", "nonsense", "BYE"] {
        let mut lab = closed();
        let stranger = lab.connect();
        let heard = lab.ask(stranger, line);
        assert_eq!(
            heard,
            ["ERR 401 this laboratory has a key; the first line is KEY and the key"],
            "{line}"
        );
        assert!(lab.dispatcher.is_closing(stranger), "{line}");
    }
    // An empty line is what telnet users send first.
    let mut lab = closed();
    let pump = lab.connect();
    assert!(lab.ask(pump, "").is_empty());
    assert_eq!(lab.ask(pump, &format!("KEY {KEY}")), ["OK KEY"]);
}

#[test]
fn a_line_behind_a_wrong_key_is_not_carried_out() {
    let mut lab = closed();
    let stranger = lab.connect();
    lab.send(stranger, b"KEY sesame+open/you=1\nVP EVIL Q01 V=2\n");
    let heard = lab.hear(stranger);
    assert_eq!(heard.len(), 1, "{heard:?}");
    assert!(
        heard[0].starts_with("ERR 403 the key is wrong"),
        "{heard:?}"
    );
    assert!(!heard[0].contains("sesame"), "no answer repeats a key");
    assert!(lab.dispatcher.is_closing(stranger));
    assert_eq!(lab.dispatcher.wrong_keys(), 1);
    let news = lab.dispatcher.next_news().expect("an operator learns it");
    assert!(
        news.contains("192.168.0.20") && news.contains("1 so far"),
        "{news}"
    );
}

#[test]
fn an_address_guesses_four_times_a_second_and_others_do_not_wait_for_it() {
    let mut lab = closed();
    let (mut looked_at, mut refused) = (0, 0);
    for _ in 0..1000 {
        let stranger = lab.connect();
        let heard = lab.ask(stranger, "KEY 0123456789abcdef");
        looked_at += usize::from(heard[0].starts_with("ERR 403"));
        refused += usize::from(heard[0].starts_with("ERR 429"));
        lab.dispatcher.gone(stranger);
        lab.wait(Nanos::from_millis(2));
    }
    assert_eq!((looked_at, refused), (8, 992), "in two seconds");
    let other = connect_from(&mut lab, 7);
    assert_eq!(lab.ask(other, &format!("KEY {KEY}")), ["OK KEY"]);
    // The same address with the right key, in its pause and behind it.
    let late = lab.connect();
    lab.ask(late, "KEY 0123456789abcdef");
    let pump = lab.connect();
    assert!(lab.ask(pump, &format!("KEY {KEY}"))[0].starts_with("ERR 429"));
    lab.wait(Nanos::from_millis(250));
    let pump = lab.connect();
    assert_eq!(lab.ask(pump, &format!("KEY {KEY}")), ["OK KEY"]);
}

#[test]
fn of_many_wrong_keys_few_are_reported() {
    let mut lab = closed();
    for guess in 0..200_u8 {
        let stranger = connect_from(&mut lab, guess);
        lab.ask(stranger, "KEY 0123456789abcdef");
        lab.dispatcher.gone(stranger);
    }
    assert_eq!(lab.dispatcher.wrong_keys(), 200);
    let news = std::iter::from_fn(|| lab.dispatcher.next_news()).count();
    assert_eq!(news, 23, "the first 20, and the 32nd, 64th and 128th");
}

#[test]
fn a_connection_without_the_key_lasts_ten_seconds() {
    let mut lab = closed();
    let stranger = lab.connect();
    lab.wait(Nanos::from_secs(9));
    assert!(!lab.dispatcher.is_closing(stranger));
    lab.wait(Nanos::from_secs(1));
    assert!(lab.hear(stranger)[0].starts_with("ERR 408"));
    assert!(lab.dispatcher.is_closing(stranger));
}

#[test]
fn lines_of_a_stranger_give_it_no_more_time_and_a_long_one_closes_it() {
    let mut lab = closed();
    let stranger = lab.connect();
    lab.wait(Nanos::from_secs(9));
    assert!(lab.ask(stranger, "").is_empty());
    lab.wait(Nanos::from_secs(1));
    assert_eq!(
        lab.hear(stranger),
        ["ERR 408 no key came within 10s; the first line is KEY and the key"]
    );
    assert!(lab.dispatcher.is_closing(stranger));

    // The key begins the client's own time.
    let pump = lab.connect();
    lab.wait(Nanos::from_secs(9));
    assert_eq!(lab.ask(pump, &format!("KEY {KEY}")), ["OK KEY"]);
    lab.wait(Nanos::from_secs(59));
    assert!(!lab.dispatcher.is_closing(pump));

    for end in ["", "\n"] {
        let stranger = lab.connect();
        lab.send(stranger, format!("{}{end}", " ".repeat(4096)).as_bytes());
        assert!(lab.hear(stranger)[0].starts_with("ERR 413"));
        assert!(lab.dispatcher.is_closing(stranger));
    }
}

#[test]
fn in_a_full_laboratory_the_stranger_that_waits_longest_makes_room() {
    let settings = Settings {
        clients: 3,
        ..Settings::default()
    };
    let mut lab = Lab::with(settings, Patch::new());
    lab.dispatcher.require(Key::parse(KEY).expect("a key"));
    let pump = lab.connect();
    lab.ask(pump, &format!("KEY {KEY}"));
    let first = lab.connect();
    lab.wait(Nanos::from_secs(1));
    let second = lab.connect();
    let logo = lab.connect();
    assert!(lab.dispatcher.is_closing(first) && !lab.dispatcher.is_closing(second));
    assert!(lab.hear(first)[0].starts_with("ERR 429 the dispatcher is full"));
    lab.dispatcher.gone(first);
    assert_eq!(lab.ask(logo, &format!("KEY {KEY}")), ["OK KEY"]);
    assert_eq!(lab.ask(second, &format!("KEY {KEY}")), ["OK KEY"]);
    // Clients that have stated the key keep their places.
    let peer = SocketAddr::from(([192, 168, 0, 20], 4000));
    let refused = lab.dispatcher.connected(lab.now, peer);
    assert!(
        refused
            .expect_err("it is full")
            .text
            .contains("3 clients are here")
    );
}

#[test]
fn a_laboratory_without_a_key_takes_any() {
    let mut lab = Lab::new();
    let pump = lab.connect();
    assert_eq!(lab.ask(pump, "KEY anything"), ["OK KEY"]);
    assert_eq!(lab.ask(pump, "VP PUMP Q01 V=2")[0], "OK VP");
}
