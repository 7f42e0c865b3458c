//! Clients that promise a line at least every so often, and break that promise.

use crate::common::Lab;
use crate::common::hosts::{Hosts, number, order, pin};
use tickbus_base::time::Nanos;
use tickbus_dispatcher::{OnLoss, Order, Patch, Settings};

const NOTHING: [&str; 0] = [];

#[test]
fn a_client_that_breaks_its_promise_to_speak_is_lost_until_it_speaks() {
    for (on_loss, lost, zero) in [
        (OnLoss::FailSafe, &["P I1=? I2=?"][..], &["P I1=0"][..]),
        (OnLoss::Hold, &[], &[]),
    ] {
        let settings = Settings {
            on_loss,
            ..Settings::default()
        };
        let mut lab = Lab::with(settings, Patch::new());
        let logo = lab.join("VR LOGO I02 V=3");
        let old = lab.join("VR OLD I01");
        let pump = lab.join("VP PUMP Q02 I01 V=2 ALIVE=500ms");
        lab.say(logo, "CONNECT I1:PUMP:Q1 I2:PUMP:Q2");
        lab.say(old, "CONNECT I1:PUMP:Q1");
        lab.say(pump, "P Q1=24 Q2=1");
        assert_eq!(lab.hear(logo), ["OK CONNECT", "P I1=24 I2=1"]);
        assert_eq!(lab.hear(old), ["P I1=24"]);
        for _ in 0..4 {
            lab.wait(Nanos::from_millis(400));
            lab.say(pump, "PING");
        }
        assert_eq!(lab.hear(logo), NOTHING, "it keeps its promise");
        lab.wait(Nanos::from_millis(499));
        assert_eq!(lab.hear(logo), NOTHING);
        lab.wait(Nanos::from_millis(51));
        assert_eq!(lab.hear(logo), lost);
        assert_eq!(lab.hear(old), zero);
        lab.say(pump, "");
        let back = match on_loss {
            OnLoss::FailSafe => (&["P I1=24 I2=1"][..], &["P I1=24"][..]),
            OnLoss::Hold => (&[][..], &[][..]),
        };
        assert_eq!(
            (&lab.hear(logo)[..], &lab.hear(old)[..]),
            (&to_strings(back.0)[..], &to_strings(back.1)[..])
        );
        lab.wait(Nanos::from_millis(600));
        assert_eq!(lab.hear(logo), lost);
        lab.say(logo, "DISCONNECT I1");
        lab.say(logo, "CONNECT I1:PUMP:Q1");
        assert_eq!(
            lab.hear(logo),
            ["OK DISCONNECT", "OK CONNECT"],
            "it has no value"
        );
        lab.say(pump, "P Q2=2");
        let back = match on_loss {
            OnLoss::FailSafe => "P I1=24 I2=2",
            OnLoss::Hold => "P I2=2",
        };
        assert_eq!(lab.hear(logo), [back]);
    }
}

#[test]
fn after_a_silence_new_values_come_alone_and_no_pulse_is_swallowed() {
    // The usual spelling, and a rare one.
    for line in ["P Q1=5", "p  q1 = 5"] {
        let mut lab = Lab::new();
        let logo = lab.join("VR LOGO I02 V=3");
        let pump = lab.join("VP PUMP Q02 V=2 ALIVE=500ms");
        lab.say(logo, "CONNECT I1:PUMP:Q1 I2:PUMP:Q2");
        lab.say(pump, "P Q1=24 Q2=1");
        lab.hear(logo);
        lab.wait(Nanos::from_millis(600));
        assert_eq!(lab.hear(logo), ["P I1=? I2=?"]);
        lab.send(pump, format!("{line}\nP Q1=6\n").as_bytes());
        assert_eq!(lab.hear(logo), ["P I1=5 I2=1", "P I1=6"], "{line}");
    }
}

#[test]
fn a_client_that_waited_for_the_disk_is_watched_again() {
    let mut lab = Lab::new();
    let logo = lab.join("VR LOGO I01 V=3");
    let pump = lab.join("VP PUMP Q01 V=2 ALIVE=500ms");
    lab.say(logo, "CONNECT I1:PUMP:Q1");
    lab.say(pump, "P Q1=24");
    assert_eq!(lab.hear(logo), ["OK CONNECT", "P I1=24"]);
    lab.wait(Nanos::from_millis(499));
    // The dispatcher checks the times of all clients while the pump still waits for its answer.
    let dispatcher = &mut lab.dispatcher;
    dispatcher.arrived(lab.now, pump, b"DISCONNECT Q1\nCONNECT Q1:LOGO:I1\n");
    dispatcher.saving();
    lab.now += Nanos::from_millis(2);
    dispatcher.tick(lab.now);
    dispatcher.saved(&Ok(()));
    lab.settle();
    lab.settle();
    assert_eq!(lab.hear(pump), ["OK DISCONNECT", "OK CONNECT"]);
    assert_eq!(lab.hear(logo), ["P I1=?", "P I1=24"]);
    lab.say(pump, "PING");
    lab.wait(Nanos::from_millis(510));
    lab.wait(Nanos::from_millis(60));
    assert_eq!(lab.hear(logo), ["P I1=?"]);
}

#[test]
fn a_client_that_reads_no_answers_keeps_no_promise_either() {
    let mut lab = Lab::new();
    let logo = lab.join("VR LOGO I01 V=3");
    let pump = lab.join("VP PUMP Q01 V=2 ALIVE=500ms");
    lab.say(logo, "CONNECT I1:PUMP:Q1");
    lab.say(pump, "P Q1=24");
    assert_eq!(lab.hear(logo), ["OK CONNECT", "P I1=24"]);
    lab.say(pump, &"PING\n".repeat(8000));
    assert!(
        !lab.dispatcher.wants_bytes(pump),
        "its answers have no room"
    );
    lab.wait(Nanos::from_millis(510));
    lab.wait(Nanos::from_millis(60));
    assert_eq!(lab.hear(logo), ["P I1=?"]);
    lab.hear(pump);
    assert_eq!(lab.hear(logo), ["P I1=24"]);
}

fn to_strings(lines: &[&str]) -> Vec<String> {
    lines.iter().map(|line| (*line).to_owned()).collect()
}

#[test]
fn the_dispatcher_does_not_blame_clients_for_its_own_pause() {
    let mut lab = Lab::new();
    let logo = lab.join("VR LOGO I01 V=3");
    let pump = lab.join("VP PUMP Q01 ALIVE=100ms");
    lab.say(logo, "CONNECT I1:PUMP:Q1");
    lab.say(pump, "P Q1=24");
    assert_eq!(lab.hear(logo), ["OK CONNECT", "P I1=24"]);
    lab.now += Nanos::from_secs(5);
    lab.dispatcher.tick(lab.now);
    assert_eq!(lab.hear(logo), NOTHING, "its lines may wait in the system");
    lab.wait(Nanos::from_millis(30));
    assert_eq!(lab.hear(logo), ["P I1=?"], "they did not");
}

#[test]
fn promises_that_cannot_be_kept_or_read_are_refused() {
    let mut lab = Lab::new();
    let logo = lab.connect();
    for line in [
        "VR LOGO Q1 ALIVE=9ms",
        "VR LOGO Q1 ALIVE=61s",
        "VR LOGO Q1 ALIVE=500",
        "VR LOGO Q1 ALIVE=",
        "VR LOGO Q1 ALIVE",
        "VR LOGO Q1 ALIVE=1s ALIVE=1s",
        "VR LOGO Q1 V=2 V=2",
        "VR LOGO Q1 ALIVE=1s I1",
        "VR LOGO Q1 AGE=1s",
    ] {
        let answer = lab.ask(logo, line);
        assert!(
            answer.len() == 1 && answer[0].starts_with("ERR 400 "),
            "{line}: {answer:?}"
        );
    }
    let answer = lab.ask(logo, "vr LOGO Q1 alive = 0.5s v=3");
    assert_eq!(answer[0], "OK VR");
}

#[test]
fn a_client_that_breaks_its_promise_is_lost_on_other_hosts_too() {
    // A day without a line is no reason to disconnect.
    let mut hosts = Hosts::new(Settings {
        idle: Nanos::from_secs(86_400),
        ..Settings::default()
    });
    let pump = hosts.join(0, "VP PUMP Q01 ALIVE=2s");
    hosts.ask(0, pump, "P Q1=24");
    let logo = hosts.join(1, "VR LOGO I01 V=3");
    let old = hosts.join(1, "VR OLD I01");
    assert_eq!(
        hosts.ask(1, logo, "CONNECT I1:PUMP:Q1"),
        ["OK CONNECT", "P I1=24"]
    );
    assert_eq!(hosts.ask(1, old, "CONNECT I1:PUMP:Q1"), ["P I1=24"]);
    hosts.wait(3);
    assert_eq!(hosts.hear(1, logo), ["P I1=?"]);
    assert_eq!(hosts.hear(1, old), ["P I1=0"]);
    // A client that connects meanwhile gets nothing.
    let late = hosts.join(2, "VR LATE I01 V=3");
    assert_eq!(hosts.ask(2, late, "CONNECT I1:PUMP:Q1"), ["OK CONNECT"]);
    hosts.ask(0, pump, "PING");
    assert_eq!(hosts.hear(1, logo), ["P I1=24"]);
    assert_eq!(hosts.hear(1, old), ["P I1=24"]);
    assert_eq!(hosts.hear(2, late), ["P I1=24"]);
    // An operator's value does not count as a client's line.
    hosts.wait(3);
    let heard = (hosts.hear(1, logo), hosts.hear(2, late));
    assert_eq!(
        heard,
        (vec!["P I1=?".to_owned()], vec!["P I1=?".to_owned()])
    );
    let (q1, forced) = (pin("PUMP:Q1"), number("5"));
    assert_eq!(
        order(&mut hosts, 0, Order::Force(q1.clone(), forced)),
        Ok(())
    );
    hosts.settle();
    assert_eq!(hosts.hear(1, logo), ["P I1=5"]);
    hosts.ask(0, pump, "PING");
    hosts.wait(3);
    assert_eq!(hosts.hear(1, logo), NOTHING);
    assert_eq!(order(&mut hosts, 0, Order::Release(q1)), Ok(()));
    hosts.settle();
    assert_eq!(hosts.hear(1, logo), ["P I1=?"]);
    hosts.ask(0, pump, "PING");
    assert_eq!(hosts.hear(1, logo), ["P I1=24"]);
}

#[test]
fn lines_that_waited_for_a_dispatcher_that_was_held_up_are_no_sign_of_life() {
    let mut lab = Lab::new();
    let logo = lab.join("VR LOGO I01 V=3");
    let pump = lab.join("VP PUMP Q01 ALIVE=500ms");
    lab.say(logo, "CONNECT I1:PUMP:Q1");
    lab.say(pump, "P Q1=24");
    assert_eq!(lab.hear(logo), ["OK CONNECT", "P I1=24"]);
    for (held_up, heard) in [(900, &["P I1=12"][..]), (1100, &["P I1=?"][..])] {
        lab.now += Nanos::from_millis(held_up);
        lab.dispatcher.woke(lab.now);
        lab.say(pump, "P Q1=12");
        lab.settle();
        assert_eq!(lab.hear(logo), heard, "after {held_up} ms");
    }
    lab.say(pump, "PING");
    assert_eq!(lab.hear(logo), ["P I1=12"]);
}
