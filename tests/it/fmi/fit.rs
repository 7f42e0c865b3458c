//! Parameters of an FMU that are fitted to a recording.

use std::fs;

use super::fixture::{err, out, tanks, tickbus};

#[test]
fn parameters_of_an_fmu_are_fitted_within_a_percent() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("a file");
    for file in ["tank2.fmu", "tank.cfg"] {
        fs::copy(tanks().join(file), folder.path().join(file)).expect("a copy");
    }
    let map = fs::read_to_string(tanks().join("tank.toml")).expect("the map");
    write("guess-map.toml", &map);
    write(
        "map.toml",
        &map.replace("\"area\" = 0.25", "\"area\" = 0.4\n\"leak\" = 0.003"),
    );
    let run = [
        "run",
        "tank2.fmu",
        "--config",
        "tank.cfg",
        "--map",
        "map.toml",
        "--duration",
        "60s",
        "--record",
        "real.vcd",
    ];
    let ran = tickbus(folder.path(), &run);
    assert_eq!(ran.status.code(), Some(0), "{}{}", out(&ran), err(&ran));
    write(
        "guess.toml",
        "config = \"tank.cfg\"\n[machine]\nfmu = \"tank2.fmu\"\nmap = \"guess-map.toml\"\n",
    );
    write(
        "fit.toml",
        "runs = 120\n[[parameter]]\nfmu = \"area\"\nfrom = 0.1\nto = 1.0\n\
         [[parameter]]\nfmu = \"leak\"\nfrom = 0.0\nto = 0.009\nstart = 0.0\n",
    );
    let with = [
        "compare",
        "real.vcd",
        "--model",
        "guess.toml",
        "--fit",
        "fit.toml",
        "--json",
    ];
    let ran = tickbus(folder.path(), &with);
    assert_eq!(ran.status.code(), Some(0), "{}{}", out(&ran), err(&ran));
    let found: serde_json::Value = serde_json::from_str(&out(&ran)).expect("a document");
    let parameters = found["fit"]["parameters"].as_array().expect("a list");
    for (parameter, right) in parameters.iter().zip([0.4, 0.003]) {
        let value = parameter["value"].as_f64().expect("a number");
        assert!((value - right).abs() < 0.01 * right, "{found:#}");
    }
}
