//! The soak: a device that ticks as fast as it can, and a peer at the highest rate that dies again and again,
//! in every way that a peer can.
//!
//! The soak takes some seconds by default; `make soak` runs it for minutes or hours (`make soak MINUTES=120`). It
//! counts the peer's actions and the device's reports: both must agree, so that no error is unexplained. Threads,
//! descriptors and memory must be the same at the end as at the beginning.
#![allow(
    missing_docs,
    unreachable_pub,
    dead_code,
    reason = "a test, which uses a part of the suite's fixtures"
)]

#[path = "soak/common.rs"]
mod common;

use std::io::{Read as _, Write as _};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::{address, assert_all_explained, count, eventually, rest, statistic};
use tickbus::time::Nanos;
use tickbus_test_log as logged;

const CONFIG: &str = r#"
[driver]
id   = 1
name = "soak"

[fieldbus]
kind    = "socket"
address = "127.0.0.1:0"
send    = "reply"
cycle   = "1ms"
max_age = "250ms"

[[signal]]
name    = "counter"
address = "%QD0"
type    = "UDINT"

[[signal]]
name    = "more"
address = "%QB359"

[[signal]]
name    = "answer"
address = "%ID0"
type    = "UDINT"

[[signal]]
name    = "rest"
address = "%IB133"
"#;

const RECORD: usize = 360;
const ANSWER: usize = 134;

/// The way in which a peer dies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Death {
    /// The peer closes properly.
    Close,
    /// The connection is reset.
    Reset,
    /// The peer dies in the middle of a record.
    Half,
    /// The peer falls silent until the device gives it up.
    Silence,
}

const DEATHS: [Death; 4] = [Death::Close, Death::Reset, Death::Half, Death::Silence];

impl Death {
    /// The cause that the device reports for it.
    fn cause(self) -> &'static str {
        match self {
            Self::Close => "left",
            Self::Reset | Self::Silence => "link",
            Self::Half => "protocol",
        }
    }
}

/// One life of a peer: at full speed for `span`, then its death. Returns the number of answered records.
fn live(address: SocketAddr, span: Duration, death: Death) -> u64 {
    let mut stream = common::connect(address);
    let end = Instant::now() + span;
    let mut record = [0; RECORD];
    let mut answer = [0; ANSWER];
    let mut answered = 0_u32;
    while Instant::now() < end || answered == 0 {
        record[..4].copy_from_slice(&answered.to_be_bytes());
        stream.write_all(&record).expect("the device reads");
        stream.read_exact(&mut answer).expect("the device answers");
        answered += 1;
    }
    match death {
        Death::Close => {}
        Death::Reset => common::reset(&stream),
        Death::Half => stream
            .write_all(&record[..RECORD / 2])
            .expect("the device reads"),
        Death::Silence => {
            let closed = stream.read(&mut answer).expect("the device closes");
            assert_eq!(closed, 0, "nobody asked");
        }
    }
    drop(stream);
    u64::from(answered)
}

#[test]
fn a_device_outlives_all_peers() {
    let end = common::end();
    let _logged = logged::Watch::new();
    let driver = common::open(CONFIG);
    let mut slots = driver.initial_slots();
    let address = address(&driver);

    let over = AtomicBool::new(false);
    let (driver, lives, answered, before, after) = std::thread::scope(|scope| {
        let ticking = scope.spawn(|| {
            let mut driver = driver;
            while !over.load(Ordering::Relaxed) {
                driver.exchange(Nanos::ZERO, &mut slots);
                slots[2] = slots[0];
            }
            driver
        });
        let mut lives = [0_u64; DEATHS.len()];
        let (mut answered, mut round) = (0, 0_u64);
        let mut before = None;
        let mut told = common::Told::new();
        while Instant::now() < end {
            round += 1;
            for (death, lives) in DEATHS.into_iter().zip(&mut lives) {
                // Silence takes a second, so it is less frequent.
                if death == Death::Silence && round % 10 != 1 {
                    continue;
                }
                answered += live(address, Duration::from_millis(50), death);
                *lives += 1;
            }
            // The first rounds fill caches that are filled only once.
            if round == 5 {
                before = Some(rest());
            }
            told.tell(|| format!("{lives:?} lives, {answered} records"));
        }
        let after = rest();
        over.store(true, Ordering::Relaxed);
        let driver = ticking.join().expect("no panic");
        (driver, lives, answered, before, after)
    });
    println!("soak: lives {lives:?}, records {answered}, before {before:?}, after {after:?}");
    assert_eq!(before, Some(after), "something piles up");

    eventually("the last peer is noticed to be gone", || {
        statistic(&driver, "state").filter(|state| state == "opening")
    });
    println!("{}", driver.statistics());
    let total: u64 = lives.iter().sum();
    assert_eq!(
        count(&driver, "link.running"),
        total,
        "every peer was served"
    );
    for cause in ["left", "link", "protocol"] {
        let done = DEATHS.iter().zip(lives);
        let done = done.filter(|(death, _)| death.cause() == cause);
        let done: u64 = done.map(|(_, lives)| lives).sum();
        let key = format!("cause.{cause}");
        assert_eq!(
            count(&driver, &key),
            done,
            "{cause}: {}",
            driver.statistics()
        );
    }
    assert_all_explained(&driver);
    assert_eq!(
        count(&driver, "bus_cycles"),
        answered,
        "every record was taken"
    );
    driver.close();
}
