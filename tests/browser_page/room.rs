//! Several pages in one room: their tabs, and one stream for all of a browser.

use std::io::Write as _;
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};

use serde_json::json;
use tickbus::dispatcher::tcp::{Hosting, Listener};
use tickbus::dispatcher::{Dispatcher, Door, Patch, Settings};
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::{Monotonic, Stop};
use tickbus_live_page::{LivePage, Member, Options};
use tickbus_net::Address;
use tickbus_patch_bay::PatchBay;
use tickbus_studio::{Running, Seat};
use tickbus_web::{
    Answer, Asset, Change, Joined, Limits, Outcome, Page, Pages, Room, Serving, Site, State,
};

use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click};

/// A dispatcher on a free port.
struct Board {
    address: SocketAddr,
    door: Door,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl Board {
    fn start() -> Self {
        let listener = Listener::bind(&Address::local(0)).expect("a free port");
        let address = listener.address();
        let stop = Stop::new();
        let door = Door::new(&stop);
        let (its_stop, its_door) = (stop.clone(), door.clone());
        let thread = thread::spawn(move || {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                stop: &its_stop,
                door: Some(&its_door),
                patch_file: None,
                news: &mut |_| {},
            };
            let mut dispatcher = Dispatcher::new(Settings::default(), Patch::new());
            listener.run(&mut dispatcher, hosting).expect("it serves");
        });
        Self {
            address,
            door,
            stop,
            thread: Some(thread),
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Sees how many streams with the token there are.
#[derive(Default)]
struct Counter {
    now: AtomicUsize,
    most: AtomicUsize,
}

impl Site for Counter {
    fn assets(&self) -> &[Asset] {
        &[]
    }

    fn look(&self, _: Answer<State>) {}

    fn heard(&self, viewers: usize) {
        self.now.store(viewers, Ordering::SeqCst);
        self.most.fetch_max(viewers, Ordering::SeqCst);
    }

    fn change(&self, _: Change, _: Answer<Outcome>) {}
}

/// A room with a driver's live page and studio, and a board.
struct Fixture {
    _serving: Serving,
    _joined: Joined,
    seat: Seat,
    _member: Member,
    _live: LivePage,
    board: Board,
    pages: Pages,
    url: String,
    _folder: tempfile::TempDir,
    _driver: Driver,
}

impl Fixture {
    fn start() -> Self {
        let folder = tempfile::tempdir().expect("there is room");
        let path = folder.path().join("driver.cfg");
        let text = "[driver]\nid = 7\nname = \"Rig\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                    [[signal]]\nname = \"Lamp\"\naddress = \"%IX0.0\"\n";
        std::fs::write(&path, text).expect("there is room");
        let read = move || Config::load(&path, &tickbus::KINDS).map_err(|why| why.to_string());
        let driver = Driver::open(read().expect("no mistakes"), Monotonic::shared());
        let mut driver = driver.expect("it opens");
        let live = LivePage::open(Monotonic::shared()).expect("a thread");
        let options = Options {
            grace: None,
            picture: None,
            lists: None,
        };
        let member = live.join(driver.watch(), options);
        let pages = Pages::of("Live page", live.site());
        let running = Running {
            id: 7,
            config: Arc::clone(driver.config()),
            kinds: &tickbus::KINDS,
            line: driver.line(),
            read: Box::new(read),
        };
        let seat = Seat::join(&pages, running).expect("it can be read");
        let board = Board::start();
        let site = Arc::new(PatchBay::new(board.door.clone()));
        let joined = pages.join(Page::new("Board", "/board", site));
        let room = Room::bind(&Address::local(0), Limits::default()).expect("a port");
        let url = room.url();
        let serving = room.serve(pages.clone(), Monotonic::shared());
        Self {
            _serving: serving.expect("a thread"),
            _joined: joined,
            seat,
            _member: member,
            _live: live,
            board,
            pages,
            url,
            _folder: folder,
            _driver: driver,
        }
    }

    /// The address of a page, with the token.
    fn url_of(&self, page: &str) -> String {
        self.url.replacen("/#", &format!("{page}#"), 1)
    }

    /// A client with one output, at 24.
    fn plug(&self, name: &str) -> TcpStream {
        let mut stream = TcpStream::connect(self.board.address).expect("it listens");
        write!(stream, "VP {name} Q01 I01\r\nP Q1=24\r\n").expect("it reads");
        stream
    }
}

#[test]
fn the_studio_of_a_driver_that_was_closed_says_so() {
    let fixture = Fixture::start();
    let browser = Browser::start(1280, 800);
    browser.go(&fixture.url_of("/studio"));
    wait_page(&browser, "/studio");
    drop(fixture.seat);
    browser.wait("document.getElementById('told').textContent === 'This driver has been closed. Open it again, or choose another page.'");
    browser.wait("document.getElementById('link').textContent === 'closed' && document.querySelector('main').inert");
    let shown =
        "return ['access', 'saved'].filter((id) => document.getElementById(id).checkVisibility())";
    assert_eq!(browser.run(shown), json!([]));
}

const LIVE: &str = "document.getElementById('link').textContent === 'live' && ";

/// Waits for the page with the token, and for what it shows.
fn wait_page(browser: &Browser, page: &str) {
    let shown = match page {
        "/" => {
            "document.getElementById('access').textContent === 'may force' && plant.signals.length === 1"
        }
        "/studio" => {
            "document.getElementById('access').textContent === 'may edit' && tickbusStudio.file?.line.runs === true"
        }
        _ => {
            "document.getElementById('access').textContent === 'may change' && document.querySelector('.client') !== null"
        }
    };
    browser.wait(&format!("{LIVE}{shown}"));
}

/// Checks that the page fits wide and narrow, and makes its pictures.
fn look(browser: &Browser, page: &str) {
    let folder = crate::screenshots();
    // Without leaving the page.
    let resize = |width: u32, height: u32| {
        let metrics = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 640});
        browser.devtools("Emulation.setDeviceMetricsOverride", &metrics);
    };
    for (width, height) in [(1440, 900), (390, 844)] {
        resize(width, height);
        for scheme in ["light", "dark"] {
            let media = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
            browser.devtools("Emulation.setEmulatedMedia", &media);
            assert_fits(browser);
            // The marked tab is in sight, and the row of tabs covers nothing that stays at the lower edge.
            browser.wait(
                "(() => { const [tabs, tab, tray] = ['#tabs', '#tabs [aria-current]', '#tray'].map((it) => document.querySelector(it)?.getBoundingClientRect()); \
                 return tab.left >= -1 && tab.right <= innerWidth + 1 && (!tray || innerWidth > 700 || tray.bottom <= tabs.top + 1); })()",
            );
            let name = format!("room_{}_{width}_{scheme}.png", page.replace('/', ""));
            shoot(browser, folder.as_deref(), &name, false);
        }
    }
    resize(1280, 800);
}

#[test]
fn seven_tabs_on_three_pages_share_one_stream() {
    let fixture = Fixture::start();
    let counter = Arc::new(Counter::default());
    let joined = fixture
        .pages
        .join(Page::new("Count", "/count", Arc::clone(&counter) as _));
    let _pump = fixture.plug("PUMP");
    let browser = Browser::start(1280, 800);
    for (at, page) in ["/board", "/", "/studio", "/", "/board", "/", "/studio"]
        .iter()
        .enumerate()
    {
        if at > 0 {
            browser.new_tab();
        }
        browser.go(&fixture.url_of(page));
        wait_page(&browser, page);
    }
    // A browser has six connections to one host: the seventh tab gets no answer, and the first one no events, if each has one.
    let tabs = "[...document.querySelectorAll('#tabs a')].map((tab) => tab.textContent)";
    let names = json!(["Overview", "Signals", "Line", "Studio", "Board", "Count"]);
    assert_eq!(browser.run(&format!("return {tabs}")), names);
    browser.first_tab();
    let _fan = fixture.plug("FAN");
    browser.wait("document.querySelectorAll('.client').length === 2");
    // A new stream can begin before the room has seen the end of the last one.
    assert!(counter.most.load(Ordering::SeqCst) <= 2);
    while counter.now.load(Ordering::SeqCst) != 1 {
        thread::yield_now();
    }

    // A page that leaves takes its tab along, without a reload.
    drop(joined);
    let fewer = json!(["Overview", "Signals", "Line", "Studio", "Board"]);
    browser.wait(&format!("JSON.stringify({tabs}) === '{fewer}'"));
    assert_quiet(&browser);
}

#[test]
fn the_tabs_lead_from_page_to_page_with_the_same_head() {
    let fixture = Fixture::start();
    let _pump = fixture.plug("PUMP");
    let browser = Browser::start(1280, 800);
    browser.go(&fixture.url);
    for (to, title) in [
        ("/studio", "driver.cfg"),
        ("/#signals", "Rig"),
        ("/#line", "Rig"),
        ("/board", "Patch bay"),
        ("/", "Rig"),
        ("/board", "Patch bay"),
    ] {
        let tab = format!("#tabs [href=\"{to}\"]");
        browser.wait(&format!("document.querySelector('{tab}')"));
        // Until it is live, the head may still move.
        browser.wait("document.getElementById('link').textContent === 'live'");
        click(&browser, &tab);
        browser.wait(&format!("location.pathname + location.hash === '{to}'"));
        let page = to.split('#').next().expect("a path");
        wait_page(&browser, page);
        let current =
            "[...document.querySelectorAll('#tabs a')].filter((tab) => tab.ariaCurrent === 'page')";
        browser.wait(&format!(
            "{current}.map((tab) => tab.pathname + tab.hash).join() === '{to}'"
        ));
        browser.wait(&format!(
            "document.getElementById('title').textContent === '{title}'"
        ));
        let order = "return [...document.getElementById('top').children].slice(0, 3).map((it) => it.tagName)";
        assert_eq!(browser.run(order), json!(["H1", "NAV", "P"]));
        look(&browser, page);
    }
    // What is changed on the board within the room goes to the board.
    browser.run("document.querySelector('[data-pin=\"PUMP:Q1\"]').click()");
    browser.run("document.getElementById('force-value').value = '7'; document.getElementById('chosen').requestSubmit()");
    browser.wait("document.getElementById('forced-text').textContent === '1 channel is forced: PUMP:Q1 to 7'");
    assert_quiet(&browser);
}
