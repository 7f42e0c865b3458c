//! Messages in, messages out, and a client of the dispatcher between them; no I/O.

use std::collections::VecDeque;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_dispatcher::client::{Client, Event, KEEP_ALIVE, Profile};
use tickbus_dispatcher::{Channel, Number};

use super::map_file::{Entry, Format, Map};
use crate::speaker::Speaker;

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

/// So many messages may wait to be published; from then on only the newest of each topic.
const QUEUE: usize = 256;

/// A client of the dispatcher whose values are messages.
#[derive(Debug)]
pub struct Mapping {
    map: Map,
    client: Client,
    is_connected: bool,
    /// Messages to be published, with their entries.
    waiting: VecDeque<(usize, String)>,
    /// By entries: how many messages were no value.
    refused: Vec<u64>,
    /// What an operator should know.
    news: Vec<String>,
    traffic: Traffic,
}

impl Mapping {
    /// What `map` says.
    ///
    /// # Errors
    ///
    /// No dispatcher can take such a client.
    pub fn new(map: Map) -> Result<Self, Mistake> {
        Ok(Self {
            client: client(&map)?,
            is_connected: false,
            waiting: VecDeque::new(),
            refused: vec![0; map.channels.len()],
            news: Vec::new(),
            traffic: Traffic::default(),
            map,
        })
    }

    /// What it does.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// What went through so far.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// What an operator should know, and does not yet.
    pub fn news(&mut self) -> Vec<String> {
        std::mem::take(&mut self.news)
    }

    /// The broker is gone. Close the connection with the dispatcher: to the others this client has left. Its values are
    /// forgotten, since they may have changed when the broker is back.
    pub fn broker_lost(&mut self) {
        // One like this was made before.
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
            // Who sends one such message sends more.
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

    /// Publishes what the dispatcher has sent, as long as the broker takes it.
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
    };
    Client::new(profile, KEEP_ALIVE)
}

impl Speaker for Mapping {
    fn connected(&mut self, now: Nanos) {
        self.client.connected(now);
        self.is_connected = true;
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
        let mut put = |channel: Channel, number: Option<Number>| {
            for (at, entry) in map.channels.iter().enumerate() {
                if entry.channel == channel
                    && let Some(payload) =
                        number.map_or(Some(String::new()), |it| entry.format.payload(&it))
                {
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
                }
            }
        };
        let heard = self.client.hear(now, bytes, &mut |event| match event {
            Event::Value(channel, number) => put(channel, Some(number)),
            Event::Lost(channel) => put(channel, None),
            Event::Refused { code, text, .. } => {
                news.push(format!("the dispatcher answers ERR {code} {text}"));
            }
            _ => {}
        });
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

impl Format {
    /// A value as a message; `None` between off and on, and for what no number can say.
    fn payload(&self, number: &Number) -> Option<String> {
        let value = || number.to_f64();
        match self {
            Self::Plain => Some(number.as_str().to_owned()),
            Self::Scaled { factor, offset } => {
                let scaled = decimal(value() * factor + offset)?;
                Some(scaled.as_str().to_owned())
            }
            Self::Words { on, off } => match value() {
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
            Self::Plain => Number::parse(text.as_bytes()).or_else(|| Number::of(number()?)),
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
