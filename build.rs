//! Looks for what the tests need beside Rust, and hands on how the product is linked.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    find_compiler();
    link();
}

/// `TICKBUS_LINK_ARG` is an option for the linker of a release; `tools/build` sets it where the linker has it.
fn link() {
    const OPTION: &str = "TICKBUS_LINK_ARG";
    if std::env::var("PROFILE").as_deref() != Ok("release") {
        return;
    }
    println!("cargo::rerun-if-env-changed={OPTION}");
    if let Ok(option) = std::env::var(OPTION) {
        println!("cargo::rustc-link-arg={option}");
    }
}

/// The tests of the plug-in bus need a C compiler; `no_cc` leaves them out.
fn find_compiler() {
    println!("cargo::rustc-check-cfg=cfg(no_cc)");
    let answer = std::process::Command::new("cc").arg("--version").output();
    if !answer.is_ok_and(|answer| answer.status.success()) {
        println!("cargo::rustc-cfg=no_cc");
    }
}
