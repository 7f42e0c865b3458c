//! The plug-in bus: an exchange with a library that does almost nothing, on the bus thread and in a helper
//! process, in alternating rounds of one run.
//!
//! The cycles follow one another without a pause, so that the time between two is that of an exchange.
//! Medians over the rounds; prints one `rust NAME VALUE` per line on stdout, in microseconds.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]

#[cfg(all(unix, not(no_cc)))]
fn main() {
    plugin::main();
}

#[cfg(not(all(unix, not(no_cc))))]
fn main() {
    eprintln!("plugin: skipped, for want of a C compiler or of helper processes");
}

#[cfg(all(unix, not(no_cc)))]
mod plugin {
    use std::path::{Path, PathBuf};
    use std::process::Command;
    use std::sync::Arc;

    use tickbus::driver::Driver;
    use tickbus::driver_cfg::Config;
    use tickbus::time::{Clock as _, Monotonic, Nanos, Stop};

    /// Bytes from the PLC and to it: %Q and %I.
    const OUTPUT: usize = 360;
    const INPUT: usize = 134;

    pub(crate) fn main() {
        // `cargo bench` passes this; `cargo test` only checks that the bench runs.
        let measured = std::env::args().any(|argument| argument == "--bench");
        let (rounds, cycles) = if measured { (7, 20_000) } else { (1, 2) };
        let folder = tempfile::tempdir().expect("a folder");
        let library = build(folder.path());
        let mut medians = [const { Vec::new() }; 2];
        for _ in 0..rounds {
            for (isolated, medians) in [false, true].into_iter().zip(&mut medians) {
                medians.push(exchange(&library, isolated, cycles));
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

    /// The median time of an exchange, in microseconds.
    fn exchange(library: &Path, isolated: bool, cycles: u64) -> f64 {
        let isolation = if isolated {
            let helper = env!("CARGO_BIN_EXE_tickbus");
            format!("isolated = true\nhelper = \"{helper}\"")
        } else {
            String::new()
        };
        let text = format!(
            "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"plugin\"\nlibrary = \"{}\"\n\
             cycle = \"50us\"\nmax_age = \"1h\"\ninput_bytes = {INPUT}\noutput_bytes = {OUTPUT}\n{isolation}\n\
             [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n",
            library.display()
        );
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"));
        let clock = Monotonic::shared();
        let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
        loop {
            clock.wait_until(clock.now() + Nanos::from_millis(10), &Stop::new());
            let statistics = driver.statistics();
            let value = |key: &str| -> f64 {
                let line = statistics.lines().find_map(|line| line.strip_prefix(key));
                line.and_then(|value| value.parse().ok()).unwrap_or(0.0)
            };
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            if value("bus_cycle.count=") >= cycles as f64 {
                driver.close();
                return value("bus_cycle.p50_us=");
            }
        }
    }
}
