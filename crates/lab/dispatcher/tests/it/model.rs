//! The routing table against a model that is too simple to be wrong: no indices, and everything looked up by name.

use std::collections::{BTreeMap, BTreeSet};

use crate::common::Lab;
use proptest::prelude::*;
use tickbus_dispatcher::{OnLoss, Patch, Settings};

const NAMES: [&str; 3] = ["A", "B", "C"];
const CHANNELS: [&str; 8] = ["Q1", "Q2", "I1", "I2", "AQ0", "AQ1", "AI0", "AI1"];
/// The possible channels of a client, and the same as an identification.
const SHAPES: [(&str, &[&str]); 2] = [
    ("Q02 I01", &["Q1", "Q2", "I1"]),
    (
        "Q01 I02 AQ01 AI01",
        &["Q1", "I1", "I2", "AQ0", "AQ1", "AI0", "AI1"],
    ),
];

#[derive(Clone, Debug)]
enum Step {
    Join(usize, usize),
    Leave(usize),
    Set(usize, usize, u8),
    Connect(usize, Vec<(usize, usize, usize)>),
    Disconnect(usize, usize),
}

fn step() -> impl Strategy<Value = Step> {
    let (name, channel) = (0..NAMES.len(), 0..CHANNELS.len());
    let joint = (channel.clone(), name.clone(), channel.clone());
    prop_oneof![
        2 => (name.clone(), 0..SHAPES.len()).prop_map(|(name, shape)| Step::Join(name, shape)),
        1 => name.clone().prop_map(Step::Leave),
        6 => (name.clone(), channel.clone(), 0_u8..3).prop_map(|(name, at, value)| Step::Set(name, at, value)),
        4 => (name.clone(), prop::collection::vec(joint, 1..3)).prop_map(|(name, joints)| Step::Connect(name, joints)),
        2 => (name, channel).prop_map(|(name, channel)| Step::Disconnect(name, channel)),
    ]
}

type Pin = (&'static str, &'static str);

#[derive(Default)]
struct Model {
    holds: bool,
    here: BTreeMap<&'static str, BTreeSet<&'static str>>,
    /// The source of each sink.
    patch: BTreeMap<Pin, Pin>,
    values: BTreeMap<Pin, u8>,
    told: BTreeMap<Pin, u8>,
    /// Values sent since the last look, with their receivers.
    events: Vec<(Pin, u8)>,
}

impl Model {
    fn has(&self, pin: Pin) -> bool {
        self.here
            .get(pin.0)
            .is_some_and(|channels| channels.contains(pin.1))
    }

    fn tell(&mut self, sink: Pin, value: u8) {
        self.told.insert(sink, value);
        self.events.push((sink, value));
    }

    fn fail(&mut self, sink: Pin) {
        if !self.holds && self.told.get(&sink).is_some_and(|value| *value != 0) {
            self.tell(sink, 0);
        }
    }

    /// Carries a step out; returns the code of the refusal.
    fn take(&mut self, step: &Step) -> Option<u16> {
        match step {
            Step::Join(name, shape) => {
                let name = NAMES[*name];
                if self.here.contains_key(name) {
                    return Some(409);
                }
                self.here
                    .insert(name, SHAPES[*shape].1.iter().copied().collect());
                for (sink, source) in self.patch.clone() {
                    if sink.0 == name && self.has(sink) {
                        self.refresh(sink, source);
                    }
                }
            }
            Step::Leave(name) => {
                let name = NAMES[*name];
                self.here.remove(name);
                self.values.retain(|pin, _| pin.0 != name);
                self.told.retain(|pin, _| pin.0 != name);
                for (sink, source) in self.patch.clone() {
                    if source.0 == name {
                        self.fail(sink);
                    }
                }
            }
            Step::Set(name, channel, value) => {
                let pin = (NAMES[*name], CHANNELS[*channel]);
                if pin.1.contains('I') {
                    return Some(422);
                }
                if !self.has(pin) {
                    return Some(404);
                }
                if self.values.insert(pin, *value) != Some(*value) {
                    for (sink, source) in self.patch.clone() {
                        if source == pin && self.has(sink) && self.told.get(&sink) != Some(value) {
                            self.tell(sink, *value);
                        }
                    }
                }
            }
            Step::Connect(name, joints) => return self.connect(NAMES[*name], joints),
            Step::Disconnect(name, channel) => {
                let pin = (NAMES[*name], CHANNELS[*channel]);
                let cut = |(sink, source): &(Pin, Pin)| *sink == pin || *source == pin;
                let all = self.patch.clone().into_iter();
                let cut: Vec<_> = all.filter(cut).collect();
                if !self.has(pin) || cut.is_empty() {
                    return Some(404);
                }
                for (sink, _) in cut {
                    self.patch.remove(&sink);
                    self.fail(sink);
                }
            }
        }
        None
    }

    fn connect(&mut self, name: &'static str, joints: &[(usize, usize, usize)]) -> Option<u16> {
        let mut patch = self.patch.clone();
        let mut made = Vec::new();
        for (own, peer, channel) in joints {
            let own = (name, CHANNELS[*own]);
            let peer = (NAMES[*peer], CHANNELS[*channel]);
            if !self.has(own) || !self.has(peer) {
                return Some(404);
            }
            let is_input = |pin: Pin| pin.1.contains('I');
            let is_analog = |pin: Pin| pin.1.starts_with('A');
            if is_input(own) == is_input(peer) || is_analog(own) != is_analog(peer) {
                return Some(422);
            }
            let (sink, source) = if is_input(own) {
                (own, peer)
            } else {
                (peer, own)
            };
            if patch
                .insert(sink, source)
                .is_some_and(|other| other != source)
            {
                return Some(409);
            }
            made.push((sink, source));
        }
        self.patch = patch;
        for (sink, source) in made {
            self.refresh(sink, source);
        }
        None
    }

    fn refresh(&mut self, sink: Pin, source: Pin) {
        if let Some(value) = self.values.get(&source).copied() {
            self.tell(sink, value);
        }
    }
}

/// The same step for the dispatcher: the seat that sends the line, and the line.
fn line(step: &Step) -> (usize, String) {
    match step {
        Step::Join(name, shape) => (*name, format!("VR {} {}", NAMES[*name], SHAPES[*shape].0)),
        Step::Leave(name) => (*name, String::new()),
        Step::Set(name, channel, value) => (*name, format!("P {}={value}", CHANNELS[*channel])),
        Step::Connect(name, joints) => {
            let joint = |(own, peer, channel): &(usize, usize, usize)| {
                format!(
                    " {}:{}:{}",
                    CHANNELS[*own], NAMES[*peer], CHANNELS[*channel]
                )
            };
            (
                *name,
                "CONNECT".to_owned() + &joints.iter().map(joint).collect::<String>(),
            )
        }
        Step::Disconnect(name, channel) => (*name, format!("DISCONNECT {}", CHANNELS[*channel])),
    }
}

/// The values in lines for a client, in the order of channels.
fn values(name: &'static str, heard: &[String]) -> Vec<(String, u8)> {
    let lines = heard.iter().filter_map(|line| line.strip_prefix("P "));
    let words = lines.flat_map(|line| line.split(' '));
    let mut values: Vec<_> = words
        .map(|word| {
            let (channel, value) = word.split_once('=').expect(word);
            (format!("{name}:{channel}"), value.parse().expect(value))
        })
        .collect();
    values.sort();
    values
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_dispatcher_does_what_the_model_does(holds: bool, steps in prop::collection::vec(step(), 1..60)) {
        let on_loss = if holds { OnLoss::Hold } else { OnLoss::FailSafe };
        let mut lab = Lab::with(Settings { on_loss, ..Settings::default() }, Patch::new());
        let mut model = Model { holds, ..Model::default() };
        let mut seats: [Option<usize>; 3] = [None; 3];
        for step in &steps {
            let (at, line) = line(step);
            if let Step::Leave(_) = step {
                if let Some(seat) = seats[at].take() {
                    lab.dispatcher.gone(seat);
                    model.take(step);
                }
            } else {
                let Some(seat) = seats[at].or_else(|| matches!(step, Step::Join(..)).then(|| lab.connect())) else {
                    continue;
                };
                seats[at] = Some(seat);
                lab.say(seat, &line);
                let refusal = model.take(step);
                let heard = lab.dispatcher.to_write(seat).to_vec();
                let heard = String::from_utf8(heard).expect("text");
                let told = heard.split("ERR ").nth(1).and_then(|rest| rest.get(..3)?.parse().ok());
                prop_assert_eq!(told, refusal, "{}: {}", line, heard);
            }
            for (name, seat) in NAMES.iter().zip(&seats) {
                if let Some(seat) = seat {
                    let mut expected: Vec<_> = model
                        .events
                        .iter()
                        .filter(|(sink, _)| sink.0 == *name)
                        .map(|(sink, value)| (format!("{}:{}", sink.0, sink.1), *value))
                        .collect();
                    expected.sort();
                    prop_assert_eq!(values(name, &lab.hear(*seat)), expected, "{}", line);
                }
            }
            model.events.clear();
            let patch: Vec<_> = lab.dispatcher.patch().iter().map(|(sink, source)| (sink.to_string(), source.to_string())).collect();
            let pin = |pin: &Pin| format!("{}:{}", pin.0, pin.1);
            let mut expected: Vec<_> = model.patch.iter().map(|(sink, source)| (pin(sink), pin(source))).collect();
            expected.sort();
            let mut patch = patch;
            patch.sort();
            prop_assert_eq!(patch, expected);
        }
    }

    #[test]
    fn no_line_is_too_strange(lines in prop::collection::vec("[A-Za-z]{0,11}[ :=\t]{0,2}([AQIPVR0-9 :=.-]{0,12}| *[IQ]1:A:[IQ]1)\r?", 1..20), bytes: Vec<u8>) {
        let mut lab = Lab::new();
        let seat = lab.join("VR A Q02 I02 AQ02 AI02 V=2");
        for line in lines {
            lab.send(seat, line.as_bytes());
            lab.send(seat, b"\n");
            for heard in lab.hear(seat) {
                let is_right = ["OK ", "ERR ", "P ", "VR:", "END "].iter().any(|word| heard.starts_with(word));
                prop_assert!(is_right, "{}", heard);
            }
        }
        lab.send(seat, &bytes);
        lab.hear(seat);
    }
}
