//! The dispatcher without its sockets: lines in, lines out; the caller passes the time.

mod guard;
mod laboratory;
mod names;
mod operator;
mod requests;
mod saving;
mod silence;

use std::net::SocketAddr;

use tickbus_base::time::Nanos;
use tickbus_net::{IS_BROWSER, begins_like_browser, may_become_browser};

use crate::board::{Board, OnLoss, Traffic};
use crate::channel::{Channel, Counts};
use crate::device::{Device, Role};
use crate::federation::{Federation, Request};
use crate::grammar::{self, Channels, Identification, Joints, LONGEST_LINE, Line, QUICK, Values};
use crate::host::HostId;
use crate::number::Number;
use crate::patch::{Patch, Pin};
use crate::refusal::{Code, Refusal};

use guard::Guard;
pub use operator::{Order, Reply};
use requests::Waiting;

/// The settings of a dispatcher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// A client that has sent no complete line for this long is disconnected.
    pub idle: Nanos,
    /// The value of an input whose source has gone.
    pub on_loss: OnLoss,
    /// The maximum number of clients at a time.
    pub clients: usize,
}

impl Default for Settings {
    /// The 60 s of the paper, fail-safe, 16,384 clients.
    fn default() -> Self {
        Self {
            idle: Nanos::from_secs(60),
            on_loss: OnLoss::FailSafe,
            clients: 16_384,
        }
    }
}

/// The dispatcher. Each connection has a seat, a number that is reused when it is free.
///
/// Calls that take `now` come between [`woke`](Self::woke) and [`tick`](Self::tick). After them, and after
/// [`saved`](Self::saved) and [`gone`](Self::gone), first save the patch if [`unsaved`](Self::unsaved) returns one; then, for
/// each seat from [`next_touched`](Self::next_touched), send the bytes of [`to_write`](Self::to_write).
#[derive(Debug)]
pub struct Dispatcher {
    settings: Settings,
    guard: Guard,
    board: Board,
    sessions: Vec<Option<Session>>,
    free: Vec<usize>,
    count: usize,
    /// The values of the current line.
    items: Vec<(usize, Number)>,
    /// Seats that were stuck and may continue.
    resumable: Vec<usize>,
    /// Answers due when the patch is saved.
    promised: Vec<Promised>,
    /// How many of these answers wait for the patch that is being saved; the others came later.
    saving: usize,
    /// When the dispatcher next checks the times of all clients.
    next_look: Nanos,
    /// The shortest `ALIVE` time of any client at the last check or since.
    promise: Nanos,
    /// This process was held up: what is read until the next [`tick`](Self::tick) may have waited for long.
    is_catching_up: bool,
    /// The other dispatchers of the laboratory, if there can be any.
    federation: Option<Box<Federation>>,
    /// Requests that wait for answers of other dispatchers.
    waiting: Vec<Waiting>,
}

#[derive(Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "independent facts about a client"
)]
struct Session {
    peer: SocketAddr,
    /// When the client's last complete line came, or the connection was made. Lines before the key do not count.
    heard: Nanos,
    /// Bytes that have arrived but were not processed yet.
    begun: Vec<u8>,
    /// The rest of the current line is too long, and is skipped.
    is_skipping: bool,
    /// The client has stated the key of the laboratory, or there is none.
    is_admitted: bool,
    is_version_2: bool,
    /// The client has promised a line at least this often.
    alive: Option<Nanos>,
    /// The client has broken that promise, and has sent no line since.
    is_silent: bool,
    progress: Progress,
}

/// When the dispatcher looks at a client's next line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    /// As soon as it comes.
    Going,
    /// When the client has read its answers, or its patch was saved.
    Stuck,
    /// Never: the connection is to be closed.
    Closing,
}

/// An answer due when the patch is saved.
#[derive(Debug)]
struct Promised {
    author: Author,
    /// Inputs that then get the value of their new source.
    sinks: Vec<Pin>,
}

/// The author of a change of the patch.
#[derive(Debug)]
enum Author {
    Client {
        seat: usize,
        verb: &'static str,
    },
    Operator(Reply),
    /// Another dispatcher, by its request of this number.
    Host {
        host: HostId,
        number: u32,
    },
    /// A client that has left since. Its changes are saved anyway.
    Nobody,
}

impl Author {
    fn is(&self, seat: usize) -> bool {
        matches!(self, Self::Client { seat: it, .. } if *it == seat)
    }
}

impl Dispatcher {
    /// A dispatcher without clients.
    pub fn new(settings: Settings, patch: Patch) -> Self {
        Self {
            settings,
            guard: Guard::default(),
            board: Board::new(patch, settings.on_loss),
            sessions: Vec::new(),
            free: Vec::new(),
            count: 0,
            items: Vec::new(),
            resumable: Vec::new(),
            promised: Vec::new(),
            saving: 0,
            next_look: Nanos::MAX,
            promise: Nanos::MAX,
            is_catching_up: false,
            federation: None,
            waiting: Vec::new(),
        }
    }

    /// All connections between channels.
    pub fn patch(&self) -> &Patch {
        self.board.patch()
    }

    /// The traffic so far.
    pub fn traffic(&self) -> Traffic {
        self.board.traffic
    }

    /// The number of clients.
    pub fn clients(&self) -> usize {
        self.count
    }

    /// A client has connected; returns its seat.
    ///
    /// # Errors
    ///
    /// The number of clients has reached the settings' maximum, and all of them have stated the key, if there is one. Send
    /// the client this refusal, and close.
    pub fn connected(&mut self, now: Nanos, peer: SocketAddr) -> Result<usize, Refusal> {
        let most = self.settings.clients;
        if self.count >= most && !self.make_room() {
            return Err(Code::Limit.because(format_args!(
                "{most} clients are here, and no more are served"
            )));
        }
        let seat = self.take_seat();
        self.count += 1;
        self.sessions[seat] = Some(Session {
            peer,
            heard: now,
            begun: Vec::new(),
            is_skipping: false,
            is_admitted: !self.guard.is_closed(),
            is_version_2: false,
            alive: None,
            is_silent: false,
            progress: Progress::Going,
        });
        if self.guard.is_closed() {
            self.guard.strangers.insert((now, seat));
        }
        let patience = self.patience(seat);
        self.next_look = self.next_look.min(now + patience);
        Ok(seat)
    }

    /// A free seat on the board, for a connection or for another dispatcher and its clients.
    fn take_seat(&mut self) -> usize {
        let seat = self.free.pop().unwrap_or_else(|| {
            self.sessions.push(None);
            self.sessions.len() - 1
        });
        self.board.seat(seat);
        seat
    }

    /// The connection of a seat was lost or closed.
    pub fn gone(&mut self, seat: usize) {
        if let Some(session) = self.sessions[seat].take() {
            self.count -= 1;
            self.guard.strangers.remove(&(session.heard, seat));
            let promised = self.promised.iter_mut().map(|it| &mut it.author);
            let waiting = self.waiting.iter_mut().map(|it| &mut it.author);
            for author in promised.chain(waiting).filter(|author| author.is(seat)) {
                *author = Author::Nobody;
            }
            self.board.unplug(seat);
            self.settle();
            self.free.push(seat);
        }
    }

    /// True if the dispatcher wants bytes of this client now. If not, the client has to read its answers first.
    pub fn wants_bytes(&self, seat: usize) -> bool {
        self.session(seat)
            .is_some_and(|session| session.progress == Progress::Going)
    }

    /// True if the connection is to be closed once its answers are written.
    pub fn is_closing(&self, seat: usize) -> bool {
        self.session(seat)
            .is_some_and(|session| session.progress == Progress::Closing)
    }

    /// A seat with something to write or to be closed, each once.
    pub fn next_touched(&mut self) -> Option<usize> {
        self.board.next_touched()
    }

    /// The bytes to be written to a client now.
    pub fn to_write(&mut self, seat: usize) -> &[u8] {
        if let Some(session) = &self.sessions[seat] {
            self.board.refill(seat, session.is_version_2);
        }
        self.board.to_write(seat)
    }

    /// The system has accepted this many bytes for a client.
    pub fn wrote(&mut self, seat: usize, count: usize) {
        self.board.outbox(seat).wrote(count);
        let is_stuck = self
            .session(seat)
            .is_some_and(|session| session.progress == Progress::Stuck);
        if is_stuck
            && self.may_answer(seat)
            && !self.is_owed_answer(seat)
            && let Some(session) = &mut self.sessions[seat]
        {
            session.progress = Progress::Going;
            self.resumable.push(seat);
        }
    }

    /// True if a client gets no answer before the patch is saved, or before another dispatcher has answered.
    fn is_owed_answer(&self, seat: usize) -> bool {
        let promised = self.promised.iter().map(|it| &it.author);
        let waiting = self.waiting.iter().map(|it| &it.author);
        promised.chain(waiting).any(|author| author.is(seat))
    }

    /// When [`tick`](Self::tick) has something to do even if nothing arrives.
    pub fn deadline(&self) -> Nanos {
        if self.resumable.is_empty() {
            self.next_look.min(self.next_beat())
        } else {
            Nanos::ZERO
        }
    }

    /// Bytes have arrived from a client, in any pieces.
    pub fn arrived(&mut self, now: Nanos, seat: usize, bytes: &[u8]) {
        let Some(session) = &mut self.sessions[seat] else {
            return;
        };
        if session.begun.is_empty() {
            let taken = self.work(now, seat, bytes);
            if let Some(session) = &mut self.sessions[seat] {
                session.begun.extend_from_slice(&bytes[taken..]);
            }
            return;
        }
        session.begun.extend_from_slice(bytes);
        let mut begun = std::mem::take(&mut session.begun);
        let taken = self.work(now, seat, &begun);
        if let Some(session) = &mut self.sessions[seat] {
            begun.drain(..taken);
            if begun.is_empty() && begun.capacity() > 2 * LONGEST_LINE {
                begun = Vec::new();
            }
            session.begun = begun;
        }
    }

    /// Processes the complete lines at the beginning of `bytes`; returns how many bytes those were.
    fn work(&mut self, now: Nanos, seat: usize, bytes: &[u8]) -> usize {
        let mut at = 0;
        let mut counts = self.board.device(seat).map(|device| device.counts);
        while at < bytes.len() {
            // The first line of a client that was silent is processed alone: it restores the values of all outputs of
            // that client.
            let (is_skipping, is_silent) = match &self.sessions[seat] {
                Some(session) if session.progress == Progress::Closing => return bytes.len(),
                Some(session) if session.progress == Progress::Going => {
                    (session.is_skipping, session.is_silent)
                }
                _ => break,
            };
            let rest = &bytes[at..];
            let quick = counts.filter(|_| !is_skipping && !is_silent);
            let quick = quick.map_or(0, |counts| self.quick_lines(seat, rest, counts));
            let Some(session) = &mut self.sessions[seat] else {
                break;
            };
            if quick > 0 {
                self.heard(now, seat);
                at += quick;
                continue;
            }
            if !session.is_skipping && may_become_browser(rest) {
                break;
            }
            let Some(end) = rest.iter().position(|byte| *byte == b'\n') else {
                if session.is_skipping {
                    return bytes.len();
                }
                if rest.len() >= LONGEST_LINE && begins_like_browser(rest) {
                    self.refuse_browser(seat);
                    return bytes.len();
                }
                if rest.len() >= LONGEST_LINE {
                    if may_answer(&mut self.board, seat) {
                        session.is_skipping = true;
                        self.refuse_length(seat);
                        return bytes.len();
                    }
                    session.progress = Progress::Stuck;
                }
                break;
            };
            if !session.is_skipping && !may_answer(&mut self.board, seat) {
                session.progress = Progress::Stuck;
                break;
            }
            at += end + 1;
            let was_skipping = std::mem::take(&mut session.is_skipping);
            self.heard(now, seat);
            self.board.traffic.lines += 1;
            if was_skipping {
                self.speak_again(now, seat);
                continue;
            }
            if begins_like_browser(rest) {
                self.refuse_browser(seat);
                return bytes.len();
            }
            if end >= LONGEST_LINE {
                self.speak_again(now, seat);
                self.refuse_length(seat);
                continue;
            }
            let line = &rest[..end];
            if let Err(refusal) = self.obey(now, seat, line.strip_suffix(b"\r").unwrap_or(line)) {
                self.refuse(seat, &refusal);
            }
            self.speak_again(now, seat);
            counts = self.board.device(seat).map(|device| device.counts);
        }
        at
    }

    /// A line of a client has come. A stranger gets no more time by it.
    #[inline]
    fn heard(&mut self, now: Nanos, seat: usize) {
        if let Some(session) = self.sessions[seat].as_mut().filter(|it| it.is_admitted) {
            session.heard = now;
        }
    }

    /// Processes the lines of values in their usual form at the beginning of `bytes`; returns how many bytes those
    /// were.
    fn quick_lines(&mut self, seat: usize, bytes: &[u8], counts: Counts) -> usize {
        let mut done = 0;
        while let Some(line) = bytes.get(done..)
            && line.starts_with(QUICK)
        {
            let mut value = grammar::quick_value(line, QUICK.len(), counts);
            // Most lines have one value. A longer line takes effect only when all of it was read, since a later part
            // may be wrong.
            self.items.clear();
            while let Some(first) = value.take_if(|it| !it.is_last) {
                self.items.push((first.place, first.number));
                value = grammar::quick_value(line, first.next, counts);
            }
            let Some(last) = value else {
                break;
            };
            self.board.traffic.lines += 1;
            self.set_values(seat);
            self.board.set(seat, last.place, last.number);
            done += last.next;
        }
        done
    }

    /// Carries out a line.
    fn obey(&mut self, now: Nanos, seat: usize, line: &[u8]) -> Result<(), Refusal> {
        let line = grammar::parse(line);
        // New values take precedence over those before the silence, which would otherwise appear for a moment.
        if !matches!(line, Ok(Line::Values(_))) {
            self.speak_again(now, seat);
        }
        let is_admitted = self.session(seat).is_some_and(|it| it.is_admitted);
        if !is_admitted && !matches!(line, Ok(Line::Nothing | Line::Key(_))) {
            return Err(self.refuse_stranger(seat));
        }
        let line = line?;
        let is_plugged = self.board.device(seat).is_some();
        let may_come_first = matches!(
            line,
            Line::Nothing | Line::Key(_) | Line::Identify(_) | Line::Ping | Line::Bye
        );
        if !is_plugged && !may_come_first {
            return Err(Code::IdentifyFirst
                .because("say first who you are, such as VR NAME Q08 I08 AQ02 AI03"));
        }
        self.board.begin_line();
        match line {
            Line::Nothing => {}
            Line::Key(said) => self.unlock(now, seat, said)?,
            Line::Identify(identification) => self.identify(now, seat, identification)?,
            Line::Values(values) => self.values(seat, values)?,
            Line::Connect(joints) => self.connect(seat, joints)?,
            Line::Disconnect(channels) => self.disconnect(seat, channels)?,
            Line::Name(channel, label) => {
                if !self.board.has(seat, channel) {
                    return Err(no_channel("you have", channel));
                }
                self.board.name_channel(seat, channel, label);
                self.confirm(seat, "NAME");
            }
            Line::List { with_names } => {
                self.confirm(seat, "LIST");
                self.board.list(seat, with_names);
            }
            // A client that sends PING wants the answer, in version 1 too.
            Line::Ping => self.board.say(seat, "OK PING"),
            Line::Bye => {
                self.confirm(seat, "BYE");
                if let Some(session) = &mut self.sessions[seat] {
                    session.progress = Progress::Closing;
                }
                self.board.touch(seat);
            }
        }
        Ok(())
    }

    fn identify(
        &mut self,
        now: Nanos,
        seat: usize,
        identification: Identification<'_>,
    ) -> Result<(), Refusal> {
        let Identification {
            role,
            name,
            counts,
            is_version_2,
            hears_losses,
            alive,
        } = identification;
        if let Some(device) = self.board.device(seat) {
            let text = format!(
                "you are {} already; connect once more to be another client",
                device.name
            );
            return Err(Code::Conflict.because(text));
        }
        if let Some(other) = self.board.find_name(name) {
            let host = self.board.host(other).map(|host| format!(" on {host}"));
            let host = host.unwrap_or_default();
            let text = format!("there is a client {name} already{host}; take another name");
            return Err(Code::Conflict.because(text));
        }
        let order = self.next_order(now);
        let Some(session) = &mut self.sessions[seat] else {
            return Ok(());
        };
        session.is_version_2 = is_version_2;
        session.alive = alive;
        if let Some(alive) = alive {
            self.promise = self.promise.min(alive);
            self.next_look = self.next_look.min(now + alive);
        }
        let device = Device {
            role,
            name: name.to_owned(),
            counts,
            peer: session.peer,
        };
        self.board.plug(seat, device, order);
        if hears_losses {
            self.board.hear_losses(seat);
        }
        self.confirm(seat, Role::keyword(role));
        self.board.list(seat, false);
        self.board.refresh_all(seat);
        // As far as there is room: values of this turn have not waited for a client that does not read.
        self.board.refill(seat, is_version_2);
        self.settle();
        Ok(())
    }

    fn values(&mut self, seat: usize, values: Values<'_>) -> Result<(), Refusal> {
        let Some(counts) = self.board.device(seat).map(|device| device.counts) else {
            return Ok(());
        };
        self.items.clear();
        for item in values {
            let (channel, value) = item?;
            if !channel.kind.is_output() {
                let text = format!("{channel} is an input; a client sends values of its outputs");
                return Err(Code::Mismatch.because(text));
            }
            let place = counts
                .place(channel)
                .ok_or_else(|| no_channel("you have", channel))?;
            self.items.push((place, value));
        }
        self.set_values(seat);
        Ok(())
    }

    /// Routes the values of the current line.
    #[inline]
    fn set_values(&mut self, seat: usize) {
        self.board.begin_line();
        for (channel, value) in &self.items {
            self.board.set(seat, *channel, *value);
        }
    }

    fn connect(&mut self, seat: usize, joints: Joints<'_>) -> Result<(), Refusal> {
        let own_name = self.name(seat);
        let mut connections: Vec<(Pin, Pin)> = Vec::new();
        for joint in joints {
            let joint = joint?;
            if !self.board.has(seat, joint.own) {
                return Err(no_channel("you have", joint.own));
            }
            let Some(other) = self.board.find(joint.peer) else {
                return Err(Code::NotFound.because(format_args!(
                    "there is no client {}; LIST shows who is here",
                    joint.peer
                )));
            };
            let peer = self.name(other);
            if !self.board.has(other, joint.channel) {
                return Err(no_channel(&format!("{peer} has"), joint.channel));
            }
            let own = Pin::new(&own_name, joint.own);
            let peer = Pin::new(&peer, joint.channel);
            connections.push(self.joint(own, peer, &connections)?);
        }
        let request = Request {
            connect: connections,
            cut: Vec::new(),
        };
        let verb = "CONNECT";
        self.change(Author::Client { seat, verb }, request);
        Ok(())
    }

    fn disconnect(&mut self, seat: usize, channels: Channels<'_>) -> Result<(), Refusal> {
        let own_name = self.name(seat);
        let mut cut = Vec::new();
        for channel in channels {
            let channel = channel?;
            if !self.board.has(seat, channel) {
                return Err(no_channel("you have", channel));
            }
            let connected = self.joints_at(&Pin::new(&own_name, channel));
            if connected.is_empty() {
                let text = format!("{channel} is not connected");
                return Err(Code::NotFound.because(text));
            }
            cut.extend(connected);
        }
        let (connect, verb) = (Vec::new(), "DISCONNECT");
        self.change(Author::Client { seat, verb }, Request { connect, cut });
        Ok(())
    }

    fn name(&self, seat: usize) -> String {
        let device = self.board.device(seat);
        device.map(|device| device.name.clone()).unwrap_or_default()
    }

    /// Stops looking at further lines of a client until it is answered.
    fn stick(&mut self, seat: usize) {
        if let Some(session) = &mut self.sessions[seat] {
            session.progress = Progress::Stuck;
        }
    }

    fn session(&self, seat: usize) -> Option<&Session> {
        self.sessions.get(seat)?.as_ref()
    }

    fn may_answer(&mut self, seat: usize) -> bool {
        may_answer(&mut self.board, seat)
    }

    /// Answers `OK` to a client of version 2.
    fn confirm(&mut self, seat: usize, verb: &str) {
        if self
            .session(seat)
            .is_some_and(|session| session.is_version_2)
        {
            self.board.say(seat, &format!("OK {verb}"));
        }
    }

    fn refuse(&mut self, seat: usize, refusal: &Refusal) {
        self.board.traffic.refused += 1;
        self.board.say(seat, &refusal.to_string());
    }

    /// Closes the connection of a web browser: the text after the head of its request comes from a web site.
    fn refuse_browser(&mut self, seat: usize) {
        if let Some(session) = &mut self.sessions[seat] {
            session.progress = Progress::Closing;
        }
        self.refuse(seat, &Code::Syntax.because(IS_BROWSER));
    }

    /// Refuses a line that is too long. A stranger has no reason to send one, and is closed.
    fn refuse_length(&mut self, seat: usize) {
        if let Some(session) = self.sessions[seat].as_mut().filter(|it| !it.is_admitted) {
            session.progress = Progress::Closing;
        }
        let text = format!("the line has more than {LONGEST_LINE} bytes and was ignored");
        self.refuse(seat, &Code::TooLong.because(text));
    }
}

/// True if a client may get further answers: it has read enough of the last ones.
fn may_answer(board: &mut Board, seat: usize) -> bool {
    let outbox = board.outbox(seat);
    outbox.listing.is_none() && !outbox.is_full()
}

fn no_channel(who_has: &str, channel: Channel) -> Refusal {
    Code::NotFound.because(format_args!("{who_has} no {channel}"))
}
