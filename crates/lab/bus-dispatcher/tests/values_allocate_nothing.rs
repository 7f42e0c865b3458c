//! Sending and receiving values allocates nothing.
//!
//! The count covers all threads of the process, so this test is alone in its file.
#![allow(missing_docs, reason = "a test")]

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpListener;

use tickbus_base::time::Monotonic;
use tickbus_conformance::resources::allocations;
use tickbus_driver::Driver;
use tickbus_driver_cfg::{Config, Kind, Kinds};
use tickbus_image::signal::Slot;

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_dispatcher::Options>()]);

#[test]
fn values_go_both_ways() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("bound").port();
    let text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"dispatcher\"\naddress = \"127.0.0.1:{port}\"\n\
         cycle = \"1ms\"\nmax_age = \"9h\"\n\
         [[signal]]\nname = \"sensor\"\naddress = \"%IX0.0\"\n\
         [[signal]]\nname = \"level\"\naddress = \"%ID4\"\ntype = \"REAL\"\n\
         [[signal]]\nname = \"run\"\naddress = \"%QX0.0\"\n\
         [[signal]]\nname = \"speed\"\naddress = \"%QW2\"\ntype = \"INT\"\n"
    );
    let config = Config::parse("driver.cfg", &text, &KINDS).unwrap_or_else(|why| panic!("{why}"));
    let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
    let mut slots = driver.initial_slots();
    driver.exchange(None, &mut slots);
    let (mut stream, _) = listener.accept().expect("the machine");
    stream.set_nodelay(true).expect("a TCP option");
    let mut reader = BufReader::new(stream.try_clone().expect("a descriptor"));
    let mut line = String::with_capacity(1024);
    let mut hear = |line: &mut String| {
        line.clear();
        reader.read_line(line).expect("it is there");
    };
    hear(&mut line);
    assert_eq!(line, "VP x Q01 I01 AQ01 AI01 V=3 ALIVE=60000ms\r\n");
    stream.write_all(b"OK VP\r\nEND 0\r\n").expect("it reads");
    while line != "PING\r\n" {
        hear(&mut line);
    }
    stream.write_all(b"OK PING\r\n").expect("it reads");
    let mut exchange = |times: u16| {
        for number in 0..times {
            let (is_odd, speed) = (number % 2 == 1, f64::from(number));
            slots[0] = Slot::from_real(f64::from(u8::from(is_odd)));
            slots[1] = Slot::from_real(speed + 0.1);
            driver.exchange(None, &mut slots);
            // The fraction shows that the line belongs to this round.
            while !line.contains(".1") || !line.contains("AQ1=") {
                hear(&mut line);
            }
            line.clear();
            let volts = if is_odd { "24" } else { "0" };
            writeln!(stream, "P I1={volts} AI1={number}").expect("it reads");
            while slots[3].real().to_bits() != speed.to_bits() {
                driver.exchange(None, &mut slots);
                std::thread::yield_now();
            }
        }
    };
    exchange(50);
    let before = allocations();
    exchange(200);
    assert_eq!(allocations() - before, 0);
}
