//! The dispatcher as docs/dispatcher.md describes it, too slow and too simple to be wrong: after each event, the model
//! checks every input.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::mem::{replace, take};

use super::words::{CHANNELS, Identity, NAMES, Peer, Pin, Request, SHAPES, is_analog, is_input};

/// An event that a client receives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Heard {
    /// A line without values; only the code of a refusal, as in `ERR 404`.
    Line(String),
    /// The values of one line: channels, and the text after the equals sign.
    Values(Vec<(String, String)>),
}

/// The value that an input shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Value {
    Number(u64),
    /// `?`
    Lost,
}

#[derive(Debug, Default)]
pub(super) struct Client {
    port: u16,
    seat: usize,
    identity: Option<Identity>,
    order: u64,
    heard: i64,
    is_silent: bool,
    /// True while an answer to the client waits for the disk; its next lines wait as well.
    is_blocked: bool,
    is_closing: bool,
    queue: VecDeque<Request>,
    said: BTreeMap<usize, u64>,
    shown: BTreeMap<usize, Value>,
    /// The inputs that show a value forced by an operator.
    forced: BTreeSet<usize>,
    /// The values that inputs showed last without a force.
    real: BTreeMap<usize, Value>,
    /// The values that inputs were to show at the last check; true if forced.
    wanted: BTreeMap<usize, (u64, bool)>,
    events: Vec<(u64, Heard)>,
}

impl Client {
    fn has(&self, channel: usize) -> bool {
        self.identity
            .is_some_and(|it| SHAPES[it.shape].1.contains(&channel))
    }

    fn version(&self) -> u8 {
        self.identity.map_or(1, |it| it.version)
    }

    fn say(&mut self, line: String) {
        self.events.push((0, Heard::Line(line)));
    }
}

#[derive(Debug)]
enum Author {
    Client(usize, &'static str),
    Operator,
    Nobody,
}

#[derive(Debug)]
struct Promised {
    author: Author,
    sinks: Vec<Pin>,
}

#[derive(Debug, Default)]
pub(super) struct Model {
    /// True if inputs keep their values when their source is lost.
    holds: bool,
    /// The idle time after which a client is closed, in milliseconds.
    idle: i64,
    clients: BTreeMap<usize, Client>,
    orders: u64,
    patch: BTreeMap<Pin, Pin>,
    forces: BTreeMap<Pin, u64>,
    /// True if the patch differs from the one on the disk.
    is_dirty: bool,
    promised: Vec<Promised>,
    saving: usize,
    /// The number of the current group of events; the values of a group arrive in one line.
    group: u64,
    /// The answers that operators have received, as codes; 0 for success.
    pub(super) replies: Vec<u16>,
}

impl Model {
    /// A board without clients; `holds` is true if inputs keep their values when their source is lost.
    pub(super) fn new(holds: bool, idle: i64) -> Self {
        Self {
            holds,
            idle,
            ..Self::default()
        }
    }

    pub(super) fn connected(&mut self, now: i64, slot: usize, seat: usize, port: u16) {
        let client = Client {
            port,
            seat,
            heard: now,
            ..Client::default()
        };
        self.clients.insert(slot, client);
    }

    fn client(&mut self, slot: usize) -> &mut Client {
        self.clients.get_mut(&slot).expect("a client that is here")
    }

    pub(super) fn identity(&self, slot: usize) -> Option<Identity> {
        self.clients.get(&slot)?.identity
    }

    pub(super) fn has_output(&self, slot: usize, channel: usize) -> bool {
        !is_input(channel)
            && self
                .clients
                .get(&slot)
                .is_some_and(|client| client.has(channel))
    }

    pub(super) fn is_waiting_for_disk(&self) -> bool {
        !self.promised.is_empty()
    }

    fn named(&self, name: usize) -> Option<usize> {
        let is_it = |client: &Client| client.identity.is_some_and(|it| it.name == name);
        self.clients
            .iter()
            .find(|(_, client)| is_it(client))
            .map(|(slot, _)| *slot)
    }

    fn has(&self, (name, channel): Pin) -> bool {
        self.named(name)
            .is_some_and(|slot| self.clients[&slot].has(channel))
    }

    /// The clients that have identified themselves, in the order in which they did.
    fn in_order(&self) -> Vec<&Client> {
        let mut all: Vec<&Client> = self
            .clients
            .values()
            .filter(|it| it.identity.is_some())
            .collect();
        all.sort_by_key(|client| client.order);
        all
    }

    /// The value that an input is to show, and true if an operator forces it.
    fn wanted(&self, sink: Pin) -> Option<(u64, bool)> {
        let source = self.patch.get(&sink);
        let forced = self.forces.get(&sink).or_else(|| self.forces.get(source?));
        if let Some(value) = forced {
            return Some((*value, true));
        }
        let (name, channel) = source?;
        let client = &self.clients[&self.named(*name)?];
        let said = client.said.get(channel).filter(|_| !client.is_silent);
        said.map(|value| (*value, false))
    }

    /// Checks every input.
    fn settle(&mut self) {
        let slots: Vec<usize> = self.clients.keys().copied().collect();
        for slot in slots {
            for channel in 0..CHANNELS.len() {
                if is_input(channel) && self.clients[&slot].has(channel) {
                    self.look_at(slot, channel);
                }
            }
        }
    }

    fn look_at(&mut self, slot: usize, channel: usize) {
        let name = self.identity(slot).expect("it has channels").name;
        let sink = (name, channel);
        let wanted = self.wanted(sink);
        // A client that connects gets the value when the connection is saved; until then it gets changes only.
        let is_promised = self.promised.iter().any(|it| it.sinks.contains(&sink));
        let client = self.client(slot);
        let before = match wanted {
            Some(wanted) => client.wanted.insert(channel, wanted),
            None => client.wanted.remove(&channel),
        };
        match wanted {
            Some(_) if is_promised && wanted == before => {}
            Some((value, is_forced)) => {
                self.show(slot, channel, Value::Number(value), is_forced, false);
            }
            None => self.lose(slot, channel),
        }
    }

    fn lose(&mut self, slot: usize, channel: usize) {
        let holds = self.holds;
        let client = self.client(slot);
        let nothing = match client.version() {
            3 => Value::Lost,
            _ => Value::Number(0),
        };
        let was_forced = client.forced.contains(&channel);
        let value = match (holds, was_forced) {
            (true, true) => Some(*client.real.get(&channel).unwrap_or(&nothing)),
            (true, false) => None,
            (false, _) => client.shown.contains_key(&channel).then_some(nothing),
        };
        if let Some(value) = value {
            self.show(slot, channel, value, false, false);
        }
    }

    fn show(&mut self, slot: usize, channel: usize, value: Value, is_forced: bool, again: bool) {
        let group = self.group;
        let client = self.client(slot);
        if is_forced {
            client.forced.insert(channel);
        } else {
            client.forced.remove(&channel);
            client.real.insert(channel, value);
        }
        if client.shown.insert(channel, value) == Some(value) && !again {
            return;
        }
        let text = match value {
            Value::Number(number) => number.to_string(),
            Value::Lost => "?".to_owned(),
        };
        let item = (CHANNELS[channel].to_owned(), text);
        match client.events.last_mut() {
            Some((last, Heard::Values(items))) if *last == group => items.push(item),
            _ => client.events.push((group, Heard::Values(vec![item]))),
        }
    }

    /// Handles a line that has arrived.
    pub(super) fn arrived(&mut self, now: i64, slot: usize, request: Request) {
        let client = self.client(slot);
        if client.is_closing {
            return;
        }
        if client.is_blocked {
            client.queue.push_back(request);
            return;
        }
        client.heard = now;
        // New values count before the client is heard again, so that no input shows those from before its silence.
        if !matches!(request, Request::Values(_) | Request::WrongValues) {
            self.speak(slot);
        }
        self.group += 1;
        if let Err(code) = self.obey(slot, &request) {
            self.client(slot).say(format!("ERR {code}"));
        }
        self.speak(slot);
    }

    fn speak(&mut self, slot: usize) {
        if take(&mut self.client(slot).is_silent) {
            self.group += 1;
            self.settle();
        }
    }

    fn obey(&mut self, slot: usize, request: &Request) -> Result<(), u16> {
        let client = self.client(slot);
        let version = client.version();
        match request {
            Request::Nothing => return Ok(()),
            Request::Wrong => return Err(400),
            Request::Ping => client.say("OK PING".to_owned()),
            Request::Bye => {
                client.is_closing = true;
                if version > 1 {
                    client.say("OK BYE".to_owned());
                }
            }
            Request::Identify(identity) => return self.identify(slot, *identity),
            _ if client.identity.is_none() => return Err(401),
            Request::WrongValues => return Err(400),
            Request::Values(items) => return self.values(slot, items),
            Request::List => self.list(slot, "LIST"),
            Request::Connect(joints) => {
                let name = client.identity.expect("checked").name;
                let mut made = Vec::new();
                for (own, peer, channel) in joints {
                    let joint = self.joint((name, *own), *peer, *channel, &made)?;
                    made.push(joint);
                }
                self.change(Author::Client(slot, "CONNECT"), &made, &[]);
            }
            Request::Disconnect(channels) => {
                let name = client.identity.expect("checked").name;
                let mut cut = Vec::new();
                for channel in channels {
                    let pin = (name, *channel);
                    let sinks = self.sinks_at(pin);
                    if !self.has(pin) || sinks.is_empty() {
                        return Err(404);
                    }
                    cut.extend(sinks);
                }
                self.change(Author::Client(slot, "DISCONNECT"), &[], &cut);
            }
        }
        Ok(())
    }

    fn identify(&mut self, slot: usize, identity: Identity) -> Result<(), u16> {
        if self.client(slot).identity.is_some() || self.named(identity.name).is_some() {
            return Err(409);
        }
        self.orders += 1;
        let order = self.orders;
        let client = self.client(slot);
        (client.identity, client.order) = (Some(identity), order);
        self.list(slot, if identity.is_controller { "VR" } else { "VP" });
        self.group += 1;
        self.settle();
        Ok(())
    }

    fn list(&mut self, slot: usize, verb: &str) {
        let lines: Vec<String> = self
            .in_order()
            .iter()
            .map(|client| device_line(client))
            .collect();
        let client = self.client(slot);
        let is_new = client.version() > 1;
        if is_new {
            client.say(format!("OK {verb}"));
        }
        let count = lines.len();
        for line in lines {
            client.say(line);
        }
        if is_new {
            client.say(format!("END {count}"));
        }
    }

    fn values(&mut self, slot: usize, items: &[(usize, u64)]) -> Result<(), u16> {
        for (channel, _) in items {
            if is_input(*channel) {
                return Err(422);
            }
            if !self.client(slot).has(*channel) {
                return Err(404);
            }
        }
        for (channel, value) in items {
            self.client(slot).said.insert(*channel, *value);
            self.settle();
        }
        Ok(())
    }

    fn find(&self, peer: Peer) -> Option<usize> {
        let (is_controller, number) = match peer {
            Peer::Name(name) if self.named(name).is_some() => return Some(name),
            Peer::Name(name) if NAMES[name] == "P1" => (false, 1),
            Peer::Name(_) => return None,
            Peer::Nth {
                is_controller,
                number,
            } => {
                let name = format!("{}{number}", if is_controller { 'R' } else { 'P' });
                let same = NAMES.iter().position(|it| **it == *name);
                if let Some(name) = same.filter(|name| self.named(*name).is_some()) {
                    return Some(name);
                }
                (is_controller, number)
            }
        };
        let identities = self
            .in_order()
            .into_iter()
            .filter_map(|client| client.identity);
        let mut of_role = identities.filter(|it| it.is_controller == is_controller);
        of_role.nth(number - 1).map(|it| it.name)
    }

    fn joint(
        &self,
        own: Pin,
        peer: Peer,
        channel: usize,
        made: &[(Pin, Pin)],
    ) -> Result<(Pin, Pin), u16> {
        if !self.has(own) {
            return Err(404);
        }
        let peer = (self.find(peer).ok_or(404_u16)?, channel);
        if !self.has(peer) {
            return Err(404);
        }
        self.joint_of(own, peer, made)
    }

    fn joint_of(&self, own: Pin, peer: Pin, made: &[(Pin, Pin)]) -> Result<(Pin, Pin), u16> {
        if is_input(own.1) == is_input(peer.1) || is_analog(own.1) != is_analog(peer.1) {
            return Err(422);
        }
        let (sink, source) = if is_input(own.1) {
            (own, peer)
        } else {
            (peer, own)
        };
        let mut others = made
            .iter()
            .filter(|(other, _)| *other == sink)
            .map(|(_, source)| source);
        let present = self.patch.get(&sink).or(others.next());
        if present.is_some_and(|other| *other != source) {
            return Err(409);
        }
        Ok((sink, source))
    }

    fn sinks_at(&self, pin: Pin) -> Vec<Pin> {
        let ends = |(sink, source): &(&Pin, &Pin)| **sink == pin || **source == pin;
        self.patch
            .iter()
            .filter(ends)
            .map(|(sink, _)| *sink)
            .collect()
    }

    /// Changes the patch; the answer follows when the patch is on the disk.
    fn change(&mut self, author: Author, make: &[(Pin, Pin)], cut: &[Pin]) {
        if let Author::Client(slot, _) = author {
            self.client(slot).is_blocked = true;
        }
        for sink in cut {
            self.is_dirty |= self.patch.remove(sink).is_some();
        }
        for (sink, source) in make {
            self.is_dirty |= self.patch.insert(*sink, *source).is_none();
        }
        let sinks: Vec<Pin> = make.iter().map(|(sink, _)| *sink).collect();
        // These inputs are connected, but their values have not been sent yet.
        for sink in &sinks {
            if let (Some(slot), Some(wanted)) = (self.named(sink.0), self.wanted(*sink)) {
                self.client(slot).wanted.insert(sink.1, wanted);
            }
        }
        self.promised.push(Promised { author, sinks });
        self.settle();
        if !self.is_dirty {
            let promised = self.promised.pop().expect("pushed");
            self.fulfil(promised, 0);
        }
    }

    /// The disk begins to write the current patch.
    pub(super) fn saving(&mut self) {
        self.saving = self.promised.len();
    }

    /// The patch is on the disk, or could not be written.
    pub(super) fn saved(&mut self, now: i64, code: u16) {
        let count = match replace(&mut self.saving, 0) {
            0 => self.promised.len(),
            count => count,
        };
        let later = self.promised.split_off(count);
        if code == 0 && later.is_empty() {
            self.is_dirty = false;
        }
        let all = replace(&mut self.promised, later);
        let mut answered = Vec::new();
        for promised in all {
            if let Author::Client(slot, _) = promised.author {
                answered.push(slot);
            }
            self.fulfil(promised, code);
        }
        for slot in answered {
            let queue = take(&mut self.client(slot).queue);
            for request in queue {
                self.arrived(now, slot, request);
            }
        }
    }

    fn fulfil(&mut self, Promised { author, sinks }: Promised, code: u16) {
        match author {
            Author::Client(slot, verb) => {
                let client = self.client(slot);
                client.is_blocked = false;
                if code > 0 {
                    client.say(format!("ERR {code}"));
                } else if client.version() > 1 {
                    client.say(format!("OK {verb}"));
                }
            }
            Author::Operator => self.replies.push(code),
            Author::Nobody => {}
        }
        self.group += 1;
        for sink in sinks {
            if let (Some(slot), Some((value, is_forced))) = (self.named(sink.0), self.wanted(sink))
                && self.clients[&slot].has(sink.1)
            {
                self.show(slot, sink.1, Value::Number(value), is_forced, true);
            }
        }
    }

    /// The connection of a client has ended.
    pub(super) fn gone(&mut self, slot: usize) {
        for promised in &mut self.promised {
            if matches!(promised.author, Author::Client(it, _) if it == slot) {
                promised.author = Author::Nobody;
            }
        }
        let identity = self.identity(slot);
        let is_here = |pin: &Pin| identity.is_none_or(|it| it.name != pin.0);
        if self.holds {
            // Values forced by an operator are released first, so that inputs hold the client's own values.
            self.group += 1;
            self.forces.retain(|pin, _| is_here(pin));
            self.settle();
        }
        self.forces.retain(|pin, _| is_here(pin));
        self.clients.remove(&slot);
        self.group += 1;
        self.settle();
    }

    /// Time has passed: marks clients as silent that have broken their promise, and closes idle ones.
    pub(super) fn look(&mut self, now: i64) {
        let mut slots: Vec<usize> = self.clients.keys().copied().collect();
        slots.sort_by_key(|slot| self.clients[slot].seat);
        for slot in slots {
            let idle = self.idle;
            let client = self.client(slot);
            let (silence, alive) = (now - client.heard, client.identity.and_then(|it| it.alive));
            if client.is_closing {
                continue;
            }
            if silence >= idle {
                client.is_closing = true;
                client.say("ERR 408".to_owned());
            } else if !client.is_silent
                && !client.is_blocked
                && alive.is_some_and(|alive| silence > alive)
            {
                client.is_silent = true;
                self.group += 1;
                self.settle();
            }
        }
    }

    pub(super) fn connect(&mut self, one: Pin, other: Pin) {
        self.group += 1;
        let is_here = self.has(one) && self.has(other);
        let joint = if is_here {
            self.joint_of(one, other, &[])
        } else {
            Err(404)
        };
        match joint {
            Ok(joint) => self.change(Author::Operator, &[joint], &[]),
            Err(code) => self.replies.push(code),
        }
    }

    pub(super) fn disconnect(&mut self, pin: Pin) {
        self.group += 1;
        let cut = self.sinks_at(pin);
        if cut.is_empty() {
            self.replies.push(404);
        } else {
            self.change(Author::Operator, &[], &cut);
        }
    }

    pub(super) fn force(&mut self, pin: Pin, value: Option<u64>) {
        self.group += 1;
        let is_done = match value {
            Some(value) => {
                let has = self.has(pin);
                if has {
                    self.forces.insert(pin, value);
                }
                has
            }
            None => self.forces.remove(&pin).is_some(),
        };
        self.settle();
        self.replies.push(if is_done { 0 } else { 404 });
    }

    /// Takes the events that a client has received since the last call.
    pub(super) fn take_events(&mut self, slot: usize) -> Vec<Heard> {
        take(&mut self.client(slot).events)
            .into_iter()
            .map(|(_, heard)| heard)
            .collect()
    }

    /// The contents of the board: a line for each client, each of its channels, and each connection.
    pub(super) fn board(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for client in self.in_order() {
            let identity = client.identity.expect("checked");
            lines.push(device_line(client));
            for outputs in [true, false] {
                let channels = SHAPES[identity.shape].1.iter().copied();
                for channel in channels.filter(|channel| is_input(*channel) != outputs) {
                    let said = client
                        .said
                        .get(&channel)
                        .copied()
                        .filter(|_| !client.is_silent);
                    let value = match client.shown.get(&channel) {
                        Some(Value::Number(number)) => Some(*number),
                        Some(Value::Lost) => None,
                        None => said,
                    };
                    let forced = self.forces.get(&(identity.name, channel)).copied();
                    lines.push(channel_line(CHANNELS[channel], value, forced));
                }
            }
        }
        let pin = |pin: &Pin| format!("{}:{}", NAMES[pin.0], CHANNELS[pin.1]);
        for (sink, source) in &self.patch {
            let is_awake = self.has(*sink) && self.has(*source);
            lines.push(format!("{} {} {is_awake}", pin(sink), pin(source)));
        }
        lines
    }
}

/// The board's line for a channel.
pub(super) fn channel_line(
    channel: &str,
    value: Option<impl ToString>,
    forced: Option<impl ToString>,
) -> String {
    let text = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    let (value, forced) = (
        value.map(|it| it.to_string()),
        forced.map(|it| it.to_string()),
    );
    format!("{channel} {} {}", text(value), text(forced))
}

fn device_line(client: &Client) -> String {
    let identity = client.identity.expect("it has said who it is");
    let [q, i, aq, ai] = SHAPES[identity.shape].0;
    let role = if identity.is_controller { "VR" } else { "VP" };
    let (name, port) = (NAMES[identity.name], client.port);
    format!("{role}:{name}:Q{q:02}:I{i:02}:AQ{aq:02}:AI{ai:02}:192.168.0.20:{port}")
}
