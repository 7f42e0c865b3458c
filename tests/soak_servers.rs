//! The soak of the servers: a Modbus, an S7 and an OPC UA server tick side by side, while clients connect, work and
//! leave in every way that a client can: properly, by reset, within a telegram, silently, or sending garbage.
//!
//! The soak takes some seconds by default; `make soak` runs it for minutes or hours. Threads, descriptors and memory
//! must be the same at the end as after the first rounds, every well-behaved client must have been served, and no line
//! may have failed.
#![allow(
    missing_docs,
    unreachable_pub,
    dead_code,
    reason = "a test, which uses a part of the suite's fixtures"
)]

#[path = "soak/common.rs"]
mod common;

use std::io::{Read as _, Write as _};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::{address, assert_all_explained, eventually, rest};
use tickbus::driver::{Code, Driver};
use tickbus::signal::Slot;
use tickbus::time::Nanos;

const SIGNALS: &str = r#"
[[signal]]
name    = "speed"
address = "%QW0"
type    = "INT"

[[signal]]
name    = "run"
address = "%QX2.0"
latch   = "rising"

[[signal]]
name    = "position"
address = "%IW0"
type    = "INT"
"#;

/// Rounds that fill one-time caches, before the counting begins.
const FIRST_ROUNDS: u32 = 5;

fn open(fieldbus: &str) -> (Driver, Vec<Slot>) {
    let text = format!(
        "[driver]\nid = 1\nname = \"soak\"\n[fieldbus]\n{fieldbus}\nmax_age = \"500ms\"\n{SIGNALS}"
    );
    let driver = common::open(&text);
    let slots = driver.initial_slots();
    (driver, slots)
}

/// The end of a client that only sends bytes.
#[derive(Clone, Copy, Debug)]
enum Death {
    Close,
    Reset,
    Half,
    Nonsense,
}

const DEATHS: [Death; 4] = [Death::Close, Death::Reset, Death::Half, Death::Nonsense];

/// A connection that sends `telegram`, receives at least one byte if `answered`, and dies.
fn say(address: SocketAddr, telegram: &[u8], answered: bool, death: Death) {
    let mut stream = common::connect(address);
    stream.write_all(telegram).expect("the server reads");
    if answered {
        let heard = stream.read(&mut [0; 1024]).expect("the server answers");
        assert!(heard > 0, "the server hung up");
    }
    match death {
        Death::Close => {}
        Death::Reset => common::reset(&stream),
        // Sending may fail if the server has already disconnected it.
        Death::Half => drop(stream.write_all(&telegram[..telegram.len() / 2])),
        Death::Nonsense => drop(stream.write_all(&[0xA5; 300])),
    }
}

/// Function 23 of unit 1: one register written, two read.
const MODBUS: [u8; 19] = [0, 1, 0, 0, 0, 13, 1, 23, 0, 0, 0, 2, 0, 0, 0, 1, 2, 0, 42];

fn modbus_clients(address: SocketAddr) {
    for death in DEATHS {
        say(address, &MODBUS, true, death);
    }
    let (mut client, mut slots) = open(&format!(
        "kind = \"modbus-client\"\naddress = \"{address}\"\nrole = \"controller\"\ncycle = \"2ms\""
    ));
    until_fresh(&mut client, &mut slots);
    client.close();
}

/// Exchanges until a client of ours has fresh data from its server.
fn until_fresh(client: &mut Driver, slots: &mut [Slot]) {
    eventually("the client has fresh data", || {
        (client.exchange(Nanos::ZERO, slots).code == Code::Fresh).then_some(())
    });
}

/// A COTP connect request to rack 0, slot 1.
const COTP: [u8; 22] = [
    3, 0, 0, 22, 17, 0xE0, 0, 0, 0, 1, 0, 0xC0, 1, 10, 0xC1, 2, 1, 0, 0xC2, 2, 1, 1,
];

fn s7_clients(address: SocketAddr) {
    for death in DEATHS {
        say(address, &COTP, true, death);
    }
    let mut client = rust7::client::S7Client::new();
    client
        .set_connection_port(address.port())
        .expect("not connected yet");
    client
        .connect_rack_slot(&address.ip().to_string(), 0, 1)
        .expect("connects");
    client
        .write_bit(0x82, 0, 2, 0, true)
        .expect("an output is there");
    assert!(client.read_bit(0x82, 0, 2, 0).expect("an output"));
    client.disconnect();
}

#[cfg(feature = "opcua")]
fn opcua_clients(address: SocketAddr, pki: &std::path::Path) {
    let url = format!("opc.tcp://{address}");
    let mut hello = b"HELF\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0\0\0\0\0\0\0".to_vec();
    hello.extend(u32::try_from(url.len()).expect("short").to_le_bytes());
    hello.extend(url.as_bytes());
    let size = u32::try_from(hello.len()).expect("short");
    hello[4..8].copy_from_slice(&size.to_le_bytes());
    for death in DEATHS {
        say(address, &hello, true, death);
    }
    let (mut client, mut slots) = open(&format!(
        "kind = \"opcua-client\"\nurl = \"{url}\"\nsecurity = \"None\"\nrole = \"controller\"\ncycle = \"5ms\"\n\
         pki = {:?}",
        pki.display().to_string()
    ));
    until_fresh(&mut client, &mut slots);
    client.close();
}

#[test]
fn servers_outlive_all_clients() {
    let end = common::end();
    let folder = tempfile::tempdir().expect("a folder");
    let local = "address = \"127.0.0.1:0\"\ncycle = \"2ms\"";
    let mut servers = vec![
        open(&format!("kind = \"modbus-server\"\n{local}")),
        open(&format!("kind = \"s7-server\"\n{local}")),
    ];
    if cfg!(feature = "opcua") {
        servers.push(open(&format!(
            "kind = \"opcua-server\"\n{local}\nsecurity = \"None\"\nanonymous = true\npki = {:?}",
            folder.path().join("server").display().to_string()
        )));
    }
    let addresses: Vec<_> = servers.iter().map(|(driver, _)| address(driver)).collect();
    let over = AtomicBool::new(false);
    let servers = std::thread::scope(|scope| {
        let ticking = scope.spawn(|| {
            while !over.load(Ordering::Relaxed) {
                for (driver, slots) in &mut servers {
                    driver.exchange(Nanos::ZERO, slots);
                    slots[2] = slots[0];
                }
                std::thread::sleep(Duration::from_micros(200));
            }
            servers
        });
        let (mut round, mut before, mut told) = (0, None, common::Told::new());
        while Instant::now() < end || round < 2 * FIRST_ROUNDS {
            round += 1;
            modbus_clients(addresses[0]);
            s7_clients(addresses[1]);
            #[cfg(feature = "opcua")]
            opcua_clients(addresses[2], &folder.path().join("client"));
            if round == FIRST_ROUNDS {
                before = Some(rest());
            }
            told.tell(|| format!("{round} rounds"));
        }
        let after = rest();
        over.store(true, Ordering::Relaxed);
        println!("soak: {round} rounds, before {before:?}, after {after:?}");
        assert_eq!(before, Some(after), "something piles up");
        ticking.join().expect("no panic")
    });
    for (driver, _) in servers {
        println!("{}", driver.statistics());
        assert_all_explained(&driver);
        driver.close();
    }
}
