//! The plug-in bus: the processor time of a bus cycle with a library that does almost nothing, on the bus thread and in
//! a helper process, in alternating rounds of one run.
//!
//! A cycle has its fixed time, so that only the processor time tells what it costs: that of all threads of this process
//! and of its helper, as the kernel counts it. Most of it is the wait for the next cycle.
//! Medians over the rounds; prints one `rust NAME VALUE` per line on stdout, in microseconds.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]

#[cfg(all(target_os = "linux", not(no_cc)))]
mod processor;

#[cfg(all(target_os = "linux", not(no_cc)))]
fn main() {
    plugin::main();
}

#[cfg(not(all(target_os = "linux", not(no_cc))))]
fn main() {
    eprintln!(
        "plugin: skipped, for want of a C compiler or of Linux, which counts processor time by thread"
    );
}

#[cfg(all(target_os = "linux", not(no_cc)))]
mod plugin {
    use std::path::{Path, PathBuf};
    use std::process::Command;
    use std::sync::Arc;

    use crate::processor::processor_us;
    use tickbus::driver::Driver;
    use tickbus::driver_cfg::Config;
    use tickbus::time::{Clock as _, Monotonic, Nanos, Stop};

    /// Bytes from the PLC and to it: %Q and %I.
    const OUTPUT: usize = 360;
    const INPUT: usize = 134;

    pub(crate) fn main() {
        // `cargo bench` passes this; `cargo test` only checks that the bench runs.
        let measured = std::env::args().any(|argument| argument == "--bench");
        let (rounds, time) = if measured { (7, 1000) } else { (1, 10) };
        let folder = tempfile::tempdir().expect("a folder");
        let library = build(folder.path());
        let mut medians = [const { Vec::new() }; 2];
        for _ in 0..rounds {
            for (isolated, medians) in [false, true].into_iter().zip(&mut medians) {
                medians.push(cycle(&library, isolated, Nanos::from_millis(time)));
            }
        }
        for (name, medians) in ["plain", "isolated"].iter().zip(&mut medians) {
            medians.sort_by(f64::total_cmp);
            println!("rust plugin.{name}_us {:.2}", medians[medians.len() / 2]);
        }
    }

    /// The tests' plug-in: without options it returns what it is sent.
    fn build(folder: &Path) -> PathBuf {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let library = folder.join("libecho.so");
        let status = Command::new("cc")
            .args(["-std=c99", "-O2", "-fPIC", "-shared", "-I"])
            .arg(root.join("include"))
            .arg("-o")
            .arg(&library)
            .arg(root.join("tests/plugins/misbehave.c"))
            .status();
        assert!(status.expect("cc runs").success());
        library
    }

    /// The processor time of a cycle, in microseconds.
    fn cycle(library: &Path, isolated: bool, time: Nanos) -> f64 {
        let isolation = if isolated {
            let helper = env!("CARGO_BIN_EXE_tickbus");
            format!("isolated = true\nhelper = \"{helper}\"")
        } else {
            String::new()
        };
        let text = format!(
            "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"plugin\"\nlibrary = \"{}\"\n\
             cycle = \"100us\"\nmax_age = \"1h\"\ninput_bytes = {INPUT}\noutput_bytes = {OUTPUT}\n{isolation}\n\
             [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n",
            library.display()
        );
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"));
        let clock = Monotonic::shared();
        let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
        let wait = |time| clock.wait_until(clock.now() + time, &Stop::new());
        let cycles = || -> f64 {
            let statistics = driver.statistics();
            let count = statistics
                .lines()
                .find_map(|line| line.strip_prefix("bus_cycle.count="));
            count.and_then(|count| count.parse().ok()).unwrap_or(0.0)
        };
        // Until the helper runs.
        while cycles() < 2.0 {
            wait(Nanos::from_millis(10));
        }
        let (before, begun) = (cycles(), processor_us(true));
        wait(time);
        let cost = (processor_us(true) - begun) / (cycles() - before);
        driver.close();
        cost
    }
}
