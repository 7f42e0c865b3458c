//! The board: who is plugged in, the patch, and the values that go through it.

mod forces;
mod remote;
mod silence;
mod snapshot;

use std::collections::{BTreeMap, HashMap};
use std::ops::Bound;

use crate::channel::Channel;
use crate::device::{Device, Role};
use crate::host::{HostId, Rank};
use crate::number::Number;
use crate::outbox::{Label, Listing, Outbox};
use crate::patch::{Patch, Pin};

pub use snapshot::{ChannelState, ClientState, Connection, Snapshot};

/// What an input gets when it no longer has a source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnLoss {
    /// Zero: as when a cable is pulled.
    #[default]
    FailSafe,
    /// The last value.
    Hold,
}

/// The place of a channel on the board: a seat, and one of its inputs or outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Place {
    pub(crate) seat: usize,
    pub(crate) channel: usize,
}

#[derive(Debug)]
struct Output {
    value: Number,
    sinks: Vec<Place>,
}

#[derive(Debug)]
struct Input {
    /// What its client has been sent, or will be next.
    value: Number,
    /// While its value comes from an operator: the last one that did not, which may be unknown.
    unforced: Option<Number>,
    label: Label,
    is_waiting: bool,
}

impl Input {
    fn new(label: Label) -> Self {
        Self {
            value: Number::UNKNOWN,
            unforced: None,
            label,
            is_waiting: false,
        }
    }
}

/// A client that is plugged in.
#[derive(Debug)]
struct Plugged {
    device: Device,
    /// Its line in the device list.
    line: Box<str>,
    order: Rank,
    /// The name of its host, if it is a client of another dispatcher. Then it has no inputs here: what goes to them is
    /// routed there.
    host: Option<Box<str>>,
    outputs: Box<[Output]>,
    /// Whether an input whose source is lost gets a sign for that, and not 0.
    hears_losses: bool,
    /// Whether the client has been silent for longer than its `ALIVE` time; its outputs are then cut off from the patch.
    is_silent: bool,
}

/// What the board keeps for a connection.
#[derive(Debug, Default)]
struct Seat {
    plugged: Option<Box<Plugged>>,
    /// The inputs of its client; or, if another dispatcher sits here, a place for each value that it wants.
    inputs: Vec<Input>,
    outbox: Outbox,
}

/// What other dispatchers may have to hear of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// A client was plugged in on a seat.
    Plugged(usize),
    /// A client that was on a seat has gone.
    Unplugged(usize, Rank),
    /// An input, and its new source, if it has one.
    Patched(Pin, Option<Pin>),
    /// The first sink of an output of a client elsewhere has come, or its last one has gone.
    Wanted(Place),
}

/// What went through the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Lines received.
    pub lines: u64,
    /// Values sent to inputs.
    pub values: u64,
    /// Values that a newer one replaced, because their client did not read.
    pub overtaken: u64,
    /// Lines refused.
    pub refused: u64,
}

/// All seats, and the one routing table: the patch by names, and the same between the channels that are there.
#[derive(Debug)]
pub(crate) struct Board {
    seats: Vec<Seat>,
    names: HashMap<String, usize>,
    /// The seats by the order of registration.
    by_order: BTreeMap<Rank, usize>,
    /// Later than every client so far.
    next_order: u64,
    /// What other dispatchers want: outputs, and the places on their seats. A forced output has these, too.
    supplies: BTreeMap<Place, Vec<Place>>,
    /// What has changed, if there are other dispatchers to be told.
    changes: Option<Vec<Change>>,
    patch: Patch,
    /// Whether it is as it was saved last, or was in the beginning.
    is_saved: bool,
    /// Channels of clients that are here, and what an operator holds them at.
    forces: BTreeMap<Pin, Number>,
    on_loss: OnLoss,
    /// Seats that have something to write, or are to be closed.
    touched: Vec<usize>,
    /// Number of the line being worked on: values that it causes may share a line.
    line: u64,
    pub(crate) traffic: Traffic,
}

impl Board {
    pub(crate) fn new(patch: Patch, on_loss: OnLoss) -> Self {
        Self {
            seats: Vec::new(),
            names: HashMap::new(),
            by_order: BTreeMap::new(),
            next_order: 0,
            supplies: BTreeMap::new(),
            changes: None,
            patch,
            is_saved: true,
            forces: BTreeMap::new(),
            on_loss,
            touched: Vec::new(),
            line: 0,
            traffic: Traffic::default(),
        }
    }

    pub(crate) fn patch(&self) -> &Patch {
        &self.patch
    }

    /// Whether the patch has not changed since it was saved.
    pub(crate) const fn is_saved(&self) -> bool {
        self.is_saved
    }

    /// The patch was saved as it is.
    pub(crate) const fn set_saved(&mut self) {
        self.is_saved = true;
    }

    /// Makes sure that there is this seat, with nobody on it.
    pub(crate) fn seat(&mut self, seat: usize) {
        if seat >= self.seats.len() {
            self.seats.resize_with(seat + 1, Seat::default);
        }
        self.clear(seat);
    }

    /// Forgets everything about a seat, but that it is in the list of those that were touched.
    fn clear(&mut self, seat: usize) {
        let is_touched = self.seats[seat].outbox.is_touched;
        self.seats[seat] = Seat::default();
        self.seats[seat].outbox.is_touched = is_touched;
    }

    pub(crate) fn outbox(&mut self, seat: usize) -> &mut Outbox {
        &mut self.seats[seat].outbox
    }

    pub(crate) fn to_write(&self, seat: usize) -> &[u8] {
        self.seats[seat].outbox.to_write()
    }

    pub(crate) fn touch(&mut self, seat: usize) {
        touch(&mut self.touched, &mut self.seats[seat].outbox, seat);
    }

    /// A seat that was touched and not asked for since.
    pub(crate) fn next_touched(&mut self) -> Option<usize> {
        let seat = self.touched.pop()?;
        self.seats[seat].outbox.is_touched = false;
        Some(seat)
    }

    /// Begins to work on a line.
    pub(crate) fn begin_line(&mut self) {
        self.line += 1;
    }

    /// Sends a line to a client.
    pub(crate) fn say(&mut self, seat: usize, line: &str) {
        self.seats[seat].outbox.line(line);
        self.touch(seat);
    }

    /// The client on a seat, once it has said who it is.
    pub(crate) fn device(&self, seat: usize) -> Option<&Device> {
        self.seats[seat]
            .plugged
            .as_ref()
            .map(|plugged| &plugged.device)
    }

    /// Finds a client by its name.
    pub(crate) fn find_name(&self, name: &str) -> Option<usize> {
        self.names.get(name).copied()
    }

    /// Finds a client by its name, or `P1` the first process and `R1` the first controller.
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        if let Some(seat) = self.find_name(name) {
            return Some(seat);
        }
        let role = match name.as_bytes().first()? {
            b'P' | b'p' => Role::Process,
            b'R' | b'r' => Role::Controller,
            _ => return None,
        };
        let number: usize = name[1..].parse().ok()?;
        let all = self.by_order.values().copied();
        let mut of_role = all.filter(|seat| self.device(*seat).is_some_and(|it| it.role == role));
        of_role.nth(number.checked_sub(1)?)
    }

    /// The next place in the order of registration: after all others, and not before `now`.
    pub(crate) fn next_order(&mut self, now: u64, host: HostId) -> Rank {
        let since = self.next_order.max(now);
        Rank { since, host }
    }

    /// Plugs a client in whose name is free, and wakes its connections.
    pub(crate) fn plug(&mut self, seat: usize, device: Device, order: Rank) {
        let inputs = device.counts.channels(false);
        let inputs = inputs.map(|channel| Input::new(Label::new(channel)));
        self.seats[seat].inputs = inputs.collect();
        let name = device.name.clone();
        self.place_device(seat, device, order, None);
        self.give_name(seat, name);
        self.changed(Change::Plugged(seat));
    }

    fn place_device(&mut self, seat: usize, device: Device, order: Rank, host: Option<Box<str>>) {
        let channels = device.counts.channels(true);
        let outputs = channels.map(|_| Output {
            value: Number::UNKNOWN,
            sinks: Vec::new(),
        });
        let outputs = outputs.collect();
        self.next_order = self.next_order.max(order.since + 1);
        self.by_order.insert(order, seat);
        self.seats[seat].plugged = Some(Box::new(Plugged {
            line: device.to_string().into(),
            device,
            order,
            host,
            outputs,
            hears_losses: false,
            is_silent: false,
        }));
    }

    /// Gives a client a free name, and wakes the connections of it.
    fn give_name(&mut self, seat: usize, name: String) {
        let Some(plugged) = &mut self.seats[seat].plugged else {
            return;
        };
        plugged.device.name.clone_from(&name);
        plugged.line = plugged.device.to_string().into();
        let connections = self.patch.of_client(&name);
        self.names.insert(name, seat);
        for (sink, source) in connections {
            self.join(&sink, &source);
        }
    }

    /// The client on this seat wants to hear of an input that its source is lost.
    pub(crate) fn hear_losses(&mut self, seat: usize) {
        if let Some(plugged) = &mut self.seats[seat].plugged {
            plugged.hears_losses = true;
        }
    }

    /// Frees the name of a client. The connections of the name sleep.
    fn take_name(&mut self, name: &str, is_leaving: bool) {
        self.begin_line();
        for (sink, source) in self.patch.of_client(name) {
            let (Some(to), Some(from)) = (self.place(&sink), self.place(&source)) else {
                continue;
            };
            // What the client had itself goes with it.
            if !is_leaving || source.client != name {
                self.part(to, from);
            }
            if !is_leaving || sink.client != name {
                self.lose(&sink);
            }
        }
        self.names.remove(name);
    }

    /// Frees a seat. The connections of its client sleep until it comes back.
    pub(crate) fn unplug(&mut self, seat: usize) {
        if let Some(plugged) = &self.seats[seat].plugged {
            let (name, order) = (plugged.device.name.clone(), plugged.order);
            if self.on_loss == OnLoss::Hold {
                // What is held is what the client said last, and not what an operator put in its place.
                self.release_all(&name);
            }
            self.forget_forces(&name);
            self.take_name(&name, true);
            self.by_order.remove(&order);
            self.changed(Change::Unplugged(seat, order));
        }
        self.clear(seat);
    }

    /// Connects an input that has no source.
    pub(crate) fn connect(&mut self, sink: Pin, source: Pin) {
        self.join(&sink, &source);
        self.changed(Change::Patched(sink.clone(), Some(source.clone())));
        self.patch.connect(sink, source);
        self.is_saved = false;
    }

    /// Cuts the connection of an input.
    pub(crate) fn disconnect(&mut self, sink: &Pin) {
        let Some(source) = self.patch.disconnect(sink) else {
            return;
        };
        self.is_saved = false;
        self.changed(Change::Patched(sink.clone(), None));
        if let (Some(to), Some(from)) = (self.place(sink), self.place(&source)) {
            self.part(to, from);
            self.lose(sink);
        }
    }

    /// Joins two channels, if both are there and not forced and the input is of a client of this dispatcher.
    fn join(&mut self, sink: &Pin, source: &Pin) {
        if self.forced(sink).is_some() || self.forced(source).is_some() {
            return;
        }
        let (Some(to), Some(from)) = (self.place(sink), self.place(source)) else {
            return;
        };
        if self.host(to.seat).is_some() || self.is_silent(from.seat) {
            return;
        }
        if let Some(output) = self.output(from) {
            output.sinks.push(to);
            if output.sinks.len() == 1 && self.host(from.seat).is_some() {
                self.changed(Change::Wanted(from));
            }
        }
    }

    /// Undoes what [`join`](Self::join) does.
    fn part(&mut self, to: Place, from: Place) {
        if let Some(output) = self.output(from) {
            output.sinks.retain(|other| *other != to);
            if output.sinks.is_empty() && self.host(from.seat).is_some() {
                self.changed(Change::Wanted(from));
            }
        }
    }

    fn changed(&mut self, change: Change) {
        if let Some(changes) = &mut self.changes {
            changes.push(change);
        }
    }

    /// Sends an input the value that it is to have once more, as far as that is known.
    pub(crate) fn refresh(&mut self, sink: &Pin) {
        self.deliver_wanted(sink, true);
    }

    /// Sends the inputs of a client the values of their sources.
    pub(crate) fn refresh_all(&mut self, seat: usize) {
        let Some(name) = self.device(seat).map(|device| device.name.clone()) else {
            return;
        };
        for (sink, _) in self.patch.of_client(&name) {
            if sink.client == name {
                self.refresh(&sink);
            }
        }
    }

    /// An output has a value; what is connected to it gets it, if it is another one.
    #[inline]
    pub(crate) fn set(&mut self, seat: usize, channel: usize, value: Number) {
        let Some(output) = self.output(Place { seat, channel }) else {
            return;
        };
        if output.value == value {
            return;
        }
        output.value = value;
        if let [to] = *output.sinks {
            self.deliver(to, value, false);
            return;
        }
        // They are not changed meanwhile.
        let sinks = std::mem::take(&mut output.sinks);
        for to in &sinks {
            self.deliver(*to, value, false);
        }
        if let Some(output) = self.output(Place { seat, channel }) {
            output.sinks = sinks;
        }
    }

    /// An input has no source any more.
    fn lose(&mut self, sink: &Pin) {
        let Some(to) = self.place(sink).filter(|_| self.forced(sink).is_none()) else {
            return;
        };
        let seat = &self.seats[to.seat];
        let hears_losses = seat.plugged.as_ref().is_some_and(|it| it.hears_losses);
        let nothing = if hears_losses {
            Number::LOST
        } else {
            Number::ZERO
        };
        let Some(input) = self.seats[to.seat].inputs.get_mut(to.channel) else {
            return;
        };
        let unforced = input.unforced.take();
        let value = match self.on_loss {
            // A client that was never sent a value assumes so itself.
            OnLoss::FailSafe => input.value.is_known().then_some(nothing),
            OnLoss::Hold => unforced.map(|it| if it.is_known() { it } else { nothing }),
        };
        if let Some(value) = value {
            self.deliver(to, value, false);
        }
    }

    /// Sends a value to an input; unless `is_forced` only if it is another one.
    #[inline]
    fn deliver(&mut self, to: Place, value: Number, is_forced: bool) {
        let seat = &mut self.seats[to.seat];
        let Some(input) = seat.inputs.get_mut(to.channel) else {
            return;
        };
        if input.value == value && !is_forced {
            return;
        }
        input.value = value;
        let outbox = &mut seat.outbox;
        if outbox.is_jammed() {
            if input.is_waiting {
                self.traffic.overtaken += 1;
            } else {
                input.is_waiting = true;
                outbox.waiting.push(to.channel);
            }
        } else {
            self.traffic.values += 1;
            outbox.value(self.line, &input.label, &value);
        }
        touch(&mut self.touched, outbox, to.seat);
    }

    /// Asks for the device list of now.
    pub(crate) fn list(&mut self, seat: usize) {
        self.seats[seat].outbox.listing = Some(Listing {
            after: None,
            end: Rank {
                since: self.next_order,
                host: HostId::default(),
            },
            count: 0,
        });
        self.touch(seat);
    }

    /// Makes lines of what waits, as far as there is room: the device list, then values. `has_end` ends the list by a
    /// line of its own.
    pub(crate) fn refill(&mut self, seat: usize, has_end: bool) {
        let outbox = &mut self.seats[seat].outbox;
        if let Some(mut listing) = outbox.listing.take() {
            let after = listing.after.map_or(Bound::Unbounded, Bound::Excluded);
            let all = self.by_order.range((after, Bound::Excluded(listing.end)));
            for (order, other) in all {
                if self.seats[seat].outbox.is_full() {
                    self.seats[seat].outbox.listing = Some(listing);
                    return;
                }
                let Some(plugged) = self.seats[*other].plugged.take() else {
                    continue;
                };
                let line = match &plugged.host {
                    Some(host) if has_end => &format!("{}@{host}", plugged.line),
                    _ => &*plugged.line,
                };
                self.seats[seat].outbox.line(line);
                self.seats[*other].plugged = Some(plugged);
                listing.after = Some(*order);
                listing.count += 1;
            }
            self.seats[seat].outbox.is_swollen = true;
            if has_end {
                self.seats[seat]
                    .outbox
                    .line(&format!("END {}", listing.count));
            }
        }
        let Seat { inputs, outbox, .. } = &mut self.seats[seat];
        if outbox.waiting.is_empty() || !outbox.has_room() {
            return;
        }
        self.line += 1;
        // There are few enough inputs for all of them to be taken at once.
        let mut waiting = std::mem::take(&mut outbox.waiting);
        for channel in waiting.drain(..) {
            let input = &mut inputs[channel];
            input.is_waiting = false;
            self.traffic.values += 1;
            outbox.value(self.line, &input.label, &input.value);
        }
        outbox.waiting = waiting;
    }

    fn place(&self, pin: &Pin) -> Option<Place> {
        let seat = *self.names.get(&pin.client)?;
        let channel = self.device(seat)?.counts.place(pin.channel)?;
        Some(Place { seat, channel })
    }

    fn output(&mut self, place: Place) -> Option<&mut Output> {
        let plugged = self.seats[place.seat].plugged.as_mut()?;
        plugged.outputs.get_mut(place.channel)
    }

    /// Whether the client on a seat has this channel.
    pub(crate) fn has(&self, seat: usize, channel: Channel) -> bool {
        let device = self.device(seat);
        device.is_some_and(|device| device.counts.place(channel).is_some())
    }
}

fn touch(touched: &mut Vec<usize>, outbox: &mut Outbox, seat: usize) {
    if !outbox.is_touched {
        outbox.is_touched = true;
        touched.push(seat);
    }
}
