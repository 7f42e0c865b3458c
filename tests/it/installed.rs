//! The command as an installed tool: its version, completions, manual pages, schema, and JSON documents.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn tickbus(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(arguments)
        .current_dir(repository())
        .output()
        .expect("the tickbus program runs")
}

#[track_caller]
fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

/// Runs a command with `--json`; returns its exit code and its document.
#[track_caller]
fn document(arguments: &[&str]) -> (Option<i32>, Value) {
    let output = tickbus(&[arguments, &["--json"]].concat());
    let text = stdout(&output);
    let document: Value =
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
    let is_done = output.status.code() == Some(0);
    assert_eq!(document["ok"], is_done, "{text}");
    (output.status.code(), document)
}

#[test]
fn the_long_version_has_commit_and_features_and_the_short_one_is_a_line() {
    let short = stdout(&tickbus(&["-V"]));
    assert_eq!(short, concat!("tickbus ", env!("CARGO_PKG_VERSION"), "\n"));
    let long = stdout(&tickbus(&["--version"]));
    let mut lines = long.lines();
    let first = lines.next().expect("a line");
    let rest = first.strip_prefix(short.trim_end()).expect("the version");
    // An archive has no git, and no commit.
    let git = Command::new("git")
        .arg("log")
        .current_dir(repository())
        .output();
    if git.is_ok_and(|git| git.status.success()) {
        let (commit, date) = rest
            .strip_prefix(" (")
            .and_then(|rest| rest.strip_suffix(')')?.split_once(' '))
            .expect(first);
        assert!(
            commit.len() >= 8 && commit.bytes().all(|digit| digit.is_ascii_hexdigit()),
            "{first}"
        );
        assert_eq!(date.len(), "2026-11-26".len(), "{first}");
    } else {
        assert_eq!(rest, "");
    }
    let features = lines
        .next()
        .and_then(|line| line.strip_prefix("features: "));
    let features: Vec<&str> = features.expect("the features").split(' ').collect();
    assert_eq!(features.contains(&"page"), cfg!(feature = "page"));
    assert_eq!(features.contains(&"none"), features == ["none"]);
    assert_eq!(lines.next(), None);
}

#[test]
fn five_shells_complete_the_subcommands() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = stdout(&tickbus(&["completions", shell]));
        for word in ["check", "dispatch", "json"] {
            assert!(script.contains(word), "{word} in {shell}");
        }
        assert!(!script.contains("plugin-helper"), "hidden in {shell}");
    }
    assert_eq!(tickbus(&["completions", "cmd"]).status.code(), Some(2));
}

#[test]
fn each_subcommand_has_a_manual_page_and_the_exit_codes_are_in_the_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let pages = folder.path().join("man1");
    let output = tickbus(&["man", pages.to_str().expect("UTF-8")]);
    assert_eq!(output.status.code(), Some(0));
    let page = |name: &str| fs::read_to_string(pages.join(name)).expect(name);
    let first = page("tickbus.1");
    for code in [
        "0  done",
        "1  the input",
        "2  the command",
        "3  the bus",
        "130  interrupted",
    ] {
        assert!(first.contains(code), "{code}");
    }
    let help = stdout(&tickbus(&["--help"]));
    let commands = help.split("Commands:\n").nth(1).expect("the commands");
    let commands = commands.lines().take_while(|line| !line.is_empty());
    let names = commands.filter_map(|line| line.split_whitespace().next());
    let names: Vec<&str> = names.filter(|name| *name != "help").collect();
    assert!(names.len() > 15, "{names:?}");
    for name in names {
        assert!(
            page(&format!("tickbus-{name}.1")).contains(".SH OPTIONS"),
            "{name}"
        );
    }
    assert!(!pages.join("tickbus-plugin-helper.1").exists());
    let file = folder.path().join("file");
    fs::write(&file, "").expect("a file");
    let output = tickbus(&["man", file.to_str().expect("UTF-8")]);
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn the_schema_has_the_kinds_of_this_command() {
    let schema: Value = serde_json::from_str(&stdout(&tickbus(&["schema"]))).expect("JSON");
    let kinds = &schema["properties"]["fieldbus"]["properties"]["kind"]["enum"];
    let kinds: Vec<&str> = kinds
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(Value::as_str)
        .collect();
    assert_eq!(kinds, tickbus::KINDS.names());
}

/// The mistakes on stdout are those on stderr; see `check.rs` for the latter.
#[test]
fn a_document_of_check_has_each_mistake_with_its_place() {
    let (code, document) = document(&["check", "tests/wrong/types.cfg"]);
    assert_eq!(code, Some(1));
    let told =
        fs::read_to_string(repository().join("tests/wrong/types.txt")).expect("the mistakes");
    let mistakes = document["mistakes"].as_array().expect("a list").iter();
    let lines = mistakes.map(|mistake| {
        let text = |key: &str| mistake[key].as_str().expect(key).to_owned();
        let file = text("file");
        let file = file.rsplit('/').next().expect("a name").to_owned();
        format!(
            "{file}:{}:{}: {}; {}\n",
            mistake["line"],
            mistake["column"],
            text("what"),
            text("right")
        )
    });
    assert_eq!(lines.collect::<String>(), told);
    let (code, missing) = self::document(&["check", "no such file.cfg"]);
    assert_eq!(code, Some(1));
    assert!(missing["mistakes"][0]["line"].is_null());
}

#[test]
fn a_document_of_check_describes_a_right_file() {
    let (code, all) = document(&["check", "tests/right/everything.cfg"]);
    assert_eq!((code, &all["mistakes"]), (Some(0), &serde_json::json!([])));
    assert_eq!(all["driver"]["name"], "Bottling line");
    assert_eq!(all["role"], "controller");
    assert_eq!(all["bus"]["kind"], "loopback");
    assert_eq!(all["timing"]["cycle_ns"], 50_000_000);
    assert_eq!(all["timing"]["reconnect_ns"][1], 1_500_000_000);
    assert_eq!(all["stations"][0]["input_bytes"], 24);
    let signals = all["signals"].as_array().expect("a list");
    let named = |name: &str| {
        let mut signals = signals.iter();
        signals.find(|signal| signal["name"] == name).expect(name)
    };
    assert_eq!(named("Level")["address"], "%IW2");
    assert_eq!(named("Level")["fail_safe"], -10.0);
    assert_eq!(named("Valve open")["latch"], "both");
    assert_eq!(named("Valve open")["fail_safe"], true);
    assert_eq!(named("Serial number")["fail_safe"], u64::MAX);
    assert_eq!(named("Drift")["fail_safe"], i64::MIN);
    assert_eq!(all["faults"].as_array().map(Vec::len), Some(5));
    let (_, axes) = document(&["check", "tests/right/axes.cfg"]);
    assert!(axes["axes"][0]["name"].is_string());
}

#[test]
fn plc_report_test_and_gsd_have_documents() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let (recording, page) = (at("run.csv"), at("run.html"));
    let (code, plc) = document(&[
        "plc",
        "rig",
        "--config",
        "driver.cfg",
        "--address",
        "127.0.0.1:1",
        "--duration",
        "200ms",
        "--stats",
        "--record",
        &recording,
    ]);
    // Nobody listens there.
    assert_eq!(code, Some(3));
    assert!(
        plc["reason"]
            .as_str()
            .expect("a reason")
            .starts_with("the line never ran")
    );
    assert!(plc["scans"].as_u64() > Some(0));
    assert_eq!(plc["statistics"]["state"], "failed");
    let (code, report) = document(&["report", &recording, "--out", &page]);
    assert_eq!(
        (code, &report["file"]),
        (Some(0), &Value::from(page.as_str()))
    );
    assert_eq!(
        report["bytes"].as_u64(),
        fs::metadata(&page).ok().map(|page| page.len())
    );
    let (code, report) = document(&["report", &at("nothing.csv")]);
    assert_eq!(
        (code, report["mistakes"].as_array().map(Vec::len)),
        (Some(1), Some(1))
    );
    let (code, gsd) = document(&[
        "gsd",
        "tests/right/profibus-device.cfg",
        "--ident",
        "0x80E0",
    ]);
    let golden = fs::read_to_string(repository().join("tests/right/profibus-device.gsd"));
    assert_eq!(
        (code, gsd["gsd"].as_str()),
        (Some(0), golden.ok().as_deref())
    );
    let (code, tests) = document(&["test", "examples/tests"]);
    assert_eq!((code, &tests["failed"]), (Some(0), &Value::from(0)));
    let first = &tests["files"][0]["tests"][0];
    assert_eq!(first["verdict"], "passed");
    let (code, wrong) = document(&["test", "tests/wrong-tests/keys.toml"]);
    assert_eq!((code, &wrong["ok"]), (Some(1), &Value::from(false)));
    assert_eq!(wrong["files"][0]["tests"][0]["verdict"], "wrong");
}

/// Output that goes into a file or a pipe has no colours, and no line of progress.
#[test]
fn a_pipe_gets_no_escape_codes() {
    for arguments in [
        &["--help"][..],
        &["check", "--no-such-option"],
        &["check", "tests/wrong/types.cfg"],
        &["check", "driver.cfg"],
        &["test", "examples/tests"],
    ] {
        let output = tickbus(arguments);
        for text in [&output.stdout, &output.stderr] {
            assert!(!text.contains(&0x1b), "{arguments:?}");
        }
    }
}

/// A copy of each unit, with this build's command, is what systemd accepts; and the command accepts what the unit says.
#[test]
#[cfg(target_os = "linux")]
fn systemd_accepts_the_units_and_the_command_their_options() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut units = Vec::new();
    for entry in fs::read_dir(repository().join("examples/systemd")).expect("the units") {
        let path = entry.expect("an entry").path();
        let text = fs::read_to_string(&path).expect("a text");
        let command = text
            .lines()
            .find_map(|line| line.strip_prefix("ExecStart=/usr/local/bin/tickbus "));
        let nowhere = folder.path().join("nowhere");
        let nowhere = nowhere.to_str().expect("UTF-8");
        let arguments = command.expect("a command").replace("$OPTIONS", "--idle 0s");
        let arguments = arguments
            .replace("/etc/tickbus", nowhere)
            .replace("/var/lib/tickbus", nowhere);
        let output = tickbus(&arguments.split(' ').collect::<Vec<_>>());
        // The options are right and the file is missing; or with --idle 0s, that one option is wrong.
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(
            told.contains("there is no such file") || told.contains("--idle"),
            "{arguments}: {told}"
        );
        assert!(!told.contains("unexpected argument"), "{arguments}: {told}");
        let unit = folder.path().join(path.file_name().expect("a name"));
        fs::write(
            &unit,
            text.replace("/usr/local/bin/tickbus", env!("CARGO_BIN_EXE_tickbus")),
        )
        .expect("a copy");
        units.push(unit);
    }
    assert_eq!(units.len(), 3);
    let verified = Command::new("systemd-analyze")
        .args(["verify", "--man=no"])
        .args(&units)
        .output();
    let Ok(verified) = verified else {
        println!("skipped: systemd-analyze is not installed");
        return;
    };
    let told = String::from_utf8_lossy(&verified.stderr);
    assert!(verified.status.success() && told.is_empty(), "{told}");
}

/// A terminal on which a command shows its messages, and what it has shown.
#[cfg(unix)]
struct Terminal {
    end: tickbus_base::os::PseudoTerminal,
    told: String,
}

#[cfg(unix)]
impl Terminal {
    /// Starts the command with stderr on a new terminal.
    fn with(command: &mut Command) -> (Self, std::process::Child) {
        Self::showing(command, |command, screen| {
            command.stdout(std::process::Stdio::null()).stderr(screen)
        })
    }

    /// Starts the command on a new terminal, after `show` has connected it.
    fn showing(
        command: &mut Command,
        show: impl FnOnce(&mut Command, fs::File) -> &mut Command,
    ) -> (Self, std::process::Child) {
        let (end, name) = tickbus_base::os::PseudoTerminal::open().expect("a terminal");
        let screen = fs::File::options().write(true).open(name);
        let child = show(command, screen.expect("its other end"))
            .env("TERM", "xterm")
            .spawn()
            .expect("the tickbus program runs");
        let told = String::new();
        (Self { end, told }, child)
    }

    fn await_words(&mut self, words: &str) {
        let mut bytes = [0; 1000];
        // A line that is written again and again must not keep the test waiting for ever.
        let mut reads = 100;
        while !self.told.contains(words) {
            reads -= 1;
            assert!(reads > 0, "{words} in {:?}", self.told);
            let patience = std::time::Duration::from_secs(60);
            let count = self.end.read_within(&mut bytes, patience);
            let count = count.expect("the terminal");
            assert!(count > 0, "{words} in {:?}", self.told);
            self.told
                .push_str(&String::from_utf8_lossy(&bytes[..count]));
        }
    }
}

#[test]
#[cfg(unix)]
fn a_terminal_has_colours_unless_the_user_wants_none() {
    for (no_colour, has_colours) in [("", true), ("1", false)] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
        command.args(["check", "--no-such-option"]);
        command.env("NO_COLOR", no_colour).env_remove("CLICOLOR");
        let (mut terminal, mut child) = Terminal::with(&mut command);
        terminal.await_words("For more information");
        assert_eq!(child.wait().expect("it ends").code(), Some(2));
        assert_eq!(terminal.told.contains('\x1b'), has_colours, "{no_colour}");
    }
}

#[test]
#[cfg(unix)]
fn the_matrix_of_a_sweep_has_colours_on_a_terminal() {
    for (no_colour, has_colours) in [("", true), ("1", false)] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
        command.args([
            "test",
            "examples/sweep",
            "--only",
            "Not OK stuck-on @ Step 1",
        ]);
        command.current_dir(repository()).env("NO_COLOR", no_colour);
        let (mut terminal, mut child) = Terminal::showing(&mut command, Command::stdout);
        terminal.await_words(" hash=");
        assert_eq!(child.wait().expect("it ends").code(), Some(0));
        let is_green = terminal.told.contains("\x1b[32m 10ms   \x1b[0m");
        assert_eq!(is_green, has_colours, "{}", terminal.told);
    }
}

/// Reads from a pipe that has no writer yet.
#[test]
#[cfg(unix)]
fn work_that_takes_long_is_a_line_on_a_terminal_which_is_erased() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("tags.csv");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo").success());
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    let (mut terminal, mut child) = Terminal::with(command.arg("import").arg(&pipe));
    terminal.await_words("\r\x1b[K\x1b[?7limport: reading tags.csv, ");
    fs::write(&pipe, "Valve;%QX0.0;BOOL\n").expect("a reader");
    assert!(child.wait().expect("it ends").success());
    terminal.await_words("import: ok signals=1");
    let told = &terminal.told;
    let (shown, end) = told.rsplit_once("\r\x1b[K").expect("erased");
    assert!(shown.ends_with(" s\x1b[?7h"), "{told:?}");
    assert!(end.starts_with("import: ok"), "{told:?}");
}
