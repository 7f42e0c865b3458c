//! The bus `profibus-device` with pyprofibus, a DP master in Python, at the other end. (profirust is at the other end in
//! the tests of the bus's own crate.)
#![allow(missing_docs, clippy::float_cmp, reason = "a test")]

mod foreign;
#[cfg(unix)]
#[path = "peers/pty.rs"]
mod pty;

use std::process::ExitCode;

use foreign::Absent;
#[cfg(unix)]
use foreign::machine::Machine;
#[cfg(unix)]
use tickbus_conformance::rig::statistic;

fn main() -> ExitCode {
    foreign::main(&[
        #[cfg(unix)]
        (
            "pyprofibus_reads_our_gsd_file_and_exchanges_at_every_rate_of_user_space",
            exchanges,
        ),
    ])
}

#[cfg(unix)]
fn exchanges() -> Result<(), Absent> {
    let gsd = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/gsd/encoder.gsd");
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/profibus_master.py"
    );
    for baud in ["9600", "19200", "187500", "500000"] {
        let mut master = foreign::python_with("main", &["pyprofibus", "serial"])?;
        // A port of its own each time: one whose parity was asked for cannot be opened again with the same settings.
        let line = pty::Line::new();
        let device = line.end(0).display();
        let mut machine = Machine::open(&format!(
            "[driver]\nid = 1\nname = \"encoder\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{device}\"\n\
             baud = {baud}\nmax_tsdr = 60000\nmax_age = \"5s\"\naddress = 8\ngsd = \"{gsd}\"\n\
             [[signal]]\nname = \"out\"\naddress = \"%QD0\"\ntype = \"UDINT\"\n\
             [[signal]]\nname = \"in\"\naddress = \"%ID0\"\ntype = \"UDINT\"\n"
        ));
        machine.until("it listens", |machine| {
            statistic(&machine.driver, "device").is_some()
        });
        master.arg(script).arg(line.end(1));
        master.args([baud, "8", gsd, "4 bytes in and out"]);
        let told = machine.until_the_end_of(master, |machine| {
            machine.tick();
            let value = machine.get("out");
            machine.set("in", value);
        });
        assert!(told.contains("profibus_master: ok exchanges="), "{told}");
        println!("{baud} baud: {}", told.trim());
    }
    Ok(())
}
