//! Peers that die in the middle of an examination.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::peers::{Cpu, server};
use super::{WORD, doctor, s7};

/// The CPU serves as many connections as the steps before the last one need.
#[test]
fn a_cpu_that_dies_in_the_middle_is_no_line_without_failures() {
    let folder = tempfile::tempdir().expect("a folder");
    let served = AtomicUsize::new(0);
    let peer = server(move |stream| {
        if served.fetch_add(1, Ordering::SeqCst) < 2 {
            Cpu::default().talk(stream);
        }
    });
    let (code, told) = doctor(folder.path(), "dies", &s7(peer, "", WORD), &[]);
    assert_eq!(code, Some(3), "{told}");
    assert!(
        told.contains("\n  \"cause\": \"connection-lost\","),
        "{told}"
    );
}

#[cfg(feature = "opcua")]
#[test]
fn an_opcua_server_that_falls_silent_in_the_middle_is_not_asked_for_each_signal() {
    use super::peers::closed;
    use std::io::{Read as _, Write as _};
    use std::process::{Command, Stdio};
    use std::thread;
    use std::time::Duration;

    let folder = tempfile::tempdir().expect("a folder");
    let own = closed();
    let signals: Vec<String> = (0..300)
        .map(|at| {
            format!(
                "[[signal]]\nname = \"s{at}\"\naddress = \"%QW{}\"\n",
                2 * at
            )
        })
        .collect();
    let signals = signals.concat();
    let served = folder.path().join("served.cfg");
    let text = super::file(
        &format!(
            "kind = \"opcua-server\"\naddress = \"{own}\"\nsecurity = \"None\"\nanonymous = true"
        ),
        &signals,
    );
    std::fs::write(&served, text).expect("the file is written");
    let mut rig = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("mirror")
        .arg(&served)
        .stdout(Stdio::null())
        .spawn()
        .expect("the tickbus program runs");
    while std::net::TcpStream::connect(own).is_err() {
        assert!(matches!(rig.try_wait(), Ok(None)), "the server has ended");
        thread::sleep(Duration::from_millis(20));
    }
    let between = server(move |client| {
        let Ok(server) = std::net::TcpStream::connect(own) else {
            return;
        };
        let (mut to, mut from) = (
            server.try_clone().expect("a socket"),
            client.try_clone().expect("a socket"),
        );
        thread::spawn(move || std::io::copy(&mut from, &mut to));
        let (mut from, mut to, mut told) = (server, client, 0);
        let mut bytes = [0; 1024];
        while let Ok(count @ 1..) = from.read(&mut bytes) {
            told += count;
            // The session and some of the signals.
            if told < 12_000 {
                let _ = to.write_all(&bytes[..count]);
            }
        }
    });
    let text = super::file(
        &format!("kind = \"opcua-client\"\nurl = \"opc.tcp://{between}\"\nsecurity = \"None\""),
        &signals,
    );
    let begin = std::time::Instant::now();
    let (code, told) = doctor(folder.path(), "silent", &text, &[]);
    let took = begin.elapsed();
    let _ = rig.kill();
    let _ = rig.wait();
    assert_eq!(code, Some(3), "{told}");
    assert!(
        told.contains("\n  \"cause\": \"connection-lost\","),
        "{told}"
    );
    assert!(took < Duration::from_secs(60), "{took:?}");
}
