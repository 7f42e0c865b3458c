//! What the tick path calls allocates nothing; a counting allocator says so.

#![allow(unsafe_code)] // a global allocator has no safe form

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use tickbus::signal::{Area, ByteOrder, DataType, Plan, Scale, Signal, SignalTable, Slot, Station};
use tickbus::time::Nanos;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting the allocations of each thread.
struct Counting;

// SAFETY: every call goes on unchanged to the system's allocator; counting touches only a
// thread-local that needs neither initialisation nor a destructor, so it does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promises about `layout` are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: `block` came from `alloc` above, hence from the system, with this layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The allocations that this thread makes while `work` runs.
fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

#[test]
fn the_allocator_counts() {
    assert_eq!(
        allocations(|| drop(std::hint::black_box(vec![0_u8; 100]))),
        1
    );
}

/// Every type in every byte order, densely and scattered, scaled and not, BOOLs in whole bytes and
/// alone.
fn table() -> SignalTable {
    let types = [
        (DataType::Sint, 1),
        (DataType::Byte, 1),
        (DataType::Int, 2),
        (DataType::Word, 2),
        (DataType::Dint, 4),
        (DataType::Dword, 4),
        (DataType::Real, 4),
        (DataType::Lint, 8),
        (DataType::Lword, 8),
        (DataType::Lreal, 8),
    ];
    let orders = [
        ByteOrder::Abcd,
        ByteOrder::Cdab,
        ByteOrder::Badc,
        ByteOrder::Dcba,
    ];
    let scale = Scale {
        gain: 0.5,
        offset: 1.0,
    };
    let signal = |data_type, byte, bit, order, scale| Signal {
        name: format!("{byte}.{bit}"),
        station: 0,
        area: Area::Input,
        byte,
        bit,
        data_type,
        order,
        scale,
        unit: None,
        latch: None,
        hold: Nanos::default(),
        fail_safe: Slot::default(),
    };
    let mut signals = Vec::new();
    for bit in 0..12 {
        let (byte, bit) = (usize::from(bit / 8), bit % 8);
        signals.push(signal(DataType::Bool, byte, bit, ByteOrder::Abcd, None));
    }
    let mut byte = 3;
    for (data_type, size) in types {
        for order in orders {
            for scale in [None, Some(scale)] {
                for count in [70, 1] {
                    for _ in 0..count {
                        signals.push(signal(data_type, byte, 0, order, scale));
                        byte += size;
                    }
                    byte += 1;
                }
            }
        }
    }
    let station = Station {
        name: String::new(),
        input_bytes: byte,
        output_bytes: 0,
    };
    SignalTable {
        stations: vec![station],
        signals,
    }
}

#[test]
fn the_codec_plan_allocates_nothing() {
    let table = table();
    let plan = Plan::new(&table, 0, Area::Input);
    let mut frame = vec![0; table.stations[0].input_bytes];
    for value in [1.0, -1e300, f64::NAN, f64::INFINITY] {
        let mut slots = vec![Slot::from_real(value); table.signals.len()];
        let count = allocations(|| {
            std::hint::black_box(plan.encode(&slots, &mut frame));
            plan.decode(&frame, &mut slots);
            plan.fail_safe(&mut slots);
        });
        assert_eq!(count, 0, "with {value} in every slot");
    }
}
