//! Requests and refusals in octets.

use std::fmt;

/// The numbers of the services.
pub(super) mod function {
    pub(in super::super) const IDLE: u8 = 0x48;
    pub(in super::super) const DATA_TRANSPORT: u8 = 0x51;
    pub(in super::super) const RESOURCE_MANAGER: u8 = 0x56;
    pub(in super::super) const INITIATE: u8 = 0x57;
    pub(in super::super) const ABORT: u8 = 0x58;
    pub(in super::super) const ALARM_ACK: u8 = 0x5C;
    pub(in super::super) const READ: u8 = 0x5E;
    pub(in super::super) const WRITE: u8 = 0x5F;
    /// In an answer: the service is refused.
    pub(in super::super) const REFUSED: u8 = 0x80;
}

/// `Error_Decode`: the codes are those of DP-V1.
const DPV1: u8 = 128;

/// Why a request is refused: `Error_Code_1` of the standard, whose high digit is the class.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Refusal {
    /// The device does not have the service.
    NotSupported = 0xA9,
    /// The slot has no such record.
    Index = 0xB0,
    /// The record has another length.
    Length = 0xB1,
    /// The device has no such slot.
    Slot = 0xB2,
    /// The request does not have the form of its service.
    Form = 0xB3,
    /// The request needs another one before, or the alarm to be acknowledged does not exist.
    State = 0xB5,
    /// The record can only be read.
    Access = 0xB6,
    /// The request for parameters in record 47 is not well formed.
    Range = 0xB7,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Self::NotSupported => "the device does not have this service",
            Self::Index => "the slot has no such record",
            Self::Length => "the record has another length",
            Self::Slot => "the device has no such slot",
            Self::Form => "the request is not well formed",
            Self::State => "the record is read after a request that says what",
            Self::Access => "the record can only be read",
            Self::Range => "the request for parameters is not well formed",
        };
        write!(f, "{text} (error code {:02X})", *self as u8)
    }
}

/// Appends a refusal.
pub(super) fn refuse(function: u8, why: Refusal, answer: &mut Vec<u8>) {
    answer.extend([function | function::REFUSED, DPV1, why as u8, 0]);
}
