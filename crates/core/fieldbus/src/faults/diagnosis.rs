//! The reports of a device to its master, on buses that have a diagnosis.

use std::fmt;

/// The maximum number of device-specific octets.
pub(super) const OCTET_LIMIT: usize = 32;

/// One report of a station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// The station, by its index in the signal table.
    pub station: usize,
    /// The problem that the station reports.
    pub finding: Finding,
    /// True if the station cannot exchange data properly until the problem is over: the master continues to read the
    /// diagnosis.
    pub is_static: bool,
}

/// A problem of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// Device-specific octets, as in the device's manual.
    Device(Octets),
    /// A problem of the module in this slot, from 1.
    Module(u8),
    /// A problem of a channel of the module in a slot. Slots count from 1, channels from 0.
    Channel {
        /// The slot.
        slot: u8,
        /// The channel.
        channel: u8,
        /// The problem of the channel.
        error: ChannelError,
    },
    /// An alarm, which the master acknowledges.
    Alarm {
        /// The type.
        kind: AlarmKind,
        /// The slot; 0 is the device itself.
        slot: u8,
        /// The device's own octets, if there are any.
        octets: Option<Octets>,
    },
}

/// A type of alarm; the numbers are those of PROFIBUS DP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "their names say it")]
pub enum AlarmKind {
    Diagnosis = 1,
    Process = 2,
    Pull = 3,
    Plug = 4,
    Status = 5,
    Update = 6,
}

impl AlarmKind {
    /// All types, with their names in a fault.
    pub(super) const ALL: [(&'static str, Self); 6] = [
        ("diagnosis", Self::Diagnosis),
        ("process", Self::Process),
        ("pull", Self::Pull),
        ("plug", Self::Plug),
        ("status", Self::Status),
        ("update", Self::Update),
    ];
}

impl fmt::Display for AlarmKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = Self::ALL.iter().find(|(_, other)| other == self);
        f.write_str(found.map_or("", |(name, _)| name))
    }
}

/// A few octets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Octets {
    all: [u8; OCTET_LIMIT],
    length: usize,
}

impl Octets {
    /// A value of these octets; `None` for no octets, or too many.
    pub fn new(octets: &[u8]) -> Option<Self> {
        let mut all = [0; OCTET_LIMIT];
        all.get_mut(..octets.len())?.copy_from_slice(octets);
        let length = octets.len();
        (length > 0).then_some(Self { all, length })
    }

    /// All octets.
    pub fn get(&self) -> &[u8] {
        &self.all[..self.length]
    }
}

/// A problem of a channel; the numbers are those of PROFIBUS DP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "their names say it")]
pub enum ChannelError {
    ShortCircuit = 1,
    Undervoltage = 2,
    Overvoltage = 3,
    Overload = 4,
    Overtemperature = 5,
    LineBreak = 6,
    UpperLimit = 7,
    LowerLimit = 8,
    Error = 9,
}

impl ChannelError {
    /// All channel errors, with their names in a fault.
    pub(super) const ALL: [(&'static str, Self); 9] = [
        ("short-circuit", Self::ShortCircuit),
        ("undervoltage", Self::Undervoltage),
        ("overvoltage", Self::Overvoltage),
        ("overload", Self::Overload),
        ("overtemperature", Self::Overtemperature),
        ("line-break", Self::LineBreak),
        ("upper-limit", Self::UpperLimit),
        ("lower-limit", Self::LowerLimit),
        ("error", Self::Error),
    ];
}

/// `line-break at channel 3 of slot 2`.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(octets) => {
                let octets = octets.get().iter().map(|octet| format!("{octet:02X}"));
                f.write_str(&octets.collect::<Vec<_>>().join(" "))
            }
            Self::Module(slot) => write!(f, "slot {slot}"),
            Self::Channel {
                slot,
                channel,
                error,
            } => {
                let all = ChannelError::ALL;
                let name = all.iter().find(|(_, other)| other == error);
                let name = name.map_or("error", |(name, _)| name);
                write!(f, "{name} at channel {channel} of slot {slot}")
            }
            Self::Alarm { kind, slot, .. } => write!(f, "{kind} alarm of slot {slot}"),
        }
    }
}
