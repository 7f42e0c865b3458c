//! The file that maps topics to channels.

use std::collections::BTreeMap;
use std::path::Path;

use tickbus_base::toml_text::{Collector, Mistakes, Table, Value, load_text, read_text, shown};
use tickbus_dispatcher::{
    Channel, Counts, Key, Kind, LONGEST_NAME, MOST_CHANNELS, PORT, Role, is_name,
};
use tickbus_net::Address;

use super::access::{Access, key_of};

/// The description of a bridge between MQTT and the dispatcher.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The address of the MQTT broker.
    pub broker: Address,
    /// How the broker lets the bridge in.
    pub access: Access,
    /// The topic for the state of the bridge.
    pub status: Option<String>,
    /// The address of the dispatcher.
    pub dispatcher: Address,
    /// The key of the laboratory, if it has one.
    pub key: Option<Key>,
    /// The bridge's role in the laboratory.
    pub role: Role,
    /// The bridge's name there, and with the broker.
    pub name: String,
    /// The channels.
    pub channels: Vec<Entry>,
}

/// A channel and its topic. Values of an input are published; those of an output come from messages of the topic.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The channel.
    pub channel: Channel,
    /// The topic.
    pub topic: String,
    /// The broker keeps the message for later subscribers.
    pub retain: bool,
    /// The format of a value in a message.
    pub format: Format,
}

/// The format of a value in a message.
#[derive(Clone, Debug, PartialEq)]
pub enum Format {
    /// As a number in plain text.
    Plain,
    /// As a number: the forwarded value is the original times `factor`, plus `offset`.
    Scaled {
        /// The factor.
        factor: f64,
        /// The offset.
        offset: f64,
    },
    /// As a word for on and one for off.
    Words {
        /// On above 8 V; 24 V in the other direction.
        on: String,
        /// Off below 5 V; 0 V in the other direction.
        off: String,
    },
}

impl Map {
    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// With every mistake in it.
    pub fn load(path: &Path) -> Result<Self, Mistakes> {
        Self::parse(&path.display().to_string(), &load_text(path)?)
    }

    /// Reads the text of a file; messages call it `file`. The paths in it are relative to the folder of `file`.
    ///
    /// # Errors
    ///
    /// With every mistake in it.
    pub fn parse(file: &str, text: &str) -> Result<Self, Mistakes> {
        let mut collector = Collector::new(file, text);
        let map = read_text(&mut collector, text, |root| read(file, root));
        match (collector.finish(), map) {
            (None, Some(map)) => Ok(map),
            (Some(mistakes), _) => Err(mistakes),
            (None, None) => Err(Mistakes::of_file(
                file,
                "it could not be read",
                "docs/dispatcher.md has an example",
            )),
        }
    }

    /// The number of channels of each kind: up to the highest number in use.
    pub fn counts(&self) -> Counts {
        let count = |kind: Kind| {
            let own = self.channels.iter().map(|entry| entry.channel);
            let own = own.filter(|channel| channel.kind == kind);
            own.map(|channel| channel.number).max().unwrap_or(0)
        };
        let [q, i, aq, ai] = Kind::ALL.map(count);
        Counts::new(q, i, aq, ai)
    }
}

fn read(file: &str, mut root: Table<'_>) -> Option<Map> {
    const CHANNEL: &str = "write [[channel]] tables with a channel and a topic";

    let mqtt = root.require("mqtt", "write an [mqtt] table with the broker");
    let lab = root.require(
        "dispatcher",
        "write a [dispatcher] table with a name and a role",
    );
    let list = root.require("channel", CHANNEL);
    root.finish();
    let folder = Path::new(file).parent().unwrap_or(Path::new(""));
    let mqtt =
        mqtt.and_then(|value| read_mqtt(value.table("[mqtt]", "write an [mqtt] table")?, folder));
    let lab = lab.and_then(|value| {
        read_dispatcher(
            value.table("[dispatcher]", "write a [dispatcher] table")?,
            folder,
        )
    });
    let channels = read_channels(&list?);
    let ((broker, access, status), (dispatcher, key, role, name)) = (mqtt?, lab?);
    let status = status.map(|(value, topic)| {
        if let Some(entry) = channels.iter().find(|entry| entry.topic == topic) {
            let what = format!("\"{topic}\" is the topic of {} as well", entry.channel);
            value.wrong(what, "take another topic for the status");
        }
        topic
    });
    Some(Map {
        broker,
        access,
        status,
        dispatcher,
        key,
        role,
        name,
        channels,
    })
}

/// The topic of the status, with its position.
type Status<'a> = Option<(Value<'a>, String)>;

fn read_mqtt<'a>(mut table: Table<'a>, folder: &Path) -> Option<(Address, Access, Status<'a>)> {
    let broker = table.require(
        "broker",
        "write where the broker listens, such as \"127.0.0.1:1883\"",
    );
    let status = table.take("status");
    let access = Access::read(&mut table, folder);
    table.finish();
    let status = status.and_then(|value| topic(&value).map(|topic| (value, topic)));
    Some((Address::read_dialled(&broker?)?, access?, status))
}

fn read_dispatcher(
    mut table: Table<'_>,
    folder: &Path,
) -> Option<(Address, Option<Key>, Role, String)> {
    let address = table.take("address");
    let key = table.take("key_file");
    let role = table.require(
        "role",
        "write \"VP\" for a process or \"VR\" for a controller",
    );
    let name = table.require("name", "write the name of this client, such as \"HALL\"");
    table.finish();
    let address = match address {
        Some(value) => Address::read_dialled(&value),
        None => Some(Address::local(PORT)),
    };
    let roles = [("VR", Role::Controller), ("VP", Role::Process)];
    let role = role.and_then(|value| value.choice("roles", &roles));
    let right = format!("write 1 to {LONGEST_NAME} letters, digits, _, - and .");
    let name = name.and_then(|value| {
        let text = value.text(&right)?;
        if !is_name(text) {
            value.wrong(
                format!("\"{}\" cannot be the name of a client", shown(text)),
                &*right,
            );
            return None;
        }
        Some(text.to_owned())
    });
    let key = key.map_or(Some(None), |value| key_of(&value, folder).map(Some));
    Some((address?, key?, role?, name?))
}

/// A single topic, not a filter for several.
fn topic(value: &Value<'_>) -> Option<String> {
    let right = "write a topic such as \"hall/pump/speed\"";
    let text = value.label(1000, right)?;
    if text.contains(['+', '#']) || text.starts_with('$') {
        let what = format!("\"{}\" is no single topic of yours", shown(text));
        value.wrong(what, "write one without +, # and a $ at its beginning");
        return None;
    }
    Some(text.to_owned())
}

fn read_channels(list: &Value<'_>) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut lines = BTreeMap::new();
    for table in list.tables("[[channel]]") {
        let collector = table.collector();
        let Some((entry, at)) = read_channel(table) else {
            continue;
        };
        let channel = entry.channel;
        if let Some(line) = lines.insert(channel, collector.line(at)) {
            let what = format!("{channel} stands in line {line} already");
            collector.report(at, what, "a channel has one topic");
        }
        // Several outputs may subscribe to one topic.
        let collides = |other: &&Entry| {
            let hears_both = other.channel.kind.is_output() && channel.kind.is_output();
            other.topic == entry.topic && !hears_both && other.channel != channel
        };
        if let Some(other) = entries.iter().find(collides) {
            let what = format!(
                "the topic of {channel} is that of {} as well",
                other.channel
            );
            let is_echo = other.channel.kind.is_output() != channel.kind.is_output();
            let why = if is_echo {
                "the bridge would hear itself; take another topic for one of them"
            } else {
                "their values would overwrite each other; take another topic for one of them"
            };
            collector.report(at, what, why);
        }
        entries.push(entry);
    }
    entries
}

fn read_channel(mut table: Table<'_>) -> Option<(Entry, usize)> {
    let channel = table.require("channel", "write which, such as \"I1\"");
    let name = table.require("topic", "write its topic, such as \"hall/pump/speed\"");
    let retain = table.take("retain");
    let [factor, offset] = ["factor", "offset"].map(|key| table.take(key));
    let [on, off] = ["on", "off"].map(|key| table.take(key));
    let at = table.at();
    table.finish();
    let name = name.and_then(|value| topic(&value));
    let retains = match &retain {
        Some(value) => value.boolean()?,
        None => false,
    };
    let channel = channel.and_then(|value| read_name(&value))?;
    if let Some(value) = retain.filter(|_| channel.kind.is_output()) {
        value.wrong(
            format!("{channel} is an output, and nothing of it is published"),
            "remove \"retain\"",
        );
    }
    let number = |value: &Value<'_>| value.number("write a number such as 0.1");
    let word = |value: &Value<'_>| {
        let text = value.label(100, "write a word such as \"ON\"");
        text.map(str::to_owned)
    };
    let format = match (on, off) {
        (None, None) if factor.is_none() && offset.is_none() => Format::Plain,
        (None, None) => {
            let by = factor.as_ref().map_or(Some(1.0), number)?;
            let offset = offset.as_ref().map_or(Some(0.0), number)?;
            if let Some(value) = factor.filter(|_| by == 0.0) {
                value.wrong(
                    "\"factor\" is 0, and every value would be the same",
                    "write another one",
                );
                return None;
            }
            Format::Scaled { factor: by, offset }
        }
        (Some(on), Some(off)) => {
            if channel.kind.is_analog() {
                on.wrong(
                    format!("{channel} is analog"),
                    "words for on and off are for digital channels",
                );
            }
            if factor.is_some() || offset.is_some() {
                on.wrong(
                    "words have no factor and no offset",
                    "remove either the words or these",
                );
            }
            let words = (word(&on)?, word(&off)?);
            if words.0 == words.1 {
                off.wrong("on and off are the same word", "write two words");
            }
            Format::Words {
                on: words.0,
                off: words.1,
            }
        }
        (Some(one), None) | (None, Some(one)) => {
            one.wrong(
                "the other word is missing",
                "write both \"on\" and \"off\", or none of them",
            );
            return None;
        }
    };
    Some((
        Entry {
            channel,
            topic: name?,
            retain: retains,
            format,
        },
        at,
    ))
}

fn read_name(value: &Value<'_>) -> Option<Channel> {
    let right = "write one such as \"Q1\", \"I1\", \"AQ1\" or \"AI1\"";
    let text = value.text(right)?;
    let Some(channel) = Channel::parse(text.as_bytes()) else {
        value.wrong(format!("\"{}\" is no channel", shown(text)), right);
        return None;
    };
    if !(1..=MOST_CHANNELS).contains(&channel.number) {
        let what = format!("there is no channel {channel}");
        value.wrong(what, format!("write a number from 1 to {MOST_CHANNELS}"));
        return None;
    }
    Some(channel)
}
