//! Injected faults, as text.

use std::fmt::Write as _;

use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::{Fault, FaultBoard, FaultStatus, read_one};

use crate::refusal::Refusal;

/// Reads a fault as in driver.cfg: the keys of a `[[fault]]` table.
///
/// # Errors
///
/// `BAD_ARGUMENT` with every mistake in the text.
pub fn read_fault(text: &str, config: &Config) -> Result<Fault, Refusal> {
    read_one(text, config.fault_scope()).map_err(not_injected)
}

/// Injects a fault and returns its number.
///
/// # Errors
///
/// `BAD_ARGUMENT` if too many faults wait or are active, or the simulation's model has no fault of this name.
pub fn inject(driver: &mut Driver, fault: &Fault) -> Result<u32, Refusal> {
    driver.inject_read(fault).map_err(not_injected)
}

/// Takes the names of the faults that the simulation's model can have.
///
/// # Errors
///
/// `BAD_ARGUMENT` if a name is not usable, or a fault of the model has none of the names.
pub fn declare_model_faults(driver: &mut Driver, names: Vec<String>) -> Result<(), Refusal> {
    let refused = |why| Refusal::new(Code::BadArgument, format!("the model's faults: {why}"));
    driver.declare_model_faults(names).map_err(refused)
}

fn not_injected(why: impl std::fmt::Display) -> Refusal {
    let text = format!("the fault cannot be injected:\n{why}");
    Refusal::new(Code::BadArgument, text)
}

/// The injected faults, one per line: number, state, how often begun, kind, name, effect; separated by tabs.
pub fn faults(board: &FaultBoard) -> String {
    let mut text = String::new();
    for fault in board.list() {
        let FaultStatus {
            id,
            phase,
            begun,
            kind,
            name,
            what,
            ..
        } = fault;
        // Writing to a string cannot fail; names have no control characters.
        let _ = writeln!(
            text,
            "{id}\t{}\t{begun}\t{kind}\t{name}\t{what}",
            phase.name()
        );
    }
    text
}
