//! The socket bus, the dispatcher, Modbus over UDP, elements that can only be written, and Ctrl-C.

use std::io::Write as _;
use std::net::{SocketAddr, UdpSocket};
use std::process::Command;
use std::thread;
use std::time::Duration;

use super::peers::{Registers, closed, mute, server};
use super::{WORD, file, modbus};
use tickbus::fieldbus::modbus::mbap::{self, Telegram};

/// Examines a line; asserts its cause and a part of what is told.
#[track_caller]
fn examine(text: &str, cause: &str, part: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("driver.cfg");
    std::fs::write(&path, text).expect("the file is written");
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["doctor", "--watch", "400ms"])
        .arg(&path)
        .output()
        .expect("the tickbus program runs");
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(
        told.contains(&format!("\ndoctor: {cause} ")) && told.contains(part),
        "{cause} and \"{part}\" in {told}{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

fn socket(address: SocketAddr) -> String {
    file(
        &format!("kind = \"socket\"\nrole_tcp = \"connect\"\naddress = \"{address}\""),
        WORD,
    )
}

/// A peer that sends these bytes again and again.
fn talking(bytes: &'static [u8]) -> SocketAddr {
    server(move |mut stream| {
        while stream.write_all(bytes).is_ok() {
            thread::sleep(Duration::from_millis(20));
        }
    })
}

#[test]
fn the_doctor_hears_whether_a_socket_peer_sends_records() {
    examine(&socket(talking(&[0, 7])), "ok", "records of 2 bytes");
    examine(&socket(server(mute)), "silent", "sends nothing");
    examine(&socket(server(drop)), "connection-lost", "closes");
    examine(&socket(closed()), "port-closed", "nothing listens");
    let listening = "kind = \"socket\"\nrole_tcp = \"listen\"\naddress = \"127.0.0.1:0\"";
    examine(&file(listening, WORD), "ok", "is free");
}

/// A server whose unit 1 has one register, over UDP.
fn datagrams() -> SocketAddr {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let address = socket.local_addr().expect("an address");
    thread::spawn(move || {
        let mut bytes = [0; 300];
        while let Ok((count, from)) = socket.recv_from(&mut bytes) {
            let Ok(Some((request, _))) = Telegram::parse(&bytes[..count]) else {
                continue;
            };
            if request.unit != 1 {
                continue;
            }
            let mut answer = Vec::new();
            mbap::append(request.transaction, 1, &mut answer, |pdu| {
                match request.pdu {
                    [3, _, _, _, 1] => pdu.extend([3, 2, 0, 7]),
                    [code, ..] => pdu.extend([code | 0x80, 1]),
                    [] => {}
                }
            });
            let _ = socket.send_to(&answer, from);
        }
    });
    address
}

#[test]
fn modbus_over_udp_is_examined_and_found() {
    let address = datagrams();
    let udp = |address, further| modbus(address, &format!("framing = \"udp\"\n{further}"), WORD);
    examine(&udp(address, ""), "ok", "all signals can be read");
    examine(&udp(address, "unit = 9"), "silent", "the unit");
    let gone = UdpSocket::bind("127.0.0.1:0").and_then(|socket| socket.local_addr());
    examine(&udp(gone.expect("a port"), ""), "port-closed", "UDP port");

    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["find", "--udp", "--cfg", "--bus", "modbus"])
        .arg(address.to_string())
        .output()
        .expect("the tickbus program runs");
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("unit 1, over UDP"), "{told}");
    assert!(told.contains("framing = \"udp\""), "{told}");
}

#[test]
fn an_element_that_can_only_be_written_is_no_failure() {
    let device = Registers {
        words: vec![0],
        ..Registers::default()
    };
    // The second register can be written and not read.
    let both = format!("{WORD}[[signal]]\nname = \"Jam\"\naddress = \"%IW0\"\n");
    let text = modbus(
        device.serve(),
        "inputs = \"holding-register:40\"\nmax_age = \"5s\"",
        &both,
    );
    examine(&text, "write-only", "only be written");
}

#[test]
fn the_doctor_asks_a_dispatcher_who_is_there() {
    let mut dispatcher = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["dispatch", "--listen", "127.0.0.1:0", "--patch"])
        .arg(std::env::temp_dir().join(format!("doctor-{}.toml", std::process::id())))
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("the tickbus program runs");
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(
        dispatcher.stdout.take().expect("it is piped"),
    ));
    let address = lines.find_map(|line| {
        let line = line.ok()?;
        let (_, address) = line.split_once("listening on ")?;
        address.trim().parse::<SocketAddr>().ok()
    });
    let address = address.expect("an address");
    let text = |further: &str| {
        file(
            &format!("kind = \"dispatcher\"\naddress = \"{address}\"\nname = \"PUMP\"\n{further}"),
            WORD,
        )
    };
    examine(&text(""), "ok", "the name \"PUMP\" is free");
    examine(
        &text("connect = [\"AI1:TANK:AQ2\"]"),
        "peer-missing",
        "AI1:TANK:AQ2",
    );
    let mut other = std::net::TcpStream::connect(address).expect("it listens");
    other
        .write_all(b"VP PUMP Q00 I00 AQ00 AI00 V=2\r\n")
        .expect("it reads");
    std::io::Read::read(&mut other, &mut [0; 64]).expect("it answers");
    examine(&text(""), "name-taken", "end it");
    let _ = dispatcher.kill();
    let _ = dispatcher.wait();
    let stranger = format!(
        "kind = \"dispatcher\"\naddress = \"{}\"\nname = \"PUMP\"",
        server(mute)
    );
    examine(&file(&stranger, WORD), "silent", "tickbus dispatch");
}

/// Ctrl-C during `--wait` ends the wait, and the steps so far are printed.
#[cfg(unix)]
#[test]
fn a_wait_that_ctrl_c_ends_prints_the_steps_so_far() {
    use rustix::process::{Pid, Signal, kill_process};

    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("driver.cfg");
    let server = format!("kind = \"modbus-server\"\naddress = \"{}\"", closed());
    std::fs::write(&path, file(&server, WORD)).expect("the file is written");
    let doctor = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["doctor", "--wait", "10min"])
        .arg(&path)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the tickbus program runs");
    let address: SocketAddr = server
        .rsplit('"')
        .nth(1)
        .and_then(|address| address.parse().ok())
        .expect("an address");
    // It waits once it serves.
    while std::net::TcpStream::connect(address).is_err() {
        thread::sleep(Duration::from_millis(20));
    }
    kill_process(Pid::from_child(&doctor), Signal::INT).expect("it runs");
    let output = doctor.wait_with_output().expect("it ends");
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("ok    port"), "{told}");
    assert!(told.contains("client"), "{told}");
    assert!(!told.contains("10min"), "{told}");
}
