//! `tickbus bridge` as a process, between `tickbus dispatch` and a serial line.
#![cfg(unix)]
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::fs::symlink;
use std::path::Path;

use crate::commands::{LabClient, Running, bridge, dispatch};
use tickbus::os::PseudoTerminal;

fn connect_pump(address: &str) -> LabClient {
    LabClient::connect(address, "VP PUMP Q2 I2 V=2")
}

/// The far end of a serial line: the client's.
struct Driver {
    line: PseudoTerminal,
    begun: Vec<u8>,
}

impl Driver {
    /// A new line, whose other end gets the name `port`.
    fn plug(port: &Path) -> Self {
        let (line, near) = PseudoTerminal::open().expect("a pseudo-terminal");
        let _ = std::fs::remove_file(port);
        symlink(near, port).expect("a link");
        let begun = Vec::new();
        Self { line, begun }
    }

    fn say(&mut self, text: &str) {
        self.line.write_all(text.as_bytes()).expect("it is open");
    }

    /// Reads lines until one begins with `begin`.
    fn until(&mut self, begin: &str) -> String {
        let limit = std::time::Instant::now() + std::time::Duration::from_secs(60);
        loop {
            while let Some(end) = self.begun.iter().position(|byte| *byte == b'\r') {
                let line: Vec<u8> = self.begun.drain(..=end).collect();
                let line = String::from_utf8(line).expect("text");
                if line.starts_with(begin) {
                    return line.trim_end().to_owned();
                }
            }
            assert!(std::time::Instant::now() < limit, "no {begin}");
            let mut bytes = [0; 256];
            let patience = std::time::Duration::from_millis(100);
            let count = self
                .line
                .read_within(&mut bytes, patience)
                .expect("it is open");
            self.begun.extend_from_slice(&bytes[..count]);
        }
    }
}

#[test]
fn a_driver_at_a_serial_line_outlives_its_dispatcher_and_its_port() {
    let folder = tempfile::tempdir().expect("a folder");
    let (patch, port) = (folder.path().join("lab.toml"), folder.path().join("port"));
    let mut lab = dispatch(&patch, "127.0.0.1:0");
    let address = lab.after("dispatch: listening on ");
    let mut driver = Driver::plug(&port);
    let name = port.to_str().expect("text");
    let mut running = bridge(&["serial", name, "--dispatcher", &address, "--line-end", "cr"]);
    running.after("bridge: connected with ");
    driver.say("VR SCADA Q2 I2 V=2\r");
    driver.until("END 1");
    let mut pump = connect_pump(&address);
    driver.say("CONNECT I1:PUMP:Q1 Q1:PUMP:I1\rP Q1=24\r");
    assert_eq!(pump.until("P "), "P I1=24");
    pump.say("P Q1=5");
    assert_eq!(driver.until("P "), "P I1=5");

    // The dispatcher ends, and is restarted.
    let (last, code) = lab.interrupt();
    assert!(last.starts_with("dispatch: ok "), "{last}");
    assert_eq!(code, Some(0));
    assert!(
        running
            .after("bridge: the dispatcher at ")
            .contains("is lost")
    );
    driver.until("ERR 503 ");
    driver.say("P Q2=7 Q1=3\r");
    let mut lab = dispatch(&patch, &address);
    lab.after("dispatch: listening on ");
    running.after("bridge: connected with ");
    driver.until("END ");
    let mut pump = connect_pump(&address);
    assert_eq!(pump.until("P "), "P I1=3");

    // The port is pulled, and plugged in again.
    drop(driver);
    assert!(
        running
            .after("bridge: the serial port ")
            .contains("is gone")
    );
    assert_eq!(pump.until("P "), "P I1=0");
    let mut driver = Driver::plug(&port);
    running.after("bridge: ");
    driver.until("END 2");
    driver.say("P Q1=9\r");
    assert_eq!(pump.until("P "), "P I1=9");

    let (last, code) = running.interrupt();
    assert!(last.starts_with("bridge: ok said="), "{last}");
    assert_eq!(code, Some(0));
    lab.interrupt();
}

#[test]
fn a_virtual_port_has_the_name_that_was_asked_for_and_takes_no_file_away() {
    let folder = tempfile::tempdir().expect("a folder");
    let (patch, link) = (folder.path().join("lab.toml"), folder.path().join("com1"));
    let mut lab = dispatch(&patch, "127.0.0.1:0");
    let address = lab.after("dispatch: listening on ");
    let name = link.to_str().expect("text").to_owned();
    let arguments = ["serial", "--pty", &name, "--dispatcher", &address];
    // A killed bridge leaves its link behind.
    let mut killed = bridge(&arguments);
    killed.after("bridge: connected with ");
    killed.kill();
    assert!(link.is_symlink());
    let mut running = bridge(&arguments);
    running.after("bridge: connected with ");
    let mut options = std::fs::OpenOptions::new();
    let mut com1 = options.read(true).write(true).open(&link).expect("a port");
    com1.write_all(b"VR SCADA Q1 I1 V=2\r\nPING\r\n")
        .expect("it is open");
    let mut lines = BufReader::new(com1).lines().map(|line| line.expect("text"));
    let heard: Vec<String> = lines.by_ref().take(4).collect();
    assert_eq!(heard[0], "OK VR");
    assert_eq!(heard[2..], ["END 1", "OK PING"]);
    let (last, _) = running.interrupt();
    assert_eq!(last, "bridge: ok said=2 heard=4 overtaken=0 dropped=0");
    assert!(!link.is_symlink());

    std::fs::write(&link, "a file of the user").expect("a file");
    let (last, code) = bridge(&arguments).end();
    assert!(
        last.starts_with("bridge: failed reason=\"cannot make a virtual port"),
        "{last}"
    );
    assert_eq!(code, Some(3));
    assert!(link.is_file());
    lab.interrupt();
}

#[test]
fn mistakes_have_the_exit_codes_of_the_house() {
    let end =
        |arguments: &[&str]| -> (String, Option<i32>) { Running::of("bridge", arguments).end() };
    let (last, code) = end(&["serial", "/dev/no-such-port"]);
    assert!(
        last.starts_with("bridge: failed reason=\"cannot open /dev/no-such-port at 9600 baud, 8N1"),
        "{last}"
    );
    assert_eq!(code, Some(3));
    for arguments in [
        &["serial"][..],
        &["serial", "/dev/x", "--pty", "y"],
        &["serial", "/dev/x", "--dispatcher", "127.0.0.1:0"],
        &["serial", "/dev/x", "--baud", "0"],
        &["serial", "/dev/x", "--line-end", "crcr"],
        &["serial", "--pty", "y", "--baud", "9600"],
        &["serial", "--pty", "y", "--parity", "none"],
    ] {
        assert_eq!(end(arguments).1, Some(2), "{arguments:?}");
    }

    let folder = tempfile::tempdir().expect("a folder");
    let map = folder.path().join("map.toml");
    let name = map.to_str().expect("text");
    assert_eq!(end(&["mqtt", name]).1, Some(1), "there is no file");
    std::fs::write(&map, "[mqtt]\nbrokr = \"127.0.0.1:1883\"\n").expect("a file");
    assert_eq!(end(&["mqtt", name]).1, Some(1));
    if !cfg!(feature = "mqtt") {
        let right = "[mqtt]\nbroker = \"127.0.0.1:1883\"\n[dispatcher]\nname = \"A\"\nrole = \"VP\"\n\
                     [[channel]]\nchannel = \"I1\"\ntopic = \"a\"\n";
        std::fs::write(&map, right).expect("a file");
        let (last, code) = end(&["mqtt", name]);
        assert!(last.contains("--features mqtt"), "{last}");
        assert_eq!(code, Some(1));
    }
}
