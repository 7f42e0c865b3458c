//! `tickbus doctor` names the true cause of prepared faults.

mod dying;
mod lines;
pub(crate) mod peers;
#[cfg(target_os = "linux")]
mod serial;

use std::net::SocketAddr;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::Duration;

use peers::{Cpu, Registers, closed, filtered, mute, says, server};
use tickbus::fieldbus::s7::item::ReturnCode;

/// A prepared fault.
struct Fault {
    name: &'static str,
    /// The cause that has to be named.
    cause: &'static str,
    /// A part of what to do next.
    next: &'static str,
    file: String,
    arguments: &'static [&'static str],
}

const REALS: &str = "[[signal]]\nname = \"Level\"\naddress = \"%QD0\"\ntype = \"REAL\"\n\
                     [[signal]]\nname = \"Flow\"\naddress = \"%QD4\"\ntype = \"REAL\"\n\
                     [[signal]]\nname = \"Weight\"\naddress = \"%QD8\"\ntype = \"REAL\"\n";

const WORD: &str = "[[signal]]\nname = \"Life\"\naddress = \"%QW0\"\n";

const ANSWER_WORD: &str = "[[signal]]\nname = \"Jam\"\naddress = \"%IW0\"\n";

/// A driver.cfg whose data are old late, for busy computers, unless the table says when.
fn file(fieldbus: &str, signals: &str) -> String {
    let age = if fieldbus.contains("max_age") {
        ""
    } else {
        "max_age = \"5s\"\n"
    };
    format!("[driver]\nid = 1\nname = \"Rig\"\n[fieldbus]\n{age}{fieldbus}\n{signals}")
}

fn modbus(address: SocketAddr, further: &str, signals: &str) -> String {
    modbus_at(&address.to_string(), further, signals)
}

fn modbus_at(address: &str, further: &str, signals: &str) -> String {
    file(
        &format!("kind = \"modbus-client\"\naddress = \"{address}\"\n{further}"),
        signals,
    )
}

fn s7(address: SocketAddr, further: &str, signals: &str) -> String {
    file(
        &format!("kind = \"s7-client\"\naddress = \"{address}\"\noutput = \"DB1\"\n{further}"),
        signals,
    )
}

/// The registers of these numbers, high word first.
fn words(values: &[f32]) -> Vec<u16> {
    let halves = values.iter().map(|value| value.to_bits().to_be_bytes());
    halves
        .flat_map(|[a, b, c, d]| [u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d])])
        .collect()
}

const VALUES: [f32; 3] = [21.37, 0.73, 1500.53];

/// A server kind with a free port, and a client that sends this request to it until it is answered or the test ends.
fn asked(further: &str, signals: &str, request: &'static [u8]) -> String {
    let address = closed();
    thread::spawn(move || {
        use std::io::{Read as _, Write as _};
        loop {
            if let Ok(mut plc) = std::net::TcpStream::connect(address) {
                let _ = plc.write_all(request);
                let _ = plc.set_read_timeout(Some(Duration::from_secs(1)));
                let _ = plc.read(&mut [0; 16]);
            }
            thread::sleep(Duration::from_millis(50));
        }
    });
    let kind = format!("kind = \"modbus-server\"\naddress = \"{address}\"\n{further}");
    file(&kind, signals)
}

/// A name that no look-up finds, and that is never asked for on a network: its label has one letter too many for DNS.
fn no_name() -> String {
    format!("{}:502", "p".repeat(64))
}

#[allow(clippy::too_many_lines, reason = "a table")]
fn faults() -> Vec<Fault> {
    let fault = |name, cause, next, file| Fault {
        name,
        cause,
        next,
        file,
        arguments: &[],
    };
    let registers = Registers::default;
    let cpu = Cpu::default;
    let reals = |words: Vec<u16>| {
        modbus(
            Registers {
                words,
                ..registers()
            }
            .serve(),
            "",
            REALS,
        )
    };
    let occupied = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let taken = occupied.local_addr().expect("an address");
    std::mem::forget(occupied);
    let single = Registers {
        most: 1,
        ..registers()
    }
    .serve();
    std::mem::forget(std::net::TcpStream::connect(single).expect("the first client"));
    let mut shifted = vec![0];
    shifted.extend(words(&VALUES));
    shifted.extend([0; 9]);
    let swapped: Vec<u16> = words(&VALUES)
        .chunks(2)
        .flat_map(|pair| [pair[1], pair[0]])
        .collect();
    let reversed = words(&VALUES)
        .iter()
        .map(|word| word.swap_bytes())
        .collect();
    let with_tail = |words: Vec<u16>| [words, vec![0; 20]].concat();
    let table = |words: usize| vec![0; words];
    let mut faults = vec![
        fault(
            "unknown name",
            "name-unknown",
            "IP address",
            modbus_at(&no_name(), "", WORD),
        ),
        fault(
            "port closed",
            "port-closed",
            "server in the PLC",
            modbus(closed(), "", WORD),
        ),
        fault(
            "says nothing",
            "silent",
            "Modbus server",
            modbus(server(mute), "", WORD),
        ),
        fault(
            "second master",
            "connection-limit",
            "another client",
            modbus(single, "", WORD),
        ),
        fault(
            "another unit, others silent",
            "wrong-unit",
            "write unit = 3",
            modbus(
                Registers {
                    unit: Some(3),
                    ..registers()
                }
                .serve(),
                "unit = 7",
                WORD,
            ),
        ),
        fault(
            "another unit behind a gateway",
            "wrong-unit",
            "write unit = 2",
            modbus(
                Registers {
                    unit: Some(2),
                    others: Some(0x0B),
                    ..registers()
                }
                .serve(),
                "unit = 7",
                WORD,
            ),
        ),
        fault(
            "no unit behind a gateway",
            "gateway-no-answer",
            "its supply",
            modbus(
                Registers {
                    unit: Some(99),
                    others: Some(0x0B),
                    ..registers()
                }
                .serve(),
                "unit = 7",
                WORD,
            ),
        ),
        fault(
            "RTU over TCP",
            "wrong-framing",
            "framing = \"rtu\"",
            modbus(
                Registers {
                    is_rtu: true,
                    ..registers()
                }
                .serve(),
                "",
                WORD,
            ),
        ),
        fault(
            "a web server",
            "not-modbus",
            "HTTP",
            modbus(says(b"HTTP/1.1 400 Bad Request\r\n\r\n"), "", WORD),
        ),
        fault(
            "an S7 CPU",
            "not-modbus",
            "ISO on TCP",
            modbus(says(&[3, 0, 0, 7, 2, 0xF0, 0x80]), "", WORD),
        ),
        fault(
            "TLS expected",
            "tls-expected",
            "tls",
            modbus(says(&[0x15, 3, 1, 0, 2, 2, 40]), "", WORD),
        ),
        fault(
            "no such function",
            "function-refused",
            "holding-register",
            modbus(
                Registers {
                    functions: &[3],
                    ..registers()
                }
                .serve(),
                "outputs = \"input-register:1\"",
                WORD,
            ),
        ),
        fault(
            "table too short",
            "address-refused",
            "enlarge",
            modbus(
                Registers {
                    words: table(3),
                    ..registers()
                }
                .serve(),
                "",
                REALS,
            ),
        ),
        fault(
            "counted from 1",
            "off-by-one",
            "count from 1",
            modbus(
                Registers {
                    words: table(8),
                    ..registers()
                }
                .serve(),
                "outputs = \"offset:3\"",
                REALS,
            ),
        ),
        fault(
            "words swapped",
            "word-order",
            "CDAB",
            reals(with_tail(swapped)),
        ),
        fault(
            "bytes swapped",
            "byte-order",
            "BADC",
            reals(with_tail(reversed)),
        ),
        fault(
            "values one further",
            "off-by-one",
            "one too low",
            reals(shifted),
        ),
        fault(
            "life sign stands still",
            "life-sign-still",
            "RUN",
            modbus(
                registers().serve(),
                "alive = { signal = \"Life\", within = \"200ms\" }",
                WORD,
            ),
        ),
        fault(
            "answers too late",
            "too-slow",
            "max_age",
            modbus(
                Registers {
                    delay: Duration::from_millis(120),
                    ..registers()
                }
                .serve(),
                "max_age = \"50ms\"\ncycle = \"10ms\"",
                WORD,
            ),
        ),
        fault(
            "another device",
            "identity-differs",
            "write_to",
            modbus(
                registers().serve(),
                "write_to = \"ACME PLC 7\"",
                ANSWER_WORD,
            ),
        ),
        fault(
            "closes at a register",
            "connection-lost",
            "read less",
            modbus(
                Registers {
                    trap: Some(4),
                    ..registers()
                }
                .serve(),
                "",
                REALS,
            ),
        ),
        fault(
            "another slot",
            "wrong-slot",
            "slot = 2",
            s7(
                Cpu {
                    slot: Some(2),
                    ..cpu()
                }
                .serve(),
                "",
                WORD,
            ),
        ),
        fault(
            "PUT/GET not allowed",
            "put-get",
            "PUT/GET",
            s7(
                Cpu {
                    error: Some(0x8104),
                    ..cpu()
                }
                .serve(),
                "",
                WORD,
            ),
        ),
        fault(
            "protection level",
            "protection-level",
            "full access",
            s7(
                Cpu {
                    error: Some(0xD241),
                    ..cpu()
                }
                .serve(),
                "",
                WORD,
            ),
        ),
        fault(
            "no such block",
            "block-missing",
            "optimized",
            s7(
                Cpu {
                    code: Some(ReturnCode::MISSING),
                    ..cpu()
                }
                .serve(),
                "",
                WORD,
            ),
        ),
        fault(
            "block too short",
            "block-short",
            "shorter",
            s7(
                Cpu {
                    block: vec![0; 6],
                    ..cpu()
                }
                .serve(),
                "",
                REALS,
            ),
        ),
        fault(
            "block protected",
            "access-denied",
            "full access",
            s7(
                Cpu {
                    code: Some(ReturnCode::ACCESS),
                    ..cpu()
                }
                .serve(),
                "",
                WORD,
            ),
        ),
        fault(
            "CPU in STOP",
            "plc-stop",
            "RUN",
            s7(
                Cpu {
                    is_stopped: true,
                    ..cpu()
                }
                .serve(),
                "",
                WORD,
            ),
        ),
        fault(
            "no CPU at all",
            "not-s7",
            "102",
            s7(says(b"HTTP/1.1 400 Bad Request\r\n\r\n"), "", WORD),
        ),
        fault(
            "no connection left",
            "connection-limit",
            "connections",
            s7(server(drop), "", WORD),
        ),
        fault(
            "no CPU that speaks",
            "silent",
            "listens",
            s7(server(mute), "", WORD),
        ),
        fault(
            "port taken",
            "port-taken",
            "another program",
            file(
                &format!("kind = \"modbus-server\"\naddress = \"{taken}\""),
                WORD,
            ),
        ),
        fault(
            "address of another computer",
            "address-not-here",
            "network card",
            file(
                "kind = \"s7-server\"\naddress = \"198.51.100.1:1102\"",
                WORD,
            ),
        ),
        Fault {
            arguments: &["--wait", "300ms"],
            ..fault(
                "nobody connects",
                "nobody-connects",
                "firewall",
                file(
                    &format!("kind = \"modbus-server\"\naddress = \"{}\"", closed()),
                    WORD,
                ),
            )
        },
        Fault {
            arguments: &["--wait", "2s"],
            ..fault(
                "the PLC asks another unit",
                "wrong-unit",
                "same unit",
                asked("unit = 5", WORD, &[0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1]),
            )
        },
        Fault {
            arguments: &["--wait", "2s"],
            ..fault(
                "the PLC asks for elements that are not there",
                "address-refused",
                "tickbus check",
                asked("", WORD, &[0, 1, 0, 0, 0, 6, 1, 3, 0x7F, 0, 0, 1]),
            )
        },
    ];
    if cfg!(target_os = "linux") {
        let next = "firewalls";
        faults.push(fault(
            "firewall drops",
            "port-filtered",
            next,
            modbus(filtered(), "", WORD),
        ));
    }
    if cfg!(feature = "opcua") {
        let opcua = |address: SocketAddr| {
            let bus = format!(
                "kind = \"opcua-client\"\nurl = \"opc.tcp://{address}\"\nsecurity = \"None\""
            );
            file(&bus, WORD)
        };
        let busy: &[u8] = &[
            b'E', b'R', b'R', b'F', 16, 0, 0, 0, 0, 0, 0x7D, 0x80, 0, 0, 0, 0,
        ];
        faults.extend([
            fault(
                "no OPC UA",
                "not-opcua",
                "4840",
                opcua(says(b"HTTP/1.1 400 Bad Request\r\n\r\n")),
            ),
            fault(
                "OPC UA server full",
                "connection-limit",
                "other clients",
                opcua(says(busy)),
            ),
            fault(
                "no OPC UA server that speaks",
                "silent",
                "busy",
                opcua(server(mute)),
            ),
        ]);
    }
    faults
}

/// Runs `tickbus doctor`, and returns its exit code and its document.
fn doctor(folder: &Path, name: &str, text: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let file = folder.join(format!("{}.cfg", name.replace('/', " ")));
    std::fs::write(&file, text).expect("the file is written");
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["doctor", "--json", "--watch", "500ms"])
        .args(arguments)
        .arg(file)
        .output()
        .expect("the tickbus program runs");
    (
        output.status.code(),
        String::from_utf8_lossy(&output.stdout).into_owned(),
    )
}

#[test]
fn the_true_cause_of_every_prepared_fault_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let faults = faults();
    assert!(faults.len() >= 30, "{}", faults.len());
    let folder = folder.path();
    let verdict = |fault: &Fault| {
        let (code, told) = doctor(folder, fault.name, &fault.file, fault.arguments);
        let cause = format!("  \"cause\": \"{}\",", fault.cause);
        let is_warning = ["word-order", "byte-order"].contains(&fault.cause)
            || told.contains("\"verdict\": \"warn\"") && !told.contains("\"verdict\": \"fail\"");
        let expected = if is_warning { 0 } else { 3 };
        let is_right = told.contains(&format!("\n{cause}\n"))
            && told.replace("\\\"", "\"").contains(fault.next)
            && code == Some(expected);
        (!is_right).then(|| {
            format!(
                "{}: {} not named, or not \"{}\": {code:?} {told}",
                fault.name, fault.cause, fault.next
            )
        })
    };
    let wrong: Vec<String> = thread::scope(|scope| {
        let runs: Vec<_> = faults
            .iter()
            .map(|fault| scope.spawn(|| verdict(fault)))
            .collect();
        runs.into_iter()
            .filter_map(|run| run.join().expect("it runs"))
            .collect()
    });
    let count = faults.len();
    assert!(
        wrong.is_empty(),
        "{} of {count}:\n{}",
        wrong.len(),
        wrong.join("\n\n")
    );
}

#[test]
fn a_line_that_is_as_it_should_be_has_no_failures() {
    let folder = tempfile::tempdir().expect("a folder");
    let modbus_words = Registers {
        words: [vec![0], words(&VALUES), vec![0; 3]].concat(),
        counts: true,
        ..Registers::default()
    };
    let life = format!(
        "{WORD}{}",
        REALS
            .replace("%QD8", "%QD10")
            .replace("%QD4", "%QD6")
            .replace("%QD0", "%QD2")
    );
    let alive =
        "alive = { signal = \"Life\", within = \"200ms\" }\noutputs = \"holding-register:1\"";
    let block = words(&VALUES)
        .iter()
        .flat_map(|word| word.to_be_bytes())
        .collect();
    for (name, text) in [
        ("modbus", modbus(modbus_words.serve(), alive, &life)),
        (
            "s7",
            s7(
                Cpu {
                    block,
                    ..Cpu::default()
                }
                .serve(),
                "",
                REALS,
            ),
        ),
    ] {
        let (code, told) = doctor(folder.path(), name, &text, &[]);
        assert_eq!(code, Some(0), "{name}: {told}");
        assert!(told.contains("  \"cause\": null,"), "{name}: {told}");
        for step in [
            "file",
            "name",
            "route",
            "port",
            "protocol",
            "identity",
            "sizes",
            "addresses",
            "values",
            "age",
        ] {
            assert!(
                told.contains(&format!("\"step\": \"{step}\"")),
                "{step} in {told}"
            );
        }
    }
}

#[test]
fn a_wrong_file_has_its_mistakes_and_texts_of_a_peer_are_text() {
    let folder = tempfile::tempdir().expect("a folder");
    let (code, told) = doctor(folder.path(), "wrong", "[driver]\nid = 1\n", &[]);
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("\"right\""), "{told}");
    let peer = says(b"\x1b]0;owned\x07\x1b[31m");
    let file = folder.path().join("x.cfg");
    std::fs::write(&file, modbus(peer, "", WORD)).expect("the file is written");
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("doctor")
        .arg(file)
        .output();
    let told = output.expect("the tickbus program runs").stdout;
    assert!(!told.contains(&0x1B), "{}", String::from_utf8_lossy(&told));
}
