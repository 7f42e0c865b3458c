//! Memory that was freed.

#![cfg_attr(
    all(target_os = "linux", target_env = "gnu"),
    allow(unsafe_code, reason = "the C library's `malloc_trim`")
)]

#[cfg(all(target_os = "linux", target_env = "gnu"))]
unsafe extern "C" {
    fn malloc_trim(kept: usize) -> std::ffi::c_int;
}

/// Gives freed memory back to the system, after work that needed much of it for a short time. Without this call, glibc
/// keeps it for later. Other systems do it themselves, or not at all.
pub fn return_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: the call has no preconditions (malloc_trim(3)).
    unsafe {
        malloc_trim(0);
    }
}

#[cfg(all(test, target_os = "linux", target_env = "gnu"))]
mod tests {
    #[test]
    fn freed_memory_is_no_longer_resident() {
        let resident = || -> usize {
            let text = std::fs::read_to_string("/proc/self/statm").expect("Linux has it");
            let pages = text.split(' ').nth(1).expect("a second number");
            pages.parse().expect("a number of pages")
        };
        // Blocks that are too small to be given back one by one, and a last one that keeps them in.
        let mut blocks: Vec<Vec<u8>> = (0..64_000).map(|_| vec![1; 1000]).collect();
        let last = blocks.pop();
        drop(blocks);
        let before = resident();
        super::return_freed_memory();
        let pages = before.saturating_sub(resident());
        assert!(pages * 4096 > 32_000_000, "{pages} pages");
        drop(last);
    }
}
