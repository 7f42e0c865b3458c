//! The doors of a sweep: the page, what is left of an interrupted run, and machines in other languages.

use std::fs;
use std::process::Command;

use tickbus::driver::Driver;
use tickbus::signal::Slot;
use tickbus::testing::Session;
use tickbus::time::Nanos;

use super::{SWEEP, err, folder, last, out, repository, test};

#[test]
fn the_page_has_the_matrix_and_opens_what_was_kept() {
    let folder = folder(SWEEP);
    let arguments = ["a.toml", "--keep", "kept", "--page", "out/sweep.html"];
    let output = test(folder.path(), &arguments);
    let page = fs::read_to_string(folder.path().join("out/sweep.html")).expect("the page");
    let link = "../kept/a%20-%20Height%20frozen%20%40%20moves.html";
    for part in [
        &format!(
            "<a class=\"run red\" href=\"{link}\" title=\"stands still: &quot;Speed&quot; stays 5, 6 without the fault\" data-word=\"still\""
        ),
        "data-name=\"Start stuck-off @ runs\">8ms</button>",
        "<th scope=\"col\">at rest</th>",
        "<code>tickbus test a.toml --only &quot;Height frozen @ moves&quot;</code>",
        "<dt>Runs</dt><dd>24</dd>",
        "<dt>still</dt><dd>6</dd>",
        "<dt>To look at</dt><dd>11</dd>",
    ] {
        assert!(page.contains(part), "{part}\n{page}");
    }
    let hash = last(&output);
    let (_, hash) = hash.rsplit_once("hash=").expect("a hash");
    assert!(
        page.contains(&format!("<dt>Hash</dt><dd>{hash}</dd>")),
        "{hash}"
    );
    assert!(
        folder
            .path()
            .join("kept/a - Height frozen @ moves.html")
            .exists()
    );

    // Without recordings, the cells have the command alone.
    test(folder.path(), &["a.toml", "--page", "sweep.html"]);
    let page = fs::read_to_string(folder.path().join("sweep.html")).expect("the page");
    assert!(!page.contains("<a class=\"run"), "{page}");

    // There is no page without a run.
    let up = "config = \"line.cfg\"\n[[test]]\nname = \"up\"\nsteps = [{ tick = 3 }]\n";
    fs::write(folder.path().join("a.toml"), up).expect("the file");
    let output = test(folder.path(), &["a.toml", "--page", "sweep.html"]);
    assert_eq!(
        err(&output),
        "test: no run of a [sweep] was made, so --page has nothing to show\n"
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(
        !folder.path().join("sweep.html").exists(),
        "the page was of an earlier run"
    );
}

#[test]
fn recordings_whose_names_would_be_one_file_are_two() {
    let below = SWEEP.replace(
        "{ \"at rest\" = \"not Run\", runs = \"Run\", moves = \"Speed == 5\" }",
        "[\"Speed < 4\", \"Speed > 4\"]",
    );
    let folder = folder(&below);
    let arguments = [
        "a.toml",
        "--only",
        "Height frozen",
        "--keep",
        "kept",
        "--page",
        "sweep.html",
    ];
    test(folder.path(), &arguments);
    let page = fs::read_to_string(folder.path().join("sweep.html")).expect("the page");
    for name in ["Height frozen @ Speed _ 4", "Height frozen @ Speed _ 4 2"] {
        assert!(
            folder.path().join(format!("kept/a - {name}.vcd")).exists(),
            "{name}"
        );
        let link = name.replace(' ', "%20").replace('@', "%40");
        assert!(
            page.contains(&format!("href=\"kept/a%20-%20{link}.html\"")),
            "{page}"
        );
    }
}

#[test]
fn what_cannot_be_written_is_told_before_the_runs() {
    let folder = folder(SWEEP);
    for option in ["--junit", "--page"] {
        let output = test(folder.path(), &["a.toml", option, "line.cfg/results"]);
        assert_eq!(out(&output), "", "{option}");
        let told = "test: line.cfg/results: cannot be written: ";
        assert!(err(&output).starts_with(told), "{}", err(&output));
        assert_eq!(output.status.code(), Some(1));
    }
    let output = test(
        folder.path(),
        &[
            "a.toml",
            "--keep",
            "line.cfg",
            "--only",
            "Height frozen @ runs",
        ],
    );
    assert!(
        out(&output).contains("      it could not be recorded: "),
        "{}",
        out(&output)
    );
}

#[cfg(unix)]
#[test]
fn a_shell_reads_the_command_that_repeats_a_run() {
    let folder = folder(&SWEEP.replace("runs = \"Run\"", "'$it \"runs\"' = \"Run\""));
    let file = folder.path().join("a b.toml");
    fs::rename(folder.path().join("a.toml"), file).expect("the file");
    let output = out(&test(folder.path(), &["a b.toml"]));
    for name in ["Height frozen @ $it \"runs\"", "Height frozen @ moves"] {
        let (_, rest) = output
            .split_once(&format!("FAIL  {name}\n"))
            .expect("it fails");
        let (_, again) = rest.split_once("again: tickbus ").expect("a command");
        let (again, _) = again.split_once('\n').expect("its end");
        let output = Command::new("sh")
            .args([
                "-c",
                &format!("'{}' {again}", env!("CARGO_BIN_EXE_tickbus")),
            ])
            .current_dir(folder.path())
            .output()
            .expect("a shell");
        assert!(out(&output).contains("sweep: runs=1 "), "{again}");
        assert!(out(&output).contains(name), "{again}");
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_no_results_of_an_earlier_one() {
    use rustix::process::{Pid, Signal, kill_process};

    let folder = folder(&SWEEP.replace("\"100ms\"", "\"100h\""));
    let files = ["junit.xml", "sweep.html"].map(|name| folder.path().join(name));
    for file in &files {
        fs::write(file, "of an earlier run").expect("the file");
    }
    let mut running = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args([
            "test",
            "a.toml",
            "--junit",
            "junit.xml",
            "--page",
            "sweep.html",
        ])
        .current_dir(folder.path())
        .spawn()
        .expect("the tickbus program runs");
    let gone = || files.iter().all(|file| !file.exists()).then_some(());
    tickbus_conformance::rig::eventually("the old results are removed", gone);
    let pid = i32::try_from(running.id()).expect("a small number");
    kill_process(Pid::from_raw(pid).expect("it runs"), Signal::INT).expect("it runs");
    let ended = running.wait().expect("it ends");
    assert!(!ended.success(), "{ended}");
    gone().expect("an interrupted run leaves no results");
}

/// The driver of [`SWEEP`].
fn driver() -> Driver {
    let overlay = "[fieldbus]\nkind = \"loopback\"\nrole = \"device\"\nmode = \"stepped\"\nprogram = \"mirror\"\nscan = \"2ms\"\n";
    let line = repository().join("tests/wrong-tests/line.cfg");
    tickbus_binding::open(&line, overlay, &tickbus::KINDS).expect("a driver")
}

/// The machine of [`SWEEP`] and its scenario, tick by tick. The scenario does not stop at the end of the run.
fn tick_alone(session: &mut Session, cell: Option<usize>, begin: i64) {
    let mut driver = driver();
    let mut slots = driver.initial_slots();
    let position = |name| driver.config().table.position(name).expect("a signal");
    let [start, height, run] = ["Start", "Height", "Run"].map(position);
    let on = Slot::from_real(1.0);
    session.begin(cell, &slots).expect("a run");
    let (mut ran, mut due, mut more) = (false, None, 60);
    for tick in 1_i64.. {
        let runs = slots[run] == on;
        if ran && !runs {
            due = Some(tick + 2);
        }
        ran = runs;
        match tick {
            _ if tick == begin => slots[start] = on,
            16 => slots[height] = Slot::from_real(5.0),
            26 => slots[height] = Slot::from_real(6.0),
            36 => {
                session.idle(&slots);
            }
            _ => {}
        }
        if due == Some(tick) {
            slots[height] = Slot::from_real(99.0);
        }
        session.before(&mut driver, &mut slots).expect("a fault");
        driver.exchange(Some(Nanos::from_millis(2).times(tick)), &mut slots);
        if session.after(&mut slots) {
            more -= 1;
        }
        if more == 0 {
            return;
        }
    }
}

#[test]
fn a_machine_in_another_language_gets_the_verdicts_of_a_test_file() {
    let folder = folder(SWEEP);
    let expected = last(&test(folder.path(), &["a.toml"]));
    let (_, keys) = SWEEP.split_once("[sweep]\n").expect("the keys");
    let (keys, _) = keys.split_once("scenario").expect("the scenario");
    let read = |keys: &str| {
        let step = Nanos::from_millis(2);
        Session::read(("up", keys), "accept them", folder.path(), &driver(), step)
    };
    let mut session = read(keys).expect("the keys are right");
    tick_alone(&mut session, None, 6);
    let plan = session.plan(false).expect("a plan");
    for cell in &plan.cells {
        tick_alone(&mut session, Some(cell.index), 6);
        assert!(session.result(cell.index).is_some(), "{}", cell.name);
    }
    let (_, hash) = expected.rsplit_once("hash=").expect("a hash");
    let summary = session.summary();
    assert!(
        summary.ends_with(&format!(" hash={hash}\n")),
        "{expected}\n{summary}"
    );

    let accepted = session.accept().expect("they are accepted");
    assert_eq!(accepted, folder.path().join("accepted/up.toml"));
    let text = fs::read_to_string(accepted).expect("the file");
    assert!(text.contains("which \"accept them\" has written"), "{text}");

    // A machine with a memory makes another run of the same scenario.
    tick_alone(&mut session, Some(4), 7);
    let run = session.result(4).expect("it is over");
    assert_eq!((run.passes, run.word), (false, "wrong"));
    let told = "this run cannot be judged: tick 6 (12ms): this run differs from the one without a fault before its fault has come; ";
    assert!(run.what.starts_with(told), "{}", run.what);
    assert!(session.summary().contains(" wrong=1 "));
    let missing = session.accept().expect_err("one was not judged");
    assert!(missing.starts_with("1 of 24 runs"), "{missing}");

    // Whoever asks too early gets an answer.
    let mut early = read(keys).expect("the keys are right");
    let slots = driver().initial_slots();
    assert!(early.begin(Some(0), &slots).is_err());
    let what = early.plan(false).expect_err("there is no run").to_string();
    assert!(
        what.contains("the run without a fault is not over"),
        "{what}"
    );
    assert!(early.accept().is_err());
}
