//! Clients of other dispatchers on the board, and other dispatchers as receivers of values.

use crate::device::Device;
use crate::host::Rank;
use crate::number::Number;
use crate::outbox::Label;
use crate::patch::Pin;

use super::{Board, Change, Input, Place};

impl Board {
    /// Starts to record changes for other dispatchers.
    pub(crate) fn keep_changes(&mut self) {
        self.changes = Some(Vec::new());
    }

    /// Takes the changes since the last call.
    pub(crate) fn take_changes(&mut self) -> Vec<Change> {
        self.changes
            .as_mut()
            .map(std::mem::take)
            .unwrap_or_default()
    }

    /// The name of the host, for a client of another dispatcher.
    pub(crate) fn host(&self, seat: usize) -> Option<&str> {
        self.seats[seat].plugged.as_ref()?.host.as_deref()
    }

    /// The client's rank in the order of registration.
    pub(crate) fn order(&self, seat: usize) -> Option<Rank> {
        Some(self.seats[seat].plugged.as_ref()?.order)
    }

    /// The seat of the client with this rank.
    pub(crate) fn seat_at(&self, order: Rank) -> Option<usize> {
        self.by_order.get(&order).copied()
    }

    /// The clients of this dispatcher.
    pub(crate) fn own_clients(&self) -> impl Iterator<Item = usize> {
        let all = self.by_order.values().copied();
        all.filter(|seat| self.host(*seat).is_none())
    }

    /// Puts a client of another dispatcher on a seat. The client has no name on this board yet.
    pub(crate) fn place_remote(&mut self, seat: usize, device: Device, order: Rank, host: &str) {
        self.place_device(seat, device, order, Some(host.into()));
    }

    /// Renames clients; the new names must be free. Connections of the old names sleep. Those of the new names wake,
    /// with the current values.
    pub(crate) fn rename(&mut self, renamed: Vec<(usize, String)>) {
        for (seat, _) in &renamed {
            let name = self.device(*seat).map(|device| device.name.clone());
            if let Some(name) = name.filter(|name| self.find_name(name) == Some(*seat)) {
                self.release_all(&name);
                self.take_name(&name, false);
            }
        }
        for (seat, name) in renamed {
            self.give_name(seat, name.clone());
            self.begin_line();
            for (sink, _) in self.patch.of_client(&name) {
                self.refresh(&sink);
            }
        }
    }

    /// True if an output has sinks here.
    pub(crate) fn is_wanted(&mut self, output: Place) -> bool {
        self.output(output)
            .is_some_and(|output| !output.sinks.is_empty())
    }

    /// Marks the value of an output as unknown.
    pub(crate) fn forget(&mut self, output: Place) {
        if let Some(output) = self.output(output) {
            output.value = Number::UNKNOWN;
        }
    }

    /// Sends another dispatcher the current value of an output and all later ones, marked by a number below ten
    /// million. `to` is the dispatcher's seat, with a place on it that is free, or the next. Returns `None` if the
    /// output does not exist.
    pub(crate) fn supply(&mut self, to: Place, number: u32, from: Place) -> Option<()> {
        self.output(from)?;
        let input = Input::new(Label::new(number));
        let inputs = &mut self.seats[to.seat].inputs;
        match inputs.get_mut(to.channel) {
            Some(free) => *free = input,
            None => inputs.push(input),
        }
        self.supplies.entry(from).or_default().push(to);
        self.resume(to, from);
        Some(())
    }

    /// Sends another dispatcher the value of an output that it wants, and later ones too unless the output is forced.
    pub(super) fn resume(&mut self, to: Place, from: Place) {
        if self.forced_at(from).is_none()
            && !self.is_silent(from.seat)
            && let Some(output) = self.output(from)
        {
            output.sinks.push(to);
        }
        self.supply_again(to, from);
    }

    /// The value that an output is forced to.
    pub(super) fn forced_at(&self, from: Place) -> Option<Number> {
        let device = self.device(from.seat).filter(|_| self.has_forces())?;
        let channel = device.counts.channels(true).nth(from.channel)?;
        self.forced(&Pin::new(&device.name, channel))
    }

    /// Resends another dispatcher the value of an output.
    pub(crate) fn supply_again(&mut self, to: Place, from: Place) {
        let said = if self.is_silent(from.seat) {
            Some(Number::LOST)
        } else {
            let said = self.output(from).map(|output| output.value);
            said.filter(|value| value.is_known())
        };
        if let Some(value) = self.forced_at(from).or(said) {
            self.deliver(to, value, true);
        }
    }

    /// Ends what [`supply`](Self::supply) began. The output may be gone already.
    pub(crate) fn end_supply(&mut self, to: Place, from: Place) {
        if let Some(output) = self.output(from) {
            output.sinks.retain(|other| *other != to);
        }
        if let Some(places) = self.supplies.get_mut(&from) {
            places.retain(|other| *other != to);
            if places.is_empty() {
                self.supplies.remove(&from);
            }
        }
        let waiting = &mut self.seats[to.seat].outbox.waiting;
        waiting.retain(|place| *place != to.channel);
    }
}
