//! Serial lines: pseudo-terminals with a prepared slave or master at the far end.

use std::io::Write as _;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use tickbus::fieldbus::modbus::{ascii, rtu};
use tickbus::os::PseudoTerminal;

const WORD: &str = "[[signal]]\nname = \"Life\"\naddress = \"%QW0\"\n";

/// The far end of a line.
#[derive(Clone, Copy, Default)]
struct Far {
    /// Answers this unit.
    unit: u8,
    is_ascii: bool,
    /// Sends each request back first.
    echoes: bool,
    /// Talks without a question to this unit.
    talks_to: Option<u8>,
    /// Talks without a question, and no telegrams.
    is_noisy: bool,
}

impl Far {
    /// Serves a line until the test ends, and returns its name.
    fn serve(self) -> String {
        let (mut far, near) = PseudoTerminal::open().expect("a pseudo-terminal");
        thread::spawn(move || {
            let mut bytes = [0; 512];
            loop {
                let patience = Duration::from_millis(20);
                let count = far.read_within(&mut bytes, patience).unwrap_or_default();
                let answer = if count == 0 {
                    self.speech()
                } else {
                    self.answer(&bytes[..count])
                };
                if far.write_all(&answer).is_err() {
                    return;
                }
            }
        });
        near.display().to_string()
    }

    fn speech(self) -> Vec<u8> {
        let mut out = Vec::new();
        if let Some(unit) = self.talks_to {
            rtu::append(unit, &mut out, |pdu| pdu.extend([3, 0, 0, 0, 1]));
        }
        if self.is_noisy {
            out.extend([0x55, 0xAA, 0x55]);
        }
        out
    }

    fn answer(self, request: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        if self.echoes {
            out.extend_from_slice(request);
        }
        if self.is_ascii {
            // `:` and two digits of the unit.
            let unit = format!(":{:02X}03", self.unit);
            if request.starts_with(unit.as_bytes()) {
                ascii::append(self.unit, &mut out, |pdu| pdu.extend([3, 2, 0, 7]));
            }
            return out;
        }
        match rtu::parse(request) {
            Some((unit, [3, ..])) if unit == self.unit => {
                rtu::append(unit, &mut out, |pdu| pdu.extend([3, 2, 0, 7]));
            }
            Some((unit, [code, ..])) if unit == self.unit => {
                rtu::append(unit, &mut out, |pdu| pdu.extend([code | 0x80, 1]));
            }
            _ => {}
        }
        out
    }
}

/// Examines a line; returns what was told.
#[track_caller]
fn examine(fieldbus: &str, cause: &str, part: &str) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("driver.cfg");
    let text = format!("[driver]\nid = 1\nname = \"Rig\"\n[fieldbus]\n{fieldbus}\n{WORD}");
    std::fs::write(&file, text).expect("the file is written");
    told(&file, cause, part)
}

#[track_caller]
fn told(file: &Path, cause: &str, part: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["doctor", "--watch", "400ms"])
        .arg(file)
        .output()
        .expect("the tickbus program runs");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        told.contains(&format!("\ndoctor: {cause} ")) && told.contains(part),
        "{cause} and \"{part}\" in {told}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    told
}

fn client(device: &str, further: &str) -> String {
    format!("kind = \"modbus-client\"\ndevice = \"{device}\"\nmax_age = \"2s\"\n{further}")
}

#[test]
fn a_unit_on_a_serial_line_is_examined_as_on_a_network() {
    let far = Far {
        unit: 4,
        ..Far::default()
    };
    let told = examine(&client(&far.serve(), "unit = 4"), "ok", "19200 baud, 8E1");
    for step in [
        "it is quiet",
        "unit 4 answers",
        "all signals can be read",
        "ok    age",
    ] {
        assert!(told.contains(step), "\"{step}\" in {told}");
    }
    let ascii = Far {
        unit: 1,
        is_ascii: true,
        ..Far::default()
    };
    let device = ascii.serve();
    examine(
        &client(&device, "framing = \"ascii\""),
        "ok",
        "unit 1 answers",
    );
    examine(
        &client(&device, ""),
        "wrong-framing",
        "write framing = \"ascii\"",
    );
}

#[test]
fn what_is_wrong_with_a_serial_line_is_named() {
    let line = |far: Far| client(&far.serve(), "");
    let other = Far {
        unit: 6,
        ..Far::default()
    };
    examine(&line(other), "wrong-unit", "write unit = 6");
    let echoes = Far {
        unit: 1,
        echoes: true,
        ..Far::default()
    };
    examine(&line(echoes), "echo", "write echo = true");
    examine(
        &client(&echoes.serve(), "echo = true"),
        "ok",
        "unit 1 answers",
    );
    let quiet = Far {
        unit: 1,
        ..Far::default()
    };
    examine(
        &client(&quiet.serve(), "echo = true"),
        "echo",
        "remove echo = true",
    );
    let two_masters = Far {
        unit: 1,
        talks_to: Some(9),
        ..Far::default()
    };
    examine(&line(two_masters), "another-master", "end the other master");
    examine(
        &client("/dev/no-such-port", ""),
        "device-missing",
        "plug the adapter in",
    );
    examine(
        &client("/etc/hostname", ""),
        "no-serial-port",
        "is no device",
    );
}

#[test]
fn a_port_that_another_program_has_is_named_with_that_program() {
    use std::os::unix::fs::OpenOptionsExt as _;

    let device = Far::default().serve();
    let mut options = std::fs::OpenOptions::new();
    let open = options
        .read(true)
        .custom_flags(0o4000)
        .open(&device)
        .expect("it is there");
    rustix::fs::flock(&open, rustix::fs::FlockOperation::LockExclusive).expect("a lock");
    let user = format!("(process {})", std::process::id());
    examine(&client(&device, ""), "device-taken", &user);
}

/// Of other units and settings each is asked once.
#[test]
fn the_search_for_a_silent_unit_ends_within_fifteen_seconds() {
    let begin = Instant::now();
    let line = client(&Far::default().serve(), "unit = 30");
    let told = examine(&line, "silent", "units 1 to 10");
    assert!(told.contains("23 other settings"), "{told}");
    assert!(begin.elapsed() < Duration::from_secs(15), "{told}");
}

#[test]
fn a_server_hears_who_talks_on_its_line() {
    let server = |far: Far, unit: u8| {
        let device = far.serve();
        format!("kind = \"modbus-server\"\ndevice = \"{device}\"\nunit = {unit}")
    };
    let plc = Far {
        talks_to: Some(7),
        ..Far::default()
    };
    examine(&server(plc, 7), "ok", "the PLC talks to unit 7");
    examine(&server(plc, 8), "wrong-unit", "same unit");
    examine(&server(Far::default(), 7), "ok", "nobody talks");
    let noise = Far {
        is_noisy: true,
        ..Far::default()
    };
    examine(&server(noise, 7), "damaged", "A and B");
}

#[test]
fn a_profibus_device_hears_its_master() {
    // The token, and a request of station 2 to station 3 for its diagnosis: SD2, length, addresses with SAPs.
    let body = [0x83, 0x82, 0x6D, 0x3C, 0x3E];
    let sum = body.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    let request = [&[0x68, 5, 5, 0x68][..], &body, &[sum, 0x16]].concat();
    let speech = [&[0xDC, 2, 2][..], &request].concat();
    let (mut far, near) = PseudoTerminal::open().expect("a pseudo-terminal");
    thread::spawn(move || {
        while far.write_all(&speech).is_ok() {
            let _ = far.read_within(&mut [0; 16], Duration::from_millis(10));
        }
    });
    let line = |address: u8| {
        format!(
            "kind = \"profibus-device\"\ndevice = \"{}\"\naddress = {address}\nident = 0x1234",
            near.display()
        )
    };
    let told = examine(&line(3), "ok", "masters 2");
    assert!(told.contains("asks station 3"), "{told}");
    examine(&line(4), "not-asked", "it asks 3");
    examine(
        &line(4).replace(&near.display().to_string(), "/dev/no-such-port"),
        "device-missing",
        "",
    );
}
