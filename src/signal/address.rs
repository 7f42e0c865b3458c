//! IEC 61131-3 addresses of the process image.

/// The two halves of a process image, named from the PLC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Area {
    /// `%I`: inputs of the PLC. The simulation writes them.
    Input,
    /// `%Q`: outputs of the PLC. The simulation reads them.
    Output,
}
