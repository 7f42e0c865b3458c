//! PROFIBUS DP over a serial line: DP-V0 and DP-V1 slaves in software.
//!
//! The core knows no port and no image. [`telegram`] reads and writes telegrams. A [`Station`] is one slave, a function
//! of its state, the time and a request, to an answer. A [`Segment`] has all stations of a line, and finds the
//! telegrams among the bytes. An observer takes what a master and its stations exchange off the line, and sends
//! nothing. A [`Gsd`] is a manufacturer's description of a device.

mod acyclic;
pub mod advice;
mod configuration;
mod device;
mod drive;
mod event;
mod examine;
mod finder;
mod gsd;
mod layout;
pub mod monitor;
mod observer;
mod options;
mod parameters;
mod rates;
mod records;
mod segment;
mod station;
pub mod telegram;
mod user_parameters;

pub use acyclic::{
    Acyclic, Alarm, AlarmSupport, Format, Nameplate, Parameter as DriveParameter, Record, Refusal,
};
pub use configuration::{Configuration, SlotModule};
pub use device::{LineOptions, ProfibusDevice};
pub use event::{Event, Leaving};
pub use gsd::{DiagnosisArea, DiagnosisTexts, Gsd, GsdError, Module, Slot};
pub use options::{Device, Options, StationOptions};
pub use segment::{Heard, Segment, Taken};
pub use station::{Diagnosed, Identity, Process, State, Station};
pub use tickbus_fieldbus::faults::AlarmKind;
pub use user_parameters::{Allowed, Parameter, ParameterBlock, ParameterKind, UserParameters};
