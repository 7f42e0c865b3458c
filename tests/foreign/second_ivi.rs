//! The buses `ivi-reader` and `ivi-client` with a second implementation of the protocol at the other end: our own
//! script, since no foreign program speaks it.
#![allow(missing_docs, clippy::float_cmp, reason = "a test")]

use crate::harness::Test;
#[cfg(unix)]
use crate::harness::{self, Absent, machine::Machine};
#[cfg(unix)]
use crate::pty;

#[cfg(unix)]
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/ivi.py");

pub(crate) const TESTS: &[(&str, Test)] = &[
    #[cfg(unix)]
    ("the_script_asks_the_simulated_reader_for_everything", asks),
    #[cfg(unix)]
    (
        "the_client_reads_and_writes_the_carrier_of_the_script",
        answers,
    ),
];

#[cfg(unix)]
fn asks() -> Result<(), Absent> {
    let mut script = harness::python_with("main", &["serial"])?;
    let folder = tempfile::tempdir().expect("a folder");
    let port = folder.path().join("reader");
    let mut machine = Machine::open(&format!(
        "[driver]\nid = 1\nname = \"reader\"\n[fieldbus]\nkind = \"ivi-reader\"\ndevice = \"pty:{}\"\n\
         output_bytes = 12\n\
         [[signal]]\nname = \"present\"\naddress = \"%IX0.0\"\n\
         [[signal]]\nname = \"number\"\naddress = \"%ID4\"\n\
         [[signal]]\nname = \"data\"\naddress = \"%ID8\"\n\
         [[signal]]\nname = \"writes\"\naddress = \"%QB1\"\n",
        port.display()
    ));
    machine.until("the port is there", |_| port.is_symlink());
    machine.set("number", f64::from(0x0A01_1C3E_u32));
    machine.set("data", f64::from(0x0301_0203_u32));
    machine.set("present", 1.0);
    script.arg(SCRIPT).arg("client").arg(&port);
    let told = machine.until_the_end_of(script, Machine::tick);
    assert!(told.contains("ivi: ok"), "{told}");
    // Two by "k", and one by "h".
    machine.until("the machine has seen it", |machine| {
        machine.get("writes") == 3.0
    });
    Ok(())
}

#[cfg(unix)]
fn answers() -> Result<(), Absent> {
    use std::io::{BufRead as _, BufReader};
    use std::process::Stdio;

    let mut script = harness::python_with("main", &["serial"])?;
    let line = pty::Line::new();
    script.arg(SCRIPT).arg("reader").arg(line.end(1));
    let mut reader = script
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut told = String::new();
    let out = reader.stdout.take().expect("a pipe");
    BufReader::new(out)
        .read_line(&mut told)
        .expect("it is ready");
    let mut controller = Machine::open(&format!(
        "[driver]\nid = 1\nname = \"client\"\n[fieldbus]\nkind = \"ivi-client\"\nrole = \"controller\"\n\
         device = \"{}\"\nmax_age = \"5s\"\n\
         [[signal]]\nname = \"command\"\naddress = \"%QB0\"\n\
         [[signal]]\nname = \"count\"\naddress = \"%QB1\"\n\
         [[signal]]\nname = \"address\"\naddress = \"%QW2\"\n\
         [[signal]]\nname = \"out\"\naddress = \"%QD4\"\n\
         [[signal]]\nname = \"echo\"\naddress = \"%IB0\"\n\
         [[signal]]\nname = \"status\"\naddress = \"%IB1\"\n\
         [[signal]]\nname = \"present\"\naddress = \"%IX2.0\"\n\
         [[signal]]\nname = \"in\"\naddress = \"%ID4\"\n",
        line.end(0).display()
    ));
    controller.until("the carrier is seen", |end| end.get("present") == 1.0);
    controller.set("count", 4.0);
    let mut toggle = 0.0;
    for (command, address, expected) in [
        (b'w', 0, 0x0301_0203_u32),
        (b'k', 0x7C, 0),
        (b'w', 0x7C, 0x0303_0303),
    ] {
        toggle = 128.0 - toggle;
        let given = f64::from(command) + toggle;
        controller.set("out", f64::from(0x0303_0303_u32));
        controller.set("address", f64::from(address));
        controller.set("command", given);
        controller.until("the answer comes", |end| end.get("echo") == given);
        assert_eq!(
            (controller.get("status"), controller.get("in")),
            (0.0, f64::from(expected))
        );
    }
    drop(reader.stdin.take());
    assert!(reader.wait().expect("it is ours").success());
    Ok(())
}
