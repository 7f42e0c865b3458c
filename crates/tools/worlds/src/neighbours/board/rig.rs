//! The dispatcher between simulated clients, as `tickbus dispatch` runs it, with the model beside it.

use std::collections::{BTreeMap, VecDeque};
use std::mem::take;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use tickbus_base::time::Nanos;
use tickbus_dispatcher::{
    Channel, Dispatcher, OnLoss, Order, Patch, Pin as BoardPin, Reply, Settings,
};

use crate::broken::Broken;
use crate::random::Random;

use super::model::{Heard, Model, channel_line};
use super::words::{CHANNELS, NAMES, Pin, Request};
use super::{Feature, Plan, Step};

/// A quarter of a second, in milliseconds. Promises end 100 ms after a multiple of it, so that none is at its limit at
/// a multiple.
const QUARTER: i64 = 250;

/// The maximum number of requests of a client that does not read, so that the dispatcher has room for its answers.
const ASKED: u32 = 30;

#[derive(Debug)]
struct Seat {
    /// The client's number in the dispatcher.
    number: usize,
    /// The bytes that the client has sent and the dispatcher has not taken, with the request that each line completes.
    sent: VecDeque<(Vec<u8>, Request)>,
    heard: Vec<u8>,
    is_deaf: bool,
    /// True if something had to wait in the dispatcher, so that newer values may have replaced older ones.
    may_have_waited: bool,
    asked: u32,
    pings: bool,
}

#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a choice of the plan"
)]
pub(super) struct Rig {
    dispatcher: Dispatcher,
    model: Model,
    /// The time, in milliseconds.
    now: i64,
    seats: BTreeMap<usize, Seat>,
    next_port: u16,
    replies: Arc<Mutex<Vec<u16>>>,
    has_pieces: bool,
    is_sloppy: bool,
    is_disk_slow: bool,
    has_floods: bool,
    is_saving: bool,
}

impl Rig {
    pub(super) fn new(plan: &Plan) -> Self {
        let holds = plan.has(Feature::Holds);
        let idle = match (plan.has(Feature::Idle), plan.has(Feature::Pauses)) {
            (true, false) => 10_600,
            _ => 1_000_600,
        };
        let settings = Settings {
            idle: Nanos::from_millis(idle),
            on_loss: if holds {
                OnLoss::Hold
            } else {
                OnLoss::FailSafe
            },
            ..Settings::default()
        };
        Self {
            dispatcher: Dispatcher::new(settings, Patch::new()),
            model: Model::new(holds, idle),
            now: 0,
            seats: BTreeMap::new(),
            next_port: 3330,
            replies: Arc::default(),
            has_pieces: plan.has(Feature::Pieces),
            is_sloppy: plan.has(Feature::Sloppy),
            is_disk_slow: plan.has(Feature::SlowDisk),
            has_floods: plan.has(Feature::Floods),
            is_saving: false,
        }
    }

    fn nanos(&self) -> Nanos {
        Nanos::from_millis(self.now)
    }

    pub(super) fn take(&mut self, step: Step, random: &mut Random) {
        match step {
            Step::Say(slot, request) => self.say(slot, request, random),
            // Only for a channel of the client: a refusal would wait for a client that does not read, as would its next
            // lines.
            Step::Flood(slot, channel) if self.model.has_output(slot, channel) => {
                for value in 0..1500_u64 {
                    // Long enough to fill the room of a client that does not read.
                    let value = 1_000_000_000_000_000 + value;
                    self.write(slot, Request::Values(vec![(channel, value)]), random);
                }
                // This is more than fits before anybody can read.
                for seat in self.seats.values_mut() {
                    seat.may_have_waited = true;
                }
                self.deliver(slot, usize::MAX);
            }
            Step::Flood(..) => {}
            Step::Leave(slot) => {
                if let Some(seat) = self.seats.remove(&slot) {
                    self.dispatcher.gone(seat.number);
                    self.model.gone(slot);
                }
            }
            Step::Deafen(slot) => {
                // An unread list holds back everything after it.
                let seat = self.seats.get_mut(&slot).filter(|seat| {
                    !seat
                        .sent
                        .iter()
                        .any(|(_, request)| *request == Request::List)
                });
                if let Some(seat) = seat {
                    (seat.is_deaf, seat.may_have_waited, seat.asked) = (true, true, 0);
                }
            }
            Step::Sip(slot, count) => self.sip(slot, count),
            Step::Hear(slot) => {
                if let Some(seat) = self.seats.get_mut(&slot) {
                    seat.is_deaf = false;
                }
                self.pump(slot);
            }
            Step::Ping(slot, pings) => {
                if let Some(seat) = self.seats.get_mut(&slot) {
                    seat.pings = pings;
                }
            }
            Step::Wait(quarters) => {
                for _ in 0..quarters.min(if self.model.is_waiting_for_disk() {
                    8
                } else {
                    quarters
                }) {
                    self.wait();
                }
            }
            Step::Pause(seconds) => {
                self.now += 1000 * seconds;
                self.ping();
                // The dispatcher blames no client for its own pause at once.
                self.pass(QUARTER);
                self.ping();
                self.wait();
            }
            Step::Disk(is_well) => self.disk(is_well),
            Step::Patch(one, other) => {
                self.operate(Order::Connect(board_pin(one), board_pin(other)));
                self.model.connect(one, other);
            }
            Step::Pull(pin) => {
                self.operate(Order::Disconnect(board_pin(pin)));
                self.model.disconnect(pin);
            }
            Step::Force(pin, value) => {
                let number = value.and_then(tickbus_dispatcher::Number::of);
                self.operate(match number {
                    Some(number) => Order::Force(board_pin(pin), number),
                    None => Order::Release(board_pin(pin)),
                });
                self.model.force(pin, value);
            }
        }
        self.turn();
    }

    fn operate(&mut self, order: Order) {
        let replies = self.replies.clone();
        let reply = Reply::new(move |answer| {
            let code = answer.err().map_or(0, |refusal| refusal.code.number());
            replies.lock().expect("nobody fails").push(code);
        });
        self.dispatcher.operate(order, reply);
    }

    /// A client sends a line; if lines come in pieces, perhaps only a part of it arrives now.
    fn say(&mut self, slot: usize, request: Request, random: &mut Random) {
        if !self.seats.contains_key(&slot) {
            if !matches!(request, Request::Identify(_)) && !random.once_in(10) {
                return;
            }
            let peer = SocketAddr::from(([192, 168, 0, 20], self.next_port));
            let seat = self.dispatcher.connected(self.nanos(), peer);
            let seat = seat.expect("there is room");
            self.model.connected(self.now, slot, seat, self.next_port);
            self.next_port += 1;
            let seat = Seat {
                number: seat,
                sent: VecDeque::new(),
                heard: Vec::new(),
                is_deaf: false,
                may_have_waited: false,
                asked: 0,
                pings: true,
            };
            self.seats.insert(slot, seat);
        }
        let seat = &self.seats[&slot];
        let request = match request {
            _ if seat.is_deaf && seat.asked >= ASKED => return,
            // With a slow disk, the order of a client's list and another client's leaving depends on who is written to
            // first.
            Request::List if seat.is_deaf || self.is_disk_slow => Request::Ping,
            request => request,
        };
        self.write(slot, request, random);
        let most = if self.has_pieces && random.once_in(2) {
            usize::try_from(random.below(60)).expect("small")
        } else {
            usize::MAX
        };
        self.deliver(slot, most);
    }

    fn write(&mut self, slot: usize, request: Request, random: &mut Random) {
        let is_sloppy = self.is_sloppy && random.once_in(2);
        if let Some(seat) = self.seats.get_mut(&slot) {
            seat.asked += u32::from(seat.is_deaf);
            let line = request.line(random, is_sloppy);
            seat.sent.push_back((line, request));
        }
    }

    /// Delivers bytes of a client to the dispatcher, in one piece, as far as it accepts them.
    fn deliver(&mut self, slot: usize, most: usize) {
        let Some(seat) = self.seats.get_mut(&slot) else {
            return;
        };
        if !self.dispatcher.wants_bytes(seat.number) || seat.sent.is_empty() {
            return;
        }
        let (mut bytes, mut requests) = (Vec::new(), Vec::new());
        let mut asks_list = false;
        while let Some((line, request)) = seat.sent.front_mut()
            && bytes.len() < most
            // Some clients wait for the disk and a list, others for the disk alone; the order in which they continue
            // does not matter.
            && !(self.is_disk_slow && (asks_list || *request == Request::List && !bytes.is_empty()))
        {
            let rest = line.split_off(line.len().min(most - bytes.len()));
            bytes.append(line);
            *line = rest;
            if line.is_empty() {
                let (_, request) = seat.sent.pop_front().expect("seen");
                asks_list |= request == Request::List;
                requests.push(request);
            }
        }
        seat.may_have_waited |= asks_list;
        let seat = seat.number;
        self.dispatcher.arrived(self.nanos(), seat, &bytes);
        for request in requests {
            self.model.arrived(self.now, slot, request);
        }
    }

    /// Does the work of the thread of `tickbus dispatch` until none is left.
    fn turn(&mut self) {
        loop {
            self.dispatcher.tick(self.nanos());
            self.save();
            let mut is_at_rest = self.dispatcher.deadline() > self.nanos();
            while let Some(seat) = self.dispatcher.next_touched() {
                let slot = self.seats.iter().find(|(_, it)| it.number == seat);
                if let Some((slot, _)) = slot {
                    self.pump(*slot);
                    is_at_rest = false;
                }
            }
            if is_at_rest && (self.is_saving || self.dispatcher.unsaved().is_none()) {
                return;
            }
        }
    }

    fn save(&mut self) {
        if self.dispatcher.unsaved().is_none() {
            return;
        }
        if !self.is_disk_slow {
            self.dispatcher.saved(&Ok(()));
            self.model.saved(self.now, 0);
        } else if !self.is_saving {
            self.is_saving = true;
            self.dispatcher.saving();
            self.model.saving();
        }
    }

    fn disk(&mut self, is_well: bool) {
        if !take(&mut self.is_saving) {
            return;
        }
        // A flood may be waiting behind an answer.
        for seat in self.seats.values_mut() {
            seat.may_have_waited |= self.has_floods;
        }
        let outcome = if is_well {
            Ok(())
        } else {
            Err("it is full".to_owned())
        };
        self.dispatcher.saved(&outcome);
        self.model.saved(self.now, if is_well { 0 } else { 500 });
        self.turn();
        // A client that has its answer continues, and so gives a sign of life.
        let slots: Vec<usize> = self.seats.keys().copied().collect();
        for slot in slots {
            let seat = self.seats.get_mut(&slot).expect("here");
            if seat.sent.is_empty()
                && self.dispatcher.wants_bytes(seat.number)
                && self.model.identity(slot).is_some()
            {
                seat.sent.push_back((b"\n".to_vec(), Request::Nothing));
            }
            self.deliver(slot, usize::MAX);
        }
    }

    /// Writes to a client that reads.
    fn pump(&mut self, slot: usize) {
        let Some(seat) = self.seats.get_mut(&slot) else {
            return;
        };
        while !seat.is_deaf {
            let bytes = self.dispatcher.to_write(seat.number).to_vec();
            if bytes.is_empty() {
                break;
            }
            self.dispatcher.wrote(seat.number, bytes.len());
            seat.heard.extend(bytes);
        }
        if self.dispatcher.is_closing(seat.number) {
            self.dispatcher.gone(seat.number);
            self.model.gone(slot);
            self.seats.remove(&slot);
        }
    }

    /// Lets a client that does not read take some bytes.
    fn sip(&mut self, slot: usize, count: usize) {
        let Some(seat) = self.seats.get_mut(&slot) else {
            return;
        };
        let bytes = self.dispatcher.to_write(seat.number);
        let taken = bytes[..count.min(bytes.len())].to_vec();
        if !taken.is_empty() {
            self.dispatcher.wrote(seat.number, taken.len());
            seat.heard.extend(taken);
        }
    }

    /// Lets a quarter of a second pass.
    fn wait(&mut self) {
        self.pass(QUARTER);
        self.model.look(self.now);
        self.turn();
        self.ping();
    }

    /// Lets time pass; the dispatcher wakes whenever it wants to.
    fn pass(&mut self, span: i64) {
        let end = self.now + span;
        loop {
            let deadline = self.dispatcher.deadline();
            if deadline >= Nanos::from_millis(end) {
                break;
            }
            // Round up to a whole millisecond.
            self.now = self.now.max(deadline.0.div_euclid(1_000_000) + 1);
            if self.now >= end {
                break;
            }
            self.dispatcher.tick(self.nanos());
        }
        self.now = end;
    }

    fn ping(&mut self) {
        let slots: Vec<usize> = self.seats.keys().copied().collect();
        for slot in slots {
            let seat = self.seats.get_mut(&slot).expect("here");
            let promises = self
                .model
                .identity(slot)
                .is_some_and(|it| it.alive.is_some());
            // The sign of life follows the rest of a line that has begun.
            if promises && seat.pings && !(seat.is_deaf && seat.asked >= ASKED) {
                seat.asked += u32::from(seat.is_deaf);
                seat.sent.push_back((b"\r\n".to_vec(), Request::Nothing));
                self.deliver(slot, usize::MAX);
            }
        }
        self.turn();
    }

    /// Lets the disk write, all clients read, and all lines arrive.
    pub(super) fn quieten(&mut self) {
        let slots: Vec<usize> = self.seats.keys().copied().collect();
        for _ in 0..100 {
            self.disk(true);
            for slot in &slots {
                self.deliver(*slot, usize::MAX);
                if let Some(seat) = self.seats.get_mut(slot) {
                    seat.is_deaf = false;
                }
                self.pump(*slot);
                self.turn();
            }
        }
    }

    /// Compares the lines that all clients have received, and the contents of the board, with the model.
    pub(super) fn judge(&mut self, trace: &mut Vec<String>) -> Result<(), Broken> {
        for (slot, seat) in &mut self.seats {
            if seat.is_deaf {
                continue;
            }
            let heard = read(&take(&mut seat.heard))?;
            let expected = self.model.take_events(*slot);
            if !heard.is_empty() {
                trace.push(format!("   {slot} hears {heard:?}"));
            }
            let may_have_waited = take(&mut seat.may_have_waited);
            let is_right = if may_have_waited {
                is_digest(&heard, &expected)
            } else {
                sorted(&heard) == sorted(&expected)
            };
            if !is_right {
                return Err(Broken {
                    promise: "heard",
                    what: format!("client {slot} heard {heard:?}; expected {expected:?}"),
                });
            }
        }
        let replies = take(&mut *self.replies.lock().expect("nobody fails"));
        let expected = take(&mut self.model.replies);
        if replies != expected {
            let what = format!("the operator heard {replies:?}; expected {expected:?}");
            return Err(Broken {
                promise: "operator",
                what,
            });
        }
        let (board, expected) = (self.board(), self.model.board());
        if board != expected {
            let what = format!("the board says {board:#?}; expected {expected:#?}");
            return Err(Broken {
                promise: "board",
                what,
            });
        }
        Ok(())
    }

    /// The contents of the board, in the model's format.
    fn board(&self) -> Vec<String> {
        let snapshot = self.dispatcher.snapshot();
        let mut lines = Vec::new();
        for client in snapshot.clients {
            lines.push(client.device.to_string());
            for channel in client.channels {
                lines.push(channel_line(
                    &channel.channel.to_string(),
                    channel.value,
                    channel.forced,
                ));
            }
        }
        let mut connections: Vec<String> = Vec::new();
        for connection in snapshot.connections {
            let (sink, source, is_awake) =
                (connection.sink, connection.source, connection.is_awake);
            connections.push(format!("{sink} {source} {is_awake}"));
        }
        lines.extend(connections);
        lines
    }
}

fn board_pin((name, channel): Pin) -> BoardPin {
    let channel = Channel::parse(CHANNELS[channel].as_bytes()).expect("a channel");
    BoardPin::new(NAMES[name], channel)
}

/// The contents of a client's lines.
fn read(bytes: &[u8]) -> Result<Vec<Heard>, Broken> {
    let text = String::from_utf8_lossy(bytes);
    if !text.is_empty() && !text.ends_with("\r\n") {
        let what = format!("half a line: {text}");
        return Err(Broken {
            promise: "lines",
            what,
        });
    }
    let lines = text.split_terminator("\r\n").map(|line| {
        if let Some(values) = line.strip_prefix("P ") {
            let pairs = values.split(' ').map(|word| {
                let (channel, value) = word.split_once('=').unwrap_or((word, ""));
                (channel.to_owned(), value.to_owned())
            });
            return Heard::Values(pairs.collect());
        }
        let is_refusal = line.starts_with("ERR ");
        Heard::Line(
            if is_refusal {
                &line[..line.len().min(7)]
            } else {
                line
            }
            .to_owned(),
        )
    });
    Ok(lines.collect())
}

/// Sorts the channels within each line, whose order does not matter.
fn sorted(events: &[Heard]) -> Vec<Heard> {
    let mut events = events.to_vec();
    for event in &mut events {
        if let Heard::Values(items) = event {
            items.sort_by(|(one, _), (other, _)| one.cmp(other));
        }
    }
    events
}

/// Returns true if a client that did not always read received all lines. Of each channel it may have missed values, but
/// neither their order nor the last one.
fn is_digest(heard: &[Heard], expected: &[Heard]) -> bool {
    let (lines, values) = parts(heard);
    let (expected_lines, expected_values) = parts(expected);
    lines == expected_lines
        && values.keys().eq(expected_values.keys())
        && values.iter().all(|(channel, values)| {
            let expected = &expected_values[channel];
            let mut rest = expected.iter();
            values.iter().all(|value| rest.any(|it| it == value))
                && values.last() == expected.last()
        })
}

/// The lines, and the values of each channel.
fn parts(events: &[Heard]) -> (Vec<&str>, BTreeMap<&str, Vec<&str>>) {
    let (mut lines, mut values) = (Vec::new(), BTreeMap::<&str, Vec<&str>>::new());
    for event in events {
        match event {
            Heard::Line(line) => lines.push(&**line),
            Heard::Values(items) => {
                for (channel, value) in items {
                    values.entry(channel).or_default().push(value);
                }
            }
        }
    }
    (lines, values)
}
