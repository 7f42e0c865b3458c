//! The names of channels, on their way between dispatchers.

use crate::board::Board;
use crate::channel::Channel;
use crate::federation::Host;
use crate::federation::message::{Body, WireName};
use crate::host::{HostId, Rank};

use super::Dispatcher;

impl Dispatcher {
    /// Notes a name that a client here has given, for all other dispatchers.
    pub(super) fn settle_name(&mut self, seat: usize, channel: Channel) {
        let Some(order) = self.board.order(seat) else {
            return;
        };
        let hosts = self.federation.iter_mut();
        let hosts = hosts.flat_map(|federation| federation.hosts.values_mut());
        // The others get all names with their next snapshot.
        for host in hosts.filter(|host| host.link.is_open) {
            host.renamed.entry(order.since).or_default().insert(channel);
        }
    }

    /// Another dispatcher reports names of a client's channels.
    pub(super) fn remote_names(&mut self, id: HostId, since: u64, names: &[WireName]) {
        let seat = self
            .host(id)
            .and_then(|host| host.clients.get(&since).copied());
        let Some(seat) = seat else {
            return;
        };
        for (channel, label) in names.iter().filter_map(WireName::read) {
            if self.board.has(seat, channel) {
                self.board.name_channel(seat, channel, label);
            }
        }
    }
}

/// All names of the channels of the client on a seat.
pub(super) fn all_names(board: &Board, seat: usize) -> Vec<WireName> {
    let labels = board.labels(seat).into_iter().flatten();
    labels
        .map(|(channel, label)| WireName::new(*channel, label))
        .collect()
}

/// The names of one client that a host has not been sent yet. Only the newest of a channel is sent, so a client that renames its
/// channels without end does not fill the queue.
pub(super) fn next_names(board: &Board, host: &mut Host, own: HostId) -> Option<Body> {
    let (since, channels) = host.renamed.pop_first()?;
    let seat = board.seat_at(Rank { since, host: own })?;
    let labels = board.labels(seat)?;
    let names = channels.iter().filter_map(|channel| {
        let label = labels.get(channel)?;
        Some(WireName::new(*channel, label))
    });
    Some(Body::Named(since, names.collect()))
}
