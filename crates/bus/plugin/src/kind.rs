//! The kind `plugin`, for the list of bus kinds.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Table, shown};
use tickbus_fieldbus::{Bus, BusKind, BusOptions, BusSetup, CYCLE, NamedFile, OpenError, Role};
use tickbus_image::signal::SignalTable;

use super::{Options, options};

impl BusKind for Options {
    const NAME: &'static str = "plugin";
    const KEYS: &'static [&'static [Key]] = &[options::KEYS];

    fn read(_role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(table)
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let mut parts = vec![format!("library {}", self.library.display())];
        if self.isolated {
            parts.push("in a helper process".to_owned());
        }
        parts.extend(self.timeout.map(|timeout| format!("timeout {timeout}")));
        let given = self.options.iter();
        parts.extend(given.map(|(key, value)| format!("{} {}", shown(key), shown(value))));
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        let helper = self.helper.iter().cloned();
        let files = std::iter::once(self.library.clone()).chain(helper);
        files.map(NamedFile::Plain).collect()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        super::open(self, setup).map(Bus::Free)
    }

    fn needs_command(&self) -> bool {
        self.isolated && self.helper.is_none()
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }
}
