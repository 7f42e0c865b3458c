//! The examination of Modbus over UDP.

use tickbus_fieldbus::examine::{Examination, WireEnd};
use tickbus_net::Address;

use super::super::ClientOptions;
use super::ask::{Frame, Miss, Talk};
use super::speak::answers;

impl ClientOptions {
    /// Examines a line of datagrams: no port accepts anything, so an answer is the first sign of life.
    pub(super) fn examine_datagrams(&self, examination: &mut Examination<'_>, address: &Address) {
        let Some(peer) = examination.find_peer(address) else {
            return;
        };
        let peer = peer.by_datagrams();
        let wire = match peer.dial() {
            Ok(wire) => wire,
            Err(why) => return examination.unreachable(peer.address, why),
        };
        let mut talk = Talk::new(wire, Frame::Tcp);
        for station in 0..examination.setup.table.stations.len() {
            let unit = self.unit(station);
            let probe = self.probe(examination, station);
            // A datagram can be lost.
            let answered =
                answers(&mut talk, unit, &probe).or_else(|_| answers(&mut talk, unit, &probe));
            let Err(miss) = answered else {
                examination.ok("protocol", format!("unit {unit} answers as Modbus does"));
                continue;
            };
            let (cause, next) = match miss {
                Miss::End(WireEnd::Closed) => (
                    "port-closed",
                    "a computer is there, and nothing listens on this UDP port: switch on the server in the PLC, or \
                     correct the port",
                ),
                Miss::End(_) => (
                    "silent",
                    "check the address, the port and the unit, whether the device speaks Modbus over UDP (most speak \
                     TCP: remove framing = \"udp\"), and the firewalls on the way",
                ),
                _ => ("not-modbus", "correct the port: Modbus usually has 502"),
            };
            let evidence = format!("{}, unit {unit}, {miss}", peer.address);
            examination.fail("protocol", cause, evidence, next);
            return;
        }
        let device = peer.address.to_string();
        let again = || Some(Talk::new(peer.dial().ok()?, Frame::Tcp));
        self.look_at_values(examination, talk, (&device, &again), |_| {});
    }
}
