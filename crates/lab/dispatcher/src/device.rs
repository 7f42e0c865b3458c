//! The identification of a client.

use std::fmt;
use std::net::{IpAddr, SocketAddr};

use crate::channel::{Counts, Kind};
use crate::name::is_shown_name;

/// The role of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// `VR`: a virtual controller.
    Controller,
    /// `VP`: a virtual process.
    Process,
}

impl Role {
    /// The role's keyword.
    pub const fn keyword(self) -> &'static str {
        match self {
            Self::Controller => "VR",
            Self::Process => "VP",
        }
    }

    pub(crate) fn parse(word: &[u8]) -> Option<Self> {
        let all = [Self::Controller, Self::Process];
        let is_it = |role: &Self| word.eq_ignore_ascii_case(role.keyword().as_bytes());
        all.into_iter().find(is_it)
    }
}

/// A client as the device list shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// The role.
    pub role: Role,
    /// The name.
    pub name: String,
    /// The channels.
    pub counts: Counts,
    /// The address from which the client connected.
    pub peer: SocketAddr,
}

impl Device {
    /// Reads a line of a device list, without its end; ignores blanks.
    pub fn parse(line: &[u8]) -> Option<Self> {
        let text: String = std::str::from_utf8(line).ok()?.split_whitespace().collect();
        let mut parts = text.splitn(7, ':');
        let role = Role::parse(parts.next()?.as_bytes())?;
        let name = parts.next().filter(|name| is_shown_name(name))?.to_owned();
        let mut counts = Counts::default();
        for expected in Kind::ALL {
            let (kind, count) = Kind::with_number(parts.next()?.as_bytes())?;
            if kind != expected {
                return None;
            }
            counts.set(kind, count);
        }
        let address = parts.next()?;
        // For a client of another dispatcher, the name of the host follows the address.
        let address = address.split_once('@').map_or(address, |(it, _)| it);
        let (ip, port) = address.rsplit_once(':')?;
        let ip = ip
            .strip_prefix('[')
            .and_then(|ip| ip.strip_suffix(']'))
            .unwrap_or(ip);
        let peer = SocketAddr::new(ip.parse().ok()?, port.parse().ok()?);
        Some(Self {
            role,
            name,
            counts,
            peer,
        })
    }
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.role.keyword(), self.name)?;
        for kind in Kind::ALL {
            write!(f, ":{}{:02}", kind.letters(), self.counts.of(kind))?;
        }
        match self.peer.ip() {
            IpAddr::V4(ip) => write!(f, ":{ip}:{}", self.peer.port()),
            IpAddr::V6(ip) => write!(f, ":[{ip}]:{}", self.peer.port()),
        }
    }
}
