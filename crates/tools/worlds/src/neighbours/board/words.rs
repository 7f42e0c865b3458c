//! The lines of the board's clients, as the model and as the dispatcher read them.

use std::fmt::Write as _;

use crate::random::Random;

/// The names that clients take. The last one looks like a reference to the first process.
pub(super) const NAMES: [&str; 4] = ["A", "B", "C", "P1"];

/// The channels that clients have, or believe they have.
pub(super) const CHANNELS: [&str; 8] = ["Q1", "Q2", "I1", "I2", "AQ0", "AQ1", "AI0", "AI1"];

/// The shapes of clients: the numbers of Q, I, AQ and AI that a client states, and its channels.
pub(super) const SHAPES: [([u8; 4], &[usize]); 4] = [
    ([2, 1, 0, 0], &[0, 1, 2]),
    ([1, 2, 1, 1], &[0, 2, 3, 4, 5, 6, 7]),
    ([0, 2, 0, 0], &[2, 3]),
    ([2, 0, 1, 0], &[0, 1, 4, 5]),
];

/// One channel of one client, by their numbers.
pub(super) type Pin = (usize, usize);

pub(super) fn is_input(channel: usize) -> bool {
    CHANNELS[channel].contains('I')
}

pub(super) fn is_analog(channel: usize) -> bool {
    CHANNELS[channel].starts_with('A')
}

/// The reference of a client to another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Peer {
    Name(usize),
    /// The nth controller or process.
    Nth {
        is_controller: bool,
        number: usize,
    },
}

/// The identity that a client states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    pub(super) is_controller: bool,
    pub(super) name: usize,
    pub(super) shape: usize,
    pub(super) version: u8,
    /// The promised time between two signs of life, in milliseconds.
    pub(super) alive: Option<i64>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Request {
    Identify(Identity),
    Values(Vec<(usize, u64)>),
    /// Own channel, peer, and its channel.
    Connect(Vec<(usize, Peer, usize)>),
    Disconnect(Vec<usize>),
    List,
    Ping,
    Nothing,
    Bye,
    /// A line outside the grammar.
    Wrong,
    /// A line with the right keyword and values outside the grammar.
    WrongValues,
}

impl Request {
    /// The line, with its end. A `sloppy` line is written differently and means the same.
    pub(super) fn line(&self, random: &mut Random, sloppy: bool) -> Vec<u8> {
        let mut line = String::new();
        match self {
            Self::Identify(identity) => {
                line.push_str(if identity.is_controller { "VR" } else { "VP" });
                let [q, i, aq, ai] = SHAPES[identity.shape].0;
                let name = NAMES[identity.name];
                let _ = write!(line, " {name} Q{q:02} I{i:02} AQ{aq:02} AI{ai:02}");
                if identity.version > 1 {
                    let _ = write!(line, " V={}", identity.version);
                }
                if let Some(alive) = identity.alive {
                    let _ = write!(line, " ALIVE={alive}ms");
                }
            }
            Self::Values(items) => {
                line.push('P');
                for (channel, value) in items {
                    let _ = write!(line, " {}=", CHANNELS[*channel]);
                    match random.below(if sloppy { 4 } else { 1 }) {
                        1 => _ = write!(line, "0{value}.0"),
                        2 => _ = write!(line, " +{value}"),
                        3 => _ = write!(line, "{value}."),
                        _ => _ = write!(line, "{value}"),
                    }
                }
            }
            Self::Connect(joints) => {
                line.push_str("CONNECT");
                for (own, peer, channel) in joints {
                    let peer = match peer {
                        Peer::Name(name) => NAMES[*name].to_owned(),
                        Peer::Nth {
                            is_controller,
                            number,
                        } => format!("{}{number}", if *is_controller { 'R' } else { 'P' }),
                    };
                    let (own, channel) = (CHANNELS[*own], CHANNELS[*channel]);
                    let _ = write!(line, " {own}:{peer}:{channel}");
                }
            }
            Self::Disconnect(channels) => {
                line.push_str("DISCONNECT");
                for channel in channels {
                    let _ = write!(line, " {}", CHANNELS[*channel]);
                }
            }
            Self::List => line.push_str("LIST"),
            Self::Ping => line.push_str("PING"),
            Self::Nothing => {}
            Self::Bye => line.push_str("BYE"),
            Self::Wrong => {
                line.push_str(random.of(&["HELLO", "CONNECT", "PING PING", "=", "VR A Q1 Q1"]));
            }
            Self::WrongValues => line.push_str(random.of(&["P Q1=x", "P Q1", "P 1=Q1"])),
        }
        if sloppy && !matches!(self, Self::Identify(_) | Self::Connect(_)) {
            line = line.to_lowercase();
            if random.once_in(2) {
                line = line.replace(' ', " \t ");
            }
        }
        line.push_str(if random.once_in(2) { "\r\n" } else { "\n" });
        line.into_bytes()
    }
}
