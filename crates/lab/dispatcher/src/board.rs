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
use crate::label::Label as Name;
use crate::number::Number;
use crate::outbox::{Label, Listing, Outbox};
use crate::patch::{Patch, Pin};

pub use snapshot::{ChannelState, ClientState, Connection, Snapshot};

/// The value of an input that has lost its source.
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
    /// The value that the client has been sent, or will be sent next.
    value: Number,
    /// The last value that came from no operator, while an operator forces the channel; may be unknown.
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
    /// The client's line in the device list.
    line: Box<str>,
    order: Rank,
    /// The name of the host, for a client of another dispatcher. Such a client has no inputs here: its values are
    /// routed on the host.
    host: Option<Box<str>>,
    outputs: Box<[Output]>,
    /// The names that the client has given its channels.
    labels: BTreeMap<Channel, Name>,
    /// True if an input that loses its source gets `?` and not 0.
    hears_losses: bool,
    /// True if the client has been silent for longer than its `ALIVE` time; the patch then ignores its outputs.
    is_silent: bool,
}

/// The board's data for one connection.
#[derive(Debug, Default)]
struct Seat {
    plugged: Option<Box<Plugged>>,
    /// The inputs of the client. If another dispatcher has this seat: a place for each value that it wants.
    inputs: Vec<Input>,
    outbox: Outbox,
}

/// A change that other dispatchers may have to learn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// A client was plugged in on a seat.
    Plugged(usize),
    /// A client that was on a seat has gone.
    Unplugged(usize, Rank),
    /// An input, and its new source if any.
    Patched(Pin, Option<Pin>),
    /// An output of a client elsewhere got its first sink, or lost its last one.
    Wanted(Place),
    /// A client here calls one of its channels differently.
    Named(usize, Channel),
}

/// Counts of everything that went through the board.
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
    /// Outputs that other dispatchers want, with the places on their seats. Forced outputs are listed, too.
    supplies: BTreeMap<Place, Vec<Place>>,
    /// Changes not yet sent to other dispatchers; `None` without other dispatchers.
    changes: Option<Vec<Change>>,
    patch: Patch,
    /// True if the patch equals the saved one, or the one that the board began with.
    is_saved: bool,
    /// Channels of connected clients, and the values that an operator forces them to.
    forces: BTreeMap<Pin, Number>,
    on_loss: OnLoss,
    /// Seats with something to write, or to be closed.
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

    /// True if the patch has not changed since it was saved.
    pub(crate) const fn is_saved(&self) -> bool {
        self.is_saved
    }

    /// Marks the patch as saved.
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

    /// Clears a seat, but keeps its entry in the list of touched seats.
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

    /// Takes the next touched seat.
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

    /// The client on a seat, once it has identified itself.
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
            labels: BTreeMap::new(),
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

    /// From now on, the client on this seat is sent `?` when an input loses its source.
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
            // The own inputs and outputs of a client that leaves go with it.
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
                // The inputs keep the client's last value, not an operator's.
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

    /// Joins two channels, if both are present and unforced, and the input belongs to a client of this dispatcher.
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

    /// Resends an input its current value, as far as known.
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

    /// Sets the value of an output; connected inputs get it if it differs.
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
        // Setting a value does not change the list of sinks.
        let sinks = std::mem::take(&mut output.sinks);
        for to in &sinks {
            self.deliver(*to, value, false);
        }
        if let Some(output) = self.output(Place { seat, channel }) {
            output.sinks = sinks;
        }
    }

    /// Handles the loss of an input's source.
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

    /// Sends a value to an input; unless `is_forced`, only if the value differs.
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

    /// The client on a seat calls one of its channels so.
    pub(crate) fn name_channel(&mut self, seat: usize, channel: Channel, label: Name) {
        let Some(plugged) = &mut self.seats[seat].plugged else {
            return;
        };
        if plugged.labels.get(&channel) == Some(&label) {
            return;
        }
        plugged.labels.insert(channel, label);
        if plugged.host.is_none() {
            self.changed(Change::Named(seat, channel));
        }
    }

    /// The names that the client on a seat has given its channels.
    pub(crate) fn labels(&self, seat: usize) -> Option<&BTreeMap<Channel, Name>> {
        Some(&self.seats[seat].plugged.as_ref()?.labels)
    }

    /// Requests the current device list, with the labels of channels if wanted.
    pub(crate) fn list(&mut self, seat: usize, with_names: bool) {
        self.seats[seat].outbox.listing = Some(Listing {
            after: None,
            end: Rank {
                since: self.next_order,
                host: HostId::default(),
            },
            count: 0,
            with_names,
            begun: None,
        });
        self.touch(seat);
    }

    /// Turns waiting data into lines while there is room: first the device list, then values. With `has_end`, a
    /// separate line ends the list.
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
                let begun = listing.begun.take().filter(|(of, _)| of == order);
                if begun.is_none() {
                    let line = match &plugged.host {
                        Some(host) if has_end => &format!("{}@{host}", plugged.line),
                        _ => &*plugged.line,
                    };
                    self.seats[seat].outbox.line(line);
                    listing.count += 1;
                }
                if listing.with_names {
                    let name = &plugged.device.name;
                    let from = begun.map_or(Bound::Unbounded, |(_, last)| Bound::Excluded(last));
                    for (channel, label) in plugged.labels.range((from, Bound::Unbounded)) {
                        let outbox = &mut self.seats[seat].outbox;
                        outbox.line(&format!("NAME {name}:{channel} {label}"));
                        if outbox.is_full() {
                            listing.begun = Some((*order, *channel));
                            break;
                        }
                    }
                }
                self.seats[*other].plugged = Some(plugged);
                if listing.begun.is_some() {
                    self.seats[seat].outbox.listing = Some(listing);
                    return;
                }
                listing.after = Some(*order);
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

    /// True if the client on a seat has this channel.
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
