//! The events of a station, in words.

use std::fmt;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::AlarmKind;

use crate::acyclic::Refusal;

/// An event of a station, for the state of the line and the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A master has sent the right parameters, and owns the station from now on.
    Parameterised {
        /// The master's address.
        master: u8,
    },
    /// The configuration is right: the station exchanges data from now on.
    Exchanges {
        /// The master's address.
        master: u8,
    },
    /// The master no longer sets the outputs: it is in CLEAR.
    Cleared,
    /// The master sets the outputs again.
    Operates,
    /// A master's request for a record was refused.
    RecordRefused {
        /// The master's address.
        master: u8,
        /// The request was to write.
        writes: bool,
        /// The slot.
        slot: u8,
        /// The index.
        index: u8,
        /// Why.
        why: Refusal,
    },
    /// An alarm was not sent, because the parameters of the master do not enable its type, or the device does not have
    /// it.
    AlarmDropped {
        /// The type.
        kind: AlarmKind,
        /// The slot.
        slot: u8,
    },
    /// The station no longer exchanges data, or never did: why.
    Left(Leaving),
}

/// Why a station no longer exchanges data, or never did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Leaving {
    /// The master sent other parameters than those of this device.
    Parameters {
        /// The master's address.
        master: u8,
        /// The expected and the received parameters.
        why: String,
    },
    /// The master expects other modules.
    Configuration {
        /// The master's address.
        master: u8,
        /// The expected and the received modules.
        why: String,
    },
    /// The master sent another number of outputs than the configuration has.
    Length {
        /// The expected number.
        expected: usize,
        /// The received number.
        received: usize,
    },
    /// The master has been silent for longer than the watchdog time that it had set.
    Watchdog(Nanos),
    /// The master released the station.
    Released {
        /// The master's address.
        master: u8,
    },
}

impl fmt::Display for Leaving {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parameters { master, why } => write!(
                f,
                "master {master} sent wrong parameters: {why}; take the same GSD in both projects"
            ),
            Self::Configuration { master, why } => write!(
                f,
                "master {master} sent another configuration: {why}; give both projects the same modules"
            ),
            Self::Length {
                expected,
                received: 0,
            } => write!(
                f,
                "the master sent no outputs, expected {expected} bytes; if it is in CLEAR, it takes this for a device with \
                 Fail_Safe: name that device's GSD file with \"gsd\""
            ),
            Self::Length { expected, received } => write!(
                f,
                "the master sent {received} bytes of outputs, expected {expected}; give both projects the same modules"
            ),
            Self::Watchdog(time) => write!(
                f,
                "the master has been silent for longer than {time}, the watchdog's time in its project"
            ),
            Self::Released { master } => write!(f, "master {master} released the station"),
        }
    }
}
