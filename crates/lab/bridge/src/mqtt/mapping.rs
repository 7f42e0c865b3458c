//! Messages in, messages out, and a client of the dispatcher between them; no I/O.

use std::collections::VecDeque;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_dispatcher::client::{Client, Event, KEEP_ALIVE, Profile};
use tickbus_dispatcher::{Number, level};

use super::map_file::{Entry, Format, Map};
use crate::speaker::Speaker;

/// Publishes a message of an entry; false if the broker takes no more now.
pub type Publish<'p> = dyn FnMut(&Entry, &str) -> bool + 'p;

/// Counts of everything that went through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Messages published.
    pub published: u64,
    /// Messages that were forwarded as values.
    pub received: u64,
    /// Messages that were no value of their channel, and dropped; and values that no message can express.
    pub refused: u64,
    /// Values that were replaced by newer ones, because a side was slow.
    pub overtaken: u64,
}

/// The most messages that wait to be published; beyond that, only the newest of each topic is kept.
const QUEUE: usize = 256;

/// A client of the dispatcher whose values are messages.
#[derive(Debug)]
pub struct Mapping {
    map: Map,
    client: Client,
    is_connected: bool,
    /// Messages to publish, with their entries.
    waiting: VecDeque<(usize, String)>,
    /// By entries: true if the input has had a value in this connection with the dispatcher.
    has_value: Vec<bool>,
    /// By entries: the number of messages that were no value, or values that were no message.
    refused: Vec<u64>,
    /// News for an operator.
    news: Vec<String>,
    traffic: Traffic,
}

impl Mapping {
    /// The mapping that `map` describes.
    ///
    /// # Errors
    ///
    /// No dispatcher can accept such a client.
    pub fn new(map: Map) -> Result<Self, Mistake> {
        Ok(Self {
            client: client(&map)?,
            is_connected: false,
            waiting: VecDeque::new(),
            has_value: vec![false; map.channels.len()],
            refused: vec![0; map.channels.len()],
            news: Vec::new(),
            traffic: Traffic::default(),
            map,
        })
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// The traffic so far.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// Takes the news for an operator.
    pub fn news(&mut self) -> Vec<String> {
        std::mem::take(&mut self.news)
    }

    /// The broker is gone. Close the connection with the dispatcher: for all others this client has left. Its values
    /// are dropped, since they may have changed by the time the broker is back.
    pub fn broker_lost(&mut self) {
        // Cannot fail: the same map made the first client.
        if let Ok(client) = client(&self.map) {
            self.client = client;
        }
        self.is_connected = false;
        self.waiting.clear();
    }

    /// A message has come from the broker.
    pub fn message(&mut self, topic: &str, payload: &[u8]) {
        for (entry, refused) in self.map.channels.iter().zip(&mut self.refused) {
            if entry.topic != topic || !entry.channel.kind.is_output() {
                continue;
            }
            let channel = entry.channel;
            if let Some(number) = entry.format.value(payload) {
                self.traffic.received += 1;
                self.client.set(channel, number);
                continue;
            }
            self.traffic.refused += 1;
            *refused += 1;
            // A sender of one such message sends more.
            if refused.is_power_of_two() {
                let text = shown(&String::from_utf8_lossy(payload));
                let right = entry.format.right();
                self.news.push(format!(
                    "\"{text}\" from the topic \"{topic}\" is no value of {channel}, and was left out ({refused} so far); \
                     send {right}"
                ));
            }
        }
    }

    /// Publishes the dispatcher's values, as long as the broker accepts them.
    pub fn publish(&mut self, publish: &mut Publish<'_>) {
        while let Some((at, payload)) = self.waiting.front()
            && publish(&self.map.channels[*at], payload)
        {
            self.waiting.pop_front();
            self.traffic.published += 1;
        }
    }
}

/// The client that a map describes.
fn client(map: &Map) -> Result<Client, Mistake> {
    let profile = Profile {
        role: map.role,
        name: map.name.clone(),
        counts: map.counts(),
        cables: Vec::new(),
        alive: None,
        key: map.key.clone(),
    };
    Client::new(profile, KEEP_ALIVE)
}

impl Speaker for Mapping {
    fn connected(&mut self, now: Nanos) {
        self.client.connected(now);
        self.is_connected = true;
        self.has_value.fill(false);
    }

    fn disconnected(&mut self) -> bool {
        self.is_connected = false;
        false
    }

    fn is_here(&self) -> bool {
        self.is_connected && self.client.is_identified()
    }

    fn wants_to_hear(&self) -> bool {
        true
    }

    fn hear(&mut self, now: Nanos, bytes: &[u8]) -> Result<(), String> {
        let (map, waiting) = (&self.map, &mut self.waiting);
        let (traffic, news) = (&mut self.traffic, &mut self.news);
        let (has_value, refused) = (&mut self.has_value, &mut self.refused);
        let mut put = |at: usize, payload: String| {
            let is_full = waiting.len() >= QUEUE;
            let older = waiting
                .iter_mut()
                .rev()
                .find(|older| is_full && older.0 == at);
            if let Some(older) = older {
                older.1 = payload;
                traffic.overtaken += 1;
            } else {
                waiting.push_back((at, payload));
            }
        };
        let entries = || map.channels.iter().enumerate();
        let heard = self.client.hear(now, bytes, &mut |event| match event {
            Event::Value(channel, number) => {
                for (at, entry) in entries().filter(|(_, entry)| entry.channel == channel) {
                    has_value[at] = true;
                    match entry.format.payload(&number) {
                        Payload::Text(text) => put(at, text),
                        Payload::Between => {}
                        Payload::TooLarge => {
                            put(at, String::new());
                            refused[at] += 1;
                            if refused[at].is_power_of_two() {
                                let (topic, count) = (&entry.topic, refused[at]);
                                news.push(format!(
                                    "{number} of {channel} is too large for the topic \"{topic}\" with its factor and offset, \
                                     and an empty message was sent ({count} so far); correct the factor"
                                ));
                            }
                        }
                    }
                }
            }
            Event::Lost(channel) => {
                for (at, _) in entries().filter(|(_, entry)| entry.channel == channel) {
                    put(at, String::new());
                }
            }
            // The source of an old value may have left while the bridge was not connected.
            Event::Settled => {
                for (at, entry) in entries() {
                    if !has_value[at] && !entry.channel.kind.is_output() {
                        put(at, String::new());
                    }
                }
            }
            Event::Refused { code, text, .. } => {
                news.push(format!("the dispatcher answers ERR {code} {text}"));
            }
            _ => {}
        });
        let refused: u64 = self.refused.iter().sum();
        self.traffic.refused = refused;
        heard.map_err(|error| error.to_string())
    }

    fn tick(&mut self, now: Nanos) -> Result<(), String> {
        if !self.is_connected {
            return Ok(());
        }
        self.client.turn(now);
        self.client.check(now).map_err(|error| error.to_string())
    }

    fn deadline(&self) -> Nanos {
        self.client.deadline()
    }

    fn to_write(&mut self) -> &[u8] {
        self.client.to_write()
    }

    fn wrote(&mut self, now: Nanos, count: usize) {
        self.client.wrote(now, count);
    }
}

/// The message for a value.
enum Payload {
    Text(String),
    /// Unchanged: within the hysteresis band.
    Between,
    /// The value has more digits than a number of the dispatcher.
    TooLarge,
}

impl Format {
    /// A value as a message.
    fn payload(&self, number: &Number) -> Payload {
        let value = || number.to_f64();
        match self {
            Self::Plain => Payload::Text(number.as_str().to_owned()),
            Self::Scaled { factor, offset } => decimal(value() * factor + offset)
                .map_or(Payload::TooLarge, |scaled| {
                    Payload::Text(scaled.as_str().to_owned())
                }),
            Self::Words { on, off } => match level(value()) {
                Some(true) => Payload::Text(on.clone()),
                Some(false) => Payload::Text(off.clone()),
                None => Payload::Between,
            },
        }
    }

    /// A message as a value. An empty one, as published for an input without a source, is 0.
    fn value(&self, payload: &[u8]) -> Option<Number> {
        if payload.is_empty() {
            return Some(Number::ZERO);
        }
        let text = std::str::from_utf8(payload).ok()?.trim();
        let number = || text.parse::<f64>().ok();
        match self {
            Self::Plain => Number::parse(text.as_bytes()).or_else(|| Number::of(number()?)),
            Self::Scaled { factor, offset } => decimal(number()? * factor + offset),
            Self::Words { on, .. } if text == on => Number::parse(b"24"),
            Self::Words { off, .. } if text == off => Some(Number::ZERO),
            Self::Words { .. } => None,
        }
    }

    /// The expected form of messages.
    fn right(&self) -> String {
        match self {
            Self::Plain | Self::Scaled { .. } => "a number such as 21.5 as plain text".to_owned(),
            Self::Words { on, off } => format!("{on} or {off}"),
        }
    }
}

/// A number with 15 significant digits: those that a double keeps through a calculation.
fn decimal(value: f64) -> Option<Number> {
    if !value.is_finite() {
        return None;
    }
    let whole = format!("{:.0}", value.trunc().abs()).len();
    let decimals = 15_usize.saturating_sub(whole);
    Number::parse(format!("{value:.decimals$}").as_bytes())
}
