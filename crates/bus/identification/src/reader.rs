//! A simulated reader, without I/O: commands in, answers out.

use tickbus_base::time::Nanos;

use crate::answer::{append, append_bare};
use crate::command::{COMMAND_LIMIT, PAGE};
use crate::{Access, CarrierType, Command, Family, Heads, Status, Timing};

/// Heads of a reader.
pub const HEADS: usize = 4;

/// The period of a repeated command. The manual does not state a reader's own pace.
const REPEAT: Nanos = Nanos::from_millis(50);

/// The most bytes of answers that wait; a reader whose client does not read drops further ones.
const OUTBOX: usize = 4096;

/// The answer to `v`.
pub const VERSION: &[u8] = b"tickbus";

/// A carrier in front of a head.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Carrier {
    /// The type.
    pub kind: CarrierType,
    /// The octets, as many as the type has.
    pub octets: Vec<u8>,
    /// The number, for `i`; empty for none.
    pub number: Vec<u8>,
    /// True if the carrier rejects writes.
    pub is_protected: bool,
}

impl Carrier {
    /// A carrier of zeros, except for its beginning.
    ///
    /// # Panics
    ///
    /// When the beginning is longer than the carrier.
    pub fn new(kind: CarrierType, beginning: &[u8]) -> Self {
        let mut octets = vec![0; kind.size()];
        octets[..beginning.len()].copy_from_slice(beginning);
        Self {
            kind,
            octets,
            number: Vec::new(),
            is_protected: false,
        }
    }
}

/// A head of a reader.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// True if the head is connected to the reader.
    pub is_connected: bool,
    /// The carrier in front of the head.
    pub carrier: Option<Carrier>,
    /// The answer to each command in place of its execution, except for [`BATTERY_LOW`](Status::BATTERY_LOW), the
    /// status of a command that was executed.
    pub fault: Option<Status>,
    /// The number of writes to its carriers.
    pub writes: u8,
}

/// The simulated reader.
#[derive(Debug)]
pub struct Reader {
    heads: [Head; HEADS],
    carriers: Family,
    timing: Timing,
    inbox: Vec<u8>,
    /// The pending answer for when the line is silent: the command's character, and the error.
    broken: Option<(u8, Status)>,
    heard: Nanos,
    /// The repeated command, and the time of its next execution.
    auto: Option<(Vec<u8>, Nanos)>,
    outbox: Vec<u8>,
    written: usize,
}

/// The input that a reader has processed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heard {
    /// The number of commands executed, or refused with a status.
    pub commands: usize,
    /// The number of times that bytes made no sense.
    pub damaged: usize,
}

impl Reader {
    /// A reader after power-on, with these heads. Only the rate of the timing is used.
    pub fn new(heads: [Head; HEADS], timing: Timing) -> Self {
        Self {
            heads,
            carriers: Family::default(),
            timing,
            inbox: Vec::new(),
            broken: None,
            heard: Nanos(0),
            auto: None,
            outbox: Vec::new(),
            written: 0,
        }
    }

    /// The head with this number, from 1 to 4.
    ///
    /// # Panics
    ///
    /// When the number is a different one.
    pub fn head(&self, number: u8) -> &Head {
        &self.heads[usize::from(number) - 1]
    }

    /// The head with this number, mutable.
    ///
    /// # Panics
    ///
    /// When the number is a different one.
    pub fn head_mut(&mut self, number: u8) -> &mut Head {
        &mut self.heads[usize::from(number) - 1]
    }

    /// The bytes to send.
    pub fn to_write(&self) -> &[u8] {
        &self.outbox[self.written..]
    }

    /// The first `count` bytes of [these](Self::to_write) were sent.
    pub fn wrote(&mut self, count: usize) {
        self.written += count;
        if self.written == self.outbox.len() {
            self.outbox.clear();
            self.written = 0;
        }
    }

    /// The line was unplugged: bytes under way are lost. Heads, the type of carriers and a repeated command stay.
    pub fn unplug(&mut self) {
        self.inbox.clear();
        self.broken = None;
        self.outbox.clear();
        self.written = 0;
    }

    /// Bytes arrived.
    pub fn hear(&mut self, now: Nanos, bytes: &[u8]) -> Heard {
        let mut heard = self.turn(now);
        self.heard = now;
        if self.broken.is_some() {
            return heard;
        }
        let mut inbox = std::mem::take(&mut self.inbox);
        inbox.extend_from_slice(bytes);
        let mut rest = &inbox[..];
        while let Some(&first) = rest.first() {
            match Command::parse(rest, self.carriers) {
                Ok(None) => break,
                Ok(Some((command, length))) => {
                    heard.commands += 1;
                    self.begin(now, &command, first, &rest[..length]);
                    rest = &rest[length..];
                }
                Err(refused) => {
                    let Some(length) = refused.length else {
                        self.broken = Some((first, refused.status));
                        rest = &[];
                        break;
                    };
                    heard.damaged += usize::from(refused.status == Status::LINE_CHECKSUM);
                    heard.commands += 1;
                    self.answer(first, refused.status, None, &[]);
                    rest = &rest[length..];
                }
            }
        }
        let taken = inbox.len() - rest.len();
        inbox.drain(..taken);
        debug_assert!(inbox.len() < COMMAND_LIMIT, "a whole command is taken");
        self.inbox = inbox;
        heard
    }

    /// Does the work due at `now`: answers invalid input once the line is silent, and repeats the repeated command.
    pub fn turn(&mut self, now: Nanos) -> Heard {
        let mut heard = Heard::default();
        if now - self.heard >= self.timing.silence() {
            let incomplete = self
                .inbox
                .first()
                .map(|first| (*first, Status::LINE_CHECKSUM));
            if let Some((first, status)) = self.broken.take().or(incomplete) {
                heard.damaged = 1;
                self.inbox.clear();
                self.answer(first, status, None, &[]);
            }
        }
        // A client that does not read its answers gets no more of them.
        if self.outbox.is_empty()
            && let Some((frame, due)) = self.auto.take()
        {
            if due > now {
                self.auto = Some((frame, due));
            } else {
                // Parsed earlier; still valid unless the carrier type has changed.
                if let Ok(Some((Command::Access { heads, access, .. }, _))) =
                    Command::parse(&frame, self.carriers)
                {
                    self.access(frame[0], heads, &access);
                    heard.commands += 1;
                }
                self.auto = Some((frame, now + REPEAT));
            }
        }
        heard
    }

    /// When [`turn`](Self::turn) has something to do; [`Nanos::MAX`] for never.
    pub fn deadline(&self) -> Nanos {
        let silent = if self.broken.is_some() || !self.inbox.is_empty() {
            self.heard + self.timing.silence()
        } else {
            Nanos::MAX
        };
        let due = self.auto.as_ref().filter(|_| self.outbox.is_empty());
        due.map_or(silent, |(_, due)| silent.min(*due))
    }

    fn answer(&mut self, first: u8, status: Status, head: Option<u8>, data: &[u8]) {
        if self.outbox.len() < OUTBOX {
            append(first, status, head, data, &mut self.outbox);
        }
    }

    /// Executes a command for the first time.
    fn begin(&mut self, now: Nanos, command: &Command<'_>, first: u8, frame: &[u8]) {
        match command {
            Command::Access {
                heads,
                is_auto,
                access,
            } => {
                if *is_auto {
                    self.auto = Some((frame.to_vec(), now + REPEAT));
                }
                self.access(first, *heads, access);
                return;
            }
            Command::SetCarriers(family) => self.carriers = *family,
            Command::CheckMemory => return self.answer(first, Status::DONE, None, &[]),
            Command::Version => return self.answer(first, Status::DONE, None, VERSION),
            Command::DoubleSided => {}
            Command::ResetReader => {
                self.auto = None;
                self.carriers = Family::default();
            }
            Command::EndAuto => self.auto = None,
        }
        if self.outbox.len() < OUTBOX {
            append_bare(first, &mut self.outbox);
        }
    }

    fn access(&mut self, first: u8, heads: Heads, access: &Access<'_>) {
        match heads {
            // No head executes it, so the reader itself answers. The next command switches the heads on.
            Heads::Off => self.answer(first, Status::DONE, None, &[]),
            Heads::One(number) => {
                self.access_one(first, number, false, access);
            }
            Heads::All => {
                let mut found = 0;
                for number in 1..=4 {
                    let head = self.head(number);
                    if !head.is_connected || head.carrier.is_none() {
                        continue;
                    }
                    found += 1;
                    self.access_one(first, number, true, access);
                    if access.writes() {
                        break;
                    }
                }
                if found == 0 {
                    let any = self.heads.iter().any(|head| head.is_connected);
                    let status = if any {
                        Status::NO_CARRIER
                    } else {
                        Status::NO_HEAD
                    };
                    self.answer(first, status, None, &[]);
                }
            }
        }
    }

    fn access_one(&mut self, first: u8, number: u8, is_of_all: bool, access: &Access<'_>) {
        let shown = is_of_all.then_some(number);
        let carriers = self.carriers;
        if self.outbox.len() >= OUTBOX {
            return;
        }
        match self.head_mut(number).execute(carriers, access) {
            Err(status) => self.answer(first, status, shown, &[]),
            Ok(data) => {
                let head = &self.heads[usize::from(number) - 1];
                let status = head.fault.unwrap_or(Status::DONE);
                let carrier = head.carrier.as_ref();
                let data = carrier.map_or(&[][..], |carrier| match data {
                    Source::Nothing => &[],
                    Source::Octets(from, count) => &carrier.octets[from..from + count],
                    Source::Number => &carrier.number,
                });
                append(first, status, shown, data, &mut self.outbox);
            }
        }
    }
}

/// The source of an answer's data.
enum Source {
    Nothing,
    Octets(usize, usize),
    Number,
}

impl Head {
    fn execute(&mut self, carriers: Family, access: &Access<'_>) -> Result<Source, Status> {
        if !self.is_connected {
            return Err(Status::NO_HEAD);
        }
        if let Some(fault) = self.fault.filter(|fault| !fault.is_done()) {
            return Err(fault);
        }
        let carrier = self.carrier.as_mut().ok_or(Status::NO_CARRIER)?;
        let kind = carrier.kind;
        if kind.family() != carriers {
            return Err(Status::UNSUPPORTED);
        }
        let page = |page: u16| {
            let address = usize::from(page) * PAGE;
            let fits = address + PAGE <= kind.size();
            fits.then_some(address).ok_or(Status::OUT_OF_RANGE)
        };
        let within = |address: u16, length: usize| {
            let fits = kind.has(address, length);
            fits.then_some(usize::from(address))
                .ok_or(Status::OUT_OF_RANGE)
        };
        let (at, data): (usize, &[u8]) = match *access {
            Access::ReadStart => return Ok(Source::Octets(0, 32)),
            Access::Read { address, length } => {
                let length = usize::from(length);
                return Ok(Source::Octets(within(address, length)?, length));
            }
            Access::ReadNumber if carrier.number.is_empty() => return Err(Status::UNSUPPORTED),
            Access::ReadNumber => return Ok(Source::Number),
            Access::ReadPage(_) if kind == CarrierType::Idc => return Err(Status::UNSUPPORTED),
            Access::ReadPage(number) => return Ok(Source::Octets(page(number)?, PAGE)),
            Access::WritePage { .. } if carriers != Family::Imc40 => {
                return Err(Status::UNSUPPORTED);
            }
            Access::WritePage { page: number, data } => (page(number)?, data),
            Access::Write { address, data } => (within(address, data.len())?, data),
            Access::Reset if carriers == Family::Imc40 => return Err(Status::UNSUPPORTED),
            Access::Reset => (
                0,
                if kind == CarrierType::Idc {
                    &RESET_IDC
                } else {
                    &[]
                },
            ),
        };
        if carrier.is_protected {
            return Err(Status::WRITE_ERROR);
        }
        carrier.octets[at..at + data.len()].copy_from_slice(data);
        self.writes = self.writes.wrapping_add(1);
        Ok(Source::Nothing)
    }
}

/// The content of an IDC after a reset: words AAAB, and AAAA as the last one. The reset of an IDC-1K changes no data.
const RESET_IDC: [u8; 32] = {
    let mut octets = [0xAA; 32];
    let mut word = 0;
    while word < 15 {
        octets[2 * word + 1] = 0xAB;
        word += 1;
    }
    octets
};

#[cfg(test)]
mod tests;
