//! The head of each station, in a driver.cfg.

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Key, Shape, Table, Value};
use tickbus_image::signal::{Area, SignalTable};

use crate::HEADS;

/// The key of a station, or of a driver without stations.
pub(crate) const KEYS: &[Key] = &[Key::new(
    "head",
    Shape::Whole(1, HEADS as i128),
    "The number of the reader's head; with several stations each has its own",
)];

/// The head of each station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct HeadNumbers {
    /// The head of a driver without `[[station]]` tables.
    single: u8,
    /// The heads in the tables, as far as they could be read, with their lines.
    own: Vec<(Option<u8>, usize)>,
    /// The offset of `[fieldbus]`.
    at: usize,
}

impl HeadNumbers {
    /// Reads `head` in `[fieldbus]`.
    pub(crate) fn read(table: &mut Table<'_>) -> Option<Self> {
        let single = table.take("head");
        Some(Self {
            single: single.map_or(Some(1), |value| read_head(&value))?,
            own: Vec::new(),
            at: table.at(),
        })
    }

    /// Reads `head` in the next of `count` `[[station]]` tables.
    pub(crate) fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        let head = if count > 1 {
            table.require("head", "write which head of the reader it is: head = 1")
        } else {
            table.take("head")
        };
        let Some(value) = head else {
            self.own.push((Some(self.single), 0));
            return;
        };
        let number = read_head(&value);
        let twin = self
            .own
            .iter()
            .find(|(other, _)| number.is_some() && *other == number);
        if let Some((_, line)) = twin {
            value.wrong(
                format!("\"head\" is that of the station on line {line}"),
                "give each station a head of its own",
            );
        }
        self.own.push((number, value.line()));
    }

    /// The number of heads.
    pub(crate) fn count(&self) -> usize {
        self.own.len().max(1)
    }

    /// The head of a station.
    pub(crate) fn of(&self, station: usize) -> u8 {
        let own = self.own.get(station).and_then(|(number, _)| *number);
        own.unwrap_or(self.single)
    }

    /// Reports stations that are smaller than a head's bytes before its data: `least` bytes of `%I`, and of `%Q`.
    pub(crate) fn fit(&self, table: &SignalTable, least: [usize; 2], collector: &Collector<'_>) {
        for station in &table.stations {
            for (area, least, key) in [
                (Area::Input, least[0], "input_bytes"),
                (Area::Output, least[1], "output_bytes"),
            ] {
                let has = station.bytes(area);
                if has < least {
                    let name = match station.name.as_str() {
                        "" => "the head".to_owned(),
                        name => format!("the head of station \"{name}\""),
                    };
                    collector.collect(
                        self.at,
                        Mistake::new(
                            format!("{name} has {has} bytes of {area}, and needs {least} before its data"),
                            format!("give all of them signals, or write {key} = {least}"),
                        ),
                    );
                }
            }
        }
    }

    /// The heads as text.
    pub(crate) fn shown(&self, table: &SignalTable) -> String {
        let all: Vec<String> = (0..table.stations.len())
            .map(|station| self.of(station).to_string())
            .collect();
        let word = if all.len() == 1 { "head" } else { "heads" };
        format!("{word} {}", all.join(" "))
    }
}

fn read_head(value: &Value<'_>) -> Option<u8> {
    let number = value.whole(1..=HEADS as i128)?;
    u8::try_from(number).ok()
}

/// The meaning of a signal's bytes: the name of a byte before the data, or its place in the data.
pub(crate) fn meaning(byte: usize, names: &[&'static str]) -> String {
    names.get(byte).map_or_else(
        || format!("data {}", byte - names.len()),
        |name| (*name).to_owned(),
    )
}
