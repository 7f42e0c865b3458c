//! The machine's end of the line, while it runs in this process.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_driver::Host;
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds};
use tickbus_fieldbus::Role;
use tickbus_live_page::{LivePage, Member, Options};
use tickbus_plc::Program;

/// The interval of the machine's ticks.
const TICK: Nanos = Nanos::from_millis(1);

/// The stand-in for the simulator while there is none.
pub struct Opened {
    /// The machine's program.
    pub program: Box<dyn Program>,
    /// How it is shown on the live page.
    pub options: Options,
}

/// Makes the machine for a driver.cfg, or says why there is none.
pub type Machine = Box<dyn Fn(&Config) -> Result<Opened, String> + Send + Sync>;

/// A line that runs; dropping it closes it.
pub(crate) struct Line {
    host: Option<Host>,
    // Left before the host closes, so that the page asks no tick that has ended.
    member: Option<Member>,
}

impl std::fmt::Debug for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Line").finish_non_exhaustive()
    }
}

impl Line {
    pub(crate) fn open(
        path: &Path,
        kinds: &'static Kinds,
        machine: &Machine,
        page: &LivePage,
    ) -> Result<Self, String> {
        let asked = CommandLineEnd {
            role: Role::Device,
            moved: false,
        };
        let config = Config::load_as(path, Some(asked), kinds);
        let mut config = config.map_err(|mistakes| mistakes.to_string())?;
        // That belongs to the simulation.
        config.record = None;
        config.page.get_or_insert_default();
        let Opened { program, options } = machine(&config)?;
        let host = Host::open(&config, program, TICK, Monotonic::shared() as Arc<_>);
        let host = host.map_err(|error| error.to_string())?;
        let member = host.watch().map(|watch| page.join(watch, options));
        Ok(Self {
            host: Some(host),
            member,
        })
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.member = None;
        if let Some(host) = self.host.take() {
            // What went wrong was shown while it ran.
            let _ = host.close();
        }
    }
}
