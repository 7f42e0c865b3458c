//! One connection, without I/O: time and received bytes go in, bytes to send and the next deadline come out.

use tickbus_base::time::{Nanos, Pace};

use super::{EndReason, Partial, Records};

/// A connection is given up after this many times `max_age` without a record.
const SILENCE: i64 = 4;

/// A record is sent at least this many times within `max_age`, changed or not.
const SIGNS_OF_LIFE: i64 = 3;

/// When a record is sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sending {
    /// At every cycle.
    #[default]
    Cyclic,
    /// When the image has changed, checked at every cycle; and as a sign of life.
    OnChange,
    /// In reply to each received record.
    Reply,
}

/// The parameters of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionParameters {
    /// When a record is sent.
    pub sending: Sending,
    /// Time between two records, or between two checks for a change. Positive.
    pub cycle: Nanos,
    /// On change: the shortest time between two records.
    pub min_interval: Nanos,
    /// Data older than this are stale. Positive.
    pub max_age: Nanos,
    /// Size of an incoming record, in bytes; 0 if none come in.
    pub receives: usize,
    /// Size of an outgoing record, in bytes; 0 if none go out.
    pub sends: usize,
}

/// One connection, from its beginning to its end.
///
/// Whenever the owner of the socket wakes up, it reads into [`space`](Self::space) and reports that by
/// [`arrived`](Self::arrived), takes all records by [`take`](Self::take), fills the buffer that [`due`](Self::due)
/// returns and reports that by [`made`](Self::made), writes [`to_write`](Self::to_write) and reports how much the
/// system accepted by [`wrote`](Self::wrote), and calls [`check`](Self::check) to see whether the connection may
/// continue; then it waits for the socket until [`deadline`](Self::deadline). Time-outs are checked last, after
/// everything that had already arrived: if this process was held up, the peer is not to blame.
#[derive(Debug)]
pub struct Session {
    terms: SessionParameters,
    began: Nanos,
    inbox: Inbox,
    outbox: Outbox,
    /// When records, or checks for a change, are due.
    pace: Pace,
    /// Received records that have not been answered.
    owed: u64,
    skipped: u64,
    /// When the connection last passed the check.
    checked: Nanos,
}

#[derive(Debug)]
struct Inbox {
    records: Records,
    /// When the last whole record arrived.
    heard: Option<Nanos>,
    /// When the incomplete record began to arrive.
    incomplete_since: Option<Nanos>,
}

/// One outgoing record.
#[derive(Debug)]
struct Outbox {
    record: Box<[u8]>,
    /// The number of bytes of the record that the system has accepted.
    written: usize,
    /// The time since which the record has been waiting to be accepted completely; `None` if there is nothing to send.
    waiting_since: Option<Nanos>,
    /// When the last record was made.
    made: Option<Nanos>,
    /// The last record that the system accepted completely, for comparison.
    last: Box<[u8]>,
}

impl Session {
    /// A connection established at `now`.
    pub fn new(terms: SessionParameters, now: Nanos) -> Self {
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

    /// How long a connection without records is kept.
    pub fn patience(max_age: Nanos) -> Nanos {
        max_age.times(SILENCE)
    }

    /// The space for the next bytes from the peer; never empty once all records have been taken.
    pub fn space(&mut self) -> &mut [u8] {
        self.inbox.records.space()
    }

    /// `count` bytes arrived at `now`, and are at the beginning of [`space`](Self::space).
    ///
    /// # Panics
    ///
    /// When there was not that much space.
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

    /// The peer's next whole record.
    pub fn take(&mut self) -> Option<&[u8]> {
        let record = self.inbox.records.take()?;
        self.owed = self.owed.saturating_add(1);
        Some(record)
    }

    /// The buffer for the image, if a record is due at `now`; [`made`](Self::made) must follow.
    ///
    /// While the system has accepted only a part of a record, no other one is made; if it has accepted
    /// nothing of it, the newer one replaces it.
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

    /// When the next record, or the next check for a change, is due.
    fn next_send(&self) -> Nanos {
        match (self.terms.sending, self.outbox.made) {
            // A waiting record will be the sign of life, once the peer accepts it.
            (Sending::OnChange, Some(made)) if self.outbox.waiting_since.is_none() => {
                self.pace.due().min(made + self.sign_of_life())
            }
            _ => self.pace.due(),
        }
    }

    fn sign_of_life(&self) -> Nanos {
        Nanos((self.terms.max_age.0 / SIGNS_OF_LIFE).max(1))
    }

    /// The buffer from [`due`](Self::due) has the image for `now`. When sending on change, calls `differs` to compare
    /// it with the last record sent. Returns whether the record is to be sent.
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

    /// The record last [made](Self::made) is lost on purpose: it counts as sent, but the peer never gets it.
    pub fn lost(&mut self) {
        if self.withdraw() && !self.outbox.last.is_empty() {
            self.outbox.last.copy_from_slice(&self.outbox.record);
        }
    }

    /// The record last [made](Self::made) is not sent after all; returns true if there was one, and none of it was
    /// written.
    pub fn withdraw(&mut self) -> bool {
        let outbox = &mut self.outbox;
        outbox.written == 0 && outbox.waiting_since.take().is_some()
    }

    /// The bytes to be written, if any.
    pub fn to_write(&self) -> &[u8] {
        match self.outbox.waiting_since {
            Some(_) => &self.outbox.record[self.outbox.written..],
            None => &[],
        }
    }

    /// Returns true if the system has accepted a part of the record, and not all of it.
    pub fn is_within_record(&self) -> bool {
        self.outbox.written > 0
    }

    /// The system accepted `count` bytes of [`to_write`](Self::to_write); returns whether that completed a
    /// record.
    ///
    /// # Panics
    ///
    /// When there were fewer bytes to write.
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

    /// A fault of the line holds back the rest of the record at `now`: the time that the peer has to read it starts
    /// again.
    pub fn held_back(&mut self, now: Nanos) {
        if let Some(since) = &mut self.outbox.waiting_since {
            *since = now;
        }
    }

    /// Checks that the connection may continue at `now`.
    ///
    /// # Errors
    ///
    /// The peer leaves a record incomplete, does not read, or is silent for too long.
    pub fn check(&mut self, now: Nanos) -> Result<(), EndReason> {
        let SessionParameters {
            max_age,
            receives,
            sends,
            ..
        } = self.terms;
        let partial = self.inbox.records.partial();
        if receives == 0 && partial.is_some() {
            return Err(EndReason::Unasked);
        }
        let over = |since: Option<Nanos>| since.is_some_and(|since| now - since > max_age);
        if let (Some(partial), true) = (partial, over(self.inbox.incomplete_since)) {
            return Err(EndReason::Incomplete(partial, max_age));
        }
        if over(self.outbox.waiting_since) {
            let have = self.outbox.written;
            return Err(EndReason::NotReading(Partial { have, of: sends }, max_age));
        }
        if receives > 0 && self.silence(now) > Self::patience(max_age) {
            return Err(EndReason::Silent(Self::patience(max_age)));
        }
        self.checked = now;
        Ok(())
    }

    /// The received part of an incomplete record.
    pub fn partial(&self) -> Option<Partial> {
        self.inbox.records.partial()
    }

    /// Why the connection ends, now that the peer has closed it.
    pub fn left(&self) -> EndReason {
        match self.inbox.records.partial() {
            Some(_) if self.terms.receives == 0 => EndReason::Unasked,
            Some(partial) => EndReason::LeftWithin(partial),
            None if self.terms.receives > 0 && self.inbox.heard.is_none() => EndReason::LeftAtOnce,
            None => EndReason::Left,
        }
    }

    /// How long the owner of the socket may wait if nothing arrives and nothing can be written.
    pub fn deadline(&self) -> Nanos {
        let SessionParameters {
            max_age,
            receives,
            sends,
            sending,
            ..
        } = self.terms;
        let mut deadline = Nanos::MAX;
        if sends > 0 {
            deadline = match sending {
                // Records may have been taken since the last check for an answer to send.
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
            // The line becomes stale first, and is given up later.
            let heard = self.inbox.heard.unwrap_or(self.began);
            let stale = heard + max_age + Nanos(1);
            let given_up = heard + Self::patience(max_age) + Nanos(1);
            deadline = deadline.min(if self.checked < stale {
                stale
            } else {
                given_up
            });
        } else {
            // No records come in, so the connection itself must be checked regularly.
            deadline = deadline.min(self.checked + self.sign_of_life());
        }
        deadline
    }

    /// How long the peer has been silent. A peer with nothing to send is never silent.
    pub fn silence(&self, now: Nanos) -> Nanos {
        if self.terms.receives == 0 {
            return Nanos::ZERO;
        }
        now - self.inbox.heard.unwrap_or(self.began)
    }

    /// True if the peer has been silent for longer than `max_age`, so that its data are stale.
    pub fn is_stale(&self, now: Nanos) -> bool {
        self.silence(now) > self.terms.max_age
    }

    /// True if a whole record has arrived; always true for a peer with nothing to send.
    pub fn has_heard(&self) -> bool {
        self.terms.receives == 0 || self.inbox.heard.is_some()
    }

    /// Cycles skipped because the system had not accepted an earlier record completely.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests;
