//! Channels: the inputs and outputs of a client.

use std::fmt;

/// The kind of a channel, as its client sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// `Q`: a digital output.
    DigitalOutput,
    /// `I`: a digital input.
    DigitalInput,
    /// `AQ`: an analog output.
    AnalogOutput,
    /// `AI`: an analog input.
    AnalogInput,
}

impl Kind {
    /// All kinds, in the order of a device line.
    pub const ALL: [Self; 4] = [
        Self::DigitalOutput,
        Self::DigitalInput,
        Self::AnalogOutput,
        Self::AnalogInput,
    ];

    /// The letters in a channel's name.
    pub const fn letters(self) -> &'static str {
        match self {
            Self::DigitalOutput => "Q",
            Self::DigitalInput => "I",
            Self::AnalogOutput => "AQ",
            Self::AnalogInput => "AI",
        }
    }

    /// True if the client sends values through the channel.
    pub const fn is_output(self) -> bool {
        matches!(self, Self::DigitalOutput | Self::AnalogOutput)
    }

    /// True for analog channels, which carry more than on and off.
    pub const fn is_analog(self) -> bool {
        matches!(self, Self::AnalogOutput | Self::AnalogInput)
    }

    /// Splits a word into the kind at its beginning, in any case, and the digits behind it.
    fn split(word: &[u8]) -> Option<(Self, &[u8])> {
        let (is_analog, rest) = match word {
            [b'A' | b'a', rest @ ..] => (true, rest),
            _ => (false, word),
        };
        let (kind, digits) = match (rest, is_analog) {
            ([b'Q' | b'q', digits @ ..], false) => (Self::DigitalOutput, digits),
            ([b'I' | b'i', digits @ ..], false) => (Self::DigitalInput, digits),
            ([b'Q' | b'q', digits @ ..], true) => (Self::AnalogOutput, digits),
            ([b'I' | b'i', digits @ ..], true) => (Self::AnalogInput, digits),
            _ => return None,
        };
        Some((kind, digits))
    }

    /// Reads a kind with a number behind it, such as `AQ02`.
    pub(crate) fn with_number(word: &[u8]) -> Option<(Self, u16)> {
        let (kind, digits) = Self::split(word)?;
        if digits.is_empty() {
            return None;
        }
        let mut number = 0_u16;
        for digit in digits {
            if !digit.is_ascii_digit() {
                return None;
            }
            // A number too large for a channel stays too large.
            number = number
                .saturating_mul(10)
                .saturating_add(u16::from(digit - b'0'));
        }
        Some((kind, number))
    }
}

/// A channel of a client, such as `AQ2`, by the number that the client itself uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Channel {
    /// The kind.
    pub kind: Kind,
    /// The number: from 1, or from 0 for analog channels.
    pub number: u16,
}

impl Channel {
    /// Reads a channel such as `Q1`, in any case.
    pub fn parse(word: &[u8]) -> Option<Self> {
        let (kind, number) = Kind::with_number(word)?;
        Some(Self { kind, number })
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.kind.letters(), self.number)
    }
}

/// The most channels of one kind that a client may have.
pub const MOST_CHANNELS: u16 = 256;

/// How many channels of each kind a client has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts([u16; 4]);

impl Counts {
    /// These counts, each from 0 to 256: of Q, I, AQ and AI.
    pub const fn new(q: u16, i: u16, aq: u16, ai: u16) -> Self {
        Self([q, i, aq, ai])
    }

    /// The number of channels of `kind`.
    pub const fn of(self, kind: Kind) -> u16 {
        self.0[kind as usize]
    }

    pub(crate) const fn set(&mut self, kind: Kind, count: u16) {
        self.0[kind as usize] = count;
    }

    /// True if a client that counts from 1 has this channel.
    pub const fn has_from_1(self, channel: Channel) -> bool {
        channel.number >= 1 && channel.number <= self.of(channel.kind)
    }

    /// The place of a channel among all outputs, or among all inputs, of its client; `None` if the client does not have
    /// it.
    ///
    /// Digital channels count from 1. Analog ones may be counted from 0 or from 1: the paper announces two and then
    /// uses AQ0 to AQ2. So both 0 and N have a place.
    #[inline]
    pub(crate) fn place(self, channel: Channel) -> Option<usize> {
        let count = self.of(channel.kind);
        let number = channel.number;
        let place = if channel.kind.is_analog() {
            let digital = if channel.kind.is_output() {
                Kind::DigitalOutput
            } else {
                Kind::DigitalInput
            };
            if count == 0 || number > count {
                return None;
            }
            self.of(digital) + number
        } else {
            if number == 0 || number > count {
                return None;
            }
            number - 1
        };
        Some(usize::from(place))
    }

    /// True if the client has this channel.
    pub fn has(self, channel: Channel) -> bool {
        self.place(channel).is_some()
    }

    /// Every channel that has a place among the outputs or the inputs, in the order of the places.
    pub(crate) fn channels(self, outputs: bool) -> impl Iterator<Item = Channel> {
        let kinds = Kind::ALL
            .into_iter()
            .filter(move |kind| kind.is_output() == outputs);
        kinds.flat_map(move |kind| {
            let count = self.of(kind);
            let first = u16::from(!kind.is_analog() || count == 0);
            (first..=count).map(move |number| Channel { kind, number })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_has_its_own_place() {
        for counts in [
            Counts::new(8, 8, 2, 3),
            Counts::new(0, 1, 1, 0),
            Counts::new(256, 0, 0, 256),
            Counts::default(),
        ] {
            for outputs in [true, false] {
                for (place, channel) in counts.channels(outputs).enumerate() {
                    assert_eq!(counts.place(channel), Some(place), "{channel}");
                }
            }
        }
        let counts = Counts::new(8, 8, 2, 0);
        for text in ["Q0", "Q9", "I9", "AQ3", "AI0", "AI1", "Q99999999999"] {
            let channel = Channel::parse(text.as_bytes()).expect(text);
            assert_eq!(counts.place(channel), None, "{text}");
        }
    }

    #[test]
    fn channels_are_read_in_any_case() {
        for (text, shown) in [
            ("q1", "Q1"),
            ("Ai03", "AI3"),
            ("aQ0", "AQ0"),
            ("I256", "I256"),
        ] {
            assert_eq!(
                Channel::parse(text.as_bytes()).expect(text).to_string(),
                shown
            );
        }
        for text in ["", "Q", "A1", "AQ", "X1", "1Q", "Q-1", "Q1a", "AAQ1", "QI1"] {
            assert_eq!(Channel::parse(text.as_bytes()), None, "{text}");
        }
    }
}
