//! The options of one bus of any kind: the content of the table `[fieldbus]`.

use std::ops::{Deref, DerefMut};
use std::path::Path;

use tickbus_base::Mistake;
use tickbus_fieldbus::{At, BusKind, BusOptions};
use tickbus_image::signal::SignalTable;

use crate::loopback;

/// The options of a bus, with the name of its kind. They dereference to the part that all kinds share; code for one
/// kind gets the concrete type with `downcast_ref`.
#[derive(Debug)]
pub struct Options {
    kind: &'static str,
    bus: Box<dyn BusOptions>,
}

impl Options {
    /// Creates the options of a bus of the kind `K`.
    pub fn of<K: BusKind>(options: K) -> Self {
        Self::named(K::NAME, Box::new(options))
    }

    pub(super) fn named(kind: &'static str, bus: Box<dyn BusOptions>) -> Self {
        Self { kind, bus }
    }

    /// Returns the bus kind as a driver.cfg names it.
    pub const fn kind(&self) -> &'static str {
        self.kind
    }

    /// Returns the recording that replaces the peer, as named in the driver.cfg.
    pub fn replayed(&self) -> Option<&Path> {
        match &self.downcast_ref::<loopback::Options>()?.peer {
            loopback::Peer::Replay(file) => Some(file),
            _ => None,
        }
    }

    /// Replaces the address from the driver.cfg with one from a command line.
    ///
    /// # Errors
    ///
    /// The bus has no address, or the text is not a valid address.
    pub fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        let kind = self.kind;
        self.bus.set_address(address).unwrap_or_else(|| {
            Err(Mistake::new(
                format!("the bus \"{kind}\" has no address"),
                format!("remove \"{address}\" from the command"),
            ))
        })
    }

    /// Reads the lines of `[fieldbus.at]`: the addresses of signals in the device. Reports invalid addresses, and a bus
    /// that has no addresses of its own.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        if self.has_addresses() {
            self.bus.place_signals(lines, table);
        } else if let Some(first) = lines.first() {
            first.wrong(
                format!("the bus \"{}\" has no addresses of its own", self.kind),
                "remove [fieldbus.at]; each signal lies where its \"address\" says",
            );
        }
    }
}

impl From<loopback::Options> for Options {
    fn from(options: loopback::Options) -> Self {
        Self::named(loopback::NAME, Box::new(options))
    }
}

impl Clone for Options {
    fn clone(&self) -> Self {
        Self::named(self.kind, self.bus.boxed())
    }
}

impl PartialEq for Options {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind && self.bus.equals(&*other.bus)
    }
}

impl Deref for Options {
    type Target = dyn BusOptions;

    fn deref(&self) -> &Self::Target {
        &*self.bus
    }
}

impl DerefMut for Options {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut *self.bus
    }
}
