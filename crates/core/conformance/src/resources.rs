//! Counts threads, descriptors, memory and allocations of the process.
#![allow(unsafe_code, reason = "a global allocator that counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::process::Command;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// The number of bytes allocated at this moment.
static LIVE: AtomicUsize = AtomicUsize::new(0);

/// The number of allocations so far, in all threads.
static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static OF_THREAD: Cell<u64> = const { Cell::new(0) };
}

/// The number of allocations so far, in all threads of the process.
pub fn allocations() -> u64 {
    ALLOCATIONS.load(Ordering::SeqCst)
}

/// The number of allocations so far, in this thread.
pub fn allocations_of_thread() -> u64 {
    OF_THREAD.get()
}

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

// SAFETY: all calls are forwarded to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LIVE.fetch_add(layout.size(), Ordering::Relaxed);
        ALLOCATIONS.fetch_add(1, Ordering::SeqCst);
        OF_THREAD.set(OF_THREAD.get() + 1);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// The resources that a process holds.
#[derive(Clone, Copy, Debug)]
pub struct Resources {
    threads: usize,
    descriptors: usize,
    processes: usize,
    bytes: usize,
}

/// The texts of reasons may vary in length.
const SLACK: usize = 4096;

impl PartialEq for Resources {
    fn eq(&self, other: &Self) -> bool {
        let exact = |one: &Self| (one.threads, one.descriptors, one.processes);
        exact(self) == exact(other) && self.bytes.abs_diff(other.bytes) < SLACK
    }
}

impl Resources {
    /// The resources of the process at this moment.
    pub fn now() -> Self {
        // In Wine these folders are there too, and are those of Wine.
        let is_linux = cfg!(target_os = "linux");
        let count = |directory: &str| match std::fs::read_dir(directory) {
            Ok(entries) if is_linux => entries.count(),
            _ => 0,
        };
        let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten();
        let children = tasks
            .flatten()
            .filter_map(|task| std::fs::read_to_string(task.path().join("children")).ok());
        Self {
            threads: count("/proc/self/task"),
            descriptors: count("/proc/self/fd"),
            processes: children.map(|list| list.split_whitespace().count()).sum(),
            bytes: LIVE.load(Ordering::Relaxed),
        }
    }

    /// The resources of the process once they are stable; `pass` lets time pass.
    pub fn settled(mut pass: impl FnMut()) -> Self {
        let limit = Instant::now() + Duration::from_secs(10);
        let mut last = Self::now();
        let mut same = 0;
        while same < 20 && Instant::now() < limit {
            pass();
            // Threads woken by something other than the clock also need the processor.
            std::thread::sleep(Duration::from_millis(1));
            let now = Self::now();
            same = if now == last { same + 1 } else { 0 };
            last = now;
        }
        last
    }
}

/// Returns true if this process runs only the test called `test` (its module path). If false, the test has run in a
/// separate process, and has passed.
pub fn alone(test: &str) -> bool {
    const MARK: &str = "TICKBUS_TEST_ALONE";
    if std::env::var_os(MARK).is_some() {
        return true;
    }
    let (_, name) = test.split_once("::").expect("a path below the crate");
    let child = Command::new(std::env::current_exe().expect("the test's own file"))
        .args([name, "--exact", "--test-threads=1", "--nocapture"])
        .env(MARK, "1")
        .output()
        .expect("the test's own file runs");
    let told = String::from_utf8_lossy(&child.stdout);
    println!("{told}");
    eprintln!("{}", String::from_utf8_lossy(&child.stderr));
    assert!(child.status.success(), "it failed in a process of its own");
    assert!(told.contains("1 passed"), "no test is called {name}");
    false
}
