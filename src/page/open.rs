//! The pages that are served: opened for the first driver, or the first nets, that ask for one, and closed with the last.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use tickbus_base::time::Monotonic;
#[cfg(feature = "doors")]
use tickbus_base::time::Nanos;
use tickbus_driver::{Line, Watch};
use tickbus_driver_cfg::Config;
use tickbus_live_page::picture::{self, Picture};
use tickbus_live_page::{LivePage, Member, Options, Recorded};
use tickbus_net::Address;
#[cfg(feature = "doors")]
use tickbus_net_page::{NetPage, Nets, Wanted};
use tickbus_studio::{Running, Seat};
use tickbus_virtual_time::Controls;
use tickbus_web::{Invitation, Joined, Limits, Page, Pages, Room, Serving};

use super::{FLAG, PageError, Read, Shown};

/// The page of this process, if there is one.
static PAGE: Mutex<Weak<Open>> = Mutex::new(Weak::new());

/// The largest picture that can be read, in bytes.
const LARGEST: u64 = 16 << 20;

/// The served page.
#[derive(Debug)]
struct Open {
    // Dropped in this order, so that nobody asks a page that has ended.
    _serving: Serving,
    pages: Pages,
    /// The live page, while it has members.
    live: Mutex<Weak<Tab<LivePage>>>,
    /// The page of nets, while there are any.
    #[cfg(feature = "doors")]
    nets: Mutex<Weak<Tab<NetPage>>>,
    /// True if only this computer reaches the page.
    is_here: bool,
    url: String,
    invitation: Invitation,
    /// The address that the first driver asked for.
    asked: Address,
    /// The file that keeps the token across restarts.
    token_file: Option<PathBuf>,
}

/// One of the served pages.
#[derive(Debug)]
struct Tab<T> {
    // Dropped in this order, so that nobody asks a page that has ended.
    joined: Joined,
    page: T,
}

/// Returns the present page, or a new one that joins the others, and whether it is new.
fn tab<T>(
    present: &Mutex<Weak<Tab<T>>>,
    join: impl FnOnce() -> std::io::Result<(Joined, T)>,
) -> Result<(Arc<Tab<T>>, bool), PageError> {
    // The value is only ever replaced as a whole.
    let mut present = present.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(tab) = present.upgrade() {
        return Ok((tab, false));
    }
    let joined = join();
    let (joined, page) =
        joined.map_err(|error| PageError::NotServed(format!("the page cannot begin: {error}")))?;
    let tab = Arc::new(Tab { joined, page });
    *present = Arc::downgrade(&tab);
    Ok((tab, true))
}

/// The place of a driver or a run on the page.
#[derive(Debug)]
pub struct Place {
    seat: Option<Seat>,
    member: Option<Member>,
    live: Option<Arc<Tab<LivePage>>>,
    open: Option<Arc<Open>>,
}

impl Drop for Place {
    fn drop(&mut self) {
        // Locked so that nobody asks for the address while it is being released.
        let present = present();
        self.seat = None;
        self.member = None;
        self.live = None;
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

/// Forgets the parent's page, which nothing serves here; called in a forked child process.
pub fn forked() {
    // If another thread of the parent had the lock, nothing in the child releases it.
    if let Ok(mut present) = PAGE.try_lock() {
        *present = Weak::new();
    }
}

/// Shows the views of `watch` on the page, if the driver.cfg asks for one. `announce` receives the address of a new
/// page, and what a terminal shows below it.
pub(crate) fn show(
    shown: Shown<'_, impl FnOnce() -> Option<Watch>>,
    announce: impl FnOnce(&str, &str),
) -> Result<Option<Place>, PageError> {
    let config = shown.config;
    let Some(wanted) = &config.page else {
        return Ok(None);
    };
    let mut options = options(config)?;
    if !shown.keeps_lists {
        options.lists = None;
    }
    let any = "listen = \"127.0.0.1:0\" in [page], or --page 127.0.0.1:0,";
    let token = wanted.token_file.as_ref();
    let token = token.map(|file| config.folder().join(file));
    let fits = |open: &Open| {
        if !wanted.listens_here() || open.is_here {
            return Ok(());
        }
        Err(PageError::WrongInput(format!(
            "{}: [page] listens on {} alone, and this process serves its pages on {} already; open this driver first, or \
             give the other pages 127.0.0.1",
            config.path.display(),
            wanted.listen,
            open.asked
        )))
    };
    let open = open(&config.name, (&wanted.listen, any), token.as_deref(), fits)?;
    let (live, is_new) = open.live()?;
    let Some(watch) = (shown.watch)() else {
        return Ok(None);
    };
    let present = Arc::clone(watch.config());
    let member = live.page.join(watch, options);
    let seat = match shown.read.filter(|_| wanted.edit) {
        Some(read) => Some(open.edit(&member, present, (shown.line, read))?),
        None => None,
    };
    // Whoever opens the page finds the driver there.
    if is_new {
        announce(&open.url, &open.invitation.for_terminal(shown.setting));
    }
    Ok(Some(Place {
        seat,
        member: Some(member),
        live: Some(live),
        open: Some(open),
    }))
}

impl Open {
    /// Returns the live page, and whether it is new.
    fn live(&self) -> Result<(Arc<Tab<LivePage>>, bool), PageError> {
        tab(&self.live, || {
            let page = LivePage::open(Monotonic::shared())?;
            let joined = self.pages.join(Page::new("Live page", "/", page.site()));
            Ok((joined, page))
        })
    }

    /// The address without the token.
    fn plain_url(&self) -> &str {
        self.url
            .split_once('#')
            .map_or(&self.url, |(plain, _)| plain)
    }

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
        lists: Some(lists_beside(&config.path)),
    })
}

/// The file of the lists of signals: `tank.lists.toml` beside `tank.cfg`.
pub(crate) fn lists_beside(config: &Path) -> PathBuf {
    config.with_extension("lists.toml")
}

/// Shows a run on virtual time on the page, which is served at `listen` unless there is one already.
pub(crate) fn show_run(
    name: &str,
    listen: &Address,
    controls: Controls,
    announce: impl FnOnce(&str, &str),
) -> Result<Place, PageError> {
    let open = open(name, (listen, "--page 127.0.0.1:0"), None, |_| Ok(()))?;
    let (live, is_new) = open.live()?;
    let member = live.page.join_run(name, controls);
    if is_new {
        announce(&open.url, &open.invitation.for_terminal(FLAG));
    }
    Ok(Place {
        seat: None,
        member: Some(member),
        live: Some(live),
        open: Some(open),
    })
}

/// The place of a program's nets on their page.
#[cfg(feature = "doors")]
#[derive(Debug)]
pub(crate) struct NetsPlace {
    nets: Nets,
    url: String,
    /// `None` after the nets have left.
    held: Mutex<Option<HeldNets>>,
}

/// The page that a program's nets are on, and the room that serves it.
#[cfg(feature = "doors")]
type HeldNets = (Arc<Tab<NetPage>>, Arc<Open>);

/// Shows nets on a page, which is served at `listen` unless this process has pages already.
#[cfg(feature = "doors")]
pub(crate) fn show_nets(title: &str, listen: &Address) -> Result<NetsPlace, PageError> {
    let open = open(title, (listen, "127.0.0.1:0"), None, |_| Ok(()))?;
    let (tab, _) = tab(&open.nets, || {
        let page = NetPage::new(Monotonic::shared());
        let joined = open.pages.join(Page::new("Nets", "/nets", page.site()));
        Ok((joined, page))
    })?;
    let address = open.plain_url().trim_end_matches('/');
    Ok(NetsPlace {
        nets: tab.page.join(title),
        url: format!("{address}{}", tab.joined.path()),
        held: Mutex::new(Some((tab, open))),
    })
}

#[cfg(feature = "doors")]
impl NetsPlace {
    /// The address of the page. It has no token, because nothing can be changed there.
    pub(crate) fn url(&self) -> String {
        self.url.clone()
    }

    /// Hands over the drawings.
    pub(crate) fn draw(&self, json: &str) -> Result<(), String> {
        self.nets.draw(json)
    }

    /// Waits until a state is wanted, at most this long.
    pub(crate) fn wanted(&self, patience: Nanos) -> bool {
        self.nets.wanted(patience) == Wanted::Yes
    }

    /// Hands over a state.
    pub(crate) fn put(&self, json: &str) -> Result<(), String> {
        self.nets.put(json)
    }

    /// Takes the nets from the page, also while another thread waits.
    pub(crate) fn leave(&self) {
        self.nets.leave();
        // Locked so that nobody asks for the address while it is being released.
        let present = present();
        let held = self
            .held
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        drop(held);
        drop(present);
    }
}

/// Shows a recording on a page at `listen` until the returned place is dropped; `announce` receives the address.
pub(crate) fn show_recording(
    recorded: Recorded,
    listen: &Address,
    announce: impl FnOnce(&str, &str),
) -> Result<Place, PageError> {
    let open = open(
        "recording",
        (listen, "--page 127.0.0.1:0"),
        None,
        |_| Ok(()),
    )?;
    let (live, _) = open.live()?;
    let member = live.page.join_recording(recorded);
    // Nothing can be forced, so nobody needs the token.
    let invitation = open.invitation.clone().without_token();
    announce(open.plain_url(), &invitation.for_terminal(FLAG));
    Ok(Place {
        seat: None,
        member: Some(member),
        live: Some(live),
        open: Some(open),
    })
}

/// Returns the present room, or a new one at `asked`; `any` is the setting for a port that the system chooses, for the
/// error message.
fn open(
    name: &str,
    (asked, any): (&Address, &str),
    token_file: Option<&Path>,
    fits: impl FnOnce(&Open) -> Result<(), PageError>,
) -> Result<Arc<Open>, PageError> {
    let mut present = present();
    if let Some(open) = present.upgrade() {
        fits(&open)?;
        if open.asked != *asked {
            log::warn!(
                "\"{name}\" asks for a page at {asked}, and is shown on that of this process, at {}",
                open.asked
            );
        }
        if let Some(file) = token_file.filter(|file| open.token_file.as_deref() != Some(*file)) {
            log::warn!(
                "the token in {} of \"{name}\" is not used: the pages of this process have a token already",
                file.display()
            );
        }
        return Ok(open);
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
    let (url, invitation) = (room.url(), room.invitation());
    let pages = Pages::default();
    let is_here = room.address().ip().is_loopback();
    let serving = room.serve(pages.clone(), Monotonic::shared());
    let open = Arc::new(Open {
        _serving: serving.map_err(refused)?,
        pages,
        live: Mutex::default(),
        #[cfg(feature = "doors")]
        nets: Mutex::default(),
        is_here,
        url,
        invitation,
        asked: asked.clone(),
        token_file: token_file.map(Path::to_owned),
    });
    *present = Arc::downgrade(&open);
    // Readers of the log must not be able to force signals: only whoever started this process gets the token.
    log::info!("the live page is at {}", open.plain_url());
    Ok(open)
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
