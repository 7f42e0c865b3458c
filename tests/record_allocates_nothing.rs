//! Receiving a record over a socket, and replying, allocates nothing.
//!
//! The count covers all threads of the process, so this test is alone in its file.
#![allow(missing_docs, reason = "a test")]

use std::io::{Read, Write};
use std::net::TcpStream;

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Manual;
use tickbus_conformance::resources::allocations;
use tickbus_test_log as logged;

#[test]
fn a_record_and_its_reply() {
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
                send = \"reply\"\nevents = true\ninput_bytes = 134\noutput_bytes = 360\n\
                [[signal]]\nname = \"in\"\naddress = \"%IX0.0\"\nlatch = \"both\"\n\
                [[signal]]\nname = \"out\"\naddress = \"%QX0.0\"\nlatch = \"both\"\n";
    let config =
        Config::parse("driver.cfg", text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let _logged = logged::Watch::new();
    let driver = Driver::open(config, Manual::new()).expect("opens");
    let address = loop {
        let statistics = driver.statistics();
        let address = statistics
            .lines()
            .find_map(|line| line.strip_prefix("address="));
        if let Some(address) = address {
            break address.to_owned();
        }
        std::thread::yield_now();
    };
    let mut plc = TcpStream::connect(address).expect("it listens");
    let (mut request, mut answer) = ([0; 360], [0; 134]);
    let mut exchange = |times: u32| {
        for number in 0..times {
            request[0] = u8::from(number % 2 == 0);
            plc.write_all(&request).expect("the device reads");
            plc.read_exact(&mut answer).expect("a reply");
        }
    };
    exchange(100);
    let before = allocations();
    exchange(1_000);
    assert_eq!(allocations() - before, 0);
    driver.close();
    assert_ne!(allocations(), before, "the counter counts");
}
