//! The live page: what a tick pays for its viewers, how long a change takes to them, and how many bytes they get.
//!
//! The tick of a free bus with a hosted program and 1,000 REALs each way, every millisecond, of which a tenth changes in each
//! tick and comes back; viewers read all that comes, on other threads. The tick's thread stays on one core, where the system
//! can do that; the others go where they like. Rounds with different numbers of viewers take turns, and a ratio is the median
//! of those of the rounds. Prints one `rust NAME VALUE` per line.
#![allow(missing_docs, reason = "a bench")]

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Clock as _, Monotonic, Nanos, Pace, Stop, TimeHistogram};
use tickbus_live_page::{LivePage, Member, Options};
use tickbus_net::Address;
use tickbus_web::{Limits, Room, Serving};

/// The time between two ticks.
const TICK: Nanos = Nanos::from_millis(1);

/// REALs each way.
const SIGNALS: usize = 1_000;

/// No page at all; a page without a recording in memory; and the numbers of viewers of one with it.
const PHASES: [(&str, Shown); 5] = [
    ("without", None),
    ("no_history", Some((0, "0"))),
    ("viewers_0", Some((0, HISTORY))),
    ("viewers_1", Some((1, HISTORY))),
    ("viewers_20", Some((20, HISTORY))),
];

/// The viewers of a page and the memory of its history, or no page.
type Shown = Option<(usize, &'static str)>;

const HISTORY: &str = "\"64 MB\"";

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let (rounds, span) = if measured {
        (9, Duration::from_secs(1))
    } else {
        (1, Duration::from_millis(50))
    };
    let rounds: Vec<[[f64; 2]; 5]> = (0..rounds)
        .map(|_| PHASES.map(|(_, shown)| phase(shown, span)))
        .collect();
    for (at, (name, _)) in PHASES.iter().enumerate() {
        let over_rounds = |of: &dyn Fn(&[[f64; 2]; 5]) -> f64| {
            let mut values: Vec<f64> = rounds.iter().map(of).collect();
            median(&mut values)
        };
        let p50 = over_rounds(&|round| round[at][0]);
        let p99 = over_rounds(&|round| round[at][1]);
        let ratio = over_rounds(&|round| round[at][0] / round[0][0]);
        println!("rust page.{name}.tick_p50_us {p50:.2}");
        println!("rust page.{name}.tick_p99_us {p99:.2}");
        let tail = over_rounds(&|round| round[at][1] / round[0][1]);
        println!("rust page.{name}.ratio {ratio:.3}");
        println!("rust page.{name}.ratio_p99 {tail:.3}");
    }
    all_change(span * 2);
    edges(span * 4);
}

/// Ticks with a page, or without one: median and 99 % of how long an exchange takes, in microseconds.
fn phase(shown: Shown, span: Duration) -> [f64; 2] {
    let mut cell = Cell::open(shown);
    let ticks = cell.tick(span, |tick, slots| change(tick, &mut slots[..SIGNALS / 10]));
    [0.5, 0.99].map(|share| ticks.quantile(share).as_micros())
}

/// Gives signals values that they did not have in the last tick.
fn change(tick: u64, slots: &mut [Slot]) {
    for (index, slot) in slots.iter_mut().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let value = (tick * 7 + index as u64) as f64 / 16.0;
        *slot = Slot::from_real(value);
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A driver on a page with viewers.
struct Cell {
    driver: Driver,
    slots: Vec<Slot>,
    _member: Option<Member>,
    page: Option<(Serving, LivePage, SocketAddr)>,
    viewers: Vec<TcpStream>,
}

impl Drop for Cell {
    fn drop(&mut self) {
        for viewer in &self.viewers {
            // It may have ended.
            let _ = viewer.shutdown(std::net::Shutdown::Both);
        }
    }
}

impl Cell {
    /// With a page and this many viewers who drop what they read; `None` for no page.
    fn open(shown: Shown) -> Self {
        let mut text = "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                        scan = \"1ms\"\ncycle = \"1ms\"\n"
            .to_owned();
        if let Some((_, history)) = shown {
            let _ = write!(text, "[page]\nhistory = {history}\n");
        }
        for area in ['I', 'Q'] {
            for signal in 0..SIGNALS {
                let _ = write!(
                    text,
                    "[[signal]]\nname = \"{area} {signal}\"\naddress = \"%{area}D{}\"\ntype = \"REAL\"\n",
                    signal * 4
                );
            }
        }
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"));
        let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let slots = driver.initial_slots();
        let page = shown.map(|_| {
            let page = LivePage::open(Monotonic::shared()).expect("a thread");
            let room = Room::bind(&Address::local(0), Limits::default()).expect("a port");
            let address = room.address();
            let serving = room.serve(
                tickbus_web::Pages::of("Live page", page.site()),
                Monotonic::shared(),
            );
            (serving.expect("a thread"), page, address)
        });
        let member = page.as_ref().map(|(_, page, _)| {
            let options = Options {
                grace: None,
                picture: None,
                lists: None,
            };
            page.join(driver.watch(), options)
        });
        let mut cell = Self {
            driver,
            slots,
            _member: member,
            page,
            viewers: Vec::new(),
        };
        for _ in 0..shown.map_or(0, |(viewers, _)| viewers) {
            cell.view(|_| {});
        }
        cell
    }

    /// A viewer, on a thread of its own; `heard` gets all bytes.
    fn view(&mut self, mut heard: impl FnMut(&[u8]) + Send + 'static) {
        let (_, _, address) = self.page.as_ref().expect("a page");
        let mut stream = TcpStream::connect(address).expect("it listens");
        write!(stream, "GET /events HTTP/1.1\r\nHost: {address}\r\n\r\n").expect("it reads");
        self.viewers.push(stream.try_clone().expect("a descriptor"));
        thread::spawn(move || {
            let mut bytes = vec![0; 1 << 18];
            while let Ok(count @ 1..) = stream.read(&mut bytes) {
                heard(&bytes[..count]);
            }
        });
    }

    /// Ticks for a while, in a thread that stays on one core; `before` may write values before each tick. How long the
    /// exchanges took.
    fn tick(
        &mut self,
        span: Duration,
        mut before: impl FnMut(u64, &mut [Slot]) + Send,
    ) -> TimeHistogram {
        let Self { driver, slots, .. } = self;
        let work = || {
            stay_on_one_core();
            let clock = Monotonic::shared();
            let mut times = TimeHistogram::new();
            let begin = clock.now();
            let mut pace = Pace::new(begin, TICK);
            let end = begin + Nanos(i64::try_from(span.as_nanos()).expect("short"));
            let mut tick = 0;
            while clock.now() < end {
                clock.wait_until(pace.due(), &Stop::new());
                if !pace.take(clock.now()) {
                    continue;
                }
                before(tick, slots);
                let begun = clock.now();
                driver.exchange(None, slots);
                // What a tick costs on its way to the page is in it, too.
                times.record(clock.now() - begun);
                tick += 1;
            }
            times
        };
        thread::scope(|scope| scope.spawn(work).join().expect("no panic"))
    }
}

/// Keeps this thread on the last core.
#[cfg(target_os = "linux")]
fn stay_on_one_core() {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let mut set = rustix::thread::CpuSet::new();
    set.set(cores - 1);
    // Elsewhere it is measured all the same.
    let _ = rustix::thread::sched_setaffinity(None, &set);
}

#[cfg(not(target_os = "linux"))]
fn stay_on_one_core() {}

/// 1,000 signals change in every tick, half of them by coming back: the bytes of one viewer.
fn all_change(span: Duration) {
    let mut cell = Cell::open(Some((0, HISTORY)));
    let (bytes, events) = (Arc::<AtomicU64>::default(), Arc::<AtomicU64>::default());
    let counted = (Arc::clone(&bytes), Arc::clone(&events));
    cell.view(move |heard| {
        counted.0.fetch_add(heard.len() as u64, Ordering::Relaxed);
        let begun = heard.windows(6).filter(|window| window == b"data: ");
        counted.1.fetch_add(begun.count() as u64, Ordering::Relaxed);
    });
    let values = |tick: u64, slots: &mut [Slot]| change(tick, &mut slots[..SIGNALS / 2]);
    cell.tick(span / 4, values);
    let before = [&bytes, &events].map(|count| count.load(Ordering::Relaxed));
    cell.tick(span, values);
    let seconds = span.as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    let rate =
        |count: &AtomicU64, before: u64| (count.load(Ordering::Relaxed) - before) as f64 / seconds;
    println!("rust page.bytes_per_s {:.0}", rate(&bytes, before[0]));
    println!("rust page.events_per_s {:.1}", rate(&events, before[1]));
}

/// One value changes now and then: how long until a viewer has the event, after the exchange in which it changed.
fn edges(span: Duration) {
    const EVERY: u64 = 97;
    let mut cell = Cell::open(Some((0, HISTORY)));
    let clock = Monotonic::shared();
    let written = Arc::new(AtomicI64::new(0));
    let spans = Arc::new(std::sync::Mutex::new(TimeHistogram::new()));
    let shared = (Arc::clone(&written), Arc::clone(&spans), Arc::clone(&clock));
    cell.view(move |heard| {
        let (written, spans, clock) = &shared;
        // An event with values, and not with the line alone.
        let has_values = heard.windows(12).any(|window| window == b"\"values\":{\"1");
        let since = if has_values {
            written.swap(0, Ordering::Relaxed)
        } else {
            0
        };
        if since > 0 {
            spans
                .lock()
                .expect("no panic")
                .record(clock.now() - Nanos(since));
        }
    });
    cell.tick(Duration::from_millis(100), |_, _| {});
    cell.tick(span, |tick, slots| {
        if tick % EVERY == 0 {
            // The second signal of %Q follows by the mirror some ticks later; this one is what the page shows first.
            slots[1] = Slot::from_real(1.0 - slots[1].real());
            written.store(clock.now().0, Ordering::Relaxed);
        }
    });
    let spans = spans.lock().expect("no panic");
    println!(
        "rust page.edge_p50_ms {:.2}",
        spans.quantile(0.5).as_micros() / 1e3
    );
    println!(
        "rust page.edge_p99_ms {:.2}",
        spans.quantile(0.99).as_micros() / 1e3
    );
}
