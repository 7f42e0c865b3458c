//! A bare coordinator in shared memory: a loop that writes one message for each client, and waits for the answers.

use std::process::Child;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::{Duration, Instant};

use tickbus_base::os::{NamedMemory, SharedMemory};

use crate::{ANSWERED, ASKED, clients, wait};

/// The words of a client: two cache lines to it, and two back, each with a count and a message.
const CLIENT: usize = 32;
const BACK: usize = 16;

/// The count that ends a client.
const END: u64 = u64::MAX;

/// Waits until a count is not `seen`, without the system as long as every process has its own core.
fn changed(memory: &SharedMemory, at: usize, seen: u64, spins: u32) -> u64 {
    let mut left = spins;
    loop {
        let count = memory.word(at).load(Acquire);
        if count != seen {
            return count;
        }
        if left > 0 {
            left -= 1;
            std::hint::spin_loop();
        } else {
            std::thread::yield_now();
        }
    }
}

/// The number of spins before the first yield, as in the server of virtual time.
fn spins(processes: usize) -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if processes <= cores { 4000 } else { 0 }
}

/// The messages of one client.
pub(super) fn client(name: &str, at: usize, count: usize) {
    let memory = NamedMemory::open(&NamedMemory::path(name)).expect("it is there");
    let (memory, base, spins) = (memory.memory(), at * CLIENT, spins(count + 1));
    let mut seen = 0;
    loop {
        seen = changed(memory, base, seen, spins);
        if seen == END {
            return;
        }
        memory.read(base + 1, &mut [0; ASKED]);
        memory.write(base + BACK + 1, &[0; ANSWERED]);
        memory.word(base + BACK).store(seen, Release);
    }
}

/// Steps per second with this many clients, each in its own process.
pub(super) fn bare(remote: usize, span: Duration) -> f64 {
    let name = format!("tickbus-bench-{}", std::process::id());
    let bytes = (remote * CLIENT * 8).max(4096);
    let served = NamedMemory::serve(&NamedMemory::path(&name), bytes).expect("a free name");
    let (memory, spins) = (served.memory(), spins(remote + 1));
    let children: Vec<Child> = clients("memory", &name, remote, remote);
    let mut sequence = 0;
    let mut step = || {
        sequence += 1;
        for base in (0..remote).map(|at| at * CLIENT) {
            memory.write(base + 1, &[0; ASKED]);
            memory.word(base).store(sequence, Release);
        }
        for base in (0..remote).map(|at| at * CLIENT) {
            changed(memory, base + BACK, sequence - 1, spins);
            memory.read(base + BACK + 1, &mut [0; ANSWERED]);
        }
    };
    for _ in 0..100 {
        step();
    }
    let (begun, mut steps) = (Instant::now(), 0_u32);
    while begun.elapsed() < span {
        step();
        steps += 1;
    }
    let rate = f64::from(steps) / begun.elapsed().as_secs_f64();
    for at in 0..remote {
        memory.word(at * CLIENT).store(END, Relaxed);
    }
    wait(children);
    rate
}
