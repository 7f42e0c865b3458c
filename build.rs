//! Looks for what the tests need beside Rust, and hands on how the product is linked.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    find_compiler();
    link();
    name();
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

/// Other programs find the library by this name, however its file is called.
fn name() {
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libtickbus.so");
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
