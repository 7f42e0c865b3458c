//! `tickbus show RECORDING`: a recording in a browser.

use std::path::PathBuf;

use super::Outcome;
use super::host::{self, PageAddress};
use tickbus_driver_cfg::Kinds;

/// Show a recording in a browser: signals, trends, the picture of the machine, and a bar that goes to any moment.
///
/// The page is that of a running driver, after the fact: no bus is opened, and nothing can be forced. It is served until
/// Ctrl-C.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The recording: of tickbus, VCD or CSV, or VCD of another program.
    recording: PathBuf,

    /// The picture of the machine, SVG [default: that of --config].
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,

    /// The driver.cfg of the recording, with what the file lacks: types, addresses, units and the picture.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,

    /// A signal that is on during a fault, to jump to; may be given several times.
    #[arg(long = "fault", value_name = "SIGNAL")]
    faults: Vec<String>,

    /// The most memory for the recording, in MB.
    #[arg(long, value_name = "MB", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..))]
    memory: u32,

    /// Serve the page here; port 0 takes a free one.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:0", value_parser = host::page_address)]
    page: PageAddress,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    served::run(arguments, kinds)
}

#[cfg(not(feature = "page"))]
mod served {
    use super::{Arguments, Kinds, Outcome};

    pub(super) fn run(_: &Arguments, _: &'static Kinds) -> Outcome {
        eprintln!(
            "show: this build has no pages; use the command of a release, or build with --features page"
        );
        Outcome::WrongInput
    }
}

#[cfg(feature = "page")]
mod served {
    use tickbus_base::time::{Clock as _, Monotonic, Nanos};
    use tickbus_driver_cfg::Config;
    use tickbus_live_page::Recorded;
    use tickbus_record::{Recording, RecordingError};

    use super::{Arguments, Kinds, Outcome};
    use crate::cli::lab::{say, say_page, until_ctrl_c};
    use crate::cli::progress::Progress;
    use crate::page;

    pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
        let fail = |why: &str, outcome| {
            eprintln!("{why}\nshow: failed");
            outcome
        };
        let recorded = match read(arguments, kinds) {
            Ok(recorded) => recorded,
            Err(why) => return fail(&why, Outcome::WrongInput),
        };
        let stop = match until_ctrl_c("show") {
            Ok(stop) => stop,
            Err(outcome) => return outcome,
        };
        let (from, to, bytes) = recorded.span();
        let told = format!(
            "{}: {} signals, {} ticks from {from} to {to}, in {} MB of memory",
            arguments.recording.display(),
            recorded.names().len(),
            recorded.ticks(),
            bytes.div_ceil(1 << 20),
        );
        let announce = |url: &str, invitation: &str| {
            say("show", &told);
            say_page("show", url, invitation);
        };
        let place = match page::show_recording(recorded, &arguments.page.listen(), announce) {
            Ok(place) => place,
            Err(error) => return fail(&error.to_string(), Outcome::BusFailed),
        };
        Monotonic::shared().wait_until(Nanos::MAX, &stop);
        drop(place);
        say("show", "ok");
        Outcome::Done
    }

    /// Reads all that the page shows, or says what is wrong.
    fn read(arguments: &Arguments, kinds: &'static Kinds) -> Result<Recorded, String> {
        let config = arguments.config.as_deref();
        let config = config.map(|path| Config::load(path, kinds));
        let config = config.transpose().map_err(|wrong| wrong.to_string())?;
        let table = config.as_ref().map(|config| &config.table);
        let path = &arguments.recording;
        let mut recording = Recording::open_any(path, table).map_err(|error| error.to_string())?;
        let name = path.display().to_string();
        let progress = Progress::begin("show", format!("reading {name}"));
        let limit = usize::try_from(arguments.memory).unwrap_or(usize::MAX);
        let limit = limit.saturating_mul(1 << 20);
        let recorded = Recorded::read(&mut recording, &name, table, &arguments.faults, limit);
        let mut recorded = recorded.map_err(|mistake| {
            RecordingError::of_file(path, mistake.what, mistake.right).to_string()
        })?;
        drop(progress);
        if let Some(why) = recorded.broken() {
            eprintln!("show: {why}");
        }
        if let Some(config) = &config {
            recorded.set_lists(page::lists_beside(&config.path));
        }
        let names = recorded.names();
        if let (Some(config), Some(table)) = (&config, table)
            && !names.iter().any(|name| table.position(name).is_some())
        {
            return Err(format!(
                "{}: none of its signals is in the recording {name}; name the driver.cfg of that run",
                config.path.display()
            ));
        }
        let of_config = config.as_ref().and_then(|config| {
            let picture = config.page.as_ref()?.picture.as_ref()?;
            Some((config.folder().join(picture), "relative to the driver.cfg"))
        });
        let own = arguments.picture.clone();
        let own = own.map(|path| (path, "relative to this folder"));
        let Some((path, place)) = own.or(of_config) else {
            return Ok(recorded);
        };
        let picture = page::picture_at(&path, place, &names)?;
        if !picture.svg.contains(" data-tb=\"") {
            let first = picture.mistakes.first();
            let first = first.map_or("no element has an attribute data-tb-…", |it| it);
            return Err(format!(
                "the picture \"{}\" fits no signal of {name} ({first}); take the picture of that machine, or bind its \
                 parts to these signals",
                path.display()
            ));
        }
        for mistake in &picture.mistakes {
            eprintln!("show: {}: {mistake}", path.display());
        }
        recorded.set_picture(picture);
        Ok(recorded)
    }
}
