//! `tickbus find` on a network of loopback addresses.

use std::net::TcpListener;
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

#[cfg(target_os = "linux")]
use super::doctor::peers::filtered_at;
use super::doctor::peers::{Cpu, Registers, server_at};

fn find(arguments: &[String]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    command.arg("find").args(arguments);
    command.output().expect("the tickbus program runs")
}

/// A port that is free at all loopback addresses that the test uses.
fn free_port() -> u16 {
    let probe = TcpListener::bind("0.0.0.0:0").expect("a free port");
    probe.local_addr().expect("an address").port()
}

/// The loopback network has all addresses on Linux only.
#[cfg(target_os = "linux")]
#[test]
fn twenty_servers_in_a_network_are_found_within_five_seconds_and_silent_addresses_get_few_packets()
{
    let port = free_port();
    let at = |last: u8| format!("127.20.7.{last}:{port}");
    for last in 10..20 {
        let words = vec![0; 10];
        // Every second one has a unit of its own, as behind a gateway.
        let unit = (last % 2 == 0).then_some(255);
        Registers {
            unit,
            words,
            ..Registers::default()
        }
        .serve_at(&at(last));
    }
    for last in 100..110 {
        let slot = (last % 2 == 0).then_some(2);
        Cpu {
            slot,
            ..Cpu::default()
        }
        .serve_at(&at(last));
    }
    let (connections, bytes) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    server_at(&at(200), {
        let (connections, bytes) = (Arc::clone(&connections), Arc::clone(&bytes));
        move |mut stream| {
            use std::io::Read as _;
            connections.fetch_add(1, Ordering::SeqCst);
            let mut into = [0; 512];
            while let Ok(count @ 1..) = stream.read(&mut into) {
                bytes.fetch_add(count, Ordering::SeqCst);
            }
        }
    });
    let begin = Instant::now();
    let port = port.to_string();
    let arguments = ["127.20.7.0/24", "--bus", "modbus,s7", "--port", &port].map(str::to_owned);
    let output = find(&arguments);
    let took = begin.elapsed();
    let told = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{told}");
    for last in (10..20).chain(100..110) {
        let (bus, further) = match last {
            10..20 if last % 2 == 0 => ("modbus", "unit 255"),
            10..20 => ("modbus", "unit 1"),
            _ if last % 2 == 0 => ("s7", "rack 0, slot 2"),
            _ => ("s7", "rack 0, slot 1"),
        };
        let row = told
            .lines()
            .find(|row| row.starts_with(&format!("{} ", at_of(last, &port))));
        let row = row.unwrap_or_else(|| panic!("{last} in {told}"));
        assert!(row.contains(bus) && row.contains(further), "{row}");
        assert!(bus != "s7" || row.contains("tickbus Press"), "{row}");
    }
    assert!(
        told.contains("find: devices=20 tried=254 refused=233 "),
        "{told}"
    );
    assert!(took < Duration::from_secs(5), "{took:?}\n{told}");
    // Of an address without any answer each attempt is one packet. One that accepts gets a few connections more.
    assert!(connections.load(Ordering::SeqCst) <= 5, "{connections:?}");
    assert!(bytes.load(Ordering::SeqCst) <= 200, "{bytes:?}");
}

/// 254 addresses at three ports, none of which answers: each attempt is one packet, as systems repeat it after a second.
#[cfg(target_os = "linux")]
#[test]
fn a_network_in_which_nobody_answers_takes_less_than_five_seconds_and_one_packet_per_port() {
    let ports = [(); 3].map(|()| filtered_at("0.0.0.0:0").port());
    let ranges = ports.map(|port| format!("127.20.9.1-254:{port}"));
    let begin = Instant::now();
    let output = find(&ranges);
    let took = begin.elapsed();
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(
        told.contains("devices=0 tried=762 refused=0 silent=762"),
        "{told}"
    );
    assert!(took < Duration::from_secs(5), "{took:?}");
    assert_eq!(output.status.code(), Some(3));
}

/// Addresses that accept connections and say nothing take files for a while.
#[cfg(target_os = "linux")]
#[test]
fn a_process_that_may_have_few_files_open_finds_the_same() {
    let port = free_port();
    let mut held = Vec::new();
    for last in 1..=60 {
        held.push(TcpListener::bind(format!("127.20.8.{last}:{port}")).expect("a port"));
    }
    Cpu::default().serve_at(&format!("127.20.8.61:{port}"));
    let few = "ulimit -n 64; exec \"$0\" find --bus s7 \"$1\"";
    let output = Command::new("sh")
        .args(["-c", few, env!("CARGO_BIN_EXE_tickbus")])
        .arg(format!("127.20.8.1-61:{port}"))
        .output()
        .expect("the tickbus program runs");
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(
        told.contains("find: devices=1 tried=61 refused=0 silent=0 unreachable=0"),
        "{told}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(told.contains("50 more ports accept connections"), "{told}");
}

fn at_of(last: u8, port: &str) -> String {
    format!("127.20.7.{last}:{port}")
}

#[test]
fn a_device_comes_with_its_table_and_as_json() {
    let modbus = Registers::default().serve().to_string();
    let output = find(&[modbus.clone(), "--cfg".to_owned()]);
    let told = String::from_utf8_lossy(&output.stdout);
    let table =
        format!("[fieldbus]\nkind    = \"modbus-client\"\naddress = \"{modbus}\"\nunit    = 1\n");
    assert!(told.contains(&table), "{told}");
    let s7 = Cpu::default().serve().to_string();
    let output = find(&[s7, "--json".to_owned()]);
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("\"identity\": \"tickbus Press\""), "{told}");
    assert!(told.contains("\"slot\": \"1\""), "{told}");
}

#[test]
fn nobody_is_exit_code_3_and_a_wrong_target_is_2() {
    let closed = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = closed.local_addr().expect("an address").to_string();
    drop(closed);
    let output = find(&[address]);
    assert_eq!(output.status.code(), Some(3));
    for (wrong, part) in [
        ("10.0.0.0/4", "65,536"),
        ("10.0.0.9-5", "before"),
        ("10.0.0.256", "IPv4"),
    ] {
        let output = find(&[wrong.to_owned()]);
        assert_eq!(output.status.code(), Some(2), "{wrong}");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(told.contains(part), "{told}");
    }
    let output = find(&[]);
    assert_eq!(
        output.status.code(),
        Some(2),
        "no network is searched that nobody has named"
    );
}
