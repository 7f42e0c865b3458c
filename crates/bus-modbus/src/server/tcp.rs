//! The units of a server over Modbus TCP.

use crate::mbap::{self, ADU_LIMIT, Telegram};
use crate::{Exception, refuse};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::{Limits, Service};
use tickbus_fieldbus::{BusError, Port};

use super::units::{Carried, ServedUnits};

/// The most unconfirmed answers remembered per client.
const REMEMBERED: usize = 64;

/// Modbus TCP as a service for many clients.
#[derive(Debug)]
pub(super) struct TcpService<'a> {
    pub(super) units: &'a mut ServedUnits,
    pub(super) clients: usize,
    pub(super) patience: Nanos,
}

/// One client.
#[derive(Debug)]
pub(super) struct Client {
    /// What its unconfirmed answers carry.
    carried: Vec<Carried>,
    /// The stations that it has written to.
    writes: Box<[bool]>,
}

impl Service for TcpService<'_> {
    type Client = Client;

    fn limits(&self) -> Limits {
        Limits {
            telegram: ADU_LIMIT,
            clients: self.clients,
            patience: self.patience,
        }
    }

    fn welcome(&mut self, _now: Nanos) -> Client {
        Client {
            carried: Vec::new(),
            writes: vec![false; self.units.len()].into(),
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
        let parsed = Telegram::parse(bytes);
        let parsed = parsed.map_err(|error| BusError::Protocol(error.to_string()))?;
        let Some((telegram, length)) = parsed else {
            return Ok(0);
        };
        let Telegram {
            transaction,
            unit,
            pdu,
        } = telegram;
        let carried = mbap::append(transaction, unit, reply, |reply| {
            if let Some(station) = self.units.station(unit) {
                let writes = &mut client.writes;
                return self.units.answer(station, now, pdu, writes, reply, port);
            }
            port.count("modbus-server.unknown_unit");
            refuse(pdu[0], Exception::GATEWAY_TARGET_FAILED, reply);
            None
        });
        if let Some(carried) = carried
            && client.carried.len() < REMEMBERED
        {
            client.carried.push(carried);
        }
        Ok(length)
    }

    fn replied(&mut self, client: &mut Client, port: &mut Port) {
        for carried in client.carried.drain(..) {
            self.units.carried(&carried, port);
        }
    }
}
