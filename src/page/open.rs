//! The page that is served: opened for the first driver that asks for one, and closed with the last.

use std::fs;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use tickbus_base::time::Monotonic;
use tickbus_driver::{Line, Watch};
use tickbus_driver_cfg::Config;
use tickbus_live_page::picture::{self, Picture};
use tickbus_live_page::{LivePage, Member, Options, Recorded};
use tickbus_net::Address;
use tickbus_studio::{Running, Seat};
use tickbus_virtual_time::Controls;
use tickbus_web::{Limits, Pages, Room, Serving};

use super::{PageError, Read, Shown};

/// The page of this process, if there is one.
static PAGE: Mutex<Weak<Open>> = Mutex::new(Weak::new());

/// The largest picture that can be read, in bytes.
const LARGEST: u64 = 16 << 20;

/// The served page.
#[derive(Debug)]
struct Open {
    // Dropped in this order, so that nobody asks a page that has ended.
    _serving: Serving,
    page: LivePage,
    pages: Pages,
    /// True if only this computer reaches the page.
    is_here: bool,
    url: String,
    /// The address that the first driver asked for.
    asked: Address,
}

/// The place of a driver or a run on the page.
#[derive(Debug)]
pub struct Place {
    seat: Option<Seat>,
    member: Option<Member>,
    open: Option<Arc<Open>>,
}

impl Drop for Place {
    fn drop(&mut self) {
        // Locked so that nobody asks for the address while it is being released.
        let present = present();
        self.seat = None;
        self.member = None;
        self.open = None;
        drop(present);
    }
}

fn present() -> MutexGuard<'static, Weak<Open>> {
    // The value is only ever replaced as a whole.
    PAGE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the address of the page with its token, if there is a page.
pub fn url() -> Option<String> {
    Some(present().upgrade()?.url.clone())
}

/// Shows the views of `watch` on the page, if the driver.cfg asks for one. `announce` receives the address of a new
/// page.
pub(crate) fn show(
    shown: Shown<'_, impl FnOnce() -> Option<Watch>>,
    announce: impl FnOnce(&str),
) -> Result<Option<Place>, PageError> {
    let config = shown.config;
    let Some(wanted) = &config.page else {
        return Ok(None);
    };
    let options = options(config)?;
    let any = "listen = \"127.0.0.1:0\" in [page], or --page 127.0.0.1:0,";
    let token = wanted.token_file.as_ref();
    let token = token.map(|file| config.folder().join(file));
    let (open, is_new) = open(&config.name, (&wanted.listen, any), token.as_deref())?;
    let Some(watch) = (shown.watch)() else {
        return Ok(None);
    };
    let present = Arc::clone(watch.config());
    let member = open.page.join(watch, options);
    let seat = match shown.read.filter(|_| wanted.edit) {
        Some(read) => Some(open.edit(&member, present, (shown.line, read))?),
        None => None,
    };
    // Whoever opens the page finds the driver there.
    if is_new {
        announce(&open.url);
    }
    Ok(Some(Place {
        seat,
        member: Some(member),
        open: Some(open),
    }))
}

impl Open {
    /// Opens the studio of a driver.
    fn edit(
        &self,
        member: &Member,
        config: Arc<Config>,
        (line, read): (Option<Line>, Read),
    ) -> Result<Seat, PageError> {
        let file = config.path.display().to_string();
        if !self.is_here {
            return Err(PageError::WrongInput(format!(
                "{file}: the page of this process is served on {}, and other computers must not edit this file; listen \
                 on 127.0.0.1, or remove \"edit\"",
                self.asked
            )));
        }
        let running = Running {
            id: member.id(),
            kinds: config.kinds,
            config,
            line,
            read,
        };
        let seat = Seat::join(&self.pages, running);
        seat.map_err(|why| PageError::WrongInput(format!("{file} cannot be edited: {why}")))
    }
}

/// Returns what the page is asked for: the picture, and how long signals stay forced.
pub(crate) fn options(config: &Config) -> Result<Options, PageError> {
    let wanted = config.page.clone().unwrap_or_default();
    let picture = wanted.picture.as_deref();
    let picture = picture.map(|file| read_picture(config, file)).transpose()?;
    Ok(Options {
        grace: wanted.grace,
        picture,
    })
}

/// Shows a run on virtual time on the page, which is served at `listen` unless there is one already.
pub(crate) fn show_run(
    name: &str,
    listen: &Address,
    controls: Controls,
    announce: impl FnOnce(&str),
) -> Result<Place, PageError> {
    let (open, is_new) = open(name, (listen, "--page 127.0.0.1:0"), None)?;
    let member = open.page.join_run(name, controls);
    if is_new {
        announce(&open.url);
    }
    Ok(Place {
        seat: None,
        member: Some(member),
        open: Some(open),
    })
}

/// Shows a recording on a page at `listen` until the returned place is dropped; `announce` receives the address.
pub(crate) fn show_recording(
    recorded: Recorded,
    listen: &Address,
    announce: impl FnOnce(&str),
) -> Result<Place, PageError> {
    let (open, _) = open("recording", (listen, "--page 127.0.0.1:0"), None)?;
    let member = open.page.join_recording(recorded);
    // Nothing can be forced, so nobody needs the token.
    let (plain, _) = open.url.split_once('#').unwrap_or((&open.url, ""));
    announce(plain);
    Ok(Place {
        seat: None,
        member: Some(member),
        open: Some(open),
    })
}

/// Returns the present page, or a new one at `asked`, and whether it is new; `any` is the setting for a port that the system chooses, for the
/// error message.
fn open(
    name: &str,
    (asked, any): (&Address, &str),
    token_file: Option<&Path>,
) -> Result<(Arc<Open>, bool), PageError> {
    let mut present = present();
    if let Some(open) = present.upgrade() {
        if open.asked != *asked {
            log::warn!(
                "\"{name}\" asks for a page at {asked}, and is shown on that of this process, at {}",
                open.asked
            );
        }
        return Ok((open, false));
    }
    let refused = |error: std::io::Error| {
        PageError::NotServed(format!(
            "the page cannot be served on {asked} ({error}); end the program that has this port, or choose another one: \
             {any} takes any"
        ))
    };
    let mut room = Room::bind(asked, Limits::default()).map_err(refused)?;
    if let Some(file) = token_file {
        room.keep_token(file)
            .map_err(|error| PageError::NotServed(format!("the page has no token: {error}")))?;
    }
    let url = room.url();
    let page = LivePage::open(Monotonic::shared()).map_err(refused)?;
    let pages = Pages::of("Live page", page.site());
    let is_here = room.address().ip().is_loopback();
    let serving = room.serve(pages.clone(), Monotonic::shared());
    let open = Arc::new(Open {
        _serving: serving.map_err(refused)?,
        page,
        pages,
        is_here,
        url,
        asked: asked.clone(),
    });
    *present = Arc::downgrade(&open);
    // Readers of the log must not be able to force signals: only whoever started this process gets the token.
    let (plain, _) = open.url.split_once('#').unwrap_or((&open.url, ""));
    log::info!("the live page is at {plain}");
    Ok((open, true))
}

/// Reads the picture of a driver. Mistakes in it are logged, and the rest of the picture works.
fn read_picture(config: &Config, file: &Path) -> Result<Picture, PageError> {
    let path = config.folder().join(file);
    let signals = config.table.signals.iter();
    let signals: Vec<&str> = signals.map(|signal| signal.name.as_str()).collect();
    let picture = picture_at(&path, "relative to the driver.cfg", &signals)
        .map_err(|what| PageError::WrongInput(format!("{}: {what}", config.path.display())))?;
    for mistake in &picture.mistakes {
        log::warn!("{}: {mistake}", path.display());
    }
    for left_out in &picture.left_out {
        log::info!("{}: left out: {left_out}", path.display());
    }
    Ok(picture)
}

/// Reads a picture that moves with these signals, or says what is wrong with it as a whole; `place` says from where its
/// path counts.
pub(crate) fn picture_at(path: &Path, place: &str, signals: &[&str]) -> Result<Picture, String> {
    let wrong = |what: String| format!("the picture \"{}\" {what}", path.display());
    let size = fs::metadata(path).map_err(|error| {
        wrong(format!(
            "cannot be read ({error}); name an SVG file, {place}"
        ))
    })?;
    if size.len() > LARGEST {
        return Err(wrong(format!(
            "has {} bytes; simplify it, or take pictures out of it",
            size.len()
        )));
    }
    let text = fs::read_to_string(path)
        .map_err(|error| wrong(format!("cannot be read ({error}); save it as plain SVG")))?;
    picture::read(&text, signals).map_err(|mistake| wrong(mistake.to_string()))
}
