//! The parts of FMI 3.0 that version 2.0 does not have: arrays, sizes, enumerations by name, clocks.

use std::fs;

use tempfile::TempDir;

use crate::fmi::fixture::{Entry, archive, err, library, out, sampling, tickbus};

const VARIABLES: &str = "
  <UInt64 name=\"n\" valueReference=\"1\" causality=\"structuralParameter\" variability=\"fixed\" start=\"2\"/>
  <Float64 name=\"u\" valueReference=\"2\" causality=\"input\" start=\"1 2\"><Dimension valueReference=\"1\"/></Float64>
  <Float64 name=\"y\" valueReference=\"3\" causality=\"output\"><Dimension valueReference=\"1\"/></Float64>
  <Float64 name=\"gain\" valueReference=\"4\" causality=\"parameter\" start=\"1 1\"><Dimension valueReference=\"1\"/></Float64>
  <Enumeration name=\"mode\" declaredType=\"Mode\" valueReference=\"5\" causality=\"parameter\" start=\"1\"/>
  <Clock name=\"sample\" valueReference=\"6\" causality=\"input\" intervalVariability=\"constant\" intervalCounter=\"100\" resolution=\"1000\"/>
  <Float64 name=\"sampled\" valueReference=\"7\" causality=\"output\"/>
  <Int32 name=\"samples\" valueReference=\"8\" causality=\"output\"/>
  <Clock name=\"late\" valueReference=\"9\" causality=\"input\" intervalVariability=\"countdown\"/>
  <Int32 name=\"lates\" valueReference=\"10\" causality=\"output\"/>
  <Clock name=\"third\" valueReference=\"11\" causality=\"output\" intervalVariability=\"triggered\"/>
  <Int32 name=\"thirds\" valueReference=\"12\" causality=\"output\" clocks=\"11\"/>
  <Clock name=\"asked\" valueReference=\"13\" causality=\"input\" intervalVariability=\"tunable\"/>
  <Int32 name=\"askeds\" valueReference=\"14\" causality=\"output\"/>
  <Binary name=\"blob\" valueReference=\"15\" causality=\"input\"/>";

const CONFIG: &str = "[driver]\nid = 1\nname = \"It\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
    mode = \"stepped\"\nscan = \"10ms\"\n\
    [[signal]]\nname = \"y[2]\"\naddress = \"%ID0\"\ntype = \"REAL\"\n\
    [[signal]]\nname = \"First\"\naddress = \"%ID4\"\ntype = \"REAL\"\n\
    [[signal]]\nname = \"sampled\"\naddress = \"%ID8\"\ntype = \"REAL\"\n\
    [[signal]]\nname = \"samples\"\naddress = \"%ID12\"\ntype = \"DINT\"\n\
    [[signal]]\nname = \"lates\"\naddress = \"%ID16\"\ntype = \"DINT\"\n\
    [[signal]]\nname = \"thirds\"\naddress = \"%ID20\"\ntype = \"DINT\"\n\
    [[signal]]\nname = \"askeds\"\naddress = \"%ID24\"\ntype = \"DINT\"\n\
    [[signal]]\nname = \"u[1]\"\naddress = \"%QD0\"\ntype = \"REAL\"\n";

const MAP: &str =
    "[signals]\nFirst = \"y[1]\"\n[parameters]\nn = 3\ngain = [[1.0, 2.0], 3.0]\nmode = \"hold\"\n";

fn fmu() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let description = format!(
        "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"It\" instantiationToken=\"x\">\
         <CoSimulation modelIdentifier=\"it\" hasEventMode=\"true\"/><TypeDefinitions><EnumerationType name=\"Mode\">\
         <Item name=\"hold\" value=\"1\"/><Item name=\"track\" value=\"2\"/></EnumerationType></TypeDefinitions>\
         <ModelVariables>{VARIABLES}</ModelVariables><ModelStructure/></fmiModelDescription>"
    );
    let library = fs::read(sampling()).expect("the library");
    archive(
        &folder.path().join("it.fmu"),
        &[
            Entry::File("modelDescription.xml", description.as_bytes()),
            Entry::File("binaries/x86_64-linux/it.so", &library),
        ],
    );
    fs::write(folder.path().join("it.cfg"), CONFIG).expect("a file");
    folder
}

/// Runs the FMU for a second in steps of 40 ms; returns the columns of the last recorded step, and the messages.
fn run(map: &str, more: &[&str]) -> (Vec<String>, String) {
    let folder = fmu();
    fs::write(folder.path().join("it.toml"), map).expect("a file");
    let arguments = [
        "run",
        "it.fmu",
        "--config",
        "it.cfg",
        "--map",
        "it.toml",
        "--duration",
        "1s",
        "--step",
        "40ms",
        "--record",
        "it.csv",
    ];
    let ran = tickbus(folder.path(), &[&arguments[..], more].concat());
    let told = format!("{}{}", out(&ran), err(&ran));
    let record = fs::read_to_string(folder.path().join("it.csv")).unwrap_or_default();
    let last = record.lines().last().unwrap_or_default();
    (last.split(',').skip(4).map(str::to_owned).collect(), told)
}

#[test]
fn arrays_sizes_enumerations_and_clocks_run_in_both_ways() {
    for more in [&[][..], &["--isolated"]] {
        let (last, told) = run(MAP, more);
        // y[2] is 2 x u[2], which keeps its start value 2; the mirror sends it to u[1]. u[3] is 3.
        assert_eq!(last, ["4", "4", "9", "10", "10", "3", "5", "4"], "{told}");
        assert!(
            told.contains("input \"blob\" of the FMU keeps its start value"),
            "{told}"
        );
        assert!(
            told.contains("input \"u[3]\" of the FMU keeps its start value"),
            "{told}"
        );
        assert!(told.contains("run: ok ticks=25 time=1s"), "{told}");
    }
}

/// An exported FMU behind `tickbus run`: its clock and its event mode are used, and its inputs are set as whole arrays.
#[test]
fn an_exported_fmu_with_arrays_and_a_clock_runs_as_a_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    let head = |name: &str| {
        format!(
            "[driver]\nid = 1\nname = \"{name}\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
             mode = \"stepped\"\nscan = \"10ms\"\n"
        )
    };
    let signal = |name: &str, address: &str, more: &str| {
        format!("[[signal]]\nname = \"{name}\"\naddress = \"{address}\"\ntype = \"INT\"\n{more}")
    };
    let inner = [
        head("Inner"),
        signal("x[1]", "%IW0", "fail_safe = 3\n"),
        signal("x[2]", "%IW2", "fail_safe = 4\n"),
        signal("y[1]", "%QW0", ""),
        signal("y[2]", "%QW2", ""),
    ];
    // The outer PLC sends y[1] to x[2]; x[1] keeps its start value.
    let outer = [
        head("Outer"),
        signal("y[1]", "%IW2", ""),
        signal("y[2]", "%IW4", ""),
        signal("x[2]", "%QW2", ""),
    ];
    let write =
        |name: &str, text: String| fs::write(folder.path().join(name), text).expect("a file");
    write("inner.cfg", inner.concat());
    write("outer.cfg", outer.concat());
    let library = library().to_str().expect("UTF-8");
    let made = ["export", "inner.cfg", "--for", "fmi3", "--library", library];
    let made = tickbus(folder.path(), &made);
    assert_eq!(made.status.code(), Some(0), "{}", err(&made));
    for more in [&[][..], &["--isolated"]] {
        let run = ["run", "inner-fmi3.fmu", "--config", "outer.cfg"];
        let options = ["--duration", "1s", "--step", "20ms", "--record", "it.csv"];
        let ran = tickbus(folder.path(), &[&run[..], &options, more].concat());
        let told = format!("{}{}", out(&ran), err(&ran));
        assert!(told.contains("run: ok ticks=50 time=1s stale=0"), "{told}");
        assert!(
            told.contains("input \"x[1]\" of the FMU keeps its start value"),
            "{told}"
        );
        let record = fs::read_to_string(folder.path().join("it.csv")).expect("a recording");
        let last = record.lines().last().expect("a line");
        assert!(last.ends_with(",3,3,3"), "{record}");
    }
}

#[test]
fn wrong_lines_about_arrays_and_enumerations_are_told_at_their_place() {
    for (wrong, right, told) in [
        (
            "\"y[1]\"",
            "\"y\"",
            "it.toml:2:9: \"y\" is an array of Float64; it has the elements \"y[1]\" to \"y[3]\"; name one",
        ),
        (
            "\"y[1]\"",
            "\"y[4]\"",
            "it.toml:2:9: \"y\" is an array of Float64; it has the elements \"y[1]\" to \"y[3]\"; name one",
        ),
        (
            "n = 3",
            "n = 2",
            "it.toml:5:8: \"gain\" is an array of Float64, and these are 3 values; write 2 values",
        ),
        (
            "n = 3",
            "n = -1",
            "it.toml:4:5: \"n\" is of type UInt64, which has no such value",
        ),
        ("n = 3", "n = 1000000", "it.toml:5:"),
        (
            "gain = [[1.0, 2.0], 3.0]",
            "\"gain[1]\" = 2.0",
            "it.toml:5:13: \"gain\" is an array of Float64; write all its elements in one line",
        ),
        ("gain = [[1.0, 2.0], 3.0]", "gain = 2.0", "it.toml:5:8: "),
        (
            "\"hold\"",
            "\"hole\"",
            "it.toml:6:8: the enumeration of \"mode\" has no item \"hole\"; did you mean \"hold\"?",
        ),
    ] {
        let (_, found) = run(&MAP.replace(wrong, right), &[]);
        assert!(found.contains(told), "{right}: {found}");
    }
}
