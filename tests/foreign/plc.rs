//! The socket bus against a program in another language, as a third party might write it.
#![allow(missing_docs, clippy::float_cmp, reason = "tests; small whole numbers")]

use crate::harness::machine::Machine;
use crate::harness::{self, Absent, Test};
use tickbus::time::Manual;
use tickbus_conformance::rig::SIGNALS;

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/plc.py");

const DRIVER_CFG: &str = r#"
[driver]
id   = 1
name = "Machine"

[fieldbus]
kind    = "socket"
address = "127.0.0.1:0"
send    = "reply"
"#;

const RECORDS: u32 = 200;

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "a_plc_in_python_exchanges_with_a_device_that_replies",
    exchanges,
)];

fn exchanges() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["socket"])?;
    // A device that replies needs no clock.
    let mut device = Machine::open_on(&Manual::new(), &format!("{DRIVER_CFG}{SIGNALS}"));
    let address = device.address();
    let (host, port) = (address.ip().to_string(), address.port().to_string());
    python.args([SCRIPT, &host, &port, &RECORDS.to_string()]);
    let told = device.until_the_end_of(python, |device| {
        device.tick();
        let (run, speed) = (device.get("run"), device.get("speed"));
        device.set("sensor", run);
        device.set("position", speed * 2.0);
        device.set("copy", speed);
    });
    let received = device.statistic("bus_cycles");
    assert_eq!(told.trim(), format!("plc.py: ok records={received}"));
    Ok(())
}
