//! The rules, one by one, without sockets.

use crate::common::Lab;
use tickbus_base::time::Nanos;
use tickbus_dispatcher::{OnLoss, Patch, Settings};

const NOTHING: [&str; 0] = [];

/// Asserts that the answer is one refusal with this code, and returns it.
fn refused(heard: &[String], code: u16) -> String {
    let [line] = heard else {
        panic!("{heard:?}");
    };
    assert!(line.starts_with(&format!("ERR {code} ")), "{line}");
    line.clone()
}

#[test]
fn what_a_web_site_has_a_browser_send_is_refused_with_its_body() {
    for head in [
        "POST / HTTP/1.1\r\nHost: 127.0.0.1:20070\r\n\r\n".to_owned(),
        format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(5000)),
        // The TLS hello with a ticket of another server, as after a name that suddenly resolves to this computer.
        format!(
            "\x16\x03\x01\x01\x7c\x01\0\x01\x78\x03\x03{}\r\n",
            "a".repeat(200)
        ),
        // A TLS hello whose length contains a line feed.
        format!(
            "\x16\x03\x01\x01\x0e\x01\0\x01\x0a\x03\x03{}\r\n",
            "a".repeat(200)
        ),
    ] {
        let request = format!("{head}VR EVIL Q01 I01\r\nCONNECT Q1:PUMP:I1\r\nP Q1=24\r\n");
        // Also in the pieces of a slow network.
        for size in [request.len(), 1000, 1] {
            refuses_browser(request.as_bytes().chunks(size));
        }
    }
}

fn refuses_browser<'a>(pieces: impl Iterator<Item = &'a [u8]>) {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q01 I01");
    let browser = lab.connect();
    for piece in pieces {
        lab.send(browser, piece);
    }
    assert!(lab.dispatcher.is_closing(browser));
    let heard = lab.hear(browser);
    assert!(
        heard.len() == 1 && heard[0].contains("HTTP request"),
        "{heard:?}"
    );
    assert_eq!(lab.hear(pump), [""; 0]);
    assert_eq!(lab.dispatcher.patch().iter().count(), 0);
}

#[test]
fn version_2_is_answered() {
    let mut lab = Lab::new();
    let logo = lab.connect();
    let line = "VR:LOGO:Q01:I01:AQ00:AI00:192.168.0.20:3330";
    assert_eq!(lab.ask(logo, "vr LOGO i1 q1 v=2"), ["OK VR", line, "END 1"]);
    assert_eq!(lab.ask(logo, "list"), ["OK LIST", line, "END 1"]);
    assert_eq!(lab.ask(logo, "PING"), ["OK PING"]);
    assert_eq!(lab.ask(logo, "CONNECT I1:LOGO:Q1"), ["OK CONNECT"]);
    assert_eq!(
        lab.ask(logo, "P Q1=3"),
        ["P I1=3"],
        "values are not confirmed, and may come back"
    );
    assert_eq!(lab.ask(logo, "DISCONNECT I1"), ["P I1=0", "OK DISCONNECT"]);
    assert_eq!(lab.ask(logo, ""), NOTHING);
    assert_eq!(lab.ask(logo, "P"), NOTHING);
    assert_eq!(lab.ask(logo, "BYE"), ["OK BYE"]);
    assert!(lab.dispatcher.is_closing(logo));
}

#[test]
fn version_3_hears_that_a_source_is_lost_and_is_back() {
    for (on_loss, lost) in [
        (OnLoss::FailSafe, &["P I1=? I2=?"][..]),
        (OnLoss::Hold, &[]),
    ] {
        let settings = Settings {
            on_loss,
            ..Settings::default()
        };
        let mut lab = Lab::with(settings, Patch::new());
        let pump = lab.join("VP PUMP Q02");
        let logo = lab.join("VR LOGO I02 V=3");
        lab.say(logo, "CONNECT I1:PUMP:Q1 I2:PUMP:Q2");
        lab.say(pump, "P Q1=0 Q2=1");
        assert_eq!(lab.hear(logo), ["OK CONNECT", "P I1=0 I2=1"]);
        lab.dispatcher.gone(pump);
        assert_eq!(lab.hear(logo), lost);
        let pump = lab.join("VP PUMP Q02");
        assert_eq!(lab.hear(logo), NOTHING, "it has said nothing yet");
        lab.say(pump, "P Q1=0 Q2=2");
        let back = match on_loss {
            OnLoss::FailSafe => "P I1=0 I2=2",
            OnLoss::Hold => "P I2=2",
        };
        assert_eq!(lab.hear(logo), [back]);
        refused(&lab.ask(pump, "P Q1=?"), 400);
    }
}

#[test]
fn values_that_come_while_a_client_joins_have_not_waited_for_it() {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q01");
    let logo = lab.join("VR LOGO I01 V=3");
    lab.say(logo, "CONNECT I1:PUMP:Q1");
    lab.say(pump, "P Q1=1");
    lab.dispatcher.gone(logo);
    let logo = lab.connect();
    // All input is processed before anything is written.
    lab.say(logo, "VR LOGO I01 V=3");
    lab.say(pump, "P Q1=2");
    let heard = lab.hear(logo);
    assert_eq!(heard[heard.len() - 2..], ["P I1=1", "P I1=2"]);
    assert_eq!(lab.dispatcher.traffic().overtaken, 0);
}

#[test]
fn version_1_gets_lists_values_and_refusals_only() {
    let mut lab = Lab::new();
    let logo = lab.connect();
    let line = "VR:LOGO:Q01:I01:AQ00:AI00:192.168.0.20:3330";
    assert_eq!(lab.ask(logo, "VR LOGO Q01 I01"), [line]);
    assert_eq!(lab.ask(logo, "LIST"), [line]);
    assert_eq!(lab.ask(logo, "CONNECT I1:LOGO:Q1"), NOTHING);
    assert_eq!(lab.ask(logo, "P Q1=3"), ["P I1=3"]);
    assert_eq!(lab.ask(logo, "DISCONNECT I1"), ["P I1=0"]);
    refused(&lab.ask(logo, "CONNECT"), 400);
    assert_eq!(lab.ask(logo, "BYE"), NOTHING);
    assert!(lab.dispatcher.is_closing(logo));
}

#[test]
fn every_mistake_has_its_code_and_changes_nothing() {
    let mut lab = Lab::new();
    let logo = lab.connect();
    for line in ["LIST", "P Q1=1", "CONNECT I1:A:Q1", "DISCONNECT I1"] {
        refused(&lab.ask(logo, line), 401);
    }
    assert_eq!(lab.ask(logo, "PING"), ["OK PING"]);
    for line in [
        "VR",
        "VR LOGO",
        "VR LO/GO Q1",
        "VR LOGO Q1 Q2",
        "VR LOGO Q1 X1",
        "VR LOGO Q",
        "VR LOGO V=2",
        "VR LOGO Q1 V=4",
        "VR LOGO Q1 V=2 I1",
        "VX LOGO Q1",
        "VR:LOGO Q1",
        ":",
        "LOGO",
    ] {
        refused(&lab.ask(logo, line), 400);
    }
    refused(&lab.ask(logo, "VR LOGO Q257"), 429);
    let other = lab.join("VP BOARD Q04 I04 AQ01 AI01");
    lab.say(logo, "VR LOGO Q02 I02 AQ01 AI01");
    lab.hear(logo);
    refused(&lab.ask(logo, "VR LOGO2 Q1"), 409);
    for (line, code) in [
        ("P Q1", 400),
        ("P Q1=", 400),
        ("P Q1=x", 400),
        ("P Q1=1Q2=2", 400),
        ("P Q1:1", 400),
        ("P 1=1", 400),
        ("P Q1=1e", 400),
        ("P Q1=123456789012345678901234", 400),
        ("P \u{fc}", 400),
        ("P Q1=1 I1=1", 422),
        ("P Q1=1 Q3=1", 404),
        ("P Q1=1 Q0=1", 404),
        ("P AQ2=1", 404),
        ("P Q70000=1", 404),
        ("LIST all", 400),
        ("PING 1", 400),
        ("BYE bye", 400),
        ("DISCONNECT", 400),
        ("DISCONNECT X", 400),
        ("DISCONNECT I1", 404),
        ("DISCONNECT I9", 404),
        ("CONNECT I1", 400),
        ("CONNECT I1:BOARD", 400),
        ("CONNECT I1=BOARD:Q1", 400),
        ("CONNECT I1:BOARD:", 400),
        ("CONNECT I1:BO/ARD:Q1", 400),
        ("CONNECT I1:NOBODY:Q1", 404),
        ("CONNECT I1:P2:Q1", 404),
        ("CONNECT I1:P0:Q1", 404),
        ("CONNECT I1:R2:Q1", 404),
        ("CONNECT I3:BOARD:Q1", 404),
        ("CONNECT I1:BOARD:Q5", 404),
        ("CONNECT I1:BOARD:I1", 422),
        ("CONNECT Q1:BOARD:Q1", 422),
        ("CONNECT I1:BOARD:AQ1", 422),
        ("CONNECT AQ1:BOARD:I1", 422),
        ("CONNECT I1:BOARD:Q1 I1:BOARD:Q2", 409),
        ("CONNECT I1:BOARD:Q1 I2:BOARD:I2", 422),
    ] {
        let heard = lab.ask(logo, line);
        assert_eq!(heard.len(), 1, "{line}: {heard:?}");
        assert!(
            heard[0].starts_with(&format!("ERR {code} ")),
            "{line}: {heard:?}"
        );
        assert!(lab.dispatcher.patch().is_empty(), "{line}");
        // Lines on the wire in between stay whole.
        assert_eq!(lab.hear(other), NOTHING);
    }
    lab.say(other, "CONNECT I1:LOGO:Q1 I2:LOGO:Q2");
    assert_eq!(
        lab.hear(other),
        NOTHING,
        "none of the values above was taken"
    );
}

#[test]
fn names_collide_and_are_free_again() {
    let mut lab = Lab::new();
    let first = lab.join("VR LOGO Q01");
    let second = lab.connect();
    refused(&lab.ask(second, "VP LOGO I01"), 409);
    assert_eq!(
        lab.ask(second, "VP logo I01").len(),
        2,
        "names are read as they are written"
    );
    lab.dispatcher.gone(first);
    let third = lab.connect();
    assert_eq!(lab.ask(third, "VP LOGO I01").len(), 2);
}

#[test]
fn a_name_goes_before_a_number() {
    let mut lab = Lab::new();
    lab.join("VP FIRST Q01");
    let named = lab.join("VR P1 Q01");
    let logo = lab.join("VR LOGO I02");
    lab.say(logo, "CONNECT I1:P1:Q1");
    lab.say(named, "P Q1=5");
    assert_eq!(lab.hear(logo), ["P I1=5"]);
}

#[test]
fn values_go_on_when_they_change_together_as_they_came() {
    let mut lab = Lab::new();
    let from = lab.join("VP FROM Q03 AQ01");
    let to = lab.join("VR TO I03 AI01");
    lab.say(to, "CONNECT I1:FROM:Q1 I2:FROM:Q2 I3:FROM:Q1 AI1:FROM:AQ1");
    lab.say(from, "P Q1=1 Q2=2 AQ1=-3.50");
    assert_eq!(lab.hear(to), ["P I1=1 I3=1 I2=2 AI1=-3.5"]);
    lab.say(from, "P Q1=01 Q2=3 AQ1=-3.5");
    assert_eq!(lab.hear(to), ["P I2=3"]);
    lab.say(from, "P Q3=1");
    assert_eq!(lab.hear(to), NOTHING, "it is not connected");
    lab.say(from, "P Q1=5 Q1=6");
    assert_eq!(lab.hear(to), ["P I1=5 I3=5 I1=6 I3=6"]);
}

#[test]
fn a_new_connection_gets_the_current_value_at_once() {
    let mut lab = Lab::new();
    let from = lab.join("VP FROM Q02");
    lab.say(from, "P Q1=0");
    let to = lab.join("VR TO I02 V=2");
    assert_eq!(
        lab.ask(to, "CONNECT I1:FROM:Q1 I2:FROM:Q2"),
        ["OK CONNECT", "P I1=0"]
    );
    assert_eq!(
        lab.ask(to, "CONNECT I1:FROM:Q1"),
        ["OK CONNECT", "P I1=0"],
        "once more is no conflict"
    );
    assert_eq!(lab.dispatcher.patch().len(), 2);
}

#[test]
fn an_input_has_one_source_and_an_output_any_number_of_sinks() {
    let mut lab = Lab::new();
    let from = lab.join("VP FROM Q02");
    let to = lab.join("VR TO I02");
    lab.say(to, "CONNECT I1:FROM:Q1 I2:FROM:Q1");
    refused(&lab.ask(to, "CONNECT I1:FROM:Q2"), 409);
    refused(&lab.ask(from, "CONNECT Q2:TO:I1"), 409);
    assert_eq!(lab.ask(from, "DISCONNECT Q1"), NOTHING);
    assert!(lab.dispatcher.patch().is_empty());
    assert_eq!(lab.ask(from, "CONNECT Q2:TO:I1"), NOTHING);
    lab.say(from, "P Q1=1 Q2=2");
    assert_eq!(lab.hear(to), ["P I1=2"]);
}

#[test]
fn cycles_come_to_rest() {
    let mut lab = Lab::new();
    let a = lab.join("VR A Q01 I01");
    let b = lab.join("VR B Q01 I01");
    lab.say(a, "CONNECT I1:B:Q1 Q1:B:I1");
    lab.say(a, "P Q1=1");
    assert_eq!(lab.hear(b), ["P I1=1"]);
    lab.say(b, "P Q1=1");
    assert_eq!(lab.hear(a), ["P I1=1"]);
    lab.say(a, "P Q1=1");
    assert_eq!(lab.hear(b), NOTHING);
}

#[test]
fn connections_sleep_and_wake_by_name() {
    let mut lab = Lab::new();
    let from = lab.join("VP FROM Q02");
    let to = lab.join("VR TO I02 V=2");
    lab.say(to, "CONNECT I1:FROM:Q1");
    lab.say(from, "P Q1=24");
    assert_eq!(lab.hear(to), ["OK CONNECT", "P I1=24"]);
    lab.dispatcher.gone(from);
    assert_eq!(lab.hear(to), ["P I1=0"], "as when the cable is pulled");
    let back = lab.join("VP FROM Q02");
    assert_eq!(lab.hear(to), NOTHING, "it has not said anything yet");
    lab.say(back, "P Q1=24");
    assert_eq!(lab.hear(to), ["P I1=24"]);
    lab.dispatcher.gone(to);
    lab.say(back, "P Q1=12");
    let to = lab.connect();
    assert_eq!(
        lab.ask(to, "VR TO I02").last().expect("the value"),
        "P I1=12"
    );
    // The client comes back without that output.
    lab.dispatcher.gone(back);
    let small = lab.join("VP FROM AQ01");
    assert_eq!(lab.hear(to), ["P I1=0"]);
    lab.dispatcher.gone(small);
    let back = lab.join("VP FROM Q01");
    lab.say(back, "P Q1=7");
    assert_eq!(lab.hear(to), ["P I1=7"]);
}

#[test]
fn a_lost_source_can_leave_its_value() {
    let settings = Settings {
        on_loss: OnLoss::Hold,
        ..Settings::default()
    };
    let mut lab = Lab::with(settings, Patch::new());
    let from = lab.join("VP FROM Q02");
    let to = lab.join("VR TO I02");
    lab.say(to, "CONNECT I1:FROM:Q1");
    lab.say(from, "P Q1=24");
    assert_eq!(lab.hear(to), ["P I1=24"]);
    lab.dispatcher.gone(from);
    assert_eq!(lab.hear(to), NOTHING);
    let back = lab.join("VP FROM Q02");
    lab.say(back, "P Q1=24");
    assert_eq!(lab.hear(to), NOTHING, "it is what the input has");
    lab.say(to, "DISCONNECT I1");
    assert_eq!(lab.hear(to), NOTHING);
}

#[test]
fn silence_of_60_s_ends_a_connection_and_any_line_is_a_sign_of_life() {
    let mut lab = Lab::new();
    let pinging = lab.join("VR PINGING Q01");
    let silent = lab.join("VR SILENT Q01 V=2");
    let never = lab.connect();
    let almost = Nanos::from_secs(60) - Nanos(1);
    lab.wait(almost);
    assert_eq!(lab.ask(pinging, "PING"), ["OK PING"]);
    // Half a line is no line.
    lab.send(never, b"VR ");
    lab.wait(Nanos(1));
    for seat in [silent, never] {
        refused(&lab.hear(seat), 408);
        assert!(lab.dispatcher.is_closing(seat));
        lab.dispatcher.gone(seat);
    }
    assert!(!lab.dispatcher.is_closing(pinging));
    lab.wait(almost - Nanos(1));
    assert_eq!(lab.hear(pinging), NOTHING);
    lab.wait(Nanos::from_millis(100));
    refused(&lab.hear(pinging), 408);
    lab.dispatcher.gone(pinging);
    assert_eq!(
        lab.dispatcher.deadline(),
        Nanos::MAX,
        "nobody is left to wait for"
    );
}

#[test]
fn lines_arrive_in_any_pieces() {
    let mut lab = Lab::new();
    let to = lab.join("VR TO I01");
    let from = lab.connect();
    for byte in b"VP FROM Q01\nCONNECT Q1:TO:I1\r\n\r\nP Q1=12.5\nP Q1=7\r\n" {
        lab.send(from, &[*byte]);
        lab.hear(from);
    }
    assert_eq!(lab.hear(to), ["P I1=12.5", "P I1=7"]);
    lab.send(from, b"P Q1=1\nP Q1=2\nP Q1");
    lab.send(from, b"=3\nP Q1=4\n");
    assert_eq!(lab.hear(to), ["P I1=1", "P I1=2", "P I1=3", "P I1=4"]);
}

#[test]
fn a_line_too_long_is_ignored_and_the_next_one_counts() {
    let mut lab = Lab::new();
    let logo = lab.join("VR LOGO Q01 I01 V=2");
    lab.say(logo, &"x".repeat(4094));
    refused(&lab.hear(logo), 400);
    lab.say(logo, &"x".repeat(4095));
    refused(&lab.hear(logo), 413);
    let values = "P Q1=1".to_owned() + &" Q1=1".repeat(1000);
    lab.say(logo, &values);
    refused(&lab.hear(logo), 413);
    // A line without an end is refused once, not stored, and no sign of life.
    for _ in 0..1000 {
        lab.send(logo, &[b'P'; 1000]);
    }
    refused(&lab.hear(logo), 413);
    lab.send(logo, b" Q1=1\nPING\n");
    assert_eq!(lab.hear(logo), ["OK PING"]);
    lab.send(logo, &[b'P'; 5000]);
    lab.wait(Nanos::from_secs(60));
    let heard = lab.hear(logo);
    assert!(heard[1].starts_with("ERR 408"), "{heard:?}");
}

#[test]
fn a_client_that_does_not_read_keeps_the_newest_value_per_channel_and_nobody_waits() {
    let mut lab = Lab::new();
    let from = lab.join("VP FROM Q02 AQ01");
    let slow = lab.join("VR SLOW Q01 I02 AI01");
    let quick = lab.join("VR QUICK I02");
    lab.say(
        slow,
        "CONNECT I1:FROM:Q1 I2:FROM:Q2 AI1:FROM:AQ1 Q1:QUICK:I2",
    );
    lab.say(quick, "CONNECT I1:FROM:Q1");
    for value in 1..=100_000 {
        lab.say(from, &format!("P Q1={value} AQ1={}", -value));
        assert_eq!(lab.hear(quick), [format!("P I1={value}")]);
    }
    // The client's own values are served although it does not read.
    lab.say(slow, "P Q1=5");
    assert_eq!(lab.hear(quick), ["P I2=5"]);
    assert!(lab.dispatcher.to_write(slow).len() < 40_000);
    lab.say(from, "P Q2=9");
    let heard = lab.hear(slow);
    let values = |channel: &str| -> Vec<i64> {
        let words = heard.iter().flat_map(|line| line.split(' '));
        let values = words.filter_map(|word| word.strip_prefix(channel)?.strip_prefix('='));
        values
            .map(|value| value.parse().expect("a number"))
            .collect()
    };
    assert!(values("I1").is_sorted(), "the order holds");
    assert_eq!(values("I1").last(), Some(&100_000));
    assert!(values("AI1").iter().rev().is_sorted());
    assert_eq!(values("AI1").last(), Some(&-100_000));
    assert_eq!(values("I2"), [9]);
    assert!(lab.dispatcher.traffic().overtaken > 190_000);
    lab.say(from, "P Q1=3");
    assert_eq!(lab.hear(slow), ["P I1=3"], "and it goes on as before");
}

#[test]
fn a_client_that_asks_and_does_not_read_has_to_wait_itself() {
    let mut lab = Lab::new();
    for at in 0..100 {
        lab.join(&format!("VP CLIENT{at} Q01"));
    }
    let asking = lab.connect();
    lab.say(asking, "VR ASKING Q01 V=2");
    for _ in 0..100 {
        if lab.dispatcher.wants_bytes(asking) {
            lab.send(asking, "LIST\r\n".repeat(100).as_bytes());
        }
    }
    assert!(!lab.dispatcher.wants_bytes(asking));
    assert!(lab.dispatcher.to_write(asking).len() < 100_000);
    let heard = lab.hear(asking);
    let lists = heard.iter().filter(|line| *line == "END 101").count();
    assert_eq!(
        lists,
        heard.iter().filter(|line| line.starts_with("OK")).count()
    );
    assert!(lists >= 101, "{lists}");
    assert!(lab.dispatcher.wants_bytes(asking));
}

#[test]
fn a_client_that_sends_lines_too_long_and_does_not_read_has_to_wait_itself() {
    let mut lab = Lab::new();
    let seat = lab.connect();
    let begun = format!("\n{}", "x".repeat(4096));
    let mut sent = 0;
    while sent < 10_000 && lab.dispatcher.wants_bytes(seat) {
        lab.send(seat, begun.as_bytes());
        sent += 1;
    }
    assert!(!lab.dispatcher.wants_bytes(seat));
    assert!(lab.dispatcher.to_write(seat).len() < 100_000);
    // Once the client reads, each line is answered, and the client is served again.
    let heard = lab.hear(seat);
    assert_eq!(heard.len(), sent);
    assert!(lab.dispatcher.wants_bytes(seat));
    lab.send(seat, b"\nPING\n");
    assert_eq!(lab.hear(seat), ["OK PING"]);
}

#[test]
fn more_clients_than_served_are_told_so() {
    let settings = Settings {
        clients: 2,
        ..Settings::default()
    };
    let mut lab = Lab::with(settings, Patch::new());
    let first = lab.connect();
    lab.connect();
    let peer = "[::1]:7".parse().expect("an address");
    let refusal = lab
        .dispatcher
        .connected(lab.now, peer)
        .expect_err("it is full");
    assert!(refusal.to_string().starts_with("ERR 429 "), "{refusal}");
    lab.dispatcher.gone(first);
    let seat = lab
        .dispatcher
        .connected(lab.now, peer)
        .expect("there is room again");
    assert_eq!(
        lab.ask(seat, "VP SIX Q1"),
        ["VP:SIX:Q01:I00:AQ00:AI00:[::1]:7"]
    );
}

#[test]
fn a_patch_that_cannot_be_saved_is_told_and_holds() {
    let mut lab = Lab::new();
    let from = lab.join("VP FROM Q01");
    let to = lab.join("VR TO I01");
    lab.dispatcher
        .arrived(lab.now, to, b"CONNECT I1:FROM:Q1\r\nPING\r\n");
    assert_eq!(lab.dispatcher.unsaved().map(Patch::len), Some(1));
    assert_eq!(lab.dispatcher.to_write(to), b"", "not before it is saved");
    lab.dispatcher.saved(&Err("disk full".to_owned()));
    let heard = lab.hear(to);
    refused(&heard[..1], 500);
    assert_eq!(heard[1..], ["OK PING"]);
    lab.say(from, "P Q1=1");
    assert_eq!(lab.hear(to), ["P I1=1"]);
}

#[test]
fn who_asks_again_for_the_connections_that_it_has_is_answered_without_a_further_save() {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q01");
    let line = b"CONNECT I1:PUMP:Q1\r\n";
    for round in 0..3 {
        let logo = lab.join("VR LOGO I01 V=2");
        lab.say(pump, &format!("P Q1={round}"));
        lab.hear(logo);
        lab.dispatcher.arrived(lab.now, logo, line);
        let is_unsaved = lab.dispatcher.unsaved().is_some();
        assert_eq!(
            is_unsaved,
            round == 0,
            "only the first one changes the patch"
        );
        lab.settle();
        assert_eq!(
            lab.hear(logo),
            ["OK CONNECT".to_owned(), format!("P I1={round}")]
        );
        lab.dispatcher.gone(logo);
    }
    // A failed save is retried.
    let logo = lab.join("VR LOGO I01 V=2");
    lab.say(logo, "DISCONNECT I1");
    lab.hear(logo);
    for _ in 0..2 {
        lab.dispatcher.arrived(lab.now, logo, line);
        assert!(lab.dispatcher.unsaved().is_some());
        lab.dispatcher.saved(&Err("disk full".to_owned()));
        refused(&lab.hear(logo)[..1], 500);
    }
}

#[test]
fn values_and_further_changes_do_not_wait_for_the_disk() {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q01 I02");
    let logo = lab.join("VR LOGO Q01 I02 V=2");
    lab.ask(logo, "CONNECT I1:PUMP:Q1");
    // Another thread saves from here on.
    let send = |lab: &mut Lab, seat, line: &str| {
        lab.dispatcher.arrived(lab.now, seat, line.as_bytes());
    };
    send(&mut lab, logo, "CONNECT I2:PUMP:Q1\r\n");
    assert_eq!(lab.dispatcher.unsaved().map(Patch::len), Some(2));
    lab.dispatcher.saving();
    assert!(lab.dispatcher.unsaved().is_none());
    send(&mut lab, pump, "P Q1=24\r\nCONNECT I1:LOGO:Q1\r\n");
    let heard = lab.dispatcher.to_write(logo).to_vec();
    assert_eq!(String::from_utf8_lossy(&heard), "P I1=24 I2=24\r\n");
    lab.dispatcher.wrote(logo, heard.len());
    // The change that came meanwhile was not part of that save.
    assert_eq!(lab.dispatcher.unsaved().map(Patch::len), Some(3));
    lab.dispatcher.saved(&Ok(()));
    assert_eq!(lab.dispatcher.to_write(logo), b"OK CONNECT\r\nP I2=24\r\n");
    assert!(!lab.dispatcher.wants_bytes(pump), "it waits for its own");
    lab.dispatcher.saving();
    lab.dispatcher.saved(&Ok(()));
    assert!(lab.dispatcher.wants_bytes(pump));
    assert!(lab.dispatcher.unsaved().is_none());
}

#[test]
fn channels_have_names_for_those_who_ask() {
    let mut lab = Lab::new();
    let adam = lab.join("VP ADAM Q1 AQ2 V=2");
    let old = lab.join("VR LOGO I1");
    assert_eq!(lab.ask(adam, "NAME AQ1 Level of \"B\" "), ["OK NAME"]);
    assert_eq!(lab.ask(adam, "name q1 Pumpe läuft"), ["OK NAME"]);
    // The last name counts.
    assert_eq!(lab.ask(adam, "NAME AQ1 Level"), ["OK NAME"]);
    let listed = lab.ask(adam, "list names");
    assert_eq!(
        listed,
        [
            "OK LIST",
            "VP:ADAM:Q01:I00:AQ02:AI00:192.168.0.20:3330",
            "NAME ADAM:Q1 Pumpe läuft",
            "NAME ADAM:AQ1 Level",
            "VR:LOGO:Q00:I01:AQ00:AI00:192.168.0.20:3331",
            "END 2"
        ]
    );
    assert_eq!(lab.ask(adam, "LIST").len(), 4);
    assert_eq!(lab.ask(old, "LIST").len(), 2, "as in the paper");
    assert!(lab.ask(old, "NAME I1 start").is_empty());
    for (line, code) in [
        ("NAME", 400),
        ("NAME AQ1", 400),
        ("NAME AQ1 \t ", 400),
        ("NAME AQ1 a\u{1b}[2J", 400),
        ("NAME X1 a", 400),
        ("NAME AQ3 a", 404),
        ("NAME I1 a", 404),
        ("LIST NAME", 400),
        ("LIST NAMES NAMES", 400),
        (&format!("NAME AQ1 {}", "x".repeat(121)), 400),
    ] {
        let heard = lab.ask(adam, line);
        assert!(
            heard[0].starts_with(&format!("ERR {code} ")),
            "{line}: {heard:?}"
        );
    }
    let state = lab.dispatcher.snapshot();
    let labels = state.clients.iter().flat_map(|client| &client.channels);
    let labels = labels.filter_map(|channel| {
        Some((
            channel.channel.to_string(),
            channel.label.as_ref()?.to_string(),
        ))
    });
    let labels: Vec<_> = labels
        .map(|(channel, label)| format!("{channel} {label}"))
        .collect();
    assert_eq!(labels, ["Q1 Pumpe läuft", "AQ1 Level", "I1 start"]);
    // They leave with their client.
    lab.dispatcher.gone(adam);
    lab.join("VP ADAM Q1 AQ2 V=2");
    assert_eq!(lab.ask(old, "LIST NAMES").len(), 3);
}
