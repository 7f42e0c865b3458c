//! Clients that have promised to speak and do not: as with forced channels, their outputs are taken out of the routes, and
//! put back when they speak again. So a value on its way costs nothing more because of promises.

use super::{Board, Place};
use crate::number::Number;
use crate::patch::Pin;

impl Board {
    /// Whether the client on a seat has broken its promise to speak.
    pub(super) fn is_silent(&self, seat: usize) -> bool {
        let plugged = self.seats[seat].plugged.as_ref();
        plugged.is_some_and(|plugged| plugged.is_silent)
    }

    /// A client has not kept its promise: its outputs have no values, and their inputs have lost their sources.
    pub(crate) fn fall_silent(&mut self, seat: usize) {
        self.begin_line();
        let sinks = self.set_silent(seat, true);
        for (sink, source) in sinks {
            if let (Some(to), Some(from)) = (self.place(&sink), self.place(&source)) {
                self.part(to, from);
            }
            self.lose(&sink);
        }
        for (to, from) in self.all_supplied(seat) {
            if let Some(output) = self.output(from) {
                output.sinks.retain(|sink| *sink != to);
            }
            self.supply_again(to, from);
        }
    }

    /// It speaks again: its outputs have the values that it said last.
    pub(crate) fn speak_again(&mut self, seat: usize) {
        self.begin_line();
        let sinks = self.set_silent(seat, false);
        for (sink, source) in sinks {
            self.join(&sink, &source);
            self.deliver_wanted(&sink, false);
        }
        for (to, from) in self.all_supplied(seat) {
            self.resume(to, from);
        }
    }

    /// The source of an output of a client elsewhere is lost.
    pub(crate) fn lose_output(&mut self, output: Place) {
        self.forget(output);
        let Some(pin) = self.pin(output).filter(|pin| self.forced(pin).is_none()) else {
            return;
        };
        let sinks: Vec<Pin> = self.patch.sinks(&pin).cloned().collect();
        for sink in sinks {
            self.lose(&sink);
        }
    }

    /// Marks a client; returns the connections of its outputs that no operator has forced.
    fn set_silent(&mut self, seat: usize, is_silent: bool) -> Vec<(Pin, Pin)> {
        let Some(plugged) = &mut self.seats[seat].plugged else {
            return Vec::new();
        };
        plugged.is_silent = is_silent;
        let name = &plugged.device.name;
        let connections = self.patch.of_client(name).into_iter();
        connections
            .filter(|(_, source)| source.client == *name && !self.forces.contains_key(source))
            .collect()
    }

    /// What other dispatchers want of a client: the places on their seats, and its outputs that no operator has forced.
    fn all_supplied(&self, seat: usize) -> Vec<(Place, Place)> {
        let of_client = self.supplies.range(
            Place { seat, channel: 0 }..=Place {
                seat,
                channel: usize::MAX,
            },
        );
        of_client
            .filter(|(from, _)| self.forced_at(**from).is_none())
            .flat_map(|(from, places)| places.iter().map(|to| (*to, *from)))
            .collect()
    }

    /// An output by its names.
    fn pin(&self, output: Place) -> Option<Pin> {
        let device = self.device(output.seat)?;
        let channel = device.counts.channels(true).nth(output.channel)?;
        Some(Pin::new(&device.name, channel))
    }

    /// What a silent client says to other dispatchers.
    pub(super) fn silence_of(&self, output: Place) -> Option<Number> {
        self.is_silent(output.seat).then_some(Number::LOST)
    }
}
