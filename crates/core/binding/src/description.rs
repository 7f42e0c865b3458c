//! The description of a signal for a simulator.

use tickbus_driver::{Driver, SlotMap};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{DataType, Slot};

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
    /// The signal's name.
    pub name: &'d str,
    /// The signal's address in IEC form.
    pub address: String,
    /// The signal's IEC data type.
    pub data_type: &'static str,
    /// The signal's unit; empty for none.
    pub unit: &'d str,
    /// The signal's station; empty if driver.cfg names none.
    pub station: &'d str,
    /// True if this end writes the signal.
    pub is_written: bool,
    /// The type of the slot's value.
    pub kind: SlotKind,
    /// The signal's slot.
    pub slot: usize,
    /// The slot that counts the signal's edges, if any.
    pub edges: Option<usize>,
    /// The signal's fail-safe value, which also replaces a value that is not a number.
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
        let (written, _) = config.role.areas();
        Self {
            name: &signal.name,
            address: signal.plc_address().to_string(),
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
