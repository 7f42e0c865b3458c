//! Forced channels: an operator's value in place of the client's.
//!
//! A forced channel is taken out of the routes, and put back when it is released, so forcing costs nothing on the path
//! of a value.

use super::{Board, Place};
use crate::number::Number;
use crate::patch::Pin;

impl Board {
    /// The value that a channel is forced to.
    pub(crate) fn forced(&self, pin: &Pin) -> Option<Number> {
        self.forces.get(pin).copied()
    }

    /// Forces a channel of a connected client to a value: an input receives it, and an output passes it to its inputs.
    pub(crate) fn force(&mut self, pin: Pin, value: Number) {
        let sinks = self.fed_by(&pin);
        if pin.channel.kind.is_output() {
            if let Some(from) = self.place(&pin)
                && let Some(output) = self.output(from)
            {
                output.sinks.clear();
            }
        } else if let Some(to) = self.place(&pin)
            && let Some(from) = self.patch.source(&pin).and_then(|pin| self.place(pin))
            && let Some(output) = self.output(from)
        {
            output.sinks.retain(|sink| *sink != to);
        }
        let from = self.place(&pin);
        self.forces.insert(pin, value);
        for sink in sinks {
            self.follow(&sink);
        }
        for (to, from) in self.supplied(from) {
            self.supply_again(to, from);
        }
    }

    /// The places on the seats of other dispatchers that want this output.
    fn supplied(&self, from: Option<Place>) -> Vec<(Place, Place)> {
        let places = from.and_then(|from| Some((from, self.supplies.get(&from)?)));
        let places = places.into_iter();
        places
            .flat_map(|(from, places)| places.iter().map(move |to| (*to, from)))
            .collect()
    }

    pub(super) fn has_forces(&self) -> bool {
        !self.forces.is_empty()
    }

    /// Releases all channels of a client.
    pub(super) fn release_all(&mut self, client: &str) {
        let of_client = self.forces.keys().filter(|pin| pin.client == client);
        let pins: Vec<Pin> = of_client.cloned().collect();
        self.begin_line();
        for pin in pins {
            self.release(&pin);
        }
    }

    /// Releases a channel; returns whether it was forced.
    pub(crate) fn release(&mut self, pin: &Pin) -> bool {
        let was_forced = self.forces.remove(pin).is_some();
        if was_forced {
            for sink in self.fed_by(pin) {
                if let Some(source) = self.patch.source(&sink).cloned() {
                    self.join(&sink, &source);
                }
                self.follow(&sink);
            }
            let from = self.place(pin).filter(|_| pin.channel.kind.is_output());
            for (to, from) in self.supplied(from) {
                self.resume(to, from);
                if self.said(pin).is_none() && !self.is_silent(from.seat) {
                    self.deliver(to, Number::ZERO, false);
                }
            }
        }
        was_forced
    }

    /// Forgets the forced values of a client that leaves.
    pub(super) fn forget_forces(&mut self, client: &str) {
        self.forces.retain(|pin, _| pin.client != client);
    }

    /// Sends an input its value: its own forced one, or that of its source. Unless `again`, only if the value differs.
    /// Returns whether there is such a value.
    pub(super) fn deliver_wanted(&mut self, sink: &Pin, again: bool) -> bool {
        let source = self.patch.source(sink);
        let forced = self.forced(sink);
        let forced = forced.or_else(|| self.forced(source?));
        let wanted = forced.or_else(|| self.said(source?));
        let (Some(value), Some(to)) = (wanted, self.place(sink)) else {
            return false;
        };
        if let Some(input) = self.seats[to.seat].inputs.get_mut(to.channel) {
            input.unforced = forced.map(|_| input.unforced.unwrap_or(input.value));
        }
        self.deliver(to, value, again);
        true
    }

    /// The value that the client of an output sent last.
    fn said(&self, source: &Pin) -> Option<Number> {
        let place = self.place(source)?;
        let plugged = self.seats[place.seat].plugged.as_ref()?;
        if plugged.is_silent {
            return None;
        }
        let value = plugged.outputs.get(place.channel)?.value;
        value.is_known().then_some(value)
    }

    /// The inputs whose value changes when this channel is forced: the sinks of an output, or the input itself.
    fn fed_by(&self, pin: &Pin) -> Vec<Pin> {
        if pin.channel.kind.is_output() {
            self.patch.sinks(pin).cloned().collect()
        } else {
            vec![pin.clone()]
        }
    }

    /// Sends an input its value if that differs from the last one.
    fn follow(&mut self, sink: &Pin) {
        if !self.deliver_wanted(sink, false) {
            self.lose(sink);
        }
    }
}
