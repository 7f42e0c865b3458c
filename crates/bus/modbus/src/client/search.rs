//! Finding Modbus servers that no driver.cfg names.

use tickbus_fieldbus::examine::{Found, Search, Searching};

use super::examine::{Frame, Miss, Talk, USUAL_UNITS, legible};
use super::{Region, Request};
use crate::{Identification, Span, Table};

/// How Modbus TCP servers are found.
pub(crate) const SEARCH: Search = Search {
    bus: "modbus",
    port: 502,
    ask,
};

/// How many of the usual units are tried.
const UNITS: usize = 3;

/// Asks units for their identity; a unit without one for a register, which proves the protocol.
fn ask(searching: Searching<'_>) -> Vec<Found> {
    let Searching { peer, wire, units } = searching;
    let mut found = Vec::new();
    let is_listed = !units.is_empty();
    let units = if is_listed {
        units
    } else {
        &USUAL_UNITS[..UNITS]
    };
    let mut talk = Some(Talk::new(wire, Frame::Tcp));
    for unit in units {
        let open = talk.take();
        let Some(mut own) = open.or_else(|| Some(Talk::new(peer.dial().ok()?, Frame::Tcp))) else {
            return found;
        };
        match identify(&mut own, *unit) {
            Ok(identity) => {
                found.push(describe(&peer.address.to_string(), *unit, &identity));
                talk = Some(own);
                if !is_listed {
                    return found;
                }
            }
            // The unit does not exist, but the protocol is right.
            Err(Miss::Refused(_)) => talk = Some(own),
            Err(Miss::Alien(_)) => return found,
            // Closed or silent: the next unit has a connection of its own.
            Err(Miss::End(_) | Miss::Malformed(_)) => {}
        }
    }
    found
}

fn identify(talk: &mut Talk, unit: u8) -> Result<Identification, Miss> {
    match talk.identity(unit) {
        Err(Miss::Refused(exception)) if !exception.passes() => {
            let first = Region::new(Table::HoldingRegisters, Span { first: 0, count: 1 });
            match talk.read(unit, &Request::Read(first), &mut [0; 2]) {
                Err(Miss::Refused(exception)) if exception.passes() => {
                    Err(Miss::Refused(exception))
                }
                Ok(()) | Err(Miss::Refused(_)) => Ok(Identification::default()),
                Err(miss) => Err(miss),
            }
        }
        known => known,
    }
}

fn describe(address: &str, unit: u8, identification: &Identification) -> Found {
    let mut identity = identification.line();
    if identity.is_empty() {
        let id = identification.server_id.as_deref();
        identity = id.map(legible).unwrap_or_default();
    }
    Found {
        identity,
        facts: vec![("unit", unit.to_string())],
        stanza: format!(
            "[fieldbus]\nkind    = \"modbus-client\"\naddress = \"{address}\"\nunit    = {unit}\n"
        ),
    }
}
