//! A master's cyclic requests to a station: `Data_Exchange` and `Global_Control`.

use tickbus_base::time::Nanos;

use super::{Process, State, Station};
use crate::event::{Event, Leaving};
use crate::telegram::{Control, Frame, append_short_ack};

/// How a master shows that it is in CLEAR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Clear {
    /// By `Global_Control`.
    by_control: bool,
    /// By telegrams without outputs.
    by_length: bool,
}

impl Clear {
    fn is_on(self) -> bool {
        self.by_control || self.by_length
    }
}

impl Station {
    /// `Data_Exchange`.
    pub(super) fn exchange(
        &mut self,
        now: Nanos,
        request: &Frame<'_>,
        process: &mut impl Process,
        reply: &mut Vec<u8>,
    ) {
        let is_owner = self.owner == Some(request.source);
        if self.state != State::DataExch || !is_owner {
            return self.append(request, Control::NOT_ACTIVE, &[], reply);
        }
        let (expected, received) = (self.outputs.len(), request.data.len());
        let is_fail_safe = self.fail_safe && received == 0 && expected > 0;
        if received != expected && !is_fail_safe {
            self.leave(now, Leaving::Length { expected, received }, process);
            return self.append(request, Control::NOT_ACTIVE, &[], reply);
        }
        // A master that continues with the next exchange has received the last answer.
        if std::mem::take(&mut self.is_pending) {
            process.delivered(self.address);
        }
        let clear = Clear {
            by_length: is_fail_safe,
            ..self.clear
        };
        self.set_clear(now, clear, process);
        if clear.is_on() {
            process.alive(self.address, now);
        } else if self.is_synced {
            self.held.copy_from_slice(request.data);
            (self.is_held, self.held_since) = (true, now);
            if self.is_cleared {
                // The machine still has the outputs from before CLEAR, or before the outage.
                self.hand_over(now, process);
            } else {
                process.alive(self.address, now);
            }
        } else {
            self.outputs.copy_from_slice(request.data);
            self.hand_over(now, process);
        }
        if self.is_frozen {
            self.is_pending = std::mem::take(&mut self.is_fresh);
        } else if !self.inputs.is_empty() {
            if !process.inputs(self.address, now, &mut self.inputs) {
                return;
            }
            self.is_pending = true;
        }
        let control = if self.is_news || self.is_static {
            Control::DATA_HIGH
        } else {
            Control::DATA_LOW
        };
        if self.inputs.is_empty() && control == Control::DATA_LOW {
            append_short_ack(reply);
        } else {
            self.append(request, control, &self.inputs, reply);
        }
    }

    /// `Global_Control`, from the owner.
    pub(super) fn control(&mut self, now: Nanos, data: &[u8], process: &mut impl Process) {
        let &[command, groups] = data else { return };
        if self.state != State::DataExch || groups != 0 && groups & self.group == 0 {
            return;
        }
        let has = |bit: u8| command & (1 << bit) != 0;
        let clear = Clear {
            by_control: has(1),
            ..self.clear
        };
        self.set_clear(now, clear, process);
        if self.has_sync {
            // Every SYNC releases the held outputs; UNSYNC ends holding.
            if (has(4) || has(5)) && std::mem::take(&mut self.is_held) && !clear.is_on() {
                self.outputs.copy_from_slice(&self.held);
                // A command makes them no younger than the exchange that brought them.
                self.hand_over(self.held_since, process);
            }
            self.is_synced = !has(4) && (has(5) || self.is_synced);
        }
        if self.has_freeze {
            if has(3) && !has(2) {
                self.is_fresh = process.inputs(self.address, now, &mut self.inputs);
                self.is_pending = false;
                self.is_frozen = true;
            }
            self.is_frozen &= !has(2);
        }
    }

    /// Passes the outputs to the machine.
    fn hand_over(&mut self, now: Nanos, process: &mut impl Process) {
        self.is_cleared = false;
        process.outputs(self.address, now, &self.outputs);
    }

    /// The master enters or leaves CLEAR.
    fn set_clear(&mut self, now: Nanos, clear: Clear, process: &mut impl Process) {
        let before = std::mem::replace(&mut self.clear, clear);
        if before.is_on() == clear.is_on() {
            return;
        }
        if clear.is_on() {
            self.outputs.fill(0);
            self.is_cleared = true;
            self.is_held = false;
            process.tell(self.address, now, Event::Cleared);
        } else {
            // The first outputs after CLEAR are new, even if their bytes and the frame count bit are those of the last request.
            self.last.head = None;
            process.tell(self.address, now, Event::Operates);
        }
    }
}
