//! The bus: a client of the dispatcher, over TCP.

use std::io;
use std::net::SocketAddr;

use tickbus_base::Mistake;
use tickbus_base::time::{Nanos, Pace, Stop};
use tickbus_dispatcher::client::{Client, ClientError, Event, KEEP_ALIVE, PATIENCE};
use tickbus_fieldbus::tcp::{Caller, dial};
use tickbus_fieldbus::{BusError, BusSetup, CYCLE, Free, Port, Receipt};
use tickbus_net::Address;

use super::Options;
use super::inputs::Inputs;
use super::outputs::Outputs;

/// The dispatcher is asked for a sign of life at least this many times within `max_age`.
const SIGNS_OF_LIFE: i64 = 3;

/// The bus of kind `dispatcher`.
#[derive(Debug)]
pub struct DispatcherBus {
    address: Address,
    cycle: Nanos,
    client: Client,
    outputs: Outputs,
    inputs: Inputs,
}

impl DispatcherBus {
    /// The bus that `options` describe, not connected yet.
    ///
    /// # Errors
    ///
    /// No dispatcher accepts a driver with these options.
    pub fn new(options: &Options, setup: &BusSetup<'_>) -> Result<Self, Mistake> {
        let channels = options.channels(setup.table);
        let sign = Nanos((setup.max_age.0 / SIGNS_OF_LIFE).max(1));
        let client = Client::new(options.profile(setup)?, sign.min(KEEP_ALIVE))?;
        let signals = setup.table.signals.iter();
        let names = channels.list.iter().zip(signals);
        let names = names.map(|(channel, signal)| (*channel, &*signal.name));
        Ok(Self {
            address: options.address.clone(),
            cycle: setup.cycle.unwrap_or(CYCLE),
            client: client.with_labels(names),
            outputs: Outputs::new(setup.table, setup.role, &channels),
            inputs: Inputs::new(setup.table, setup.role, &channels),
        })
    }
}

impl Free for DispatcherBus {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let Some((mut call, peer)) = dial(&self.address, PATIENCE, port, stop)? else {
            return Ok(());
        };
        let now = port.clock().now();
        self.client.connected(now);
        self.outputs.begin();
        self.inputs.begin();
        let name = &self.client.profile().name;
        port.opening(&format!(
            "connected with the dispatcher at {peer}; joining it as \"{name}\""
        ));
        let mut membership = Membership {
            pace: Pace::new(now, self.cycle),
            bus: self,
            peer,
            receipt: None,
            progress: Progress::Joining,
            refusal: None,
        };
        call.run(&mut membership, port, stop)
    }
}

/// One connection.
struct Membership<'b> {
    bus: &'b mut DispatcherBus,
    peer: SocketAddr,
    pace: Pace,
    /// The receipt for the values on their way.
    receipt: Option<Receipt>,
    progress: Progress,
    /// The last refusal of a connection, or of another line, if it was not reported yet.
    refusal: Option<String>,
}

/// The last report about the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    /// Joining.
    Joining,
    /// Joined, but not reported yet.
    Joined,
    /// No input has a source.
    Waiting,
    /// Running.
    Running,
}

impl Membership<'_> {
    /// Sends changed values, once the dispatcher has all earlier ones.
    fn make(&mut self, now: Nanos, port: &mut Port) {
        let DispatcherBus {
            outputs, client, ..
        } = &mut *self.bus;
        let stations = 0..port.stations();
        // While the line is down nothing is sent; changes are sent when it is up again.
        let Some(mut frames) = port.look(stations.clone(), now) else {
            return;
        };
        let (receipt, is_ending) = (frames.receipt(), frames.is_ending());
        if !outputs.look(&mut frames) {
            if is_ending {
                // The dispatcher already has the last values.
                self.receipt.get_or_insert(receipt);
            }
            return;
        }
        self.receipt = port.take(stations, now).map(|_| receipt);
        let client = self.receipt.is_some().then_some(client);
        outputs.say(client, port);
    }

    fn settle_receipt(&mut self, port: &mut Port) {
        if self.bus.client.is_all_written()
            && let Some(receipt) = self.receipt.take()
        {
            port.sent(&receipt);
        }
    }

    /// Reports the state of the line when it changes.
    fn report(&mut self, port: &mut Port) {
        if self.progress == Progress::Joining {
            return;
        }
        let refusal = self.refusal.take();
        let served = self.bus.inputs.is_served();
        let (peer, name) = (self.peer, &self.bus.client.profile().name);
        match (self.progress, served) {
            (Progress::Joined | Progress::Waiting, true) => {
                port.running(&format!("joined the dispatcher at {peer} as \"{name}\""));
                self.progress = Progress::Running;
            }
            (Progress::Joined, false) => {
                port.opening(&waiting(peer, name, refusal.as_deref()));
                self.progress = Progress::Waiting;
                return;
            }
            (Progress::Running, false) => {
                let error = BusError::Left("no input has a source any more".to_owned());
                port.lost(&error, "waiting for one in the dispatcher");
                self.progress = Progress::Waiting;
            }
            (Progress::Waiting, false) if refusal.is_some() => {
                port.opening(&waiting(peer, name, refusal.as_deref()));
                return;
            }
            _ => {}
        }
        if let Some(refusal) = refusal {
            port.log(log::Level::Warn, "refused", format_args!("{refusal}"));
        }
    }
}

/// The state of a member whose inputs have no source.
fn waiting(peer: SocketAddr, name: &str, refusal: Option<&str>) -> String {
    let joined =
        format!("joined the dispatcher at {peer} as \"{name}\"; no input has a source yet");
    match refusal {
        Some(refusal) => format!("{joined}; {refusal}"),
        None => format!("{joined}; connect one in the dispatcher, or by \"connect\""),
    }
}

impl Caller for Membership<'_> {
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        let DispatcherBus { client, inputs, .. } = &mut *self.bus;
        let (progress, refusal) = (&mut self.progress, &mut self.refusal);
        let heard = client.hear(now, bytes, &mut |event| match event {
            Event::Value(channel, value) => inputs.value(channel, value, port),
            Event::Lost(channel) => inputs.lost(channel, port),
            // Values wait until all first values have arrived.
            Event::LineEnd if *progress != Progress::Joining => inputs.deliver(now, port),
            Event::Settled => *progress = Progress::Joined,
            Event::Refused { cable, code, text } => {
                let cable = cable.map(|cable| format!("{cable} was refused: "));
                *refusal = Some(format!("{}{text} (ERR {code})", cable.unwrap_or_default()));
            }
            Event::Identified
            | Event::LineEnd
            | Event::Device(_)
            | Event::ListEnd
            | Event::Connected(_) => {}
        });
        if self.progress != Progress::Joining && client.heard() == now {
            inputs.deliver(now, port);
        }
        self.report(port);
        heard.map_err(|error| match error {
            ClientError::Refused(why) => BusError::Refused(why),
            ClientError::Protocol(why) => BusError::Protocol(why),
            ClientError::Silent(why) => BusError::Link(why),
        })
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let is_first = self.receipt.is_none() && !self.bus.client.is_identified();
        if (self.pace.take(now) || is_first) && self.receipt.is_none() {
            self.make(now, port);
        }
        self.bus.client.turn(now);
        self.settle_receipt(port);
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        self.bus.client.to_write()
    }

    fn wrote(&mut self, now: Nanos, count: usize, port: &mut Port) {
        self.bus.client.wrote(now, count);
        self.settle_receipt(port);
    }

    fn check(&mut self, now: Nanos, _port: &mut Port) -> Result<(), BusError> {
        let checked = self.bus.client.check(now);
        checked.map_err(|error| BusError::Link(error.to_string()))
    }

    fn deadline(&self, _port: &Port) -> Nanos {
        self.pace.due().min(self.bus.client.deadline())
    }

    fn left(&mut self) -> BusError {
        BusError::Left(format!(
            "the dispatcher at {} closed the connection",
            self.peer
        ))
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        let peer = self.peer;
        BusError::Link(format!(
            "the connection with the dispatcher at {peer} broke ({error}); see whether it still runs"
        ))
    }
}
