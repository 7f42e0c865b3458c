//! The patch: which output each input is connected to, by names.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use crate::channel::{Channel, Kind};
use crate::name::is_shown_name;

/// One channel of one client, by its name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pin {
    /// The name of the client.
    pub client: String,
    /// The channel.
    pub channel: Channel,
}

impl Pin {
    /// A channel of a client.
    pub fn new(client: &str, channel: Channel) -> Self {
        let client = client.to_owned();
        Self { client, channel }
    }

    /// Reads `NAME:I4`.
    pub fn parse(text: &str) -> Option<Self> {
        let (client, channel) = text.split_once(':')?;
        let channel = Channel::parse(channel.as_bytes())?;
        is_shown_name(client).then(|| Self::new(client, channel))
    }

    /// The first pin that a client of this name can have, in sort order.
    fn first(client: &str) -> Self {
        let kind = Kind::DigitalOutput;
        Self::new(client, Channel { kind, number: 0 })
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.client, self.channel)
    }
}

/// All connections: an input has one source, an output any number of sinks. Connections exist even while their clients
/// are absent.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Patch {
    sources: BTreeMap<Pin, Pin>,
    /// The same by sources.
    sinks: BTreeSet<(Pin, Pin)>,
}

impl Patch {
    /// No connections.
    pub fn new() -> Self {
        Self::default()
    }

    /// Connects an input to an output of the same sort, in place of its former source.
    pub fn connect(&mut self, sink: Pin, source: Pin) {
        self.disconnect(&sink);
        self.sinks.insert((source.clone(), sink.clone()));
        self.sources.insert(sink, source);
    }

    /// Cuts the connection of an input; returns its former source.
    pub fn disconnect(&mut self, sink: &Pin) -> Option<Pin> {
        let source = self.sources.remove(sink)?;
        self.sinks.remove(&(source.clone(), sink.clone()));
        Some(source)
    }

    /// The output that an input is connected to.
    pub fn source(&self, sink: &Pin) -> Option<&Pin> {
        self.sources.get(sink)
    }

    /// The inputs that an output is connected to.
    pub fn sinks<'a>(&'a self, source: &'a Pin) -> impl Iterator<Item = &'a Pin> {
        let from = (source.clone(), Pin::first(""));
        let all = self.sinks.range(from..);
        all.take_while(move |(other, _)| other == source)
            .map(|(_, sink)| sink)
    }

    /// All connections, as sink and source, in the order of the sinks.
    pub fn iter(&self) -> impl Iterator<Item = (&Pin, &Pin)> {
        self.sources.iter()
    }

    /// The number of connections.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// True if there are no connections.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// The connections in which the client of this name is a sink, a source or both, as sink and source.
    pub(crate) fn of_client(&self, name: &str) -> Vec<(Pin, Pin)> {
        let own = self.sources.range(Pin::first(name)..);
        let own = own.take_while(|(sink, _)| sink.client == name);
        let own = own.map(|(sink, source)| (sink.clone(), source.clone()));
        let from = (Pin::first(name), Pin::first(""));
        let others = self.sinks.range(from..);
        let others = others.take_while(|(source, _)| source.client == name);
        // Connections of the client with itself are already among its own.
        let others = others.filter(|(_, sink)| sink.client != name);
        own.chain(others.map(|(source, sink)| (sink.clone(), source.clone())))
            .collect()
    }
}
