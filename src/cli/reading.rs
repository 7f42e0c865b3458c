//! The driver.cfg of a command, read with what its command line asks for: at the start, and again when the line is to
//! take the changes of the file.

use std::fmt;
use std::path::{Path, PathBuf};

use serde_json::json;

use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds, PageOptions};
use tickbus_fieldbus::Role;
use tickbus_net::Address;
use tickbus_record as record;

/// The address at which to serve the page; `None` leaves it to the driver.cfg.
#[derive(Clone, Debug)]
pub(super) struct PageAddress(Option<Address>);

/// Parses the value of --page.
pub(super) fn page_address(text: &str) -> Result<PageAddress, String> {
    let stated = (!text.is_empty()).then(|| super::lab::address(text));
    Ok(PageAddress(stated.transpose()?))
}

impl PageAddress {
    /// Asks for the page on behalf of the driver.cfg.
    pub(super) fn ask(&self, config: &mut Config) {
        let page = config.page.get_or_insert_default();
        if let Some(address) = &self.0 {
            page.listen = address.clone();
        }
    }

    /// Returns the address of the page for a command without a driver.cfg.
    pub(super) fn listen(&self) -> Address {
        let usual = || PageOptions::default().listen;
        self.0.clone().unwrap_or_else(usual)
    }
}

/// Returns the recording asked for on the command line. Its path is relative to the current folder, not to that of the
/// driver.cfg.
pub(super) fn recording(file: &Path) -> Result<record::Options, String> {
    let path = std::path::absolute(file)
        .map_err(|error| format!("\"{}\" is no path: {error}", file.display()))?;
    record::Options::to(&path).map_err(|mistake| mistake.to_string())
}

/// Keys that a kind of bus needs, with the value for a machine of which nobody need be kept away.
const NEEDED: &[(&str, &str)] = &[("opcua-server", "anonymous = true\n")];

/// The parts of a command line that change what its driver.cfg says.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub(super) file: PathBuf,
    pub(super) kinds: &'static Kinds,
    pub(super) role: Role,
    pub(super) has_replies: bool,
    /// The kind of bus in the place of the file's own.
    pub(super) bus: Option<String>,
    pub(super) address: Option<String>,
    pub(super) faults: Option<PathBuf>,
    pub(super) record: Option<PathBuf>,
    pub(super) page: Option<PageAddress>,
    pub(super) edit: bool,
}

/// Why a driver.cfg cannot be used.
#[derive(Debug)]
pub(super) enum Wrong {
    /// The file, or the file of faults, has mistakes.
    Mistakes(Mistakes),
    /// The command line does not fit the file.
    Argument(String),
}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mistakes(mistakes) => mistakes.fmt(f),
            Self::Argument(text) => f.write_str(text),
        }
    }
}

impl From<Mistakes> for Wrong {
    fn from(mistakes: Mistakes) -> Self {
        Self::Mistakes(mistakes)
    }
}

impl Reading {
    /// Reads the file.
    pub(super) fn read(&self) -> Result<Config, Wrong> {
        let asked = CommandLineEnd {
            role: self.role,
            moved: self.address.is_some(),
        };
        let mut config = Config::load_as(&self.file, Some(asked), self.kinds)?;
        if let Some(kind) = &self.bus {
            config = on_bus(config, kind)?;
        }
        if let Some(address) = &self.address {
            config.bus.set_address(address).map_err(|error| {
                let kind = config.bus.kind();
                Wrong::Argument(format!("--address: {error} (the bus is \"{kind}\")"))
            })?;
        }
        if let Some(file) = &self.faults {
            config.add_faults(file)?;
        }
        if !self.has_replies {
            config.replies.clear();
        }
        // The [record] table belongs to the simulation, which may run at the other end of the same line. An observer has
        // its own.
        let own = (config.record.take()).filter(|_| self.role == Role::Observer);
        let record = self.record.as_deref().map(recording).transpose();
        config.record = record
            .map_err(|error| Wrong::Argument(format!("--record: {error}")))?
            .or(own);
        if let Some(page) = &self.page {
            page.ask(&mut config);
        }
        if self.edit {
            let page = config.page.get_or_insert_default();
            page.edit = true;
        }
        match &config.page {
            Some(page) if page.edit && !page.listens_here() => Err(Wrong::Argument(format!(
                "--edit: the page is served on {}, and other computers must not edit a driver.cfg, which names \
                 libraries; serve it on 127.0.0.1, and let others in by a tunnel (ssh -L)",
                page.listen
            ))),
            _ => Ok(config),
        }
    }
}

/// Returns the same driver on a bus of this kind with its defaults, and with its own page.
fn on_bus(mut config: Config, kind: &str) -> Result<Config, Mistakes> {
    let page = config.page.take();
    let needed = NEEDED.iter().find(|(known, _)| *known == kind);
    let needed = needed.map_or("", |(_, keys)| keys);
    let text = format!("[fieldbus]\nkind = {}\n{needed}", json!(kind));
    let mut config = config.overlaid("--bus", &text)?;
    config.page = page;
    Ok(config)
}
