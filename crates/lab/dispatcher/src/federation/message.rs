//! The messages between dispatchers.
//!
//! A letter is a byte with the version of this format, followed by `postcard`. Clients and channels appear as the text
//! that clients use, so the same rules check them.

use serde::{Deserialize, Serialize};

use crate::channel::{Channel, Kind, MOST_CHANNELS};
use crate::device::Device;
use crate::host::HostId;
use crate::label::Label;
use crate::name::is_name;
use crate::patch::Pin;

/// The version of this format. Dispatchers with different versions do not understand each other.
const VERSION: u8 = 2;

/// A connection: a sink and its source.
pub(crate) type Joint = (Pin, Pin);

/// One message from one dispatcher to another.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Letter {
    /// The sender.
    pub(crate) from: HostId,
    /// The stream that this letter belongs to. A new stream begins with [`Body::Snapshot`], and has a higher number.
    pub(crate) stream: u64,
    /// The letter's number in the stream, from 0. A [`Body::Beat`] has the number of the next letter.
    pub(crate) number: u64,
    /// The content.
    pub(crate) body: Body,
}

/// The content of a letter.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Body {
    /// A sign of life, outside of the stream. `is_lost`: letters of yours are missing here, begin a new stream.
    Beat { is_lost: bool },
    /// All clients and connections of a dispatcher.
    Snapshot {
        /// The name of its host.
        host: String,
        clients: Vec<Client>,
        patch: Vec<WireJoint>,
    },
    /// A client has come.
    Here(Client),
    /// The client that registered at this time has gone.
    Gone(u64),
    /// The client that registered at this time calls channels so.
    Named(u64, Vec<WireName>),
    /// An input has this source now, or no longer has one.
    Patched(WirePin, Option<WirePin>),
    /// The values of an output are wanted: of your client that registered at this time, at this place among its
    /// outputs. Mark them by this number.
    Want {
        since: u64,
        output: u16,
        number: u32,
    },
    /// The values of this output are not wanted any more.
    Unwant { since: u64, output: u16 },
    /// Lines of values, as for clients: `P 17=20 18=3`, by the numbers of wants.
    Values(String),
    /// Make these connections and cut those, all or none; answer with this number.
    Request {
        number: u32,
        connect: Vec<WireJoint>,
        cut: Vec<WireJoint>,
    },
    /// The outcome of a request: `Err` has the code and the text of the refusal.
    Answer {
        number: u32,
        outcome: Result<(), (u16, String)>,
    },
}

/// A client, with the time of its registration.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Client {
    pub(crate) since: u64,
    /// The client's line in the device list.
    line: String,
    /// The names that it has given its channels.
    pub(crate) names: Vec<WireName>,
}

/// A channel and its name as text, such as `AQ1 Level`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct WireName(String);

/// A pin as text.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct WirePin(String);

/// A connection as text.
pub(crate) type WireJoint = (WirePin, WirePin);

impl From<&Pin> for WirePin {
    fn from(pin: &Pin) -> Self {
        Self(pin.to_string())
    }
}

impl WirePin {
    /// The pin, or `None` if the text is not a valid one.
    pub(crate) fn pin(&self) -> Option<Pin> {
        Pin::parse(&self.0)
    }
}

impl WireName {
    pub(crate) fn new(channel: Channel, label: &Label) -> Self {
        Self(format!("{channel} {label}"))
    }

    /// The channel and its name, or `None` if the text is not a valid one.
    pub(crate) fn read(&self) -> Option<(Channel, Label)> {
        let (channel, label) = self.0.split_once(' ')?;
        Some((
            Channel::parse(channel.as_bytes())?,
            Label::read(label.as_bytes())?,
        ))
    }
}

/// Connections as text.
pub(crate) fn to_wire(joints: &[Joint]) -> Vec<WireJoint> {
    let all = joints.iter();
    all.map(|(sink, source)| (sink.into(), source.into()))
        .collect()
}

/// A connection of an input with an output of its kind, or `None` if the text is not a valid one.
pub(crate) fn joint((sink, source): &WireJoint) -> Option<Joint> {
    let (sink, source) = (sink.pin()?, source.pin()?);
    let (to, from) = (sink.channel.kind, source.channel.kind);
    let fits = !to.is_output() && from.is_output() && to.is_analog() == from.is_analog();
    fits.then_some((sink, source))
}

impl Client {
    pub(crate) fn new(since: u64, device: &Device, names: Vec<WireName>) -> Self {
        let line = device.to_string();
        Self { since, line, names }
    }

    /// The client, or `None` if the line is not a valid one.
    pub(crate) fn device(&self) -> Option<Device> {
        let device = Device::parse(self.line.as_bytes())?;
        let counts = Kind::ALL.map(|kind| device.counts.of(kind));
        let is_right = is_name(&device.name) && counts.iter().all(|count| *count <= MOST_CHANNELS);
        // Later clients need room for higher numbers.
        (is_right && self.since < u64::MAX / 2).then_some(device)
    }
}

/// Why a letter cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unreadable {
    #[error(
        "it has version {0} of the letters among dispatchers, and this one reads version {VERSION}"
    )]
    Version(u8),
    #[error("it is no letter of a dispatcher")]
    Damaged,
}

impl Letter {
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        postcard::to_extend(self, vec![VERSION]).expect("memory takes any letter")
    }

    pub(crate) fn read(bytes: &[u8]) -> Result<Self, Unreadable> {
        match bytes.split_first() {
            Some((&VERSION, rest)) => {
                let (letter, rest) =
                    postcard::take_from_bytes(rest).map_err(|_| Unreadable::Damaged)?;
                rest.is_empty().then_some(letter).ok_or(Unreadable::Damaged)
            }
            Some((version, _)) => Err(Unreadable::Version(*version)),
            None => Err(Unreadable::Damaged),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_letter_reads_what_was_written_and_nothing_shorter_or_longer() {
        let pin = |text| WirePin::from(&Pin::parse(text).expect(text));
        let joint = || (pin("B:I1"), pin("A:Q1"));
        let client = Client {
            since: 7,
            line: "VP:A:Q01:I00:AQ00:AI00:[::1]:80".to_owned(),
            names: vec![WireName("Q1 Running".to_owned())],
        };
        let bodies = [
            Body::Beat { is_lost: true },
            Body::Snapshot {
                host: "pi".to_owned(),
                clients: vec![client.clone()],
                patch: vec![joint()],
            },
            Body::Here(client),
            Body::Gone(1),
            Body::Named(1, vec![WireName("AQ1 Level".to_owned())]),
            Body::Patched(pin("B:I1"), None),
            Body::Want {
                since: 1,
                output: 2,
                number: 3,
            },
            Body::Values("P 17=20\r\n".to_owned()),
            Body::Request {
                number: 1,
                connect: vec![joint()],
                cut: vec![joint()],
            },
            Body::Answer {
                number: 1,
                outcome: Err((404, "no".to_owned())),
            },
        ];
        for body in bodies {
            let letter = Letter {
                from: HostId(u128::MAX),
                stream: 1,
                number: 2,
                body,
            };
            let mut bytes = letter.to_bytes();
            for length in 0..bytes.len() {
                assert!(Letter::read(&bytes[..length]).is_err(), "{letter:?}");
            }
            assert_eq!(Letter::read(&bytes).as_ref(), Ok(&letter));
            bytes.push(0);
            assert_eq!(Letter::read(&bytes), Err(Unreadable::Damaged));
            bytes[0] = 9;
            assert_eq!(Letter::read(&bytes), Err(Unreadable::Version(9)));
        }
    }

    #[test]
    fn what_clients_may_not_say_is_not_taken_from_dispatchers_either() {
        let device = |since, line: &str| {
            let line = line.to_owned();
            let names = Vec::new();
            Client { since, line, names }.device()
        };
        assert!(device(1, "VP:A:Q256:I00:AQ00:AI00:1.2.3.4:5").is_some());
        assert!(device(1, "VP:A:Q257:I00:AQ00:AI00:1.2.3.4:5").is_none());
        assert!(device(1, "VP:A@pi:Q01:I00:AQ00:AI00:1.2.3.4:5").is_none());
        assert!(device(u64::MAX, "VP:A:Q01:I00:AQ00:AI00:1.2.3.4:5").is_none());
        let named = |text: &str| WireName(text.to_owned()).read();
        let level = Channel::parse(b"AQ1").zip(Label::of("Level of 1"));
        assert_eq!(named("AQ1 Level of 1"), level);
        for wrong in [
            "AQ1",
            "AQ1 ",
            "X1 a",
            "AQ1 a\u{1b}[2J",
            &format!("AQ1 {}", "x".repeat(121)),
        ] {
            assert_eq!(named(wrong), None, "{wrong}");
        }
        let text = |text: &str| WirePin(text.to_owned());
        for (sink, source, fits) in [
            ("A:I1", "B@pi:Q1", true),
            ("A:Q1", "B:Q1", false),
            ("A:I1", "B:I1", false),
            ("A:AI1", "B:Q1", false),
            ("A", "B:Q1", false),
            ("A/:I1", "B:Q1", false),
        ] {
            let joint = joint(&(text(sink), text(source)));
            assert_eq!(joint.is_some(), fits, "{sink} {source}");
        }
    }
}
