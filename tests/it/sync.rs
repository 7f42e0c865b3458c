//! `tickbus sync` as a process: a run over TCP and through shared memory, controlled on stdin, interrupted, misused.
#![cfg(unix)]
#![allow(missing_docs, reason = "tests")]

mod diff;
#[cfg(feature = "page")]
mod page;
mod save;

use std::io::{BufRead as _, BufReader, Lines, Write as _};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::thread;

use tickbus::signal::DataType;
use tickbus::virtual_time::{
    Declaration, Ended, Outcome, Participant, Step, Variable, shared_memory, tcp,
};

/// A client that counts, and reads the count of the other one.
struct Counter(&'static str, &'static str);

impl Participant for Counter {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new(self.0);
        declaration.writes = vec![Variable::new(format!("{} count", self.0), DataType::Udint)];
        declaration.reads = vec![format!("{} count", self.1)];
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        assert_eq!(reads[0], step.sequence - 1);
        writes[0] = step.sequence;
        Ok(())
    }
}

/// A running `tickbus sync`.
struct Sync {
    child: Child,
    stdin: ChildStdin,
    lines: Lines<BufReader<ChildStdout>>,
    _file: tempfile::NamedTempFile,
}

impl Sync {
    fn start(text: &str, arguments: &[&str]) -> Self {
        Self::start_logging(text, arguments, "error")
    }

    /// Like [`start`](Self::start), with a log of this level on stderr.
    fn start_logging(text: &str, arguments: &[&str], level: &str) -> Self {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        std::fs::write(file.path(), text).expect("it can be written");
        let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .arg("sync")
            .arg(file.path())
            .args(arguments)
            .env("TICKBUS_LOG", level)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the tickbus program runs");
        let stdout = child.stdout.take().expect("it is piped");
        Self {
            stdin: child.stdin.take().expect("it is piped"),
            lines: BufReader::new(stdout).lines(),
            child,
            _file: file,
        }
    }

    fn line(&mut self) -> String {
        let line = self.lines.next().expect("a further line");
        line.expect("text")
    }

    /// The address on which it listens.
    fn address(&mut self) -> tickbus::net::Address {
        let line = self.line();
        let address = line.strip_prefix("sync: listening on ").expect(&line);
        address.parse().expect("an address")
    }

    fn say(&mut self, command: &str) {
        writeln!(self.stdin, "{command}").expect("it reads");
    }

    /// Waits for the end: the last line, and the exit code.
    fn end(mut self) -> (String, Option<i32>) {
        let last = self.lines.by_ref().map(|line| line.expect("text")).last();
        let status = self.child.wait().expect("it ends");
        (last.unwrap_or_default(), status.code())
    }
}

const CLIENTS: &str = "step = \"1ms\"\nclients = [\"a\", \"b\"]\n";

#[test]
fn two_transports_give_the_same_last_line() {
    let mut sync = Sync::start(
        &format!("[sync]\nlisten = \"127.0.0.1:0\"\nuntil = \"100ms\"\n{CLIENTS}"),
        &[],
    );
    let address = sync.address();
    let over_tcp: Vec<Result<Outcome, Ended>> = thread::scope(|scope| {
        let joined = [Counter("b", "a"), Counter("a", "b")].map(|mut counter| {
            let address = &address;
            scope.spawn(move || tcp::join(address, &mut counter))
        });
        joined.map(|client| client.join().expect("no panic")).into()
    });
    let outcome = over_tcp[0].clone().expect("it runs");
    assert_eq!(over_tcp[1], Ok(outcome));
    let (last, code) = sync.end();
    assert_eq!(code, Some(0));
    assert_eq!(
        last,
        format!("sync: ok steps=100 time=99ms hash={}", outcome.hash)
    );

    let name = format!("sync-{}", std::process::id());
    let mut sync = Sync::start(
        &format!("[sync]\nshared_memory = \"{name}\"\nuntil = \"100ms\"\n{CLIENTS}"),
        &[],
    );
    assert_eq!(
        sync.line(),
        format!("sync: waiting in the shared memory \"{name}\"")
    );
    thread::scope(|scope| {
        for mut counter in [Counter("b", "a"), Counter("a", "b")] {
            let name = &name;
            scope.spawn(move || shared_memory::join(name, &mut counter).expect("it runs"));
        }
    });
    assert_eq!(sync.end(), (last, Some(0)));
}

#[test]
fn a_unix_socket_has_one_server_and_is_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = format!("unix:{}", folder.path().join("run").display());
    let address: tickbus::net::LocalAddress = place.parse().expect("a path");
    let text =
        format!("[sync]\nlisten = \"{place}\"\nstep = \"1ms\"\nclients = 1\nuntil = \"5ms\"\n");
    let run = |sync: &mut Sync| {
        assert_eq!(sync.line(), format!("sync: listening on {place}"));
        tcp::join_local(&address, &mut Counter("a", "a")).expect("it runs")
    };
    let mut killed = Sync::start(&text, &[]);
    assert_eq!(killed.line(), format!("sync: listening on {place}"));
    let (last, code) = Sync::start(&text, &[]).end();
    assert_eq!(code, Some(3));
    let reason =
        format!("cannot listen on {place}: another server listens there; stop that server");
    assert!(last.contains(&reason), "{last}");
    killed.child.kill().expect("it runs");
    killed.child.wait().expect("it was started");
    assert!(address.path().exists(), "a killed server leaves its file");
    let mut sync = Sync::start(&text, &[]);
    let outcome = run(&mut sync);
    let expected = format!("sync: ok steps=5 time=4ms hash={}", outcome.hash);
    assert_eq!(sync.end(), (expected, Some(0)));
    assert!(!address.path().exists());
    std::fs::write(address.path(), "precious").expect("a file");
    let (last, code) = Sync::start(&text, &[]).end();
    assert_eq!(code, Some(3));
    assert!(
        last.contains("a file that is no socket is there; write a path that is free"),
        "{last}"
    );
}

#[test]
fn a_paused_run_is_stepped_and_stopped_by_commands() {
    let text = "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"1ms\"\nclients = 1\n";
    let mut sync = Sync::start(text, &["--paused"]);
    let address = sync.address();
    let mut alone = Counter("a", "a");
    thread::scope(|scope| {
        let joined = scope.spawn(|| tcp::join(&address, &mut alone));
        assert_eq!(sync.line(), "sync: client \"a\" has joined");
        assert_eq!(sync.line(), "sync: all have joined: the run starts");
        for command in ["step 3", "nonsense", "step", "stop"] {
            sync.say(command);
        }
        assert!(
            sync.line()
                .contains("\"nonsense\" is not a command; commands are pause")
        );
        let outcome = joined.join().expect("no panic").expect("it was stopped");
        assert!(outcome.steps <= 4, "{outcome:?}");
        let hash = outcome.hash;
        let (last, code) = sync.end();
        assert!(
            last.starts_with(&format!("sync: ok steps={} ", outcome.steps)),
            "{last}"
        );
        assert!(last.ends_with(&format!("hash={hash}")), "{last}");
        assert_eq!(code, Some(0));
    });
}

#[test]
fn an_interrupt_while_it_waits_ends_it_and_says_for_whom() {
    let mut sync = Sync::start(&format!("[sync]\nlisten = \"127.0.0.1:0\"\n{CLIENTS}"), &[]);
    sync.address();
    let pid = rustix::process::Pid::from_child(&sync.child);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("it runs");
    let (last, code) = sync.end();
    let reason = r#"stopped while it waited for "a", "b""#;
    assert_eq!(
        last,
        format!("sync: failed cause=stopped steps=0 reason={reason:?}")
    );
    assert_eq!(code, Some(3));
}

#[test]
fn wrong_files_and_contradictions_have_exit_code_1() {
    let mut sync = Sync::start("[sync]\nstep = \"soon\"\n", &[]);
    let mut told = String::new();
    let stderr = sync.child.stderr.take().expect("it is piped");
    std::io::Read::read_to_string(&mut BufReader::new(stderr), &mut told).expect("text");
    assert!(told.contains(":2:8: \"soon\" is not a duration"), "{told}");
    assert!(told.ends_with("sync: failed mistakes=3\n"), "{told}");
    assert_eq!(sync.end().1, Some(1));

    let text = "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"1ms\"\nclients = 1\n";
    let mut sync = Sync::start(text, &[]);
    let address = sync.address();
    tcp::join(&address, &mut Counter("a", "nobody")).expect_err("nobody writes it");
    let (last, code) = sync.end();
    assert!(
        last.starts_with("sync: failed cause=configuration steps=0 reason="),
        "{last}"
    );
    assert_eq!(code, Some(1));
}

#[test]
fn a_script_is_the_logic_or_the_feature_is_named() {
    let mut script = tempfile::NamedTempFile::new().expect("a temporary file");
    writeln!(
        script,
        "variable(\"b count\", \"UDINT\");\non_time(|| set(\"b count\", step() - 1));"
    )
    .expect("it can be written");
    let text = format!(
        "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"1ms\"\nclients = 1\nuntil = \"5ms\"\nlogic = \"{}\"\n",
        script.path().display()
    );
    let mut sync = Sync::start(&text, &[]);
    if cfg!(feature = "script") {
        let address = sync.address();
        tcp::join(&address, &mut Late).expect("it runs");
        assert!(sync.end().0.starts_with("sync: ok steps=5 "));
    } else {
        let mut told = String::new();
        let stderr = sync.child.stderr.take().expect("it is piped");
        std::io::Read::read_to_string(&mut BufReader::new(stderr), &mut told).expect("text");
        assert!(
            told.contains("built without scripts; build it with --features script"),
            "{told}"
        );
        assert_eq!(sync.end().1, Some(1));
    }
}

/// Reads the values that the logic has written in the previous step.
struct Late;

impl Participant for Late {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new("late");
        declaration.reads = vec!["b count".to_owned()];
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], _: &mut [u64]) -> Result<(), String> {
        assert_eq!(reads[0], step.sequence.saturating_sub(2));
        Ok(())
    }
}

#[test]
fn a_client_s_reason_cannot_forge_the_last_line() {
    let mut sync = Sync::start(
        "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"1ms\"\nclients = [\"a\"]\n",
        &[],
    );
    let address = sync.address();
    let ended = tcp::join(&address, &mut Forger).expect_err("it gives up");
    assert!(ended.reason.contains('\n'), "the client gets it as it is");
    let (last, code) = sync.end();
    assert_eq!(code, Some(3));
    assert_eq!(
        last,
        r#"sync: failed cause=failed client="a" steps=0 reason="gave up: \"\nsync: ok steps=1""#
    );
}

/// Gives up with a reason that looks like a verdict.
struct Forger;

impl Participant for Forger {
    fn declare(&self) -> Declaration {
        Declaration::new("a")
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, _: Step, _: &[u64], _: &mut [u64]) -> Result<(), String> {
        Err("\"\nsync: ok steps=1".to_owned())
    }
}
