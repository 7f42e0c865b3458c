//! FMUs of tickbus in foreign tools, and foreign FMUs as machines of tickbus.
#![allow(missing_docs, reason = "a test")]

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;

use tempfile::TempDir;

use crate::fixture::{library, made, tanks};
use crate::harness::{self, Absent, Test};
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::{Area, DataType, Slot};
use tickbus::time::{Manual, Nanos};
use tickbus_test_log as logged;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("fmpy_validates_and_runs_both_versions", in_fmpy),
    ("fmpy_runs_an_fmu_of_3_0_in_the_event_mode", in_events),
    ("every_misuse_of_the_functions_has_an_answer", misuse),
    ("the_fmu_manipulation_toolbox_finds_nothing", in_toolbox),
    ("vdmcheck2_finds_nothing_but_in_a_wrong_one", in_vdmcheck),
    ("the_example_s_tank_is_one_for_others_too", tank),
    ("libcosim_runs_an_fmu_of_2_0", in_libcosim),
    ("the_rig_records_the_same_in_an_fmu_in_c_and_in_rust", rig),
    ("an_fmu_by_pythonfmu_is_the_machine", by_pythonfmu),
    ("arrays_of_an_fmu_by_pythonfmu3_are_signals", by_pythonfmu3),
];

/// A Python with the tools.
fn python() -> Result<Command, Absent> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Err(Absent(
            "the tools' own libraries are for Linux on x86-64".to_owned(),
        ));
    }
    harness::python_with(
        "fmi",
        &[
            "fmpy",
            "libcosimpy",
            "pythonfmu",
            "pythonfmu3",
            "fmu_manipulation_toolbox",
        ],
    )
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).trim().to_owned()
}

/// Runs `tests/peers/fmi_tools.py`; its one line says ok.
fn tool(arguments: &[&str]) -> Result<(), Absent> {
    let mut python = python()?;
    let script = Path::new(ROOT).join("tests/peers/fmi_tools.py");
    let output = python
        .arg(script)
        .args(arguments)
        .output()
        .expect("it starts");
    let (told, complaint) = (text(&output.stdout), text(&output.stderr));
    assert!(
        output.status.success() && told.contains("fmi_tools: ok"),
        "{arguments:?}\n{told}\n{complaint}"
    );
    Ok(())
}

/// Writes the FMU of a driver.cfg.
fn export(config: &Path, version: &str, fmu: &Path) {
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("export")
        .arg(config)
        .args(["--for", version, "--library"])
        .arg(library())
        .arg("--out")
        .arg(fmu)
        .output()
        .expect("it runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// The FMUs of tests/fmi/types.cfg, in both versions.
fn types() -> [&'static str; 2] {
    const VERSIONS: [&str; 2] = ["fmi2", "fmi3"];
    static MADE: OnceLock<[String; 2]> = OnceLock::new();
    let config = Path::new(ROOT).join("tests/fmi/types.cfg");
    let made = MADE.get_or_init(|| {
        let file = |version| format!("{version}.fmu");
        let folder = made("types", |folder| {
            for version in VERSIONS {
                export(&config, version, &folder.join(file(version)));
            }
        });
        let path = |version| folder.join(file(version)).to_str().map(str::to_owned);
        VERSIONS.map(|version| path(version).expect("UTF-8"))
    });
    made.each_ref().map(String::as_str)
}

fn in_fmpy() -> Result<(), Absent> {
    python()?;
    types().into_iter().try_for_each(|fmu| tool(&["fmpy", fmu]))
}

fn in_events() -> Result<(), Absent> {
    python()?;
    tool(&["events", types()[1]])
}

fn misuse() -> Result<(), Absent> {
    python()?;
    types()
        .into_iter()
        .try_for_each(|fmu| tool(&["misuse", fmu]))
}

fn in_toolbox() -> Result<(), Absent> {
    python()?;
    types()
        .into_iter()
        .try_for_each(|fmu| tool(&["toolbox", fmu]))
}

/// `VDMCheck2`, a formal model of FMI 2.0, checks an FMU, or only its modelDescription.xml. Returns its messages.
fn ask_vdmcheck(asked: &[&Path]) -> Result<Vec<String>, Absent> {
    let folder = Path::new(ROOT).join("target/peers/java/vdmcheck");
    if !folder.join("fmi2-rule-model").exists() {
        return Err(Absent("VDMCheck2 is not there; run tools/peers".to_owned()));
    }
    let rules = std::fs::read_dir(folder.join("fmi2-rule-model/Rules")).expect("its rules");
    let rules = rules.map(|rule| rule.expect("a rule").path());
    let rules: Vec<_> = rules
        .filter(|rule| rule.extension().is_some_and(|ending| ending == "adoc"))
        .collect();
    let start =
        |file: &&Path| {
            Command::new("java")
            // The program runs only a few seconds.
            .args(["-XX:TieredStopAtLevel=1", "-XX:+UseSerialGC", "-XX:-UsePerfData"])
            .args(["-Dvdmj.parser.merge_comments=true"])
            .args(["-Dfmureader.noschema=true", "-Dfmureader.xsd=fmi2schema/fmi2.xsd"])
            .args(["-cp", "lib/*", "com.fujitsu.vdmj.VDMJ", "-vdmsl", "-q", "-annotations", "-e"])
            .arg("isValidFMIConfigurations(modelDescription, buildDescription, terminalsAndIcons)")
            .arg("fmi2-rule-model")
            .args(&rules)
            .arg(file)
            .current_dir(&folder)
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|why| Absent(format!("there is no java: {why}")))
        };
    let running = asked.iter().map(start).collect::<Result<Vec<_>, _>>()?;
    let ended = running.into_iter().map(Child::wait_with_output);
    Ok(ended
        .map(|output| text(&output.expect("it ends").stdout))
        .collect())
}

fn in_vdmcheck() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let wrong = folder.path().join("modelDescription.xml");
    let right = std::fs::read_to_string(Path::new(ROOT).join("examples/fmu-tank/fmi2.xml"));
    let bent = right.expect("a file").replace("\"output\"", "\"input\"");
    std::fs::write(&wrong, bent).expect("a file");
    let tank = tanks().join("tank2.fmu");
    let told = ask_vdmcheck(&[Path::new(types()[0]), &tank, &wrong])?;
    assert_eq!(told[..2], ["true", "true"]);
    let causality = "Variable \"low\" causality/variability/initial/start <input>";
    assert!(
        told[2].contains(causality) && told[2].ends_with("false"),
        "{}",
        told[2]
    );
    Ok(())
}

fn tank() -> Result<(), Absent> {
    python()?;
    for fmu in ["tank2.fmu", "tank3.fmu"] {
        tool(&["tank", tanks().join(fmu).to_str().expect("UTF-8")])?;
    }
    Ok(())
}

fn in_libcosim() -> Result<(), Absent> {
    python()?;
    tool(&["cosim", types()[0]])
}

/// The rig's signals with its program stepped: 2000 ticks with the same inputs, in an FMU under `FMPy`, in C and in Rust.
fn rig() -> Result<(), Absent> {
    python()?;
    let folder = tempfile::tempdir().expect("a folder");
    let rig =
        std::fs::read_to_string(Path::new(ROOT).join("driver.cfg")).expect("the rig's driver.cfg");
    let signals = &rig[rig.find("[[signal]]").expect("signals")..];
    let config = folder.path().join("driver.cfg");
    let text = format!(
        "[driver]\nid = 1\nname = \"Test rig\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"rig\"\nmode = \"stepped\"\n{signals}"
    );
    std::fs::write(&config, text).expect("a file");
    let own = folder.path().join("rust.vcd");
    record(&config, &own);
    let own = std::fs::read(own).expect("a recording");
    for version in ["fmi2", "fmi3"] {
        let fmu = folder.path().join(format!("{version}.fmu"));
        export(&config, version, &fmu);
        let fmu = fmu.to_str().expect("UTF-8");
        let record = folder.path().join(format!("{version}.vcd"));
        tool(&["rig", fmu, record.to_str().expect("UTF-8")])?;
        assert!(
            std::fs::read(record).expect("a recording") == own,
            "{version}: the recordings differ"
        );
    }
    // And by the functions in C.
    let record = folder.path().join("c.vcd");
    let [library, config, file] =
        [library(), &config, &record].map(|path| path.to_str().expect("UTF-8"));
    tool(&["rig_in_c", library, config, file])?;
    assert!(
        std::fs::read(record).expect("a recording") == own,
        "C: the recordings differ"
    );
    assert!(
        own.len() > 100_000,
        "much has happened: {} bytes",
        own.len()
    );
    Ok(())
}

/// The same as `rig` in `tests/peers/fmi_tools.py`.
fn record(config: &Path, file: &Path) {
    let mut config =
        Config::load(config, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    config.record = Some(tickbus::record::Options::to(file).expect("a name"));
    let _logged = logged::Watch::new();
    let mut driver = Driver::open(config, Manual::new()).expect("opens");
    let mut slots = driver.initial_slots();
    let table = driver.config().table.clone();
    let mut random = 1_u64;
    for tick in 1..=2000_i64 {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let word = u32::try_from(random >> 32).expect("32 bits");
        let (mut bits, mut reals) = (0, 0);
        for (slot, signal) in slots.iter_mut().zip(&table.signals) {
            if signal.area == Area::Output {
                continue;
            }
            *slot = Slot::from_real(if signal.data_type == DataType::Bool {
                bits += 1;
                f64::from(word >> ((bits - 1) % 31) & 1)
            } else {
                reals += 1;
                f64::from((word >> (3 * (reals - 1))) % 1000) / 4.0
            });
        }
        driver.exchange(Nanos::from_millis(2 * tick), &mut slots);
    }
    driver.close();
}

/// A machine in Python, made an FMU by `PythonFMU`.
const MACHINE: &str = "\
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Machine(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.level = 0.5
        self.low = False
        self.valve = False
        self.register_variable(Boolean('valve', causality=Fmi2Causality.input, variability=Fmi2Variability.discrete))
        self.register_variable(Real('level', causality=Fmi2Causality.output))
        self.leak = 0.0
        self.register_variable(Real('leak', causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Boolean('low', causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))

    def do_step(self, current_time, step_size):
        self.level += ((0.04 if self.valve else -0.04) - self.leak) * step_size
        self.low = self.level < 0.4
        return True
";

/// Makes `Machine.fmu` from a class in Python, with one of the two tools; returns its folder.
fn built_by(tool: &str, class: &str) -> Result<TempDir, Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let script = folder.path().join("machine.py");
    std::fs::write(&script, class).expect("a file");
    let built = python()?
        .args(["-m", tool, "build", "-f"])
        .arg(&script)
        .arg("-d")
        .arg(folder.path())
        .output()
        .expect("it starts");
    assert!(
        built.status.success(),
        "{}{}",
        text(&built.stdout),
        text(&built.stderr)
    );
    Ok(folder)
}

/// Returns what the Python with the tools prints.
fn printed(code: &str) -> Result<String, Absent> {
    let asked = python()?.args(["-c", code]).output().expect("it starts");
    Ok(text(&asked.stdout))
}

/// The library of Python, which these FMUs expect to be loaded already.
fn shared_python() -> Result<String, Absent> {
    let shared = printed(
        "import sysconfig, os; print(os.path.join(sysconfig.get_config_var('LIBDIR'), sysconfig.get_config_var('INSTSONAME')))",
    )?;
    if !shared.contains(".so") || !Path::new(&shared).exists() {
        return Err(Absent(format!(
            "this Python has no shared library ({shared}), which FMUs of PythonFMU need"
        )));
    }
    Ok(shared)
}

fn by_pythonfmu() -> Result<(), Absent> {
    let folder = built_by("pythonfmu", MACHINE)?;
    let shared = shared_python()?;
    for file in ["tank.cfg", "tank.toml"] {
        let from = Path::new(ROOT).join("examples/fmu-tank").join(file);
        let text = std::fs::read_to_string(from).expect("a file");
        // This FMU has no such parameter.
        let text = text
            .split("[parameters]")
            .next()
            .expect("a part")
            .to_owned();
        std::fs::write(folder.path().join(file), text).expect("a file");
    }
    // A tunable parameter of the FMU is its fault.
    let faults =
        "[[fault]]\nkind = \"model\"\nname = \"leak\"\nvalue = 0.08\nat = \"5s\"\nfor = \"3s\"\n";
    std::fs::write(folder.path().join("faults.toml"), faults).expect("a file");
    let ran = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args([
            "run",
            "Machine.fmu",
            "--config",
            "tank.cfg",
            "--map",
            "tank.toml",
            "--step",
            "10ms",
            "--duration",
            "20s",
            "--record",
            "run.csv",
            "--faults",
            "faults.toml",
        ])
        .args(["--isolated"])
        .env("LD_PRELOAD", &shared)
        .current_dir(folder.path())
        .output()
        .expect("it runs");
    let told = text(&ran.stdout);
    assert!(ran.status.success(), "{told}\n{}", text(&ran.stderr));
    assert!(
        told.ends_with("run: ok ticks=2000 time=20s stale=0"),
        "{told}"
    );
    let record = std::fs::read_to_string(folder.path().join("run.csv")).expect("a recording");
    let lines: Vec<&str> = record.lines().collect();
    let level = |tick: usize| -> f64 {
        let value = lines[tick].rsplit(',').next().expect("a column");
        value.parse().expect("a level")
    };
    assert!((395.0..=405.0).contains(&level(2000)), "{}", level(2000));
    assert!((395.0..=405.0).contains(&level(500)), "{}", level(500));
    assert!((270.0..=290.0).contains(&level(800)), "{}", level(800));

    // The same machine in a sweep, of which two runs take place at once.
    let sweep = "config = \"tank.cfg\"\nstep = \"10ms\"\n\
                 [machine]\nfmu = \"Machine.fmu\"\nmap = \"tank.toml\"\nisolated = true\n\
                 [sweep]\nscenario = [{ run = \"10s\" }]\nmoments = [\"Level < 450\", \"Valve\"]\n\
                 told = \"Level < 300\"\nwithin = \"5s\"\n\
                 kinds = [\"stuck-off\", { kind = \"model\", name = \"leak\", value = 0.08 }]\n";
    std::fs::write(folder.path().join("sweep.toml"), sweep).expect("a file");
    let ran = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["test", "sweep.toml", "--jobs", "2"])
        .env("LD_PRELOAD", &shared)
        .current_dir(folder.path())
        .output()
        .expect("it runs");
    let told = text(&ran.stdout);
    assert!(ran.status.success(), "{told}\n{}", text(&ran.stderr));
    assert!(told.contains("sweep: runs=4 told=4 "), "{told}");
    Ok(())
}

/// A machine with arrays, made an FMU 3.0 by `PythonFMU3`.
const ARRAYS: &str = "\
import numpy
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability


class Machine(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.gain = numpy.array([1.0, 1.0, 1.0])
        self.u = numpy.array([1.0, 2.0, 3.0])
        self.y = numpy.array([0.0, 0.0, 0.0])
        three = [Dimension(start='3')]
        self.register_variable(Float64('time', causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous))
        self.register_variable(Float64('u', causality=Fmi3Causality.input, dimensions=three))
        self.register_variable(
            Float64('gain', causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable, dimensions=three)
        )
        self.register_variable(Float64('y', causality=Fmi3Causality.output, dimensions=three))

    def do_step(self, current_time, step_size):
        self.y = self.gain * self.u
        return True
";

fn by_pythonfmu3() -> Result<(), Absent> {
    let folder = built_by("pythonfmu3", ARRAYS)?;
    let config = "[driver]\nid = 1\nname = \"It\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\nmode = \"stepped\"\n\
                  [[signal]]\nname = \"y[1]\"\naddress = \"%ID0\"\ntype = \"REAL\"\n\
                  [[signal]]\nname = \"y[3]\"\naddress = \"%ID4\"\ntype = \"REAL\"\n\
                  [[signal]]\nname = \"u[3]\"\naddress = \"%QD0\"\ntype = \"REAL\"\n";
    std::fs::write(folder.path().join("it.cfg"), config).expect("a file");
    let map = "[parameters]\ngain = [2.0, 3.0, 5.0]\n";
    std::fs::write(folder.path().join("it.toml"), map).expect("a file");
    let ran = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args([
            "run",
            "Machine.fmu",
            "--config",
            "it.cfg",
            "--map",
            "it.toml",
        ])
        .args(["--step", "1s", "--duration", "3s", "--record", "run.csv"])
        .arg("--isolated")
        .env("LD_PRELOAD", shared_python()?)
        .env(
            "PYTHONPATH",
            printed("import sysconfig; print(sysconfig.get_path('purelib'))")?,
        )
        .current_dir(folder.path())
        .output()
        .expect("it runs");
    let told = text(&ran.stdout);
    assert!(ran.status.success(), "{told}\n{}", text(&ran.stderr));
    let record = std::fs::read_to_string(folder.path().join("run.csv")).expect("a recording");
    // The mirror sends y[1] to u[3]; u[1] keeps its start value 1.
    let last = record.lines().last().expect("a line");
    assert!(last.ends_with(",2,10,2"), "{record}");
    Ok(())
}
