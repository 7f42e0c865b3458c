//! Looks for the tools that the tests need besides Rust.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    find_compiler();
}

/// The tests of the plug-in bus build plug-ins in C; `no_cc` leaves them out.
fn find_compiler() {
    println!("cargo::rustc-check-cfg=cfg(no_cc)");
    let answer = std::process::Command::new("cc").arg("--version").output();
    if !answer.is_ok_and(|answer| answer.status.success()) {
        println!("cargo::rustc-cfg=no_cc");
    }
}
