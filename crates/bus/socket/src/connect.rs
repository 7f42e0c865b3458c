//! The end that connects.

use tickbus_base::time::Stop;
use tickbus_fieldbus::tcp;
use tickbus_fieldbus::{BusError, Medium, Port};
use tickbus_net::Address;

use super::connection::{Connection, Transfer};
use super::connection_states::ConnectionStates;
use super::{ConnectionFrames, Session, SessionParameters};

/// Connects, and serves the connection until it ends or `stop` comes.
///
/// # Errors
///
/// The peer does not answer, or the connection has ended.
pub(super) fn connect(
    address: &Address,
    terms: SessionParameters,
    frames: &mut ConnectionFrames,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let patience = Session::patience(terms.max_age);
    let Some((mut call, peer)) = tcp::dial(address, patience, port, stop)? else {
        return Ok(());
    };
    port.carried_by(Medium::Tcp);
    let mut lines = ConnectionStates::new([(String::new(), frames.stations())].into_iter());
    let reason = format!("connected with {peer}; waiting for its first record");
    lines.opening(0, &reason, port);
    frames.begin();
    let mut transfer = Transfer {
        connection: &mut Connection::new(peer, terms, port),
        frames,
        line: 0,
        lines: &mut lines,
    };
    call.run(&mut transfer, port, stop)
}
