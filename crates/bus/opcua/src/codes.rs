//! The status codes that a fault can make a server answer with.

use tickbus_fieldbus::faults::AnswerCodes;

/// The bits of a status that is bad: all codes of errors have them.
const BAD: u32 = 0x8000_0000;

/// The codes of a server: any bad status by its number (OPC 10000-6, A.2), and those that a client's error handling is
/// likely to distinguish by their names.
pub(crate) const CODES: AnswerCodes = AnswerCodes {
    range: (BAD, u32::MAX),
    names: &[
        ("BadCommunicationError", 0x8005_0000),
        ("BadConfigurationError", 0x8089_0000),
        ("BadDeviceFailure", 0x808B_0000),
        ("BadInternalError", 0x8002_0000),
        ("BadNoCommunication", 0x8031_0000),
        ("BadNodeIdUnknown", 0x8034_0000),
        ("BadNotConnected", 0x808A_0000),
        ("BadNotReadable", 0x803A_0000),
        ("BadNotWritable", 0x803B_0000),
        ("BadOutOfMemory", 0x8003_0000),
        ("BadOutOfRange", 0x803C_0000),
        ("BadOutOfService", 0x808D_0000),
        ("BadResourceUnavailable", 0x8004_0000),
        ("BadSensorFailure", 0x808C_0000),
        ("BadServerHalted", 0x800E_0000),
        ("BadShutdown", 0x800C_0000),
        ("BadTimeout", 0x800A_0000),
        ("BadTooManyOperations", 0x8010_0000),
        ("BadUnexpectedError", 0x8001_0000),
        ("BadUserAccessDenied", 0x801F_0000),
        ("BadWaitingForInitialData", 0x8032_0000),
    ],
    wrong: &[],
    has_elements: false,
    has_pauses: false,
};

#[cfg(all(test, feature = "opcua"))]
mod tests {
    use super::CODES;
    use opcua::types::StatusCode;

    #[test]
    fn names_are_those_of_the_standard() {
        for (name, code) in CODES.names {
            assert_eq!(StatusCode::from(*code).to_string(), *name);
        }
    }
}
