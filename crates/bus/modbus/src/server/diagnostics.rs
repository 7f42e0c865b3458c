//! The counters and the event log of a unit, which functions 8, 11 and 12 read: as the Modbus Application Protocol V1.1b3
//! defines them, and the counters as Appendix A of Modbus over Serial Line V1.02 does.

use std::collections::VecDeque;

use crate::function::EXCEPTION_BIT;
use crate::{Exception, Function};

/// The most events in the log.
const EVENTS: usize = 64;

/// A request arrived; with the bits for a broadcast, for a unit that only listens, for characters that were lost, and for a
/// damaged telegram.
const RECEIVED: u8 = 0x80;
const BROADCAST: u8 = 0x40;
const LISTENS: u8 = 0x20;
const OVERRUN: u8 = 0x10;
const DAMAGED: u8 = 0x02;

/// An answer was sent; with the bits for exceptions 1 to 3, exception 4, exceptions 5 and 6, and exception 7.
const SENT: u8 = 0x40;
const REFUSED: u8 = 0x01;
const FAILED: u8 = 0x02;
const BUSY: u8 = 0x04;
const NAK: u8 = 0x08;

/// The unit only listens from now on.
const SILENCED: u8 = 0x04;

/// Communication was restarted.
const RESTARTED: u8 = 0x00;

/// The sub-functions of function 8.
mod sub {
    pub(super) const ECHO: u16 = 0;
    pub(super) const RESTART: u16 = 1;
    pub(super) const REGISTER: u16 = 2;
    pub(super) const LISTEN_ONLY: u16 = 4;
    pub(super) const CLEAR: u16 = 10;
    /// The first of the counters, which follow each other in the order of [`Counter`](super::Counter).
    pub(super) const FIRST_COUNTER: u16 = 11;
    pub(super) const CLEAR_OVERRUNS: u16 = 20;
}

/// Restarting with this value also clears the event log.
const CLEARS_LOG: u16 = 0xFF00;

/// The counters, in the order of their sub-functions.
#[derive(Clone, Copy)]
enum Counter {
    /// Undamaged telegrams on the line, for any unit.
    BusMessages,
    /// Damaged telegrams.
    BusErrors,
    /// Exceptions of this unit, also those to broadcasts.
    Exceptions,
    /// Requests to this unit, and broadcasts.
    Messages,
    /// Requests without an answer.
    NoResponses,
    /// Exceptions 7.
    Naks,
    /// Exceptions 5 and 6.
    Busy,
    /// Telegrams that were longer than any can be.
    Overruns,
}

const COUNTERS: usize = Counter::Overruns as usize + 1;

/// The counters and the event log of a unit.
#[derive(Debug, Default)]
pub(super) struct Diagnostics {
    counters: [u16; COUNTERS],
    /// Requests that were carried out.
    events: u16,
    /// The last events, the latest first.
    log: VecDeque<u8>,
    /// True if the unit does nothing but wait for a restart.
    listens: bool,
}

impl Diagnostics {
    fn count(&mut self, counter: Counter) {
        let count = &mut self.counters[counter as usize];
        *count = count.wrapping_add(1);
    }

    fn note(&mut self, event: u8) {
        self.log.truncate(EVENTS - 1);
        let listens = if self.listens && event & (RECEIVED | SENT) != 0 {
            LISTENS
        } else {
            0
        };
        self.log.push_front(event | listens);
    }

    /// An undamaged telegram was on the line, for any unit.
    pub(super) fn heard(&mut self) {
        self.count(Counter::BusMessages);
    }

    /// A damaged telegram was on the line; with `is_overlong` longer than any can be.
    pub(super) fn damaged(&mut self, is_overlong: bool) {
        self.count(Counter::BusErrors);
        if is_overlong {
            self.count(Counter::Overruns);
        }
        let overrun = if is_overlong { OVERRUN } else { 0 };
        self.note(RECEIVED | DAMAGED | overrun);
    }

    /// A request for this unit arrived. Returns true if the unit carries it out.
    pub(super) fn begin(&mut self, pdu: &[u8], is_broadcast: bool) -> bool {
        self.note(RECEIVED | if is_broadcast { BROADCAST } else { 0 });
        self.count(Counter::Messages);
        // A restart that would be refused is not answered either.
        let restarts = matches!(pdu, &[code, high, low, 0 | 0xFF, 0]
            if code == Function::Diagnostics.code() && u16::from_be_bytes([high, low]) == sub::RESTART);
        let acts = !self.listens || restarts && !is_broadcast;
        if !acts {
            self.count(Counter::NoResponses);
        }
        acts
    }

    /// The request that [began](Self::begin) last was carried out or refused, and this is the answer's PDU; empty for none.
    /// What a broadcast would have got is not sent.
    pub(super) fn end(&mut self, pdu: &[u8], answer: &[u8], is_broadcast: bool) {
        let is_own = |wanted: u16| {
            let own = pdu.get(1..3);
            let own = own.map(|own| u16::from_be_bytes([own[0], own[1]]));
            pdu[0] == Function::Diagnostics.code() && own == Some(wanted)
        };
        let exception = match answer {
            [code, exception, ..] if code & EXCEPTION_BIT != 0 => *exception,
            _ => 0,
        };
        if exception != 0 {
            self.count(Counter::Exceptions);
        } else if pdu[0] != Function::CommEventCounter.code()
            && ![sub::RESTART, sub::CLEAR].into_iter().any(is_own)
        {
            self.events = self.events.wrapping_add(1);
        }
        if answer.is_empty() || is_broadcast {
            // A restart of a unit that listened has no answer, and belongs to no counter any more.
            if !is_own(sub::RESTART) {
                self.count(Counter::NoResponses);
            }
            return;
        }
        let bits = match exception {
            0 => 0,
            1..=3 => REFUSED,
            5 | 6 => BUSY,
            7 => NAK,
            _ => FAILED,
        };
        match exception {
            5 | 6 => self.count(Counter::Busy),
            7 => self.count(Counter::Naks),
            _ => {}
        }
        // A restart is the last event.
        if !is_own(sub::RESTART) {
            self.note(SENT | bits);
        }
    }

    /// Answers a request of function 8, 11 or 12, whose code is in `reply` already; `data` follows the code. A unit that
    /// only listens answers nothing, and takes the code back.
    ///
    /// # Errors
    ///
    /// The sub-function is unknown, or its data are not those that it has.
    pub(super) fn answer(
        &mut self,
        function: Function,
        data: &[u8],
        reply: &mut Vec<u8>,
    ) -> Result<(), Exception> {
        // A unit whose requests are carried out at once is never busy with one.
        const STATUS: u16 = 0;

        if function == Function::Diagnostics {
            return self.diagnose(data, reply);
        }
        if !data.is_empty() {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        }
        let log = if function == Function::CommEventLog {
            let bytes = u8::try_from(6 + self.log.len()).expect("the log is short");
            reply.push(bytes);
            Some(&self.log)
        } else {
            None
        };
        reply.extend_from_slice(&STATUS.to_be_bytes());
        reply.extend_from_slice(&self.events.to_be_bytes());
        if let Some(log) = log {
            let messages = self.counters[Counter::BusMessages as usize];
            reply.extend_from_slice(&messages.to_be_bytes());
            reply.extend(log);
        }
        Ok(())
    }

    fn diagnose(&mut self, data: &[u8], reply: &mut Vec<u8>) -> Result<(), Exception> {
        let Some(([high, low], values)) = data.split_first_chunk::<2>() else {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        };
        let code = u16::from_be_bytes([*high, *low]);
        let value = match values {
            [high, low] => Some(u16::from_be_bytes([*high, *low])),
            _ => None,
        };
        let zero = || match value {
            Some(0) => Ok(()),
            _ => Err(Exception::ILLEGAL_DATA_VALUE),
        };
        let counter = usize::from(code.wrapping_sub(sub::FIRST_COUNTER));
        let found = match code {
            sub::ECHO if !values.is_empty() && values.len().is_multiple_of(2) => None,
            sub::RESTART => {
                if !matches!(value, Some(0 | CLEARS_LOG)) {
                    return Err(Exception::ILLEGAL_DATA_VALUE);
                }
                if value == Some(CLEARS_LOG) {
                    self.log.clear();
                }
                self.clear();
                self.note(RESTARTED);
                if std::mem::take(&mut self.listens) {
                    reply.pop();
                    return Ok(());
                }
                None
            }
            // The device has nothing to report in this register.
            sub::REGISTER => {
                zero()?;
                Some(0)
            }
            sub::LISTEN_ONLY => {
                zero()?;
                self.note(SILENCED);
                self.listens = true;
                reply.pop();
                return Ok(());
            }
            sub::CLEAR => {
                zero()?;
                self.clear();
                None
            }
            sub::CLEAR_OVERRUNS => {
                zero()?;
                self.counters[Counter::Overruns as usize] = 0;
                None
            }
            _ if counter < COUNTERS => {
                zero()?;
                Some(self.counters[counter])
            }
            sub::ECHO => return Err(Exception::ILLEGAL_DATA_VALUE),
            _ => return Err(Exception::ILLEGAL_FUNCTION),
        };
        match found {
            None => reply.extend_from_slice(data),
            Some(found) => {
                reply.extend_from_slice(&data[..2]);
                reply.extend_from_slice(&found.to_be_bytes());
            }
        }
        Ok(())
    }

    fn clear(&mut self) {
        self.counters = [0; COUNTERS];
        self.events = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit, asked as from a line.
    fn ask(unit: &mut Diagnostics, pdu: &[u8]) -> Vec<u8> {
        unit.heard();
        let mut reply = Vec::new();
        if !unit.begin(pdu, false) {
            return reply;
        }
        let function = Function::of(pdu[0]);
        let own = function.filter(|function| {
            matches!(
                function,
                Function::Diagnostics | Function::CommEventCounter | Function::CommEventLog
            )
        });
        match own {
            // Another function, carried out or refused as its second byte says.
            None if pdu[1] == 0 => reply.extend_from_slice(pdu),
            None => reply.extend_from_slice(&[pdu[0] | EXCEPTION_BIT, pdu[1]]),
            Some(function) => {
                reply.push(pdu[0]);
                if let Err(exception) = unit.answer(function, &pdu[1..], &mut reply) {
                    reply = vec![pdu[0] | EXCEPTION_BIT, exception.0];
                }
            }
        }
        unit.end(pdu, &reply, false);
        reply
    }

    fn counter(unit: &mut Diagnostics, sub: u8) -> u16 {
        let answer = ask(unit, &[8, 0, sub, 0, 0]);
        let [8, 0, code, high, low] = answer[..] else {
            panic!("{answer:?}");
        };
        assert_eq!(code, sub);
        u16::from_be_bytes([high, low])
    }

    #[test]
    fn data_come_back_and_what_has_the_wrong_length_is_refused() {
        let mut unit = Diagnostics::default();
        for pdu in [&[8, 0, 0, 0xA5, 0x37][..], &[8, 0, 0, 1, 2, 3, 4]] {
            assert_eq!(ask(&mut unit, pdu), pdu);
        }
        for (pdu, exception) in [
            (&[8][..], 3),
            (&[8, 0], 3),
            (&[8, 0, 0], 3),
            (&[8, 0, 0, 1], 3),
            (&[8, 0, 1, 0, 1], 3),
            (&[8, 0, 11, 0, 1], 3),
            (&[8, 0, 3, 0x0A, 0], 1),
            (&[8, 0, 19, 0, 0], 1),
            (&[8, 0, 21, 0, 0], 1),
            (&[8, 1, 0, 0, 0], 1),
            (&[11, 0], 3),
        ] {
            let refusal = [pdu[0] | EXCEPTION_BIT, exception];
            assert_eq!(ask(&mut unit, pdu), refusal, "{pdu:?}");
        }
    }

    #[test]
    fn each_counter_counts_what_its_name_says() {
        let mut unit = Diagnostics::default();
        unit.heard();
        unit.damaged(false);
        unit.damaged(true);
        ask(&mut unit, &[3, 2]);
        ask(&mut unit, &[3, 6]);
        ask(&mut unit, &[3, 7]);
        ask(&mut unit, &[3, 0]);
        assert!(unit.begin(&[6, 0], true));
        unit.end(&[6, 0], &[6, 0], true);
        // Four requests and the telegram before them, and this one.
        assert_eq!(counter(&mut unit, 11), 6);
        assert_eq!(counter(&mut unit, 12), 2);
        assert_eq!(counter(&mut unit, 13), 3);
        // Four requests, the broadcast, and this is the fourth query.
        assert_eq!(counter(&mut unit, 14), 9);
        assert_eq!(counter(&mut unit, 15), 1);
        assert_eq!(counter(&mut unit, 16), 1);
        assert_eq!(counter(&mut unit, 17), 1);
        assert_eq!(counter(&mut unit, 18), 1);
        assert_eq!(ask(&mut unit, &[8, 0, 20, 0, 0]), [8, 0, 20, 0, 0]);
        assert_eq!(counter(&mut unit, 18), 0);
        assert_eq!(counter(&mut unit, 12), 2);
        // One request was carried out, one broadcast, and eleven of function 8; asking for it does not count.
        for _ in 0..2 {
            assert_eq!(ask(&mut unit, &[11]), [11, 0, 0, 0, 13]);
        }
        assert_eq!(ask(&mut unit, &[8, 0, 10, 0, 0]), [8, 0, 10, 0, 0]);
        assert_eq!(ask(&mut unit, &[11]), [11, 0, 0, 0, 0]);
        assert_eq!(counter(&mut unit, 12), 0);
        assert_eq!(counter(&mut unit, 2), 0);
    }

    #[test]
    fn a_unit_that_only_listens_answers_nothing_until_it_is_restarted() {
        let mut unit = Diagnostics::default();
        assert_eq!(ask(&mut unit, &[8, 0, 4, 0, 0]), []);
        assert_eq!(ask(&mut unit, &[3, 0]), []);
        assert_eq!(ask(&mut unit, &[8, 0, 0, 1, 2]), []);
        assert_eq!(ask(&mut unit, &[8, 0, 1, 0x12, 0x34]), []);
        assert_eq!(
            ask(&mut unit, &[8, 0, 1, 0, 0]),
            [],
            "the first has no answer"
        );
        assert_eq!(ask(&mut unit, &[8, 0, 1, 0, 0]), [8, 0, 1, 0, 0]);
        assert_eq!(ask(&mut unit, &[3, 0]), [3, 0]);
        let log = ask(&mut unit, &[12]);
        // Asked, carried out, asked, restarted twice and asked between, and before that in the mode.
        let expected = [
            RECEIVED,
            SENT,
            RECEIVED,
            RESTARTED,
            RECEIVED,
            RESTARTED,
            RECEIVED | LISTENS,
            RECEIVED | LISTENS,
            RECEIVED | LISTENS,
            RECEIVED | LISTENS,
            SILENCED,
            RECEIVED,
        ];
        assert_eq!(log[..6], [12, 6 + 12, 0, 0, 0, 1]);
        assert_eq!(log[8..], expected);
        assert_eq!(ask(&mut unit, &[8, 0, 1, 0xFF, 0]), [8, 0, 1, 0xFF, 0]);
        assert_eq!(ask(&mut unit, &[12])[8..], [RECEIVED, RESTARTED]);
    }

    #[test]
    fn the_log_keeps_the_last_events() {
        let mut unit = Diagnostics::default();
        for _ in 0..100 {
            ask(&mut unit, &[3, 2]);
        }
        unit.damaged(true);
        let log = ask(&mut unit, &[12]);
        assert_eq!(log.len(), 2 + 6 + EVENTS);
        assert_eq!(log[1], 70);
        assert_eq!(
            log[8..12],
            [
                RECEIVED,
                RECEIVED | DAMAGED | OVERRUN,
                SENT | REFUSED,
                RECEIVED
            ]
        );
    }
}
