//! Hosts and ports, as written in a driver.cfg and on a command line.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Value, shown};

/// The longest host name in DNS.
const HOST_LIMIT: usize = 253;

/// A host and a port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// The host.
    pub host: Host,
    /// The port; when listening, 0 lets the system choose one.
    pub port: u16,
}

/// A host, by number or by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Host {
    /// The host's address.
    Ip(IpAddr),
    /// A name that must be looked up.
    Name(String),
}

impl Address {
    /// A port on this machine, reachable only from this machine.
    pub const fn local(port: u16) -> Self {
        Self {
            host: Host::Ip(IpAddr::V4(Ipv4Addr::LOCALHOST)),
            port,
        }
    }

    /// Reads the value of the key `address`, and reports mistakes in it.
    pub fn read(value: &Value<'_>) -> Option<Self> {
        let text = value.text("write a host and a port in quotes, such as \"127.0.0.1:20030\"")?;
        text.parse().map_err(|mistake| value.refuse(mistake)).ok()
    }

    /// Reads an address to connect to.
    pub fn read_dialled(value: &Value<'_>) -> Option<Self> {
        let address = Self::read(value)?;
        let checked = address.check_dialled();
        checked.map_err(|mistake| value.refuse(mistake)).ok()?;
        Some(address)
    }

    /// Checks that the address is one to connect to.
    ///
    /// # Errors
    ///
    /// Nothing can listen on port 0.
    pub fn check_dialled(&self) -> Result<(), Mistake> {
        if self.port == 0 {
            return Err(Mistake::new(
                "port 0 cannot be connected to",
                "write the port on which the other end listens, or give its address on the \
                        command line with --address; 0 is for an end that listens, and lets the system \
                        choose",
            ));
        }
        Ok(())
    }
}

/// Reads `HOST:PORT`: `127.0.0.1:20030`, `[::1]:20030`, `plc.example.com:20030`.
impl FromStr for Address {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        const SHAPE: &str = "write a host and a port, such as \"127.0.0.1:20030\"";
        let refuse = |what: String, right: &str| Err(Mistake::new(what, right));
        let Some((host, digits)) = text.rsplit_once(':') else {
            return refuse(
                format!("the address \"{}\" has no port", shown(text)),
                SHAPE,
            );
        };
        if host.contains(':') && !host.starts_with('[') {
            let what = format!("the address \"{}\" has colons in its host", shown(text));
            return refuse(
                what,
                "write an IPv6 address in brackets, such as \"[::1]:20030\"",
            );
        }
        // `parse` alone would accept a plus sign.
        let port = digits.parse().ok().filter(|_| !digits.starts_with('+'));
        let Some(port) = port else {
            let what = format!("\"{}\" is no port", shown(digits));
            return refuse(what, "write a number from 1 to 65535 behind the colon");
        };
        Ok(Self {
            host: host.parse()?,
            port,
        })
    }
}

impl FromStr for Host {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let refuse = |what: String, right: &str| Err(Mistake::new(what, right));
        if text.is_empty() {
            let right = "write the host before the colon: 127.0.0.1 is this machine alone, 0.0.0.0 \
                         all of its networks";
            return refuse("the address has no host".to_owned(), right);
        }
        let bare = text
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'));
        if let Some(bare) = bare {
            return match bare.parse::<Ipv6Addr>() {
                Ok(ip) => Ok(Self::Ip(ip.into())),
                Err(_) => refuse(
                    format!("\"{}\" is no IPv6 address", shown(bare)),
                    "write one such as [::1], or an IPv4 address or a name without brackets",
                ),
            };
        }
        if let Ok(ip) = text.parse::<Ipv4Addr>() {
            return Ok(Self::Ip(ip.into()));
        }
        // This name always means this machine. Without a look-up there is one address; a look-up could return two.
        if text.eq_ignore_ascii_case("localhost") {
            return Ok(Self::Ip(Ipv4Addr::LOCALHOST.into()));
        }
        if text
            .bytes()
            .all(|byte| byte.is_ascii_digit() || byte == b'.')
        {
            return refuse(
                format!("\"{}\" is no IPv4 address", shown(text)),
                "write four numbers from 0 to 255, such as 192.168.0.10",
            );
        }
        let letter = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if text.len() > HOST_LIMIT || !text.chars().all(letter) {
            return refuse(
                format!("\"{}\" is no name of a host", shown(text)),
                "write an IP address, or a name of letters, digits, dots and hyphens",
            );
        }
        Ok(Self::Name(text.to_owned()))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}

impl fmt::Display for Host {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ip(IpAddr::V6(ip)) => write!(f, "[{ip}]"),
            Self::Ip(ip) => ip.fmt(f),
            Self::Name(name) => f.write_str(name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_read_and_write_themselves() {
        for text in [
            "127.0.0.1:20030",
            "0.0.0.0:0",
            "[::1]:1",
            "[fe80::1]:65535",
            "plc-7.hall_2.example.com:502",
        ] {
            let address: Address = text.parse().unwrap_or_else(|why| panic!("{why}"));
            assert_eq!(address.to_string(), text);
        }
        let localhost: Address = "LocalHost:7".parse().expect("this machine");
        assert_eq!(localhost.to_string(), "127.0.0.1:7");
    }

    #[test]
    fn what_is_no_address_is_told_why() {
        for (text, part) in [
            ("", "has no port"),
            ("127.0.0.1", "has no port"),
            ("::1", "colons in its host"),
            (":20030", "has no host"),
            ("127.0.0.1:", "no port"),
            ("127.0.0.1:65536", "no port"),
            ("127.0.0.1:+7", "no port"),
            ("127.0.0.1: 7", "no port"),
            ("127.0.0.256:7", "no IPv4 address"),
            ("127.1:7", "no IPv4 address"),
            ("::1:20030", "colons in its host"),
            ("[::x]:7", "no IPv6 address"),
            ("[127.0.0.1]:7", "no IPv6 address"),
            ("tcp://host:7", "colons in its host"),
            ("a host:7", "no name of a host"),
        ] {
            let told = text.parse::<Address>().expect_err(text).to_string();
            assert!(told.contains(part), "\"{part}\" in {told}");
        }
    }
}
