//! A station's answer to `Slave_Diag`.

use super::{State, Station};

/// The octets of the standard's part.
const STANDARD: usize = 6;

/// The room for extended diagnosis in a device with at most `most` octets in all.
pub(super) fn room(most: usize) -> usize {
    most.clamp(STANDARD, crate::telegram::DATA_LIMIT) - STANDARD
}

/// The mistakes in the last parameters or configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Faults {
    pub(super) parameters: bool,
    pub(super) configuration: bool,
    pub(super) not_supported: bool,
}

impl Station {
    /// Appends the current diagnosis.
    pub(super) fn append_diagnosis(&self, out: &mut Vec<u8>) {
        let flag = |bit: u8, is_set: bool| u8::from(is_set) << bit;
        let waits = self.state == State::WaitPrm;
        let alarm = self.acyclic.alarms.block().unwrap_or_default();
        // An alarm takes the place of other blocks, if there is not room for both.
        let room = room(self.identity.max_diagnosis);
        let fits = alarm.len() + self.extended.len() <= room;
        let extended: &[u8] = if fits { &self.extended } else { &[] };
        let has_more = self.has_more || !fits;
        out.push(
            flag(1, self.state != State::DataExch)
                | flag(2, self.faults.configuration)
                | flag(
                    3,
                    !self.extended.is_empty() || self.has_more || self.acyclic.alarms.has_error(),
                )
                | flag(4, self.faults.not_supported)
                | flag(6, self.faults.parameters),
        );
        // A slave always sets bit 2.
        out.push(
            flag(0, waits)
                | flag(1, self.is_static)
                | flag(2, true)
                | flag(3, self.watchdog.is_some())
                | flag(4, self.is_frozen)
                | flag(5, self.is_synced),
        );
        out.push(flag(7, has_more));
        // 255: no master.
        out.push(self.owner.unwrap_or(0xFF));
        out.extend(self.identity.ident.to_be_bytes());
        out.extend_from_slice(extended);
        out.extend(alarm);
    }
}
