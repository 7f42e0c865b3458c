//! One reader and its heads, asked in turn, without I/O.

use std::io;

use tickbus_base::time::{Nanos, Pace};
use tickbus_fieldbus::tcp::Caller;
use tickbus_fieldbus::{BusError, Cause, PlcState, Port, Receipt};
use tickbus_net::serial::gone;

use super::{ClientOptions, INPUTS, NO_ANSWER};
use crate::{Access, Answer, CarrierType, Client, Command, Outcome, PAGE, Status};

/// The bit of a command that toggles with each new one.
const TOGGLE: u8 = 0x80;

/// A carrier is in front of the head.
const PRESENT: u8 = 1;
/// The head is there.
const CONNECTED: u8 = 2;

/// A station, which is a head.
#[derive(Debug)]
pub(crate) struct Station {
    head: u8,
    /// The controller's inputs: the last command's echo, its status, flags, length, data.
    frame: Vec<u8>,
    /// A command was sent, but not answered yet.
    sent: Option<u8>,
    receipt: Option<Receipt>,
    /// The station was reported as left.
    is_left: bool,
}

impl Station {
    pub(crate) fn new(head: u8, bytes: usize) -> Self {
        Self {
            head,
            frame: vec![0; bytes],
            sent: None,
            receipt: None,
            is_left: false,
        }
    }

    /// Shows the outcome of a command.
    fn show(&mut self, echo: u8, status: u8, data: &[u8]) {
        let room = &mut self.frame[INPUTS.len()..];
        room.fill(0);
        room[..data.len()].copy_from_slice(data);
        self.frame[0] = echo;
        self.frame[1] = status;
        self.frame[3] = u8::try_from(data.len()).unwrap_or(u8::MAX);
    }

    fn set_flags(&mut self, status: Status) {
        self.frame[2] = match status {
            _ if status.is_of_the_head() => 0,
            Status::NO_CARRIER => CONNECTED,
            _ if status.is_of_a_carrier() => CONNECTED | PRESENT,
            // This status does not concern a carrier.
            _ => CONNECTED | self.frame[2] & PRESENT,
        };
    }

    /// The command in the controller's outputs, if it is a new one.
    fn new_command<'a>(
        &self,
        frame: &'a [u8],
        carriers: CarrierType,
    ) -> Option<Result<Access<'a>, u8>> {
        let [command, length, high, low, data @ ..] = frame else {
            return None;
        };
        if (command ^ self.frame[0]) & TOGGLE == 0 {
            return None;
        }
        let room = self.frame.len() - INPUTS.len();
        let address = u16::from_be_bytes([*high, *low]);
        let count = usize::from(*length);
        let out_of_range = Err(Status::OUT_OF_RANGE.0);
        let (access, answer) = match command & !TOGGLE {
            // No command: the echo follows the toggle bit.
            0 | b'q' => return Some(Err(Status::DONE.0)),
            b'a' => (Access::ReadStart, 32),
            b'w' => (
                Access::Read {
                    address,
                    length: *length,
                },
                count,
            ),
            b'k' => match data.get(..count) {
                None => return Some(out_of_range),
                Some(data) => (Access::Write { address, data }, 0),
            },
            b'i' => (Access::ReadNumber, 0),
            b'h' => (Access::Reset, 0),
            b'l' => (Access::ReadPage(address), PAGE),
            b'm' => match data.first_chunk() {
                None => return Some(out_of_range),
                Some(data) => (
                    Access::WritePage {
                        page: address,
                        data,
                    },
                    0,
                ),
            },
            _ => return Some(Err(Status::UNKNOWN_COMMAND.0)),
        };
        let fits = match access {
            Access::Read { address, length } => carriers.has(address, usize::from(length)),
            Access::Write { address, data } => carriers.has(address, data.len()),
            // Higher numbers do not fit into three digits.
            Access::ReadPage(page) | Access::WritePage { page, .. } => page <= 0xFFF,
            _ => true,
        };
        Some(if fits && answer <= room {
            Ok(access)
        } else {
            out_of_range
        })
    }
}

/// The last request to the reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asked {
    /// End a command that another program had repeated.
    EndAuto,
    /// Set this type of carriers.
    SetCarriers,
    /// The controller's command for this station.
    Command(usize),
    /// Check for a carrier.
    Presence(usize),
}

/// The client's end of a line that is open.
pub(super) struct Session<'a> {
    options: &'a ClientOptions,
    stations: &'a mut [Station],
    client: Client,
    asked: Option<Asked>,
    /// The reader has been set up.
    is_set_up: bool,
    cycle: Nanos,
    pace: Pace,
    /// When it last checked for due work.
    looked: Nanos,
    skipped: u64,
    /// The line's message while the reader answers.
    running: String,
}

impl<'a> Session<'a> {
    pub(super) fn new(
        options: &'a ClientOptions,
        stations: &'a mut [Station],
        cycle: Nanos,
        now: Nanos,
    ) -> Self {
        for station in &mut *stations {
            // A command under way when the line broke is not sent again: there may be another carrier by now.
            if let Some(sent) = station.sent.take() {
                station.show(sent, NO_ANSWER, &[]);
            }
            station.receipt = None;
        }
        Self {
            client: Client::new(options.line.carriers, options.line.timing(options.timeout)),
            options,
            stations,
            asked: None,
            is_set_up: false,
            cycle,
            pace: Pace::new(now, cycle),
            looked: now,
            skipped: 0,
            running: format!("the reader on {} answers", options.line.device),
        }
    }

    fn device(&self) -> &str {
        &self.options.line.device
    }

    /// Begins a cycle; with the set-up, if the reader needs it.
    fn begin(&mut self, now: Nanos, port: &mut Port) {
        if self.is_set_up {
            self.go_on(0, now, port);
        } else {
            self.ask(now, Asked::EndAuto, &Command::EndAuto);
        }
    }

    fn ask(&mut self, now: Nanos, asked: Asked, command: &Command<'_>) {
        self.client.ask(now, command);
        self.asked = Some(asked);
    }

    /// Asks the next head from this one on, or ends the cycle.
    fn go_on(&mut self, from: usize, now: Nanos, port: &mut Port) {
        for index in from..self.stations.len() {
            if !port.is_station_up(index, now) {
                continue;
            }
            let is_paused = port
                .watchdog()
                .is_some_and(|limit| port.tick_age(now) > limit);
            let Some(mut frames) = port.look(index..index + 1, now) else {
                return;
            };
            let frame = frames.frame(index);
            let station = &mut self.stations[index];
            let given = frame.first().copied().unwrap_or(0);
            // The fail-safe 0 of a paused controller is no command: if the echo followed it, the last command would be
            // a new one when the controller continues.
            let command = if is_paused && given & !TOGGLE == 0 {
                None
            } else {
                station.new_command(frame, self.options.line.carriers)
            };
            let (asked, access) = match command {
                Some(Ok(access)) => {
                    station.sent = Some(given);
                    (Asked::Command(index), access)
                }
                refused => {
                    if let Some(Err(status)) = refused {
                        station.show(given, status, &[]);
                    }
                    let one = Access::Read {
                        address: 0,
                        length: 1,
                    };
                    (Asked::Presence(index), one)
                }
            };
            let head = station.head;
            self.ask(now, asked, &Command::once(head, access));
            self.stations[index].receipt = Some(frames.receipt());
            return;
        }
    }

    fn answered(&mut self, answer: Answer, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        match self.asked.take() {
            None => {}
            Some(Asked::EndAuto) => {
                let family = self.options.line.carriers.family();
                self.ask(now, Asked::SetCarriers, &Command::SetCarriers(family));
            }
            Some(Asked::SetCarriers) => {
                if !answer.status.is_done() {
                    let carriers = self.options.line.carriers.name();
                    return Err(BusError::Refused(format!(
                        "the reader on {} does not work with carriers of type {carriers}: {}",
                        self.device(),
                        answer.status
                    )));
                }
                self.is_set_up = true;
                self.go_on(0, now, port);
            }
            Some(Asked::Command(index)) => {
                let station = &mut self.stations[index];
                if let Some(sent) = station.sent.take() {
                    let data = self.client.data();
                    let room = station.frame.len() - INPUTS.len();
                    // The length of a code carrier's number is not known in advance.
                    if data.len() <= room {
                        station.show(sent, answer.status.0, data);
                    } else {
                        station.show(sent, Status::OUT_OF_RANGE.0, &[]);
                    }
                }
                self.deliver(index, answer.status, now, port);
            }
            Some(Asked::Presence(index)) => self.deliver(index, answer.status, now, port),
        }
        Ok(())
    }

    /// Passes the controller's inputs of a head on, and asks the next head.
    fn deliver(&mut self, index: usize, status: Status, now: Nanos, port: &mut Port) {
        let device = &self.options.line.device;
        let station = &mut self.stations[index];
        station.set_flags(status);
        if status.is_of_the_head() {
            if !station.is_left {
                station.is_left = true;
                let why = format!("head {} of the reader on {device}: {status}", station.head);
                port.station_left(index, now, Cause::Refused, &why);
            }
        } else if std::mem::take(&mut station.is_left) {
            port.plc_state(index, now, PlcState::Run);
        }
        port.running(&self.running);
        port.received(index, now, &station.frame);
        if let Some(receipt) = station.receipt.take() {
            port.sent(&receipt);
        }
        self.go_on(index + 1, now, port);
    }

    /// The reader did not answer.
    fn missed(&mut self, port: &mut Port) {
        port.count("ivi-client.unanswered");
        if let Some(Asked::Command(index)) = self.asked.take()
            && let Some(sent) = self.stations[index].sent.take()
        {
            self.stations[index].show(sent, NO_ANSWER, &[]);
        }
        // The reader may have been off, and lost its settings.
        self.is_set_up = false;
        let error = BusError::Link(format!(
            "the reader on {} did not answer within {}; check that it is on, in read/write mode and at {} baud, and the \
             cable",
            self.device(),
            self.options.line.timing(self.options.timeout).patience(),
            self.options.line.baud
        ));
        port.lost(&error, "it is asked again");
    }
}

impl Caller for Session<'_> {
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        if port.is_up(now) {
            self.client.hear(now, bytes);
        }
        Ok(())
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.looked = now;
        while let Some(outcome) = self.client.poll(now) {
            match outcome {
                Outcome::Answered(answer) => self.answered(answer, now, port)?,
                Outcome::Silent => self.missed(port),
                Outcome::Over => {}
            }
        }
        while self.skipped < self.client.skipped() {
            self.skipped += 1;
            port.count("ivi-client.skipped_bytes");
        }
        if !self.client.is_busy() && self.pace.take(now) && port.take_all(now).is_some() {
            self.begin(now, port);
        }
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        self.client.to_write()
    }

    fn wrote(&mut self, _now: Nanos, count: usize, _port: &mut Port) {
        self.client.wrote(count);
    }

    fn deadline(&self, _port: &Port) -> Nanos {
        if self.client.is_busy() {
            // While an answer is slow, wake up in every cycle to check the age of the data.
            self.client.deadline().min(self.looked + self.cycle)
        } else {
            self.pace.due()
        }
    }

    fn left(&mut self) -> BusError {
        gone(self.device(), "it was closed").into()
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        gone(self.device(), error).into()
    }
}
