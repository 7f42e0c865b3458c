//! The Modbus buses over UDP and as ASCII, with pymodbus at the other end.
#![allow(missing_docs, clippy::float_cmp, reason = "a test")]

use std::net::UdpSocket;

use crate::harness::{Absent, Test};
use crate::modbus::{ALLOWED, Mirror as _, Server, loop_through, open, pymodbus, signals};
#[cfg(unix)]
use crate::pty;
use tickbus::fieldbus::LinkState;
#[cfg(unix)]
use tickbus_conformance::rig::statistic;

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("pymodbus_drives_our_server_over_udp", pymodbus_over_udp),
    ("our_client_drives_pymodbus_over_udp", our_client_over_udp),
    #[cfg(unix)]
    (
        "pymodbus_drives_our_server_as_ascii_on_a_serial_line",
        pymodbus_drives_our_server_as_ascii,
    ),
    #[cfg(unix)]
    (
        "our_client_drives_pymodbus_as_ascii_on_a_serial_line",
        our_client_drives_pymodbus_as_ascii,
    ),
];

fn pymodbus_over_udp() -> Result<(), Absent> {
    let mut client = pymodbus("modbus_client.py")?;
    let server =
        "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nframing = \"udp\"\nmax_age = \"1h\"";
    let mut machine = open(server, &signals());
    let address = machine.address();
    client.args([
        "udp",
        &address.ip().to_string(),
        &address.port().to_string(),
    ]);
    let told = machine.mirror_until_the_end_of(client);
    assert!(told.contains("modbus_client: ok checks="), "{told}");
    machine.until("the last write is through", |machine| {
        machine.get("cdab") != 0.0
    });
    assert_eq!((machine.get("abcd"), machine.get("cdab")), (1234.5, -0.125));
    Ok(())
}

fn our_client_over_udp() -> Result<(), Absent> {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    let address = socket.local_addr().expect("it is bound");
    drop(socket);
    let (ip, port) = (address.ip().to_string(), address.port().to_string());
    let server = Server::start(&["udp", &ip, &port])?;
    let client = format!(
        "kind = \"modbus-client\"\naddress = \"{address}\"\nframing = \"udp\"\n{ALLOWED}\n"
    );
    for (keys, count) in [
        ("inputs = \"offset:0\"", 64),
        ("inputs = \"offset:1000\"\noutputs = \"401001\"", 300),
        ("inputs = \"coil:1\"\noutputs = \"coil:1\"", 10),
    ] {
        let machine = loop_through(&format!("{client}{keys}"), count);
        machine.end.driver.close();
    }
    // The server dies and is restarted.
    let mut machine = loop_through(&format!("{client}inputs = \"offset:0\""), 4);
    drop(server);
    machine.until("the line is lost", |machine| {
        machine.driver.link().state != LinkState::Running
    });
    let _server = Server::start(&["udp", &ip, &port])?;
    machine.set("i 0", 99.0);
    machine.until("the value is back", |machine| machine.get("q 0") == 99.0);
    Ok(())
}

#[cfg(unix)]
fn as_ascii(end: &str, device: &std::path::Path) -> String {
    let device = device.display();
    format!(
        "kind = \"modbus-{end}\"\nmax_age = \"1h\"\ndevice = \"{device}\"\nframing = \"ascii\"\nbaud = 115200\n"
    )
}

#[cfg(unix)]
fn pymodbus_drives_our_server_as_ascii() -> Result<(), Absent> {
    let mut client = pymodbus("modbus_client.py")?;
    let line = pty::Line::new();
    let mut machine = open(&as_ascii("server", line.end(0)), &signals());
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    client.arg("ascii").arg(line.end(1));
    let told = machine.mirror_until_the_end_of(client);
    assert!(told.contains("modbus_client: ok checks="), "{told}");
    assert_eq!(machine.get("abcd"), 1234.5);
    Ok(())
}

#[cfg(unix)]
fn our_client_drives_pymodbus_as_ascii() -> Result<(), Absent> {
    let line = pty::Line::new();
    let device = line.end(1).display().to_string();
    let _server = Server::start(&["ascii", &device])?;
    let client = format!("{}{ALLOWED}\n", as_ascii("client", line.end(0)));
    for (keys, count) in [
        ("inputs = \"offset:0\"", 64),
        ("inputs = \"coil:1\"\noutputs = \"coil:1\"", 10),
    ] {
        let machine = loop_through(&format!("{client}{keys}"), count);
        machine.end.driver.close();
    }
    Ok(())
}
