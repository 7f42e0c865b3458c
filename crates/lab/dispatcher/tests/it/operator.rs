//! An operator's orders on the board, without sockets.

use std::sync::mpsc::channel;

use crate::common::Lab;
use tickbus_dispatcher::{Number, OnLoss, Order, Patch, Pin, Refusal, Reply, Settings};

const NOTHING: [&str; 0] = [];

fn pin(text: &str) -> Pin {
    Pin::parse(text).expect(text)
}

fn connect(one: &str, other: &str) -> Order {
    Order::Connect(pin(one), pin(other))
}

fn force(channel: &str, value: &str) -> Order {
    Order::Force(
        pin(channel),
        Number::parse(value.as_bytes()).expect("a number"),
    )
}

fn release(channel: &str) -> Order {
    Order::Release(pin(channel))
}

/// Carries an order out, saves the patch, and returns the answer.
fn order(lab: &mut Lab, order: Order) -> Result<(), Refusal> {
    let (sender, answer) = channel();
    let reply = Reply::new(move |outcome| sender.send(outcome).expect("it is waited for"));
    lab.dispatcher.operate(order, reply);
    if lab.dispatcher.unsaved().is_some() {
        assert!(answer.try_recv().is_err(), "not before it is saved");
        lab.dispatcher.saved(&Ok(()));
    }
    answer.try_recv().expect("an answer")
}

#[track_caller]
fn refused(lab: &mut Lab, wrong: Order, code: u16, text: &str) {
    let before = lab.dispatcher.snapshot();
    let refusal = order(lab, wrong).expect_err("it is wrong");
    assert_eq!((refusal.code.number(), &*refusal.text), (code, text));
    assert_eq!(lab.dispatcher.snapshot(), before);
}

#[test]
fn any_two_channels_are_connected_and_cut() {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q2 I1 AQ1");
    let logo = lab.join("VR LOGO Q1 I2");
    lab.say(pump, "P Q1=24");
    assert_eq!(order(&mut lab, connect("PUMP:Q1", "LOGO:I1")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=24"]);
    assert_eq!(order(&mut lab, connect("LOGO:I2", "PUMP:Q1")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I2=24"]);
    assert_eq!(lab.hear(pump), NOTHING, "the pump did not ask");
    refused(
        &mut lab,
        connect("PUMP:Q2", "LOGO:I1"),
        409,
        "LOGO:I1 is connected to PUMP:Q1 already; DISCONNECT it there first",
    );
    refused(
        &mut lab,
        connect("PUMP:Q1", "LOGO:Q1"),
        422,
        "Q1 and Q1 cannot be connected; connect an output with an input, digital or analog both",
    );
    refused(
        &mut lab,
        connect("PUMP:AQ1", "LOGO:I1"),
        422,
        "AQ1 and I1 cannot be connected; connect an output with an input, digital or analog both",
    );
    refused(
        &mut lab,
        connect("P1:Q1", "LOGO:I1"),
        404,
        "there is no client P1",
    );
    refused(
        &mut lab,
        connect("PUMP:Q3", "LOGO:I1"),
        404,
        "PUMP has no Q3",
    );
    refused(
        &mut lab,
        Order::Disconnect(pin("PUMP:Q2")),
        404,
        "PUMP:Q2 is not connected",
    );
    assert_eq!(order(&mut lab, Order::Disconnect(pin("LOGO:I1"))), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=0"]);
    lab.dispatcher.gone(logo);
    let connections = lab.dispatcher.snapshot().connections;
    assert!(!connections[0].is_awake, "it sleeps");
    assert_eq!(order(&mut lab, Order::Disconnect(pin("PUMP:Q1"))), Ok(()));
    assert!(lab.dispatcher.patch().is_empty());
}

#[test]
fn an_operator_is_answered_when_the_patch_is_saved_or_cannot_be() {
    let mut lab = Lab::new();
    lab.join("VR LOGO Q1 I1");
    let (sender, answer) = channel();
    let reply = Reply::new(move |outcome| sender.send(outcome).expect("it is waited for"));
    lab.dispatcher.operate(connect("LOGO:Q1", "LOGO:I1"), reply);
    lab.dispatcher.saved(&Err("disk full".to_owned()));
    let refusal = answer
        .try_recv()
        .expect("an answer")
        .expect_err("not saved");
    assert_eq!(
        refusal.to_string(),
        "ERR 500 the patch could not be saved (disk full); it holds until the dispatcher ends"
    );
}

#[test]
fn a_forced_output_gives_its_value_to_its_inputs_until_it_is_released() {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q1");
    let logo = lab.join("VR LOGO I3");
    for input in ["LOGO:I1", "LOGO:I2"] {
        order(&mut lab, connect("PUMP:Q1", input)).expect("it fits");
    }
    lab.say(pump, "P Q1=20");
    assert_eq!(lab.hear(logo), ["P I1=20 I2=20"]);
    assert_eq!(order(&mut lab, force("PUMP:Q1", "5.0")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=5 I2=5"]);
    lab.say(pump, "P Q1=24");
    assert_eq!(lab.hear(logo), NOTHING);
    assert_eq!(order(&mut lab, connect("PUMP:Q1", "LOGO:I3")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I3=5"], "who connects gets it, too");
    assert_eq!(order(&mut lab, Order::Disconnect(pin("LOGO:I2"))), Ok(()));
    assert_eq!(lab.hear(logo), ["P I2=0"]);
    let client = &lab.dispatcher.snapshot().clients[0];
    let shown = &client.channels[0];
    let texts = (shown.value, shown.forced);
    assert_eq!(format!("{texts:?}"), "(Some(24), Some(5))");
    assert_eq!(order(&mut lab, release("PUMP:Q1")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=24 I3=24"]);
    lab.say(pump, "P Q1=3");
    assert_eq!(lab.hear(logo), ["P I1=3 I3=3"], "each once");
    refused(&mut lab, release("PUMP:Q1"), 404, "PUMP:Q1 is not forced");
    refused(&mut lab, force("PUMP:Q9", "1"), 404, "PUMP has no Q9");
}

#[test]
fn a_forced_input_hears_nothing_else_until_it_is_released() {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q1");
    let logo = lab.join("VR LOGO I2");
    assert_eq!(order(&mut lab, force("LOGO:I1", "7")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=7"], "without a source, too");
    assert_eq!(order(&mut lab, connect("PUMP:Q1", "LOGO:I1")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=7"]);
    lab.say(pump, "P Q1=20");
    assert_eq!(order(&mut lab, force("LOGO:I1", "8")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=8"]);
    lab.dispatcher.gone(pump);
    assert_eq!(lab.hear(logo), NOTHING, "its source is lost, and it stays");
    let pump = lab.join("VP PUMP Q1");
    lab.say(pump, "P Q1=21");
    assert_eq!(lab.hear(logo), NOTHING);
    assert_eq!(order(&mut lab, release("LOGO:I1")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I1=21"]);
    lab.say(pump, "P Q1=22");
    assert_eq!(lab.hear(logo), ["P I1=22"]);
    order(&mut lab, force("LOGO:I2", "7")).expect("it is here");
    assert_eq!(lab.hear(logo), ["P I2=7"]);
    assert_eq!(order(&mut lab, release("LOGO:I2")), Ok(()));
    assert_eq!(lab.hear(logo), ["P I2=0"], "there is no source");
}

#[test]
fn both_ends_may_be_forced_and_are_released_in_any_order() {
    for first in ["PUMP:Q1", "LOGO:I1"] {
        let mut lab = Lab::new();
        let pump = lab.join("VP PUMP Q1");
        let logo = lab.join("VR LOGO I1");
        order(&mut lab, connect("PUMP:Q1", "LOGO:I1")).expect("it fits");
        order(&mut lab, force("PUMP:Q1", "1")).expect("it is here");
        order(&mut lab, force("LOGO:I1", "2")).expect("it is here");
        assert_eq!(lab.hear(logo), ["P I1=1", "P I1=2"]);
        lab.say(pump, "P Q1=3");
        order(&mut lab, release(first)).expect("it is forced");
        let second = if first == "PUMP:Q1" {
            assert_eq!(lab.hear(logo), NOTHING);
            "LOGO:I1"
        } else {
            assert_eq!(lab.hear(logo), ["P I1=1"]);
            "PUMP:Q1"
        };
        order(&mut lab, release(second)).expect("it is forced");
        assert_eq!(lab.hear(logo), ["P I1=3"]);
        lab.say(pump, "P Q1=4");
        assert_eq!(lab.hear(logo), ["P I1=4"], "there is one route");
    }
}

#[test]
fn what_is_forced_ends_with_its_client() {
    let settings = Settings {
        on_loss: OnLoss::Hold,
        ..Settings::default()
    };
    let mut lab = Lab::with(settings, Patch::new());
    let pump = lab.join("VP PUMP Q1");
    let logo = lab.join("VR LOGO I1");
    order(&mut lab, connect("PUMP:Q1", "LOGO:I1")).expect("it fits");
    order(&mut lab, force("PUMP:Q1", "9")).expect("it is here");
    lab.dispatcher.gone(pump);
    assert_eq!(
        lab.hear(logo),
        ["P I1=9", "P I1=0"],
        "an operator's value is not held, and there is no other"
    );
    let pump = lab.join("VP PUMP Q1");
    lab.say(pump, "P Q1=20");
    assert_eq!(lab.hear(logo), ["P I1=20"]);
    order(&mut lab, force("PUMP:Q1", "9")).expect("it is here");
    lab.say(pump, "P Q1=21");
    lab.dispatcher.gone(pump);
    assert_eq!(
        lab.hear(logo),
        ["P I1=9", "P I1=21"],
        "what it said last is held"
    );
}

#[test]
fn a_forced_value_that_is_released_is_not_held() {
    let settings = Settings {
        on_loss: OnLoss::Hold,
        ..Settings::default()
    };
    for first in ["PUMP:Q1", "LOGO:I1"] {
        let mut lab = Lab::with(settings, Patch::new());
        let pump = lab.join("VP PUMP Q1");
        let logo = lab.join("VR LOGO I1 V=3");
        order(&mut lab, connect("PUMP:Q1", "LOGO:I1")).expect("it fits");
        order(&mut lab, force(first, "9")).expect("it is here");
        order(&mut lab, release(first)).expect("it is forced");
        assert_eq!(lab.hear(logo), ["P I1=9", "P I1=?"], "nothing was said");
        lab.say(pump, "P Q1=20");
        order(&mut lab, force("LOGO:I1", "9")).expect("it is here");
        order(&mut lab, force("LOGO:I1", "10")).expect("it is here");
        lab.dispatcher.gone(pump);
        order(&mut lab, release("LOGO:I1")).expect("it is forced");
        assert_eq!(
            lab.hear(logo),
            ["P I1=20", "P I1=9", "P I1=10", "P I1=20"],
            "as before"
        );
        let pump = lab.join("VP PUMP Q1");
        lab.say(pump, "P Q1=21");
        order(&mut lab, force("PUMP:Q1", "9")).expect("it is here");
        order(&mut lab, Order::Disconnect(pin("LOGO:I1"))).expect("it is connected");
        assert_eq!(lab.hear(logo), ["P I1=21", "P I1=9", "P I1=21"]);
    }
}

#[test]
fn an_input_whose_source_is_lost_has_no_value() {
    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q1");
    lab.join("VR LOGO I1 V=3");
    order(&mut lab, connect("PUMP:Q1", "LOGO:I1")).expect("it fits");
    lab.say(pump, "P Q1=20");
    lab.dispatcher.gone(pump);
    assert_eq!(lab.dispatcher.snapshot().clients[0].channels[0].value, None);
}

#[test]
fn what_a_client_has_changed_is_saved_when_it_has_left() {
    let mut lab = Lab::new();
    lab.join("VP PUMP Q1");
    let logo = lab.join("VR LOGO I1");
    lab.dispatcher
        .arrived(lab.now, logo, b"CONNECT I1:PUMP:Q1\r\n");
    lab.dispatcher.gone(logo);
    let saved = lab.dispatcher.unsaved().expect("it is not saved yet");
    assert_eq!(saved.len(), 1);
    // The next client on that seat must not get the answer.
    let other = lab.connect();
    lab.dispatcher.saved(&Ok(()));
    assert_eq!(lab.hear(other), NOTHING);
    assert!(lab.dispatcher.unsaved().is_none());
}
