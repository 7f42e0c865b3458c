//! Gives the line of an open driver the settings that its driver.cfg has now.

use std::sync::Arc;

use tickbus_driver::{Code, Driver, Line, Untaken};
use tickbus_driver_cfg::Config;

use crate::Refusal;

/// The parts of an open driver that a reload needs: taken while the driver is claimed, and used afterwards.
#[derive(Debug)]
pub struct Reload {
    config: Arc<Config>,
    line: Option<Line>,
}

impl Reload {
    /// Of this driver.
    pub fn of(driver: &Driver) -> Self {
        Self {
            config: Arc::clone(driver.config()),
            line: driver.line(),
        }
    }

    /// Reads the file, and lets the line take its settings while the simulation ticks. Returns false if the line has
    /// them already.
    ///
    /// # Errors
    ///
    /// `BAD_CONFIG` with the mistakes of the file; `UNSUPPORTED` with what needs the driver to be opened again;
    /// `CLOSED`; `BUS_FAILED` if the system has no thread. The line is then as before.
    pub fn run(self) -> Result<bool, Refusal> {
        let next = self.config.read_again();
        let next = next.map_err(|mistakes| Refusal::new(Code::BadConfig, mistakes))?;
        let Some(line) = self.line else {
            let what =
                "the bus runs in step with the simulation; close the driver, and open it again";
            return Err(Refusal::new(Code::Unsupported, what));
        };
        line.take(next).map_err(|untaken| match untaken {
            Untaken::NeedsRestart(_) => Refusal::new(Code::Unsupported, untaken),
            Untaken::Wrong(error) => error.into(),
            Untaken::Closed => Refusal::plain(Code::Closed),
            Untaken::Lost(_) => Refusal::new(Code::BusFailed, untaken),
        })
    }
}
