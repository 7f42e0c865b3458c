//! Libraries in helper processes: a failure of the one does not affect the other.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Manual;

use crate::conformance::rig::{CYCLE, End, await_that, logged};
use crate::fixture::{HELPER, Misbehaving, until, until_it_echoes};

#[test]
fn a_crash_ends_the_helper_alone_and_the_line_comes_back() {
    for (what, words) in [
        ("crash", "was ended by SIGSEGV"),
        ("abort", "was ended by SIGABRT"),
        ("exit", "ended with exit code 3"),
    ] {
        for (function, good) in [("open", ""), ("exchange", ", good = 5")] {
            let plugin = Misbehaving::once(true, &format!("{function} = \"{what}\"{good}"));
            let clock = Manual::new();
            let mut end = plugin.open(&clock);
            let reason = until(&end, &clock, "failed", "link");
            let how = format!("libmisbehave.so: its helper process {words}");
            let place = format!(" in tickbus_{function}; ");
            assert!(reason.contains(&how) && reason.contains(&place), "{reason}");
            until_it_echoes(&mut end, &clock, 5.0);
            assert_eq!(end.statistic("plugin.helpers"), "2");
        }
    }
}

/// The process id of the current helper.
fn helper_of(end: &End) -> u32 {
    process(&end.statistic("helper"))
}

fn process(fact: &str) -> u32 {
    let (_, number) = fact.rsplit_once(" as process ").expect("a process");
    number.parse().expect("a number")
}

/// True if a process exists, even as a zombie.
fn exists(process: u32) -> bool {
    Path::new(&format!("/proc/{process}")).exists()
}

/// True if a process that is not our child has ended; another process reaps it.
fn has_ended(process: u32) -> bool {
    fs::read_to_string(format!("/proc/{process}/stat"))
        .ok()
        .and_then(|stat| {
            stat.rsplit_once(") ")
                .map(|(_, rest)| rest.starts_with('Z'))
        })
        .unwrap_or(true)
}

#[test]
fn a_helper_whose_call_never_returns_is_ended_and_the_line_comes_back() {
    for function in ["open", "exchange"] {
        let mut plugin = Misbehaving::once(true, &format!("{function} = \"hang\""));
        plugin.extra = "open_timeout = \"2s\"\ncall_timeout = \"50ms\"\n".to_owned();
        let clock = Manual::new();
        let mut end = plugin.open(&clock);
        await_that("the call hangs", || {
            clock.advance(CYCLE);
            plugin.file("once").exists()
        });
        let hung = helper_of(&end);
        let reason = until(&end, &clock, "failed", "link");
        let words = format!("tickbus_{function} has not returned for ");
        assert!(
            reason.contains(&words) && reason.contains("was ended"),
            "{reason}"
        );
        assert!(!exists(hung), "no zombie is left");
        until_it_echoes(&mut end, &clock, 6.0);
        let second = helper_of(&end);
        assert_ne!(second, hung);
        end.driver.close();
        assert!(!exists(second), "no zombie is left");
    }
}

#[test]
fn closing_ends_a_helper_whose_close_hangs() {
    let mut plugin = Misbehaving::new(true, "close = \"hang\"");
    plugin.extra += "close_timeout = \"20ms\"\n";
    let clock = Manual::new();
    let mut end = plugin.open(&clock);
    until_it_echoes(&mut end, &clock, 2.0);
    let helper = helper_of(&end);
    end.driver.close();
    assert!(!exists(helper));
}

#[test]
fn closing_does_not_wait_for_an_exchange() {
    let mut plugin = Misbehaving::new(true, "exchange = \"hang\", good = 1");
    plugin.extra += "close_timeout = \"20ms\"\n";
    let clock = Manual::new();
    let end = plugin.open(&clock);
    until(&end, &clock, "running", "running");
    let helper = helper_of(&end);
    end.driver.close();
    assert!(!exists(helper));
}

/// The reason with a shell script as the helper, whose stdin is the socket to the host.
#[track_caller]
fn reason_with_helper(script: &str, cause: &str) -> String {
    let mut plugin = Misbehaving::new(false, "");
    let helper = plugin.file("helper");
    fs::write(&helper, format!("#!/bin/sh\n{script}\n")).expect("written");
    fs::set_permissions(&helper, fs::Permissions::from_mode(0o700)).expect("a program");
    let _ = write!(
        plugin.extra,
        "isolated = true\nhelper = \"{}\"\n",
        helper.display()
    );
    let clock = Manual::new();
    until(&plugin.open(&clock), &clock, "failed", cause)
}

#[test]
fn a_helper_that_is_not_this_tickbus_is_told_so() {
    let reason = reason_with_helper("exit 5", "link");
    assert!(
        reason.contains("ended with exit code 5 before it said hello"),
        "{reason}"
    );
    let hello = r"printf '\007\000\000\000\000\0059.9.9' >&0; read line";
    let reason = reason_with_helper(hello, "refused");
    assert!(
        reason.contains("is tickbus 9.9.9, and this is tickbus "),
        "{reason}"
    );
    let garbage = "echo 'Usage: helper' >&0; read line";
    let reason = reason_with_helper(garbage, "protocol");
    assert!(
        reason.contains("answered with a message of 1734439765 bytes, expected at most"),
        "{reason}"
    );
    let done = r"printf '\002\000\000\000\002\000' >&0; read line";
    let reason = reason_with_helper(done, "protocol");
    assert!(
        reason.contains("answered with \"done\" out of turn"),
        "{reason}"
    );
}

/// `tickbus mirror` with a plug-in in a helper, as a separate process.
struct Mirror {
    child: Child,
    lines: std::io::Lines<BufReader<std::process::ChildStdout>>,
}

impl Mirror {
    fn start(plugin: &Misbehaving, stderr: Stdio) -> Self {
        let file = plugin.file("driver.cfg");
        fs::write(&file, plugin.text()).expect("written");
        let mut child = Command::new(HELPER)
            .args(["mirror", "--stats=10ms"])
            .arg(&file)
            .stdout(Stdio::piped())
            .stderr(stderr)
            .spawn()
            .expect("starts");
        let lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
        Self { child, lines }
    }

    /// The value in the next line on stdout with this key.
    fn next(&mut self, key: &str) -> String {
        let start = format!("{key}=");
        let mut values = self.lines.by_ref().map_while(Result::ok);
        let found = values.find_map(|line| line.strip_prefix(&start).map(str::to_owned));
        found.expect("the mirror goes on")
    }

    fn kill(mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it has ended");
    }
}

#[test]
fn a_helper_ends_when_its_host_is_killed_even_if_the_library_hangs() {
    for options in ["", "exchange = \"hang\""] {
        let mut plugin = Misbehaving::new(true, options);
        plugin.extra += "close_timeout = \"50ms\"\n";
        let mut mirror = Mirror::start(&plugin, Stdio::null());
        let helper = process(&mirror.next("helper"));
        if options.is_empty() {
            while mirror.next("state") != "running" {}
        }
        mirror.kill();
        await_that("the helper ends", || has_ended(helper));
    }
}

#[test]
fn what_a_library_in_a_helper_prints_goes_to_stderr_and_its_stdin_is_empty() {
    for what in ["print", "stdin"] {
        let plugin = Misbehaving::new(true, &format!("exchange = \"{what}\""));
        let stderr = fs::File::create(plugin.file("stderr")).expect("a file");
        let mut mirror = Mirror::start(&plugin, stderr.into());
        let mut lines = Vec::new();
        while mirror.next("state") != "running" {}
        await_that("it has printed", || {
            lines.push(mirror.lines.next().expect("goes on").expect("text"));
            let printed = fs::read_to_string(plugin.file("stderr")).expect("text");
            what == "stdin" || printed.contains("the plug-in prints\n")
        });
        assert!(
            !lines.iter().any(|line| line.contains("prints")),
            "{lines:?}"
        );
        mirror.kill();
    }
}

#[test]
fn the_helper_command_is_not_for_people() {
    let output = Command::new(HELPER)
        .arg("plugin-helper")
        .stdin(Stdio::null())
        .output()
        .expect("runs");
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("this command is for tickbus itself"),
        "{told}"
    );
}

#[test]
fn the_command_beside_the_driver_cfg_is_found() {
    let mut plugin = Misbehaving::new(false, "");
    plugin.extra += "isolated = true\n";
    std::os::unix::fs::symlink(HELPER, plugin.file("tickbus")).expect("a link");
    let file = plugin.file("driver.cfg");
    fs::write(&file, plugin.text()).expect("written");
    let clock = Manual::new();
    let config = Config::load(&file, &tickbus::KINDS).expect("a right file");
    let _logged = logged::Watch::new();
    let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
    await_that("it runs", || {
        clock.advance(CYCLE);
        driver.statistics().contains("\nstate=running\n")
    });
    let helper = format!("\nhelper={}", plugin.file("tickbus").display());
    assert!(
        driver.statistics().contains(&helper),
        "{}",
        driver.statistics()
    );
}
