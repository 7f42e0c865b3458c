//! The faults of a machine's model, by their names.

use tickbus_base::Mistake;
use tickbus_fieldbus::faults::FaultBoard;

use super::plant::Plant;

/// The faults that the machine of a test or of a sweep can have.
#[derive(Clone, Copy)]
pub(super) enum ModelFaults<'a> {
    /// The machine has no faults of its own.
    None,
    /// Variables of an FMU.
    Fmu(&'a Plant),
    /// Those that a machine in another language has declared to its driver.
    Declared(&'a FaultBoard),
}

impl ModelFaults<'_> {
    /// The names of all faults.
    pub(super) fn names(self) -> Vec<String> {
        match self {
            Self::None => Vec::new(),
            Self::Fmu(plant) => plant.fault_names(),
            Self::Declared(board) => board.model_faults().to_vec(),
        }
    }

    /// The names of the faults that the value 1 switches on: those of an FMU that are on or off, or all that were
    /// declared.
    pub(super) fn switches(self) -> Vec<String> {
        match self {
            Self::Fmu(plant) => plant.switches(),
            other => other.names(),
        }
    }

    /// Checks a fault of the kind "model".
    ///
    /// # Errors
    ///
    /// The machine has no such fault.
    pub(super) fn check(self, name: &str, value: f64) -> Result<(), Mistake> {
        match self {
            Self::None => Err(Mistake::new(
                "this machine has no faults of its own",
                "name an FMU that has them, or let a rule of the machine do what the fault does",
            )),
            Self::Fmu(plant) => plant.check_fault(name, value),
            Self::Declared(board) => board.check_model_fault(name),
        }
    }

    /// How a machine without faults of its own gets some.
    pub(super) fn how_to_have(self) -> &'static str {
        match self {
            Self::Declared(_) => {
                "the machine has declared no faults: remove it, or let the machine name them before its first tick"
            }
            Self::None | Self::Fmu(_) => {
                "the machine has no faults of its own: remove it, or name an FMU that has some"
            }
        }
    }
}
