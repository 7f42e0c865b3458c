//! Steps allocate nothing, neither in the server nor in its clients.
//!
//! The count covers all threads of the process, so this test is alone in its file.
#![allow(unsafe_code, reason = "a global allocator that counts")]

#[path = "it/common/mod.rs"]
mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use common::{Mixer, mixer_settings, mixers};
use tickbus_base::time::Monotonic;
use tickbus_net::Address;
#[cfg(unix)]
use tickbus_virtual_time::shared_memory;
use tickbus_virtual_time::{
    Controls, Declaration, Hosting, Logic, Participant, Step, in_process, tcp,
};

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

/// A client that checks how much was allocated between its steps 100 and 1900.
struct Watcher(Mixer, u64, Option<u64>);

impl Watcher {
    fn new(mixer: Mixer) -> Self {
        Self(mixer, 0, None)
    }
}

impl Participant for Watcher {
    fn declare(&self) -> Declaration {
        self.0.declare()
    }

    fn initial(&mut self, writes: &mut [u64]) {
        self.0.initial(writes);
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        let allocations = ALLOCATIONS.load(Ordering::SeqCst);
        match step.sequence {
            100 => self.1 = allocations,
            1900 => self.2 = Some(allocations - self.1),
            _ => {}
        }
        self.0.run(step, reads, writes)
    }
}

fn hosting(controls: &Controls, run: impl FnOnce(Hosting<'_>)) {
    run(Hosting {
        clock: &*Monotonic::shared(),
        controls,
        news: &mut |_| {},
    });
}

#[test]
fn steps_allocate_nothing() {
    let in_this_process = || {
        let mut clients = mixers(3);
        // The first client runs in every step.
        let mut watcher = Watcher::new(clients.remove(0));
        let mut all: Vec<&mut dyn Participant> = vec![&mut watcher];
        all.extend(clients.iter_mut().map(|client| client as _));
        in_process::run(mixer_settings(2000, 3), all, Logic::new()).expect("it runs");
        watcher.2
    };
    // On a busy machine the harness's own thread may still be starting, and allocate.
    let counts: Vec<_> = (0..5).map(|_| in_this_process()).collect();
    assert!(counts.contains(&Some(0)), "in this process: {counts:?}");

    let controls = Controls::default();
    let mut clients = mixers(3);
    let mut watcher = Watcher::new(clients.remove(0));
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    thread::scope(|scope| {
        for client in &mut clients {
            scope.spawn(|| tcp::join(&address, client).expect("it runs"));
        }
        scope.spawn(|| tcp::join(&address, &mut watcher).expect("it runs"));
        hosting(&controls, |hosting| {
            let outcome = listener.run(mixer_settings(2000, 3), Logic::new(), hosting);
            outcome.expect("it runs");
        });
    });
    assert_eq!(watcher.2, Some(0), "over TCP");

    #[cfg(unix)]
    {
        let mut clients = mixers(3);
        let mut watcher = Watcher::new(clients.remove(0));
        let name = format!("test-allocations-{}", std::process::id());
        let settings = mixer_settings(2000, 3);
        let listener = shared_memory::Listener::bind(&name, &settings).expect("a free name");
        thread::scope(|scope| {
            for client in &mut clients {
                scope.spawn(|| shared_memory::join(&name, client).expect("it runs"));
            }
            scope.spawn(|| shared_memory::join(&name, &mut watcher).expect("it runs"));
            hosting(&controls, |hosting| {
                let outcome = listener.run(settings, Logic::new(), hosting);
                outcome.expect("it runs");
            });
        });
        assert_eq!(watcher.2, Some(0), "through shared memory");
    }
}
