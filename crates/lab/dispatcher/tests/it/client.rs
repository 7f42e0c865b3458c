//! The client against the dispatcher, both without sockets.

use crate::common::Lab;
use tickbus_base::time::Nanos;
use tickbus_dispatcher::client::{ASK_AGAIN, Client, ClientError, Event, KEEP_ALIVE, Profile};
use tickbus_dispatcher::{Cable, Channel, Counts, Number, Role};

/// A client in a seat of the lab.
struct Seated {
    client: Client,
    seat: usize,
    events: Vec<String>,
}

impl Seated {
    fn join(lab: &mut Lab, role: Role, name: &str, cables: &[&str]) -> Self {
        let profile = Profile {
            role,
            name: name.to_owned(),
            counts: Counts::new(2, 2, 2, 2),
            cables: cables
                .iter()
                .map(|text| Cable::parse(text).expect(text))
                .collect(),
            alive: None,
            key: None,
        };
        let mut client = Client::new(profile, KEEP_ALIVE).expect("a right profile");
        client.connected(lab.now);
        Self {
            client,
            seat: lab.connect(),
            events: Vec::new(),
        }
    }

    /// Exchanges all pending bytes, and returns the events.
    fn settle(&mut self, lab: &mut Lab) -> Result<Vec<String>, ClientError> {
        loop {
            self.client.turn(lab.now);
            let bytes = self.client.to_write().to_vec();
            self.client.wrote(lab.now, bytes.len());
            lab.send(self.seat, &bytes);
            let heard = lab.hear(self.seat);
            if bytes.is_empty() && heard.is_empty() {
                return Ok(std::mem::take(&mut self.events));
            }
            let events = &mut self.events;
            for line in heard {
                let take = &mut |event: Event<'_>| match event {
                    Event::Value(channel, value) => events.push(format!("{channel}={value}")),
                    Event::Lost(channel) => events.push(format!("{channel} is lost")),
                    Event::Refused { cable, code, .. } => {
                        events.push(format!("{} {code}", cable.expect("of a connection")));
                    }
                    Event::Device(device) => events.push(device.name),
                    _ => {}
                };
                self.client
                    .hear(lab.now, format!("{line}\r\n").as_bytes(), take)?;
            }
            self.client.check(lab.now)?;
        }
    }

    fn set(&mut self, channel: &str, value: &str) {
        let channel = Channel::parse(channel.as_bytes()).expect(channel);
        self.client
            .set(channel, Number::parse(value.as_bytes()).expect(value));
    }
}

#[test]
fn two_clients_exchange_values_and_find_each_other_in_any_order() {
    let mut lab = Lab::new();
    let mut pump = Seated::join(
        &mut lab,
        Role::Process,
        "PUMP",
        &["I2:LOGO:Q2", "AQ2:LOGO:AI2"],
    );
    pump.set("AQ2", "7.5");
    let right = ["PUMP", "I2:LOGO:Q2 404", "AQ2:LOGO:AI2 404"];
    assert_eq!(pump.settle(&mut lab), Ok(right.map(str::to_owned).to_vec()));
    let mut logo = Seated::join(&mut lab, Role::Controller, "LOGO", &["I1:P1:Q1"]);
    logo.set("Q2", "24");
    assert_eq!(logo.settle(&mut lab).expect("taken"), ["PUMP", "LOGO"]);
    assert_eq!(
        pump.settle(&mut lab).expect("taken"),
        [""; 0],
        "it is not time yet"
    );
    lab.wait(ASK_AGAIN);
    assert_eq!(pump.settle(&mut lab).expect("taken"), ["I2=24"]);
    assert_eq!(logo.settle(&mut lab).expect("taken"), ["AI2=7.5"]);
    pump.set("Q1", "24");
    pump.settle(&mut lab).expect("taken");
    assert_eq!(logo.settle(&mut lab).expect("taken"), ["I1=24"]);
    lab.dispatcher.gone(pump.seat);
    assert_eq!(
        logo.settle(&mut lab).expect("taken"),
        ["I1 is lost", "AI2 is lost"]
    );
    // The client comes back: connections wake, and it sends its values again.
    pump.seat = lab.connect();
    pump.client.connected(lab.now);
    pump.settle(&mut lab).expect("taken");
    assert_eq!(
        logo.settle(&mut lab).expect("taken"),
        ["I1=24", "AI2=7.5", "AI2=7.5"],
        "at once, and by CONNECT"
    );
}

#[test]
fn a_taken_name_is_told_and_a_quiet_client_stays() {
    let mut lab = Lab::new();
    let mut first = Seated::join(&mut lab, Role::Process, "PUMP", &[]);
    first.settle(&mut lab).expect("taken");
    let mut second = Seated::join(&mut lab, Role::Controller, "PUMP", &[]);
    let Err(ClientError::Refused(why)) = second.settle(&mut lab) else {
        panic!("the name is taken");
    };
    assert!(
        why.starts_with("the dispatcher has another client \"PUMP\""),
        "{why}"
    );
    for _ in 0..20 {
        lab.wait(KEEP_ALIVE);
        first.settle(&mut lab).expect("it stays");
    }
    lab.wait(Nanos::from_secs(60));
    let Err(ClientError::Refused(why)) = first.settle(&mut lab) else {
        panic!("it was silent for 60 s");
    };
    assert!(
        why.contains("has disconnected \"PUMP\" (nothing was heard for"),
        "{why}"
    );
}
