//! Connections with clients of other dispatchers: a connection belongs to the dispatcher of its sink.

use std::collections::{BTreeMap, BTreeSet};

use crate::federation::Request;
use crate::federation::message::{Body, Joint, WireJoint, joint};
use crate::host::HostId;
use crate::patch::{Patch, Pin};
use crate::refusal::{Code, Refusal};

use super::{Author, Dispatcher, Promised};

/// A change of connections that involves other dispatchers.
#[derive(Debug)]
pub(super) struct Waiting {
    pub(super) author: Author,
    /// The connections to make here once all others have agreed.
    connect: Vec<Joint>,
    cut: Vec<Pin>,
    /// Requests without an answer so far.
    open: BTreeSet<(HostId, u32)>,
    /// New connections that others have made, to be cut if one of them refuses.
    made: Vec<(HostId, Vec<Joint>)>,
    refusal: Option<Refusal>,
}

impl Dispatcher {
    /// The dispatcher to which the connections of a client's inputs belong, if it is another one.
    pub(super) fn home(&self, client: &str) -> Option<HostId> {
        let seat = self.board.find_name(client)?;
        self.board.host(seat)?;
        self.board.order(seat).map(|order| order.host)
    }

    /// The patch in which the connections of a client's inputs are.
    fn patch_of(&self, client: &str) -> &Patch {
        let hosts = self.federation.as_ref().map(|federation| &federation.hosts);
        let host = self.home(client);
        let host = host.and_then(|id| hosts?.get(&id));
        host.map_or(self.board.patch(), |host| &host.patch)
    }

    /// Refuses a connection if its sink has another source, on the board or among these.
    pub(super) fn check_source(&self, joint: &Joint, others: &[Joint]) -> Result<(), Refusal> {
        let (sink, source) = joint;
        let mut in_line = others.iter().filter(|(other, _)| other == sink);
        let present = self.patch_of(&sink.client).source(sink);
        let present = present.or(in_line.next().map(|(_, source)| source));
        match present.filter(|other| *other != source) {
            None => Ok(()),
            Some(other) => Err(Code::Conflict.because(format_args!(
                "{sink} is connected to {other} already; DISCONNECT it there first"
            ))),
        }
    }

    /// The connections that end at this channel, no matter which dispatcher they belong to.
    pub(super) fn joints_at(&self, pin: &Pin) -> Vec<Joint> {
        let federation = self.federation.iter();
        let hosts = federation.flat_map(|federation| federation.hosts.values());
        let patches = std::iter::once(self.board.patch()).chain(hosts.map(|host| &host.patch));
        let mut joints = Vec::new();
        for patch in patches {
            if pin.channel.kind.is_output() {
                joints.extend(patch.sinks(pin).map(|sink| (sink.clone(), pin.clone())));
            } else {
                joints.extend(
                    patch
                        .source(pin)
                        .map(|source| (pin.clone(), source.clone())),
                );
            }
        }
        joints
    }

    /// Makes and cuts connections that were checked, and answers.
    pub(super) fn change(&mut self, author: Author, all: Request) {
        if let Author::Client { seat, .. } = author {
            self.stick(seat);
        }
        let federation = self.federation.as_ref();
        let mut requests: BTreeMap<HostId, Request> = BTreeMap::new();
        let (mut connect, mut cut) = (Vec::new(), Vec::new());
        for joint in all.connect {
            match self.home(&joint.0.client) {
                // The connection exists already.
                Some(_) if self.patch_of(&joint.0.client).source(&joint.0) == Some(&joint.1) => {}
                Some(host) => requests.entry(host).or_default().connect.push(joint),
                None => connect.push(joint),
            }
        }
        for joint in all.cut {
            let mut hosts = federation.iter().flat_map(|federation| &federation.hosts);
            let host = hosts.find(|(_, host)| host.patch.source(&joint.0) == Some(&joint.1));
            let host = host.map(|(id, _)| *id);
            match host.filter(|_| self.board.patch().source(&joint.0) != Some(&joint.1)) {
                Some(host) => requests.entry(host).or_default().cut.push(joint),
                None => cut.push(joint.0),
            }
        }
        let mut waiting = Waiting {
            author,
            connect,
            cut,
            open: BTreeSet::new(),
            made: Vec::new(),
            refusal: None,
        };
        if requests.is_empty() {
            self.finish(waiting);
            return;
        }
        if let Some(federation) = &mut self.federation {
            for (host, request) in requests {
                let number = federation.request(host, request);
                waiting.open.insert((host, number));
            }
        }
        self.waiting.push(waiting);
    }

    /// All other dispatchers have answered.
    fn finish(&mut self, waiting: Waiting) {
        let Waiting {
            author,
            connect,
            cut,
            made,
            refusal,
            ..
        } = waiting;
        let mut checks = connect.iter().map(|joint| self.check_source(joint, &[]));
        let refusal = refusal.or_else(|| checks.find_map(Result::err));
        drop(checks);
        if let Some(refusal) = refusal {
            if let Some(federation) = &mut self.federation {
                for (host, cut) in made {
                    let connect = Vec::new();
                    federation.request(host, Request { connect, cut });
                }
            }
            self.conclude(author, Err(refusal));
            return;
        }
        self.board.begin_line();
        for sink in &cut {
            self.board.disconnect(sink);
        }
        let sinks = self.connect_all(connect);
        self.promise(Promised { author, sinks });
    }

    /// Answers when the patch is saved; at once, if the file is up to date.
    fn promise(&mut self, promised: Promised) {
        // Controllers that come back request the connections that they already have. Writing the file for each of them
        // would keep all others waiting.
        if self.board.is_saved() {
            self.fulfil(promised, Ok(()));
        } else {
            self.promised.push(promised);
        }
    }

    /// Makes connections that were checked; returns their sinks.
    fn connect_all(&mut self, joints: Vec<Joint>) -> Vec<Pin> {
        let mut sinks = Vec::with_capacity(joints.len());
        for (sink, source) in joints {
            if self.board.patch().source(&sink).is_none() {
                self.board.connect(sink.clone(), source);
            }
            sinks.push(sink);
        }
        sinks
    }

    /// Another dispatcher asks for changes of this patch.
    pub(super) fn requested(
        &mut self,
        host: HostId,
        number: u32,
        connect: &[WireJoint],
        cut: &[WireJoint],
    ) {
        let all: Option<Vec<Joint>> = connect.iter().chain(cut).map(joint).collect();
        let unreadable = || Code::Syntax.because("the dispatcher there cannot read this");
        let checked = all.ok_or_else(unreadable).and_then(|mut joints| {
            let cut = joints.split_off(connect.len());
            self.check_request(&joints).map(|()| (joints, cut))
        });
        let (connect, cut) = match checked {
            Ok(request) => request,
            Err(refusal) => return self.answer(host, number, Err(refusal)),
        };
        self.board.begin_line();
        for (sink, source) in cut {
            if self.board.patch().source(&sink) == Some(&source) {
                self.board.disconnect(&sink);
            }
        }
        let sinks = self.connect_all(connect);
        let author = Author::Host { host, number };
        self.promise(Promised { author, sinks });
    }

    fn check_request(&self, joints: &[Joint]) -> Result<(), Refusal> {
        for (at, joint) in joints.iter().enumerate() {
            for pin in [&joint.0, &joint.1] {
                let seat = self.board.find_name(&pin.client);
                if !seat.is_some_and(|seat| self.board.has(seat, pin.channel)) {
                    return Err(Code::NotFound.because(format_args!("there is no {pin} any more")));
                }
            }
            if self.home(&joint.0.client).is_some() {
                let text = format!("{} has moved to another host; try again", joint.0.client);
                return Err(Code::NotFound.because(text));
            }
            self.check_source(joint, &joints[..at])?;
        }
        Ok(())
    }

    pub(super) fn answer(&mut self, host: HostId, number: u32, outcome: Result<(), Refusal>) {
        let outcome = outcome.map_err(|refusal| (refusal.code.number(), refusal.text));
        if let Some(host) = self.host(host) {
            host.link.send(Body::Answer { number, outcome });
        }
    }

    /// Another dispatcher has answered a request.
    pub(super) fn answered(&mut self, id: HostId, number: u32, outcome: Result<(), (u16, String)>) {
        let request = self.host(id).and_then(|host| host.asked.remove(&number));
        let Some(request) = request else {
            return;
        };
        let mut all = self.waiting.iter_mut();
        let Some(at) = all.position(|waiting| waiting.open.remove(&(id, number))) else {
            return;
        };
        let waiting = &mut self.waiting[at];
        match outcome {
            Ok(()) => waiting.made.push((id, request.connect)),
            Err((code, text)) => {
                waiting.refusal = Some(Code::of(code).because(text));
            }
        }
        if waiting.open.is_empty() {
            let waiting = self.waiting.swap_remove(at);
            self.finish(waiting);
        }
    }
}
