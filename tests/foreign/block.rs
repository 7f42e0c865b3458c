//! `block = "..."` in test files: blocks compiled by `iec2c`, their tables, branches and sweeps.
#![allow(missing_docs, unreachable_pub, reason = "a test")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::harness::iec2c::Compiler;
use crate::harness::{Absent, Test};
use tickbus::prepare::{Block, Source};
use tickbus::time::Nanos;

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("the_example_is_green", the_example_is_green),
    (
        "every_type_of_a_signal_goes_in_and_out",
        every_type_of_a_signal_goes_in_and_out,
    ),
    (
        "a_row_that_differs_is_told_with_its_place",
        a_row_that_differs_is_told_with_its_place,
    ),
    ("functions_have_a_result", functions_have_a_result),
    (
        "a_value_that_the_caller_lends_stays_until_it_is_set",
        a_value_that_the_caller_lends_stays_until_it_is_set,
    ),
    (
        "projects_lose_their_programs_and_keep_their_globals",
        projects_lose_their_programs_and_keep_their_globals,
    ),
    (
        "messages_of_the_compiler_have_the_users_line",
        messages_of_the_compiler_have_the_users_line,
    ),
    ("known_branches_are_counted", known_branches_are_counted),
    (
        "the_branches_are_those_that_gcov_counts",
        the_branches_are_those_that_gcov_counts,
    ),
    ("a_sweep_finds_the_faults", a_sweep_finds_the_faults),
];

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs `tickbus test` in `directory`, with a cache there.
fn test(directory: &Path, arguments: &[&str]) -> Result<Output, Absent> {
    let compiler = Compiler::find()?;
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("test")
        .args(arguments)
        .env("IEC2C", &compiler.program)
        .env("IEC2C_LIB", &compiler.library)
        .env("XDG_CACHE_HOME", directory.join("cache"))
        .current_dir(directory)
        .output()
        .expect("the tickbus program runs");
    Ok(output)
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A folder with `b.st` and `a.toml`, which names a block in it.
fn folder(source: &str, block: &str, rest: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("b.st"), source).expect("the source");
    let file = format!("block = \"{block}\"\nsource = \"b.st\"\n{rest}");
    fs::write(folder.path().join("a.toml"), file).expect("the test file");
    folder
}

fn the_example_is_green() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    for file in ["valve.st", "valve.toml", "sweep.toml", "accepted.toml"] {
        let from = repository().join("examples/block").join(file);
        fs::copy(from, folder.path().join(file)).expect("the example");
    }
    let output = test(folder.path(), &[".", "--coverage"])?;
    let text = out(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", err(&output));
    assert!(text.contains("FB_Valve: "), "{text}");
    // The second time nothing is compiled.
    let again = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["test", ".", "--coverage"])
        .env("IEC2C", Compiler::find()?.program)
        .env("IEC2C_LIB", Compiler::find()?.library)
        .env("PATH", "")
        .env("XDG_CACHE_HOME", folder.path().join("cache"))
        .current_dir(folder.path())
        .output()
        .expect("the tickbus program runs");
    assert_eq!(out(&again), text);
    Ok(())
}

fn every_type_of_a_signal_goes_in_and_out() -> Result<(), Absent> {
    let types = [
        ("BOOL", "1", "1"),
        ("BYTE", "200", "200"),
        ("SINT", "-100", "-100"),
        ("USINT", "200", "200"),
        ("WORD", "40000", "40000"),
        ("INT", "-30000", "-30000"),
        ("UINT", "60000", "60000"),
        ("DWORD", "4000000000", "4000000000"),
        ("DINT", "-2000000000", "-2000000000"),
        ("UDINT", "4000000000", "4000000000"),
        ("REAL", "0.1", "0.1"),
        ("LWORD", "9007199254740993", "9007199254740993"),
        ("LINT", "-9007199254740993", "-9007199254740993"),
        ("ULINT", "9007199254740993", "9007199254740993"),
        ("LREAL", "0.1", "0.1"),
        ("TIME", "1234", "> 1233"),
        ("Length", "7", "7"),
        ("Percent", "50", "50"),
    ];
    let all = |write: &dyn Fn(usize, &str) -> String| -> String {
        let written = types.iter().enumerate();
        let written = written.map(|(number, (name, ..))| write(number, name));
        written.collect::<Vec<_>>().concat()
    };
    let inputs = all(&|number, name| format!("    a{number} : {name};\n"));
    let outputs = all(&|number, name| format!("    b{number} : {name};\n"));
    let body = all(&|number, _| format!("  b{number} := a{number};\n"));
    let head = all(&|number, _| format!("| a{number} | b{number} "));
    let cells = types.map(|(_, given, expected)| format!("| {given} | {expected} "));
    let row = cells.concat();
    let source = format!(
        "TYPE\n  Length : INT;\n  Percent : INT (0..100);\nEND_TYPE\nFUNCTION_BLOCK Pass\n  \
         VAR_INPUT\n{inputs}  END_VAR\n  VAR_OUTPUT\n{outputs}  END_VAR\n{body}END_FUNCTION_BLOCK\n"
    );
    let rest =
        format!("[[test]]\nname = \"t\"\nsteps = [{{ table = \"\"\"\n{head}\n{row}\n\"\"\" }}]\n");
    let folder = folder(&source, "pass", &rest);
    let output = test(folder.path(), &["a.toml"])?;
    assert_eq!(err(&output), "");
    assert_eq!(output.status.code(), Some(0), "{}", out(&output));
    Ok(())
}

/// A timer, an initial value, and a number.
const DELAY: &str = "\
FUNCTION_BLOCK Delay
  VAR_INPUT
    In : BOOL;
    Wait : TIME := T#50ms;
  END_VAR
  VAR_OUTPUT
    Out : BOOL;
    Scans : INT;
  END_VAR
  VAR
    Timer : TON;
  END_VAR
  Timer(IN := In, PT := Wait);
  Out := Timer.Q;
  Scans := Scans + 1;
END_FUNCTION_BLOCK
";

fn a_row_that_differs_is_told_with_its_place() -> Result<(), Absent> {
    let table = "[[test]]\nname = \"t\"\nsteps = [{ table = \"\"\"\n\
                 time       | In || Out | Scans\n\
                 0ms..40ms  | 1  || 0   | -\n\
                 50ms       | -  || 1   | 6\n\
                 90ms       | 0  || 0   | 11\n\
                 \"\"\" }]\n";
    let folder = folder(DELAY, "Delay", table);
    let output = test(folder.path(), &["a.toml"])?;
    let text = out(&output);
    let told = "a.toml:9:26: tick 10 (100ms): \"Scans\" is 10, expected 11 in row 3 of the table\n";
    assert!(text.contains(told), "{text}{}", err(&output));
    Ok(())
}

fn functions_have_a_result() -> Result<(), Absent> {
    let source = "\
FUNCTION Split : INT
  VAR_INPUT
    Number : INT;
  END_VAR
  VAR_OUTPUT
    Rest : INT;
  END_VAR
  Rest := Number MOD 10;
  Split := Number / 10;
END_FUNCTION
";
    let table = "[[test]]\nname = \"t\"\nsteps = [{ table = \"\"\"\n\
                 Number | Split | Rest\n----|----|---\n123 | 12 | 3\n7 | 0 | > 6\n\"\"\" }]\n";
    let folder = folder(source, "Split", table);
    let output = test(folder.path(), &["a.toml"])?;
    let text = out(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", err(&output));
    Ok(())
}

fn a_value_that_the_caller_lends_stays_until_it_is_set() -> Result<(), Absent> {
    let source = "\
FUNCTION_BLOCK Up
  VAR_IN_OUT
    Sum : INT;
    Name : STRING;
  END_VAR
  Sum := Sum + 1;
END_FUNCTION_BLOCK
";
    let table = "without = \"Name\"\n[[test]]\nname = \"t\"\nsteps = [{ table = \"\"\"\n\
                 Sum | Sum out\n- | 1\n- | 2\n10 | 11\n- | 12\n\"\"\" }]\n";
    let folder = folder(source, "Up", table);
    let output = test(folder.path(), &["a.toml"])?;
    let text = out(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", err(&output));
    Ok(())
}

fn projects_lose_their_programs_and_keep_their_globals() -> Result<(), Absent> {
    let source = "\
PROGRAM Main
  VAR
    lamp AT %QX0.0 : BOOL;
  END_VAR
  lamp := NOT lamp;
END_PROGRAM
FUNCTION_BLOCK Twice
  VAR_INPUT
    In : INT;
  END_VAR
  VAR_OUTPUT
    Out : INT;
  END_VAR
  VAR_EXTERNAL
    Factor : INT;
  END_VAR
  Out := In * Factor;
END_FUNCTION_BLOCK
CONFIGURATION Config0
  VAR_GLOBAL
    Factor AT %MW0 : INT := 2;
  END_VAR
  RESOURCE Res0 ON PLC
    TASK T0(INTERVAL := T#20ms, PRIORITY := 0);
    PROGRAM Inst0 WITH T0 : Main;
  END_RESOURCE
END_CONFIGURATION
";
    let table = "[[test]]\nname = \"t\"\nsteps = [{ table = \"\"\"\nIn | Out\n21 | 42\n\"\"\" }]\n";
    let folder = folder(source, "Twice", table);
    let output = test(folder.path(), &["a.toml", "--coverage"])?;
    let text = out(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", err(&output));
    assert!(text.contains("Twice: 0 of 0 branches\n"), "{text}");
    Ok(())
}

fn messages_of_the_compiler_have_the_users_line() -> Result<(), Absent> {
    let wrong = DELAY.replace("Out := Timer.Q;", "Out := Scans;");
    let test_of = "[[test]]\nname = \"t\"\nsteps = [{ tick = 1, expect = \"Out\" }]\n";
    for coverage in [false, true] {
        let folder = folder(&wrong, "Delay", test_of);
        let arguments = ["a.toml", "--coverage"];
        let output = test(folder.path(), &arguments[..=usize::from(coverage)])?;
        let told = err(&output);
        assert!(told.starts_with("b.st:14:"), "{told}");
        assert!(told.contains("; so the compiler says"), "{told}");
        assert_eq!(output.status.code(), Some(1));
    }
    Ok(())
}

/// Each part has its statement, with a number of its own, in the next line.
const BRANCHES: &str = "\
FUNCTION_BLOCK Way
  VAR_INPUT
    a : BOOL;
    b : BOOL;
    n : INT;
  END_VAR
  VAR_OUTPUT
    x : INT;
  END_VAR
  VAR
    i : INT;
  END_VAR
  IF a AND b THEN
    x := 1001;
  ELSIF b THEN
    x := 1002;
  ELSE
    x := 1003;
  END_IF;
  IF a THEN
    x := x + 1004;
  END_IF;
  CASE n OF
    1, 2:
      x := x + 1005;
    3..5:
      IF b THEN
        x := x + 1006;
      END_IF;
  END_CASE;
  CASE n OF
    7:
      x := x + 1007;
  ELSE
      x := x + 1008;
  END_CASE;
  FOR i := 1 TO n DO
    x := x + 1009;
  END_FOR;
  WHILE x > 10000 DO
    x := x - 1010;
  END_WHILE;
  REPEAT
    x := x + 1;
  UNTIL x > 5 END_REPEAT;
END_FUNCTION_BLOCK
";

fn known_branches_are_counted() -> Result<(), Absent> {
    let steps = |rows: &str| {
        format!(
            "[[test]]\nname = \"t\"\nsteps = [{{ table = \"\"\"\na | b | n | x\n{rows}\"\"\" }}]\n"
        )
    };
    let folder = folder(BRANCHES, "Way", &steps("1 | 1 | 2 | -\n"));
    let output = test(folder.path(), &["a.toml", "--coverage"])?;
    let text = out(&output);
    let told = "Way: 5 of 14 branches; not taken: line 15 ELSIF, line 17 ELSE, line 22 END_IF without ELSE, \
                line 26 CASE 3..5, line 27 IF, line 29 END_IF without ELSE, line 30 END_CASE without ELSE, \
                line 32 CASE 7, line 40 WHILE\n";
    assert!(text.contains(told), "{text}{}", err(&output));
    // Runs add up, also those of a second test.
    let more = "0 | 1 | 7 | -\n0 | 0 | 3 | -\n0 | 1 | 4 | -\n0 | 0 | 0 | -\n";
    let file = format!("block = \"Way\"\nsource = \"b.st\"\n{}", steps(more));
    fs::write(folder.path().join("a.toml"), file).expect("the test file");
    let output = test(folder.path(), &["a.toml", "--coverage", "--json"])?;
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let coverage = &document["files"][0]["coverage"];
    assert_eq!(coverage["block"], "Way");
    assert_eq!(coverage["file"], "b.st");
    assert_eq!(coverage["taken"], 10);
    let missed = |branch: &&serde_json::Value| branch["taken"] == false;
    let branches = coverage["branches"].as_array().expect("a list");
    let missed: Vec<_> = branches.iter().filter(missed).collect();
    let lines: Vec<_> = missed
        .iter()
        .map(|branch| branch["line"].as_u64())
        .collect();
    assert_eq!(lines, [13, 20, 24, 40].map(Some));
    Ok(())
}

/// Sets random inputs in each scan, and prints the counters at the end.
const DRIVER: &str = "\
#include <stdio.h>
#include <string.h>
#include \"tickbus_plc.h\"
int main(int count, char **names)
{
    const struct tickbus_plc *plc = &tickbus_plc;
    unsigned seed = 1, scans = count > 1 ? (unsigned)names[1][0] - '0' : 0;
    plc->init();
    for (unsigned scan = 0; scan < scans; scan++) {
        for (unsigned i = 0; i < plc->located_count; i++) {
            const struct tickbus_located *one = &plc->located[i];
            if (one->area[0] == 'I') {
                seed = seed * 1103515245u + 12345u;
                memset(one->value, 0, one->bytes);
                *(unsigned char *)one->value = (seed >> 16) % (one->bytes == 1 ? 2 : 9);
            }
        }
        plc->scan(0, scan * 10000000, scan);
    }
    for (unsigned i = 0; i < plc->located_count; i++)
        if (!strcmp(plc->located[i].type, \"DWORD\"))
            printf(\"%u\\n\", *(unsigned *)plc->located[i].value);
    return 0;
}
";

fn the_branches_are_those_that_gcov_counts() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    if Command::new("gcov").arg("--version").output().is_err() {
        return Err(Absent("there is no gcov".to_owned()));
    }
    let source = Source {
        name: "b.st".to_owned(),
        bytes: BRANCHES.into(),
    };
    let block = Block::find(&[source], "Way").expect("the block");
    let library = compiler.library.to_str().expect("a path");
    let headers = format!("-I{library}/C");
    let glue = repository().join("plc/glue");
    let glue_headers = format!("-I{}", glue.display());
    let glue = glue.join("tickbus_plc.c").display().to_string();
    // With the marks of the branches, and without them, compiled for gcov.
    let built = [true, false].map(|counted| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path();
        let text = block.wrap(&[], Nanos::from_millis(10), counted).text;
        fs::write(path.join("way.st"), text).expect("the source");
        fs::write(path.join("main.c"), DRIVER).expect("the driver");
        let options = ["-f", "-l", "-p", "-r", "-R", "-a", "-I", library, "-T", "."];
        run(
            path,
            &compiler.program,
            &[&options[..], &["way.st"]].concat(),
        );
        let mut sources = files(path, "c");
        sources.retain(|name| name != "POUS.c");
        sources.push(glue.clone());
        let sources: Vec<&str> = sources.iter().map(String::as_str).collect();
        let flags = [
            "--coverage",
            "-O0",
            "-w",
            "-I.",
            &headers,
            &glue_headers,
            "-lm",
            "-o",
            "way",
        ];
        run(path, Path::new("gcc"), &[&sources[..], &flags].concat());
        folder
    });
    let [marked, plain] = built.each_ref().map(tempfile::TempDir::path);
    let source: Vec<&str> = BRANCHES.lines().collect();
    for scans in ["1", "3", "9"] {
        let counters = run(marked, &marked.join("way"), &[scans]);
        let counters = counters.lines().map(|line| line.parse().expect("a number"));
        let counters: Vec<u64> = counters.collect();
        for data in files(plain, "gcda") {
            fs::remove_file(plain.join(data)).expect("removed");
        }
        run(plain, &plain.join("way"), &[scans]);
        let data = files(plain, "gcda");
        let data: Vec<&str> = data.iter().map(String::as_str).collect();
        run(plain, Path::new("gcov"), &data);
        let report = fs::read_to_string(plain.join("POUS.c.gcov")).expect("gcov's report");
        let mut compared = 0;
        for (number, branch) in block.branches.iter().enumerate() {
            let taken = counters[number / 32] >> (number % 32) & 1 == 1;
            let own = source[branch.line]
                .split_once("10")
                .map(|(_, own)| &own[..2]);
            let (Some(own), false) = (own, branch.label.contains("without")) else {
                continue;
            };
            let statement = report
                .lines()
                .find(|line| line.contains(&format!("10{own}")));
            let count = statement.expect("its statement").trim_start();
            compared += 1;
            assert_eq!(!count.starts_with('#'), taken, "{scans} scans: {count}");
        }
        assert_eq!(compared, 10);
    }
    Ok(())
}

/// The output of a program in a folder.
fn run(folder: &Path, program: &Path, arguments: &[&str]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("it runs");
    assert!(output.status.success(), "{}", err(&output));
    out(&output)
}

/// The files in a folder whose names end like this.
fn files(folder: &Path, ending: &str) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("its files");
    let names = entries.map(|entry| entry.expect("a file").file_name());
    let names = names.map(|name| name.into_string().expect("a name"));
    names
        .filter(|name| name.ends_with(&format!(".{ending}")))
        .collect()
}

fn a_sweep_finds_the_faults() -> Result<(), Absent> {
    let sweep = "\
[[test]]
name = \"normal\"
steps = [{ set = { In = true }, await = \"Out\", within = \"1s\" }, { set = { In = false }, run = \"50ms\" }]
[sweep]
signals  = [\"In\"]
kinds    = [\"stuck-on\", \"stuck-off\"]
moments  = { late = \"Scans == 3\" }
told     = \"Scans == 30000\"
goes_on  = \"Out\"
within   = \"200ms\"
scenario = \"normal\"
";
    let folder = folder(DELAY, "Delay", sweep);
    let output = test(folder.path(), &["a.toml", "--coverage"])?;
    let text = out(&output);
    assert!(
        text.contains("stuck-on  late\nIn        STILL\n"),
        "{text}{}",
        err(&output)
    );
    assert!(text.contains("stuck-off late\nIn        STILL\n"), "{text}");
    Ok(())
}
