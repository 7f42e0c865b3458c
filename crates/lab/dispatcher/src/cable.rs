//! Connections as clients request them, such as `I1:PUMP:Q2`.

use std::fmt;

use tickbus_base::Mistake;

use crate::channel::{Channel, Counts};
use crate::grammar::Joints;

/// A connection between a channel of a client and one of another client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cable {
    /// The channel of the client itself.
    pub own: Channel,
    /// The other client: its name, or `P1` for the first process and `R1` for the first controller.
    pub peer: String,
    /// The channel of the other client.
    pub channel: Channel,
}

impl Cable {
    /// Reads a connection such as `I1:PUMP:Q2`.
    ///
    /// # Errors
    ///
    /// The text is no connection, or its channels do not fit together.
    pub fn parse(text: &str) -> Result<Self, Mistake> {
        const RIGHT: &str =
            "write an own channel, another client and its channel, such as I1:PUMP:Q2";
        let mut joints = Joints::of(text.as_bytes());
        let cable = match (joints.next(), joints.next()) {
            (Some(Ok(joint)), None) => Self {
                own: joint.own,
                peer: joint.peer.to_owned(),
                channel: joint.channel,
            },
            (Some(Err(refusal)), _) => return Err(Mistake::new(refusal.text, RIGHT)),
            _ => {
                return Err(Mistake::new(
                    format!("\"{text}\" is not one connection"),
                    RIGHT,
                ));
            }
        };
        let (own, channel) = (cable.own.kind, cable.channel.kind);
        if own.is_output() == channel.is_output() || own.is_analog() != channel.is_analog() {
            return Err(Mistake::new(
                format!("{} and {} cannot be connected", cable.own, cable.channel),
                "connect an output with an input, digital or analog both",
            ));
        }
        Ok(cable)
    }

    /// Checks that a client with these channels has the own one.
    ///
    /// # Errors
    ///
    /// The client has no such channel.
    pub fn check(&self, counts: Counts) -> Result<(), Mistake> {
        if counts.has_from_1(self.own) {
            return Ok(());
        }
        let letters = self.own.kind.letters();
        Err(Mistake::new(
            format!(
                "this client has no {}, which it connects by {self}",
                self.own
            ),
            match counts.of(self.own.kind) {
                0 => format!("it has no {letters} at all; remove this connection"),
                count => format!("it has {letters}1 to {letters}{count}"),
            },
        ))
    }
}

impl fmt::Display for Cable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.own, self.peer, self.channel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cables_are_read_and_shown() {
        for (text, shown) in [
            ("I1:PUMP:Q2", "I1:PUMP:Q2"),
            ("q1 :P2: i04", "Q1:P2:I4"),
            ("AQ2:a-b.c:AI1", "AQ2:a-b.c:AI1"),
        ] {
            assert_eq!(Cable::parse(text).expect(text).to_string(), shown);
        }
        for (text, part) in [
            ("", "is not one connection"),
            ("I1:PUMP:Q2 I2:PUMP:Q1", "is not one connection"),
            ("I1", "stands where : as in I1:NAME:Q2 was expected"),
            ("I1:PU+MP:Q2", "cannot be the name of a client"),
            ("I1:PUMP:X2", "\"X2\" is no channel"),
            (
                "I1:PUMP:I2",
                "I1 and I2 cannot be connected; connect an output",
            ),
            ("AI1:PUMP:Q2", "AI1 and Q2 cannot be connected"),
        ] {
            let mistake = Cable::parse(text).expect_err(text).to_string();
            assert!(mistake.contains(part), "{mistake}");
        }
    }

    #[test]
    fn a_cable_ends_in_a_channel_that_is_there() {
        let counts = Counts::new(2, 0, 1, 0);
        for (text, part) in [
            (
                "Q3:A:I1",
                "no Q3, which it connects by Q3:A:I1; it has Q1 to Q2",
            ),
            ("I1:A:Q1", "it has no I at all"),
            ("AQ0:A:AI1", "it has AQ1 to AQ1"),
        ] {
            let cable = Cable::parse(text).expect(text);
            let mistake = cable.check(counts).expect_err(text).to_string();
            assert!(mistake.contains(part), "{mistake}");
        }
        assert_eq!(
            Cable::parse("AQ1:A:AI0").expect("one").check(counts),
            Ok(())
        );
    }
}
