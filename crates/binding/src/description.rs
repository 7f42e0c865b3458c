//! Signals, as a simulator has to know them.

use tickbus_driver::{Driver, SlotMap};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, DataType, Slot};

/// How a slot holds its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum SlotKind {
    /// A double.
    Real = 0,
    /// A signed integer: an unscaled LINT.
    Signed = 1,
    /// An unsigned integer: an unscaled LWORD or ULINT.
    Unsigned = 2,
}

/// A signal.
#[derive(Clone, Debug)]
pub struct SignalDescription<'d> {
    /// Its name.
    pub name: &'d str,
    /// Its address in IEC form.
    pub address: String,
    /// Its IEC data type.
    pub data_type: &'static str,
    /// Its unit; empty for none.
    pub unit: &'d str,
    /// Its station; empty if driver.cfg names none.
    pub station: &'d str,
    /// Whether this end writes it.
    pub is_written: bool,
    /// What its slot holds.
    pub kind: SlotKind,
    /// Its slot.
    pub slot: usize,
    /// The slot in which its edges are counted.
    pub edges: Option<usize>,
    /// What its slot holds for a value that is not a number.
    pub fail_safe: Slot,
}

impl<'d> SignalDescription<'d> {
    /// The signal with this index.
    pub fn of(driver: &'d Driver, index: usize) -> Self {
        Self::in_config(driver.config(), driver.slots(), index)
    }

    /// The signal with this index of a driver that need not be open.
    pub fn in_config(config: &'d Config, slots: &SlotMap, index: usize) -> Self {
        let signal = &config.table.signals[index];
        let written = match config.role {
            Role::Device => Area::Input,
            Role::Controller => Area::Output,
        };
        Self {
            name: &signal.name,
            address: signal.address().to_string(),
            data_type: signal.data_type.name(),
            unit: signal.unit.as_deref().unwrap_or_default(),
            station: &config.table.stations[signal.station].name,
            is_written: signal.area == written,
            kind: match signal.data_type {
                _ if !signal.is_integer_slot() => SlotKind::Real,
                DataType::Lint => SlotKind::Signed,
                _ => SlotKind::Unsigned,
            },
            slot: index,
            edges: slots.edges[index],
            fail_safe: signal.fail_safe,
        }
    }
}
