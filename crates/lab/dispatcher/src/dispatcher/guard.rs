//! Admits clients that know the key of the laboratory.

use std::collections::{BTreeSet, VecDeque};
use std::net::{IpAddr, SocketAddr};

use tickbus_base::os::is_told;
use tickbus_base::time::Nanos;

use super::{Dispatcher, Progress};
use crate::key::Key;
use crate::refusal::{Code, Refusal};

/// After a wrong key, no key of the same address is looked at for this long: four guesses in a second.
const PAUSE: Nanos = Nanos::from_millis(250);

/// The most addresses that wait.
const ADDRESSES: usize = 1024;

/// A connection has this long to state the key.
pub(super) const PATIENCE: Nanos = Nanos::from_secs(10);

/// The key, if there is one, and the clients that did not know it.
#[derive(Debug, Default)]
pub(super) struct Guard {
    key: Option<Key>,
    /// Wrong keys so far.
    wrong: u64,
    /// Addresses that have stated a wrong key, and when the next one of each is looked at; the soonest first.
    pauses: VecDeque<(IpAddr, Nanos)>,
    /// The seats whose clients have not stated the key, and since when they are connected.
    pub(super) strangers: BTreeSet<(Nanos, usize)>,
    news: VecDeque<String>,
}

impl Guard {
    /// True if clients have to state a key.
    pub(super) fn is_closed(&self) -> bool {
        self.key.is_some()
    }

    pub(super) fn next_news(&mut self) -> Option<String> {
        self.news.pop_front()
    }

    fn admit(&mut self, now: Nanos, peer: SocketAddr, said: &[u8]) -> Result<(), Refusal> {
        let Some(key) = &self.key else {
            return Ok(());
        };
        while self.pauses.front().is_some_and(|(_, end)| *end <= now) {
            self.pauses.pop_front();
        }
        let address = peer.ip();
        if self.pauses.iter().any(|(other, _)| *other == address) {
            return Err(Code::Limit.because(format_args!(
                "a wrong key came from this address; connect again after {PAUSE}"
            )));
        }
        if key.is(said) {
            return Ok(());
        }
        self.wrong += 1;
        if self.pauses.len() >= ADDRESSES {
            self.pauses.pop_front();
        }
        self.pauses.push_back((address, now + PAUSE));
        if is_told(self.wrong) {
            self.news.push_back(format!(
                "a client at {peer} has stated a wrong key ({} so far)",
                self.wrong
            ));
        }
        Err(Code::WrongKey.because("the key is wrong; ask the operator of the laboratory for it"))
    }
}

impl Dispatcher {
    /// Requires every further client to state this key in its first line. Clients of other dispatchers and operators of a
    /// page need none.
    pub fn require(&mut self, key: Key) {
        self.guard.key = Some(key);
    }

    /// The number of wrong keys that clients have stated.
    pub fn wrong_keys(&self) -> u64 {
        self.guard.wrong
    }

    /// A client has stated a key. A wrong one closes the connection.
    pub(super) fn unlock(&mut self, now: Nanos, seat: usize, said: &[u8]) -> Result<(), Refusal> {
        let Some(session) = &mut self.sessions[seat] else {
            return Ok(());
        };
        let admitted = self.guard.admit(now, session.peer, said);
        if admitted.is_ok() {
            self.guard.strangers.remove(&(session.heard, seat));
            session.is_admitted = true;
            session.heard = now;
            self.board.say(seat, "OK KEY");
        } else {
            session.progress = Progress::Closing;
        }
        admitted
    }

    /// Closes the connection of the stranger that has waited longest, so that a newcomer has its place. Returns false if there
    /// is no stranger.
    pub(super) fn make_room(&mut self) -> bool {
        let Some((_, seat)) = self.guard.strangers.pop_first() else {
            return false;
        };
        if let Some(session) = &mut self.sessions[seat] {
            session.progress = Progress::Closing;
        }
        self.refuse(
            seat,
            &Code::Limit.because(
                "the dispatcher is full, and this client has not stated the key; connect again",
            ),
        );
        true
    }

    /// A client begins without the key: closes the connection.
    pub(super) fn refuse_stranger(&mut self, seat: usize) -> Refusal {
        if let Some(session) = &mut self.sessions[seat] {
            session.progress = Progress::Closing;
        }
        Code::IdentifyFirst.because("this laboratory has a key; the first line is KEY and the key")
    }
}
