//! The driver.cfg of a command, read with what its command line asks for: at the start, and again when the line is to
//! take the changes of the file.

use std::fmt;
use std::path::PathBuf;

use serde_json::json;

use super::host::{Hosting, Job, PageAddress, recording};
use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds};
use tickbus_fieldbus::Role;

/// Keys that a kind of bus needs, with the value for a machine of which nobody need be kept away.
const NEEDED: &[(&str, &str)] = &[("opcua-server", "anonymous = true\n")];

/// The parts of a command line that change what its driver.cfg says.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    file: PathBuf,
    kinds: &'static Kinds,
    role: Role,
    has_replies: bool,
    /// The kind of bus in the place of the file's own.
    bus: Option<String>,
    address: Option<String>,
    faults: Option<PathBuf>,
    record: Option<PathBuf>,
    page: Option<PageAddress>,
    edit: bool,
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
    /// The reading that this job and these arguments ask for.
    pub(super) fn new(job: &Job<'_>, arguments: &Hosting) -> Self {
        Self {
            file: job.file.to_owned(),
            kinds: job.kinds,
            role: job.role,
            has_replies: job.has_replies,
            bus: job.bus.map(str::to_owned),
            address: arguments.address.clone(),
            faults: arguments.faults.clone(),
            record: arguments.record.clone(),
            page: arguments.page.clone(),
            edit: arguments.edit,
        }
    }

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
