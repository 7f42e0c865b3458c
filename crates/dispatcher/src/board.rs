//! The board: who is plugged in, the patch, and the values that go through it.

use std::collections::{BTreeMap, HashMap};

use crate::channel::Channel;
use crate::device::{Device, Role};
use crate::number::Number;
use crate::outbox::{Label, Listing, Outbox};
use crate::patch::{Patch, Pin};

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    seat: usize,
    channel: usize,
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
    label: Label,
    is_waiting: bool,
}

/// A client that is plugged in.
#[derive(Debug)]
struct Plugged {
    device: Device,
    /// Its line in the device list.
    line: Box<str>,
    order: u64,
    outputs: Box<[Output]>,
    inputs: Box<[Input]>,
    /// Whether an input whose source is lost gets a sign for that, and not 0.
    hears_losses: bool,
}

/// What the board keeps for a connection.
#[derive(Debug, Default)]
struct Seat {
    plugged: Option<Box<Plugged>>,
    outbox: Outbox,
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
    by_order: BTreeMap<u64, usize>,
    next_order: u64,
    patch: Patch,
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
            patch,
            on_loss,
            touched: Vec::new(),
            line: 0,
            traffic: Traffic::default(),
        }
    }

    pub(crate) fn patch(&self) -> &Patch {
        &self.patch
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

    /// Whether a client has this name.
    pub(crate) fn is_taken(&self, name: &str) -> bool {
        self.names.contains_key(name)
    }

    /// Finds a client by its name, or `P1` the first process and `R1` the first controller.
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        if let Some(seat) = self.names.get(name) {
            return Some(*seat);
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

    /// Plugs a client in whose name is free, and wakes its connections.
    pub(crate) fn plug(&mut self, seat: usize, device: Device) {
        let channels = device.counts.channels(true);
        let outputs = channels.map(|_| Output {
            value: Number::UNKNOWN,
            sinks: Vec::new(),
        });
        let outputs = outputs.collect();
        let inputs = device.counts.channels(false).map(|channel| Input {
            value: Number::UNKNOWN,
            label: Label::new(channel),
            is_waiting: false,
        });
        let inputs = inputs.collect();
        let order = self.next_order;
        self.next_order += 1;
        self.names.insert(device.name.clone(), seat);
        self.by_order.insert(order, seat);
        let connections = self.patch.of_client(&device.name);
        self.seats[seat].plugged = Some(Box::new(Plugged {
            line: device.to_string().into(),
            device,
            order,
            outputs,
            inputs,
            hears_losses: false,
        }));
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

    /// Frees a seat. The connections of its client sleep until it comes back.
    pub(crate) fn unplug(&mut self, seat: usize) {
        let plugged = self.seats[seat].plugged.take();
        self.clear(seat);
        let Some(plugged) = plugged else {
            return;
        };
        self.names.remove(&plugged.device.name);
        self.by_order.remove(&plugged.order);
        self.begin_line();
        for (sink, source) in self.patch.of_client(&plugged.device.name) {
            if source.client != plugged.device.name
                && let Some(from) = self.place(&source)
                && let Some(output) = self.output(from)
            {
                output.sinks.retain(|sink| sink.seat != seat);
            }
            if sink.client != plugged.device.name
                && let Some(to) = self.place(&sink)
            {
                self.lose(to);
            }
        }
    }

    /// Connects an input that has no source.
    pub(crate) fn connect(&mut self, sink: Pin, source: Pin) {
        self.join(&sink, &source);
        self.patch.connect(sink, source);
    }

    /// Cuts the connection of an input.
    pub(crate) fn disconnect(&mut self, sink: &Pin) {
        let Some(source) = self.patch.disconnect(sink) else {
            return;
        };
        if let (Some(to), Some(from)) = (self.place(sink), self.place(&source)) {
            if let Some(output) = self.output(from) {
                output.sinks.retain(|other| *other != to);
            }
            self.lose(to);
        }
    }

    /// Joins two channels, if both are there.
    fn join(&mut self, sink: &Pin, source: &Pin) {
        if let (Some(to), Some(from)) = (self.place(sink), self.place(source))
            && let Some(output) = self.output(from)
        {
            output.sinks.push(to);
        }
    }

    /// Sends an input the value of its source once more, as far as both are there and it is known.
    pub(crate) fn refresh(&mut self, sink: &Pin) {
        let source = self.patch.source(sink);
        let (Some(to), Some(from)) = (self.place(sink), source.and_then(|pin| self.place(pin)))
        else {
            return;
        };
        if let Some(value) = self.output(from).map(|output| output.value)
            && value.is_known()
        {
            self.deliver(to, value, true);
        }
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
        let count = output.sinks.len();
        for at in 0..count {
            let output = self.output(Place { seat, channel });
            let Some(to) = output.and_then(|output| output.sinks.get(at).copied()) else {
                return;
            };
            self.deliver(to, value, false);
        }
    }

    /// An input has no source any more.
    fn lose(&mut self, to: Place) {
        let Some(plugged) = &self.seats[to.seat].plugged else {
            return;
        };
        let nothing = if plugged.hears_losses {
            Number::LOST
        } else {
            Number::ZERO
        };
        let input = plugged.inputs.get(to.channel);
        // A client that was never sent a value assumes so itself.
        if self.on_loss == OnLoss::FailSafe && input.is_some_and(|input| input.value.is_known()) {
            self.deliver(to, nothing, false);
        }
    }

    /// Sends a value to an input; unless `is_forced` only if it is another one.
    #[inline]
    fn deliver(&mut self, to: Place, value: Number, is_forced: bool) {
        let seat = &mut self.seats[to.seat];
        let input = seat.plugged.as_mut();
        let Some(input) = input.and_then(|plugged| plugged.inputs.get_mut(to.channel)) else {
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
            next: 0,
            end: self.next_order,
            count: 0,
        });
        self.touch(seat);
    }

    /// Makes lines of what waits, as far as there is room: the device list, then values. `has_end` ends the list by a
    /// line of its own.
    pub(crate) fn refill(&mut self, seat: usize, has_end: bool) {
        let outbox = &mut self.seats[seat].outbox;
        if let Some(mut listing) = outbox.listing.take() {
            for (order, other) in self.by_order.range(listing.next..listing.end) {
                if self.seats[seat].outbox.is_full() {
                    self.seats[seat].outbox.listing = Some(listing);
                    return;
                }
                let Some(plugged) = self.seats[*other].plugged.take() else {
                    continue;
                };
                self.seats[seat].outbox.line(&plugged.line);
                self.seats[*other].plugged = Some(plugged);
                listing.next = order + 1;
                listing.count += 1;
            }
            self.seats[seat].outbox.is_swollen = true;
            if has_end {
                self.seats[seat]
                    .outbox
                    .line(&format!("END {}", listing.count));
            }
        }
        let Seat { plugged, outbox } = &mut self.seats[seat];
        if outbox.waiting.is_empty() || !outbox.has_room() {
            return;
        }
        let Some(plugged) = plugged else {
            return;
        };
        self.line += 1;
        // There are few enough inputs for all of them to be taken at once.
        let mut waiting = std::mem::take(&mut outbox.waiting);
        for channel in waiting.drain(..) {
            let input = &mut plugged.inputs[channel];
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
