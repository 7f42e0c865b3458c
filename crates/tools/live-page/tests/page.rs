//! The page over real sockets, with drivers that tick.
#![allow(
    missing_docs,
    clippy::float_cmp,
    reason = "tests, with small whole numbers"
)]

#[path = "page/forcing.rs"]
mod forcing;
#[path = "page/lists.rs"]
mod lists;
#[path = "page/past.rs"]
mod past;

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use serde_json::Value;
use tickbus_base::time::{Monotonic, Nanos};
use tickbus_driver::Driver;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_image::signal::Slot;
use tickbus_live_page::{LivePage, Member, Options};
use tickbus_net::Address;
use tickbus_web::{Limits, Room, Serving};

static KINDS: Kinds = Kinds::LOOPBACK.with_programs(tickbus_programs::PROGRAMS);

/// A simulation in a separate thread: its driver's PLC is the mirror.
struct Simulation {
    is_over: Arc<AtomicBool>,
    ticks: Arc<AtomicU64>,
    /// The values to write, by index, from the next tick on; and the values read.
    writes: Sender<(usize, f64)>,
    reads: Receiver<Vec<f64>>,
    /// The changes of the model's faults.
    faults: Receiver<(usize, Option<f64>)>,
    thread: Option<JoinHandle<()>>,
    member: Option<Member>,
}

const SIGNALS: &str = r#"
[[signal]]
name = "in"
address = "%IB0"
[[signal]]
name = "out"
address = "%QB0"
[[signal]]
name = "bit"
address = "%IX1.0"
latch = "rising"
[[signal]]
name = "bit back"
address = "%QX1.0"
latch = "rising"
[[signal]]
name = "long"
address = "%IL8"
type = "LINT"
"#;

impl Simulation {
    fn start(page: &Page, id: i32, name: &str, grace: Option<Nanos>) -> Self {
        Self::start_in(Duration::from_millis(1), page, id, name, grace)
    }

    /// Like [`start`](Self::start), with this time between two ticks.
    fn start_in(pause: Duration, page: &Page, id: i32, name: &str, grace: Option<Nanos>) -> Self {
        Self::start_with("", pause, page, (id, name), grace)
    }

    /// Like [`start_in`](Self::start_in), with these keys of `[page]`.
    fn start_with(
        keys: &str,
        pause: Duration,
        page: &Page,
        place: (i32, &str),
        grace: Option<Nanos>,
    ) -> Self {
        Self::start_beside(None, keys, pause, page, place, grace)
    }

    /// Like [`start_with`](Self::start_with), with this file of lists.
    fn start_beside(
        lists: Option<PathBuf>,
        keys: &str,
        pause: Duration,
        page: &Page,
        (id, name): (i32, &str),
        grace: Option<Nanos>,
    ) -> Self {
        let text = format!(
            "[driver]\nid = {id}\nname = \"{name}\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
             scan = \"1ms\"\nmode = \"stepped\"\n[page]\n{keys}\n{SIGNALS}"
        );
        let config =
            Config::parse("driver.cfg", &text, &KINDS).unwrap_or_else(|why| panic!("{why}"));
        let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let options = Options {
            grace,
            picture: None,
            lists,
        };
        let member = page.live.join(driver.watch(), options);
        let is_over = Arc::<AtomicBool>::default();
        let ticks = Arc::<AtomicU64>::default();
        let (writes, written) = channel();
        let (send, reads) = channel();
        let names = ["leak", "a hose"].map(str::to_owned);
        driver
            .declare_model_faults(names.into())
            .expect("two names");
        let (tell, faults) = channel();
        let thread = thread::spawn({
            let (is_over, ticks) = (Arc::clone(&is_over), Arc::clone(&ticks));
            move || {
                let mut slots = driver.initial_slots();
                let mut time = Nanos::ZERO;
                while !is_over.load(Ordering::Relaxed) {
                    let mut is_asked = false;
                    for (index, value) in written.try_iter() {
                        slots[index] = Slot::from_real(value);
                        is_asked = true;
                    }
                    driver.exchange(time, &mut slots);
                    while let Some(change) = driver.next_model_change() {
                        // As below.
                        let _ = tell.send(change);
                    }
                    time += Nanos::from_millis(1);
                    ticks.fetch_add(1, Ordering::Relaxed);
                    if is_asked {
                        let seen = slots.iter().map(|slot| slot.real()).collect();
                        // Not every test receives these.
                        let _ = send.send(seen);
                    }
                    thread::sleep(pause);
                }
                driver.close();
            }
        });
        Self {
            is_over,
            ticks,
            writes,
            reads,
            faults,
            thread: Some(thread),
            member: Some(member),
        }
    }

    fn write(&self, index: usize, value: f64) {
        self.writes.send((index, value)).expect("it runs");
    }

    /// The slots after a further tick in which this signal had this value.
    fn slots(&self, index: usize, value: f64) -> Vec<f64> {
        while self.reads.try_recv().is_ok() {}
        self.write(index, value);
        self.reads.recv().expect("it runs")
    }

    /// Waits until this many more ticks have passed.
    fn pass(&self, ticks: u64) {
        let end = self.ticks.load(Ordering::Relaxed) + ticks;
        while self.ticks.load(Ordering::Relaxed) < end {
            thread::yield_now();
        }
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        self.member = None;
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("no panic");
        }
    }
}

struct Page {
    _serving: Serving,
    live: LivePage,
    address: SocketAddr,
    token: String,
}

impl Page {
    fn open() -> Self {
        let live = LivePage::open(Monotonic::shared()).expect("a thread");
        let room = Room::bind(&Address::local(0), Limits::default()).expect("a free port");
        let address = room.address();
        let (_, token) = room.url().split_once("#token=").map(own).expect("a token");
        let serving = room
            .serve(
                tickbus_web::Pages::of("Live page", live.site()),
                Monotonic::shared(),
            )
            .expect("a thread");
        Self {
            _serving: serving,
            live,
            address,
            token,
        }
    }

    /// Sends a request; returns the status and the body of the answer.
    fn ask(&self, line: &str, headers: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        let (address, length) = (self.address, body.len());
        write!(
            stream,
            "{line} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Length: {length}\r\n{headers}\r\n{body}"
        )
        .expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("UTF-8");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
        let status = head
            .split(' ')
            .nth(1)
            .and_then(|status| status.parse().ok());
        (status.expect("a status"), body.to_owned())
    }

    fn change(&self, line: &str, body: &str) -> (u16, String) {
        let headers = format!("Authorization: Bearer {}\r\n", self.token);
        self.ask(line, &headers, body)
    }

    fn get(&self, path: &str) -> Value {
        let (status, body) = self.ask(&format!("GET {path}"), "", "");
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).expect("JSON")
    }

    fn view(&self) -> Viewer {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        write!(
            stream,
            "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n",
            self.address
        )
        .expect("it reads");
        Viewer(BufReader::new(stream))
    }
}

fn own((one, other): (&str, &str)) -> (String, String) {
    (one.to_owned(), other.to_owned())
}

struct Viewer(BufReader<TcpStream>);

impl Viewer {
    fn event(&mut self) -> Value {
        loop {
            let mut line = String::new();
            self.0.read_line(&mut line).expect("text");
            assert!(!line.is_empty(), "the stream has ended");
            if let Some(data) = line.strip_prefix("data: ") {
                return serde_json::from_str(data).expect("JSON");
            }
        }
    }

    /// The next event with values.
    fn values(&mut self) -> Value {
        loop {
            let event = self.event();
            let values = event["values"].as_object();
            if values.is_some_and(|values| !values.is_empty()) {
                return event["values"].clone();
            }
        }
    }
}

#[track_caller]
fn eventually(what: &str, mut is_so: impl FnMut() -> bool) {
    let limit = Instant::now() + Duration::from_secs(20);
    while !is_so() {
        assert!(Instant::now() < limit, "{what}");
        thread::sleep(Duration::from_millis(5));
    }
}

const EVER: Option<Nanos> = None;

#[test]
fn a_viewer_gets_everything_once_and_then_what_has_changed() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    simulation.pass(5);
    let mut viewer = page.view();
    let first = viewer.event();
    assert_eq!(first["full"], true);
    let signals = first["signals"]["drivers"][0]["signals"].clone();
    assert_eq!(signals.as_array().map(Vec::len), Some(5));
    assert_eq!(signals[3]["name"], "bit back");
    assert_eq!(first["line"]["drivers"][0]["state"], "running");
    simulation.write(0, 7.0);
    // The byte, and its echo: at once, or one look later.
    let mut seen = Vec::new();
    while seen.len() < 2 {
        let values = viewer.values();
        for row in values["1"].as_array().expect("rows") {
            // The raw value follows from the value.
            assert_eq!(row.as_array().map(Vec::len), Some(2), "{row}");
            assert_eq!(row[1], 7, "{row}");
            seen.push(row[0].clone());
        }
    }
    assert_eq!(seen, [0, 1]);
    // A late viewer gets all of it.
    let late = page.view().event();
    assert_eq!(late["signals"]["drivers"][0]["signals"][1]["value"], 7);
}

#[test]
fn a_single_request_has_the_values_of_now_however_slow_the_ticks_are() {
    let page = Page::open();
    let pause = Duration::from_millis(150);
    let simulation = Simulation::start_in(pause, &page, 1, "Slow", EVER);
    for value in 1..=4 {
        // The page looks on its own every half a second.
        let seen = simulation.slots(0, f64::from(value));
        assert_eq!(seen[0], f64::from(value));
        let signal = page.get("/signals")["drivers"][0]["signals"][0].take();
        assert_eq!(signal["value"], value);
    }
    // The simulation stands still, as in a debugger: nobody waits for long.
    simulation.is_over.store(true, Ordering::Relaxed);
    let asked = Instant::now();
    page.get("/signals");
    assert!(asked.elapsed() < Duration::from_secs(2));
}

#[test]
fn an_edge_is_counted_and_its_pulse_is_in_the_trend() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    simulation.pass(5);
    page.get("/signals");
    simulation.slots(2, 1.0);
    simulation.slots(2, 0.0);
    simulation.pass(5);
    eventually("its edge is counted at both ends", || {
        let signals = page.get("/signals")["drivers"][0]["signals"].take();
        signals[2]["edges"] == 1 && signals[3]["edges"] == 1
    });
    for index in [2, 3] {
        let trend = page.get(&format!("/trend/1/{index}"));
        let values = trend["values"].as_array().expect("values");
        assert!(values.iter().any(|value| value == 1.0), "{trend}");
        assert_eq!(values.last(), Some(&0.0.into()), "{trend}");
        assert_eq!(trend["ms"].as_array().map(Vec::len), Some(values.len()));
    }
    assert_eq!(page.ask("GET /trend/1/5", "", "").0, 404);
    assert_eq!(page.ask("GET /trend/2/0", "", "").0, 404);
    assert_eq!(page.ask("GET /picture/1.svg", "", "").0, 404);
}

#[test]
fn what_is_forced_holds_until_it_is_released() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    assert_eq!(page.change("PUT /force/1/in", "5").0, 200);
    // The PLC gets the value and returns it; the simulation's own value is unchanged.
    eventually("it comes back", || simulation.slots(0, 9.0)[1] == 5.0);
    assert_eq!(simulation.slots(0, 9.0)[0], 9.0);
    let signal = page.get("/signals")["drivers"][0]["signals"][0].take();
    assert_eq!(
        (&signal["value"], &signal["forced"]),
        (&5.into(), &5.into())
    );
    // A value that the simulation reads.
    assert_eq!(page.change("PUT /force/1/out", "16#20").0, 200);
    eventually("it is read", || simulation.slots(0, 9.0)[1] == 32.0);
    assert_eq!(page.change("PUT /force/1/long", "9007199254740993").0, 200);
    let signal = page.get("/signals")["drivers"][0]["signals"][4].take();
    assert_eq!(signal["value"], "9007199254740993", "to the last digit");
    assert_eq!(page.change("DELETE /force/1/out", "").0, 200);
    eventually("it is read no more", || simulation.slots(0, 9.0)[1] == 5.0);
    assert_eq!(page.change("DELETE /force", "").0, 200);
    eventually("nothing is forced", || simulation.slots(0, 9.0)[1] == 9.0);
    let signals = page.get("/signals")["drivers"][0]["signals"].take();
    assert!(signals[0]["forced"].is_null() && signals[4]["forced"].is_null());
    // Any number of times: ended faults make room.
    for value in 0..200 {
        let (status, text) = page.change("PUT /force/1/in", &value.to_string());
        assert_eq!(status, 200, "{text}");
        simulation.pass(2);
    }
    eventually("the last one holds", || {
        simulation.slots(0, 9.0)[1] == 199.0
    });
}

#[test]
fn a_fault_of_the_model_is_given_to_it_and_taken_back() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    let told = || simulation.faults.recv().expect("it runs");
    eventually("the page has their names", || {
        page.get("/line")["drivers"][0]["model_faults"] == serde_json::json!(["leak", "a hose"])
    });
    assert_eq!(page.change("PUT /fault/1/a%20hose", "0.4").0, 200);
    assert_eq!(told(), (1, Some(0.4)));
    // The other value takes its place, without a tick between them.
    assert_eq!(page.change("PUT /fault/1/a%20hose", "0.6").0, 200);
    assert_eq!(told(), (1, Some(0.6)));
    assert_eq!(page.change("DELETE /fault/1/a%20hose", "").0, 200);
    assert_eq!(told(), (1, None));
    assert_eq!(
        page.change("DELETE /fault/1/a%20hose", "").0,
        200,
        "it is over already"
    );
    assert_eq!(page.change("PUT /fault/1/leak", "TRUE").0, 200);
    assert_eq!(told(), (0, Some(1.0)));
    assert_eq!(page.change("DELETE /force", "").0, 200);
    assert_eq!(told(), (0, None));
    for (line, body, status, words) in [
        ("PUT /fault/1/leek", "1", 404, "did you mean \\\"leak\\\"?"),
        (
            "PUT /fault/1/leak",
            "much",
            400,
            "write a number, TRUE or FALSE",
        ),
        ("PUT /fault/2/leak", "1", 404, "ids are 1"),
    ] {
        let (is, text) = page.change(line, body);
        assert_eq!(is, status, "{line}: {text}");
        assert!(text.contains(words), "{line}: {text}");
    }
    assert_eq!(page.ask("PUT /fault/1/leak", "", "1").0, 401);
    simulation.pass(3);
    assert!(
        simulation.faults.try_recv().is_err(),
        "nothing of it was done"
    );
}

#[test]
fn what_cannot_be_forced_is_refused_with_what_could() {
    let page = Page::open();
    let _simulation = Simulation::start(&page, 1, "Cell", EVER);
    for (line, body, status, words) in [
        ("PUT /force/1/in", "256", 400, "BYTE goes from 0 to 255"),
        (
            "PUT /force/1/in",
            "",
            400,
            "there is no value for \\\"in\\\"",
        ),
        ("PUT /force/1/bit", "2", 400, "a BOOL takes TRUE or FALSE"),
        ("PUT /force/1/inn", "1", 404, "did you mean \\\"in\\\"?"),
        ("PUT /force/2/in", "1", 404, "ids are 1"),
        ("DELETE /force/1/no", "", 404, "has no signal"),
        ("PUT /signals", "1", 404, "there is nothing to change here"),
    ] {
        let (is, text) = page.change(line, body);
        assert_eq!(is, status, "{line}: {text}");
        assert!(text.contains(words), "{line}: {text}");
    }
    for headers in ["", "Authorization: Bearer 00\r\n"] {
        assert_eq!(page.ask("PUT /force/1/in", headers, "5").0, 401);
        assert_eq!(page.ask("DELETE /force", headers, "").0, 401);
    }
    let referer = format!("Referer: http://{}/?token={}\r\n", page.address, page.token);
    assert_eq!(page.ask("PUT /force/1/in", &referer, "5").0, 401);
    let foreign = format!(
        "Authorization: Bearer {}\r\nOrigin: http://evil.example\r\n",
        page.token
    );
    assert_eq!(page.ask("PUT /force/1/in", &foreign, "5").0, 403);
    let faults = page.get("/line")["drivers"][0]["faults"].take();
    assert_eq!(
        faults.as_array().map(Vec::len),
        Some(0),
        "nothing of it was done"
    );
}

#[test]
fn drivers_come_to_one_page_and_go() {
    let page = Page::open();
    let one = Simulation::start(&page, 5, "One", EVER);
    let mut viewer = page.view();
    assert_eq!(
        viewer.event()["signals"]["drivers"]
            .as_array()
            .map(Vec::len),
        Some(1)
    );
    let two = Simulation::start(&page, 5, "Two", EVER);
    let full = |viewer: &mut Viewer| loop {
        let event = viewer.event();
        if event["full"] == true {
            return event;
        }
    };
    let event = full(&mut viewer);
    let drivers = event["signals"]["drivers"].clone();
    assert_eq!(
        (&drivers[0]["id"], &drivers[1]["id"]),
        (&5.into(), &6.into())
    );
    assert_eq!(drivers[1]["name"], "Two");
    page.change("PUT /force/6/in", "5");
    eventually("the second one is forced", || two.slots(0, 9.0)[1] == 5.0);
    assert_ne!(one.slots(0, 9.0)[1], 5.0);
    drop(one);
    let event = full(&mut viewer);
    assert_eq!(event["signals"]["drivers"][0]["name"], "Two");
    assert_eq!(
        event["signals"]["drivers"].as_array().map(Vec::len),
        Some(1)
    );
}

#[test]
fn forced_signals_are_released_when_the_last_viewer_has_been_gone_for_long_enough() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", Some(Nanos::from_millis(1500)));
    let keeps = Simulation::start(&page, 2, "Keeps", EVER);
    page.change("PUT /force/1/in", "5");
    page.change("PUT /force/2/in", "5");
    // A viewer with the token counts as long as it sends requests.
    let begun = Instant::now();
    let mut asked = begun;
    while begun.elapsed() < Duration::from_secs(3) {
        asked = Instant::now();
        page.change("GET /access", "");
        thread::sleep(Duration::from_millis(100));
        assert_eq!(simulation.slots(0, 9.0)[1], 5.0);
    }
    // A viewer without a token does not count.
    let _viewer = page.view();
    eventually("it is released", || simulation.slots(0, 9.0)[1] == 9.0);
    let after = asked.elapsed();
    assert!(after >= Duration::from_millis(1500), "{after:?}");
    assert_eq!(keeps.slots(0, 9.0)[1], 5.0);
}

#[test]
fn connections_beyond_the_limit_leave_the_tick_and_the_viewers_alone() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    let mut viewer = page.view();
    viewer.event();
    let begin = simulation.ticks.load(Ordering::Relaxed);
    // A page has 512 of them.
    let mut open = Vec::new();
    for _ in 0..2_000 {
        open.extend(TcpStream::connect(page.address));
        if open.len() > 700 {
            open.drain(..100);
        }
    }
    simulation.write(0, 7.0);
    while viewer.values()["1"][0][1] != 7 {}
    assert!(simulation.ticks.load(Ordering::Relaxed) > begin);
    drop(open);
    eventually("others are let in again", || {
        let stream = TcpStream::connect(page.address);
        stream.is_ok_and(|mut stream| {
            let asked = write!(
                stream,
                "GET / HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
                page.address
            );
            let mut answer = String::new();
            asked.is_ok() && stream.read_to_string(&mut answer).is_ok() && answer.contains(" 200 ")
        })
    });
}

#[test]
fn a_simulation_that_does_not_tick_is_shown_as_it_was_and_says_so() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    simulation.write(0, 7.0);
    eventually("it is seen", || {
        page.get("/signals")["drivers"][0]["signals"][0]["value"] == 7
    });
    // The simulation stops without leaving the page, as in a debugger.
    simulation.is_over.store(true, Ordering::Relaxed);
    eventually("its tick stands still", || {
        let before = simulation.ticks.load(Ordering::Relaxed);
        thread::sleep(Duration::from_millis(20));
        simulation.ticks.load(Ordering::Relaxed) == before
    });
    let signal = page.get("/signals")["drivers"][0]["signals"][0].take();
    assert_eq!(signal["value"], 7);
    let (status, text) = page.change("PUT /force/1/in", "5");
    assert_eq!(status, 409, "{text}");
    assert!(text.contains("the driver is closed"), "{text}");
}

#[test]
fn what_a_plc_never_sent_is_not_exported_as_live() {
    let page = Page::open();
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"page\"\n\
                [[station]]\nname = \"North\"\n[[station]]\nname = \"South\"\n\
                [[signal]]\nname = \"to\"\nstation = \"North\"\naddress = \"%IB0\"\n\
                [[signal]]\nname = \"from\"\nstation = \"South\"\naddress = \"%QB0\"\n";
    let config = Config::parse("driver.cfg", text, &KINDS).unwrap_or_else(|why| panic!("{why}"));
    let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
    let mut slots = driver.initial_slots();
    let options = Options {
        grace: None,
        picture: None,
        lists: None,
    };
    let _member = page.live.join(driver.watch(), options);
    let (is_over, page) = (AtomicBool::new(false), &page);
    thread::scope(|scope| {
        scope.spawn(|| {
            for tick in 1.. {
                driver.exchange(Nanos::from_millis(tick), &mut slots);
                if is_over.load(Ordering::Relaxed) {
                    break;
                }
                thread::yield_now();
            }
            driver.close();
        });
        let has = |text: &str, line: &str| text.lines().any(|it| it == line);
        let mut text = String::new();
        // The first look may come before the first tick.
        for _ in 0..100 {
            text = page.ask("GET /metrics", "", "").1;
            if text.contains("tickbus_signal_value{") {
                break;
            }
        }
        let signals = page.get("/signals");
        is_over.store(true, Ordering::Relaxed);
        let of = "driver=\"x\",id=\"1\"";
        let (to, from) = (
            format!("{{{of},signal=\"to\",station=\"North\""),
            format!("{{{of},signal=\"from\",station=\"South\""),
        );
        assert!(
            has(&text, &format!("tickbus_signal_value{to},unit=\"\"}} 0")),
            "{text}"
        );
        assert!(
            !text.contains(&format!("tickbus_signal_value{from}")),
            "{text}"
        );
        assert!(
            has(&text, &format!("tickbus_signal_failsafe{from}}} 1")),
            "{text}"
        );
        let stale = format!("tickbus_station_stale{{{of},station=\"South\"}} 1");
        assert!(has(&text, &stale), "{text}");
        let from = &signals["drivers"][0]["signals"][1];
        assert_eq!(
            (&from["stale"], &from["failsafe"]),
            (&true.into(), &true.into())
        );
    });
}
