//! Finding Modbus servers that no driver.cfg names.

use tickbus_fieldbus::examine::{Datagrams, Found, Peer, Search, Searching};

use super::examine::{Frame, Miss, Talk, USUAL_UNITS, legible};
use super::{Region, Request};
use crate::identification::READ_DEVICE_IDENTIFICATION;
use crate::{Function, Identification, Span, Table, mbap};

/// How Modbus TCP servers are found.
pub(crate) const SEARCH: Search = Search {
    bus: "modbus",
    port: 502,
    ask,
    datagrams: Some(Datagrams {
        units: usual_units(),
        question,
    }),
};

/// How many of the usual units are tried.
const UNITS: usize = 3;

const fn usual_units() -> &'static [u8] {
    USUAL_UNITS.split_at(UNITS).0
}

/// Asks a unit for its identity, whose refusal is an answer as well.
fn question(unit: u8) -> Vec<u8> {
    const ANY: u16 = 0x7462;
    let code = Function::DeviceIdentification.code();
    let mut telegram = Vec::new();
    mbap::append(ANY, unit, &mut telegram, |pdu| {
        pdu.extend([code, READ_DEVICE_IDENTIFICATION, 1, 0]);
    });
    telegram
}

/// Asks units for their identity; a unit without one for a register, which proves the protocol.
fn ask(searching: Searching<'_>) -> Vec<Found> {
    let Searching { peer, wire, units } = searching;
    let mut found = Vec::new();
    let is_listed = !units.is_empty();
    let units = if is_listed { units } else { usual_units() };
    let mut talk = Some(Talk::new(wire, Frame::Tcp));
    for unit in units {
        let open = talk.take();
        let Some(mut own) = open.or_else(|| Some(Talk::new(peer.dial().ok()?, Frame::Tcp))) else {
            return found;
        };
        match identify(&mut own, *unit) {
            Ok(identity) => {
                found.push(describe(&peer, *unit, &identity));
                talk = Some(own);
                if !is_listed {
                    return found;
                }
            }
            // The unit does not exist, but the protocol is right.
            Err(Miss::Refused(_)) => talk = Some(own),
            Err(Miss::Alien(_) | Miss::Echo { .. }) => return found,
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

fn describe(peer: &Peer, unit: u8, identification: &Identification) -> Found {
    let mut identity = identification.line();
    if identity.is_empty() {
        let id = identification.server_id.as_deref();
        identity = id.map(legible).unwrap_or_default();
    }
    let mut facts = vec![("unit", unit.to_string())];
    let mut stanza = format!(
        "[fieldbus]\nkind    = \"modbus-client\"\naddress = \"{}\"\nunit    = {unit}\n",
        peer.address
    );
    if peer.is_udp {
        facts.push(("over", "UDP".to_owned()));
        stanza.push_str("framing = \"udp\"\n");
    }
    Found {
        identity,
        facts,
        stanza,
        named: Vec::new(),
    }
}
