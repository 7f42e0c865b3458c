//! The dispatcher as one of several: their clients on its board, and its clients on theirs.

use std::collections::{BTreeMap, BTreeSet};

use tickbus_base::time::Nanos;

use crate::board::{Change, Place};
use crate::federation::link::{BEAT, Taken};
use crate::federation::message::{Body, Client, Letter, WireJoint, joint};
use crate::federation::{Federation, Host, Identity, MOST_WANTS, on_seat};
use crate::host::{HostId, Rank};
use crate::name::is_name;
use crate::number::Number;
use crate::patch::Patch;

use super::Dispatcher;
use super::names::{all_names, next_names};

impl Dispatcher {
    /// Makes this dispatcher one of several in a laboratory. Letters to the others come from
    /// [`next_letter`](Self::next_letter), news for an operator from [`next_news`](Self::next_news); ask for both after
    /// working on clients.
    ///
    /// Letters may be lost, but those from one dispatcher must arrive in their order.
    pub fn federate(&mut self, identity: Identity) {
        self.board.keep_changes();
        self.federation = Some(Box::new(Federation::new(identity)));
    }

    /// Another dispatcher can be reached.
    pub fn host_appeared(&mut self, now: Nanos, id: HostId) {
        self.settle();
        let Some(federation) = &self.federation else {
            return;
        };
        if id == federation.identity.host {
            return;
        }
        if !federation.hosts.contains_key(&id) {
            let seat = self.take_seat();
            if let Some(federation) = &mut self.federation {
                federation.hosts.insert(id, Host::new(now, seat));
            }
        }
        self.open_stream(now, id);
    }

    /// Another dispatcher has ended, or cannot be reached any more.
    pub fn host_vanished(&mut self, id: HostId) {
        self.settle();
        self.cut_off(id);
        let federation = self.federation.as_mut();
        if let Some(host) = federation.and_then(|federation| federation.hosts.remove(&id)) {
            self.free.push(host.seat);
        }
    }

    /// The next letter for another dispatcher.
    pub fn next_letter(&mut self) -> Option<(HostId, Vec<u8>)> {
        self.settle();
        let board = &mut self.board;
        let federation = self.federation.as_mut()?;
        let own = federation.identity.host;
        let newest = |host: &mut Host| {
            board.refill(host.seat, false);
            let lines = String::from_utf8_lossy(board.to_write(host.seat)).into_owned();
            board.outbox(host.seat).wrote(lines.len());
            let values = (!lines.is_empty()).then_some(Body::Values(lines));
            values.or_else(|| next_names(board, host, own))
        };
        let (host, letter) = federation.next_letter(newest)?;
        Some((host, letter.to_bytes()))
    }

    /// The next news for an operator, one line.
    pub fn next_news(&mut self) -> Option<String> {
        let news = self.guard.next_news();
        news.or_else(|| self.federation.as_mut()?.news.pop_front())
    }

    /// A letter from another dispatcher has arrived.
    pub fn letter_arrived(&mut self, now: Nanos, bytes: &[u8]) {
        self.settle();
        let Some(federation) = &mut self.federation else {
            return;
        };
        let letter = match Letter::read(bytes) {
            Ok(letter) => letter,
            Err(why) => {
                let complaint = format!(
                    "a letter from another dispatcher was ignored ({why}); run the same tickbus on all hosts"
                );
                if federation.complaint != complaint {
                    federation.complaint.clone_from(&complaint);
                    federation.news.push_back(complaint);
                }
                return;
            }
        };
        let id = letter.from;
        if id == federation.identity.host {
            return;
        }
        if !federation.hosts.contains_key(&id) {
            self.host_appeared(now, id);
        }
        let Some(host) = self.host(id) else {
            return;
        };
        match host.link.arrived(now, letter) {
            Taken::Next(body) => self.read(id, body),
            Taken::Restart => self.open_stream(now, id),
            Taken::Nothing | Taken::Missing => {}
        }
        self.settle();
    }

    /// Sends signs of life, and cuts off dispatchers that send none.
    pub(super) fn beat(&mut self, now: Nanos) {
        let Some(federation) = &mut self.federation else {
            return;
        };
        if now < federation.next_beat {
            return;
        }
        federation.next_beat = now + BEAT;
        let mut silent = Vec::new();
        for (id, host) in &mut federation.hosts {
            if host.link.is_silent(now) {
                silent.push(*id);
            }
        }
        for id in silent {
            self.cut_off(id);
        }
        let federation = self.federation.iter_mut();
        for host in federation.flat_map(|federation| federation.hosts.values_mut()) {
            host.link.beat();
        }
        self.settle();
    }

    /// When [`beat`](Self::beat) has something to do.
    pub(super) fn next_beat(&self) -> Nanos {
        let federation = self.federation.as_ref();
        federation.map_or(Nanos::MAX, |federation| federation.next_beat)
    }

    /// The next rank; based on the time of day in nanoseconds.
    pub(super) fn next_order(&mut self, now: Nanos) -> Rank {
        let identity = self.federation.as_ref().map(|it| &it.identity);
        let host = identity.map(|it| it.host).unwrap_or_default();
        let now = identity.map_or(0, |it| {
            it.since.saturating_add(u64::try_from(now.0).unwrap_or(0))
        });
        self.board.next_order(now, host)
    }

    pub(super) fn host(&mut self, id: HostId) -> Option<&mut Host> {
        self.federation.as_mut()?.hosts.get_mut(&id)
    }

    /// Sends the changes of this board to the other dispatchers.
    pub(super) fn settle(&mut self) {
        loop {
            let changes = self.board.take_changes();
            if changes.is_empty() {
                return;
            }
            for change in changes {
                self.settle_one(change);
            }
        }
    }

    fn settle_one(&mut self, change: Change) {
        let Some(federation) = &mut self.federation else {
            return;
        };
        match change {
            Change::Plugged(seat) => {
                if let (Some(order), Some(device)) =
                    (self.board.order(seat), self.board.device(seat))
                {
                    // Its names come later.
                    let client = Client::new(order.since, device, Vec::new());
                    federation.tell_all(|| Body::Here(client.clone()));
                }
            }
            Change::Unplugged(seat, order) => {
                let is_own = order.host == federation.identity.host;
                if is_own {
                    federation.tell_all(|| Body::Gone(order.since));
                }
                for host in federation.hosts.values_mut() {
                    if is_own {
                        host.renamed.remove(&order.since);
                    }
                    let wants: Vec<_> = host.wants.range(on_seat(seat)).collect();
                    let wants: Vec<_> = wants.into_iter().map(|(output, _)| *output).collect();
                    for output in wants {
                        host.unwant(output);
                    }
                    let supplies = host.supplies.range(on_seat(seat));
                    let supplies: Vec<_> = supplies.map(|(output, _)| *output).collect();
                    for output in supplies {
                        end_supply(&mut self.board, host, output);
                    }
                }
                let mut rivals = federation.rivals.iter_mut();
                let group = rivals
                    .find_map(|(name, group)| group.remove(&order).is_some().then(|| name.clone()));
                if let Some(name) = group {
                    self.resolve(&name);
                }
            }
            Change::Patched(sink, source) => federation
                .tell_all(|| Body::Patched((&sink).into(), source.as_ref().map(Into::into))),
            Change::Wanted(output) => self.settle_want(output),
            Change::Named(seat, channel) => self.settle_name(seat, channel),
        }
    }

    fn settle_want(&mut self, output: Place) {
        let Some(order) = self.board.order(output.seat) else {
            return;
        };
        let is_wanted = self.board.is_wanted(output);
        let Some(host) = self.host(order.host) else {
            return;
        };
        let since = order.since;
        #[expect(clippy::cast_possible_truncation, reason = "below 1024")]
        let place = output.channel as u16;
        if is_wanted && !host.wants.contains_key(&output) {
            let number = host.want(output);
            host.link.send(want(since, place, number));
        } else if !is_wanted && host.unwant(output) {
            host.link.send(Body::Unwant {
                since,
                output: place,
            });
            // No further value of this output will arrive.
            self.board.forget(output);
        }
    }

    /// Sends a host the complete state.
    fn open_stream(&mut self, now: Nanos, id: HostId) {
        let own = self.board.own_clients().filter_map(|seat| {
            let (order, device) = (self.board.order(seat)?, self.board.device(seat)?);
            let mut device = device.clone();
            // The name that the client has chosen, not the one that it is shown by.
            let name = device.name.split_once('@').map(|(name, _)| name.to_owned());
            device.name = name.unwrap_or(device.name);
            Some(Client::new(
                order.since,
                &device,
                all_names(&self.board, seat),
            ))
        });
        let clients = own.collect();
        let patch: Vec<_> = self.board.patch().iter().collect();
        let patch = patch.into_iter().map(|(a, b)| (a.into(), b.into()));
        let patch = patch.collect();
        let Some(federation) = &mut self.federation else {
            return;
        };
        let host = federation.identity.name.clone();
        federation.open(
            now,
            id,
            Body::Snapshot {
                host,
                clients,
                patch,
            },
        );
        let Some(host) = federation.hosts.get_mut(&id) else {
            return;
        };
        for (output, number) in &host.wants {
            if let Some(order) = self.board.order(output.seat) {
                #[expect(clippy::cast_possible_truncation, reason = "below 1024")]
                let place = output.channel as u16;
                host.link.send(want(order.since, place, *number));
            }
        }
        // Values may have been lost with the old stream.
        for (from, channel) in &host.supplies {
            let to = Place {
                seat: host.seat,
                channel: *channel,
            };
            self.board.begin_line();
            self.board.supply_again(to, *from);
        }
        host.link.beat();
    }

    /// Processes a letter that came in order.
    fn read(&mut self, id: HostId, body: Body) {
        match body {
            Body::Beat { .. } => {}
            Body::Snapshot {
                host,
                clients,
                patch,
            } => self.read_snapshot(id, host, &clients, &patch),
            Body::Here(client) => self.here(id, &client),
            Body::Gone(since) => self.remote_gone(id, since),
            Body::Named(since, names) => self.remote_names(id, since, &names),
            Body::Patched(sink, source) => {
                let source = source.map(|source| (sink.clone(), source));
                let (sink, source) = (sink.pin(), source.as_ref().map(joint));
                let Some(host) = self.host(id) else {
                    return;
                };
                match (sink, source) {
                    (_, Some(Some((sink, source)))) => host.patch.connect(sink, source),
                    (Some(sink), None) => drop(host.patch.disconnect(&sink)),
                    _ => {}
                }
            }
            Body::Want {
                since,
                output,
                number,
            } => self.supply(id, since, output, number),
            Body::Unwant { since, output } => {
                if let Some(output) = self.own_output(since, output)
                    && let Some(federation) = &mut self.federation
                    && let Some(host) = federation.hosts.get_mut(&id)
                {
                    end_supply(&mut self.board, host, output);
                }
            }
            Body::Values(lines) => self.remote_values(id, &lines),
            Body::Request {
                number,
                connect,
                cut,
            } => self.requested(id, number, &connect, &cut),
            Body::Answer { number, outcome } => self.answered(id, number, outcome),
        }
    }

    fn read_snapshot(&mut self, id: HostId, name: String, all: &[Client], patch: &[WireJoint]) {
        let Some(federation) = &mut self.federation else {
            return;
        };
        let Some(host) = federation.hosts.get_mut(&id) else {
            return;
        };
        if host.name.is_empty() {
            host.name = if is_name(&name) {
                name
            } else {
                "host".to_owned()
            };
            federation.news.push_back(format!(
                "the dispatcher of {} is here; its clients: {}",
                host.name,
                all.len()
            ));
        }
        host.patch = Patch::new();
        for (sink, source) in patch.iter().filter_map(joint) {
            host.patch.connect(sink, source);
        }
        // The host sends its wants again.
        let supplies: Vec<_> = host.supplies.keys().copied().collect();
        for output in supplies {
            end_supply(&mut self.board, host, output);
        }
        host.ask_again();
        let here: BTreeSet<u64> = all.iter().map(|client| client.since).collect();
        let gone = host.clients.keys().filter(|since| !here.contains(since));
        let gone: Vec<u64> = gone.copied().collect();
        for since in gone {
            self.remote_gone(id, since);
        }
        for client in all {
            self.here(id, client);
        }
    }

    /// Another dispatcher reports a client.
    fn here(&mut self, id: HostId, client: &Client) {
        let Some(host) = self.host(id) else {
            return;
        };
        let Some(device) = client.device() else {
            return;
        };
        if host.clients.contains_key(&client.since) {
            // Names may have been lost with the old stream.
            self.remote_names(id, client.since, &client.names);
            return;
        }
        let host_name = host.name.clone();
        let seat = self.take_seat();
        if let Some(host) = self.host(id) {
            host.clients.insert(client.since, seat);
        }
        let order = Rank {
            since: client.since,
            host: id,
        };
        let name = device.name.clone();
        self.board.place_remote(seat, device, order, &host_name);
        self.remote_names(id, client.since, &client.names);
        let Some(holder) = self.board.find_name(&name) else {
            self.board.rename(vec![(seat, name)]);
            return;
        };
        if let (Some(federation), Some(first)) = (&mut self.federation, self.board.order(holder)) {
            let group = federation.rivals.entry(name.clone()).or_default();
            group.extend([(first, holder), (order, seat)]);
        }
        self.resolve(&name);
    }

    /// Gives a name to the first client that has taken it, and other names to the rest.
    fn resolve(&mut self, name: &str) {
        let Some(federation) = &mut self.federation else {
            return;
        };
        let Some(group) = federation.rivals.get(name) else {
            return;
        };
        let mut shown: Vec<(usize, String)> = Vec::new();
        // Two computers may have the same name.
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for seat in group.values() {
            let host = self.board.host(*seat);
            let host = host.unwrap_or(&federation.identity.name);
            let text = if shown.is_empty() {
                name.to_owned()
            } else {
                let count = counts.entry(host).or_default();
                *count += 1;
                match count {
                    1 => format!("{name}@{host}"),
                    _ => format!("{name}@{host}@{count}"),
                }
            };
            shown.push((*seat, text));
        }
        if group.len() < 2 {
            federation.rivals.remove(name);
        }
        let board = &self.board;
        shown.retain(|(seat, text)| board.find_name(text) != Some(*seat));
        for (seat, text) in &shown {
            let before = board.device(*seat).map_or("", |device| &device.name);
            federation.news.push_back(if text == name {
                format!("{before} has the name {name} now")
            } else {
                format!(
                    "two clients are named {name}; the later one is {text} until the other leaves"
                )
            });
        }
        self.board.rename(shown);
    }

    /// A client of another dispatcher has gone.
    fn remote_gone(&mut self, id: HostId, since: u64) {
        let seat = self.host(id).and_then(|host| host.clients.remove(&since));
        if let Some(seat) = seat {
            self.board.unplug(seat);
            self.settle();
            self.free.push(seat);
        }
    }

    /// Cuts off a dispatcher that has fallen silent.
    fn cut_off(&mut self, id: HostId) {
        let Some(host) = self.host(id) else {
            return;
        };
        host.link.close();
        let name = std::mem::take(&mut host.name);
        let clients: Vec<u64> = host.clients.keys().copied().collect();
        let asked: Vec<u32> = host.asked.keys().copied().collect();
        let supplies: Vec<Place> = host.supplies.keys().copied().collect();
        host.patch = Patch::new();
        for since in clients {
            self.remote_gone(id, since);
        }
        let Some(federation) = &mut self.federation else {
            return;
        };
        if let Some(host) = federation.hosts.get_mut(&id) {
            for output in supplies {
                end_supply(&mut self.board, host, output);
            }
            host.free.clear();
            host.places = 0;
            self.board.seat(host.seat);
        }
        if !name.is_empty() {
            let news =
                format!("the dispatcher of {name} is gone; connections with its clients sleep");
            federation.news.push_back(news);
        }
        for number in asked {
            let text = format!("{name} was cut off before it answered; try again when it is back");
            self.answered(id, number, Err((404, text)));
        }
    }

    /// An output of a client of this dispatcher, by the time of its registration.
    fn own_output(&self, since: u64, output: u16) -> Option<Place> {
        let host = self.federation.as_ref()?.identity.host;
        let seat = self.board.seat_at(Rank { since, host })?;
        let channel = usize::from(output);
        Some(Place { seat, channel })
    }

    /// Another dispatcher wants the values of an output.
    fn supply(&mut self, id: HostId, since: u64, output: u16, number: u32) {
        let output = self.own_output(since, output);
        let Some(output) = output.filter(|_| number < MOST_WANTS) else {
            return;
        };
        let Some(federation) = &mut self.federation else {
            return;
        };
        let Some(host) = federation.hosts.get_mut(&id) else {
            return;
        };
        end_supply(&mut self.board, host, output);
        let channel = host.free.pop().unwrap_or(host.places);
        let to = Place {
            seat: host.seat,
            channel,
        };
        self.board.begin_line();
        if self.board.supply(to, number, output).is_some() {
            host.places = host.places.max(channel + 1);
            host.supplies.insert(output, channel);
        } else if channel < host.places {
            host.free.push(channel);
        }
    }

    /// Lines of values from another dispatcher.
    fn remote_values(&mut self, id: HostId, lines: &str) {
        let hosts = self.federation.as_ref().map(|federation| &federation.hosts);
        let Some(host) = hosts.and_then(|hosts| hosts.get(&id)) else {
            return;
        };
        for line in lines.lines() {
            self.board.begin_line();
            for word in line.split(' ').skip(1) {
                let item = word.split_once('=').and_then(|(number, value)| {
                    let output = host.wanted.get(&number.parse().ok()?)?;
                    let value = match value {
                        "?" => None,
                        value => Some(Number::parse(value.as_bytes())?),
                    };
                    Some((*output, value))
                });
                match item {
                    Some((output, Some(value))) => {
                        self.board.set(output.seat, output.channel, value);
                    }
                    // The remote client has broken its `ALIVE` promise.
                    Some((output, None)) => self.board.lose_output(output),
                    None => {}
                }
            }
        }
    }
}

const fn want(since: u64, output: u16, number: u32) -> Body {
    Body::Want {
        since,
        output,
        number,
    }
}

fn end_supply(board: &mut crate::board::Board, host: &mut Host, output: Place) {
    if let Some(channel) = host.supplies.remove(&output) {
        let to = Place {
            seat: host.seat,
            channel,
        };
        board.end_supply(to, output);
        host.free.push(channel);
    }
}
