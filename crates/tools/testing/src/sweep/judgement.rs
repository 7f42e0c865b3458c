//! Verdicts: how a program copes with a fault.

use std::fmt;
use std::hash::Hasher as _;

use siphasher::sip::SipHasher24;
use tickbus_base::time::Nanos;

/// How a program copes with a fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// The program told it, this long after the fault.
    Told(Nanos),
    /// The progress is that of the run without a fault, and at the end this much later.
    Right(Nanos),
    /// The progress is another one: what differed first.
    Different(String),
    /// The progress ended: what did not come any more.
    Still(String),
    /// Something held that never may: what, and when.
    Never(String),
}

impl Judgement {
    /// The words of all verdicts, as `accepted.toml` has them.
    pub const WORDS: [&'static str; 5] = ["told", "right", "differs", "still", "never"];

    /// The verdict in one word.
    pub fn word(&self) -> &'static str {
        let [told, right, differs, still, never] = Self::WORDS;
        match self {
            Self::Told(_) => told,
            Self::Right(_) => right,
            Self::Different(_) => differs,
            Self::Still(_) => still,
            Self::Never(_) => never,
        }
    }

    /// True for a verdict that needs no acceptance.
    pub const fn is_right(&self) -> bool {
        matches!(self, Self::Told(_) | Self::Right(_))
    }
}

impl fmt::Display for Judgement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Told(after) => write!(f, "told after {after}"),
            Self::Right(Nanos::ZERO) => f.write_str("continues as without the fault"),
            Self::Right(late) => write!(f, "continues as without the fault, {late} later"),
            Self::Different(what) => write!(f, "continues differently: {what}"),
            Self::Still(what) => write!(f, "stands still: {what}"),
            Self::Never(what) => write!(f, "breaks a \"never\": {what}"),
        }
    }
}

/// The hash over verdicts, in the order of the list of runs: equal for sweeps that are equal to the last word.
pub fn verdict_hash<'j>(verdicts: impl IntoIterator<Item = (&'j str, &'j Judgement)>) -> u64 {
    let mut hash = SipHasher24::new();
    for (name, judgement) in verdicts {
        for text in [name, &judgement.to_string()] {
            hash.write(text.as_bytes());
            hash.write(&[0]);
        }
    }
    hash.finish()
}
