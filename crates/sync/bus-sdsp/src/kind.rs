//! The kind `sdsp`, for the list of bus kinds.

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Key, Table};
use tickbus_fieldbus::{At, Bus, BusKind, BusOptions, BusSetup, NamedFile, OpenError, Role};
use tickbus_image::signal::{Signal, SignalTable};

use super::{Every, Options, Sdsp, options};

impl BusKind for Options {
    const NAME: &'static str = "sdsp";
    const KEYS: &'static [&'static [Key]] = &[options::KEYS];
    const ONE_OF: &'static [&'static str] = &options::MEETINGS;

    fn read(_role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(moved, table)
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let mut parts = vec![format!("in step with the server at {}", self.meeting)];
        parts.extend(
            self.client
                .as_ref()
                .map(|name| format!("client \"{name}\"")),
        );
        parts.push(match self.every {
            Every::Time(step) => format!("a step every {step}"),
            Every::Tick => "a step in each tick".to_owned(),
            Every::Steps(multiple) if multiple.get() == 1 => "in each of its steps".to_owned(),
            Every::Steps(multiple) => format!("in one of {multiple} steps"),
        });
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let bus = Sdsp::new(self, setup).map_err(OpenError::Config)?;
        Ok(Bus::Stepped(Box::new(bus)))
    }

    fn is_stepped(&self) -> bool {
        true
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.set_address(address))
    }

    fn has_addresses(&self) -> bool {
        true
    }

    fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        self.place_signals(lines, table);
    }

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        self.at.get(&signal.name).cloned().unwrap_or_default()
    }
}
