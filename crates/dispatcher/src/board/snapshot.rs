//! The board at one moment, for those who look at it.

use super::{Board, Traffic};
use crate::channel::Channel;
use crate::device::Device;
use crate::number::Number;
use crate::patch::Pin;

/// Everything on the board at one moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// The clients, in the order in which they came.
    pub clients: Vec<ClientState>,
    /// All connections, in the order of their sinks.
    pub connections: Vec<Connection>,
    /// What went through so far.
    pub traffic: Traffic,
}

/// A client and its channels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientState {
    /// Who it is.
    pub device: Device,
    /// Its outputs, then its inputs. Analog channels from 0 to N, as the dispatcher accepts them.
    pub channels: Vec<ChannelState>,
}

/// A channel and its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelState {
    /// Which one.
    pub channel: Channel,
    /// What the client has said of its output, or has been sent for its input.
    pub value: Option<Number>,
    /// What an operator holds it at.
    pub forced: Option<Number>,
}

/// A connection of the patch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Connection {
    /// The input.
    pub sink: Pin,
    /// The output.
    pub source: Pin,
    /// Whether both channels are there. If not, it waits for them.
    pub is_awake: bool,
}

impl Board {
    /// The board as it is now.
    pub(crate) fn snapshot(&self) -> Snapshot {
        let seats = self.by_order.values();
        let plugged = seats.filter_map(|seat| self.seats[*seat].plugged.as_ref());
        let clients = plugged.map(|plugged| {
            let Device { counts, name, .. } = &plugged.device;
            let outputs = counts.channels(true).zip(&plugged.outputs);
            let outputs = outputs.map(|(channel, output)| (channel, output.value));
            let inputs = counts.channels(false).zip(&plugged.inputs);
            let inputs = inputs.map(|(channel, input)| (channel, input.value));
            let has_forces = !self.forces.is_empty();
            let channels = outputs.chain(inputs).map(|(channel, value)| ChannelState {
                channel,
                value: value.is_known().then_some(value),
                // A name is copied for each channel only while something is forced.
                forced: has_forces
                    .then(|| self.forced(&Pin::new(name, channel)))
                    .flatten(),
            });
            ClientState {
                device: plugged.device.clone(),
                channels: channels.collect(),
            }
        });
        let connections = self.patch.iter().map(|(sink, source)| Connection {
            sink: sink.clone(),
            source: source.clone(),
            is_awake: self.place(sink).is_some() && self.place(source).is_some(),
        });
        Snapshot {
            clients: clients.collect(),
            connections: connections.collect(),
            traffic: self.traffic,
        }
    }
}
