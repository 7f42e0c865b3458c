//! The error codes of the DDI, by their low parts: on Windows NT and later they have a base added.

use tickbus_fieldbus::Verdict::{Broken, Refused};
use tickbus_fieldbus::{Failing, Meaning};

/// The base that Windows adds to each code.
const BASE: u32 = 0xE007_0000;

/// There is no message in the mailbox.
pub(crate) const NO_MESSAGE: u32 = 0x9B;

const SIZES: &str = "the signals reach beyond the board's process data; check their addresses, `write_offset` and `read_offset`";

/// All codes that tickbus knows.
#[rustfmt::skip]
pub const ERRORS: &[Meaning] = &[
    Meaning::new(0x80, "board number", Refused, "the driver does not have a board of this number; check `device`, and the number that is set on the board"),
    Meaning::new(0x85, "handle", Broken, Meaning::REPORT),
    Meaning::new(0x86, "state", Broken, "the driver is in another state than its order of calls says; see whether another program uses the board"),
    Meaning::new(0x87, "node not ready", Broken, "the board is not ready; it starts, or has an error that its diagnosis tells"),
    Meaning::new(0x88, "DTI and MXI mixed", Broken, Meaning::REPORT),
    Meaning::new(0x89, "device not ready", Broken, "the board is not ready; it starts, or has an error that its diagnosis tells"),
    Meaning::new(0x8A, "permission", Broken, "another program has the board for itself; end it"),
    Meaning::new(0x8D, "parameter", Broken, Meaning::REPORT),
    Meaning::new(0x90, "node absent", Refused, "the board does not have this node; check `device`"),
    Meaning::new(0x91, "device name", Refused, "the driver does not know a device of this name; check `device`: a board is \"IBB1N1\", one on Ethernet \"IBETH01N1\""),
    Meaning::new(0x92, "no handles", Broken, "the driver has no handle left; end programs that use it"),
    Meaning::new(0x95, "range", Refused, SIZES),
    Meaning::new(0x96, "area exceeded", Refused, SIZES),
    Meaning::new(0x97, "consistency", Refused, "the driver does not have this consistency; let offsets and sizes of the process data be even"),
    Meaning::new(0x98, "data area absent", Refused, "the node has no process data; check `device`"),
    Meaning::new(0x99, "multi-port memory unavailable", Broken, "the board's memory cannot be reached; see whether the board was removed, and its addresses in the driver's set-up"),
    Meaning::new(0x9A, "message too long", Broken, Meaning::REPORT),
    Meaning::new(0x9B, "no message", Broken, "the board did not answer in time; see whether it was reset"),
    Meaning::new(0x9C, "no mailbox", Refused, "the node has no mailbox; check `device`"),
    Meaning::new(0xA2, "system failure", Broken, "the board reports a system failure; switch it off and on, and see its diagnosis"),
    Meaning::new(0xD2, "board absent", Broken, "the board is not there; check `device`, and that the vendor's tools see it"),
    Meaning::new(0xE8, "data timeout", Broken, "the board's data did not come in time; check the network, if it is one on Ethernet"),
    Meaning::new(0xED, "bus stop", Broken, "the bus was stopped; see the board's diagnosis"),
    Meaning::new(0x800, "error of Windows", Broken, "the system refused it; see its event log, and the driver's installation"),
];

/// The low part of a code.
pub(crate) fn low(code: u32) -> u32 {
    if code & 0xFFFF_0000 == BASE {
        code & 0xFFFF
    } else {
        code
    }
}

/// `function` returned `code`.
pub(crate) fn failing(function: &str, code: u32) -> Failing {
    Failing::new(
        function,
        &format!("0x{code:X}"),
        Meaning::of(ERRORS, low(code)),
    )
}
