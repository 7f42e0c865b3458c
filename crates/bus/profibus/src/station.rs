//! A DP slave: a function of its state, the time and a request, to an answer.

mod acyclic;
mod diagnosis;
mod exchange;
mod start_up;

use tickbus_base::time::Nanos;

use crate::acyclic::{Acyclic, Alarm, Server};
use crate::configuration::Configuration;
use crate::event::{Event, Leaving};
use crate::telegram::{BROADCAST, Control, Frame, append_short_ack};
use crate::user_parameters::UserParameters;
use exchange::Clear;

/// The service access points of a slave, and a master's.
pub(crate) mod sap {
    pub(crate) const RD_INP: u8 = 56;
    pub(crate) const RD_OUTP: u8 = 57;
    pub(crate) const GLOBAL_CONTROL: u8 = 58;
    pub(crate) const GET_CFG: u8 = 59;
    pub(crate) const SLAVE_DIAG: u8 = 60;
    pub(crate) const SET_PRM: u8 = 61;
    pub(crate) const CHK_CFG: u8 = 62;
    /// The master's end for all of these.
    pub(crate) const MASTER: u8 = 62;
}

/// The time in bits before an answer, unless the master has set another.
pub(crate) const MIN_TSDR: u8 = 11;

/// The machine behind a station.
pub trait Process {
    /// True if the station takes part in the line's traffic; a device without power does not.
    fn is_up(&mut self, _station: u8, _now: Nanos) -> bool {
        true
    }

    /// Fills in the current inputs. `false`: they are lost on the way, so send nothing.
    fn inputs(&mut self, station: u8, now: Nanos, inputs: &mut [u8]) -> bool;

    /// The master has received the inputs of the last [`inputs`](Self::inputs).
    fn delivered(&mut self, station: u8);

    /// The outputs that a telegram brought.
    fn outputs(&mut self, station: u8, now: Nanos, outputs: &[u8]);

    /// The master is alive, and the outputs are unchanged.
    fn alive(&mut self, station: u8, now: Nanos);

    /// Fills in those octets of a record that the machine provides; the others stay.
    fn read_record(&mut self, _station: u8, _now: Nanos, _record: usize, _octets: &mut [u8]) {}

    /// The octets that a master has written into a record.
    fn wrote_record(&mut self, _station: u8, _now: Nanos, _record: usize, _octets: &[u8]) {}

    /// Reports an event of the station.
    fn tell(&mut self, station: u8, now: Nanos, event: Event);
}

/// The identity of a station's device.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "the standard's own flags, independent of each other"
)]
pub struct Identity {
    /// The ident number, from its GSD file.
    pub ident: u16,
    /// The modules.
    pub configuration: Configuration,
    /// The user parameters; by default any are accepted.
    pub user: UserParameters,
    /// True if the device supports SYNC.
    pub sync: bool,
    /// True if the device supports FREEZE.
    pub freeze: bool,
    /// True if a master in CLEAR sends the device telegrams without outputs.
    pub fail_safe: bool,
    /// True if the user parameters begin with the octets of DPV1.
    pub dpv1: bool,
    /// The most octets of a diagnosis, including the 6 of the standard.
    pub max_diagnosis: usize,
    /// The acyclic services.
    pub acyclic: Acyclic,
}

/// An extended diagnosis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnosed {
    /// The blocks, in the standard's format.
    pub blocks: Vec<Vec<u8>>,
    /// The station cannot exchange data properly while the diagnosis lasts (`Stat_Diag`): the master keeps reading it.
    pub is_static: bool,
    /// The causes of alarms that are there. A new one raises an alarm, as does the end of an error.
    pub alarms: Vec<Alarm>,
}

/// The states of a DP slave; `Power_On` precedes its construction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Waiting for parameters.
    WaitPrm,
    /// Waiting for the configuration check.
    WaitCfg,
    /// Exchanging data.
    DataExch,
}

/// A DP slave.
#[derive(Debug)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "the standard's own flags, independent of each other"
)]
pub struct Station {
    address: u8,
    identity: Identity,
    state: State,
    /// The master that has set the parameters.
    owner: Option<u8>,
    /// The master whose parameters were last refused.
    refused: Option<u8>,
    watchdog: Option<Nanos>,
    /// When the owner was last heard.
    heard: Nanos,
    min_tsdr: u8,
    group: u8,
    fail_safe: bool,
    faults: diagnosis::Faults,
    /// The extended diagnosis that the machine has raised; empty without one.
    extended: Vec<u8>,
    /// The diagnosis has more blocks than fit.
    has_more: bool,
    /// The machine cannot exchange data properly until its diagnosis is taken back.
    is_static: bool,
    /// The owner has not read the diagnosis yet.
    is_news: bool,
    has_freeze: bool,
    has_sync: bool,
    is_frozen: bool,
    is_synced: bool,
    clear: Clear,
    /// The frozen inputs have not been sent yet.
    is_fresh: bool,
    inputs: Vec<u8>,
    outputs: Vec<u8>,
    /// The outputs are 0 since CLEAR, or since the last master left, and the machine does not have them.
    is_cleared: bool,
    /// Outputs that wait for the next SYNC.
    held: Vec<u8>,
    is_held: bool,
    /// When the master last sent them.
    held_since: Nanos,
    /// The last answer to `Data_Exchange` has inputs that the master may not have received.
    is_pending: bool,
    acyclic: Server,
    last: Last,
}

/// The last request and its answer, for a master that repeats it.
#[derive(Debug, Default)]
struct Last {
    /// The head without the address of the station; `None` if there is nothing to repeat.
    head: Option<Head>,
    data: Vec<u8>,
    answer: Vec<u8>,
}

type Head = (u8, Control, Option<u8>, Option<u8>);

fn head_of(request: &Frame<'_>) -> Head {
    (request.source, request.control, request.dsap, request.ssap)
}

/// An answer without its addresses.
enum Answer<'a> {
    /// SC.
    Acknowledged,
    /// A telegram.
    Data(Control, &'a [u8]),
}

impl Station {
    /// The station at `address`, after power-on.
    pub fn new(address: u8, identity: Identity) -> Self {
        let slots = identity.configuration.slots();
        Self {
            address,
            state: State::WaitPrm,
            owner: None,
            refused: None,
            watchdog: None,
            heard: Nanos(0),
            min_tsdr: MIN_TSDR,
            group: 0,
            fail_safe: false,
            faults: diagnosis::Faults::default(),
            extended: Vec::new(),
            has_more: false,
            is_static: false,
            is_news: false,
            has_freeze: false,
            has_sync: false,
            is_frozen: false,
            is_synced: false,
            clear: Clear::default(),
            is_fresh: false,
            inputs: vec![0; identity.configuration.inputs()],
            outputs: vec![0; identity.configuration.outputs()],
            is_cleared: true,
            held: vec![0; identity.configuration.outputs()],
            is_held: false,
            held_since: Nanos(0),
            is_pending: false,
            acyclic: Server::new(&identity.acyclic, slots),
            last: Last::default(),
            identity,
        }
    }

    /// The address.
    pub fn address(&self) -> u8 {
        self.address
    }

    /// The state.
    pub fn state(&self) -> State {
        self.state
    }

    /// The wait before an answer, in bit times.
    pub fn min_tsdr(&self) -> u8 {
        self.min_tsdr
    }

    /// When the station acts on its own: the end of the watchdog's time, or of a master's connection; [`Nanos::MAX`] for
    /// never.
    pub fn deadline(&self) -> Nanos {
        self.watchdog_ends().min(self.acyclic.deadline())
    }

    fn watchdog_ends(&self) -> Nanos {
        match (self.state, self.watchdog) {
            (State::WaitPrm, _) | (_, None) => Nanos::MAX,
            (_, Some(time)) => self.heard + time,
        }
    }

    /// Does what is due at `now`.
    pub fn turn(&mut self, now: Nanos, process: &mut impl Process) {
        self.acyclic.turn(now);
        self.tell_dropped_alarms(now, process);
        if self.watchdog_ends() <= now
            && let Some(time) = self.watchdog
        {
            self.leave(now, Leaving::Watchdog(time), process);
        }
    }

    /// Raises an extended diagnosis, or clears it with an empty one. The next data answer announces the diagnosis to
    /// the master. Blocks that exceed the device's room are left out, and the master learns that there are more.
    pub fn diagnose(&mut self, diagnosed: &Diagnosed) {
        let room = diagnosis::room(self.identity.max_diagnosis);
        let mut extended = Vec::new();
        let mut has_more = false;
        for block in &diagnosed.blocks {
            if extended.len() + block.len() <= room {
                extended.extend_from_slice(block);
            } else {
                has_more = true;
            }
        }
        let is_news = self.extended != extended
            || self.has_more != has_more
            || self.is_static != diagnosed.is_static;
        self.extended = extended;
        self.has_more = has_more;
        self.is_static = diagnosed.is_static;
        self.is_news |= is_news;
        self.acyclic.alarms.raise(&diagnosed.alarms);
        self.offer_alarm();
    }

    /// Takes a request to this station or to all, and appends its answer, if any.
    pub fn request(
        &mut self,
        now: Nanos,
        request: &Frame<'_>,
        process: &mut impl Process,
        reply: &mut Vec<u8>,
    ) {
        self.turn(now, process);
        if !process.is_up(self.address, now) {
            return;
        }
        let is_owner = self.owner == Some(request.source);
        if is_owner {
            self.heard = now;
        }
        match request.control.function() {
            Control::SDN_LOW | Control::SDN_HIGH => {
                if is_owner && request.dsap == Some(sap::GLOBAL_CONTROL) {
                    self.control(now, request.data, process);
                }
                return;
            }
            _ if request.destination == BROADCAST => return,
            Control::FDL_STATUS => return self.append(request, Control::OK, &[], reply),
            Control::SRD_LOW | Control::SRD_HIGH => {}
            _ => return self.append(request, Control::NOT_ACTIVE, &[], reply),
        }
        if is_owner && !request.control.counts() {
            // The master restarts: it no longer waits for the last answer.
            self.is_pending = false;
        }
        if self.is_repeated(request) {
            // Another request says nothing about the outputs: those of before an outage stay old while the configuration is repeated.
            if is_owner && self.state == State::DataExch && request.dsap.is_none() {
                process.alive(self.address, now);
            }
            reply.extend_from_slice(&self.last.answer);
            return;
        }
        let before = reply.len();
        self.serve(now, request, process, reply);
        // A repeated request whose answer was lost here is served again.
        self.last.head = (reply.len() > before).then(|| head_of(request));
        self.last.data.clear();
        self.last.data.extend_from_slice(request.data);
        self.last.answer.clear();
        self.last.answer.extend_from_slice(&reply[before..]);
    }

    /// True if the master repeats its last request because the answer did not arrive. The frame count bit alone would
    /// do, but some masters never toggle it: a telegram with new outputs never counts as a repetition.
    fn is_repeated(&self, request: &Frame<'_>) -> bool {
        request.control.counts()
            && self.last.head == Some(head_of(request))
            && self.last.data == request.data
    }

    fn serve(
        &mut self,
        now: Nanos,
        request: &Frame<'_>,
        process: &mut impl Process,
        reply: &mut Vec<u8>,
    ) {
        let Some(dsap) = request.dsap else {
            return self.exchange(now, request, process, reply);
        };
        let exchanges = self.state == State::DataExch;
        let is_owner = self.owner == Some(request.source);
        if request.ssap != Some(sap::MASTER) {
            return self.serve_acyclic(now, dsap, request, process, reply);
        }
        let mut data = Vec::new();
        let answer = match dsap {
            sap::SLAVE_DIAG => {
                self.append_diagnosis(&mut data);
                self.is_news &= !(is_owner || self.owner.is_none());
                if is_owner {
                    self.acyclic.alarms.read();
                    self.offer_alarm();
                }
                Answer::Data(Control::DATA_LOW, &data)
            }
            sap::GET_CFG => Answer::Data(Control::DATA_LOW, self.identity.configuration.bytes()),
            sap::SET_PRM => {
                self.parameterise(now, request.source, request.data, process);
                Answer::Acknowledged
            }
            sap::CHK_CFG if is_owner && self.state != State::WaitPrm => {
                self.check(now, request.source, request.data, process);
                Answer::Acknowledged
            }
            // Acknowledge; a master that has not read the diagnosis yet would otherwise wait here forever.
            sap::CHK_CFG if self.refused == Some(request.source) => Answer::Acknowledged,
            sap::RD_INP if exchanges => Answer::Data(Control::DATA_LOW, &self.inputs),
            sap::RD_OUTP if exchanges => Answer::Data(Control::DATA_LOW, &self.outputs),
            _ => Answer::Data(Control::NOT_ACTIVE, &[]),
        };
        match answer {
            Answer::Acknowledged => append_short_ack(reply),
            Answer::Data(Control::NOT_ACTIVE, _) => {
                self.append(request, Control::NOT_ACTIVE, &[], reply);
            }
            Answer::Data(control, data) => self.answer(request, control, data, reply),
        }
    }

    /// Appends an answer with the access points of the request.
    fn answer(&self, request: &Frame<'_>, control: Control, data: &[u8], reply: &mut Vec<u8>) {
        let answer = Frame {
            destination: request.source,
            source: self.address,
            control,
            dsap: request.ssap,
            ssap: request.dsap,
            data,
        };
        answer.append(reply);
    }

    /// Appends an answer without access points.
    fn append(&self, request: &Frame<'_>, control: Control, data: &[u8], reply: &mut Vec<u8>) {
        let answer = Frame {
            destination: request.source,
            source: self.address,
            control,
            dsap: None,
            ssap: None,
            data,
        };
        answer.append(reply);
    }

    /// Back to `Wait_Prm`, with no master and all outputs 0.
    fn leave(&mut self, now: Nanos, why: Leaving, process: &mut impl Process) {
        self.state = State::WaitPrm;
        self.owner = None;
        self.watchdog = None;
        self.group = 0;
        self.is_frozen = false;
        self.is_synced = false;
        self.clear = Clear::default();
        self.is_fresh = false;
        self.is_pending = false;
        self.has_freeze = false;
        self.has_sync = false;
        self.is_held = false;
        self.outputs.fill(0);
        self.is_cleared = true;
        self.acyclic.reset(false);
        self.acyclic.alarms.clear();
        // An answer of another state is not repeated.
        self.last.head = None;
        process.tell(self.address, now, Event::Left(why));
    }
}

#[cfg(test)]
mod tests;
