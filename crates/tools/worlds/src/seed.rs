//! The seeds of worlds.

use std::fmt;
use std::str::FromStr;

use crate::random::scramble;

/// The seed of a world. All bits of the masks are set, except in a world that was shrunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seed {
    /// The source of all randomness.
    pub number: u64,
    /// Selects the course of events. Several turns share the same two drivers, since reading two files takes as long as
    /// everything that happens to them.
    pub turn: u8,
    /// The features that may exist.
    pub features: u64,
    /// The drawn misfortunes that happen.
    pub events: u8,
    /// The features drawn last that may exist.
    pub more: u32,
}

impl From<u64> for Seed {
    fn from(number: u64) -> Self {
        Self {
            number,
            turn: 0,
            features: u64::MAX,
            events: u8::MAX,
            more: u32::MAX,
        }
    }
}

impl Seed {
    /// The number of turns per number when many worlds run.
    pub const TURNS: u8 = 8;

    /// The seed after this one when many worlds run.
    #[must_use]
    pub fn next(self) -> Self {
        let turn = (self.turn + 1) % Self::TURNS;
        Self {
            number: self.number.wrapping_add(u64::from(turn == 0)),
            turn,
            ..self
        }
    }

    /// The number that controls what happens to the two drivers.
    pub(crate) fn chance(self) -> u64 {
        if self.turn == 0 {
            return self.number;
        }
        self.number ^ scramble(u64::from(self.turn))
    }
}

/// The form of a seed in the corpus and on the command line: `number` or `number/turn`. With `:features:events`
/// appended, none of the features drawn last exist; `:features:events:more` permits those of the mask.
/// has none of the features that are drawn last, or with `:features:events:more`.
impl fmt::Display for Seed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            number,
            turn,
            features,
            events,
            more,
        } = self;
        write!(f, "{number}")?;
        if *turn > 0 {
            write!(f, "/{turn}")?;
        }
        let plain = Self::from(*number);
        if (*features, *events, *more) == (plain.features, plain.events, plain.more) {
            return Ok(());
        }
        write!(f, ":{features:x}:{events:x}")?;
        if *more > 0 {
            write!(f, ":{more:x}")?;
        }
        Ok(())
    }
}

impl FromStr for Seed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(':');
        let mut read = || -> Option<Self> {
            let number = parts.next()?;
            let (number, turn) = number.split_once('/').unwrap_or((number, "0"));
            let mut seed = Self::from(number.parse::<u64>().ok()?);
            seed.turn = turn.parse().ok()?;
            if let Some(features) = parts.next() {
                seed.features = u64::from_str_radix(features, 16).ok()?;
                seed.events = u8::from_str_radix(parts.next()?, 16).ok()?;
                let more = parts.next().unwrap_or("0");
                seed.more = u32::from_str_radix(more, 16).ok()?;
            }
            parts.next().is_none().then_some(seed)
        };
        read().ok_or_else(|| {
            format!(
                "\"{text}\" is no seed; write a number, as in 4711, number/turn, as in 4711/2, or either with :features:events or :features:events:more behind it, as in 4711:3ff:5"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_read_as_it_is_written() {
        let small = Seed {
            number: 4711,
            turn: 0,
            features: 0x3FF,
            events: 5,
            more: 0,
        };
        let more = Seed {
            more: 0x10,
            ..small
        };
        let turned = Seed { turn: 3, ..small };
        for (seed, text) in [
            (Seed::from(4711), "4711"),
            (small, "4711:3ff:5"),
            (more, "4711:3ff:5:10"),
            (turned, "4711/3:3ff:5"),
            (Seed::from(4711).next(), "4711/1"),
        ] {
            assert_eq!(seed.to_string(), text);
            assert_eq!(text.parse(), Ok(seed));
        }
        for wrong in ["", "x", "1:2", "1:2:3:4:5", "-1", "1/", "1/256", "1/2/3"] {
            assert!(wrong.parse::<Seed>().is_err(), "{wrong}");
        }
    }
}
