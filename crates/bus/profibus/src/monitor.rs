//! Listens to a line: the parties and the quality of their traffic.

mod words;

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt::Write as _;

use tickbus_base::os::Characters;
use tickbus_base::time::{Nanos, TimeHistogram};

use crate::finder::{Finder, Found};
use crate::telegram::{BROADCAST, Control, Frame, Telegram};
pub use words::words;
pub(crate) use words::{Service, service};

/// Records the traffic and the stations of a line; sends nothing.
#[derive(Debug)]
pub struct Monitor {
    finder: Finder,
    all: Seen,
}

/// Everything seen so far.
#[derive(Debug, Default)]
struct Seen {
    masters: BTreeMap<u8, MasterSeen>,
    slaves: BTreeMap<u8, SlaveSeen>,
    telegrams: u64,
    damaged: u64,
    /// The last request, as long as its answer may still come.
    open: Option<Open>,
    /// The request that the last telegram has answered.
    answered: Option<Open>,
    /// The last request without an answer.
    unanswered: Option<Open>,
}

#[derive(Debug)]
struct Open {
    at: Nanos,
    master: u8,
    slave: u8,
    service: Service,
    bytes: Vec<u8>,
}

#[derive(Debug, Default)]
struct MasterSeen {
    requests: u64,
    tokens: u64,
}

#[derive(Debug, Default)]
struct SlaveSeen {
    master: u8,
    state: &'static str,
    requests: u64,
    answers: u64,
    unanswered: u64,
    repeated: u64,
    late: u64,
    replies: TimeHistogram,
}

/// How far a station has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Progress {
    /// The master that sent the last request.
    pub(crate) master: u8,
    /// The station has ever answered.
    pub(crate) answers: bool,
    /// The state in words.
    pub(crate) state: &'static str,
}

/// One piece of traffic.
#[derive(Debug)]
pub struct Heard<'a> {
    /// The telegram; `None` for bytes that are no telegram.
    pub telegram: Option<Telegram<'a>>,
    /// The bytes.
    pub bytes: &'a [u8],
    /// The bytes of the request that the telegram answers, if it is an answer in time.
    pub request: Option<&'a [u8]>,
    /// A remark; empty if there is nothing remarkable.
    pub note: &'static str,
}

impl Monitor {
    /// Creates a monitor for a line of `baud` bits per second.
    pub fn new(baud: u32) -> Self {
        Self {
            finder: Finder::new(baud),
            all: Seen::default(),
        }
    }

    /// Takes characters off the line, and passes on the telegrams in them.
    pub fn hear<'a>(
        &mut self,
        now: Nanos,
        characters: impl Into<Characters<'a>>,
        mut each: impl FnMut(&Heard<'_>),
    ) {
        let all = &mut self.all;
        let heard = self.finder.hear(now, characters.into(), |found| {
            let heard = match found {
                Found::Damaged => {
                    all.damaged += 1;
                    Heard {
                        telegram: None,
                        bytes: &[],
                        request: None,
                        note: "damaged bytes",
                    }
                }
                Found::Telegram(telegram, bytes) => {
                    let note = all.telegram(now, &telegram, bytes);
                    Heard {
                        telegram: Some(telegram),
                        bytes,
                        request: all.answered.as_ref().map(|open| &open.bytes[..]),
                        note,
                    }
                }
            };
            each(&heard);
            Ok::<(), Infallible>(())
        });
        match heard {
            Ok(()) => {}
        }
    }

    /// How far a station has come; `None` if no master has sent it a request.
    pub(crate) fn progress(&self, station: u8) -> Option<Progress> {
        let slave = self.all.slaves.get(&station)?;
        Some(Progress {
            master: slave.master,
            answers: slave.answers > 0,
            state: slave.state,
        })
    }

    /// The addresses of the stations that have answered a master.
    pub(crate) fn answering(&self) -> impl Iterator<Item = u8> {
        let slaves = self.all.slaves.iter();
        slaves
            .filter(|(_, slave)| slave.answers > 0)
            .map(|(address, _)| *address)
    }

    /// How often bytes were heard that are no telegram.
    pub(crate) fn damaged(&self) -> u64 {
        self.all.damaged
    }

    /// The stations and their masters, one per line.
    pub fn table(&self) -> String {
        let all = &self.all;
        let mut text = format!("telegrams {}  damaged {}\n", all.telegrams, all.damaged);
        // Writing to a string cannot fail.
        // A token has no checksum, so one telegram alone proves nothing.
        let masters = all.masters.iter();
        for (address, master) in masters.filter(|(_, seen)| seen.requests + seen.tokens > 1) {
            let _ = writeln!(
                text,
                "master {address:>3}  requests {}  tokens {}",
                master.requests, master.tokens
            );
        }
        for (address, slave) in &all.slaves {
            let _ = writeln!(
                text,
                "slave  {address:>3}  {:<16} master {}  requests {}  answers {}  unanswered {}  repeated {}  late {}  \
                 reply median {} longest {}",
                slave.state,
                slave.master,
                slave.requests,
                slave.answers,
                slave.unanswered,
                slave.repeated,
                slave.late,
                slave.replies.quantile(0.5).rounded(),
                slave.replies.longest().rounded(),
            );
        }
        text
    }
}

impl Seen {
    fn telegram(&mut self, now: Nanos, telegram: &Telegram<'_>, bytes: &[u8]) -> &'static str {
        self.telegrams += 1;
        self.answered = None;
        match telegram {
            Telegram::Token { source, .. } => {
                self.give_up();
                self.masters.entry(*source).or_default().tokens += 1;
                ""
            }
            Telegram::Frame(frame) if frame.control.is_request() => self.request(now, frame, bytes),
            Telegram::Frame(frame) => self.answer(now, Some(frame.source), Some(frame.control)),
            Telegram::ShortAck => self.answer(now, None, None),
        }
    }

    /// The master continues: an answer to its last request, if still to come, will be late.
    fn give_up(&mut self) {
        let Some(open) = self.open.take() else { return };
        if let Some(slave) = self.slaves.get_mut(&open.slave) {
            slave.unanswered += 1;
            slave.state = "silent";
        }
        self.unanswered = Some(open);
    }

    fn request(&mut self, now: Nanos, frame: &Frame<'_>, bytes: &[u8]) -> &'static str {
        self.give_up();
        self.masters.entry(frame.source).or_default().requests += 1;
        let function = frame.control.function();
        let is_answered = !matches!(function, Control::SDN_LOW | Control::SDN_HIGH);
        if !is_answered || frame.destination == BROADCAST {
            return "";
        }
        let service = service(frame);
        let before = self.unanswered.take();
        let is_repeated = before.is_some_and(|before| before.bytes == bytes);
        // Masters ask every address for its status, in search of other masters, which does not prove that there is a
        // slave.
        if service != Service::Status || self.slaves.contains_key(&frame.destination) {
            let slave = self.slaves.entry(frame.destination).or_default();
            slave.master = frame.source;
            slave.requests += 1;
            slave.repeated += u64::from(is_repeated);
        }
        self.open = Some(Open {
            at: now,
            master: frame.source,
            slave: frame.destination,
            service,
            bytes: bytes.to_vec(),
        });
        if is_repeated { "repeated" } else { "" }
    }

    /// An answer; a short acknowledgement does not name its sender.
    fn answer(&mut self, now: Nanos, from: Option<u8>, control: Option<Control>) -> &'static str {
        let fits = |open: &mut Open| from.is_none_or(|from| from == open.slave);
        let Some(open) = self.open.take_if(fits) else {
            let late = from.or(self.unanswered.as_ref().map(|open| open.slave));
            if let Some(slave) = late.and_then(|late| self.slaves.get_mut(&late)) {
                slave.late += 1;
                return "late: its master has gone on";
            }
            return "nobody asked";
        };
        if self.masters.contains_key(&open.slave) && open.service == Service::Status {
            return "";
        }
        let slave = self.slaves.entry(open.slave).or_default();
        slave.master = open.master;
        slave.answers += 1;
        slave.replies.record(now - open.at);
        slave.state = match (control, open.service) {
            (Some(Control::NOT_ACTIVE), _) => "refuses",
            (_, Service::SetPrm) => "parameterised",
            (_, Service::ChkCfg) => "configured",
            (_, Service::DataExchange) => "exchanges data",
            _ if slave.state.is_empty() || slave.state == "silent" => "answers",
            _ => slave.state,
        };
        self.answered = Some(open);
        ""
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(to: u8, from: u8, control: u8, dsap: Option<u8>, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        Frame {
            destination: to,
            source: from,
            control: Control(control),
            dsap,
            ssap: dsap.map(|_| 62),
            data,
        }
        .append(&mut bytes);
        bytes
    }

    /// The monitor's notes on these telegrams, a millisecond apart.
    fn notes(monitor: &mut Monitor, telegrams: &[Vec<u8>]) -> Vec<&'static str> {
        let mut notes = Vec::new();
        for (number, bytes) in (1..).zip(telegrams) {
            monitor.hear(Nanos::from_millis(number), &bytes[..], |heard| {
                notes.push(heard.note);
            });
        }
        notes
    }

    #[test]
    fn it_tells_who_is_there_and_how_far_each_has_come() {
        let mut monitor = Monitor::new(500_000);
        let said = notes(
            &mut monitor,
            &[
                vec![0xDC, 2, 2],
                // There is no station at 5.
                frame(5, 2, 0x49, None, &[]),
                frame(8, 2, 0x6D, Some(60), &[]),
                frame(2, 8, 0x08, Some(62), &[2, 5, 0, 255, 0, 1]),
                frame(8, 2, 0x5D, Some(61), &[0x80, 0, 0, 11, 0, 1, 0]),
                vec![0xE5],
                frame(8, 2, 0x7D, Some(62), &[0x50]),
                vec![0xE5],
                frame(8, 2, 0x5D, None, &[]),
                frame(2, 8, 0x08, None, &[1, 2]),
                frame(127, 2, 0x46, Some(58), &[0, 0]),
                frame(9, 2, 0x7D, None, &[1]),
                frame(2, 9, 0x03, None, &[]),
            ],
        );
        assert!(said.iter().all(|note| note.is_empty()), "{said:?}");
        let table = monitor.table();
        for words in [
            "telegrams 13  damaged 0\n",
            "master   2  requests 7  tokens 1\n",
            "slave    8  exchanges data   master 2  requests 4  answers 4  unanswered 0  repeated 0  late 0  reply median ",
            "slave    9  refuses ",
        ] {
            assert!(table.contains(words), "{words}\n{table}");
        }
        assert!(!table.contains("slave    5"), "{table}");
    }

    #[test]
    fn a_master_is_listed_after_its_second_telegram() {
        let mut monitor = Monitor::new(500_000);
        notes(&mut monitor, &[vec![0xDC, 2, 2], vec![0xDC, 54, 2]]);
        notes(&mut monitor, &[vec![0xDC, 2, 54], vec![0xDC, 2, 2]]);
        let table = monitor.table();
        assert!(
            table.contains("master   2  requests 0  tokens 3\n"),
            "{table}"
        );
        assert!(!table.contains("master  54"), "{table}");
    }

    #[test]
    fn missing_late_and_repeated_telegrams_are_told() {
        let mut monitor = Monitor::new(500_000);
        let ask = frame(8, 2, 0x7D, None, &[7]);
        let said = notes(
            &mut monitor,
            &[
                ask.clone(),
                ask.clone(),
                frame(2, 8, 0x08, None, &[1]),
                // The answer to the first request.
                frame(2, 8, 0x08, None, &[1]),
                frame(8, 2, 0x5D, None, &[7]),
                vec![0xDC, 2, 2],
                vec![0xE5],
                vec![0x00, 0x01],
                frame(2, 70, 0x08, None, &[1]),
            ],
        );
        let late = "late: its master has gone on";
        let expected = [
            "",
            "repeated",
            "",
            late,
            "",
            "",
            late,
            "damaged bytes",
            "nobody asked",
        ];
        assert_eq!(said, expected);
        let table = monitor.table();
        let words = "slave    8  silent           master 2  requests 3  answers 1  unanswered 2  repeated 1  late 2";
        assert!(table.contains(words), "{table}");
    }
}
