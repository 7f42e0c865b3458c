//! The orders of an operator: patch any two channels, and force them. A client can patch only its own.

use std::fmt;

use super::{Author, Dispatcher, no_channel};
use crate::board::Snapshot;
use crate::federation::Request;
use crate::number::Number;
use crate::patch::Pin;
use crate::refusal::{Code, Refusal};

/// Takes the answer to an operator. The dispatcher drops it without a call if it ends first.
pub struct Reply(Box<dyn FnOnce(Result<(), Refusal>) + Send>);

impl Reply {
    /// Calls `answer`, which must not block, in the dispatcher's thread.
    pub fn new(answer: impl FnOnce(Result<(), Refusal>) + Send + 'static) -> Self {
        Self(Box::new(answer))
    }

    pub(super) fn give(self, answer: Result<(), Refusal>) {
        (self.0)(answer);
    }
}

impl fmt::Debug for Reply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reply").finish_non_exhaustive()
    }
}

/// An order of an operator. A refused order has changed nothing, unless its code is [`Code::Internal`]: then the patch
/// has changed, but could not be saved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// Connects an output with an input, in either order.
    Connect(Pin, Pin),
    /// Cuts the connection of an input, or all those of an output; their clients may be absent.
    Disconnect(Pin),
    /// Forces a channel to a value until it is released or its client leaves: an input receives it, an output passes it
    /// to its inputs.
    Force(Pin, Number),
    /// Ends a force.
    Release(Pin),
}

impl Dispatcher {
    /// Carries out an order. Changes of the patch are answered once saved, other orders at once.
    pub fn operate(&mut self, order: Order, reply: Reply) {
        self.board.begin_line();
        let request = match order {
            Order::Connect(one, other) => self.patch_in(one, other),
            Order::Disconnect(pin) => self.pull_out(&pin),
            Order::Force(pin, value) => {
                let forced = self.check_here(&pin).and_then(|seat| self.check_own(seat));
                if forced.is_ok() {
                    self.board.force(pin, value);
                }
                return reply.give(forced);
            }
            Order::Release(pin) => {
                let is_released = self.board.release(&pin);
                let not_forced = || Code::NotFound.because(format_args!("{pin} is not forced"));
                return reply.give(is_released.then_some(()).ok_or_else(not_forced));
            }
        };
        match request {
            Ok(request) => self.change(Author::Operator(reply), request),
            Err(refusal) => reply.give(Err(refusal)),
        }
    }

    /// All clients, their values and all connections, including those of other dispatchers. This copies everything, so
    /// call it no more often than somebody looks.
    pub fn snapshot(&self) -> Snapshot {
        let federation = self.federation.iter();
        let hosts = federation.flat_map(|federation| federation.hosts.values());
        self.board.snapshot(hosts.map(|host| &host.patch))
    }

    fn patch_in(&self, one: Pin, other: Pin) -> Result<Request, Refusal> {
        self.check_here(&one)?;
        self.check_here(&other)?;
        let connect = vec![self.joint(one, other, &[])?];
        let cut = Vec::new();
        Ok(Request { connect, cut })
    }

    fn pull_out(&self, pin: &Pin) -> Result<Request, Refusal> {
        let (connect, cut) = (Vec::new(), self.joints_at(pin));
        if cut.is_empty() {
            let text = format!("{pin} is not connected");
            return Err(Code::NotFound.because(text));
        }
        Ok(Request { connect, cut })
    }

    /// Refuses a client of another dispatcher.
    fn check_own(&self, seat: usize) -> Result<(), Refusal> {
        match self.board.host(seat) {
            None => Ok(()),
            Some(host) => Err(Code::NotFound.because(format_args!(
                "this client is on {host}; do it at the dispatcher there"
            ))),
        }
    }

    fn check_here(&self, pin: &Pin) -> Result<usize, Refusal> {
        let name = &pin.client;
        let Some(seat) = self.board.find_name(name) else {
            return Err(Code::NotFound.because(format_args!("there is no client {name}")));
        };
        if !self.board.has(seat, pin.channel) {
            return Err(no_channel(&format!("{name} has"), pin.channel));
        }
        Ok(seat)
    }

    /// The connection of two channels, as sink and source, if it fits the patch and `further` connections.
    pub(super) fn joint(
        &self,
        own: Pin,
        peer: Pin,
        further: &[(Pin, Pin)],
    ) -> Result<(Pin, Pin), Refusal> {
        let (kind, other) = (own.channel.kind, peer.channel.kind);
        if kind.is_output() == other.is_output() || kind.is_analog() != other.is_analog() {
            return Err(Code::Mismatch.because(format_args!(
                "{} and {} cannot be connected; connect an output with an input, digital or analog both",
                own.channel, peer.channel
            )));
        }
        let (sink, source) = if kind.is_output() {
            (peer, own)
        } else {
            (own, peer)
        };
        let joint = (sink, source);
        self.check_source(&joint, further)?;
        Ok(joint)
    }
}
