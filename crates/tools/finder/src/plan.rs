//! The plan of a search: addresses, buses, pace.

use std::collections::HashSet;
use std::net::{IpAddr, SocketAddr};

use tickbus_base::time::{Clock, Stop};
use tickbus_fieldbus::examine::Search;
use tickbus_net::{Address, Error, look_up};

use crate::device::Device;
use crate::target::{Target, addresses};

/// The usual number of connections per second.
pub const RATE: u32 = 500;

/// A search.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The buses, each with the port at which its servers are searched.
    pub searches: Vec<(Search, u16)>,
    /// The addresses with their ports.
    pub addresses: Vec<SocketAddr>,
    /// Connections per second.
    pub rate: u32,
    /// The Modbus units to ask; empty for the usual ones.
    pub units: Vec<u8>,
    /// Search by datagrams as well, for buses that have them.
    pub udp: bool,
}

impl Plan {
    /// Plans a search of `targets` for servers of these buses, each at the port beside it, at the usual [`RATE`]. Names are
    /// looked up.
    ///
    /// # Errors
    ///
    /// A name is unknown.
    pub fn of(
        targets: &[Target],
        searches: Vec<(Search, u16)>,
        clock: &dyn Clock,
        stop: &Stop,
    ) -> Result<Self, Error> {
        let mut ports: Vec<u16> = searches.iter().map(|(_, port)| *port).collect();
        ports.dedup();
        Ok(Self {
            addresses: addresses(targets, &ports, clock, stop)?,
            searches,
            rate: RATE,
            units: Vec::new(),
            udp: false,
        })
    }
    /// Returns the search for the servers that `found` names, if they are at addresses that this search names, and are not
    /// among those that it has tried; `None` without any.
    pub(crate) fn further(&self, found: &[Device], clock: &dyn Clock, stop: &Stop) -> Option<Self> {
        let hosts: HashSet<IpAddr> = self.addresses.iter().map(SocketAddr::ip).collect();
        let is_new = |address: &SocketAddr| {
            hosts.contains(&address.ip()) && !self.addresses.contains(address)
        };
        let mut further = Self {
            searches: Vec::new(),
            addresses: Vec::new(),
            udp: false,
            ..self.clone()
        };
        for device in found {
            let urls = device.found.named.iter().take(MOST_NAMED);
            let addresses = urls.filter_map(|url| address_of(url));
            for address in addresses {
                let looked_up = look_up(&address, clock, stop).unwrap_or_default();
                further
                    .addresses
                    .extend(looked_up.into_iter().filter(is_new));
            }
            if !further.addresses.is_empty() {
                let same = |(search, _): &&(Search, u16)| search.bus == device.bus;
                further.searches.extend(self.searches.iter().filter(same));
            }
        }
        further.addresses.sort_unstable();
        further.addresses.dedup();
        (!further.addresses.is_empty()).then_some(further)
    }
}

/// The most servers that one device may name.
const MOST_NAMED: usize = 32;

/// The host and the port in a URL such as `opc.tcp://press:4840/path`.
fn address_of(url: &str) -> Option<Address> {
    let (_, rest) = url.split_once("://")?;
    let host = rest.split('/').next()?;
    host.parse()
        .ok()
        .filter(|address: &Address| address.check_dialled().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Manual;
    use tickbus_fieldbus::examine::Found;

    const SEARCH: Search = Search {
        bus: "opcua",
        port: 4840,
        ask: |_| Vec::new(),
        datagrams: None,
    };

    #[test]
    fn servers_that_a_device_names_are_searched_if_the_user_has_named_their_addresses() {
        let clock = Manual::new();
        let stop = Stop::new();
        let target: Target = "10.0.0.0/29".parse().expect("a range");
        let plan = Plan::of(&[target], vec![(SEARCH, 4840)], &*clock, &stop).expect("no names");
        let named = [
            "opc.tcp://10.0.0.3:4841/press",
            "opc.tcp://10.0.0.3:4840",
            "opc.tcp://10.0.1.3:4841",
            "opc.tcp://[::1]:4841",
            "opc.tcp://10.0.0.4",
            "nonsense",
        ];
        let device = Device {
            address: "10.0.0.2:4840".parse().expect("an address"),
            bus: "opcua",
            found: Found {
                identity: String::new(),
                facts: Vec::new(),
                stanza: String::new(),
                named: named.map(str::to_owned).into(),
            },
        };
        let further = plan.further(&[device], &*clock, &stop).expect("one");
        let shown: Vec<String> = further
            .addresses
            .iter()
            .map(SocketAddr::to_string)
            .collect();
        assert_eq!(shown, ["10.0.0.3:4841"]);
        assert_eq!(further.searches.len(), 1);
        assert!(plan.further(&[], &*clock, &stop).is_none());
    }
}
