//! The limits on connections, in total and per computer.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// The seats of a room. No computer alone takes all of them.
pub(crate) struct Seats {
    all: Arc<Semaphore>,
    per_computer: usize,
    /// The seats of computers that have some, or had some before.
    each: HashMap<IpAddr, Arc<Semaphore>>,
}

/// A taken seat; dropping it frees it.
pub(crate) struct Seat {
    _of_all: OwnedSemaphorePermit,
    _of_its: OwnedSemaphorePermit,
}

impl Seats {
    pub(crate) fn new(connections: usize, per_computer: usize) -> Self {
        Self {
            all: Arc::new(Semaphore::new(connections)),
            per_computer,
            each: HashMap::new(),
        }
    }

    /// Takes a seat for a computer, if it may have one.
    pub(crate) fn take(&mut self, address: IpAddr) -> Option<Seat> {
        let of_all = Arc::clone(&self.all).try_acquire_owned().ok()?;
        let most = self.per_computer;
        self.each.retain(|_, its| its.available_permits() < most);
        let its = self.each.entry(computer(address));
        let its = its.or_insert_with(|| Arc::new(Semaphore::new(most)));
        let of_its = Arc::clone(its).try_acquire_owned().ok()?;
        Some(Seat {
            _of_all: of_all,
            _of_its: of_its,
        })
    }
}

/// The identity of a computer: for an IPv6 address its network, in which a computer may use any number of addresses.
fn computer(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) if !address.is_loopback() => {
            let network = u128::from(address) & !u128::from(u64::MAX);
            Ipv6Addr::from(network).into()
        }
        address => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_computer_takes_the_seats_of_others() {
        let mut seats = Seats::new(4, 2);
        let mut take = |address: &str| seats.take(address.parse().expect("an address"));
        let one = [take("192.168.0.1"), take("::ffff:192.168.0.1")];
        assert!(one.iter().all(Option::is_some));
        assert!(take("192.168.0.1").is_none());
        let other = [take("fd00::1:1"), take("fd00::1:2")];
        assert!(other.iter().all(Option::is_some));
        // All are taken.
        assert!(take("192.168.0.2").is_none());
        drop(other);
        let third = take("192.168.0.2");
        assert!(third.is_some());
        drop(one);
        assert!(take("192.168.0.1").is_some());
    }
}
