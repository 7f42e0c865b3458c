//! Log messages that a peer can cause: every one is counted, and they are logged less and less often.

use std::collections::BTreeMap;
use std::fmt;

use tickbus_base::os::{is_rarely_logged, is_told};

/// The topic of a message: a line's state and cause, or its own name.
pub type Topic = (&'static str, &'static str);

/// How often each topic occurred.
#[derive(Debug, Default)]
pub struct Rarely {
    times: BTreeMap<Topic, u64>,
    untold: u64,
}

/// The number of a message within its topic, appended to the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times(u64);

impl Rarely {
    /// Counts a message; returns `None` if it is not to be logged.
    pub fn count(&mut self, topic: Topic) -> Option<Times> {
        let times = self.times.entry(topic).or_default();
        *times += 1;
        if is_told(*times) {
            return Some(Times(*times));
        }
        self.untold += 1;
        None
    }

    /// How many messages were not logged.
    pub fn untold(&self) -> u64 {
        self.untold
    }
}

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !is_rarely_logged(self.0) {
            return Ok(());
        }
        write!(
            f,
            " ({} times so far; told more rarely from now on)",
            self.0
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_topic_is_told_twenty_times_and_then_at_powers_of_two() {
        let mut rarely = Rarely::default();
        let mut told = Vec::new();
        for _ in 0..20_000 {
            told.extend(rarely.count(("opening", "left")).map(|times| times.0));
        }
        assert_eq!(told.len(), 30);
        assert_eq!(told[18..22], [19, 20, 32, 64]);
        assert_eq!(rarely.untold(), 20_000 - 30);
        assert_eq!(rarely.count(("opening", "protocol")), Some(Times(1)));
        assert_eq!(Times(19).to_string(), "");
        let last = Times(32).to_string();
        assert_eq!(last, " (32 times so far; told more rarely from now on)");
    }
}
