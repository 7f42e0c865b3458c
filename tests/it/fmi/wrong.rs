//! FMUs that are truncated, hostile, made for something else, or misbehaving: each leads to a sentence with the remedy.

use std::fs::{self, File};
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use zip::{ZipArchive, ZipWriter};

use crate::fmi::fixture::{
    CONFIG, Entry, archive, description, err, misbehaving, misbehaving_as, out, tickbus,
};

const RUN: [&str; 6] = ["run", "it.fmu", "--config", "it.cfg", "--duration", "1s"];

/// The output of `tickbus run` for an archive with these entries.
fn told(entries: &[Entry<'_>]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    archive(&folder.path().join("it.fmu"), entries);
    told_in(folder.path())
}

fn told_in(folder: &Path) -> String {
    fs::write(folder.join("it.cfg"), CONFIG).expect("a file");
    let output = tickbus(folder, &RUN);
    assert_eq!(output.status.code(), Some(1), "{}", out(&output));
    assert_eq!(out(&output), "");
    let told = err(&output);
    assert!(told.ends_with("\nrun: failed mistakes=1\n"), "{told}");
    told
}

#[test]
fn archives_that_are_cut_or_none_say_so() {
    let folder = misbehaving_as("ok");
    let file = folder.path().join("it.fmu");
    let whole = fs::read(&file).expect("the FMU");
    for length in [0, 1, 100, whole.len() / 2, whole.len() - 1] {
        fs::write(&file, &whole[..length]).expect("a file");
        let told = told_in(folder.path());
        assert!(
            told.starts_with("it.fmu: this is no whole archive: "),
            "{length}: {told}"
        );
        assert!(told.contains("; get the FMU anew; it may be cut"), "{told}");
    }
    // A changed byte within the library: its checksum shows that.
    let mut bent = whole;
    bent[2000] ^= 0x55;
    fs::write(&file, bent).expect("a file");
    let told = told_in(folder.path());
    assert!(told.contains("get the FMU anew"), "{told}");
}

#[test]
fn archives_that_would_harm_are_refused_before_a_byte_is_written() {
    let right = description("ok");
    let right = Entry::File("modelDescription.xml", right.as_bytes());
    for name in [
        "/tmp/tickbus-was-here",
        "../tickbus-was-here",
        "resources/../../tickbus-was-here",
        "resources\\..\\x",
        "C:/x",
    ] {
        let told = told(&[
            Entry::File("modelDescription.xml", description("ok").as_bytes()),
            Entry::File(name, b"x"),
        ]);
        assert!(
            told.contains("\" would be unpacked outside of its folder; do not use this FMU"),
            "{told}"
        );
    }
    assert!(!Path::new("/tmp/tickbus-was-here").exists());
    let link = told(&[right, Entry::Link("resources/x", "/etc/passwd")]);
    assert!(
        link.contains("\"resources/x\" is a link; do not use this FMU"),
        "{link}"
    );
}

#[test]
fn bombs_are_refused_by_what_they_state_and_by_what_they_are() {
    // 1.2 GB of zeros: one entry, and 29 copies of its compressed data.
    let folder = tempfile::tempdir().expect("a folder");
    let one = folder.path().join("one.zip");
    archive(&one, &[Entry::File("resources/0", &vec![0; 40 << 20])]);
    let mut one = ZipArchive::new(File::open(&one).expect("a file")).expect("an archive");
    let mut bomb = ZipWriter::new(File::create(folder.path().join("it.fmu")).expect("a file"));
    for number in 0..30 {
        let entry = one.by_index_raw(0).expect("it is there");
        bomb.raw_copy_file_rename(entry, format!("resources/{number}"))
            .expect("room");
    }
    bomb.finish().expect("room");
    let told = told_in(folder.path());
    assert!(
        told.contains(
            "it has 1200 MB when it is unpacked, and the most is 1024 MB; do not use this FMU"
        ),
        "{told}"
    );
    let laughs = "<?xml version=\"1.0\"?><!DOCTYPE a [<!ENTITY b \"ha\"><!ENTITY c \"&b;&b;&b;\">]><fmiModelDescription>&c;</fmiModelDescription>";
    let told = self::told(&[Entry::File("modelDescription.xml", laughs.as_bytes())]);
    assert!(told.contains("this is no XML: "), "{told}");
}

#[test]
fn what_is_for_something_else_says_for_what() {
    let two = description("ok");
    let file = |text: &'static str| [Entry::File("modelDescription.xml", text.as_bytes())];
    let told_of = |entries: &[Entry<'_>], words: &str| {
        let told = told(entries);
        assert!(told.contains(words), "{words}\n{told}");
    };
    told_of(
        &[Entry::File("readme", b"")],
        "there is no modelDescription.xml at the top of the archive",
    );
    told_of(
        &file("<fmiModelDescription fmiVersion=\"1.0\"/>"),
        "it.fmu/modelDescription.xml:1:1: this is FMI 1.0; export the FMU for FMI 2.0 or 3.0, co-simulation",
    );
    told_of(
        &file(
            "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"x\" instantiationToken=\"x\"><ModelExchange modelIdentifier=\"x\"/></fmiModelDescription>",
        ),
        "this FMU is for model exchange alone: it needs a solver for its states and events; export it for co-simulation",
    );
    told_of(
        &[Entry::File("modelDescription.xml", two.as_bytes())],
        "it has no library at all, and needs one for linux64",
    );
    told_of(
        &[
            Entry::File("modelDescription.xml", two.as_bytes()),
            Entry::File("binaries/win64/it.dll", b"x"),
        ],
        "it has libraries for win64, and none for linux64; export it for this platform, or run it where it is for",
    );
    told_of(
        &[
            Entry::File("modelDescription.xml", two.as_bytes()),
            Entry::File("sources/it.c", b"x"),
        ],
        "it has sources, and no library for linux64; compile it",
    );
    told_of(
        &[
            Entry::File("modelDescription.xml", two.as_bytes()),
            Entry::File("binaries/linux64/other.so", b"x"),
        ],
        "it has no binaries/linux64/it.so",
    );
    let odd = two.replace("<Real/>", "<Complex/>");
    told_of(
        &[Entry::File("modelDescription.xml", odd.as_bytes())],
        "it.fmu/modelDescription.xml:6:68: there is no type \"Complex\" in this version of FMI",
    );
}

#[test]
fn a_library_that_is_none_or_lacks_functions_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("it.cfg"), CONFIG).expect("a file");
    let tank = fs::read(misbehaving()).expect("a library");
    let three = "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"x\" instantiationToken=\"x\"><CoSimulation modelIdentifier=\"it\"/>\
                 <ModelVariables><Float64 name=\"Level\" valueReference=\"1\" causality=\"output\"/></ModelVariables></fmiModelDescription>";
    let two = description("ok");
    for (text, library, words) in [
        (
            &*two,
            ("binaries/linux64/it.so", &b"no library"[..]),
            "it.fmu: its library cannot be loaded: ",
        ),
        (
            three,
            ("binaries/x86_64-linux/it.so", &tank),
            "it.fmu: its library has no function fmi3InstantiateCoSimulation; export it again",
        ),
    ] {
        let entries = [
            Entry::File("modelDescription.xml", text.as_bytes()),
            Entry::File(library.0, library.1),
        ];
        archive(&folder.path().join("it.fmu"), &entries);
        let output = tickbus(folder.path(), &RUN);
        assert_eq!(output.status.code(), Some(3), "{}", out(&output));
        assert!(err(&output).contains(words), "{words}\n{}", err(&output));
    }
}

/// The FMU's misbehaviour in its third step, and the message about it; in this process and in a helper.
#[test]
fn discard_error_fatal_and_a_refused_beginning_are_told() {
    for (how, words) in [
        (
            "discard",
            "it.fmu: it discards the step of 0.01 s at 0.03 s, and got to 0.03 s: give it shorter ones",
        ),
        (
            "error",
            "it.fmu: the step of 0.01 s at 0.03 s failed, and does not say why; ask whoever made it",
        ),
        // Messages about earlier steps are not the reason for this failure.
        (
            "grumbles",
            "it.fmu: the step of 0.01 s at 0.03 s failed, and does not say why; ask whoever made it",
        ),
        (
            "fatal",
            "it.fmu: the step of 0.01 s at 0.03 s failed for good (fatal); it says: the solver has lost its matrix",
        ),
        (
            "formats",
            "it.fmu: the step of 0.01 s at 0.03 s failed; it says: V7 at 0.03 s: 1 2 3|1.5 2.5 3.5 4.5 5.5 6.5 7.5 8.5 end",
        ),
        // Some programs pass their own environment.
        (
            "stray",
            "it.fmu: the step of 0.01 s at 0.03 s failed; it says: V7 at 0.03 s: 1 2 3|1.5 2.5 3.5 4.5 5.5 6.5 7.5 8.5 end",
        ),
        // While it is asked how far it got.
        (
            "lost",
            "it.fmu: the step of 0.01 s at 0.03 s failed for good (fatal), and does not say why",
        ),
        (
            "null",
            "it.fmu: it makes no instance of itself; it says: no licence on this computer",
        ),
        ("refuses", "it.fmu: its initialisation failed"),
    ] {
        let folder = misbehaving_as(how);
        for isolated in [&[][..], &["--isolated"]] {
            let output = tickbus(folder.path(), &[&RUN, isolated].concat());
            let told = out(&output) + err(&output).as_str();
            assert_eq!(output.status.code(), Some(3), "{told}");
            assert!(told.contains(words), "{how} {isolated:?}: {told}");
        }
    }
}

/// By the standards, no function of an FMU may be called after a fatal answer, in any instance.
#[test]
fn an_fmu_that_has_failed_for_good_is_not_begun_again_in_the_same_process() {
    for (isolated, second) in [
        (
            "",
            "it.fmu: an earlier run of it in this process has failed for good (fatal), and it must not be called any more; \
             give each run a process of its own (isolated = true)",
        ),
        (
            "isolated = true\n",
            "failed for good (fatal); it says: the solver has lost its matrix",
        ),
    ] {
        let folder = misbehaving_as("fatal");
        let text = format!(
            "config = \"it.cfg\"\nstep = \"10ms\"\n[machine]\nfmu = \"it.fmu\"\n{isolated}\
             [[test]]\nname = \"first\"\nsteps = [{{ run = \"1s\" }}]\n\
             [[test]]\nname = \"second\"\nsteps = [{{ run = \"1s\" }}]\n"
        );
        fs::write(folder.path().join("it.test.toml"), text).expect("a file");
        let output = tickbus(folder.path(), &["test", "it.test.toml"]);
        let told = out(&output) + err(&output).as_str();
        assert!(!output.status.success(), "{told}");
        let (first, rest) = told.split_once("second").expect("two tests");
        assert!(
            first.contains("failed for good (fatal); it says: "),
            "{told}"
        );
        assert!(rest.contains(second), "{told}");
    }
}

#[test]
fn all_but_documentation_and_sources_is_unpacked_whatever_the_names_begin_with() {
    let folder = misbehaving_as("looks");
    let library = fs::read(misbehaving()).expect("the library");
    let description = description("looks");
    for prefix in ["", "./"] {
        let names = [
            "modelDescription.xml",
            "binaries/linux64/it.so",
            "documentation/it.html",
        ];
        let names = names.map(|name| format!("{prefix}{name}"));
        archive(
            &folder.path().join("it.fmu"),
            &[
                Entry::File(&names[0], description.as_bytes()),
                Entry::File(&names[1], &library),
                Entry::File(&names[2], b"<p>"),
                // Packing programs write an entry for a folder.
                Entry::File(&format!("{prefix}resources/a"), b"x"),
            ],
        );
        let output = tickbus(folder.path(), &RUN);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{prefix}: {}{}",
            out(&output),
            err(&output)
        );
    }
}

#[test]
fn an_archive_with_the_same_file_twice_is_refused() {
    let description = description("ok");
    for twin in ["resources/./a", "./resources/a", "resources//a"] {
        let told = told(&[
            Entry::File("modelDescription.xml", description.as_bytes()),
            Entry::File("resources/a", b"x"),
            Entry::File(twin, b"y"),
        ]);
        assert!(
            told.contains("it.fmu: it has \"resources/a\" twice; do not use this FMU"),
            "{twin}: {told}"
        );
    }
}

/// Another program could load either of the two.
#[test]
fn an_archive_with_the_very_same_name_twice_is_refused() {
    let folder = misbehaving_as("ok");
    let path = folder.path().join("it.fmu");
    let description = description("ok");
    archive(
        &path,
        &[
            Entry::File("modelDescription.xml", description.as_bytes()),
            Entry::File("resources/a", b"x"),
            Entry::File("resources/b", b"y"),
        ],
    );
    rename(&path, b"resources/b", b"resources/a");
    let output = tickbus(folder.path(), &RUN);
    assert_eq!(output.status.code(), Some(1));
    let told = err(&output);
    let words = "it.fmu: it has \"resources/a\" twice; do not use this FMU";
    assert!(told.contains(words), "{told}");
}

/// Renames a file in an archive to a name of the same length, possibly an existing one, as no packing program does.
fn rename(archive: &Path, from: &[u8], to: &[u8]) {
    let mut bytes = fs::read(archive).expect("a file");
    for at in 0..bytes.len() - from.len() {
        if bytes[at..].starts_with(from) {
            bytes[at..at + to.len()].copy_from_slice(to);
        }
    }
    fs::write(archive, bytes).expect("room");
}

/// As in the makers' own Reference FMU "Roberts".
#[test]
fn the_same_file_twice_is_accepted_where_a_run_does_not_depend_on_it() {
    let library = fs::read(misbehaving()).expect("the library");
    let description = description("ok");
    for (folder, second, code) in [
        ("extra", &b"x"[..], 0),
        ("extra", b"y", 1),
        ("resources", b"x", 1),
    ] {
        let place = misbehaving_as("ok");
        let path = place.path().join("it.fmu");
        let names = ["a", "b"].map(|name| format!("{folder}/{name}"));
        archive(
            &path,
            &[
                Entry::File("modelDescription.xml", description.as_bytes()),
                Entry::File("binaries/linux64/it.so", &library),
                Entry::File(&names[0], b"x"),
                Entry::File(&names[1], second),
            ],
        );
        rename(&path, names[1].as_bytes(), names[0].as_bytes());
        let output = tickbus(place.path(), &RUN);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{folder} {second:?}: {}",
            err(&output)
        );
    }
}

#[test]
fn a_parameter_may_be_a_text() {
    let folder = misbehaving_as("ok");
    let text = description("ok").replace(
        "<ModelVariables>",
        "<ModelVariables><ScalarVariable name=\"File\" valueReference=\"7\" causality=\"parameter\"><String start=\"\"/></ScalarVariable>",
    );
    let library = fs::read(misbehaving()).expect("the library");
    archive(
        &folder.path().join("it.fmu"),
        &[
            Entry::File("modelDescription.xml", text.as_bytes()),
            Entry::File("binaries/linux64/it.so", &library),
        ],
    );
    let run = |map: &str| {
        fs::write(folder.path().join("it.toml"), map).expect("a file");
        err(&tickbus(
            folder.path(),
            &[&RUN[..], &["--map", "it.toml"]].concat(),
        ))
    };
    let told = run("[parameters]\nFile = \"a.txt\"\n");
    let words = "it.fmu: setting a parameter failed; it says: text 7 of 1 is a.txt";
    assert!(told.contains(words), "{told}");
    let told = run("[parameters]\nFile = 1\n");
    assert!(
        told.contains("it.toml:2:8: ") && told.contains("write a text in quotes"),
        "{told}"
    );
}

/// The arguments of the setup call.
#[test]
fn the_tolerance_of_the_description_and_the_end_of_the_run_are_handed_in() {
    for (attributes, more, words) in [
        (
            "startTime=\"1\" tolerance=\"1e-4\"",
            &[][..],
            "tolerance 1 0.0001, from 1, to 1 2",
        ),
        (
            "startTime=\"1\" tolerance=\"1e-4\"",
            &["--tolerance", "1e-6"],
            "tolerance 1 1e-06, from 1, to 1 2",
        ),
        (
            "tolerance=\"0\"",
            &["--isolated"],
            "tolerance 0 0, from 0, to 1 1",
        ),
    ] {
        let folder = misbehaving_as("setup");
        let text = description("setup").replace(
            "<ModelVariables>",
            &format!("<DefaultExperiment {attributes}/><ModelVariables>"),
        );
        let library = fs::read(misbehaving()).expect("the library");
        archive(
            &folder.path().join("it.fmu"),
            &[
                Entry::File("modelDescription.xml", text.as_bytes()),
                Entry::File("binaries/linux64/it.so", &library),
            ],
        );
        let output = tickbus(folder.path(), &[&RUN[..], more].concat());
        let told = err(&output);
        assert!(
            told.contains(&format!(
                "entering the initialisation failed; it says: {words}"
            )),
            "{told}"
        );
    }
    let folder = misbehaving_as("ok");
    let output = tickbus(folder.path(), &[&RUN[..], &["--tolerance", "0"]].concat());
    assert!(
        err(&output).contains("write a number above 0, such as 1e-6"),
        "{}",
        err(&output)
    );
}

#[test]
fn a_model_that_looks_for_its_description_finds_it_though_it_has_no_resources() {
    let folder = misbehaving_as("looks");
    let output = tickbus(folder.path(), &RUN);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
}

#[test]
fn a_duration_below_one_step_is_refused() {
    let folder = misbehaving_as("ok");
    let output = tickbus(
        folder.path(),
        &[
            "run",
            "it.fmu",
            "--config",
            "it.cfg",
            "--duration",
            "4ms",
            "--step",
            "5ms",
        ],
    );
    assert_eq!(output.status.code(), Some(1), "{}", out(&output));
    let told = err(&output);
    assert!(
        told.starts_with(
            "--duration 4ms is shorter than one step of 5ms; give it a longer one, or shorter steps (--step)\n"
        ),
        "{told}"
    );
}

#[test]
fn an_fmu_that_ends_its_simulation_has_not_failed() {
    let folder = misbehaving_as("ended");
    let output = tickbus(folder.path(), &RUN);
    let told = out(&output);
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(
        told.contains("run: the FMU has ended its simulation at 40ms\nrun: ok ticks=4 "),
        "{told}"
    );
}

#[test]
fn a_crash_in_a_helper_is_a_sentence_and_the_recording_is_whole() {
    for (how, words) in [
        (
            "crash",
            "it.fmu: its process was ended by SIGSEGV (an access to memory that is not its own) in the step of 0.01 s at 0.03 s",
        ),
        ("abort", "it.fmu: its process was ended by SIGABRT"),
        ("exit", "it.fmu: its process ended with exit code 7 in"),
        (
            "close",
            "it.fmu: its process has closed the line to its host, and hangs in the step of 0.01 s at 0.03 s",
        ),
    ] {
        let folder = misbehaving_as(how);
        let output = tickbus(
            folder.path(),
            &[&RUN[..], &["--isolated", "--record", "run.csv"]].concat(),
        );
        let told = out(&output);
        assert_eq!(output.status.code(), Some(3), "{told}");
        assert!(told.contains(words), "{how}: {told}");
        let record = fs::read_to_string(folder.path().join("run.csv")).expect("a recording");
        assert_eq!(record.lines().count(), 1 + 3, "{record}");
    }
    // The FMU's prints do not disturb the messages.
    let folder = misbehaving_as("print");
    let output = tickbus(folder.path(), &[&RUN[..], &["--isolated"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", out(&output));
    assert!(err(&output).contains("hello"), "{}", err(&output));
}

#[test]
fn an_fmu_that_hangs_can_be_interrupted() {
    let (folder, temporary) = (
        misbehaving_as("hang"),
        tempfile::tempdir().expect("a folder"),
    );
    let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(RUN)
        .current_dir(folder.path())
        .env("TMPDIR", temporary.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    let hangs = lines.map_while(Result::ok).any(|line| line == "hangs");
    assert!(hangs, "it gets to its third step");
    // The first signal asks for the end; one of those a second later ends it.
    let pid = rustix::process::Pid::from_child(&child);
    while child.try_wait().expect("it is known").is_none() {
        rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("it runs");
        thread::sleep(Duration::from_millis(50));
    }
    let output = child.wait_with_output().expect("it has ended");
    assert_eq!(output.status.code(), Some(3));
    assert!(
        err(&output)
            .contains("run: interrupted again, while the FMU or the line did not come back"),
        "{}",
        err(&output)
    );
    let left = fs::read_dir(temporary.path()).expect("a folder").count();
    assert_eq!(left, 0, "what was unpacked has gone");
}
