//! Looks for what the tests need beside Rust, and hands on how the product is linked and which commit it is.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    find_compiler();
    link();
    name();
    commit();
}

/// `TICKBUS_COMMIT` is the commit and its date for `tickbus --version`, such as `2f9b409b 2026-11-26`. Without it git
/// says so; a release archive has no git, and its version then has no commit. The date is that of the commit, so that
/// two builds of one commit are equal.
fn commit() {
    const VARIABLE: &str = "TICKBUS_COMMIT";
    println!("cargo::rerun-if-env-changed={VARIABLE}");
    let stated = std::env::var(VARIABLE).ok();
    let commit = stated.filter(|stated| !stated.is_empty());
    if let Some(commit) = commit.or_else(commit_of_git) {
        println!("cargo::rustc-env={VARIABLE}={commit}");
    }
}

fn commit_of_git() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git").args(arguments).output();
        let output = output.ok().filter(|output| output.status.success())?;
        let text = String::from_utf8(output.stdout).ok()?;
        Some(text.trim().to_owned())
    };
    // An archive that was unpacked within some other repository must not get that one's commit.
    let root = git(&["rev-parse", "--show-toplevel"])?;
    let here = std::env::var("CARGO_MANIFEST_DIR").ok()?;
    let is_here = std::fs::canonicalize(root).ok()? == std::fs::canonicalize(here).ok()?;
    // Each change of HEAD adds a line to its log; a file that does not exist would run this script in every build.
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"])?;
    if is_here && std::path::Path::new(&log).exists() {
        println!("cargo::rerun-if-changed={log}");
    }
    let commit = is_here.then(|| git(&["log", "-1", "--abbrev=8", "--format=%h %cs"]));
    commit.flatten()
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
