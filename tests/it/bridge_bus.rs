//! `tickbus bridge bus` as a process, and the key of a laboratory.
#![cfg(unix)]
#![allow(missing_docs, reason = "tests")]

use std::path::{Path, PathBuf};

use crate::commands::{LabClient, Running, bridge, dispatch};

const KEY: &str = "0123456789abcdef";

/// A device whose PLC sends each value back.
const MIRROR: &str = "[driver]\nid = 1\nname = \"Real PLC\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\nscan = \"1ms\"\n\
    [[signal]]\nname = \"run\"\naddress = \"%IX0.0\"\n\
    [[signal]]\nname = \"set\"\naddress = \"%IW2\"\ntype = \"INT\"\nscale = { raw = [0, 1000], value = [0.0, 10.0] }\n\
    [[signal]]\nname = \"running\"\naddress = \"%QX0.0\"\n\
    [[signal]]\nname = \"is\"\naddress = \"%QW2\"\ntype = \"INT\"\nscale = { raw = [0, 1000], value = [0.0, 10.0] }\n";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.path(name), text).expect("a file");
        self.path(name).to_str().expect("text").to_owned()
    }
}

fn locked_dispatch(patch: &Path, key: &str) -> Running {
    let patch = patch.to_str().expect("text");
    let arguments = [
        "--patch",
        patch,
        "--listen",
        "127.0.0.1:0",
        "--key-file",
        key,
    ];
    Running::of("dispatch", &arguments)
}

#[test]
fn values_of_a_bus_move_both_ways_in_engineering_units_and_a_second_bridge_of_the_name_is_told() {
    let folder = Folder::new();
    let file = folder.write("driver.cfg", MIRROR);
    let mut lab = dispatch(&folder.path("lab.toml"), "127.0.0.1:0");
    let address = lab.after("dispatch: listening on ");
    let mut first = bridge(&["bus", &file, "--dispatcher", &address]);
    assert_eq!(first.after("bridge: Real_PLC has "), "Q01 I01 AQ01 AI01");
    assert_eq!(first.after("bridge: Real_PLC:Q1 is "), "\"running\"");
    first.after("bridge: Real_PLC opening: joined ");
    let mut second = bridge(&["bus", &file, "--dispatcher", &address]);
    let told = second.after("bridge: Real_PLC failed: ");
    assert!(told.contains("another client \"Real_PLC\""), "{told}");
    let mut third = bridge(&["bus", &file, "--dispatcher", &address, "--name", "OTHER"]);
    third.after("bridge: OTHER opening: joined ");

    let mut tank = LabClient::connect(&address, "VP TANK Q1 I1 AQ1 AI1 V=3");
    tank.say("CONNECT I1:Real_PLC:Q1 AI1:Real_PLC:AQ1 Q1:Real_PLC:I1 AQ1:Real_PLC:AI1");
    tank.until("OK CONNECT");
    tank.say("P Q1=24 AQ1=3.21");
    // Two signals of one line may arrive with two ticks.
    tank.until_values("AI1=3.21");
    // Its channels are called what the driver.cfg calls them.
    let begun = std::time::Instant::now();
    let mut names = Vec::new();
    while names.len() < 8 {
        assert!(begun.elapsed().as_secs() < 60, "{names:?}");
        tank.say("LIST NAMES");
        names = std::iter::from_fn(|| Some(tank.until("")).filter(|line| !line.starts_with("END")))
            .collect();
        names.retain(|line| line.starts_with("NAME "));
    }
    for name in ["Q1 running", "I1 run", "AQ1 is", "AI1 set"] {
        assert!(
            names.contains(&format!("NAME Real_PLC:{name}")),
            "{names:?}"
        );
    }
    tank.say("P Q1=0 AQ1=-1");
    tank.until_values("AI1=-1");
    // The first bridge ends, and the second one gets the name.
    assert_eq!(first.interrupt().1, Some(0));
    tank.until_values("AI1=?");
    second.after("bridge: Real_PLC running: joined ");
    tank.until_values("AI1=-1");
    for (running, begin) in [(second, "bridge: ok ticks="), (third, "bridge: ok ticks=")] {
        let (last, code) = running.interrupt();
        assert!(last.starts_with(begin), "{last}");
        assert_eq!(code, Some(0));
    }
    lab.interrupt();
}

#[test]
fn a_laboratory_with_a_key_takes_only_bridges_and_simulations_that_know_it() {
    let folder = Folder::new();
    let (key, wrong) = (
        folder.write("lab.key", &format!("{KEY}\n")),
        folder.write("wrong.key", "fedcba9876543210\n"),
    );
    let file = folder.write("driver.cfg", MIRROR);
    let mut lab = locked_dispatch(&folder.path("lab.toml"), &key);
    let address = lab.after("dispatch: listening on ");
    let join = |name: &str, more: &[&str]| {
        let mut arguments = vec!["bus", &file, "--dispatcher", &address, "--name", name];
        arguments.extend(more);
        bridge(&arguments)
    };
    let mut right = join("RIGHT", &["--key-file", &key]);
    right.after("bridge: RIGHT opening: joined ");
    let mut none = join("NONE", &[]);
    let told = none.after("bridge: NONE failed: ");
    assert!(told.contains("this laboratory has a key"), "{told}");
    let mut other = join("OTHER", &["--key-file", &wrong]);
    let told = other.after("bridge: OTHER failed: ");
    assert!(told.contains("the key is wrong"), "{told}");
    assert!(
        lab.after("dispatch: a client at 127.0.0.1:")
            .contains("has stated a wrong key")
    );
    drop((none, other));

    // The key by hand, as with telnet.
    let mut by_hand = LabClient::open(&address);
    by_hand.say(&format!("KEY {KEY}"));
    // The one who guesses has the same address.
    let mut answer = by_hand.until("");
    while answer.starts_with("ERR 429") {
        by_hand = LabClient::open(&address);
        by_hand.say(&format!("KEY {KEY}"));
        answer = by_hand.until("");
    }
    assert_eq!(answer, "OK KEY");
    by_hand.say("VP TANK Q1 V=2");
    assert_eq!(by_hand.until("END"), "END 2");
    assert_eq!(right.interrupt().1, Some(0));

    // A driver.cfg of the kind "dispatcher" names the key beside it.
    let member = |key: &str| {
        let text = format!(
            "[driver]\nid = 2\nname = \"MEMBER\"\n[fieldbus]\nkind = \"dispatcher\"\naddress = \"{address}\"\nkey_file = \"{key}\"\n\
             [[signal]]\nname = \"on\"\naddress = \"%IX0.0\"\n"
        );
        folder.write("member.cfg", &text)
    };
    let mut mirror = Running::of("mirror", &[&member("lab.key")]);
    mirror.after("mirror: running: joined ");
    assert_eq!(mirror.interrupt().1, Some(0));
    let checked = Running::of("check", &[&member("no.key")]).end();
    assert_eq!(checked.1, Some(1), "{}", checked.0);
    let (last, code) = lab.interrupt();
    assert!(last.contains(" wrong_keys="), "{last}");
    assert_eq!(code, Some(0));
}

#[test]
fn a_file_that_no_bridge_can_use_is_refused_at_once() {
    let folder = Folder::new();
    let short = folder.write("short.key", "short\n");
    let unknown = MIRROR.replace("\"loopback\"", "\"loopbak\"");
    let stepped = MIRROR.replace("scan = \"1ms\"", "scan = \"1ms\"\nmode = \"stepped\"");
    let (no_signals, _) = MIRROR.split_once("[[signal]]").expect("signals");
    let many: Vec<String> = (0..257)
        .map(|at| format!("[[signal]]\nname = \"{at}\"\naddress = \"%QB{at}\"\n"))
        .collect();
    let many = many.concat();
    for (text, more, code, part) in [
        (&*unknown, &[][..], 1, "did you mean \"loopback\""),
        (no_signals, &[], 1, "the file has no [signal]"),
        (&stepped, &[], 1, "runs in steps"),
        (&format!("{no_signals}{many}"), &[], 1, "257 channels AQ"),
        (MIRROR, &["--name", ""], 1, "cannot be the name of a client"),
        (MIRROR, &["--address", "127.0.0.1:1"], 1, "has no address"),
        (
            MIRROR,
            &["--key-file", &short],
            2,
            "the key has 5 characters",
        ),
        (
            MIRROR,
            &["--key-file", "no-such-file"],
            2,
            "there is no such file",
        ),
        (MIRROR, &["--tick", "0ms"], 2, "no time at all"),
    ] {
        let file = folder.write("driver.cfg", text);
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tickbus"));
        command.args(["bridge", "bus", &file]).args(more);
        let output = command.output().expect("it runs");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(told.contains(part), "{part} in\n{told}");
        assert_eq!(output.status.code(), Some(code), "{part}\n{told}");
    }
}

#[test]
fn stations_that_would_be_the_same_client_are_refused_with_both_names() {
    let folder = Folder::new();
    let signal = |station: &str| {
        format!(
            "[[signal]]\nname = \"run {station}\"\nstation = \"{station}\"\naddress = \"%IX0.0\"\n"
        )
    };
    let file = folder.write(
        "driver.cfg",
        &format!(
            "[driver]\nid = 1\nname = \"HALL\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
             [[station]]\nname = \"Ofen ä\"\n[[station]]\nname = \"Ofen ö\"\n{}{}",
            signal("Ofen ä"),
            signal("Ofen ö")
        ),
    );
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tickbus"));
    let output = command.args(["bridge", "bus", &file]).output();
    let output = output.expect("it runs");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("\"Ofen ä\" and \"Ofen ö\" would both be the client HALL.Ofen__"),
        "{told}"
    );
    assert!(told.contains("rename one of the stations"), "{told}");
    assert_eq!(output.status.code(), Some(1), "{told}");
}
