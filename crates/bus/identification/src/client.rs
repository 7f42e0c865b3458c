//! The client: one command at a time, without I/O.

use tickbus_base::time::Nanos;

use crate::answer::{Fit, Shape};
use crate::{Answer, CarrierType, Command};

/// The most bytes kept of unrequested input.
const INBOX: usize = 1024;

/// The outcome of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// An answer; [`Client::data`] has its data. The command has then ended, unless it is for all heads, or is
    /// repeated.
    Answered(Answer),
    /// The command for all heads has ended: no more answers have come.
    Over,
    /// No answer has come in time.
    Silent,
}

/// Timing of a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Bits per second; a character has ten.
    pub baud: u32,
    /// The reader's time for an answer, in addition to the time of its characters.
    pub timeout: Nanos,
}

impl Timing {
    /// The time of this many characters.
    pub fn characters(&self, count: usize) -> Nanos {
        let bits = i64::try_from(count).unwrap_or(i64::MAX).saturating_mul(10);
        Nanos(bits.saturating_mul(1_000_000_000) / i64::from(self.baud.max(1)))
    }

    /// The silence that ends data of unknown length, and after which the next byte begins a command: that of five
    /// characters, and at least 100 ms, for which a busy computer may hold bytes back.
    pub fn silence(&self) -> Nanos {
        self.characters(5).max(Nanos::from_millis(100))
    }

    /// The time-out, or the silence if that is longer: after noise, a reader does not understand a client that retries
    /// sooner.
    pub fn patience(&self) -> Nanos {
        self.timeout.max(self.silence())
    }
}

/// The command that was sent last.
#[derive(Clone, Copy, Debug)]
struct Asked {
    shape: Shape,
    /// The deadline for the answer.
    limit: Nanos,
    /// A head has answered a command for all heads.
    is_answered: bool,
    ends_auto: bool,
}

/// The client's end of a line: commands and received bytes go in, bytes to send and [`Outcome`]s come out.
///
/// The client skips bytes that are no answer to its command one by one, so that it finds the next valid answer after
/// noise.
#[derive(Debug)]
pub struct Client {
    carriers: CarrierType,
    timing: Timing,
    asked: Option<Asked>,
    /// The repeated command, if any.
    auto: Option<Shape>,
    request: Vec<u8>,
    written: usize,
    inbox: Vec<u8>,
    /// When the last byte arrived.
    heard: Nanos,
    data: Vec<u8>,
    skipped: u64,
}

impl Client {
    /// A client for a reader of these carriers. (A separate command sets the reader.)
    pub fn new(carriers: CarrierType, timing: Timing) -> Self {
        Self {
            carriers,
            timing,
            asked: None,
            auto: None,
            request: Vec::new(),
            written: 0,
            inbox: Vec::new(),
            heard: Nanos(0),
            data: Vec::new(),
            skipped: 0,
        }
    }

    /// True while a command waits for its answer.
    pub const fn is_busy(&self) -> bool {
        self.asked.is_some()
    }

    /// Begins a command at `now`. A repeated command replaces the previous one, and ends with
    /// [`EndAuto`](Command::EndAuto).
    ///
    /// # Panics
    ///
    /// When a command [is pending](Self::is_busy), or this one cannot be [appended](Command::append).
    pub fn ask(&mut self, now: Nanos, command: &Command<'_>) {
        assert!(self.asked.is_none(), "one command at a time");
        let shape = Shape::of(command);
        self.request.clear();
        self.written = 0;
        command.append(self.carriers.family(), &mut self.request);
        let characters =
            self.request.len() + shape.longest() * if shape.has_many() { 4 } else { 1 };
        let limit = now + self.timing.patience() + self.timing.characters(characters);
        self.asked = Some(Asked {
            shape,
            limit,
            is_answered: false,
            ends_auto: *command == Command::EndAuto,
        });
        if let Command::Access { is_auto: true, .. } = command {
            self.auto = Some(shape);
        }
    }

    /// The bytes to send.
    pub fn to_write(&self) -> &[u8] {
        &self.request[self.written..]
    }

    /// The first `count` bytes of [these](Self::to_write) were sent.
    pub fn wrote(&mut self, count: usize) {
        self.written += count;
    }

    /// Bytes arrived.
    pub fn hear(&mut self, now: Nanos, bytes: &[u8]) {
        self.heard = now;
        self.inbox.extend_from_slice(bytes);
        let old = self.inbox.len().saturating_sub(INBOX);
        self.skip(old);
    }

    /// The next outcome at `now`, if any; call it until it returns `None`.
    pub fn poll(&mut self, now: Nanos) -> Option<Outcome> {
        let is_silent = now - self.heard >= self.timing.silence();
        if let Some(answer) = self.find(is_silent) {
            return Some(Outcome::Answered(answer));
        }
        let Some(asked) = self.asked else {
            // The beginning of a repeated answer, without its end.
            if is_silent && !self.inbox.is_empty() {
                let rest = self.inbox.len();
                self.skip(rest);
            }
            return None;
        };
        if asked.is_answered && (is_silent || now >= asked.limit) {
            self.asked = None;
            return Some(Outcome::Over);
        }
        if now < asked.limit {
            return None;
        }
        // False start: these bytes are no answer, but one may follow.
        while !self.inbox.is_empty() {
            self.skip(1);
            if let Some(answer) = self.find(true) {
                return Some(Outcome::Answered(answer));
            }
        }
        self.asked = None;
        Some(Outcome::Silent)
    }

    /// How long to wait for bytes, if there is nothing to send; [`Nanos::MAX`] for ever.
    pub fn deadline(&self) -> Nanos {
        let silent = self.heard + self.timing.silence();
        match &self.asked {
            // Only silence ends these.
            Some(asked)
                if asked.is_answered || asked.shape.ends_by_silence() && !self.inbox.is_empty() =>
            {
                asked.limit.min(silent)
            }
            Some(asked) => asked.limit,
            None if self.inbox.is_empty() => Nanos::MAX,
            None => silent,
        }
    }

    /// The data of the last answer.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The number of bytes that belonged to no answer.
    pub const fn skipped(&self) -> u64 {
        self.skipped
    }

    fn skip(&mut self, count: usize) {
        self.inbox.drain(..count);
        self.skipped += count as u64;
    }

    /// Takes the first answer out of the inbox, and skips the bytes before it.
    fn find(&mut self, is_silent: bool) -> Option<Answer> {
        let asked = self.asked.map(|asked| asked.shape);
        let shapes = [asked, self.auto].into_iter().flatten();
        let mut at = 0;
        let found = loop {
            if at == self.inbox.len() {
                break None;
            }
            let rest = &self.inbox[at..];
            let mut fits = shapes
                .clone()
                .map(|shape| (shape, shape.fit(rest, is_silent)));
            match fits.find(|(_, fit)| *fit != Fit::No) {
                None => at += 1,
                Some((
                    _,
                    Fit::Whole {
                        answer,
                        length,
                        data,
                    },
                )) => {
                    self.data.clear();
                    self.data
                        .extend_from_slice(&rest[data..data + answer.length]);
                    break Some((answer, length));
                }
                Some(_) => break None,
            }
        };
        self.skip(at);
        let (answer, length) = found?;
        self.inbox.drain(..length);
        if let Some(asked) = &mut self.asked
            && asked.shape.is_of(answer.command)
        {
            asked.is_answered = true;
            if asked.ends_auto {
                self.auto = None;
            }
            if !asked.shape.has_many() || answer.head.is_none() {
                self.asked = None;
            }
        }
        Some(answer)
    }
}

#[cfg(test)]
mod tests;
