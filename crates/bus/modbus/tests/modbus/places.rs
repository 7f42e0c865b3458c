//! A server with the places of a device's manual, and a client that knows only those.

use super::*;
use conformance::rig::End;
use tickbus_base::time::Monotonic;

/// Two devices behind one address: a drive at unit 3, and remote I/O at unit 7 that has its image as a whole.
const DEVICES: &str = r#"
[driver]
id = 1
name = "line"

[fieldbus]
kind     = "modbus-server"
address  = "127.0.0.1:0"
max_age  = "300ms"
reserved = [{ at = "408503", count = 2 }]

[fieldbus.at]
"speed"  = "408502"
"status" = "408501"
"ready"  = "100008"
"fault"  = "100010"

[[station]]
name     = "drive"
unit     = 3
identity = { vendor = "ACME", product = "FD-7", revision = "V2.1", name = "Frequency drive", server_id = "FD7", server_data = "V2" }

[[station]]
name = "rack"
unit = 7

[[signal]]
name    = "speed"
station = "drive"
address = "%QW0"
type    = "INT"

[[signal]]
name    = "status"
station = "drive"
address = "%IW0"
type    = "INT"

[[signal]]
name    = "ready"
station = "drive"
address = "%IX2.0"
latch   = "rising"

[[signal]]
name    = "fault"
station = "drive"
address = "%IX2.1"
latch   = "rising"

[[signal]]
name    = "press"
station = "rack"
address = "%QW0"
type    = "INT"
"#;

/// Asks a unit.
#[track_caller]
fn of_unit(stream: &mut TcpStream, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let sent = stream.write_all(&request(1, unit, pdu));
    sent.expect("the server reads");
    answer(stream, 1)
}

#[test]
fn two_devices_have_their_own_places_and_names_behind_one_address() {
    let mut device = Alone::open(DEVICES, &KINDS);
    let mut stream = client(device.address());
    device.end.set("status", 0x1234.into());
    device.end.tick();
    let write = [16, 0x21, 0x35, 0, 2, 4, 0, 5, 9, 9];
    assert_eq!(of_unit(&mut stream, 3, &write), write[..5]);
    device.until("it is there", |end| end.get("speed") == 5.0);
    let all = [3, 0x21, 0x34, 0, 4];
    assert_eq!(
        of_unit(&mut stream, 3, &all),
        [3, 8, 0x12, 0x34, 0, 5, 0, 0, 0, 0]
    );
    // The drive has nothing at 0 and the rack nothing at 8500.
    assert_eq!(of_unit(&mut stream, 3, &[3, 0, 0, 0, 1]), [0x83, 2]);
    assert_eq!(of_unit(&mut stream, 7, &all), [0x83, 2]);
    assert_eq!(of_unit(&mut stream, 7, &[6, 0, 0, 0, 8]), [6, 0, 0, 0, 8]);
    device.until("it is there", |end| end.get("press") == 8.0);
    // What the device itself writes is refused, and with it the whole request.
    assert_eq!(
        of_unit(&mut stream, 3, &[16, 0x21, 0x34, 0, 2, 4, 0, 1, 0, 1]),
        [0x90, 2]
    );
    assert_eq!(of_unit(&mut stream, 3, &all)[4..6], [0, 5]);

    assert_eq!(
        of_unit(&mut stream, 3, &[17]),
        [17, 6, b'F', b'D', b'7', 0xFF, b'V', b'2']
    );
    assert_eq!(of_unit(&mut stream, 7, &[17]), [0x91, 1]);
    let who = of_unit(&mut stream, 3, &[43, 14, 4, 4]);
    assert!(who.ends_with(b"Frequency drive"), "{who:?}");
    let who = of_unit(&mut stream, 7, &[43, 14, 4, 0]);
    assert!(who.ends_with(b"tickbus"), "{who:?}");
}

#[test]
fn a_pulse_waits_until_its_own_place_was_read() {
    let mut device = Alone::open(DEVICES, &KINDS);
    let mut stream = client(device.address());
    for value in [1.0, 0.0] {
        device.end.set("ready", value);
        device.end.tick();
    }
    // Neighbours in the image, and not in the table.
    for _ in 0..3 {
        assert_eq!(of_unit(&mut stream, 3, &[2, 0, 9, 0, 1]), [2, 1, 0]);
    }
    assert_eq!(of_unit(&mut stream, 3, &[2, 0, 7, 0, 1]), [2, 1, 1]);
    // The server hears of the answer's arrival with the next request.
    device.until("the pulse is over", |_| {
        of_unit(&mut stream, 3, &[2, 0, 7, 0, 1]) == [2, 1, 0]
    });
}

#[test]
fn a_client_that_reads_places_one_by_one_ends_the_wait_of_a_closing_device() {
    let clock = Monotonic::shared();
    let text = DEVICES
        .replace("\"300ms\"", "\"20s\"\nat_close = \"fail_safe\"")
        .replace("latch   = \"rising\"\n", "");
    let end = End::open(&text, &clock, &KINDS);
    let mut stream = client(end.address());
    let reads = [[3, 0x21, 0x34, 0, 1], [2, 0, 7, 0, 1], [2, 0, 9, 0, 1]];
    let mut poll = move || {
        for read in reads {
            let sent = stream.write_all(&request(1, 3, &read));
            if sent.is_err() || stream.read(&mut [0; 64]).unwrap_or_default() == 0 {
                return false;
            }
        }
        true
    };
    assert!(poll());
    // A log entry says that values were not confirmed: the test then fails.
    let polling = std::thread::spawn(move || while poll() {});
    end.driver.close();
    polling.join().expect("it has lost its server");
}

/// Injects a fault into the devices, for as long as `during` runs.
#[track_caller]
fn with_fault(device: &mut Alone, fault: &str, during: impl FnOnce(&mut Alone)) {
    let fault = device.end.driver.inject_text(fault).expect("a right fault");
    device.end.tick();
    during(device);
    assert!(device.end.driver.end_fault(fault));
    device.end.tick();
}

#[test]
fn a_busy_device_refuses_and_does_nothing_and_its_neighbour_is_not_busy() {
    let mut device = Alone::open(DEVICES, &KINDS);
    let mut stream = client(device.address());
    let write = [6, 0x21, 0x35, 0, 5];
    with_fault(
        &mut device,
        "kind = \"answer-error\"\ncode = 6\nstation = \"drive\"\nfunction = 6",
        |device| {
            assert_eq!(of_unit(&mut stream, 3, &write), [0x86, 6]);
            assert_eq!(
                of_unit(&mut stream, 3, &[3, 0x21, 0x35, 0, 1]),
                [3, 2, 0, 0]
            );
            assert_eq!(of_unit(&mut stream, 7, &[6, 0, 0, 0, 8]), [6, 0, 0, 0, 8]);
            assert_eq!(device.end.statistic("fault.answers"), "1");
        },
    );
    assert_eq!(of_unit(&mut stream, 3, &write), write);
    device.until("it is there", |end| end.get("speed") == 5.0);
}

#[test]
fn a_wrong_answer_is_no_receipt_and_what_was_asked_is_done() {
    let mut device = Alone::open(DEVICES, &KINDS);
    let mut stream = client(device.address());
    for value in [1.0, 0.0] {
        device.end.set("ready", value);
        device.end.tick();
    }
    let read = [2, 0, 7, 0, 1];
    for (how, answer) in [
        ("truncated", [0, 1, 0, 0, 0, 3, 3, 2, 1].as_slice()),
        ("transaction", &[0, 2, 0, 0, 0, 4, 3, 2, 1, 1]),
        ("unit", &[0, 1, 0, 0, 0, 4, 4, 2, 1, 1]),
    ] {
        let fault = format!("kind = \"answer-wrong\"\nhow = \"{how}\"");
        with_fault(&mut device, &fault, |_| {
            let sent = stream.write_all(&request(1, 3, &read));
            sent.expect("the server reads");
            let mut came = vec![0; answer.len()];
            stream.read_exact(&mut came).expect("an answer");
            assert_eq!(came, answer, "{how}");
        });
    }
    // The pulse was in all three answers, and nobody has it yet.
    assert_eq!(of_unit(&mut stream, 3, &read), [2, 1, 1]);
    with_fault(
        &mut device,
        "kind = \"answer-wrong\"\nhow = \"truncated\"",
        |device| {
            let sent = stream.write_all(&request(1, 3, &[6, 0x21, 0x35, 0, 9]));
            sent.expect("the server reads");
            device.until("it is there", |end| end.get("speed") == 9.0);
        },
    );
}

#[test]
fn a_fault_meets_the_requests_for_one_signal_or_for_a_number_of_elements() {
    let mut device = Alone::open(DEVICES, &KINDS);
    let mut stream = client(device.address());
    device.end.set("status", 0x1234.into());
    device.end.tick();
    let (status, both) = ([3, 0x21, 0x34, 0, 1], [3, 0x21, 0x34, 0, 2]);
    let other = [6, 0, 0, 0, 8];
    suffer(
        &mut device,
        "name = \"busy\"\nkind = \"answer-error\"\ncode = 6\nsignal = \"speed\"",
    );
    assert_eq!(of_unit(&mut stream, 3, &status), [3, 2, 0x12, 0x34]);
    assert_eq!(of_unit(&mut stream, 3, &both), [0x83, 6]);
    assert_eq!(of_unit(&mut stream, 3, &[6, 0x21, 0x35, 0, 9]), [0x86, 6]);
    let first_writes = [23, 0x21, 0x34, 0, 1, 0x21, 0x35, 0, 1, 2, 0, 9];
    assert_eq!(of_unit(&mut stream, 3, &first_writes), [0x97, 6]);
    // The signal of the other unit has the same bits of its own image.
    assert_eq!(of_unit(&mut stream, 7, &other), other);
    // A reserved element carries no signal, and what does not exist concerns none.
    let reserved = [3, 0x21, 0x36, 0, 1];
    assert_eq!(of_unit(&mut stream, 3, &reserved), [3, 2, 0, 0]);
    assert_eq!(of_unit(&mut stream, 3, &[3, 0x21, 0x34, 0, 9]), [0x83, 2]);
    assert_eq!(device.end.get("speed"), 0.0);

    let mut device = Alone::open(DEVICES, &KINDS);
    let mut stream = client(device.address());
    suffer(
        &mut device,
        "kind = \"answer-wrong\"\nhow = \"short\"\nsignal = \"status\"\nquantity = 2",
    );
    assert_eq!(of_unit(&mut stream, 3, &status), [3, 2, 0, 0]);
    assert_eq!(of_unit(&mut stream, 3, &both), [3, 2, 0, 0]);
    let three = [3, 0x21, 0x34, 0, 3];
    assert_eq!(of_unit(&mut stream, 3, &three)[..2], [3, 6]);
}
