//! What a world is drawn from.

use std::fmt;
use std::str::FromStr;

/// What a world is drawn from. All bits of both masks are set, but in a world that was shrunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seed {
    /// The source of all chance.
    pub number: u64,
    /// Which features may exist.
    pub features: u64,
    /// Which of the misfortunes drawn happen.
    pub events: u8,
}

impl From<u64> for Seed {
    fn from(number: u64) -> Self {
        Self {
            number,
            features: u64::MAX,
            events: u8::MAX,
        }
    }
}

/// As it is written in the corpus, and on the command line: `number`, or `number:features:events`.
impl fmt::Display for Seed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            number,
            features,
            events,
        } = self;
        if *self == Self::from(*number) {
            return write!(f, "{number}");
        }
        write!(f, "{number}:{features:x}:{events:x}")
    }
}

impl FromStr for Seed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(':');
        let mut read = || -> Option<Self> {
            let mut seed = Self::from(parts.next()?.parse::<u64>().ok()?);
            if let Some(features) = parts.next() {
                seed.features = u64::from_str_radix(features, 16).ok()?;
                seed.events = u8::from_str_radix(parts.next()?, 16).ok()?;
            }
            parts.next().is_none().then_some(seed)
        };
        read().ok_or_else(|| {
            format!(
                "\"{text}\" is no seed; write a number, as in 4711, or number:features:events, as in 4711:3ff:5"
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
            features: 0x3FF,
            events: 5,
        };
        for (seed, text) in [(Seed::from(4711), "4711"), (small, "4711:3ff:5")] {
            assert_eq!(seed.to_string(), text);
            assert_eq!(text.parse(), Ok(seed));
        }
        for wrong in ["", "x", "1:2", "1:2:3:4", "-1"] {
            assert!(wrong.parse::<Seed>().is_err(), "{wrong}");
        }
    }
}
