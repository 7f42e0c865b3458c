//! `tickbus sync --save-to` and `--restore` as processes.

use std::path::Path;

use super::*;

/// Runs the clients at a `tickbus sync` with these arguments: the lines of the server, and its exit code.
fn run(arguments: &[&str], until: &str) -> (Vec<String>, Option<i32>) {
    let text = format!("[sync]\nlisten = \"127.0.0.1:0\"\nuntil = \"{until}\"\n{CLIENTS}");
    let mut sync = Sync::start(&text, arguments);
    let address = sync.address();
    thread::scope(|scope| {
        for mut counter in [Counter("a", "b"), Counter("b", "a")] {
            let address = &address;
            scope.spawn(move || tcp::join(address, &mut counter));
        }
    });
    let lines: Vec<String> = sync
        .lines
        .by_ref()
        .map(|line| line.expect("text"))
        .collect();
    (lines, sync.child.wait().expect("it ends").code())
}

fn text(path: &Path) -> &str {
    path.to_str().expect("text")
}

#[test]
fn a_run_that_was_saved_and_restored_in_new_processes_is_equal_to_the_whole_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let [saved, whole, second] =
        ["cell.saved", "whole.vcd", "second.vcd"].map(|name| folder.path().join(name));
    let (lines, code) = run(&["--record", text(&whole)], "1s");
    let last = lines.last().cloned();
    assert_eq!(code, Some(0));
    let (lines, code) = run(&["--save-to", text(&saved), "--save-at", "500"], "600ms");
    let line = format!("sync: saved after step 500 in {}", saved.display());
    assert!(lines.contains(&line), "{lines:#?}");
    assert_eq!(code, Some(0));
    let arguments = ["--restore", text(&saved), "--record", text(&second)];
    let (lines, code) = run(&arguments, "1s");
    assert_eq!((lines.last().cloned(), code), (last, Some(0)));
    let (told, code) = super::diff::diff([&whole, &second]);
    assert!(told.starts_with("diff: equal steps=1000 hash="), "{told}");
    assert_eq!(code, Some(0));
}

#[test]
fn a_run_that_cannot_be_saved_or_restored_ends_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let nowhere = folder.path().join("none/cell.saved");
    let (lines, code) = run(&["--save-to", text(&nowhere), "--save-at", "5"], "10ms");
    let part = format!("sync: not saved: {}: ", nowhere.display());
    assert!(
        lines.iter().any(|line| line.starts_with(&part)),
        "{lines:#?}"
    );
    assert!(
        lines
            .last()
            .is_some_and(|line| line.starts_with("sync: ok steps=10 "))
    );
    assert_eq!(code, Some(3));

    let damaged = folder.path().join("cell.saved");
    std::fs::write(&damaged, "TICKSYNC").expect("it can be written");
    let listen = format!("[sync]\nlisten = \"127.0.0.1:0\"\n{CLIENTS}");
    for (arguments, part) in [
        (
            vec!["--restore", text(&damaged)],
            "cell.saved: byte 8: the file is cut; ",
        ),
        (vec!["--restore", text(&nowhere)], "none/cell.saved: "),
        (vec!["--save-at", "5"], "--save-to <FILE>"),
    ] {
        let sync = Sync::start(&listen, &arguments);
        let output = sync.child.wait_with_output().expect("it ends");
        let told = String::from_utf8(output.stderr).expect("text");
        assert!(told.contains(part), "{told}");
        assert!(output.status.code().is_some_and(|code| code != 0));
    }
}
