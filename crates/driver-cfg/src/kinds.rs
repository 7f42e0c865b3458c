//! The bus kinds: a line for each.

use std::ops::{Deref, DerefMut};
use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Table, Value, did_you_mean, shown};
use tickbus_bus_dispatcher as dispatcher;
use tickbus_bus_hilscher as hilscher;
use tickbus_bus_identification as identification;
use tickbus_bus_interbus as interbus;
use tickbus_bus_modbus as modbus;
use tickbus_bus_opcua as opcua;
use tickbus_bus_plugin as plugin;
use tickbus_bus_profibus as profibus;
use tickbus_bus_s7 as s7;
use tickbus_bus_sdsp as sdsp;
use tickbus_bus_socket as socket;
use tickbus_fieldbus::{At, BusKind, BusOptions, Events, Role};
use tickbus_image::signal::SignalTable;

use crate::loopback;

/// Makes all that has a part for each kind from one line of it.
macro_rules! kinds {
    (
        exported: $($(#[doc = $doc:literal])+ $own:ident($own_options:ty),)+
        by_hand: $($(#[doc = $hand_doc:literal])+ $(#[cfg($cfg:meta)])? $hand:ident($hand_options:ty),)+
    ) => {
        /// What the `[fieldbus]` table configures, by bus kind. It dereferences to what all kinds have in common.
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub enum Options {
            $($(#[doc = $doc])+ $own($own_options),)+
            $($(#[doc = $hand_doc])+ $(#[cfg($cfg)])? $hand($hand_options),)+
        }

        /// The kinds as the PLC's half of a line is made for them. There is no other match on them, and none without all
        /// of them: an export that a kind lacks is a mistake of the compiler's.
        #[derive(Clone, Copy, Debug)]
        pub enum Exported<'a> {
            $($(#[doc = $doc])+ $own(&'a $own_options),)+
            /// A bus, by its kind, whose other end no PLC editor has a program for: the user writes it by hand.
            ByHand(&'static str),
        }

        /// The bus kinds in this version.
        const BUILT: &[&str] = &[
            $(<$own_options as BusKind>::NAME,)+
            $($(#[cfg($cfg)])? <$hand_options as BusKind>::NAME,)+
        ];

        impl Options {
            /// The bus kind as a driver.cfg names it.
            pub const fn kind(&self) -> &'static str {
                match self {
                    $(Self::$own(_) => <$own_options as BusKind>::NAME,)+
                    $($(#[cfg($cfg)])? Self::$hand(_) => <$hand_options as BusKind>::NAME,)+
                }
            }

            /// What the exports go by.
            pub const fn exported(&self) -> Exported<'_> {
                match self {
                    $(Self::$own(options) => Exported::$own(options),)+
                    $($(#[cfg($cfg)])? Self::$hand(_) => Exported::ByHand(self.kind()),)+
                }
            }

            /// Reads the keys of a kind in `BUILT`.
            fn read_kind(kind: &str, role: Role, moved: bool, table: Table<'_>) -> Option<(Self, Events)> {
                $(if kind == <$own_options as BusKind>::NAME {
                    return read_keys(role, moved, table).map(|(options, events)| (Self::$own(options), events));
                })+
                $($(#[cfg($cfg)])? if kind == <$hand_options as BusKind>::NAME {
                    return read_keys(role, moved, table).map(|(options, events)| (Self::$hand(options), events));
                })+
                unreachable!("{kind} is a kind of this version")
            }
        }

        impl Deref for Options {
            type Target = dyn BusOptions;

            fn deref(&self) -> &Self::Target {
                match self {
                    $(Self::$own(options) => options,)+
                    $($(#[cfg($cfg)])? Self::$hand(options) => options,)+
                }
            }
        }

        impl DerefMut for Options {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self {
                    $(Self::$own(options) => options,)+
                    $($(#[cfg($cfg)])? Self::$hand(options) => options,)+
                }
            }
        }
    };
}

// A kind whose PLC has a half in an editor goes to the first list, and every export says what it makes of it.
kinds! {
    exported:
    /// `kind = "loopback"`: both ends in one process.
    Loopback(loopback::Options),
    /// `kind = "socket"`: records of fixed size over TCP.
    Socket(socket::Options),
    /// `kind = "modbus-server"`: Modbus clients read and write the image.
    ModbusServer(modbus::ServerOptions),
    /// `kind = "modbus-client"`: reads and writes the tables of a Modbus server.
    ModbusClient(modbus::ClientOptions),
    /// `kind = "s7-server"`: S7 communication clients read and write the image.
    S7Server(s7::ServerOptions),
    /// `kind = "s7-client"`: reads and writes the memory of a CPU.
    S7Client(s7::ClientOptions),
    /// `kind = "opcua-client"`: for PLCs that are OPC UA servers.
    OpcuaClient(opcua::ClientOptions),
    /// `kind = "opcua-server"`: for PLCs that are OPC UA clients.
    OpcuaServer(opcua::ServerOptions),
    by_hand:
    /// `kind = "profibus-device"`: DP slaves in software on a serial line.
    ProfibusDevice(profibus::Options),
    /// `kind = "hilscher-cif"`: a card of the generation before.
    HilscherCif(hilscher::cif::Options),
    /// `kind = "hilscher-cifx"`: a cifX or netX card.
    HilscherCifx(hilscher::cifx::Options),
    /// `kind = "interbus-ddi"`: an INTERBUS controller board.
    InterbusDdi(interbus::Options),
    /// `kind = "ivi-client"`: asks a reader of code carriers.
    IviClient(identification::ClientOptions),
    /// `kind = "ivi-reader"`: a simulated reader of code carriers.
    IviReader(identification::ReaderOptions),
    /// `kind = "sdsp"`: a client of a run on virtual time.
    Sdsp(sdsp::Options),
    /// `kind = "dispatcher"`: a client of a virtual laboratory.
    Dispatcher(dispatcher::Options),
    /// `kind = "plugin"`: a vendor's shared library.
    Plugin(plugin::Options),
    /// `kind = "mailbox"`: the example of `examples/bus-mailbox`.
    #[cfg(feature = "example-bus")]
    Mailbox(tickbus_bus_mailbox::Options),
}

impl Options {
    /// The recording that replaces the peer, as named in the driver.cfg.
    pub fn replayed(&self) -> Option<&Path> {
        match self {
            Self::Loopback(loopback::Options {
                peer: loopback::Peer::Replay(file),
                ..
            }) => Some(file),
            _ => None,
        }
    }

    /// Replaces the address from the driver.cfg by one from a command line.
    ///
    /// # Errors
    ///
    /// The bus has no address, or the text is not a valid one.
    pub fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        let kind = self.kind();
        self.deref_mut().set_address(address).unwrap_or_else(|| {
            Err(Mistake::new(
                format!("the bus \"{kind}\" has no address"),
                format!("remove \"{address}\" from the command"),
            ))
        })
    }

    /// Takes the lines of `[fieldbus.at]`: the addresses of signals in the device. Reports invalid addresses,
    /// or that the bus has no addresses of its own.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        if self.has_addresses() {
            self.deref_mut().place_signals(lines, table);
        } else if let Some(first) = lines.first() {
            first.wrong(
                format!("the bus \"{}\" has no addresses of its own", self.kind()),
                "remove [fieldbus.at]; each signal lies where its \"address\" says",
            );
        }
    }

    /// Reads `events` and the keys of the bus kind `kind`, and reports their mistakes. `moved` says that another
    /// address will replace the one that is read.
    ///
    /// The table is finished: keys that are left in it are unknown, unless the bus kind itself is unknown.
    pub fn read(
        kind: &Value<'_>,
        role: Role,
        moved: bool,
        table: Table<'_>,
    ) -> Option<(Self, Events)> {
        let first = BUILT[0];
        let name = kind.text(&format!(
            "write the kind of bus in quotes, such as \"{first}\""
        ));
        match name {
            Some(name) if BUILT.contains(&name) => Self::read_kind(name, role, moved, table),
            other => {
                table.finish_open();
                report_kind(kind, other?);
                None
            }
        }
    }
}

/// Reads the keys of one kind, and `events`, which all kinds have.
fn read_keys<K: BusKind>(role: Role, moved: bool, mut table: Table<'_>) -> Option<(K, Events)> {
    let options = K::read(role, moved, &mut table);
    let events = table.take("events");
    table.finish();
    let events = events.map_or(Some(Events::None), |value| {
        read_events(&value, K::LEARNS_OF_WRITES)
    });
    Some((options?, events?))
}

fn read_events(value: &Value<'_>, has_writes: bool) -> Option<Events> {
    if value.is_boolean() || !has_writes {
        let changes = value.boolean()?;
        return Some(if changes {
            Events::Changes
        } else {
            Events::None
        });
    }
    let right = "write true for every change, \"writes\" for every write, changed or not, or false";
    let text = value.text(right)?;
    if text != "writes" {
        value.wrong(format!("\"{}\" is no kind of events", shown(text)), right);
        return None;
    }
    Some(Events::Writes)
}

fn report_kind(kind: &Value<'_>, name: &str) {
    let right = match name.to_ascii_lowercase().as_str() {
        "profinet" | "ethercat" | "ethernet-ip" | "ethernetip" | "canopen" | "devicenet" | "powerlink" => {
            "this bus needs a card: kind = \"hilscher-cifx\" (docs/hilscher.md), or \"plugin\" for another vendor's; \
             docs/which-bus.md lists what suits each PLC"
                .to_owned()
        }
        _ => did_you_mean(name, "bus kinds", BUILT),
    };
    kind.wrong(format!("bus kind \"{}\" is unknown", shown(name)), right);
}
