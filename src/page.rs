//! The live page of this process, which all of its drivers share.
//!
//! A build without the feature `page` has no page, and rejects a driver.cfg that asks for one.

#[cfg(not(feature = "page"))]
mod none;
#[cfg(feature = "page")]
mod open;

#[cfg(not(feature = "page"))]
pub(crate) use none::{show, show_run};
#[cfg(feature = "page")]
pub(crate) use open::{lists_beside, options, picture_at, show, show_recording, show_run};

#[cfg(all(feature = "doors", not(feature = "page")))]
pub(crate) use none::{NetsPlace, show_nets};
#[cfg(all(feature = "doors", feature = "page"))]
pub(crate) use open::{NetsPlace, show_nets};

#[cfg(not(feature = "page"))]
pub use none::{Place, forked, url};
#[cfg(feature = "page")]
pub use open::{Place, forked, url};

use tickbus_binding::Refusal;
use tickbus_driver::{Code, Driver, Line, Watch};
use tickbus_driver_cfg::Config;

/// The end of a line that a page shows, and that it edits if the driver.cfg says so.
pub(crate) struct Shown<'a, W: FnOnce() -> Option<Watch>> {
    pub(crate) config: &'a Config,
    pub(crate) watch: W,
    /// The line, which takes the changes of the file; `None` if its bus runs in step with the simulation.
    pub(crate) line: Option<Line>,
    /// Reads the file as it was read before; `None` if it cannot be edited here.
    pub(crate) read: Option<Read>,
    /// The setting that opens the page for other computers, with `PORT` for its port.
    pub(crate) setting: &'static str,
    /// False if lists of signals cannot be kept beside the driver.cfg.
    pub(crate) keeps_lists: bool,
}

/// This setting on the command line.
pub(crate) const FLAG: &str = "--page 0.0.0.0:PORT";

/// Reads a driver.cfg, or says what is wrong.
pub(crate) type Read = Box<dyn Fn() -> Result<Config, String> + Send + Sync>;

/// Says why a driver cannot be shown.
#[derive(Debug)]
pub(crate) enum PageError {
    /// This build has no pages.
    #[cfg_attr(feature = "page", expect(dead_code, reason = "it has them"))]
    Unsupported(String),
    /// The driver.cfg, or the picture that it names, is wrong.
    #[cfg_attr(not(feature = "page"), expect(dead_code, reason = "nothing is read"))]
    WrongInput(String),
    /// The page cannot be served.
    #[cfg_attr(not(feature = "page"), expect(dead_code, reason = "nothing is served"))]
    NotServed(String),
}

impl PageError {
    /// Returns true if the driver.cfg must be changed, rather than the system.
    pub(crate) const fn is_wrong_input(&self) -> bool {
        !matches!(self, Self::NotServed(_))
    }
}

impl std::fmt::Display for PageError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unsupported(text) | Self::WrongInput(text) | Self::NotServed(text) => {
                f.write_str(text)
            }
        }
    }
}

/// Shows a simulation's driver on the page, if its driver.cfg asks for one. The address is printed on stderr, for
/// whoever started the simulation.
///
/// # Errors
///
/// The picture of the page, its address or its token is wrong, or this build has no pages.
pub fn show_driver(driver: &mut Driver) -> Result<Option<Place>, Refusal> {
    use std::io::{IsTerminal as _, Write as _};

    let config = std::sync::Arc::clone(driver.config());
    let announce = |url: &str, invitation: &str| {
        let mut err = std::io::stderr().lock();
        let invitation = if err.is_terminal() { invitation } else { "" };
        // The simulation runs even without a reader of stderr.
        let _ = write!(err, "tickbus: live page at {url}\n{invitation}");
    };
    let opened = std::sync::Arc::clone(&config);
    let read = move || opened.read_again().map_err(|mistakes| mistakes.to_string());
    let shown = Shown {
        config: &config,
        line: driver.line(),
        watch: || Some(driver.watch()),
        read: Some(Box::new(read)),
        setting: "listen = \"0.0.0.0:PORT\" in [page]",
        keeps_lists: true,
    };
    Ok(show(shown, announce)?)
}

impl From<PageError> for Refusal {
    fn from(error: PageError) -> Self {
        let code = match error {
            PageError::Unsupported(_) => Code::Unsupported,
            PageError::WrongInput(_) => Code::BadConfig,
            PageError::NotServed(_) => Code::BusFailed,
        };
        Self::new(code, error)
    }
}
