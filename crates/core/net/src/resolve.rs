//! Resolving hosts.

use std::io;
use std::net::{SocketAddr, ToSocketAddrs as _};
use std::sync::mpsc::{self, TryRecvError};

use tickbus_base::time::{Clock, Nanos, Stop};

use crate::{Address, Error, Host};

/// All addresses of a host, with its port; `None` if `stop` came first.
///
/// A name is looked up on a separate thread, because a look-up cannot be cancelled: closing leaves the thread behind,
/// which ends when the look-up does.
///
/// # Errors
///
/// The name is unknown, or cannot be looked up.
pub(crate) fn resolve(
    address: &Address,
    clock: &dyn Clock,
    stop: &Stop,
) -> Result<Option<Vec<SocketAddr>>, Error> {
    let name = match &address.host {
        Host::Ip(ip) => return Ok(Some(vec![SocketAddr::new(*ip, address.port)])),
        Host::Name(name) => name.clone(),
    };
    let refused = |error: io::Error| {
        Error(format!(
            "the host \"{name}\" cannot be looked up ({error}); correct \"address\", or write an IP \
             address there"
        ))
    };
    let (sender, receiver) = mpsc::channel();
    let looking = std::thread::Builder::new().name("tickbus-lookup".to_owned());
    let spawned = looking.spawn({
        let (stop, target) = (stop.clone(), (name.clone(), address.port));
        move || {
            let found = target.to_socket_addrs().map(Iterator::collect);
            // The receiver may be gone.
            let _ = sender.send(found);
            stop.wake();
        }
    });
    spawned.map_err(refused)?;
    loop {
        let found: io::Result<Vec<SocketAddr>> = match receiver.try_recv() {
            Ok(found) => found,
            Err(TryRecvError::Empty) => {
                if stop.is_stopped() {
                    return Ok(None);
                }
                clock.wait_until(Nanos::MAX, stop);
                continue;
            }
            Err(TryRecvError::Disconnected) => Err(io::Error::other("the look-up broke off")),
        };
        let found = found.map_err(refused)?;
        if found.is_empty() {
            return Err(refused(io::Error::other("it has no address")));
        }
        return Ok(Some(found));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Manual;

    fn named(host: &str) -> Address {
        Address {
            host: Host::Name(host.to_owned()),
            port: 7,
        }
    }

    #[test]
    fn a_name_becomes_addresses_with_the_port() {
        let found = resolve(&named("localhost"), &*Manual::new(), &Stop::new());
        let found = found.expect("every machine knows it").expect("no stop");
        assert!(!found.is_empty());
        assert!(
            found
                .iter()
                .all(|address| address.ip().is_loopback() && address.port() == 7)
        );
    }

    #[test]
    fn a_number_is_not_looked_up() {
        let address: Address = "192.0.2.1:9".parse().expect("an address");
        let found = resolve(&address, &*Manual::new(), &Stop::new());
        assert_eq!(found, Ok(Some(vec!["192.0.2.1:9".parse().expect("it is")])));
    }

    #[test]
    fn a_stop_waits_for_no_look_up() {
        let stop = Stop::new();
        stop.stop();
        // Both results are correct: the look-up and the stop may finish in either order.
        let found = resolve(&named("localhost"), &*Manual::new(), &stop);
        assert!(matches!(found, Ok(None | Some(_))));
    }
}
