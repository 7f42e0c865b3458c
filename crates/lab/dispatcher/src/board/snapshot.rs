//! The state of the board at one moment, for viewers.

use super::{Board, Traffic};
use crate::channel::Channel;
use crate::device::Device;
use crate::label::Label;
use crate::number::Number;
use crate::patch::{Patch, Pin};

/// Everything on the board at one moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// The clients, in the order of their registration.
    pub clients: Vec<ClientState>,
    /// All connections, those of each dispatcher in the order of their sinks.
    pub connections: Vec<Connection>,
    /// The traffic so far.
    pub traffic: Traffic,
}

/// A client and its channels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientState {
    /// The client's identification.
    pub device: Device,
    /// The name of the host, for a client of another dispatcher. Such a client has no input values here, and values
    /// only of connected outputs.
    pub host: Option<String>,
    /// The outputs, then the inputs. Analog channels run from 0 to N, as the dispatcher accepts them.
    pub channels: Vec<ChannelState>,
}

/// A channel and its value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelState {
    /// The channel.
    pub channel: Channel,
    /// The name that the client has given the channel, if any.
    pub label: Option<Label>,
    /// The last value that the client sent for its output, or was sent for its input. `None` if there was no value yet, if the
    /// client has exceeded its `ALIVE` time, or if the input has lost its source.
    pub value: Option<Number>,
    /// The value that an operator forces the channel to.
    pub forced: Option<Number>,
}

/// A connection of the patch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Connection {
    /// The input.
    pub sink: Pin,
    /// The output.
    pub source: Pin,
    /// True if both channels are present; otherwise the connection sleeps until they are.
    pub is_awake: bool,
}

impl Board {
    /// The board as it is now, with the connections that belong to other dispatchers.
    pub(crate) fn snapshot<'p>(&'p self, elsewhere: impl Iterator<Item = &'p Patch>) -> Snapshot {
        let seats = self.by_order.values().map(|seat| &self.seats[*seat]);
        let plugged = seats.filter_map(|seat| Some((seat.plugged.as_ref()?, &seat.inputs)));
        let clients = plugged.map(|(plugged, inputs)| {
            let Device { counts, name, .. } = &plugged.device;
            let outputs = counts.channels(true).zip(&plugged.outputs);
            let outputs = outputs.map(|(channel, output)| {
                let is_silent = plugged.is_silent;
                let value = if is_silent {
                    Number::LOST
                } else {
                    output.value
                };
                (channel, value)
            });
            let values = inputs.iter().map(|input| input.value);
            let values = values.chain(std::iter::repeat(Number::UNKNOWN));
            let inputs = counts.channels(false).zip(values);
            let has_forces = self.has_forces();
            let channels = outputs.chain(inputs).map(|(channel, value)| ChannelState {
                channel,
                label: plugged.labels.get(&channel).cloned(),
                value: (value.is_known() && value != Number::LOST).then_some(value),
                // A name is copied for each channel only while something is forced.
                forced: has_forces
                    .then(|| self.forced(&Pin::new(name, channel)))
                    .flatten(),
            });
            ClientState {
                device: plugged.device.clone(),
                host: plugged.host.as_deref().map(str::to_owned),
                channels: channels.collect(),
            }
        });
        let all = std::iter::once(&self.patch).chain(elsewhere);
        let connections = all.flat_map(Patch::iter).map(|(sink, source)| Connection {
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
