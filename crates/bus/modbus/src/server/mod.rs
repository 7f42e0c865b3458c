//! The bus `modbus-server`: clients read and write the image.

mod at;
mod diagnostics;
mod examine;
mod files;
mod options;
mod reserved;
mod serial;
mod tcp;
mod udp;
mod units;

use tickbus_base::time::Stop;
use tickbus_fieldbus::{BusError, BusSetup, Free, Medium, Port, tcp as many};

use super::{Line, tls};
use crate::tls::ServerSide;
pub(crate) use files::FILES;
pub(crate) use options::QUEUES;
pub use options::ServerOptions;
pub(crate) use reserved::{RANGE_KEYS, RANGES};
use tcp::TcpService;
use units::ServedUnits;

/// The bus of kind `modbus-server`.
#[derive(Debug)]
pub struct ModbusServer {
    options: ServerOptions,
    units: ServedUnits,
    tls: Option<ServerSide>,
}

impl ModbusServer {
    /// The bus that `options` describe.
    pub fn new(options: &ServerOptions, setup: &BusSetup<'_>) -> Self {
        Self {
            options: options.clone(),
            units: ServedUnits::new(options, setup),
            tls: None,
        }
    }

    /// The same server within TLS, if `tls` is there.
    pub(crate) fn within(mut self, tls: Option<ServerSide>) -> Self {
        self.tls = tls;
        self
    }
}

impl Free for ModbusServer {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        match &self.options.line {
            Line::Tcp(address) | Line::RtuOverTcp(address) => {
                let mut service = TcpService {
                    units: &mut self.units,
                    is_rtu: matches!(self.options.line, Line::RtuOverTcp(_)),
                    clients: self.options.clients,
                    patience: port.max_age(),
                };
                port.carried_by(Medium::Tcp);
                match (&self.tls, &self.options.tls) {
                    (Some(side), Some(tls)) => {
                        let roles = tls.write_roles.as_deref();
                        tls::serve(side, roles, service, address, port, stop)
                    }
                    _ => many::serve(address, &mut service, port, stop),
                }
            }
            Line::Udp(address) => {
                udp::serve(address, &mut self.units, self.options.clients, port, stop)
            }
            Line::Serial(line) => serial::serve(line, &mut self.units, port, stop),
        }
    }
}
