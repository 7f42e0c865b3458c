//! One connection, as a core without I/O: time and bytes are handed in, bytes and the next deadline
//! come out.

use tickbus_base::time::{Nanos, Pace};

use super::{Fault, Partial, Records};

/// After so many times `max_age` without a record a connection is given up.
const SILENCE: i64 = 4;

/// So many times within `max_age` a record goes out, changed or not.
const SIGNS_OF_LIFE: i64 = 3;

/// When a record goes out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sending {
    /// At every cycle.
    #[default]
    Cyclic,
    /// When the image has changed, looked at every cycle; and as a sign of life.
    OnChange,
    /// One for each record that comes in.
    Reply,
}

/// What both ends of a connection, or this one, have agreed upon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terms {
    /// When a record goes out.
    pub sending: Sending,
    /// Time between two records, or between two looks for a change. Positive.
    pub cycle: Nanos,
    /// On change: the least time between two records.
    pub min_interval: Nanos,
    /// Data older than this are stale. Positive.
    pub max_age: Nanos,
    /// Size of a record that comes in, in bytes; 0 when none do.
    pub receives: usize,
    /// Size of a record that goes out, in bytes; 0 when none do.
    pub sends: usize,
}

/// One connection, from its first moment to its end.
///
/// The owner of the socket, whenever it wakes: reads into [`space`](Self::space) and says so by
/// [`arrived`](Self::arrived), takes all records by [`take`](Self::take), fills what
/// [`due`](Self::due) gives and says so by [`made`](Self::made), writes [`to_write`](Self::to_write) and
/// says how much the system took by [`wrote`](Self::wrote), and asks [`check`](Self::check) whether
/// the connection may go on; then it waits for the socket until [`deadline`](Self::deadline). The clock is
/// judged last, after all that had already come: a process that was held up blames nobody else for it.
#[derive(Debug)]
pub struct Session {
    terms: Terms,
    began: Nanos,
    inbox: Inbox,
    outbox: Outbox,
    /// When records are due, or looks for a change.
    pace: Pace,
    /// Records that came in and are not yet answered.
    owed: u64,
    skipped: u64,
    /// When the connection was last found in order.
    checked: Nanos,
}

#[derive(Debug)]
struct Inbox {
    records: Records,
    /// When the last whole record came.
    heard: Option<Nanos>,
    /// When the record that is not whole yet was begun.
    incomplete_since: Option<Nanos>,
}

/// One record on its way out.
#[derive(Debug)]
struct Outbox {
    record: Box<[u8]>,
    /// How much of it the system has taken.
    written: usize,
    /// Since when it has waited to be taken whole; `None` when there is nothing to send.
    waiting_since: Option<Nanos>,
    /// When the last record was made.
    made: Option<Nanos>,
    /// The last record that the system took whole, for comparison.
    last: Box<[u8]>,
}

impl Session {
    /// A connection that stands since `now`.
    pub fn new(terms: Terms, now: Nanos) -> Self {
        let compared = match terms.sending {
            Sending::OnChange => terms.sends,
            Sending::Cyclic | Sending::Reply => 0,
        };
        Self {
            terms,
            began: now,
            inbox: Inbox {
                records: Records::new(terms.receives),
                heard: None,
                incomplete_since: None,
            },
            outbox: Outbox {
                record: vec![0; terms.sends].into(),
                written: 0,
                waiting_since: None,
                made: None,
                last: vec![0; compared].into(),
            },
            pace: Pace::new(now, terms.cycle),
            owed: 0,
            skipped: 0,
            checked: now,
        }
    }

    /// After how long without a record a connection is given up.
    pub fn patience(max_age: Nanos) -> Nanos {
        max_age.times(SILENCE)
    }

    /// Where the next bytes from the peer go; never empty when all records were taken.
    pub fn space(&mut self) -> &mut [u8] {
        self.inbox.records.space()
    }

    /// So many bytes came, at `now`, and stand at the beginning of [`space`](Self::space).
    ///
    /// # Panics
    ///
    /// When there was no space for as many.
    pub fn arrived(&mut self, now: Nanos, count: usize) {
        if count == 0 {
            return;
        }
        let Inbox {
            records,
            heard,
            incomplete_since,
        } = &mut self.inbox;
        let size = self.terms.receives;
        let before = records.waiting();
        records.arrived(count);
        if size == 0 {
            return;
        }
        let all = before + count;
        if all >= size {
            *heard = Some(now);
            *incomplete_since = None;
        }
        if !all.is_multiple_of(size) {
            incomplete_since.get_or_insert(now);
        }
    }

    /// The next whole record of the peer.
    pub fn take(&mut self) -> Option<&[u8]> {
        let record = self.inbox.records.take()?;
        self.owed = self.owed.saturating_add(1);
        Some(record)
    }

    /// Where to put the image, if a record is to be made at `now`; [`made`](Self::made) has to follow.
    ///
    /// While the system has not taken the whole of a record there is none to be made, or, if it has not
    /// even taken a part, the newer one takes its place.
    pub fn due(&mut self, now: Nanos) -> Option<&mut [u8]> {
        if self.terms.sends == 0 {
            return None;
        }
        let waiting = self.outbox.waiting_since.is_some();
        if self.terms.sending == Sending::Reply {
            if waiting || self.owed == 0 {
                return None;
            }
            self.owed -= 1;
        } else {
            if now < self.next_send() {
                return None;
            }
            self.pace.take(now);
            self.skipped += u64::from(waiting);
            if self.outbox.written > 0 {
                return None;
            }
        }
        Some(&mut self.outbox.record)
    }

    /// When a record is due next, or a look for a change.
    fn next_send(&self) -> Nanos {
        match (self.terms.sending, self.outbox.made) {
            // A record that waits is the sign of life, once the peer takes it.
            (Sending::OnChange, Some(made)) if self.outbox.waiting_since.is_none() => {
                self.pace.due().min(made + self.sign_of_life())
            }
            _ => self.pace.due(),
        }
    }

    fn sign_of_life(&self) -> Nanos {
        Nanos((self.terms.max_age.0 / SIGNS_OF_LIFE).max(1))
    }

    /// The image of `now` stands where [`due`](Self::due) wanted it. When changes decide, `differs` is
    /// asked to compare the record that went out last with it. True if the record is to go out.
    pub fn made(&mut self, now: Nanos, differs: impl FnOnce(&[u8], &[u8]) -> bool) -> bool {
        let life = self.sign_of_life();
        let outbox = &mut self.outbox;
        let goes = match (self.terms.sending, outbox.waiting_since, outbox.made) {
            (Sending::OnChange, None, Some(made)) => {
                now - made >= life
                    || (now - made >= self.terms.min_interval
                        && differs(&outbox.last, &outbox.record))
            }
            _ => true,
        };
        if goes {
            outbox.waiting_since.get_or_insert(now);
            outbox.made = Some(now);
        }
        goes
    }

    /// The record that was [made](Self::made) last gets lost on the way: it counts as sent, and the peer never has it.
    pub fn lost(&mut self) {
        let outbox = &mut self.outbox;
        if outbox.written == 0 && outbox.waiting_since.take().is_some() && !outbox.last.is_empty() {
            outbox.last.copy_from_slice(&outbox.record);
        }
    }

    /// What is to be written; empty when there is nothing to send.
    pub fn to_write(&self) -> &[u8] {
        match self.outbox.waiting_since {
            Some(_) => &self.outbox.record[self.outbox.written..],
            None => &[],
        }
    }

    /// The system took so many bytes of [`to_write`](Self::to_write); true when that was the rest of a
    /// record.
    ///
    /// # Panics
    ///
    /// When there were not as many.
    pub fn wrote(&mut self, count: usize) -> bool {
        let rest = self.to_write().len();
        assert!(count <= rest, "{count} bytes were taken of {rest}");
        let whole = rest > 0 && count == rest;
        let outbox = &mut self.outbox;
        if whole {
            outbox.written = 0;
            outbox.waiting_since = None;
            let compared = outbox.last.len();
            outbox.last.copy_from_slice(&outbox.record[..compared]);
        } else {
            outbox.written += count;
        }
        whole
    }

    /// Whether the connection may go on at `now`.
    ///
    /// # Errors
    ///
    /// The peer leaves a record incomplete, does not read, or says nothing, for too long.
    pub fn check(&mut self, now: Nanos) -> Result<(), Fault> {
        let Terms {
            max_age,
            receives,
            sends,
            ..
        } = self.terms;
        let partial = self.inbox.records.partial();
        if receives == 0 && partial.is_some() {
            return Err(Fault::Unasked);
        }
        let over = |since: Option<Nanos>| since.is_some_and(|since| now - since > max_age);
        if let (Some(partial), true) = (partial, over(self.inbox.incomplete_since)) {
            return Err(Fault::Incomplete(partial, max_age));
        }
        if over(self.outbox.waiting_since) {
            let have = self.outbox.written;
            return Err(Fault::NotReading(Partial { have, of: sends }, max_age));
        }
        if receives > 0 && self.silence(now) > Self::patience(max_age) {
            return Err(Fault::Silent(Self::patience(max_age)));
        }
        self.checked = now;
        Ok(())
    }

    /// How much has come of a record that is not whole yet.
    pub fn partial(&self) -> Option<Partial> {
        self.inbox.records.partial()
    }

    /// Why the connection ends, now that the peer has closed it.
    pub fn left(&self) -> Fault {
        match self.inbox.records.partial() {
            Some(_) if self.terms.receives == 0 => Fault::Unasked,
            Some(partial) => Fault::LeftWithin(partial),
            None if self.terms.receives > 0 && self.inbox.heard.is_none() => Fault::LeftAtOnce,
            None => Fault::Left,
        }
    }

    /// Until when the owner of the socket may wait, if nothing comes and nothing can be written.
    pub fn deadline(&self) -> Nanos {
        let Terms {
            max_age,
            receives,
            sends,
            sending,
            ..
        } = self.terms;
        let mut deadline = Nanos::MAX;
        if sends > 0 {
            deadline = match sending {
                // Records may have been taken after the last look for an answer to send.
                Sending::Reply if self.owed > 0 && self.outbox.waiting_since.is_none() => {
                    return self.checked;
                }
                Sending::Reply => Nanos::MAX,
                Sending::Cyclic | Sending::OnChange => self.next_send(),
            };
        }
        let limits = [self.inbox.incomplete_since, self.outbox.waiting_since];
        for since in limits.into_iter().flatten() {
            deadline = deadline.min(since + max_age + Nanos(1));
        }
        if receives > 0 {
            // First the line becomes stale, then it is given up.
            let heard = self.inbox.heard.unwrap_or(self.began);
            let stale = heard + max_age + Nanos(1);
            let given_up = heard + Self::patience(max_age) + Nanos(1);
            deadline = deadline.min(if self.checked < stale {
                stale
            } else {
                given_up
            });
        } else {
            // Nothing comes, so that the connection stands has to be looked at again and again.
            deadline = deadline.min(self.checked + self.sign_of_life());
        }
        deadline
    }

    /// For how long nothing has been heard of the peer. One that has nothing to say is never silent.
    pub fn silence(&self, now: Nanos) -> Nanos {
        if self.terms.receives == 0 {
            return Nanos::ZERO;
        }
        now - self.inbox.heard.unwrap_or(self.began)
    }

    /// Whether the peer has been silent for so long that its data are stale.
    pub fn is_stale(&self, now: Nanos) -> bool {
        self.silence(now) > self.terms.max_age
    }

    /// Whether a whole record has come yet; a peer that has nothing to say has said it.
    pub fn has_heard(&self) -> bool {
        self.terms.receives == 0 || self.inbox.heard.is_some()
    }

    /// Cycles at which the system had not yet taken the whole record of an earlier one.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests;
