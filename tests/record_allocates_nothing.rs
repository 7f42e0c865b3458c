//! Receiving a record over a socket, and replying, allocates nothing.
//!
//! The count covers all threads of the process, so this test is alone in its file.
#![allow(missing_docs, reason = "a test")]
#![allow(unsafe_code, reason = "a global allocator that counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicU64, Ordering};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Manual;
use tickbus_test_log as logged;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

struct Counting;

// SAFETY: all calls are passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::SeqCst);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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
    let before = ALLOCATIONS.load(Ordering::SeqCst);
    exchange(1_000);
    assert_eq!(ALLOCATIONS.load(Ordering::SeqCst) - before, 0);
    driver.close();
    assert_ne!(
        ALLOCATIONS.load(Ordering::SeqCst),
        before,
        "the counter counts"
    );
}
