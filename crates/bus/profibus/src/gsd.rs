//! GSD files: a manufacturer's description of a device.
//!
//! The reader is our own: crate `gsd-parser` 0.6 panics on a file that refers to an undefined parameter, refuses 34 of
//! 583 files of a maker's catalogue that this one reads, and misplaces the bits of a `BitArea`.
//!
//! The reader skips keywords that do not concern a slave, and the keywords of safety modules (`F_…`).

mod choose;
mod lines;
mod read;
#[cfg(test)]
mod tests;
pub(crate) mod write;

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use tickbus_base::Mistake;

use crate::acyclic::AlarmSupport;
use crate::user_parameters::ParameterBlock;

/// A station's description, from a GSD file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "the standard's own flags, independent of each other"
)]
pub struct Gsd {
    /// The maker.
    pub vendor: String,
    /// The device.
    pub model: String,
    /// The device's ident number.
    pub ident: u16,
    /// The supported rates, in bits per second, each with the longest wait before an answer, in bits.
    pub rates: BTreeMap<u32, u16>,
    /// The modules, in the order of the file.
    pub modules: Vec<Module>,
    /// The slots that accept only certain modules.
    pub slots: Vec<Slot>,
    /// True if the modules are chosen, and not fixed.
    pub modular: bool,
    /// The most modules.
    pub max_module: Option<usize>,
    /// The most bytes that a modular device sends.
    pub max_inputs: Option<usize>,
    /// The most bytes that a modular device receives.
    pub max_outputs: Option<usize>,
    /// The most bytes that a modular device sends and receives together.
    pub max_data: Option<usize>,
    /// The most octets of user parameters, for the device with its modules.
    pub max_parameters: Option<usize>,
    /// The most octets of a diagnosis.
    pub max_diagnosis: Option<usize>,
    /// The shortest time between two exchanges, in units of 100 µs.
    pub min_slave_interval: Option<u16>,
    /// True if the device supports SYNC.
    pub sync: bool,
    /// True if the device supports FREEZE.
    pub freeze: bool,
    /// True if the device accepts telegrams without outputs in CLEAR.
    pub fail_safe: bool,
    /// True if the device's address can be set over the line.
    pub set_slave_add: bool,
    /// True if the device has the parameter octets of DPV1.
    pub dpv1: bool,
    /// The order number.
    pub order: String,
    /// True if the master that owns the station can read and write records.
    pub c1_read_write: bool,
    /// The most octets of a record for that master.
    pub c1_max_data: u8,
    /// The alarms that the device can send.
    pub alarms: AlarmSupport,
    /// True if other masters can read and write records.
    pub c2_read_write: bool,
    /// The most octets of a record for other masters.
    pub c2_max_data: u8,
    /// The connections that other masters can have at a time; 0 if the file does not say.
    pub c2_channels: u8,
    /// The parameters of the device itself.
    pub parameters: Arc<ParameterBlock>,
    /// The meaning of the device-related diagnosis.
    pub diagnosis: DiagnosisTexts,
}

/// A module that a device can have.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Module {
    /// The name.
    pub name: String,
    /// The identifiers, including vendor-specific octets.
    pub identifiers: Vec<u8>,
    /// The number by which slots refer to it.
    pub reference: Option<u32>,
    /// The parameters.
    pub parameters: Arc<ParameterBlock>,
}

/// A slot, and the modules that fit there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The slot number, from 1.
    pub number: u32,
    /// The name.
    pub name: String,
    /// The number of the default module.
    pub default: u32,
    /// The numbers of the modules that fit, as ranges.
    pub fitting: Vec<RangeInclusive<u32>>,
}

/// The texts of a device-related diagnosis; bit 0 is the lowest of the first octet after its header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DiagnosisTexts {
    /// The meaning of single bits when they are 1.
    pub bits: BTreeMap<u32, String>,
    /// The meaning of numbers of several bits.
    pub areas: Vec<DiagnosisArea>,
}

/// Bits of a diagnosis that form a number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DiagnosisArea {
    /// The lowest bit.
    pub first: u32,
    /// The highest bit.
    pub last: u32,
    /// The meaning of the values.
    pub values: BTreeMap<u32, String>,
}

/// A mistake in a GSD file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {mistake}")]
pub struct GsdError {
    /// The line, from 1.
    pub line: usize,
    /// The mistake and its remedy.
    pub mistake: Mistake,
}
