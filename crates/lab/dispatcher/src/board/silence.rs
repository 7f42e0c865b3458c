//! Clients that are silent for longer than their `ALIVE` time. As with forced channels, the board takes their outputs out of
//! the routes, and puts them back with the next line, so that routing a value costs no more than without such clients.

use super::{Board, Place};
use crate::patch::Pin;

impl Board {
    /// True if the client on a seat has exceeded its `ALIVE` time.
    pub(super) fn is_silent(&self, seat: usize) -> bool {
        let plugged = self.seats[seat].plugged.as_ref();
        plugged.is_some_and(|plugged| plugged.is_silent)
    }

    /// The client on a seat has exceeded its `ALIVE` time: every input that it feeds loses its source.
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

    /// The client on a seat sends lines again: every input that it feeds gets the last value of its source.
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

    /// Another dispatcher reports that a client there has exceeded its `ALIVE` time: the inputs of this output lose their source.
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

    /// Marks a client as silent or not, and returns the connections from its outputs, except outputs that an operator
    /// has forced.
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

    /// The outputs of a client that go to other dispatchers, each with its place on the other's seat; without forced
    /// outputs.
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

    /// The pin of an output.
    fn pin(&self, output: Place) -> Option<Pin> {
        let device = self.device(output.seat)?;
        let channel = device.counts.channels(true).nth(output.channel)?;
        Some(Pin::new(&device.name, channel))
    }
}
