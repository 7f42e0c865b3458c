//! The streams of letters between two dispatchers: missing letters are noticed, and silent dispatchers cut off.

use std::collections::VecDeque;

use tickbus_base::time::Nanos;

use crate::host::HostId;

use super::message::{Body, Letter};

/// How often a dispatcher gives a sign of life.
pub(crate) const BEAT: Nanos = Nanos::from_secs(1);

/// A dispatcher that has been silent for this long is cut off.
pub(crate) const SILENCE: Nanos = Nanos::from_secs(5);

/// The most letters kept for a network that does not accept them.
const LONGEST_QUEUE: usize = 10_000;

/// The two streams between this dispatcher and another one.
#[derive(Debug)]
pub(crate) struct Link {
    /// The number of the stream to the other dispatcher, and of the next letter in that stream.
    stream: u64,
    next: u64,
    /// Letters to the other dispatcher that the network has not accepted yet.
    queue: VecDeque<Body>,
    /// True if there is a stream to the other dispatcher. Nothing is kept for a dispatcher that is cut off.
    pub(crate) is_open: bool,
    began: Nanos,
    /// The stream from the other dispatcher, and the number of the next letter expected.
    followed: Option<(u64, u64)>,
    heard: Nanos,
}

/// The meaning of a letter for the link.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Taken {
    /// The letter is the next one, to be processed.
    Next(Body),
    /// The letter is only a sign of life, or too late to be of use.
    Nothing,
    /// Letters before this one are missing; the other side has been informed.
    Missing,
    /// The other side misses letters: begin a new stream.
    Restart,
}

impl Link {
    /// A link to a dispatcher that has just appeared; there is no stream yet.
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
            // A snapshot will be shorter: the next sign of life from the other side triggers one.
            self.is_open = false;
            self.queue.clear();
        }
        if self.is_open {
            self.queue.push_back(body);
        }
    }

    /// Sends a sign of life, even to a dispatcher that is cut off.
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

    /// Checks whether letters before this one are missing.
    fn check(&mut self, place: (u64, u64)) -> Taken {
        match self.followed {
            // A late letter, or a duplicate.
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
