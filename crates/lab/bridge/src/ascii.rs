//! A client on a serial line, as a client of the dispatcher: lines in, lines out; the caller passes the time.

use std::collections::VecDeque;

use tickbus_base::time::Nanos;
use tickbus_dispatcher::grammar::{Identification, LONGEST_LINE, Line, Values, parse, printable};
use tickbus_dispatcher::{Channel, Counts, Key, Number};

use crate::lines::{Cut, Lines};
use crate::outbox::{Outbox, put};
use crate::speaker::Speaker;

/// If nothing was sent for this time, the dispatcher gets a sign of life; it must answer within the same time.
const ALIVE: Nanos = Nanos::from_secs(20);

/// The most requests that may wait for the dispatcher.
const REQUESTS: usize = 64;

/// The client's message when the dispatcher has gone.
const AWAY: &[u8] = b"ERR 503 the dispatcher does not answer; the bridge goes on calling it, and sends your values and \
                      connections then";

/// How a line ends on the serial side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineEnd {
    /// A line feed.
    Lf,
    /// A carriage return and a line feed.
    CrLf,
    /// A carriage return.
    Cr,
}

impl LineEnd {
    const fn bytes(self) -> &'static [u8] {
        match self {
            Self::Lf => b"\n",
            Self::CrLf => b"\r\n",
            Self::Cr => b"\r",
        }
    }
}

/// Counts of everything that went through a bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Lines from the serial side.
    pub said: u64,
    /// Lines from the dispatcher for the serial side.
    pub heard: u64,
    /// Values that were replaced by newer ones, because a side was slow.
    pub overtaken: u64,
    /// Lines from the serial side that were dropped: too long, too many, or without a dispatcher.
    pub dropped: u64,
}

/// A bridge between a serial line and a connection with the dispatcher.
///
/// The bridge forwards lines unchanged. In addition it reintroduces the client after a lost connection, with its newest
/// values and the requests that may not have arrived; it sends signs of life, and keeps the newest values where a side
/// is slow.
#[derive(Debug)]
pub struct AsciiBridge {
    from_serial: Lines,
    from_dispatcher: Lines,
    to_serial: Outbox,
    to_dispatcher: Outbox,
    /// Input from the serial line that waits for room in `requests`.
    unread: Vec<u8>,
    state: State,
    /// The key of the laboratory, if it has one.
    key: Option<Key>,
    /// The key was sent, and not answered yet.
    awaits_key: bool,
    client: Option<Client>,
    /// CONNECT, DISCONNECT and LIST lines that may not have been carried out yet.
    requests: VecDeque<Vec<u8>>,
    /// The senders of pending PINGs, with their times.
    pings: VecDeque<(Asker, Nanos)>,
    /// When the dispatcher was last sent something.
    sent: Nanos,
    /// When the dispatcher last sent something, or the connection was made.
    heard: Nanos,
    traffic: Traffic,
}

/// The client, as it has introduced itself.
#[derive(Debug)]
struct Client {
    /// The client's identification line.
    line: Vec<u8>,
    counts: Counts,
    /// The client has not received the answer to that line yet.
    is_waiting: bool,
    /// The newest values of the outputs.
    outputs: Vec<(Channel, Number)>,
    /// The client receives `P I1=?` when an input loses its source: version 3.
    hears_losses: bool,
    /// The newest values that the client received for its inputs.
    inputs: Vec<(Channel, Number)>,
    /// Inputs that have a value from an earlier connection, but none from this one.
    stale: Vec<Channel>,
}

/// The progress of the connection with the dispatcher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// There is no connection.
    Away,
    /// There is no connection: the dispatcher has refused the client for now, and is called again after a pause.
    Refused,
    /// The dispatcher does not know the client.
    Stranger,
    /// The identification was sent, but not answered yet.
    Introduced,
    /// The dispatcher knows the client.
    Here,
    /// BYE was sent: by the client, or because it starts over.
    Leaving {
        /// The client has sent it.
        by_client: bool,
    },
}

/// The sender of a PING.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asker {
    Client,
    /// The bridge, as a sign of life.
    Bridge,
    /// The bridge, to learn if a request was carried out.
    Request,
    /// The bridge, to learn if the inputs have their first values.
    Settled,
}

impl AsciiBridge {
    /// A bridge to a serial line whose lines end with `end`; received lines may have any end.
    pub fn new(end: LineEnd) -> Self {
        Self {
            from_serial: Lines::default(),
            from_dispatcher: Lines::default(),
            to_serial: Outbox::new(end.bytes()),
            to_dispatcher: Outbox::new(b"\r\n"),
            unread: Vec::new(),
            state: State::Away,
            key: None,
            awaits_key: false,
            client: None,
            requests: VecDeque::new(),
            pings: VecDeque::new(),
            sent: Nanos::ZERO,
            heard: Nanos::ZERO,
            traffic: Traffic::default(),
        }
    }

    /// States this key to the dispatcher in the client's place.
    #[must_use]
    pub fn with_key(mut self, key: Option<Key>) -> Self {
        self.key = key;
        self
    }

    /// The time since which it waits for an answer of the dispatcher; `None` if it does not.
    fn waits_since(&self) -> Option<Nanos> {
        let asked = self.pings.front().map(|(_, asked)| *asked);
        let left = matches!(self.state, State::Leaving { .. }).then_some(self.sent);
        asked.or(left).map(|since| since.max(self.heard))
    }

    /// The traffic so far.
    pub fn traffic(&self) -> Traffic {
        Traffic {
            overtaken: self.to_serial.overtaken + self.to_dispatcher.overtaken,
            ..self.traffic
        }
    }

    /// The serial port is gone. Close the connection: for all others the client has left.
    pub fn unplugged(&mut self) {
        self.state = State::Away;
        self.from_serial = Lines::default();
        self.unread.clear();
        self.to_serial.clear();
        self.requests.clear();
        if let Some(client) = &mut self.client {
            // The values may have changed by the time the port is back.
            client.outputs.clear();
            client.is_waiting = false;
        }
    }

    /// The bytes to write to the serial port now.
    pub fn to_serial(&mut self) -> &[u8] {
        self.to_serial.next_bytes()
    }

    /// The port has taken this many bytes.
    pub fn wrote_to_serial(&mut self, count: usize) {
        self.to_serial.wrote(count);
    }

    /// True if bytes from the serial port are wanted now; otherwise the dispatcher has to answer first.
    pub fn wants_serial(&self) -> bool {
        self.unread.is_empty() && !self.must_wait()
    }

    /// Bytes have arrived from the serial port, in any pieces.
    pub fn from_serial(&mut self, now: Nanos, mut bytes: &[u8]) {
        if self.unread.is_empty() {
            self.read(now, &mut bytes);
        }
        self.unread.extend_from_slice(bytes);
        self.resume(now);
    }

    /// Reads the input that has waited.
    fn resume(&mut self, now: Nanos) {
        if self.unread.is_empty() || self.must_wait() {
            return;
        }
        let unread = std::mem::take(&mut self.unread);
        let mut bytes = &unread[..];
        self.read(now, &mut bytes);
        self.unread = bytes.to_vec();
    }

    fn read(&mut self, now: Nanos, bytes: &mut &[u8]) {
        while !self.must_wait()
            && let Some(cut) = self.from_serial.next(bytes)
        {
            self.traffic.said += 1;
            match cut {
                Cut::Line(line) => self.said(now, line),
                Cut::TooLong => self.refuse(&format!(
                    "413 the line is longer than {LONGEST_LINE} bytes with its end; send several lines"
                )),
            }
        }
    }

    /// True if a line of the client could overtake a request, or be one too many. Without a dispatcher all lines are
    /// read, since the answers report that.
    fn must_wait(&self) -> bool {
        let is_full = self.requests.len() >= REQUESTS;
        !self.is_apart() && (is_full || self.state == State::Here && self.has_unsent())
    }

    /// There is no connection with the dispatcher.
    const fn is_apart(&self) -> bool {
        matches!(self.state, State::Away | State::Refused)
    }

    /// The client has sent a line.
    fn said(&mut self, now: Nanos, line: Vec<u8>) {
        let parsed = parse(&line);
        match (&parsed, self.state) {
            (Ok(Line::Nothing), _) => {}
            (Ok(Line::Identify(identification)), _) => {
                let identification = *identification;
                self.identify(&line, identification);
            }
            (Ok(Line::Bye), State::Away | State::Refused) => self.client = None,
            (Ok(Line::Bye), _) => {
                self.client = None;
                self.requests.clear();
                self.leave(true);
            }
            (Ok(Line::Key(_)), _) => {
                self.refuse("400 the bridge states the key; start it with --key-file");
            }
            (_, State::Leaving { .. }) if self.client.is_none() => self.traffic.dropped += 1,
            (Ok(Line::Ping), State::Away | State::Refused | State::Leaving { .. }) => {
                self.traffic.dropped += 1;
                self.say(AWAY);
            }
            (Ok(Line::Ping), _) => self.ping(now, Asker::Client),
            (Ok(Line::Values(values)), _) if self.keep(values.clone()) => {
                if self.state == State::Here {
                    let items: Vec<_> = values.clone().flatten().collect();
                    self.to_dispatcher.values(&line, &items);
                }
            }
            (
                Ok(Line::Connect(_) | Line::Disconnect(_) | Line::Name(..) | Line::List { .. }),
                _,
            ) if self.client.is_some() => {
                self.request(now, line);
            }
            // The dispatcher knows best what is wrong.
            (_, State::Here) if self.to_dispatcher.is_full() => self.traffic.dropped += 1,
            (_, State::Here) => self.to_dispatcher.line(&line),
            (Err(refusal), _) => {
                let text = refusal.to_string();
                self.traffic.dropped += 1;
                self.say(text.as_bytes());
            }
            (Ok(_), _) if self.client.is_none() => {
                self.refuse("401 say first who you are, such as VR NAME Q08 I08 AQ02 AI03");
            }
            (Ok(_), _) => self.refuse("404 these are no values of your outputs"),
        }
    }

    fn identify(&mut self, line: &[u8], identification: Identification<'_>) {
        self.requests.clear();
        self.client = Some(Client {
            line: line.to_vec(),
            counts: identification.counts,
            is_waiting: true,
            outputs: Vec::new(),
            hears_losses: identification.hears_losses,
            inputs: Vec::new(),
            stale: Vec::new(),
        });
        match self.state {
            State::Away => self.say(AWAY),
            State::Stranger => {
                self.to_dispatcher.line(line);
                self.state = State::Introduced;
            }
            // A program that connects on its own would use a new connection.
            State::Introduced | State::Here => self.leave(false),
            // The next connection introduces the client.
            State::Refused | State::Leaving { .. } => {}
        }
    }

    fn leave(&mut self, by_client: bool) {
        self.to_dispatcher.line(b"BYE");
        self.state = State::Leaving { by_client };
    }

    /// Keeps values as the newest ones, if all of them are valid.
    fn keep(&mut self, values: Values<'_>) -> bool {
        let Some(client) = &mut self.client else {
            return false;
        };
        let counts = client.counts;
        let is_right = |item: &(Channel, Number)| item.0.kind.is_output() && counts.has(item.0);
        let Ok(items) = values.collect::<Result<Vec<_>, _>>() else {
            return false;
        };
        if !items.iter().all(is_right) {
            return false;
        }
        for item in items {
            put(&mut client.outputs, item);
        }
        true
    }

    fn request(&mut self, now: Nanos, line: Vec<u8>) {
        if self.requests.len() >= REQUESTS {
            self.refuse("503 the dispatcher does not answer, and 64 lines wait for it already; send it again later");
            return;
        }
        self.requests.push_back(line);
        self.send_requests(now);
    }

    /// The number of requests sent in this connection that are not carried out yet: the first ones.
    fn under_way(&self) -> usize {
        let asked = self.pings.iter();
        asked.filter(|(asker, _)| *asker == Asker::Request).count()
    }

    fn has_unsent(&self) -> bool {
        self.under_way() < self.requests.len()
    }

    /// Sends as many requests as the dispatcher has room for.
    fn send_requests(&mut self, now: Nanos) {
        if self.state != State::Here {
            return;
        }
        for at in self.under_way()..self.requests.len() {
            if self.to_dispatcher.is_full() {
                break;
            }
            self.to_dispatcher.line(&self.requests[at]);
            self.ask(now, Asker::Request);
        }
    }

    fn ping(&mut self, now: Nanos, asker: Asker) {
        if self.to_dispatcher.is_full() {
            self.traffic.dropped += u64::from(asker == Asker::Client);
            return;
        }
        self.ask(now, asker);
    }

    fn ask(&mut self, now: Nanos, asker: Asker) {
        self.to_dispatcher.line(b"PING");
        self.sent = now;
        self.pings.push_back((asker, now));
    }

    /// The dispatcher has sent a line.
    fn obey(&mut self, now: Nanos, line: &[u8]) -> Result<(), String> {
        if std::mem::take(&mut self.awaits_key) {
            return self.key_answered(line);
        }
        if line == b"OK PING" {
            let asker = self.pings.pop_front().map(|(asker, _)| asker);
            match (asker, self.state) {
                (Some(Asker::Client), _) => self.pass(line),
                // While the client leaves, the requests are those for the next connection.
                (Some(Asker::Request), State::Here) => {
                    self.requests.pop_front();
                    self.send_requests(now);
                }
                (Some(Asker::Settled), State::Here) => self.pass_losses(),
                _ => {}
            }
            return Ok(());
        }
        match self.state {
            State::Away | State::Refused | State::Leaving { by_client: false } => {}
            State::Stranger if self.key.is_none() && line.starts_with(b"ERR 401") => {
                self.pass(line);
                return self.wants_key(line);
            }
            // A dispatcher with a key closes a connection that states none.
            State::Stranger if self.key.is_none() && line.starts_with(b"ERR 408") => {
                return self.wants_key(line);
            }
            State::Introduced => self.introduced(now, line)?,
            State::Leaving { by_client: true } | State::Stranger | State::Here => self.pass(line),
        }
        Ok(())
    }

    /// The dispatcher has answered the key.
    fn key_answered(&mut self, line: &[u8]) -> Result<(), String> {
        let Err(refused) = Key::answered(line) else {
            return Ok(());
        };
        // What listens there may have returned the key, so the line is not repeated.
        let refused = refused.to_string();
        if let Some(client) = &mut self.client
            && std::mem::take(&mut client.is_waiting)
        {
            self.say(refused.as_bytes());
        }
        self.state = State::Refused;
        Err(format!("it answers {refused}"))
    }

    /// The dispatcher refuses a client without a key.
    fn wants_key(&mut self, line: &[u8]) -> Result<(), String> {
        self.state = State::Refused;
        Err(format!(
            "it answers {}; if the laboratory has a key, start the bridge with --key-file",
            shown(line)
        ))
    }

    /// The dispatcher has answered the identification.
    fn introduced(&mut self, now: Nanos, line: &[u8]) -> Result<(), String> {
        let Some(client) = &mut self.client else {
            return Ok(());
        };
        let is_first = std::mem::take(&mut client.is_waiting);
        if line.starts_with(b"ERR ") {
            if is_first {
                self.pass(line);
            }
            // The name is taken, as it is for a while when a cable was pulled; there are too many clients; or the laboratory
            // has a key.
            if [b"ERR 401", b"ERR 409", b"ERR 429"]
                .iter()
                .any(|code| line.starts_with(*code))
            {
                if line.starts_with(b"ERR 401") {
                    return self.wants_key(line);
                }
                self.state = State::Refused;
                return Err(format!("it answers {}", shown(line)));
            }
            self.client = None;
            self.requests.clear();
            self.state = State::Stranger;
            return Ok(());
        }
        self.to_dispatcher.newest(&client.outputs);
        self.state = State::Here;
        self.pass(line);
        self.ask(now, Asker::Settled);
        self.send_requests(now);
        Ok(())
    }

    /// Reports to the client the inputs that have had no value since the dispatcher was away: their sources are gone.
    fn pass_losses(&mut self) {
        if let Some(client) = &mut self.client {
            let none = if client.hears_losses {
                Number::LOST
            } else {
                Number::ZERO
            };
            let stale = std::mem::take(&mut client.stale);
            let losses: Vec<_> = stale.into_iter().map(|channel| (channel, none)).collect();
            for loss in &losses {
                put(&mut client.inputs, *loss);
            }
            self.to_serial.newest(&losses);
        }
    }

    /// Passes a line of the dispatcher on.
    fn pass(&mut self, line: &[u8]) {
        self.traffic.heard += 1;
        if let Some(values) = line.strip_prefix(b"P ")
            && let Ok(items) = Values::delivered(values).collect::<Result<Vec<_>, _>>()
        {
            if let Some(client) = &mut self.client {
                for item in items.iter().filter(|item| client.counts.has(item.0)) {
                    put(&mut client.inputs, *item);
                    client.stale.retain(|channel| *channel != item.0);
                }
            }
            self.to_serial.values(line, &items);
        } else {
            self.to_serial.line(line);
        }
    }

    fn refuse(&mut self, why: &str) {
        self.traffic.dropped += 1;
        self.say(format!("ERR {why}").as_bytes());
    }

    /// Sends a line from the bridge itself.
    fn say(&mut self, line: &[u8]) {
        // A flood of mistakes gets no more answers than the line can carry.
        if !self.to_serial.is_full() {
            self.to_serial.line(line);
        }
    }
}

/// The beginning of a line of the dispatcher, for a message: what listens there may be anything.
fn shown(line: &[u8]) -> String {
    const LONGEST: usize = 200;

    printable(&line[..line.len().min(LONGEST)])
}

impl Speaker for AsciiBridge {
    fn connected(&mut self, now: Nanos) {
        self.from_dispatcher = Lines::default();
        self.to_dispatcher.clear();
        self.pings.clear();
        self.sent = now;
        self.heard = now;
        self.awaits_key = self.key.is_some();
        if let Some(key) = &self.key {
            self.to_dispatcher.line(key.line().as_bytes());
        }
        self.state = match &mut self.client {
            Some(client) => {
                let values = client.inputs.iter();
                let values = values.filter(|item| ![Number::ZERO, Number::LOST].contains(&item.1));
                client.stale = values.map(|item| item.0).collect();
                self.to_dispatcher.line(&client.line);
                State::Introduced
            }
            None => State::Stranger,
        };
    }

    fn disconnected(&mut self) -> bool {
        if self.state == State::Refused {
            return false;
        }
        let state = std::mem::replace(&mut self.state, State::Away);
        if state == State::Here {
            self.say(AWAY);
        }
        matches!(state, State::Leaving { .. })
    }

    fn is_here(&self) -> bool {
        self.state == State::Here
    }

    fn deadline(&self) -> Nanos {
        if self.is_apart() {
            return Nanos::MAX;
        }
        if !self.unread.is_empty() && !self.must_wait() {
            return Nanos::ZERO;
        }
        if self.wants_to_hear() {
            self.sent.min(self.waits_since().unwrap_or(self.heard)) + ALIVE
        } else {
            self.sent + ALIVE
        }
    }

    fn tick(&mut self, now: Nanos) -> Result<(), String> {
        self.resume(now);
        if self.is_apart() {
            return Ok(());
        }
        let is_due = |since: Nanos| now - since >= ALIVE;
        let waits_since = self.waits_since();
        let wants = self.wants_to_hear();
        if wants && waits_since.is_some_and(is_due) {
            return Err(format!("it has not answered for {ALIVE}"));
        }
        if is_due(self.sent) || wants && waits_since.is_none() && is_due(self.heard) {
            self.ping(now, Asker::Bridge);
        }
        Ok(())
    }

    fn wants_to_hear(&self) -> bool {
        !self.to_serial.is_full()
    }

    fn to_write(&mut self) -> &[u8] {
        self.to_dispatcher.next_bytes()
    }

    fn wrote(&mut self, now: Nanos, count: usize) {
        self.sent = now;
        self.to_dispatcher.wrote(count);
        self.send_requests(now);
    }

    fn hear(&mut self, now: Nanos, mut bytes: &[u8]) -> Result<(), String> {
        self.heard = now;
        while let Some(cut) = self.from_dispatcher.next(&mut bytes) {
            if let Cut::Line(line) = cut {
                self.obey(now, &line)?;
            }
        }
        self.resume(now);
        Ok(())
    }
}
