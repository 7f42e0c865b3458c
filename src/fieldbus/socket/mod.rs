//! Records of fixed size over TCP.
//!
//! A record is the frames of all stations of one direction, one after another, in the order of the
//! driver.cfg: nothing before them, nothing behind them. So whoever can open a TCP connection can be
//! the other end.
//!
//! [`Session`] is the whole of the protocol, without I/O; the rest carries its bytes.

mod comparison;
mod connect;
mod connection;
mod fault;
mod listen;
mod options;
mod record;
mod session;

use crate::signal::SignalTable;
use crate::time::{Nanos, Stop};

use super::{BusError, Free, Port, Role};

use comparison::Comparison;
pub use fault::Fault;
pub use options::{Options, TcpRole};
pub use record::{Partial, Records};
pub use session::{Sending, Session, Terms};

/// The bus cycle where a driver.cfg names none.
const CYCLE: Nanos = Nanos::from_millis(10);

/// The bus of kind `socket`: one TCP connection, made by this end or by the other.
#[derive(Debug)]
pub struct Socket {
    options: Options,
    cycle: Nanos,
    comparison: Comparison,
}

impl Socket {
    /// The bus that `options` describe, for the end with `role`, with a bus cycle of `cycle` if one is
    /// stated.
    pub fn new(options: &Options, table: &SignalTable, role: Role, cycle: Option<Nanos>) -> Self {
        Self {
            options: options.clone(),
            cycle: cycle.unwrap_or(CYCLE),
            comparison: Comparison::new(table, role),
        }
    }

    fn terms(&self, port: &Port) -> Result<Terms, BusError> {
        let sizes = (0..port.stations()).map(|station| port.sizes(station));
        let (sends, receives) = sizes.fold((0, 0), |all, one| (all.0 + one.0, all.1 + one.1));
        if self.options.sending == Sending::Reply && receives == 0 {
            return Err(BusError::Refused(
                "send = \"reply\" answers the peer's records, but by its signals this end receives \
                 none; use send = \"cyclic\" or \"on-change\""
                    .to_owned(),
            ));
        }
        Ok(Terms {
            sending: self.options.sending,
            cycle: self.cycle,
            min_interval: self.options.min_interval,
            max_age: port.max_age(),
            receives,
            sends,
        })
    }
}

impl Free for Socket {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let terms = self.terms(port)?;
        let serve = match self.options.tcp {
            TcpRole::Listen => listen::listen,
            TcpRole::Connect => connect::connect,
        };
        serve(
            &self.options.address,
            terms,
            &mut self.comparison,
            port,
            stop,
        )
    }
}
