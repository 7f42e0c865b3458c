//! The streams of letters between two dispatchers: what is missing is noticed, and who is silent is gone.

use std::collections::VecDeque;

use tickbus_base::time::Nanos;

use crate::host::HostId;

use super::message::{Body, Letter};

/// How often a dispatcher gives a sign of life.
pub(crate) const BEAT: Nanos = Nanos::from_secs(1);

/// A dispatcher that nothing was heard of for this long is cut off.
pub(crate) const SILENCE: Nanos = Nanos::from_secs(5);

/// The most letters kept for a network that does not take them.
const LONGEST_QUEUE: usize = 10_000;

/// The two streams between this dispatcher and another one.
#[derive(Debug)]
pub(crate) struct Link {
    /// The number of the stream to it, and of the next letter in that.
    stream: u64,
    next: u64,
    /// Letters to it that the network has not taken yet.
    queue: VecDeque<Body>,
    /// Whether there is a stream to it. Nothing is kept for who is cut off.
    pub(crate) is_open: bool,
    began: Nanos,
    /// The stream from it that is followed, and the next letter expected.
    followed: Option<(u64, u64)>,
    heard: Nanos,
}

/// What a letter means for the link.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Taken {
    /// It comes next, and is to be worked on.
    Next(Body),
    /// It only said that the dispatcher lives, or is of no use any more.
    Nothing,
    /// Letters are missing before it; that was said to the other side.
    Missing,
    /// The other side misses letters: begin a new stream.
    Restart,
}

impl Link {
    /// To a dispatcher that has just appeared; there is no stream yet.
    pub(crate) fn new(now: Nanos) -> Self {
        Self {
            stream: 0,
            next: 0,
            queue: VecDeque::new(),
            is_open: false,
            began: now,
            followed: None,
            heard: now,
        }
    }

    /// Begins stream number `stream`, with a higher number than all before: the first letter is to be a snapshot.
    pub(crate) fn open(&mut self, now: Nanos, stream: u64) {
        self.stream = stream;
        self.next = 0;
        self.queue.clear();
        self.is_open = true;
        self.began = now;
    }

    /// The other side is cut off.
    pub(crate) fn close(&mut self) {
        self.is_open = false;
        self.queue.clear();
        self.followed = None;
    }

    pub(crate) fn is_silent(&self, now: Nanos) -> bool {
        now - self.heard >= SILENCE
    }

    /// Adds a letter to the stream, if there is one.
    pub(crate) fn send(&mut self, body: Body) {
        if self.queue.len() >= LONGEST_QUEUE {
            // A snapshot will be shorter: the next sign of life from there brings it.
            self.is_open = false;
            self.queue.clear();
        }
        if self.is_open {
            self.queue.push_back(body);
        }
    }

    /// Gives a sign of life, to a dispatcher that is cut off as well.
    pub(crate) fn beat(&mut self) {
        let is_lost = self.followed.is_none();
        if !matches!(self.queue.back(), Some(Body::Beat { .. })) {
            self.queue.push_back(Body::Beat { is_lost });
        }
    }

    /// The next letter for the network.
    pub(crate) fn take(&mut self, from: HostId) -> Option<Letter> {
        let body = self.queue.pop_front()?;
        let number = self.next;
        if !matches!(body, Body::Beat { .. }) {
            self.next += 1;
        }
        Some(Letter {
            from,
            stream: self.stream,
            number,
            body,
        })
    }

    /// A letter has come.
    pub(crate) fn arrived(&mut self, now: Nanos, letter: Letter) -> Taken {
        self.heard = now;
        let place = (letter.stream, letter.number);
        if let Body::Beat { is_lost } = letter.body {
            if !self.is_open || is_lost && now - self.began >= BEAT {
                return Taken::Restart;
            }
            return self.check(place);
        }
        let newest = self.followed.map_or(0, |(stream, _)| stream);
        if matches!(letter.body, Body::Snapshot { .. }) && letter.number == 0 && place.0 > newest
            || self.followed == Some(place)
        {
            self.followed = Some((place.0, place.1 + 1));
            return Taken::Next(letter.body);
        }
        self.check(place)
    }

    /// Looks whether what comes next is this letter, or one behind it.
    fn check(&mut self, place: (u64, u64)) -> Taken {
        match self.followed {
            // What comes late, or twice.
            Some(next) if place <= next => Taken::Nothing,
            Some(_) => {
                self.followed = None;
                self.beat();
                Taken::Missing
            }
            None => Taken::Nothing,
        }
    }
}
