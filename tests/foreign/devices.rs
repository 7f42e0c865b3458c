//! The devices of examples/devices, each with a client that knows the real one.

use std::path::{Path, PathBuf};

use crate::harness::machine::Machine;
use crate::harness::{self, Absent, Test};
#[cfg(unix)]
use crate::pty;
use tickbus_conformance::rig::statistic;

pub(crate) const TESTS: &[(&str, Test)] = &[
    #[cfg(unix)]
    (
        "pymx2_runs_a_motor_behind_the_inverter_of_its_manual",
        an_inverter,
    ),
    #[cfg(feature = "opcua")]
    (
        "asyncua_leads_a_filler_through_the_states_of_packml",
        a_filler,
    ),
];

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("examples/devices")
        .join(name)
}

/// The driver.cfg of a device, with the port of this test.
fn driver_cfg(name: &str, changes: &[(&str, &str)]) -> String {
    let file = folder(name).join("driver.cfg");
    let mut text = std::fs::read_to_string(file).expect("an example");
    for (from, to) in changes {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        text = text.replace(from, to);
    }
    text
}

fn script(name: &str) -> String {
    format!("{}/tests/peers/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[cfg(unix)]
fn an_inverter() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["mx2", "serial"])?;
    let line = pty::Line::new();
    let port = line.end(0).display().to_string();
    // The client waits that many milliseconds for each answer, and a busy computer is late.
    let text = driver_cfg(
        "omron-mx2",
        &[
            ("/dev/ttyUSB0", &port),
            ("max_age  = \"1s\"", "max_age  = \"10s\""),
        ],
    );
    let mut machine = Machine::open(&text);
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    python.arg(script("omron_mx2.py")).arg(line.end(1));
    python.arg("150");
    let told = machine.until_the_end_of(python, Machine::tick);
    assert!(told.contains("omron_mx2: ok"), "{told}");
    assert!((machine.get("F001 frequency") - 10.0).abs() < 1e-9);
    Ok(())
}

#[cfg(feature = "opcua")]
fn a_filler() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["asyncua"])?;
    let types = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("target/peers/nodesets/Opc.Ua.PackML.NodeSet2.xml");
    if !types.exists() {
        return Err(Absent(
            "there is no NodeSet of PackML; run tools/peers".to_owned(),
        ));
    }
    let own = folder("packml-filler").join("filler.NodeSet2.xml");
    let text = driver_cfg(
        "packml-filler",
        &[
            ("127.0.0.1:4840", "127.0.0.1:0"),
            ("Opc.Ua.PackML.NodeSet2.xml", &types.display().to_string()),
            ("filler.NodeSet2.xml", &own.display().to_string()),
        ],
    );
    let mut machine = Machine::open(&text);
    let address = machine.address();
    python.arg(script("packml_client.py"));
    python.arg(format!("opc.tcp://{address}"));
    let told = machine.until_the_end_of(python, Machine::tick);
    assert!(told.contains("packml_client: ok"), "{told}");
    Ok(())
}
