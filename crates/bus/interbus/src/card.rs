//! The order of the calls of the DDI.

use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, Card, Moved, Port, Vendor};

use super::errors::{NO_MESSAGE, failing};
use super::library::{Library, Node, WatchDog};
use super::options::Options;
use super::state::State;

/// Reads the value of a single variable, that of the plug-and-play mode.
const READ_PLUG_AND_PLAY: [u16; 4] = [0x0351, 2, 1, 0x2240];

/// The position of the mode in the words of the answer.
const MODE: usize = 5;

/// Starts the data transfer: no parameters.
const START: [u16; 2] = [0x0701, 0];

/// The most old messages discarded before the first one of this opening: a mailbox holds no more.
const OLD: usize = 64;

/// The way to the board in the options.
pub(super) struct Ddi(pub(super) Options);

impl Vendor for Ddi {
    const COUNTERS: [&'static str; 3] = [
        "interbus-ddi.slow_calls",
        "interbus-ddi.no_bus",
        "interbus-ddi.again",
    ];

    type Library = Library;

    fn load(&self, path: &Path) -> Result<Library, Mistake> {
        Library::load(path)
    }

    fn open<'l>(
        &self,
        library: &'l Library,
        port: &Port,
        _sizes: [usize; 2],
    ) -> Result<Box<dyn Card + 'l>, BusError> {
        let Options { device, .. } = &self.0;
        let mailbox = Node::open(library, &format!("{device}_M"))?;
        let card = OpenCard {
            data: Node::open(library, &format!("{device}_D"))?,
            mailbox,
            phase: Phase::Asked,
            since: port.clock().now(),
            options: self.0.clone(),
            state: State::default(),
            is_news: false,
        };
        for _ in 0..OLD {
            if card.mailbox.receive()?.is_none() {
                break;
            }
        }
        card.mailbox.send(&READ_PLUG_AND_PLAY)?;
        port.tell("card", device);
        Ok(Box::new(card))
    }

    fn limits(&self) -> [Nanos; 2] {
        [Nanos::from_secs(10), Nanos::from_secs(2)]
    }

    fn timeout(&self) -> Nanos {
        Nanos::from_millis(100)
    }
}

/// The phase of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The board was asked for its plug-and-play mode.
    Asked,
    /// The data transfer was started.
    Started,
    Running,
}

/// An open board; dropping it closes it.
struct OpenCard<'l> {
    // Closed in this order.
    data: Node<'l>,
    mailbox: Node<'l>,
    phase: Phase,
    /// When this phase began.
    since: Nanos,
    options: Options,
    state: State,
    /// The state has not been reported yet.
    is_news: bool,
}

impl OpenCard<'_> {
    /// Enters a phase at `now`.
    fn enter(&mut self, phase: Phase, now: Nanos) {
        (self.phase, self.since) = (phase, now);
    }

    fn is_late(&self, now: Nanos) -> bool {
        now - self.since > self.options.start_timeout
    }

    /// Checks for the answer about the plug-and-play mode, and starts the bus once it has come.
    fn ask(&mut self, now: Nanos) -> Result<(), BusError> {
        let Some(answer) = self.mailbox.receive()? else {
            if self.is_late(now) {
                return Err(failing("DDI_MXI_RcvMessage", NO_MESSAGE).error());
            }
            return Ok(());
        };
        // A board without this variable sends a short answer.
        if let Some(mode) = answer.get(MODE).filter(|mode| **mode != 0) {
            return Err(BusError::Refused(format!(
                "the board is in plug-and-play mode {mode}, in which nobody can write; switch that off with the vendor's tool"
            )));
        }
        if let Some(service) = self.options.activate {
            self.mailbox.send(&[service, 0])?;
        }
        self.mailbox.send(&START)?;
        self.enter(Phase::Started, now);
        Ok(())
    }

    /// Checks the state of the bus.
    fn look(&mut self, now: Nanos) -> Result<(), BusError> {
        let state = self.data.state()?;
        self.is_news |= state != self.state;
        self.state = state;
        match self.phase {
            Phase::Started if state.runs() => {
                self.enter(Phase::Running, now);
                if self.options.card.watchdog {
                    self.data.watchdog(WatchDog::Enable)?;
                }
            }
            Phase::Started if self.is_late(now) => {
                return Err(BusError::Link(format!(
                    "INTERBUS did not start within {}, its state is {state}; see the board's diagnosis, and whether its \
                     configuration is active",
                    self.options.start_timeout
                )));
            }
            Phase::Running if !state.runs() => {
                return Err(BusError::Link(format!(
                    "INTERBUS stopped, its state is {state}; see the board's diagnosis"
                )));
            }
            _ => {}
        }
        Ok(())
    }
}

impl Card for OpenCard<'_> {
    fn exchange(&mut self, now: Nanos, output: &[u8], input: &mut [u8]) -> Result<Moved, BusError> {
        match self.phase {
            Phase::Asked => self.ask(now)?,
            _ => self.look(now)?,
        }
        if self.phase != Phase::Running {
            return Ok(Moved::NoPeer("the board starts INTERBUS"));
        }
        let card = &self.options.card;
        if card.watchdog {
            self.data.watchdog(WatchDog::Trigger)?;
        }
        if !output.is_empty() {
            self.data.write(card.write_offset, output)?;
        }
        if !input.is_empty() {
            self.data.read(card.read_offset, input)?;
        }
        Ok(Moved::Data {
            out: true,
            back: true,
            again: None,
        })
    }

    fn news(&mut self) -> Option<String> {
        std::mem::take(&mut self.is_news).then(|| self.state.to_string())
    }
}

impl Drop for OpenCard<'_> {
    fn drop(&mut self) {
        if self.phase == Phase::Running && self.options.card.watchdog {
            // On failure, the board is gone.
            let _ = self.data.watchdog(WatchDog::Clear);
        }
    }
}
