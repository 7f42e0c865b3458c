//! The end that connects.

use tickbus_base::os::{Poller, Source};
use tickbus_base::time::Stop;
use tickbus_fieldbus::tcp::{self, Address, no_wait};
use tickbus_fieldbus::{BusError, Port};

use super::connection::Connection;
use super::{Frames, Terms};

/// Connects, and serves the connection until it ends or `stop` comes.
///
/// # Errors
///
/// The peer does not answer, or the connection has ended.
pub(super) fn connect(
    address: &Address,
    terms: Terms,
    frames: &mut Frames,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let mut poller = Poller::new(stop).map_err(|error| no_wait(&error))?;
    let Some((stream, peer)) = tcp::connect(address, &mut poller, port, stop)? else {
        return Ok(());
    };
    port.opening(&format!(
        "connected with {peer}; waiting for its first record"
    ));
    let mut connection = Connection::new(stream, peer, terms, port)?;
    frames.begin();
    let mut ready = (false, false);
    while !stop.is_stopped() {
        connection.turn(ready, port, frames)?;
        if let Some(news) = connection.news() {
            port.running(&news);
        }
        let mut sources = [Source::new(connection.stream(), connection.interest())];
        poller
            .wait(
                &**port.clock(),
                connection.deadline().min(port.due()),
                &mut sources,
            )
            .map_err(|error| no_wait(&error))?;
        ready = (sources[0].is_readable(), sources[0].is_writable());
    }
    Ok(())
}
