//! Messages in, messages out, and a client of the dispatcher between them; no I/O.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_dispatcher::grammar::{Line, parse};
use tickbus_dispatcher::{Channel, Number};

use super::map_file::{Entry, Format, Map};
use crate::ascii::{AsciiBridge, LineEnd};
use crate::lines::{Cut, Lines};

/// Above this voltage a digital channel is on.
const ON: f64 = 8.0;

/// Below this voltage it is off; between them it keeps its state.
const OFF: f64 = 5.0;

/// Publishes a message of an entry; false if the broker takes no more now.
pub type Publish<'p> = dyn FnMut(&Entry, &str) -> bool + 'p;

/// What went through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Messages published.
    pub published: u64,
    /// Messages that were passed on as values.
    pub received: u64,
    /// Messages that were no value of their channel, and left out.
    pub refused: u64,
    /// Values that a newer one has replaced, because a side was slow.
    pub overtaken: u64,
}

/// A client of the dispatcher whose values are messages.
#[derive(Debug)]
pub struct Mapping {
    map: Map,
    client: AsciiBridge,
    heard: Lines,
    /// By entries: what waits to be published, and how many messages were no value.
    states: Vec<State>,
    traffic: Traffic,
}

#[derive(Clone, Debug, Default)]
struct State {
    waiting: Option<String>,
    refused: u64,
}

impl Mapping {
    /// What `map` says.
    pub fn new(map: Map) -> Self {
        let mut client = AsciiBridge::new(LineEnd::Lf);
        let (keyword, name) = (map.role.keyword(), &map.name);
        let mut line = format!("{keyword} {name}");
        for kind in tickbus_dispatcher::Kind::ALL {
            line += &format!(" {}{}", kind.letters(), map.counts().of(kind));
        }
        client.from_serial(Nanos::ZERO, format!("{line}\n").as_bytes());
        Self {
            states: vec![State::default(); map.channels.len()],
            map,
            client,
            heard: Lines::default(),
            traffic: Traffic::default(),
        }
    }

    /// What it does.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// The client of the dispatcher.
    pub fn client(&mut self) -> &mut AsciiBridge {
        &mut self.client
    }

    /// What went through so far.
    pub fn traffic(&self) -> Traffic {
        let overtaken = self.traffic.overtaken + self.client.traffic().overtaken;
        Traffic {
            overtaken,
            ..self.traffic
        }
    }

    /// The broker is gone. Close the connection with the dispatcher: to the others this client has left.
    pub fn broker_lost(&mut self) {
        self.client.unplugged();
        for state in &mut self.states {
            state.waiting = None;
        }
    }

    /// A message has come from the broker. Returns what an operator should know of it.
    pub fn message(&mut self, now: Nanos, topic: &str, payload: &[u8]) -> Vec<String> {
        let mut news = Vec::new();
        for (entry, state) in self.map.channels.iter().zip(&mut self.states) {
            if entry.topic != topic || !entry.channel.kind.is_output() {
                continue;
            }
            let channel = entry.channel;
            if let Some(number) = entry.format.value(payload) {
                self.traffic.received += 1;
                let line = format!("P {channel}={number}\n");
                self.client.from_serial(now, line.as_bytes());
                continue;
            }
            self.traffic.refused += 1;
            state.refused += 1;
            // Who sends one such message sends more.
            if state.refused.is_power_of_two() {
                let text = shown(&String::from_utf8_lossy(payload));
                let (right, count) = (entry.format.right(), state.refused);
                news.push(format!(
                    "\"{text}\" from the topic \"{topic}\" is no value of {channel}, and was left out ({count} so far); \
                     send {right}"
                ));
            }
        }
        news
    }

    /// Publishes what the dispatcher has sent. Returns what an operator should know of it.
    pub fn publish(&mut self, publish: &mut Publish<'_>) -> Vec<String> {
        let mut news = Vec::new();
        for (entry, state) in self.map.channels.iter().zip(&mut self.states) {
            if let Some(payload) = state.waiting.take_if(|payload| publish(entry, payload)) {
                drop(payload);
                self.traffic.published += 1;
            }
        }
        let bytes = self.client.to_serial().to_vec();
        self.client.wrote_to_serial(bytes.len());
        let mut bytes = &*bytes;
        while let Some(cut) = self.heard.next(&mut bytes) {
            let Cut::Line(line) = cut else {
                continue;
            };
            match parse(&line) {
                Ok(Line::Values(values)) => {
                    for (channel, number) in values.flatten() {
                        self.value(channel, number, publish);
                    }
                }
                _ if line.starts_with(b"ERR ") && !line.starts_with(b"ERR 503") => {
                    let text = String::from_utf8_lossy(&line);
                    news.push(format!("the dispatcher answers: {}", shown(&text)));
                }
                // The list of devices.
                _ => {}
            }
        }
        news
    }

    fn value(&mut self, channel: Channel, number: Number, publish: &mut Publish<'_>) {
        for (entry, state) in self.map.channels.iter().zip(&mut self.states) {
            if entry.channel != channel {
                continue;
            }
            let Some(payload) = entry.format.payload(&number) else {
                continue;
            };
            if state.waiting.is_none() && publish(entry, &payload) {
                self.traffic.published += 1;
            } else if state.waiting.replace(payload).is_some() {
                self.traffic.overtaken += 1;
            }
        }
    }
}

impl Format {
    /// A value as a message; `None` between off and on, and for what no number can say.
    fn payload(&self, number: &Number) -> Option<String> {
        let value = || number.as_str().parse::<f64>().ok();
        match self {
            Self::Plain => Some(number.as_str().to_owned()),
            Self::Scaled { factor, offset } => {
                let scaled = decimal(value()? * factor + offset)?;
                Some(scaled.as_str().to_owned())
            }
            Self::Words { on, off } => match value()? {
                volts if volts > ON => Some(on.clone()),
                volts if volts < OFF => Some(off.clone()),
                _ => None,
            },
        }
    }

    /// A message as a value.
    fn value(&self, payload: &[u8]) -> Option<Number> {
        let text = std::str::from_utf8(payload).ok()?.trim();
        let number = || text.parse::<f64>().ok();
        match self {
            Self::Plain => Number::parse(text.as_bytes()).or_else(|| decimal(number()?)),
            Self::Scaled { factor, offset } => decimal(number()? * factor + offset),
            Self::Words { on, .. } if text == on => Number::parse(b"24"),
            Self::Words { off, .. } if text == off => Some(Number::ZERO),
            Self::Words { .. } => None,
        }
    }

    /// What messages should be.
    fn right(&self) -> String {
        match self {
            Self::Plain | Self::Scaled { .. } => "a number such as 21.5 as plain text".to_owned(),
            Self::Words { on, off } => format!("{on} or {off}"),
        }
    }
}

/// A number with 15 digits that count: those that a double carries through a calculation.
fn decimal(value: f64) -> Option<Number> {
    if !value.is_finite() {
        return None;
    }
    let whole = format!("{:.0}", value.trunc().abs()).len();
    let decimals = 15_usize.saturating_sub(whole);
    Number::parse(format!("{value:.decimals$}").as_bytes())
}
