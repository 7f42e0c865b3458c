//! Clients that are silent for too long, and clients whose lines have waited for too long.

use tickbus_base::time::Nanos;

use super::guard::PATIENCE;
use super::{Code, Dispatcher, Progress};
use crate::board::OnLoss;

impl Dispatcher {
    /// Call when a thread that serves has waited, before it reads what has arrived.
    ///
    /// If the thread was held up for longer than a client's `ALIVE` time, that client's lines may have waited as long.
    /// Such lines are no sign of life: the client's outputs are cut off before the lines are read, and restored by its
    /// first line after [`tick`](Self::tick).
    pub fn woke(&mut self, now: Nanos) {
        let late = now - self.next_look;
        // With `Hold`, inputs would not learn of the loss, and would keep even older values.
        if late <= self.promise || self.settings.on_loss == OnLoss::Hold {
            return;
        }
        self.is_catching_up = true;
        for seat in 0..self.sessions.len() {
            let Some(session) = &mut self.sessions[seat] else {
                continue;
            };
            let is_overdue = session.alive.is_some_and(|alive| late > alive);
            if is_overdue && session.progress != Progress::Closing && !session.is_silent {
                session.is_silent = true;
                self.board.fall_silent(seat);
            }
        }
    }

    /// Continues with clients that had to wait, and disconnects those that have been silent for too long.
    pub fn tick(&mut self, now: Nanos) {
        for seat in std::mem::take(&mut self.resumable) {
            if let Some(session) = &mut self.sessions[seat] {
                // The dispatcher read nothing from it, so its silence does not count.
                session.heard = now;
                let due = session.alive.map_or(Nanos::MAX, |alive| now + alive);
                self.next_look = self.next_look.min(due);
            }
            self.arrived(now, seat, &[]);
        }
        self.is_catching_up = false;
        self.beat(now);
        if now < self.next_look {
            return;
        }
        // If this process was held up, clients may have sent lines that were not read yet.
        let is_late = now - self.next_look > Nanos(self.promise.0 / 2);
        let (mut first, mut promise) = (Nanos::MAX, Nanos::MAX);
        for seat in 0..self.sessions.len() {
            let idle = self.patience(seat);
            let Some(session) = self.sessions[seat]
                .as_mut()
                .filter(|it| it.progress != Progress::Closing)
            else {
                continue;
            };
            if now - session.heard >= idle {
                session.progress = Progress::Closing;
                let refusal = if session.is_admitted {
                    Code::TimeOut.because(format_args!(
                        "nothing was heard for {idle}; send PING when there is nothing else to send"
                    ))
                } else {
                    Code::TimeOut.because(format_args!(
                        "no key came within {idle}; the first line is KEY and the key"
                    ))
                };
                self.refuse(seat, &refusal);
                continue;
            }
            first = first.min(session.heard + idle);
            let Some(alive) = session.alive else {
                continue;
            };
            promise = promise.min(alive);
            if session.is_silent {
                continue;
            }
            let due = session.heard + alive;
            if now < due || is_late {
                first = first.min(due);
            } else if self.is_owed_answer(seat) {
                // The dispatcher does not read this client's lines. Once it does, the client has its full time again.
                first = first.min(now + alive);
            } else if let Some(session) = &mut self.sessions[seat] {
                session.is_silent = true;
                self.board.fall_silent(seat);
            }
        }
        self.promise = promise;
        // With many clients one is always due soon; check them together.
        let soonest = now + Nanos((self.settings.idle.0 / 600).min(promise.0 / 10));
        self.next_look = first.max(soonest);
        if first == Nanos::MAX {
            self.next_look = Nanos::MAX;
        }
    }

    /// How long a client may send no line.
    pub(super) fn patience(&self, seat: usize) -> Nanos {
        let idle = self.settings.idle;
        let is_stranger = self.session(seat).is_some_and(|it| !it.is_admitted);
        if is_stranger {
            idle.min(PATIENCE)
        } else {
            idle
        }
    }

    /// If a client was silent, its outputs have values again.
    pub(super) fn speak_again(&mut self, now: Nanos, seat: usize) {
        let Some(session) = &mut self.sessions[seat] else {
            return;
        };
        if !self.is_catching_up && std::mem::take(&mut session.is_silent) {
            self.next_look = self
                .next_look
                .min(now + session.alive.unwrap_or(Nanos::MAX));
            self.board.speak_again(seat);
        }
    }
}
