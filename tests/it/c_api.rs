//! The C interface: its example, and a program that uses it wrongly, compiled by the system's C compiler.
#![cfg(not(no_cc))]
#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tickbus::driver::Code;

use crate::fmi::run::with_server;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

const TANK: &str = r#"
[driver]
id   = 1
name = "Tank"

[fieldbus]
kind    = "loopback"
program = "mirror"
mode    = "stepped"
scan    = "10ms"

[[signal]]
name    = "Valve"
address = "%QX0.0"

[[signal]]
name    = "Level low"
address = "%IX0.0"

[[signal]]
name    = "Level"
address = "%IW2"
type    = "INT"
unit    = "mm"
scale   = { raw = [0, 27648], value = [0.0, 500.0] }
"#;

/// The folder of the native library that this test is built with.
pub(crate) fn library() -> PathBuf {
    let here = std::env::current_exe().expect("a test has a file");
    here.parent().expect("it is in a folder").to_owned()
}

/// Compiles one source file with the `compiler` command, without a single warning.
fn compile(compiler: &[&str], source: &str, folder: &Path) -> PathBuf {
    let program = folder.join("program");
    let library = library();
    let output = Command::new(compiler[0])
        .args(&compiler[1..])
        .args([
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-pthread",
            "-I",
        ])
        .arg(Path::new(ROOT).join("include"))
        .arg(Path::new(ROOT).join(source))
        .args(["-x", "none", "-ltickbus", "-L"])
        .arg(&library)
        .arg(format!("-Wl,-rpath,{}", library.display()))
        .arg("-o")
        .arg(&program)
        .output()
        .expect("the compiler runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    program
}

fn folder_with_tank() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("there is room");
    fs::write(folder.path().join("tank.cfg"), TANK).expect("there is room");
    let wrong = TANK.replace("address =", "adress =");
    fs::write(folder.path().join("wrong.cfg"), wrong).expect("there is room");
    folder
}

fn run(program: &Path, folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(program);
    command
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("it runs")
}

#[test]
fn the_example_runs_a_tank_by_the_mirror() {
    for compiler in [&["cc", "-std=c99"][..], &["c++", "-std=c++17", "-x", "c++"]] {
        let folder = folder_with_tank();
        let program = compile(compiler, "examples/c/tank.c", folder.path());
        let output = run(&program, folder.path(), &[]);
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let lines: Vec<&str> = printed.lines().collect();
        assert_eq!(lines.len(), 10, "{printed}");
        // The mirror opens the valve below 150 mm, a scan later: it stays there.
        for line in &lines[2..] {
            let mm: f64 = line[3..]
                .split_whitespace()
                .next()
                .expect("mm")
                .parse()
                .expect("a number");
            assert!((145.0..155.0).contains(&mm), "{printed}");
        }
    }
}

#[test]
fn the_example_says_what_is_wrong_with_its_file() {
    let folder = folder_with_tank();
    let program = compile(&["cc"], "examples/c/tank.c", folder.path());
    let output = run(&program, folder.path(), &["nothing.cfg"]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.starts_with("tank: BAD_CONFIG (-4): "), "{said}");
    assert!(said.contains("nothing.cfg"), "{said}");
}

#[test]
fn misuse_is_answered_and_nothing_goes_down() {
    let folder = folder_with_tank();
    let program = compile(
        &["cc", "-std=c99", "-D_POSIX_C_SOURCE=200809L"],
        "tests/c/misuse.c",
        folder.path(),
    );
    let output = run(&program, folder.path(), &["tank.cfg", "wrong.cfg"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?} {said}", output.status);
    assert!(output.stdout.starts_with(b"misuse: ok"), "{said}");
}

#[test]
fn many_drivers_tick_in_one_call_each_with_its_own_time_and_status() {
    let folder = folder_with_tank();
    let compiler = ["cc", "-std=c99", "-D_POSIX_C_SOURCE=200809L"];
    let program = compile(&compiler, "tests/c/many.c", folder.path());
    let output = run(&program, folder.path(), &["tank.cfg"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?} {said}", output.status);
    assert!(output.stdout.starts_with(b"many: ok"), "{said}");
}

#[test]
fn a_line_takes_the_changes_of_its_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = compile(&["cc", "-std=c11"], "tests/c/reload.c", folder.path());
    let output = run(&program, folder.path(), &["reload.cfg"]);
    assert!(output.status.success(), "{output:?}");
}

#[test]
#[cfg(feature = "page")]
fn nets_are_shown_and_wrong_ones_are_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = compile(&["cc", "-std=c99"], "tests/c/nets.c", folder.path());
    let output = run(&program, folder.path(), &[]);
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn a_loop_learns_that_the_run_is_over() {
    let folder = folder_with_tank();
    let program = compile(&["cc", "-std=c99"], "tests/c/over.c", folder.path());
    let (output, _) = with_server(folder.path(), 20, || {
        run(&program, folder.path(), &["sdsp.cfg"])
    });
    let told = String::from_utf8_lossy(&output.stdout);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(told, "over: turns=21 status=2\n", "{said}");
}

#[test]
fn values_of_every_kind_go_as_in_java() {
    let folder = folder_with_tank();
    let config = r#"
[driver]
id   = 1
name = "Values"

[fieldbus]
kind    = "loopback"
program = "mirror"
mode    = "stepped"
scan    = "10ms"

[[signal]]
name    = "pulse"
address = "%IX0.0"

[[signal]]
name    = "answer"
address = "%QX0.0"
latch   = "rising"

[[signal]]
name    = "whole"
address = "%IL8"
type    = "LINT"
fail_safe = -7

[[signal]]
name    = "natural"
address = "%IL16"
type    = "ULINT"
fail_safe = 42
"#;
    fs::write(folder.path().join("values.cfg"), config).expect("there is room");
    let program = compile(&["cc", "-std=c11"], "tests/c/values.c", folder.path());
    let output = run(&program, folder.path(), &["values.cfg"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?} {said}", output.status);
}

#[test]
fn a_process_that_ends_closes_what_it_has_left_open() {
    let folder = folder_with_tank();
    let program = compile(
        &["cc", "-std=c99", "-D_POSIX_C_SOURCE=200809L"],
        "tests/c/forgotten.c",
        folder.path(),
    );
    for end in ["return", "exit", "fork"] {
        let output = run(&program, folder.path(), &["tank.cfg", end]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{end}: {:?} {said}", output.status);
        let recorded = fs::read_to_string(folder.path().join("last.csv")).expect("recorded");
        let last = recorded.lines().last().expect("a line");
        assert!(last.contains("47.11"), "{end}: {recorded}");
    }
}

#[test]
fn the_header_has_every_status() {
    let header = fs::read_to_string(Path::new(ROOT).join("include/tickbus.h")).expect("the header");
    for code in Code::ALL {
        let entry = format!("TB_{} = {}", code.name(), code.code());
        assert!(
            header.contains(&entry),
            "{entry} is not in include/tickbus.h"
        );
    }
}
