//! Finding CPUs that no driver.cfg names.

use super::examine::{Miss, SLOTS, Talk, meets};
use super::options::CALLING;
use super::{End, FrameFields};
use crate::length::LONGEST;
use crate::szl::Identity;
use crate::transport::PORT;
use crate::{ProtocolError, Tsap};
use tickbus_fieldbus::examine::{Found, Peer, Search, Searching, WireEnd};

/// How CPUs are found.
pub(crate) const SEARCH: Search = Search {
    bus: "s7",
    port: PORT,
    ask,
    datagrams: None,
};

/// Asks for the identity, at each of the usual racks and slots until one answers.
fn ask(searching: Searching<'_>) -> Vec<Found> {
    let Searching { peer, wire, .. } = searching;
    let fields = FrameFields {
        lengths: vec![[0, 0]],
        ..FrameFields::default()
    };
    let calling = Tsap::new(&CALLING);
    let mut first = Some(wire);
    for (rack, slot) in SLOTS {
        let ends = (calling, Tsap::of_slot(rack, slot));
        let Some(wire) = first.take().or_else(|| peer.dial().ok()) else {
            return Vec::new();
        };
        let mut talk = Talk::new(wire, &peer, &fields, ends, LONGEST, true);
        let identity = match talk.meet() {
            Ok((_, identity)) => identity,
            Err(Miss::Session(End::Broken(
                ProtocolError::NoIsoOnTcp(_) | ProtocolError::PacketLength(_),
            ))) => return Vec::new(),
            Err(_) if talk.session.asks_who() => {
                meets(&peer, ends).and_then(|(_, identity)| identity)
            }
            // What falls silent at the first slot is no CPU; a CPU refuses, or closes the connection.
            Err(Miss::Wire(WireEnd::Silent)) => return Vec::new(),
            Err(_) => continue,
        };
        return vec![describe(&peer, (rack, slot), identity.as_ref())];
    }
    Vec::new()
}

fn describe(peer: &Peer, (rack, slot): (u8, u8), identity: Option<&Identity>) -> Found {
    Found {
        identity: identity.map(Identity::line).unwrap_or_default(),
        facts: vec![("rack", rack.to_string()), ("slot", slot.to_string())],
        stanza: format!(
            "[fieldbus]\nkind    = \"s7-client\"\naddress = \"{}\"\nrack    = {rack}\nslot    = {slot}\n",
            peer.address
        ),
        named: Vec::new(),
    }
}
