//! `tickbus find` and `tickbus doctor` with pymodbus, Snap7 and asyncua at the other end.

use std::net::SocketAddr;
use std::path::Path;
use std::process::{Command, Output};

use crate::harness::{self, Absent, Test};
#[cfg(feature = "opcua")]
use crate::opcua::{free_address, plc};
use crate::{modbus, s7};
#[cfg(feature = "opcua")]
use serde_json::json;

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("the_doctor_and_find_know_pymodbus", pymodbus),
    ("the_doctor_and_find_know_python_snap7", python_snap7),
    ("the_doctor_sees_the_stop_of_snap7_in_c", snap7_in_stop),
    #[cfg(feature = "modbus-tls")]
    (
        "the_doctor_names_what_is_wrong_with_the_tls_of_pymodbus",
        pymodbus_in_tls,
    ),
    #[cfg(feature = "opcua")]
    ("the_doctor_and_find_know_asyncua", asyncua),
    #[cfg(feature = "opcua")]
    (
        "a_server_that_asyncua_names_is_found_if_the_user_has_named_its_address",
        discovery,
    ),
    #[cfg(feature = "opcua")]
    (
        "the_doctor_names_what_a_secured_asyncua_refuses",
        secured_asyncua,
    ),
];

fn tickbus(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    command
        .args(arguments)
        .output()
        .expect("the tickbus program runs")
}

/// Examines a line in this folder; asserts its cause, and that the report has this part.
#[track_caller]
fn examine_in(folder: &Path, fieldbus: &str, signals: &str, cause: &str, part: &str) {
    let file = folder.join("driver.cfg");
    let text = format!("[driver]\nid = 1\nname = \"Rig\"\n[fieldbus]\n{fieldbus}\n{signals}");
    std::fs::write(&file, text).expect("the file is written");
    let output = tickbus(&["doctor", "--watch", "300ms", &file.display().to_string()]);
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(
        told.contains(&format!("\ndoctor: {cause} ")),
        "{cause} in {told}"
    );
    assert!(told.contains(part), "\"{part}\" in {told}");
}

#[track_caller]
fn examine(fieldbus: &str, signals: &str, cause: &str, part: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    examine_in(folder.path(), fieldbus, signals, cause, part);
}

/// Finds the device at this address, with these parts in its row.
#[track_caller]
fn find(address: SocketAddr, parts: &[&str]) {
    let output = tickbus(&["find", &address.to_string()]);
    let told = String::from_utf8_lossy(&output.stdout);
    let row = told
        .lines()
        .find(|row| row.starts_with(&address.to_string()));
    let row = row.unwrap_or_else(|| panic!("{address} in {told}"));
    for part in parts {
        assert!(row.contains(part), "\"{part}\" in {row}");
    }
}

const WORD: &str = "[[signal]]\nname = \"Count\"\naddress = \"%QW0\"\n";

fn pymodbus() -> Result<(), Absent> {
    let (_server, address) = modbus::Server::at_address("tcp")?;
    let line = format!("kind = \"modbus-client\"\naddress = \"{address}\"\n");
    find(address, &["modbus", "ACME PLC 7 1.2"]);
    examine(&line, WORD, "ok", "\"ACME PLC 7 1.2\"");
    let beyond = format!("{line}outputs = \"offset:3000\"");
    examine(&beyond, WORD, "address-refused", "exception 02");
    let other = format!("{line}write_to = \"ACME PLC 8\"");
    let input = WORD.replace("%Q", "%I");
    examine(
        &other,
        &input,
        "identity-differs",
        "write_to = \"ACME PLC 7 1.2\"",
    );
    let (_server, address) = modbus::Server::at_address("rtu-over-tcp")?;
    let line = format!("kind = \"modbus-client\"\naddress = \"{address}\"\n");
    examine(&line, WORD, "wrong-framing", "framing = \"rtu\"");
    examine(
        &format!("{line}framing = \"rtu\""),
        WORD,
        "ok",
        "ACME PLC 7 1.2",
    );
    Ok(())
}

#[cfg(feature = "modbus-tls")]
fn pymodbus_in_tls() -> Result<(), Absent> {
    use crate::modbus_tls::{make_certificates, tls};
    let folder = tempfile::tempdir().expect("a folder");
    make_certificates(folder.path())?;
    let own = folder.path().display().to_string();
    let (_server, secured) = modbus::Server::at_address_with("tls", &[&own])?;
    let (_server, plain) = modbus::Server::at_address("tcp")?;
    let line = |address: SocketAddr, own: &str, authority: &str| {
        let certificates = tls(folder.path(), own, authority, "");
        format!("kind = \"modbus-client\"\naddress = \"{address}\"\n{certificates}")
    };
    examine(
        &line(secured, "operator", "ca"),
        WORD,
        "ok",
        "ACME PLC 7 1.2",
    );
    let bare = format!("kind = \"modbus-client\"\naddress = \"{secured}\"\n");
    examine(&bare, WORD, "tls-expected", "tls");
    examine(
        &line(plain, "operator", "ca"),
        WORD,
        "tls-missing",
        "port 802",
    );
    let strange = line(secured, "operator", "stranger");
    examine(&strange, WORD, "certificate-unknown", "ca_file");
    let stranger = line(secured, "stranger", "ca");
    examine(&stranger, WORD, "certificate-refused", "certificate_file");
    Ok(())
}

fn python_snap7() -> Result<(), Absent> {
    let cpu = s7::Cpu::start(harness::python_with("main", &["snap7"])?, "snap7_server.py");
    let address = SocketAddr::from(([127, 0, 0, 1], cpu.port));
    find(address, &["s7", "6ES7 315-2EH14-0AB0"]);
    let line = |output: &str| {
        format!("kind = \"s7-client\"\naddress = \"{address}\"\noutput = \"{output}\"\n")
    };
    examine(&line("DB1"), WORD, "ok", "6ES7 315-2EH14-0AB0");
    examine(&line("DB9"), WORD, "block-missing", "optimized");
    examine(
        &line("%DB1.DBB600"),
        WORD,
        "block-short",
        "DB1 bytes 600 to 601",
    );
    let modbus = format!("kind = \"modbus-client\"\naddress = \"{address}\"\n");
    examine(&modbus, WORD, "another-bus", "kind = \"s7-client\"");
    Ok(())
}

fn snap7_in_stop() -> Result<(), Absent> {
    let mut cpu = s7::Cpu::start(s7::snap7_in_c()?, "snap7c_server.py");
    let address = SocketAddr::from(([127, 0, 0, 1], cpu.port));
    let line = format!("kind = \"s7-client\"\naddress = \"{address}\"\noutput = \"DB1\"\n");
    find(address, &["s7", "6ES7"]);
    examine(&line, WORD, "ok", "the CPU is in RUN");
    cpu.tell("stop");
    // The line is read by another thread of the CPU.
    for _ in 0..50 {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("driver.cfg");
        let text = format!("[driver]\nid = 1\nname = \"Rig\"\n[fieldbus]\n{line}\n{WORD}");
        std::fs::write(&file, text).expect("the file is written");
        let output = tickbus(&["doctor", "--watch", "10ms", &file.display().to_string()]);
        if String::from_utf8_lossy(&output.stdout).contains("\ndoctor: plc-stop ") {
            return Ok(());
        }
    }
    panic!("the stop is never seen");
}

#[cfg(feature = "opcua")]
fn signal(node: &str, name: &str, data_type: &str) -> String {
    format!(
        "[fieldbus.at]\n\"{name}\" = \"{node}\"\n[[signal]]\nname = \"{name}\"\naddress = \"%QW0\"\ntype = \"{data_type}\"\n"
    )
}

#[cfg(feature = "opcua")]
fn discovery() -> Result<(), Absent> {
    use std::io::BufRead as _;
    use std::process::Stdio;

    let mut command = harness::python_with("main", &["asyncua"])?;
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/opcua_discovery.py"
    );
    let mut servers = command
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("Python runs");
    let mut ports = String::new();
    let stdout = servers.stdout.take().expect("it is piped");
    std::io::BufReader::new(stdout)
        .read_line(&mut ports)
        .expect("a line");
    let mut ports = ports.split_whitespace();
    let (own, other) = (ports.next().expect("two"), ports.next().expect("two"));
    let output = tickbus(&["find", &format!("127.0.0.1:{own}")]);
    let told = String::from_utf8_lossy(&output.stdout);
    let named = format!("127.0.0.1:{own} names opc.tcp://127.0.0.1:{other}/press");
    assert!(told.contains(&named), "{told}");
    let found = format!("127.0.0.1:{other}");
    let row = told.lines().find(|row| row.starts_with(&found));
    assert!(
        row.is_some_and(|row| row.contains("urn:test:press")),
        "{told}"
    );
    drop(servers.stdin.take());
    let _ = servers.wait();
    Ok(())
}

#[cfg(feature = "opcua")]
fn asyncua() -> Result<(), Absent> {
    let address = free_address();
    let mut server = plc(address, &json!({"denied": ["torque"]}))?;
    let line =
        format!("kind = \"opcua-client\"\nurl = \"opc.tcp://{address}\"\nsecurity = \"None\"\n");
    find(address, &["opcua", "urn:test:plc", "\"None\""]);
    examine(
        &line,
        &signal("ns=2;s=speed", "speed", "INT"),
        "ok",
        "urn:test:plc ACME PLC",
    );
    examine(
        &line,
        &signal("ns=2;s=sped", "speed", "INT"),
        "node-unknown",
        "ns=2;s=sped",
    );
    examine(
        &line,
        &signal("ns=1;s=speed", "speed", "INT"),
        "wrong-namespace",
        "namespace 2 has",
    );
    examine(
        &line,
        &signal("ns=7;s=speed", "speed", "INT"),
        "namespace-unknown",
        "nsu=",
    );
    let uri = signal("nsu=urn:nobody;s=speed", "speed", "INT");
    examine(&line, &uri, "namespace-unknown", "urn:nobody");
    examine(
        &line,
        &signal("ns=2;s=speed", "speed", "UINT"),
        "type-differs",
        "Int16",
    );
    let denied = signal("ns=2;s=torque", "torque", "REAL").replace("%QW0", "%QD0");
    examine(&line, &denied, "access-denied", "the right to read");
    // What the driver only writes need not be readable.
    let written = denied.replace("%QD0", "%ID0");
    examine(&line, &written, "ok", "if the driver reads them");
    let secured = line.replace("\"None\"", "\"Basic256Sha256\"");
    examine(
        &secured,
        &signal("ns=2;s=speed", "speed", "INT"),
        "no-endpoint",
        "it has \"None\"",
    );
    // Suspended, by OPC 10000-5, 12.6.
    server.ask(&json!({"state": 3}));
    examine(
        &line,
        &signal("ns=2;s=speed", "speed", "INT"),
        "plc-stop",
        "RUN",
    );
    Ok(())
}

#[cfg(feature = "opcua")]
fn secured_asyncua() -> Result<(), Absent> {
    let address = free_address();
    let folder = tempfile::tempdir().expect("a folder");
    let _server = plc(
        address,
        &json!({"security": ["Basic256Sha256"], "folder": folder.path(), "user": "rig", "password": "swordfish"}),
    )?;
    let line =
        |more: &str| format!("kind = \"opcua-client\"\nurl = \"opc.tcp://{address}\"\n{more}\n");
    let speed = signal("ns=2;s=speed", "speed", "INT");
    let user = "user = \"rig\"\npassword_in_clear = \"swordfish\"\n";
    examine(&line(user), &speed, "certificate-unknown", "trusted");
    let own = folder.path();
    let any = format!("trust = \"any\"\n{user}");
    examine_in(own, &line(&any), &speed, "ok", "\"Basic256Sha256\"");
    let wrong = any.replace("swordfish", "herring");
    examine_in(
        own,
        &line(&wrong),
        &speed,
        "user-refused",
        "the user and the password",
    );
    examine_in(
        own,
        &line("trust = \"any\""),
        &speed,
        "user-required",
        "user",
    );
    Ok(())
}
