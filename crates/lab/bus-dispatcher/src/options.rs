//! The options of the bus in a driver.cfg.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Key, Shape, Table, Value};
use tickbus_dispatcher::client::Profile;
use tickbus_dispatcher::{
    Cable, Channel, Key as LabKey, Kind, LEAST_PROMISE, LONGEST_NAME, LONGEST_PROMISE,
    MOST_CHANNELS, PORT, Role as Part, is_name,
};
use tickbus_fieldbus::{At, BusSetup, Role};
use tickbus_image::signal::SignalTable;
use tickbus_net::Address;

use super::channels::{Channels, kind_of};

/// The longest path, in characters.
const PATH_LIMIT: usize = 1000;

/// The keys of the bus, for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    Key::new("address", Shape::ADDRESS, "Where the dispatcher listens").or("\"127.0.0.1:20070\""),
    Key::new(
        "name",
        Shape::Pattern("[A-Za-z0-9_.-]{1,63}"),
        "A unique name in the laboratory; the driver's name by default",
    ),
    Key::new(
        "connect",
        Shape::List(&Shape::Text, 0, usize::MAX),
        "The connections to request, such as \"I1:PUMP:Q2\"",
    ),
    Key::new(
        "key_file",
        Shape::Label(PATH_LIMIT),
        "The file with the key of the laboratory, relative to the folder of this file",
    ),
];

/// The options of the bus `dispatcher`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The address of the dispatcher.
    pub address: Address,
    /// The name in the laboratory, if stated.
    pub name: Option<String>,
    /// The connections to request, each with its offset in the file.
    pub cables: Vec<(usize, Cable)>,
    /// The file with the key of the laboratory, if it has one; relative to the folder of the driver.cfg.
    pub key_file: Option<PathBuf>,
    /// The key, if it is known without a file.
    pub key: Option<LabKey>,
    /// Signals with their own channel, by name: `[fieldbus.at]`.
    pub at: BTreeMap<String, Channel>,
    pub(super) role: Role,
    /// The offset of the `[fieldbus]` table, for mistakes.
    offset: usize,
}

impl Options {
    /// Reads `address`, `name`, `connect` and `key_file`. With `moved`, `set_address` follows.
    pub fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let address = table.take("address");
        let name = table.take("name");
        let connect = table.take("connect");
        let key_file = table.take("key_file");
        let address = address.map_or(Some(Address::local(PORT)), |value| {
            let address = Address::read(&value)?;
            if !moved && let Err(mistake) = address.check_dialled() {
                value.refuse(mistake);
            }
            Some(address)
        });
        let name = name.map_or(Some(None), |value| read_name(&value).map(Some));
        let cables = connect.map_or(Some(Vec::new()), |value| read_cables(&value));
        let key_file = key_file.map_or(Some(None), |value| {
            let file = value.label(PATH_LIMIT, "name the file with the key of the laboratory");
            file.map(|file| Some(PathBuf::from(file)))
        });
        Some(Self {
            address: address?,
            name: name?,
            cables: cables?,
            key_file: key_file?,
            key: None,
            at: BTreeMap::new(),
            role,
            offset: table.at(),
        })
    }

    /// Replaces the address of the driver.cfg.
    pub(super) fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        let address: Address = address.parse()?;
        address.check_dialled()?;
        self.address = address;
        Ok(())
    }

    /// The key of the laboratory; `folder` is that of the driver.cfg.
    fn key(&self, folder: &Path) -> Result<Option<LabKey>, Mistake> {
        if self.key.is_some() {
            return Ok(self.key.clone());
        }
        let file = self.key_file.as_ref();
        file.map(|file| LabKey::load(&folder.join(file)))
            .transpose()
    }

    /// Reports a key that cannot be read.
    pub(super) fn check_key(&self, folder: &Path, collector: &Collector<'_>) {
        if let Err(mistake) = self.key(folder) {
            collector.collect(self.offset, mistake);
        }
    }

    /// The channels of all signals.
    pub fn channels(&self, table: &SignalTable) -> Channels {
        Channels::new(table, self.role, &self.at)
    }

    /// Takes the lines of `[fieldbus.at]`: channels.
    pub(super) fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        for line in lines {
            let signal = &table.signals[line.signal];
            let kind = kind_of(signal, self.role);
            let letters = kind.letters();
            let channel = Channel::parse(line.text.as_bytes());
            let fits = |channel: &Channel| {
                channel.kind == kind && (1..=MOST_CHANNELS).contains(&channel.number)
            };
            let Some(channel) = channel.filter(fits) else {
                line.wrong(
                    format!("\"{}\" is no channel for \"{}\"", line.text, signal.name),
                    format!("write one from {letters}1 to {letters}{MOST_CHANNELS}"),
                );
                continue;
            };
            if let Some((other, _)) = self.at.iter().find(|(_, taken)| **taken == channel) {
                line.wrong(
                    format!("{channel} is the channel of \"{other}\", too"),
                    "give each signal a channel of its own",
                );
                continue;
            }
            self.at.insert(signal.name.clone(), channel);
        }
    }

    /// Reports problems of the signals.
    pub(super) fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        let counts = self.channels(table).counts;
        for kind in Kind::ALL {
            let count = counts.of(kind);
            if count > MOST_CHANNELS {
                collector.report(
                    self.offset,
                    format!("the signals make {count} channels {}", kind.letters()),
                    format!("a client of a dispatcher has up to {MOST_CHANNELS} of a kind; write a second driver.cfg"),
                );
            }
        }
        for (at, cable) in &self.cables {
            if let Err(mistake) = cable.check(counts) {
                collector.collect(*at, mistake);
            }
        }
    }

    /// The driver's description of itself to the dispatcher.
    ///
    /// # Errors
    ///
    /// No name is stated, and the driver's name is not valid; or the key cannot be read.
    pub(super) fn profile(&self, setup: &BusSetup<'_>) -> Result<Profile, Mistake> {
        let name = match (&self.name, self.role) {
            (Some(name), _) => name.clone(),
            (None, Role::Device | Role::Observer) => setup.name.to_owned(),
            // One driver.cfg may serve both ends.
            (None, Role::Controller) => format!("{}-PLC", setup.name),
        };
        if !is_name(&name) {
            return Err(Mistake::new(
                format!("the driver's name makes \"{name}\", which no dispatcher takes"),
                format!(
                    "write a \"name\" of 1 to {LONGEST_NAME} letters, digits, _, - and . into [fieldbus]"
                ),
            ));
        }
        let profile = Profile {
            role: self.part(),
            name,
            counts: self.channels(setup.table).counts,
            cables: self.cables.iter().map(|(_, cable)| cable.clone()).collect(),
            // Clients fed by this driver lose their source if it falls silent for longer than its `max_age`.
            alive: Some(setup.max_age.clamp(LEAST_PROMISE, LONGEST_PROMISE)),
            key: self.key(setup.folder)?,
        };
        profile.check().map(|()| profile)
    }

    /// The part in the laboratory.
    pub(super) const fn part(&self) -> Part {
        match self.role {
            Role::Device | Role::Observer => Part::Process,
            Role::Controller => Part::Controller,
        }
    }
}

fn read_name(value: &Value<'_>) -> Option<String> {
    let right = format!(
        "write a name of 1 to {LONGEST_NAME} letters, digits, _, - and ., such as name = \"PUMP\""
    );
    let name = value.text(&right)?;
    if !is_name(name) {
        value.wrong("no dispatcher takes this name", right);
        return None;
    }
    Some(name.to_owned())
}

fn read_cables(value: &Value<'_>) -> Option<Vec<(usize, Cable)>> {
    const RIGHT: &str = "write connections in quotes, such as connect = [\"I1:PUMP:Q2\"]";
    let read = |value: &Value<'_>| {
        let cable = Cable::parse(value.text(RIGHT)?);
        let cable = cable.map_err(|mistake| value.refuse(mistake)).ok()?;
        Some((value.at(), cable))
    };
    // Report all mistakes, not only the first.
    let cables: Vec<_> = value.list(RIGHT)?.iter().map(read).collect();
    cables.into_iter().collect()
}
