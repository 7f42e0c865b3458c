//! A channel's information about itself.

use std::fmt;

/// The size of the driver's packed struct: two names of 16 characters, two 32-bit numbers, four of 16 bits, the
/// length and the 63 characters of the firmware's name, its date in four octets, and twelve 32-bit numbers.
pub(super) const INFORMATION: usize = 2 * 16 + 2 * 4 + 4 * 2 + 64 + 4 + 12 * 4;

/// Names of the state flags.
const FLAGS: [(u32, &str); 7] = [
    (0x01, "ready"),
    (0x02, "run"),
    (0x04, "bus on"),
    (0x08, "configuration locked"),
    (0x10, "new configuration"),
    (0x20, "restart required"),
    (0x80, "DMA"),
];

/// A channel's information about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Information {
    board: String,
    serial: u32,
    firmware: String,
    version: [u16; 4],
    flags: u32,
}

impl Information {
    pub(super) fn parse(bytes: &[u8; INFORMATION]) -> Self {
        let u32_at = |at: usize| {
            let octets = bytes[at..at + 4].try_into().expect("four octets");
            // The driver's library uses the byte order of this computer.
            u32::from_ne_bytes(octets)
        };
        let u16_at = |at: usize| u16::from_ne_bytes([bytes[at], bytes[at + 1]]);
        let length = usize::from(bytes[48]).min(63);
        Self {
            board: text(&bytes[..16]),
            serial: u32_at(36),
            firmware: text(&bytes[49..49 + length]),
            version: [40, 42, 44, 46].map(u16_at),
            flags: u32_at(INFORMATION - 4),
        }
    }

    /// The names of the flags that are set.
    pub(super) fn state(&self) -> String {
        let set = FLAGS.iter().filter(|(bit, _)| self.flags & bit != 0);
        let names: Vec<&str> = set.map(|(_, name)| *name).collect();
        names.join(", ")
    }
}

impl fmt::Display for Information {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [major, minor, build, revision] = self.version;
        write!(
            f,
            "{}, serial number {}, firmware {} {major}.{minor}.{build}.{revision}",
            self.board, self.serial, self.firmware
        )
    }
}

/// Characters up to the first NUL.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0);
    String::from_utf8_lossy(&bytes[..end.unwrap_or(bytes.len())]).into_owned()
}
