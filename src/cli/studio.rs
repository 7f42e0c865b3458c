//! `tickbus studio FILE`: a driver.cfg in a browser.

use std::path::PathBuf;

use super::Outcome;
use super::host::{self, PageAddress};
use tickbus_driver_cfg::Kinds;

/// Edit a driver.cfg in a browser, and run its line.
///
/// A table has the signals, with the checker's words at the cell; every edit is written into FILE at once, keeps its
/// comments, and can be undone. Start runs the machine's end of the line, with the replies of FILE, until there is a
/// simulator. FILE is made by the first edit if it is not there.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg.
    #[arg(default_value = "driver.cfg")]
    file: PathBuf,

    /// Serve the page here.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:20080", value_parser = host::page_address)]
    page: PageAddress,

    /// Start the line at once.
    #[arg(long)]
    start: bool,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    served::run(arguments, kinds)
}

#[cfg(not(feature = "page"))]
mod served {
    use super::{Arguments, Kinds, Outcome};

    pub(super) fn run(_: &Arguments, _: &'static Kinds) -> Outcome {
        eprintln!(
            "studio: this build has no pages; use the command of a release, or build with --features page"
        );
        Outcome::WrongInput
    }
}

#[cfg(feature = "page")]
mod served {
    use std::io::Write as _;

    use tickbus_base::time::{Clock as _, Monotonic, Nanos};
    use tickbus_programs::{Idle, Mirror};
    use tickbus_studio::{Opened, Settings, Studio, Unsaved};
    use tickbus_web::{Limits, Room};

    use super::{Arguments, Kinds, Outcome};
    use crate::cli::lab::{say, until_ctrl_c};
    use crate::page;

    pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
        let settings = Settings {
            path: arguments.file.clone(),
            kinds,
            machine: Box::new(|config| {
                let options = page::options(config).map_err(|error| error.to_string())?;
                let program: Box<dyn tickbus_plc::Program> = if config.replies.is_empty() {
                    Box::new(Mirror)
                } else {
                    Box::new(Idle)
                };
                Ok(Opened { program, options })
            }),
        };
        let studio = match Studio::open(settings) {
            Ok(studio) => studio,
            Err(why) => return fail(&why, Outcome::WrongInput),
        };
        let asked = arguments.page.listen();
        let serving = Room::bind(&asked, Limits::default()).and_then(|room| {
            let url = room.url().replacen("/#", "/studio#", 1);
            let serving = room.serve(studio.pages(), Monotonic::shared())?;
            Ok((url, serving))
        });
        let (url, serving) = match serving {
            Ok(serving) => serving,
            Err(error) => {
                let why = format!(
                    "the page cannot be served on {asked} ({error}); end the program that has this port, or choose another \
                     one: --page 127.0.0.1:0 takes any"
                );
                return fail(&why, Outcome::BusFailed);
            }
        };
        let stop = match until_ctrl_c("studio") {
            Ok(stop) => stop,
            Err(outcome) => return outcome,
        };
        say("studio", &format!("{} at {url}", studio.path().display()));
        if arguments.start
            && let Err(why) = studio.start()
        {
            say("studio", &format!("the line does not run: {why}"));
        }
        Monotonic::shared().wait_until(Nanos::MAX, &stop);
        drop(serving);
        match studio.close() {
            None => {
                say("studio", "ok");
                Outcome::Done
            }
            Some(unsaved) => tell(&unsaved),
        }
    }

    fn tell(unsaved: &Unsaved) -> Outcome {
        let why = format!("the file could not be written: {}", unsaved.why);
        match &unsaved.kept {
            Ok(path) => fail(
                &format!("{why}; the edits are in {}", path.display()),
                Outcome::WrongInput,
            ),
            Err(error) => {
                let _ = std::io::stdout().lock().write_all(unsaved.text.as_bytes());
                fail(
                    &format!(
                        "{why}; its text is above, because no other file can be written either: {error}"
                    ),
                    Outcome::WrongInput,
                )
            }
        }
    }

    fn fail(why: &str, outcome: Outcome) -> Outcome {
        eprintln!("studio: failed: {why}");
        outcome
    }
}
