//! The targets of a search: addresses, ranges and names that the user writes.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Stop};
use tickbus_base::toml_text::shown;
use tickbus_net::{Address, Error, Host, look_up};

/// The widest network, as the number of bits that all of its addresses share.
const WIDEST: u32 = 16;

/// One argument of a search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// The addresses from the first to the last one, both included, at the usual ports or at this one.
    Range(Ipv4Addr, Ipv4Addr, Option<u16>),
    /// A host, at the usual ports or at this one.
    Host(Host, Option<u16>),
}

impl FromStr for Target {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        // Without a port behind it IPv6 needs no brackets.
        if let Ok(ip) = text.parse::<Ipv6Addr>() {
            return Ok(Self::Host(Host::Ip(ip.into()), None));
        }
        if let Some((network, bits)) = text.split_once('/') {
            return network_of(network, bits)
                .ok_or_else(|| wrong(text))
                .and_then(|range| range.check(text));
        }
        let (bare, port) = match text.rsplit_once(':') {
            // The brackets of an IPv6 address end before its port.
            Some((host, digits))
                if !digits.contains(']') && (!host.contains(':') || host.ends_with(']')) =>
            {
                let address: Address = text.parse()?;
                address.check_dialled()?;
                (host, Some(digits.parse().map_err(|_| wrong(text))?))
            }
            _ => (text, None),
        };
        if let Some((first, last)) = bare.rsplit_once('-')
            && let Ok(first) = first.parse::<Ipv4Addr>()
        {
            let last = last_of(first, last).ok_or_else(|| wrong(text))?;
            return Self::Range(first, last, port).check(text);
        }
        Ok(Self::Host(bare.parse()?, port))
    }
}

fn wrong(text: &str) -> Mistake {
    Mistake::new(
        format!("\"{}\" is no address to search", shown(text)),
        "write an address, a name, or a range such as 192.168.0.0/24 or 192.168.0.5-20",
    )
}

/// The addresses of a network without those of the network itself and of the broadcast.
fn network_of(network: &str, bits: &str) -> Option<Target> {
    let network: Ipv4Addr = network.parse().ok()?;
    let bits: u32 = bits.parse().ok().filter(|bits| *bits <= 32 && *bits > 0)?;
    let mask = u32::MAX << (32 - bits);
    let (first, last) = (network.to_bits() & mask, network.to_bits() | !mask);
    let ends = if bits < 31 {
        (first + 1, last - 1)
    } else {
        (first, last)
    };
    Some(Target::Range(ends.0.into(), ends.1.into(), None))
}

/// The end of a range: a whole address, or its last number.
fn last_of(first: Ipv4Addr, last: &str) -> Option<Ipv4Addr> {
    if let Ok(last) = last.parse() {
        return Some(last);
    }
    let [a, b, c, _] = first.octets();
    Some(Ipv4Addr::new(a, b, c, last.parse().ok()?))
}

impl Target {
    fn check(self, text: &str) -> Result<Self, Mistake> {
        if let Self::Range(first, last, _) = self {
            let Some(count) = last.to_bits().checked_sub(first.to_bits()) else {
                return Err(Mistake::new(
                    format!("\"{}\" ends before it begins", shown(text)),
                    "write the smaller address first",
                ));
            };
            if count >= 1 << (32 - WIDEST) {
                return Err(Mistake::new(
                    format!("\"{}\" has more than 65,536 addresses", shown(text)),
                    "name the network of the machine, such as 192.168.0.0/24",
                ));
            }
        }
        Ok(self)
    }
}

/// All addresses of `targets` at `ports`, each once. Names are looked up.
///
/// # Errors
///
/// A name is unknown.
pub(crate) fn addresses(
    targets: &[Target],
    ports: &[u16],
    clock: &dyn Clock,
    stop: &Stop,
) -> Result<Vec<SocketAddr>, Error> {
    let mut hosts: Vec<(IpAddr, Option<u16>)> = Vec::new();
    for target in targets {
        match target {
            Target::Range(first, last, port) => {
                let range = first.to_bits()..=last.to_bits();
                hosts.extend(range.map(|bits| (Ipv4Addr::from_bits(bits).into(), *port)));
            }
            Target::Host(host, port) => {
                let address = Address {
                    host: host.clone(),
                    port: port.unwrap_or_default(),
                };
                let found = look_up(&address, clock, stop)?;
                hosts.extend(found.iter().map(|found| (found.ip(), *port)));
            }
        }
    }
    // One port of all addresses after another: an address gets its packets apart.
    let mut all: Vec<SocketAddr> = Vec::new();
    for port in ports {
        all.extend(
            hosts
                .iter()
                .map(|(ip, own)| SocketAddr::new(*ip, own.unwrap_or(*port))),
        );
    }
    let mut seen = std::collections::HashSet::new();
    all.retain(|address| seen.insert(*address));
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Manual;

    fn all(text: &str) -> Vec<String> {
        let target: Target = text.parse().unwrap_or_else(|why| panic!("{text}: {why}"));
        let found = addresses(&[target], &[502, 102], &*Manual::new(), &Stop::new());
        let found = found.expect("no names");
        found.iter().map(SocketAddr::to_string).collect()
    }

    #[test]
    fn addresses_and_ranges_are_read() {
        assert_eq!(all("10.0.0.7"), ["10.0.0.7:502", "10.0.0.7:102"]);
        assert_eq!(all("10.0.0.7:1502"), ["10.0.0.7:1502"]);
        assert_eq!(all("[::1]:7"), ["[::1]:7"]);
        assert_eq!(all("[::1]"), ["[::1]:502", "[::1]:102"]);
        assert_eq!(all("::1"), ["[::1]:502", "[::1]:102"]);
        assert_eq!(all("10.0.0.5-6:7"), ["10.0.0.5:7", "10.0.0.6:7"]);
        assert_eq!(all("10.0.0.255-10.0.1.0:7").len(), 2);
        assert_eq!(all("192.168.0.0/24").len(), 2 * 254);
        assert_eq!(
            all("192.168.0.77/30")[..2],
            ["192.168.0.77:502", "192.168.0.78:502"]
        );
        assert_eq!(all("10.0.0.1/32").len(), 2);
        assert_eq!(all("10.0.0.0/31").len(), 4);
    }

    #[test]
    fn what_is_no_target_is_refused_with_a_remedy() {
        for (text, part) in [
            ("", "no host"),
            ("10.0.0.0/33", "no address"),
            ("10.0.0.0/0", "no address"),
            ("10.0.0.0/8", "65,536"),
            ("10.0.0.0/x", "no address"),
            ("10.0.0.9-5", "before"),
            ("10.0.0.9-300", "no address"),
            ("10.0.0", "no IPv4 address"),
            ("10.0.0.1:0", "port 0"),
            ("10.0.0.1:x", "no port"),
            ("a b", "no name"),
        ] {
            let told = text.parse::<Target>().expect_err(text).to_string();
            assert!(told.contains(part), "\"{part}\" in {told}");
        }
    }
}
