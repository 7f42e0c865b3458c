//! A server with the variables of a real CPU's program, and a client that knows only those.

use super::*;

const BLOCK: u8 = 0x84;

/// Two CPUs behind one address, with a data block 10 each, and a block that both share.
const CPUS: &str = r#"
[driver]
id = 1
name = "line"

[fieldbus]
kind     = "s7-server"
address  = "127.0.0.1:0"
max_age  = "300ms"
db       = [{ number = 10, station = "press", length = 40 }]
identity = { order = "6ES7 315-2EH14-0AB0", firmware = "V3.2.6" }

[fieldbus.at]
"speed"  = "DB10.DBW20"
"low"    = "DB10.DBX21.0"
"status" = "DB10.DBW4"
"ready"  = "M100.3"
"level"  = "DB10.DBD2:REAL"
"shared" = "DB500.DBB65535"

[[station]]
name = "press"
slot = 2

[[station]]
name = "oven"
slot = 3
identity = { name = "Oven 1" }

[[station]]
name = "rack"

[[signal]]
name    = "speed"
station = "press"
address = "%QW0"
type    = "INT"

[[signal]]
name    = "low"
station = "press"
address = "%QX2.0"
latch   = "rising"

[[signal]]
name    = "status"
station = "press"
address = "%IW0"
type    = "INT"

[[signal]]
name    = "ready"
station = "press"
address = "%IX2.1"
latch   = "rising"

[[signal]]
name    = "level"
station = "oven"
address = "%QD0"
type    = "REAL"

[[signal]]
name    = "shared"
station = "rack"
address = "%QB0"
"#;

fn open() -> (Alone, SocketAddr) {
    let device = Alone::open(CPUS, &KINDS);
    let address = device.address();
    (device, address)
}

/// Reads bytes of a data block.
fn read(client: &mut Client, block: u16, at: usize, count: usize) -> Vec<u8> {
    let item = address(BLOCK, block, at, count);
    client.ask(&job(&[&[4, 1][..], &item].concat(), &[]))[21..].to_vec()
}

/// Writes bytes of a data block; returns the code of the item.
fn write(client: &mut Client, block: u16, at: usize, bytes: &[u8]) -> u8 {
    let item = address(BLOCK, block, at, bytes.len());
    let [high, low] = u16::try_from(bytes.len() * 8).expect("a few").to_be_bytes();
    let data = [&[0, 4, high, low][..], bytes].concat();
    client.ask(&job(&[&[5, 1][..], &item].concat(), &data))[21]
}

#[test]
fn each_cpu_has_its_own_variables_and_nothing_else() {
    let (mut device, at) = open();
    device.end.set("status", 0x1234.into());
    device.end.tick();
    let (mut press, mut oven) = (Client::in_slot(at, 2), Client::in_slot(at, 3));
    assert_eq!(write(&mut press, 10, 20, &[0, 5]), 0xFF);
    assert_eq!(write(&mut oven, 10, 2, &2.5_f32.to_be_bytes()), 0xFF);
    device.until("both are there", |end| {
        end.get("speed") == 5.0 && end.get("level") == 2.5 && end.get("low") == 1.0
    });
    // A block of a stated length: bytes without a signal keep what was written.
    assert_eq!(write(&mut press, 10, 30, &[7, 8]), 0xFF);
    assert_eq!(
        read(&mut press, 10, 0, 40)[4..],
        [
            &[0, 0, 0, 0, 0x12, 0x34][..],
            &[0; 14],
            &[0, 5],
            &[0; 8],
            &[7, 8],
            &[0; 8]
        ]
        .concat()
    );
    assert_eq!(read(&mut oven, 10, 0, 6)[4..], [0, 0, 0x40, 0x20, 0, 0]);
    // Beyond its end, and what no line names.
    assert_eq!(read(&mut press, 10, 39, 2)[0], 5);
    assert_eq!(read(&mut oven, 10, 6, 1)[0], 5);
    assert_eq!(read(&mut press, 11, 0, 1)[0], 0x0A);
    // This end writes it; the whole item is refused.
    assert_eq!(write(&mut press, 10, 5, &[0; 17]), 3);
    assert_eq!(read(&mut press, 10, 20, 2)[4..], [0, 5]);
    // A block of a station without a slot is everybody's.
    assert_eq!(write(&mut press, 500, 65535, &[9]), 0xFF);
    assert_eq!(read(&mut oven, 500, 65535, 1)[4..], [9]);
    device.until("it is there", |end| end.get("shared") == 9.0);
}

#[test]
fn a_bit_is_written_without_its_neighbours_and_a_word_with_its_bits() {
    let (mut device, at) = open();
    let mut press = Client::in_slot(at, 2);
    assert_eq!(write(&mut press, 10, 20, &[0x7F, 0xFE]), 0xFF);
    device.until("it is there", |end| end.get("speed") == 32766.0);
    let bit = [5, 1, 0x12, 10, 0x10, 1, 0, 1, 0, 10, BLOCK, 0, 0, 168];
    press.ask(&job(&bit, &[0, 3, 0, 1, 1]));
    device.until("both are there", |end| {
        end.get("speed") == 32767.0 && end.get("low") == 1.0
    });
}

#[test]
fn a_pulse_waits_until_its_own_place_was_read() {
    let (mut device, at) = open();
    let mut press = Client::in_slot(at, 2);
    for value in [1.0, 0.0] {
        device.end.set("ready", value);
        device.end.tick();
    }
    for _ in 0..3 {
        assert_eq!(press.read(FLAGS, 99, 1), [0]);
    }
    assert_eq!(press.read(FLAGS, 100, 1), [8]);
    // The server hears of the answer's arrival with the next request.
    device.until("the pulse is over", |_| press.read(FLAGS, 100, 1) == [0]);
}

#[test]
fn a_fault_with_a_chance_meets_all_items_of_a_job_or_none() {
    let (mut device, at) = open();
    let mut press = Client::in_slot(at, 2);
    let fault = "kind = \"answer-error\"\ncode = 1\nchance = 0.5\nstation = \"press\"";
    let fault = device.end.driver.inject_text(fault).expect("a right fault");
    device.end.tick();
    let item = address(BLOCK, 10, 4, 2);
    let many = [&[4, 10][..], &item.repeat(10)].concat();
    let mut seen = [0; 2];
    for _ in 0..40 {
        let answer = press.ask(&job(&many, &[]));
        let refused = answer[21..] == [1, 0, 0, 0].repeat(10);
        assert!(refused || answer.len() == 21 + 60, "{answer:?}");
        seen[usize::from(refused)] += 1;
    }
    assert!(seen.iter().all(|count| *count > 5), "{seen:?}");
    let jobs = seen[1].to_string();
    assert_eq!(device.end.statistic("fault.answers"), jobs);
    assert!(device.end.driver.end_fault(fault));
}
