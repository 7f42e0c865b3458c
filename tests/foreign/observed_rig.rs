//! The bottle rig behind a foreign Modbus server, moved by a foreign PLC program and recorded by an observer beside them; the
//! recording is compared with a model and fitted, by the commands of `docs/compare.md`.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use crate::commands::Running;
use crate::harness::{self, Absent, Test};
use crate::observer::free_port;

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "the_rig_behind_pymodbus_is_observed_compared_and_fitted",
    observed_compared_and_fitted,
)];

/// How often the rig and the observer ask the server.
const CYCLE: &str = "5ms";

/// The rig's own time for the way up, in seconds.
const UP: f64 = 2.0;

/// The rig as replies, with this time for the way up.
fn replies(up: &str) -> String {
    format!(
        "[[reply]]\nkind = \"cylinder\"\nname = \"lift 2\"\nextend = [\"LA2 run\", \"LA2 up\"]\n\
         retract = [\"LA2 run\", \"not LA2 up\"]\nextended = \"Step 5 complete\"\nretracted = \"LA2 bottom\"\n\
         position = \"LA2 position\"\nlimits = [0, 250]\nextend_time = \"{up}\"\nretract_time = \"1600ms\"\n\
         [[reply]]\nkind = \"follows\"\nname = \"wheel 2\"\nsignal = \"Step 4 complete\"\nwhen = \"IM2 index\"\n\
         on_after = \"700ms\"\n"
    )
}

/// The signals of the rig's driver.cfg, for an end of the foreign server.
fn config(port: u16, own: &str) -> String {
    let rig = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("driver.cfg"));
    let rig = rig.expect("the rig's driver.cfg");
    let (_, signals) = rig.split_once("[[signal]]").expect("signals");
    format!(
        "[driver]\nid = 1\nname = \"Rig\"\n[fieldbus]\nkind = \"modbus-client\"\naddress = \"127.0.0.1:{port}\"\n\
         cycle = \"{CYCLE}\"\noutputs = \"holding-register offset:0\"\ninputs = \"holding-register offset:1024\"\n{own}\n\
         [[signal]]{signals}"
    )
}

fn python(script: &str) -> Result<Command, Absent> {
    let mut python = harness::python_with("main", &["pymodbus", "serial"])?;
    python.arg(format!(
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/{}"),
        script
    ));
    Ok(python)
}

/// The foreign server, which has the process image. It is killed when a test fails before its end.
struct Server(Child);

impl Server {
    fn start(port: u16) -> Result<Self, Absent> {
        let mut server = python("modbus_server.py")?
            .args(["tcp", "127.0.0.1", &port.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        let told = BufReader::new(server.stdout.take().expect("a pipe"));
        let server = Self(server);
        let first = told.lines().next().expect("a line").expect("text");
        assert_eq!(first, "modbus_server: ready");
        Ok(server)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn compare(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("compare")
        .args(arguments.split(' '))
        .current_dir(folder)
        .output()
        .expect("it runs")
}

fn observed_compared_and_fitted() -> Result<(), Absent> {
    let port = free_port();
    let server = Server::start(port)?;
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).expect("written");
        path.to_str().expect("UTF-8").to_owned()
    };
    // The rig itself, and what an engineer has written about it: the way up is 20 % too short.
    let writes = "write_to = \"ACME PLC 7 1.2\"";
    let plant = file("plant.cfg", &[config(port, writes), replies("2s")].concat());
    file(
        "rig.cfg",
        &[config(port, writes), replies("1600ms")].concat(),
    );
    let observer = config(port, "role = \"observer\"").replace("fail_safe = true", "#");
    let observer = file("observer.cfg", &observer);
    for (name, config) in [("right", "plant.cfg"), ("guess", "rig.cfg")] {
        let text = format!("config = \"{config}\"\nstep = \"{CYCLE}\"\n[machine]\n");
        file(&format!("{name}.toml"), &text);
    }
    file(
        "limits.toml",
        "likeness = 0.9\n[limits]\nmedian = \"40ms\"\nmissing = 0\nextra = 0\n",
    );
    file(
        "parameters.toml",
        "runs = 60\n[[parameter]]\nreply = \"lift 2\"\nkey = \"extend_time\"\nfrom = \"500ms\"\nto = \"5s\"\n",
    );

    let plc = |cycles: &str| {
        let mut plc = python("rig_plc.py")?;
        let told = plc.args([&port.to_string(), cycles]).output();
        let told = told.expect("it starts");
        let errors = String::from_utf8_lossy(&told.stderr);
        assert_eq!(
            String::from_utf8_lossy(&told.stdout).trim(),
            format!("rig_plc: ok cycles={cycles}"),
            "{errors}"
        );
        Ok(())
    };
    let rig = Running::of("mirror", &[&plant, "--replies", "--tick", "1ms"]);
    // Until the rig is there.
    plc("0")?;
    let record = folder.path().join("real.vcd");
    let record = record.to_str().expect("UTF-8");
    let observing = Running::of("observe", &[&observer, "--record", record, "--tick", CYCLE]);
    plc("3")?;
    let (_, code) = observing.interrupt();
    assert_eq!(code, Some(0));
    rig.interrupt();
    drop(server);

    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    // With the right times the model is like the rig, as far as two polls let it.
    let right = compare(
        folder.path(),
        "real.vcd --model right.toml --limits limits.toml --page right.html",
    );
    let (told, wrong) = (text(&right.stdout), text(&right.stderr));
    assert!(right.status.success(), "{told}{wrong}");
    // With the guess it is not, and the limits say so.
    let guess = compare(
        folder.path(),
        "real.vcd --model guess.toml --limits limits.toml --page guess.html",
    );
    let (told, wrong) = (text(&guess.stdout), text(&guess.stderr));
    assert_eq!(guess.status.code(), Some(1), "{told}{wrong}");
    assert!(
        wrong.contains("\"Step 5 complete\": the median of the time differences is "),
        "{told}{wrong}"
    );
    let fit = compare(
        folder.path(),
        "real.vcd --model guess.toml --fit parameters.toml --json",
    );
    assert!(fit.status.success(), "{}", text(&fit.stderr));
    let found: serde_json::Value = serde_json::from_slice(&fit.stdout).expect("a document");
    let fitted = &found["fit"]["parameters"][0];
    let value = fitted["value"].as_f64().expect("a number");
    assert!((value - UP).abs() <= 0.01 * UP, "{found:#}");
    assert!(found["likeness"].as_f64() > Some(0.9), "{found:#}");
    Ok(())
}
