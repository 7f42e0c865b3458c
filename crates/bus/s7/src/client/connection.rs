//! One connection without its socket: the session, and its transfers to and from the port.

use std::io;
use std::net::SocketAddr;

use super::{ClientSession, ConnectionParameters, Refusal, S7Client, SessionEvent};
use crate::szl::Identity;
use tickbus_base::time::{Nanos, Pace};
use tickbus_fieldbus::tcp::Caller;
use tickbus_fieldbus::{BusError, PlcState, Port, Receipt};

/// How often a CPU is asked for its operating state.
const STATE: Nanos = Nanos::from_millis(200);

/// A CPU that has reported its operating state may then refuse to report it one time fewer than this in a
/// row: a busy CPU refuses now and then. After that it is assumed to be another CPU, which does not report
/// it.
const UNTOLD: u8 = 5;

/// When to retry a station after the CPU refused some of its data.
const RETRY: Nanos = Nanos::from_secs(1);

/// When to ask a CPU for its identity after all, if the question was omitted and nothing is written for that reason:
/// the connections that broke at the question may have broken with the cable.
const ASK_AGAIN: Nanos = Nanos::from_secs(5);

/// One connection.
pub(super) struct Connection<'a> {
    bus: &'a mut S7Client,
    peer: SocketAddr,
    session: ClientSession,
    pace: Pace,
    has_identity: bool,
    /// When to ask the CPU for its operating state next; `None` if it does not report it.
    state: Option<Nanos>,
    /// When to connect again, to ask for the identity that was omitted before.
    ask_again: Option<Nanos>,
    /// A cycle became due while the question was pending.
    is_due: bool,
    /// For the frames of the cycle under way.
    receipt: Option<Receipt>,
    stations: Vec<StationCycle>,
}

/// The state of a station after the last cycles.
#[derive(Clone, Debug, Default)]
struct StationCycle {
    /// True if any of the station's data are written, and if any are read.
    has: [bool; 2],
    /// The CPU refused some of its data; they are tried again at this time.
    resume: Option<Nanos>,
    refusal: Option<Refusal>,
}

impl<'a> Connection<'a> {
    pub(super) fn new(
        bus: &'a mut S7Client,
        peer: SocketAddr,
        terms: ConnectionParameters,
        port: &Port,
    ) -> Self {
        let now = port.clock().now();
        let station = |station| StationCycle {
            has: bus.frames.has(station),
            ..StationCycle::default()
        };
        Self {
            session: bus.frames.session(terms, now),
            pace: Pace::new(now, bus.cycle),
            has_identity: false,
            state: None,
            ask_again: None,
            is_due: false,
            receipt: None,
            stations: (0..port.stations()).map(station).collect(),
            peer,
            bus,
        }
    }

    /// The connection has ended with an error.
    pub(super) fn end(&mut self) {
        if self.session.asks_who() {
            self.bus.identity.unanswered += 1;
        } else if self.session.asks_state() {
            self.bus.state.unanswered += 1;
        }
    }

    fn meet(&mut self, now: Nanos, length: u16, identity: Option<Identity>, port: &mut Port) {
        // A CPU that closed the connection when asked for its identity would do the same for this question.
        if identity.is_some() {
            self.bus.identity.unanswered = 0;
            self.state = self.bus.state.is_asked().then_some(now);
        }
        if self.state.is_none() {
            self.presume_run(now, port);
        }
        let was_asked = identity.is_some();
        let line = identity.map(|identity| identity.line()).unwrap_or_default();
        let line = if line.is_empty() {
            let called = self.bus.options.called;
            format!("S7 CPU at {}, TSAP {called}", self.peer)
        } else {
            line
        };
        let all = 0..port.stations();
        let may_write = self.bus.guard.meet(port, all, &line);
        self.session.allow(may_write);
        let is_missed = !was_asked && !may_write && self.bus.guard.names_one();
        self.ask_again = is_missed.then(|| now + ASK_AGAIN);
        self.has_identity = true;
        port.tell("pdu", &length.to_string());
        port.running(&format!("connected with {}, {line}", self.peer));
        // Before the first cycle: the memory of a CPU in STOP must not be taken for its outputs.
        self.ask_state(now, port);
    }

    /// Asks for the operating state if that is due, between two cycles.
    fn ask_state(&mut self, now: Nanos, port: &mut Port) {
        if self.session.is_idle() && self.state.is_some_and(|due| due <= now) {
            self.state = Some(now + STATE);
            // A server takes any question for a sign of life, and none may pass a line that is down.
            if port.is_up(now) {
                self.session.ask_state(now);
            }
        }
    }

    /// The CPU reported its operating state, or that it does not report it.
    fn learn(
        &mut self,
        now: Nanos,
        state: Option<PlcState>,
        port: &mut Port,
    ) -> Result<(), BusError> {
        self.bus.state.unanswered = 0;
        if let Some(state) = state {
            self.bus.untold = 0;
            self.bus.said = Some(state);
            for station in 0..self.stations.len() {
                port.plc_state(station, now, state);
            }
        } else {
            self.bus.untold = self.bus.untold.saturating_add(1);
            if self.bus.said.is_none() || self.bus.untold >= UNTOLD {
                self.state = None;
                self.presume_run(now, port);
            }
        }
        if std::mem::take(&mut self.is_due) {
            return self.cycle(now, port);
        }
        Ok(())
    }

    /// The CPU does not report its operating state, so its data count as valid. If an earlier CPU reported STOP and
    /// this one reports nothing, it is assumed to be another one.
    fn presume_run(&mut self, now: Nanos, port: &mut Port) {
        if self.bus.said.take() == Some(PlcState::Stop) {
            for station in 0..self.stations.len() {
                port.plc_state(station, now, PlcState::Run);
            }
        }
        port.tell("cpu", "unknown");
        if !std::mem::replace(&mut self.bus.told_unknown, true) {
            log::warn!(
                "the CPU at {} does not say whether it is in RUN (system status list 0x0424), so its values count as \
                 fresh in STOP, too; name a signal that has to change: alive = {{ signal = \"...\", within = \
                 \"500ms\" }}",
                self.peer
            );
        }
    }

    /// A cycle is due.
    fn cycle(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        if self.session.asks_state() {
            self.is_due = true;
            return Ok(());
        }
        if !self.session.is_idle() {
            port.count("s7.skipped");
            return Ok(());
        }
        let Some(mut frames) = port.take_all(now) else {
            return Ok(());
        };
        let is_ending = frames.is_ending();
        for (index, station) in self.stations.iter_mut().enumerate() {
            if station
                .resume
                .is_some_and(|resume| resume <= now || is_ending)
            {
                station.resume = None;
                self.session.suspend(index, false);
            }
            if self.bus.guard.may_write() && station.has[0] && station.resume.is_none() {
                let frame = frames.frame(index);
                self.session.frame_to_write(index).copy_from_slice(frame);
            }
        }
        self.receipt = Some(frames.receipt());
        match self.session.begin(now) {
            Some(SessionEvent::Done) => self.done(now, port),
            _ => Ok(()),
        }
    }

    /// A cycle is complete.
    fn done(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let may_write = self.bus.guard.may_write();
        // In a cycle without reads and writes, nothing was heard from the CPU.
        let is_heard = self.stations.iter().any(|station| {
            let [is_written, is_read] = station.has;
            station.resume.is_none() && (is_read || is_written && may_write)
        });
        port.together(|port| {
            for (index, station) in self.stations.iter_mut().enumerate() {
                if station.resume.is_some() {
                    continue;
                }
                if let Some(refusal) = self.session.refusal(index) {
                    port.count("s7.refused");
                    station.resume = Some(now + RETRY);
                    station.refusal = Some(refusal.clone());
                    continue;
                }
                let [is_written, is_read] = station.has;
                if is_read {
                    port.received(index, now, self.session.frame_read(index));
                } else if is_heard {
                    port.touch(index, now);
                }
                if is_written
                    && may_write
                    && let Some(receipt) = &self.receipt
                {
                    port.sent(&receipt.of(index));
                }
                station.refusal = None;
                // The refusal may have been reported during an earlier connection.
                let told = &mut self.bus.told_refusals[index];
                if !told.is_empty() {
                    told.clear();
                    port.tell("refused", &refusals(&self.bus.told_refusals));
                }
            }
        });
        self.put_off(port)
    }

    /// Skips the stations with refused data for a while.
    ///
    /// # Errors
    ///
    /// The CPU refused data of every station.
    fn put_off(&mut self, port: &Port) -> Result<(), BusError> {
        let is_used = |station: &&StationCycle| station.has != [false, false];
        let is_served = |station: &StationCycle| station.resume.is_none();
        let is_any_served = self.stations.iter().filter(is_used).any(is_served);
        for (index, station) in self.stations.iter_mut().enumerate() {
            let (Some(_), Some(refusal)) = (station.resume, &station.refusal) else {
                continue;
            };
            if !is_any_served {
                return Err(refusal.clone().into_error(self.peer));
            }
            self.session.suspend(index, true);
            let name = &self.bus.names[index];
            let text = format!("station \"{name}\": {} {refusal}", self.peer);
            let told = &mut self.bus.told_refusals[index];
            if *told != text {
                if let Some(times) = self.bus.rarely.count(("s7", "refused")) {
                    log::warn!("{text}; it is stale, and is tried again every {RETRY}{times}");
                }
                *told = text;
                port.tell("refused", &refusals(&self.bus.told_refusals));
            }
        }
        Ok(())
    }
}

impl Caller for Connection<'_> {
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        let mut bytes = bytes;
        loop {
            let news = self.session.hear(now, bytes);
            bytes = &[];
            match news.map_err(|end| end.into_error(self.peer))? {
                None => return Ok(()),
                Some(SessionEvent::Met(length, identity)) => self.meet(now, length, identity, port),
                Some(SessionEvent::Done) => self.done(now, port)?,
                Some(SessionEvent::State(state)) => self.learn(now, state, port)?,
            }
        }
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        if !self.has_identity {
            return Ok(());
        }
        // Before the cycle, or an overloaded line would never get a turn for it.
        self.ask_state(now, port);
        if self.pace.take(now) {
            self.cycle(now, port)?;
        }
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        self.session.to_write()
    }

    fn wrote(&mut self, _now: Nanos, count: usize, _port: &mut Port) {
        self.session.wrote(count);
    }

    fn check(&mut self, now: Nanos, _port: &mut Port) -> Result<(), BusError> {
        if self.ask_again.is_some_and(|due| due <= now) {
            let peer = self.peer;
            return Err(BusError::Link(format!(
                "{peer} was not asked which CPU it is, because connections broke at that question; it is asked again"
            )));
        }
        let checked = self.session.check(now);
        checked.map_err(|end| end.into_error(self.peer))
    }

    fn deadline(&self, _port: &Port) -> Nanos {
        let again = self.ask_again.unwrap_or(Nanos::MAX);
        let mut deadline = self.session.deadline().min(again);
        if self.has_identity {
            deadline = deadline.min(self.pace.due());
        }
        if let (Some(state), true) = (self.state, self.session.is_idle()) {
            deadline = deadline.min(state);
        }
        deadline
    }

    fn left(&mut self) -> BusError {
        let peer = self.peer;
        BusError::Left(format!(
            "{peer} closed the connection; if it did so at once, check \"rack\" and \"slot\", and whether all its \
             connections are taken"
        ))
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        let peer = self.peer;
        BusError::Link(format!(
            "the connection with {peer} broke ({error}); see whether the CPU still runs"
        ))
    }
}

/// The refusals as the statistics show them.
fn refusals(told: &[String]) -> String {
    let told = told.iter().map(String::as_str);
    let told: Vec<&str> = told.filter(|text| !text.is_empty()).collect();
    if told.is_empty() {
        "nothing".to_owned()
    } else {
        told.join("; ")
    }
}
