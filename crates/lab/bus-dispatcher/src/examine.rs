//! The examination of a line: the dispatcher, the key of the laboratory, and who is there.

use tickbus_dispatcher::client::{Client, Event, KEEP_ALIVE, Profile};
use tickbus_dispatcher::{Counts, Device, Role as Part};
use tickbus_fieldbus::examine::{Examination, Wire, WireEnd};

use super::Options;

/// The outcome of a visit.
enum Visit {
    /// The clients of the dispatcher.
    Devices(Vec<Device>),
    /// The dispatcher refuses, or no dispatcher is there.
    Refused(String),
    End(WireEnd),
}

impl Options {
    /// Examines the line. A client without channels asks who is there, and leaves: nothing is connected, and no value sent.
    pub(super) fn examine(&self, examination: &mut Examination<'_>) {
        let own = match self.profile(&examination.setup) {
            Ok(own) => own,
            Err(mistake) => {
                let next = "correct name or key_file";
                examination.fail("protocol", "profile", mistake.to_string(), next);
                return;
            }
        };
        let Some((_, wire)) = examination.reach(&self.address) else {
            return;
        };
        let visitor = Profile {
            role: Part::Process,
            name: format!("tickbus-doctor-{}", std::process::id()),
            counts: Counts::default(),
            cables: Vec::new(),
            alive: None,
            key: own.key.clone(),
        };
        let Ok(client) = Client::new(visitor, KEEP_ALIVE) else {
            return;
        };
        match visit(client, wire) {
            Visit::Devices(devices) => tell(examination, &own, &devices),
            Visit::Refused(why) => {
                let next = "compare key_file with the dispatcher's, and see whether a dispatcher listens there";
                examination.fail("protocol", "refused", why, next);
            }
            Visit::End(end) => {
                let next = "see whether a dispatcher listens there: tickbus dispatch";
                let evidence = format!("{} {end}", self.address);
                examination.fail("protocol", "silent", evidence, next);
            }
        }
    }
}

/// Joins, takes the list of clients, and leaves.
fn visit(mut client: Client, mut wire: Wire) -> Visit {
    let deadline = wire.deadline();
    client.connected(wire.now());
    let mut devices = Vec::new();
    let mut is_whole = false;
    let mut received = Vec::new();
    loop {
        client.turn(wire.now());
        let out = client.to_write().to_vec();
        if !out.is_empty() {
            if let Err(end) = wire.send(&out) {
                return Visit::End(end);
            }
            client.wrote(wire.now(), out.len());
        }
        received.clear();
        if let Err(end) = wire.receive(&mut received, deadline) {
            return Visit::End(end);
        }
        let heard = client.hear(wire.now(), &received, &mut |event| match event {
            Event::Device(device) => devices.push(device),
            Event::ListEnd => is_whole = true,
            _ => {}
        });
        if let Err(error) = heard {
            return Visit::Refused(error.to_string());
        }
        if is_whole {
            // If it fails, the dispatcher sees the end of the connection.
            let _ = wire.send(b"BYE\r\n");
            devices.retain(|device| device.name != client.profile().name);
            return Visit::Devices(devices);
        }
    }
}

/// The steps `protocol`, `name` and `cables`.
fn tell(examination: &mut Examination<'_>, own: &Profile, devices: &[Device]) {
    let names: Vec<&str> = devices.iter().map(|device| &*device.name).collect();
    let step = examination.ok("protocol", "a dispatcher answers, and lets clients in");
    step.details = vec![match &names[..] {
        [] => "nobody else is there".to_owned(),
        names => format!("there are {}", names.join(", ")),
    }];
    if let Some(taken) = devices.iter().find(|device| device.name == own.name) {
        let evidence = format!("\"{}\" is there already, from {}", own.name, taken.peer);
        let next =
            "end it, or write another name; if it is your simulation, the line is as it should be";
        examination.warn("client", "name-taken", evidence, next);
    } else {
        examination.ok("client", format!("the name \"{}\" is free", own.name));
    }
    let is_there = |name: &str| {
        let of = |role| devices.iter().any(|device| device.role == role);
        names.contains(&name)
            || name.starts_with('P') && of(Part::Process)
            || name.starts_with('R') && of(Part::Controller)
    };
    let missing: Vec<String> = (own.cables.iter())
        .filter(|cable| !is_there(&cable.peer))
        .map(ToString::to_string)
        .collect();
    if !missing.is_empty() {
        let evidence = format!("nobody is there for {}", missing.join(", "));
        let next = "start the other client; the connection is then made";
        examination.warn("cables", "peer-missing", evidence, next);
    } else if !own.cables.is_empty() {
        let count = own.cables.len();
        examination.ok(
            "cables",
            format!("the peers of all {count} connections are there"),
        );
    }
}
