//! The units of a server over TCP, with either framing.

use std::net::SocketAddr;
use std::sync::Arc;

use crate::mbap::{self, ADU_LIMIT, Telegram};
use crate::restricts::Restricts;
use crate::{Exception, answer, refuse, rtu};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::{Limits, Service};
use tickbus_fieldbus::{BusError, Port, Renewal};

use super::units::{BROADCAST, Carried, ServedUnits, Source};

/// The most unconfirmed answers remembered per client.
const REMEMBERED: usize = 64;

/// Modbus TCP, or RTU over TCP, as a service for many clients.
#[derive(Debug)]
pub(super) struct TcpService<'a> {
    pub(super) units: &'a mut ServedUnits,
    pub(super) is_rtu: bool,
    pub(super) clients: usize,
    pub(super) patience: Nanos,
}

/// One client.
#[derive(Debug)]
pub(super) struct Client {
    /// The values in the client's unconfirmed answers.
    carried: Vec<Carried>,
    source: Source,
}

impl Client {
    fn remember(&mut self, carried: Option<Carried>) {
        if let Some(carried) = carried
            && self.carried.len() < REMEMBERED
        {
            self.carried.push(carried);
        }
    }
}

impl TcpService<'_> {
    /// Like [`telegram`](Service::telegram), for RTU.
    fn rtu_telegram(
        &mut self,
        client: &mut Client,
        now: Nanos,
        bytes: &[u8],
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        let split = rtu::split(bytes, answer::length);
        let split = split.map_err(|error| {
            self.units.damaged(false);
            BusError::Protocol(error.to_string())
        })?;
        let Some((unit, pdu, length)) = split else {
            return Ok(0);
        };
        self.units.heard();
        let source = &mut client.source;
        if unit == BROADCAST {
            self.units.broadcast(now, pdu, source, port);
        } else if let Some(station) = self.units.station(unit) {
            let begin = reply.len();
            let carried = rtu::append(unit, reply, |reply| {
                self.units.answer(station, now, pdu, source, reply, port)
            });
            match port.take_wrong() {
                Some(wrong) => rtu::spoil(reply, begin, wrong),
                None => client.remember(carried),
            }
        } else {
            // The unit may belong to another device on the same serial line.
            port.count("modbus-server.unknown_unit");
        }
        Ok(length)
    }
}

impl Restricts for TcpService<'_> {
    fn restrict(client: &mut Client) {
        client.source.may_write = false;
    }
}

impl Service for TcpService<'_> {
    type Client = Client;

    fn limits(&self) -> Limits {
        Limits {
            telegram: if self.is_rtu {
                rtu::ADU_LIMIT
            } else {
                ADU_LIMIT
            },
            clients: self.clients,
            patience: self.patience,
        }
    }

    fn welcome(&mut self, peer: SocketAddr, _now: Nanos) -> Client {
        Client {
            carried: Vec::new(),
            source: Source {
                renewals: vec![Renewal::of_new_client(); self.units.len()].into(),
                writer: Some(Arc::new(peer)),
                may_write: true,
            },
        }
    }

    fn telegram(
        &mut self,
        client: &mut Client,
        now: Nanos,
        bytes: &[u8],
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        if self.is_rtu {
            return self.rtu_telegram(client, now, bytes, reply, port);
        }
        let parsed = Telegram::parse(bytes);
        let parsed = parsed.map_err(|error| {
            self.units.damaged(false);
            BusError::Protocol(error.to_string())
        })?;
        let Some((telegram, length)) = parsed else {
            return Ok(0);
        };
        self.units.heard();
        let Telegram {
            transaction,
            unit,
            pdu,
        } = telegram;
        let begin = reply.len();
        let carried = mbap::append(transaction, unit, reply, |reply| {
            if let Some(station) = self.units.station(unit) {
                let source = &mut client.source;
                return self.units.answer(station, now, pdu, source, reply, port);
            }
            port.count("modbus-server.unknown_unit");
            refuse(pdu[0], Exception::GATEWAY_TARGET_FAILED, reply);
            None
        });
        // What the client cannot understand it has not received.
        match port.take_wrong() {
            Some(wrong) => mbap::spoil(reply, begin, wrong),
            None => client.remember(carried),
        }
        Ok(length)
    }

    fn replied(&mut self, client: &mut Client, port: &mut Port) {
        for carried in client.carried.drain(..) {
            self.units.carried(&carried, port);
        }
    }

    fn unheard(&mut self, client: &mut Client, now: Nanos, port: &mut Port) {
        client.carried.clear();
        Renewal::lost_all(&mut client.source.renewals, now, port.max_age());
    }

    // The other units of the connection live.
    fn unanswered(&mut self, client: &mut Client, stations: &[usize], now: Nanos, port: &mut Port) {
        let is_of = |station: &usize| stations.contains(station);
        client.carried.retain(|one| !is_of(&one.station));
        for (station, renewal) in client.source.renewals.iter_mut().enumerate() {
            if is_of(&station) {
                renewal.lost(now, port.max_age());
            }
        }
    }
}
