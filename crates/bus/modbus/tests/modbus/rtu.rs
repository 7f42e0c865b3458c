//! RTU telegrams, over TCP and on a line.

use std::io::{Read as _, Write as _};
use std::time::Duration;

use super::conformance::peers::{Alone, client, is_closed};
use super::conformance::rig::{await_that, config, pass};
use super::ends::rtu_request;
#[cfg(unix)]
use super::{AnyPort, pty};

/// This end is two of several units behind one device server.
#[test]
fn rtu_over_tcp_is_served_as_on_a_serial_line() {
    let mut device = Alone::open(
        "[driver]\nid = 1\nname = \"device\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n\
         framing = \"rtu\"\n[[station]]\nname = \"a\"\nunit = 3\n[[station]]\nname = \"b\"\nunit = 7\n\
         [[signal]]\nname = \"press\"\nstation = \"a\"\naddress = \"%QW0\"\n\
         [[signal]]\nname = \"oven\"\nstation = \"b\"\naddress = \"%QW0\"\n",
        &crate::KINDS,
    );
    device.end.tick();
    let mut honest = client(device.address());
    let mut is_answered = |requests: &[u8], expected: &[u8]| {
        honest.write_all(requests).expect("the server reads");
        let mut answer = vec![0; expected.len()];
        honest.read_exact(&mut answer).expect("an answer");
        assert_eq!(answer, expected);
    };
    let [five, six, nine] = [(3, 5), (7, 6), (7, 9)].map(|(unit, value)| {
        let pdu = [6, 0, 0, 0, value];
        rtu_request(unit, &pdu)
    });
    // Units of another device, and the broadcast, are not answered.
    let others = rtu_request(4, &[6, 0, 0, 0, 8]);
    is_answered(
        &[&five[..], &others, &six].concat(),
        &[&five[..], &six].concat(),
    );
    device.until("both have theirs", |end| {
        end.get("press") == 5.0 && end.get("oven") == 6.0
    });
    let all = rtu_request(0, &[6, 0, 0, 0, 2]);
    is_answered(&[&all[..], &nine].concat(), &nine);
    device.until("both have the broadcast", |end| {
        end.get("press") == 2.0 && end.get("oven") == 9.0
    });
    assert_eq!(device.end.statistic("modbus-server.unknown_unit"), "1");
    // A function that is refused, in pieces.
    let refused = rtu_request(3, &[0x91, 1]);
    let (begin, end) = (&rtu_request(3, &[17])[..2], &rtu_request(3, &[17])[2..]);
    is_answered(begin, &[]);
    is_answered(end, &refused);
    let mut damaged = five.clone();
    damaged[5] ^= 1;
    for (dropped, bytes) in [("1", &damaged[..]), ("2", &[3, 66])] {
        let mut liar = client(device.address());
        liar.write_all(bytes).expect("the server reads");
        await_that("it is disconnected", || is_closed(&liar));
        is_answered(&five, &five);
        assert_eq!(device.end.statistic("clients.dropped"), dropped);
    }
    honest.write_all(&damaged).expect("the server reads");
    device.until("the reason is known", |end| {
        end.link()
            .reason
            .contains("its telegram has a wrong checksum")
    });
}

/// A line whose receiver stays enabled while sending.
#[cfg(unix)]
#[test]
fn a_server_on_a_line_that_echoes_answers_each_request_once() {
    let line = pty::Line::new();
    // A slow line, because the test's clock runs faster than the pseudo-terminal.
    let slow = "unit = 1\necho = true\nbaud = 50\nsilence = \"1ms\"";
    // That clock goes on while a busy computer does not let the bus look at its line: what it then finds is not old.
    let config =
        config(&AnyPort, "device", slow).replace("max_age = \"300ms\"", "max_age = \"1h\"");
    assert!(config.contains("1h"), "{config}");
    let serial = format!("device = \"{}\"", line.end(0).display());
    let mut device = Alone::open(
        &config.replace("address = \"127.0.0.1:0\"", &serial),
        &crate::KINDS,
    );
    device.until("it listens", |end| {
        end.driver.statistics().contains("\ndevice=")
    });
    let mut master = std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(line.end(1))
        .expect("the other end");
    for speed in [5_u8, 6, 6, 7] {
        let request = rtu_request(1, &[6, 0, 1, 0, speed]);
        master.write_all(&request).expect("a line");
        let mut reader = master.try_clone().expect("a handle");
        let (answered, answers) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let mut answer = [0; 8];
            let _ = answered.send(reader.read_exact(&mut answer).map(|()| answer));
        });
        // The echo is expected for the duration of the answer on this line, 1.8 s. The test's clock runs no faster than
        // the system's, so that the pseudo-terminal keeps up with it.
        let (began, mut passes) = (std::time::Instant::now(), 0_u32);
        let mut answer = [0; 8];
        await_that("it answers", || {
            if began.elapsed() >= Duration::from_millis(1) * passes {
                passes += 1;
                pass(&device.clock, 1);
            }
            device.end.tick();
            let read = answers.try_recv();
            read.is_ok_and(|read| {
                answer = read.expect("the line is open");
                true
            })
        });
        assert_eq!(answer[..], request);
        // Everything that this end sends is echoed.
        master.write_all(&answer).expect("a line");
        device.until_speed(i16::from(speed));
    }
    // Answering an echo would give an exception, or a second write.
    for _ in 0..200 {
        pass(&device.clock, 1);
    }
    assert_eq!(device.end.statistic("bus_cycles"), "4");
    // The own echo is not of the peer.
    for (key, value) in [
        ("octets_in", "32"),
        ("octets_out", "32"),
        ("frames_in", "4"),
        ("frames_out", "4"),
    ] {
        assert_eq!(device.end.statistic(&format!("line.{key}")), value, "{key}");
    }
    assert!(!device.end.driver.statistics().contains("illegal"));
}
