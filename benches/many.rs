//! Many drivers in one process, and many signals in one driver: the time to open them and their memory. Prints one
//! `rust NAME VALUE` per line on stdout.
#![allow(missing_docs, reason = "a bench")]

use std::fmt::Write as _;
use std::time::Instant;

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Monotonic;

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let (drivers, large) = if measured { (1000, 30_000) } else { (3, 300) };
    // The large one first: the memory of closed drivers would be used again, and not count.
    measure("many.signals", 1, large);
    measure("many.drivers", drivers, 100);
}

/// Opens drivers with as many signals each, half of them in each direction.
fn measure(name: &str, drivers: u32, signals: u32) {
    let text = config(signals);
    let (before, begin) = (resident(), Instant::now());
    let open: Vec<Driver> = (0..drivers)
        .map(|_| {
            let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
                .unwrap_or_else(|why| panic!("{why}"));
            Driver::open(config, Monotonic::shared()).expect("opens")
        })
        .collect();
    let time = begin.elapsed().as_secs_f64();
    let memory = resident() - before;
    let all = f64::from(drivers) * f64::from(signals);
    println!("rust {name}.open_s {time:.3}");
    println!("rust {name}.open_us_per_signal {:.2}", time * 1e6 / all);
    println!("rust {name}.bytes_per_signal {:.0}", memory / all);
    for driver in open {
        driver.close();
    }
}

/// REALs on a bus without threads of its own.
fn config(signals: u32) -> String {
    let mut text = "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
         scan = \"1ms\"\nmode = \"stepped\"\n"
        .to_owned();
    for area in ['Q', 'I'] {
        for index in 0..signals / 2 {
            let _ = write!(
                text,
                "[[signal]]\nname = \"axis {index} of {area}\"\naddress = \"%{area}D{}\"\ntype = \"REAL\"\n",
                index * 4
            );
        }
    }
    text
}

/// Resident memory of this process, in bytes.
fn resident() -> f64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = text.split(' ').nth(1).and_then(|pages| pages.parse().ok());
    pages.unwrap_or(0.0) * 4096.0
}
