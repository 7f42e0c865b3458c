//! The socket bus against a program in another language, as a third party might write it.
#![allow(missing_docs, clippy::float_cmp, reason = "tests; small whole numbers")]

mod foreign;

use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use foreign::Absent;
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Manual, Nanos};

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/plc.py");

/// The same addresses as in the script.
const DRIVER_CFG: &str = r#"
[driver]
id   = 1
name = "Machine"

[fieldbus]
kind    = "socket"
address = "127.0.0.1:0"
send    = "reply"

[[signal]]
name    = "run"
address = "%QX0.0"

[[signal]]
name    = "speed"
address = "%QW2"
type    = "INT"

[[signal]]
name    = "echo"
address = "%QW4"
type    = "INT"

[[signal]]
name    = "sensor"
address = "%IX0.0"

[[signal]]
name    = "position"
address = "%IW2"
type    = "INT"

[[signal]]
name    = "copy"
address = "%IW4"
type    = "INT"
"#;

const RECORDS: u32 = 200;

fn main() -> ExitCode {
    foreign::main(&[(
        "a_plc_in_python_exchanges_with_a_device_that_replies",
        exchanges,
    )])
}

fn exchanges() -> Result<(), Absent> {
    let python = foreign::python_with("main", &["socket"])?;
    run(python).unwrap_or_else(|why| panic!("{why}"));
    Ok(())
}

fn run(mut python: Command) -> Result<(), String> {
    let config = Config::parse("driver.cfg", DRIVER_CFG).map_err(|why| why.to_string())?;
    // A device that replies needs no clock.
    let mut device = Driver::open(config, Manual::new()).map_err(|why| why.to_string())?;
    let mut slots = device.initial_slots();
    let address = wait_for(|| {
        let text = device.statistics();
        let line = text.lines().find_map(|line| line.strip_prefix("address="));
        line.map(str::to_owned)
    })
    .ok_or("the device does not listen")?;
    let (host, port) = address.rsplit_once(':').ok_or("no port in the address")?;
    let mut plc = python
        .args([SCRIPT, host, port, &RECORDS.to_string()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|why| why.to_string())?;
    let ended = wait_for(|| {
        device.exchange(Nanos::ZERO, &mut slots);
        let [run, speed, _, sensor, position, copy] = &mut slots[..6] else {
            panic!("six signals");
        };
        *sensor = *run;
        *position = Slot::from_real(speed.real() * 2.0);
        *copy = *speed;
        std::thread::yield_now();
        plc.try_wait().expect("it was started")
    });
    if ended.is_none() {
        // Waited for below, whether or not it has just ended by itself.
        let _ = plc.kill();
    }
    let output = plc.wait_with_output().map_err(|why| why.to_string())?;
    let told =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    let statistics = device.statistics();
    let received = statistics
        .lines()
        .find_map(|line| line.strip_prefix("bus_cycles="))
        .unwrap_or_default();
    if told[0].trim() == format!("plc.py: ok records={received}") {
        Ok(())
    } else {
        Err(format!("{}\n{}\n{statistics}", told[0], told[1]))
    }
}

/// Polls until there is something, for at most 20 s.
fn wait_for<T>(mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let limit = Instant::now() + Duration::from_secs(20);
    loop {
        if let Some(found) = look() {
            return Some(found);
        }
        if Instant::now() > limit {
            return None;
        }
    }
}
