//! A client of a dispatcher, without its socket: bytes and time in; values, answers and bytes out.

mod lines;
mod outputs;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;

use crate::cable::Cable;
use crate::channel::{Channel, Counts, Kind, MOST_CHANNELS};
use crate::device::{Device, Role};
use crate::key::{Key, KeyRefused};
use crate::label::Label;
use crate::name::{LONGEST_NAME, is_name};
use crate::number::Number;
use crate::refusal::Code;

use lines::{Heard, Lines};
use outputs::Outputs;

/// How often an otherwise quiet client sends or requests something: well within the 60 s after which a dispatcher
/// disconnects.
pub const KEEP_ALIVE: Nanos = Nanos::from_secs(20);

/// The client gives up a dispatcher that has not answered, or not read, for this long.
pub const PATIENCE: Nanos = Nanos::from_secs(10);

/// The client retries a refused connection after this time: the other client may have come.
pub const ASK_AGAIN: Nanos = Nanos::from_secs(5);

/// A client's description of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Profile {
    /// The role.
    pub role: Role,
    /// The name.
    pub name: String,
    /// The channels. All kinds count from 1.
    pub counts: Counts,
    /// The connections that the client requests.
    pub cables: Vec<Cable>,
    /// The client sends a line at least this often, 10 ms to 60 s; the dispatcher cuts its outputs off while it does not. `None`:
    /// the dispatcher does not supervise it.
    pub alive: Option<Nanos>,
    /// The key of the laboratory, if it has one.
    pub key: Option<Key>,
}

impl Profile {
    /// Checks that a dispatcher can accept this profile.
    ///
    /// # Errors
    ///
    /// The name, the counts or a connection breaks a rule.
    pub fn check(&self) -> Result<(), Mistake> {
        if !is_name(&self.name) {
            return Err(Mistake::new(
                format!("\"{}\" cannot be the name of a client", self.name),
                format!("take 1 to {LONGEST_NAME} letters, digits, _, - and ."),
            ));
        }
        for kind in Kind::ALL {
            let (count, letters) = (self.counts.of(kind), kind.letters());
            if count > MOST_CHANNELS {
                return Err(Mistake::new(
                    format!("there are {count} channels {letters}"),
                    format!("a client has up to {MOST_CHANNELS} of a kind"),
                ));
            }
        }
        self.cables
            .iter()
            .try_for_each(|cable| cable.check(self.counts))
    }
}

/// An event that a client reports.
#[derive(Debug)]
pub enum Event<'a> {
    /// The dispatcher has accepted the client. The device list follows.
    Identified,
    /// The value of an input.
    Value(Channel, Number),
    /// The source of an input is gone, or was disconnected: it has no value until there is a source again.
    Lost(Channel),
    /// The end of a line of values: all values since the last such event belong together.
    LineEnd,
    /// A device of the list; the client itself, too.
    Device(Device),
    /// The end of the list.
    ListEnd,
    /// Every connection was requested once, and the first values of the inputs have arrived.
    Settled,
    /// A connection was made.
    Connected(&'a Cable),
    /// The dispatcher refused this connection, and the client will retry. Without a connection: it refused another
    /// line.
    Refused {
        /// The connection.
        cable: Option<&'a Cable>,
        /// The number of the refusal, such as 404.
        code: u16,
        /// The text of the refusal.
        text: String,
    },
}

/// Why a connection with a dispatcher cannot continue.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ClientError {
    /// The dispatcher does not accept this client. It may do so later, as names become free.
    #[error("{0}")]
    Refused(String),
    /// The dispatcher sent something invalid.
    #[error("{0}")]
    Protocol(String),
    /// The dispatcher neither answers nor reads.
    #[error("{0}")]
    Silent(String),
}

/// A client across connections: it keeps the values of its outputs, and resends them after a reconnect.
///
/// After [`connected`](Self::connected) the owner of the socket calls [`hear`](Self::hear) with the bytes that arrive,
/// and [`turn`](Self::turn) at [`deadline`](Self::deadline) and after every other call. It writes
/// [`to_write`](Self::to_write) and reports that by [`wrote`](Self::wrote). Last it asks [`check`](Self::check) whether
/// the connection may continue.
#[derive(Debug)]
pub struct Client {
    profile: Profile,
    keep_alive: Nanos,
    progress: Progress,
    /// The state of each cable's request.
    wishes: Box<[Wish]>,
    /// The labels of channels, and how many of them the dispatcher has answered.
    labels: Box<[(Channel, Label)]>,
    labelled: usize,
    outputs: Outputs,
    lines: Lines,
    out: Vec<u8>,
    written: usize,
    wants_list: bool,
    is_settled: bool,
    /// When the client last made bytes, or all of them were written.
    said: Nanos,
    /// When the client last requested an answer.
    asked: Nanos,
    /// When the last complete line came, or the connection was made.
    heard: Nanos,
}

/// How far a connection has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Apart,
    Connected,
    /// The dispatcher has accepted the key.
    Admitted,
    /// Accepted by the dispatcher, and between two requests.
    Idle,
    /// Awaiting the answer to this request. Others wait meanwhile, so each answer belongs to one request.
    Asking(Request),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Request {
    Key,
    Identify,
    Connect(usize),
    Label,
    List,
    Ping,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wish {
    Granted,
    /// To be requested at this time.
    At(Nanos),
}

impl Client {
    /// A client that is not connected. It sends something, if only `PING`, whenever nothing was sent or received for
    /// `keep_alive`: [`KEEP_ALIVE`], or shorter to notice a lost dispatcher earlier.
    ///
    /// # Errors
    ///
    /// No dispatcher can accept this profile.
    pub fn new(profile: Profile, keep_alive: Nanos) -> Result<Self, Mistake> {
        profile.check()?;
        let outputs = Outputs::new(profile.counts);
        Ok(Self {
            keep_alive,
            progress: Progress::Apart,
            wishes: vec![Wish::At(Nanos::ZERO); profile.cables.len()].into(),
            labels: Box::default(),
            labelled: 0,
            out: Vec::with_capacity(outputs.longest() + 256),
            outputs,
            lines: Lines::new(),
            written: 0,
            wants_list: false,
            is_settled: false,
            said: Nanos::ZERO,
            asked: Nanos::ZERO,
            heard: Nanos::ZERO,
            profile,
        })
    }

    /// Announces what these channels are called, once the dispatcher has accepted the client. A dispatcher that does not know
    /// labels does without.
    #[must_use]
    pub fn with_labels<'n>(mut self, names: impl Iterator<Item = (Channel, &'n str)>) -> Self {
        let named = names.filter_map(|(channel, name)| Some((channel, Label::of(name)?)));
        self.labels = named.collect();
        self
    }

    /// The client's description of itself.
    pub const fn profile(&self) -> &Profile {
        &self.profile
    }

    /// A connection was established: the client sends everything again.
    pub fn connected(&mut self, now: Nanos) {
        self.progress = Progress::Connected;
        self.wishes.fill(Wish::At(now));
        self.outputs.repeat();
        self.lines.clear();
        self.out.clear();
        self.written = 0;
        self.wants_list = false;
        self.is_settled = false;
        self.labelled = 0;
        self.said = now;
        self.heard = now;
    }

    /// True if the dispatcher has accepted this client.
    pub fn is_identified(&self) -> bool {
        !matches!(
            self.progress,
            Progress::Apart
                | Progress::Connected
                | Progress::Admitted
                | Progress::Asking(Request::Key | Request::Identify)
        )
    }

    /// When the dispatcher last sent a line, or the connection was established.
    pub const fn heard(&self) -> Nanos {
        self.heard
    }

    /// Sets an output. The client sends the value if it differs from the last one sent; of several values between two
    /// writes, only the newest.
    ///
    /// # Panics
    ///
    /// When the client has no such output.
    pub fn set(&mut self, channel: Channel, value: Number) {
        self.outputs.set(channel, value);
    }

    /// True if all values that were set have been written.
    pub fn is_all_written(&self) -> bool {
        self.is_identified() && !self.outputs.has_news() && self.to_write().is_empty()
    }

    /// Requests the device list.
    pub fn ask_list(&mut self) {
        self.wants_list = true;
    }

    /// Bytes have arrived, in any pieces.
    ///
    /// # Errors
    ///
    /// The connection cannot continue.
    pub fn hear(
        &mut self,
        now: Nanos,
        bytes: &[u8],
        events: &mut dyn FnMut(Event<'_>),
    ) -> Result<(), ClientError> {
        let mut lines = std::mem::take(&mut self.lines);
        let result = lines.each(bytes, &mut |line| {
            self.heard = now;
            self.obey(now, line, events)
        });
        self.lines = lines;
        // What arrives instead of an answer may repeat the key.
        result.map_err(|error| match error {
            ClientError::Protocol(_) if self.awaits_key() => {
                ClientError::Protocol(KeyRefused::NoDispatcher.to_string())
            }
            other => other,
        })
    }

    /// True if the dispatcher has not answered the key yet.
    fn awaits_key(&self) -> bool {
        let is_before = matches!(
            self.progress,
            Progress::Connected | Progress::Asking(Request::Key)
        );
        is_before && self.profile.key.is_some()
    }

    fn obey(
        &mut self,
        now: Nanos,
        line: &[u8],
        events: &mut dyn FnMut(Event<'_>),
    ) -> Result<(), ClientError> {
        if self.awaits_key() && !line.is_empty() {
            return self.key_answered(line);
        }
        match lines::read(line)? {
            Heard::Nothing => {}
            Heard::Values(values) => {
                for item in values {
                    let (channel, value) =
                        item.map_err(|refusal| lines::nonsense(line, &refusal.text))?;
                    if self.profile.counts.has_from_1(channel) && !channel.kind.is_output() {
                        events(if value == Number::LOST {
                            Event::Lost(channel)
                        } else {
                            Event::Value(channel, value)
                        });
                    } else if channel.number != 0 || self.profile.counts.of(channel.kind) == 0 {
                        // The dispatcher has a channel 0 of each analog kind, which this client does not use.
                        return Err(lines::nonsense(
                            line,
                            &format!("{channel} is no input of this client"),
                        ));
                    }
                }
                events(Event::LineEnd);
            }
            Heard::Device(device) => events(Event::Device(device)),
            Heard::ListEnd => events(Event::ListEnd),
            Heard::Done(verb) => self.done(line, verb, events)?,
            Heard::Refused(code, text) => self.refused(now, code, text, events)?,
        }
        Ok(())
    }

    fn key_answered(&mut self, line: &[u8]) -> Result<(), ClientError> {
        let name = &self.profile.name;
        match Key::answered(line) {
            Ok(()) if self.progress == Progress::Asking(Request::Key) => {
                self.progress = Progress::Admitted;
                Ok(())
            }
            Ok(()) | Err(KeyRefused::NoDispatcher) => {
                Err(ClientError::Protocol(KeyRefused::NoDispatcher.to_string()))
            }
            Err(refused) => Err(ClientError::Refused(format!(
                "the dispatcher does not take \"{name}\": {refused}"
            ))),
        }
    }

    fn done(
        &mut self,
        line: &[u8],
        verb: &[u8],
        events: &mut dyn FnMut(Event<'_>),
    ) -> Result<(), ClientError> {
        let Progress::Asking(request) = self.progress else {
            return Err(lines::nonsense(line, "nothing was asked"));
        };
        let expected = match request {
            // Answers to a key are read elsewhere.
            Request::Key => "KEY",
            Request::Identify => self.profile.role.keyword(),
            Request::Connect(_) => "CONNECT",
            Request::Label => "NAME",
            Request::List => "LIST",
            Request::Ping => "PING",
        };
        if verb != expected.as_bytes() {
            return Err(lines::nonsense(
                line,
                &format!("OK {expected} was expected"),
            ));
        }
        self.progress = Progress::Idle;
        match request {
            Request::Key | Request::List => {}
            Request::Identify => events(Event::Identified),
            Request::Connect(at) => {
                self.wishes[at] = Wish::Granted;
                events(Event::Connected(&self.profile.cables[at]));
            }
            Request::Label => self.labelled += 1,
            Request::Ping => {
                if !std::mem::replace(&mut self.is_settled, true) {
                    events(Event::Settled);
                }
            }
        }
        Ok(())
    }

    fn refused(
        &mut self,
        now: Nanos,
        code: u16,
        text: String,
        events: &mut dyn FnMut(Event<'_>),
    ) -> Result<(), ClientError> {
        let name = &self.profile.name;
        if code == Code::TimeOut.number() {
            return Err(ClientError::Refused(format!(
                "the dispatcher has disconnected \"{name}\" ({text}); see whether this computer was held up, and \
                 reconnect"
            )));
        }
        let mut cable = None;
        match self.progress {
            Progress::Apart
            | Progress::Connected
            | Progress::Admitted
            | Progress::Asking(Request::Key | Request::Identify) => {
                return Err(ClientError::Refused(if code == Code::Conflict.number() {
                    format!(
                        "the dispatcher has another client \"{name}\"; give this one a \"name\" of its own, or end the \
                         other one (a client whose computer was lost keeps its name for up to 60 s)"
                    )
                } else {
                    format!("the dispatcher does not take \"{name}\": {text} (ERR {code})")
                }));
            }
            Progress::Asking(Request::Label) => {
                self.progress = Progress::Idle;
                // An older dispatcher has no names for channels. Nothing else depends on them.
                self.labelled = self.labels.len();
                if code == Code::Syntax.number() {
                    return Ok(());
                }
            }
            Progress::Asking(request) => {
                self.progress = Progress::Idle;
                if let Request::Connect(at) = request {
                    self.wishes[at] = Wish::At(now + ASK_AGAIN);
                    cable = Some(&self.profile.cables[at]);
                }
            }
            Progress::Idle => {}
        }
        events(Event::Refused { cable, code, text });
        Ok(())
    }

    /// Makes the bytes that are due at `now`.
    pub fn turn(&mut self, now: Nanos) {
        // While the system has not taken everything, newer values replace those that wait.
        if !self.to_write().is_empty() {
            return;
        }
        match self.progress {
            Progress::Apart | Progress::Asking(Request::Key | Request::Identify) => return,
            Progress::Connected if let Some(key) = &self.profile.key => {
                let line = key.line();
                self.ask(now, Request::Key, &line);
                return;
            }
            Progress::Connected | Progress::Admitted => {
                let Profile {
                    role,
                    name,
                    counts,
                    alive,
                    ..
                } = &self.profile;
                let [q, i, aq, ai] = Kind::ALL.map(|kind| counts.of(kind));
                let alive = alive.map(|alive| format!(" ALIVE={}ms", alive.0 / 1_000_000));
                let line = format!(
                    "{} {name} Q{q:02} I{i:02} AQ{aq:02} AI{ai:02} V=3{}",
                    role.keyword(),
                    alive.unwrap_or_default()
                );
                self.ask(now, Request::Identify, &line);
                return;
            }
            Progress::Idle => self.ask_next(now),
            Progress::Asking(_) => {}
        }
        if self.outputs.has_news() {
            self.outputs.write(&mut self.out);
            self.said = now;
        }
    }

    fn ask_next(&mut self, now: Nanos) {
        let is_due = |wish: &Wish| matches!(wish, Wish::At(at) if *at <= now);
        if let Some(at) = self.wishes.iter().position(is_due) {
            let line = format!("CONNECT {}", self.profile.cables[at]);
            self.ask(now, Request::Connect(at), &line);
        } else if std::mem::take(&mut self.wants_list) {
            self.ask(now, Request::List, "LIST");
        } else if self.is_settled
            && let Some((channel, label)) = self.labels.get(self.labelled)
        {
            let line = format!("NAME {channel} {label}");
            self.ask(now, Request::Label, &line);
        } else if now >= self.next_ping() {
            self.ask(now, Request::Ping, "PING");
        }
    }

    fn ask(&mut self, now: Nanos, request: Request, line: &str) {
        self.out.extend_from_slice(line.as_bytes());
        self.out.extend_from_slice(b"\r\n");
        self.progress = Progress::Asking(request);
        self.said = now;
        self.asked = now;
    }

    fn next_ping(&self) -> Nanos {
        if self.is_settled {
            self.said.min(self.heard) + self.keep_alive
        } else {
            self.said
        }
    }

    /// The bytes to be written.
    pub fn to_write(&self) -> &[u8] {
        &self.out[self.written..]
    }

    /// The system has taken `count` bytes of [`to_write`](Self::to_write).
    ///
    /// # Panics
    ///
    /// When there were fewer.
    pub fn wrote(&mut self, now: Nanos, count: usize) {
        assert!(
            count <= self.to_write().len(),
            "more was taken than there was"
        );
        self.written += count;
        if self.written == self.out.len() {
            self.out.clear();
            self.written = 0;
            self.said = now;
            self.turn(now);
        }
    }

    /// Checks whether the dispatcher still answers and reads.
    ///
    /// # Errors
    ///
    /// The dispatcher neither answers nor reads.
    pub fn check(&self, now: Nanos) -> Result<(), ClientError> {
        if now < self.given_up() {
            return Ok(());
        }
        let does = if self.to_write().is_empty() {
            "answered"
        } else {
            "read"
        };
        Err(ClientError::Silent(format!(
            "the dispatcher has not {does} for {PATIENCE}; see whether it still runs, and the cable"
        )))
    }

    fn given_up(&self) -> Nanos {
        // Values that arrive meanwhile are no answer.
        let asked = matches!(self.progress, Progress::Asking(_)).then_some(self.asked);
        let unwritten = (!self.to_write().is_empty()).then_some(self.said);
        let since = asked.into_iter().chain(unwritten).min();
        since.map_or(Nanos::MAX, |since| since.max(self.heard) + PATIENCE)
    }

    /// When [`turn`](Self::turn) or [`check`](Self::check) has something to do although nothing arrives and nothing
    /// can be written.
    pub fn deadline(&self) -> Nanos {
        let mut deadline = self.given_up();
        match self.progress {
            Progress::Connected | Progress::Admitted => deadline = self.said,
            Progress::Idle => {
                deadline = deadline.min(self.next_ping());
                if self.is_settled && self.labelled < self.labels.len() {
                    deadline = self.said;
                }
                for wish in &self.wishes {
                    if let Wish::At(at) = wish {
                        deadline = deadline.min(*at);
                    }
                }
            }
            Progress::Apart | Progress::Asking(_) => {}
        }
        deadline
    }
}

#[cfg(test)]
mod tests;
