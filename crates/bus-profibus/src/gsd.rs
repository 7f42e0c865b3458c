//! GSD files: which device a station is, by its maker.
//!
//! The reader is our own: crate `gsd-parser` 0.6 panics on a file that refers to a parameter which it does not define,
//! refuses 34 of 583 files of a maker's catalogue, which this one reads, and puts wrong bits beside a `BitArea`.
//!
//! Keywords that say nothing to a slave are skipped, and so are the keywords of safety modules (`F_…`).

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

use crate::user_parameters::ParameterBlock;

/// What a GSD file says that a station needs.
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
    /// The number of its kind.
    pub ident: u16,
    /// The rates that it supports, in bits per second, each with the longest wait before its answer, in bits.
    pub rates: BTreeMap<u32, u16>,
    /// Its modules, in the order of the file.
    pub modules: Vec<Module>,
    /// The slots that take certain modules alone.
    pub slots: Vec<Slot>,
    /// Whether its modules are chosen, and not fixed.
    pub modular: bool,
    /// The most modules.
    pub max_module: Option<usize>,
    /// The most bytes that a modular device sends.
    pub max_inputs: Option<usize>,
    /// The most bytes that a modular device receives.
    pub max_outputs: Option<usize>,
    /// The most bytes of both.
    pub max_data: Option<usize>,
    /// The most octets of the user's parameters, for the device with its modules.
    pub max_parameters: Option<usize>,
    /// The most octets of a diagnosis.
    pub max_diagnosis: Option<usize>,
    /// The shortest time between two exchanges, in units of 100 µs.
    pub min_slave_interval: Option<u16>,
    /// Whether it supports SYNC.
    pub sync: bool,
    /// Whether it supports FREEZE.
    pub freeze: bool,
    /// Whether it takes telegrams without outputs in CLEAR.
    pub fail_safe: bool,
    /// Whether its address can be set over the line.
    pub set_slave_add: bool,
    /// Whether it has the parameter octets of DPV1.
    pub dpv1: bool,
    /// The parameters of the device itself.
    pub parameters: Arc<ParameterBlock>,
    /// What the device-related diagnosis means.
    pub diagnosis: DiagnosisTexts,
}

/// A module that a device can have.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Module {
    /// Its name.
    pub name: String,
    /// Its identifiers, with the octets of the vendor's.
    pub identifiers: Vec<u8>,
    /// The number by which slots refer to it.
    pub reference: Option<u32>,
    /// Its parameters.
    pub parameters: Arc<ParameterBlock>,
}

/// A slot, and the modules that fit there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// From 1.
    pub number: u32,
    /// Its name.
    pub name: String,
    /// The number of the module that it has unless somebody chooses another one.
    pub default: u32,
    /// The numbers of the modules that fit, as ranges.
    pub fitting: Vec<RangeInclusive<u32>>,
}

/// The texts of a device-related diagnosis; bit 0 is the lowest of the first octet behind its header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DiagnosisTexts {
    /// What single bits mean when they are 1.
    pub bits: BTreeMap<u32, String>,
    /// What numbers of several bits mean.
    pub areas: Vec<DiagnosisArea>,
}

/// Bits of a diagnosis that are a number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DiagnosisArea {
    /// The lowest bit.
    pub first: u32,
    /// The highest bit.
    pub last: u32,
    /// What its values mean.
    pub values: BTreeMap<u32, String>,
}

/// A mistake in a GSD file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {mistake}")]
pub struct GsdError {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong, and what would be right.
    pub mistake: Mistake,
}
