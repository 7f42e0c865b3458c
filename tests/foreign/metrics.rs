//! The metrics of the live page with foreign programs: `prometheus_client` and promtool read them, and a Prometheus scrapes
//! them, answers what the dashboard asks, and raises the alerts.
#![allow(missing_docs, reason = "a test")]

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::harness::{self, Absent, Test};
use crate::page::{LEVEL, Machine, eventually};

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("prometheus_client_reads_the_metrics", client_reads),
    ("promtool_finds_nothing_wrong", promtool),
    (
        "a_prometheus_answers_the_dashboard_and_raises_alerts",
        prometheus,
    ),
];

/// Metrics that only a simulation has; the mirror of this test scans as a program does.
const OF_TICKS: [&str; 2] = ["tickbus_exchanges_total", "tickbus_exchange_seconds"];

/// A program with text on its standard input; it must succeed. Returns its output.
fn filter(mut command: Command, text: &str) -> String {
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut stdin = child.stdin.take().expect("it is piped");
    stdin.write_all(text.as_bytes()).expect("it reads");
    drop(stdin);
    let output = child.wait_with_output().expect("it ends");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}\nof\n{text}");
    assert_eq!(errors, "", "of\n{text}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The metrics of a machine in which a signal is forced, once they tell of it.
fn of_forced(machine: &Machine) -> String {
    machine.ask(&format!("PUT {LEVEL}"), "125.0");
    eventually("it is forced", || machine.signal(2)["value"] == 125);
    // The statistics are updated twice a second.
    let mut text = String::new();
    eventually("the statistics tell of it", || {
        text = machine.ask("GET /metrics", "");
        let mut lines = text.lines();
        lines.any(|line| line.starts_with("tickbus_faults_begun_total") && line.ends_with(" 1"))
    });
    text
}

fn client_reads() -> Result<(), Absent> {
    let mut python = harness::python_with("metrics", &["prometheus_client"])?;
    let machine = Machine::start("kind = \"modbus-server\"", "keep_forced = true");
    let text = of_forced(&machine);
    python.arg("tests/peers/read_metrics.py");
    let read = filter(python, &text);
    let has = |line: &str| assert!(read.lines().any(|it| it == line), "no {line:?} in\n{read}");
    let level = "driver=Tank id=4711 signal=Level \"left\"";
    has(&format!(
        "gauge\ttickbus_signal_value\t{level} unit=mm\t125"
    ));
    has(&format!("gauge\ttickbus_signal_forced\t{level}\t1"));
    has("counter\ttickbus_signal_edges_total\tdriver=Tank id=4711 signal=Valve\t0");
    has("gauge\ttickbus_line_state\tdriver=Tank id=4711 state=opening\t1");
    has("counter\ttickbus_faults_begun_total\tdriver=Tank id=4711\t1");
    has("histogram\ttickbus_bus_cycle_seconds_bucket\tdriver=Tank id=4711 le=0.001\t0");
    Ok(())
}

fn promtool() -> Result<(), Absent> {
    let promtool = || harness::command("promtool", "prometheus");
    let machine = Machine::start("kind = \"modbus-server\"", "keep_forced = true");
    let text = of_forced(&machine);
    let mut check = promtool()?;
    check.args(["check", "metrics"]);
    filter(check, &text);
    let mut check = promtool()?;
    check.args(["test", "rules", "tests/peers/alerts.yml"]);
    filter(check, "");
    Ok(())
}

/// A Prometheus that scrapes one page, five times a second; killed at the end.
struct Prometheus {
    child: Child,
    port: u16,
    _folder: tempfile::TempDir,
}

impl Prometheus {
    fn start(page: &str) -> Result<Self, Absent> {
        let mut command = harness::command("prometheus", "prometheus")?;
        let folder = tempfile::tempdir().expect("a folder");
        let read = |name: &str| fs::read_to_string(Path::new("docs/grafana").join(name));
        let settings = read("prometheus.yml").expect("it is there");
        let settings = settings.replace("127.0.0.1:20080", page);
        let settings = settings.replace("interval: 5s", "interval: 200ms");
        fs::write(folder.path().join("prometheus.yml"), settings).expect("a file");
        // The alerts as they are, without their waits.
        let alerts = read("alerts.yml").expect("it is there");
        let alerts = alerts.lines().filter(|line| !line.contains("  for: "));
        let alerts: Vec<&str> = alerts.collect();
        fs::write(folder.path().join("alerts.yml"), alerts.join("\n")).expect("a file");
        // Prometheus does not report a port that the system has chosen.
        let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let port = free.local_addr().expect("it is bound").port();
        drop(free);
        let child = command
            .current_dir(folder.path())
            .args(["--config.file=prometheus.yml", "--storage.tsdb.path=data"])
            .args(["--log.level=error", "--web.listen-address"])
            .arg(format!("127.0.0.1:{port}"))
            .spawn()
            .expect("it runs");
        Ok(Self {
            child,
            port,
            _folder: folder,
        })
    }

    /// Asks its HTTP interface; `None` before it listens.
    fn get(&self, path: &str) -> Option<serde_json::Value> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).ok()?;
        // HTTP/1.0, so that the answer comes in one piece.
        write!(stream, "GET /api/v1/{path} HTTP/1.0\r\n\r\n").ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        let (_, body) = answer.split_once("\r\n\r\n")?;
        serde_json::from_str(body).ok()
    }

    /// The series that a query finds; a query with a mistake is a failure.
    fn query(&self, query: &str) -> Vec<serde_json::Value> {
        let escaped = query.bytes().map(|byte| format!("%{byte:02X}"));
        let path = format!("query?query={}", escaped.collect::<Vec<_>>().concat());
        let Some(answer) = self.get(&path) else {
            return Vec::new();
        };
        assert_ne!(answer["errorType"], "bad_data", "{query}: {answer}");
        answer["data"]["result"]
            .as_array()
            .cloned()
            .unwrap_or_default()
    }

    fn fires(&self, alert: &str) -> bool {
        let Some(answer) = self.get("alerts") else {
            return false;
        };
        let alerts = answer["data"]["alerts"].as_array().cloned();
        let is_it =
            |it: &serde_json::Value| it["labels"]["alertname"] == alert && it["state"] == "firing";
        alerts.unwrap_or_default().iter().any(is_it)
    }
}

impl Drop for Prometheus {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The queries of the dashboard, with all drivers and signals chosen.
fn dashboard() -> Vec<String> {
    let text = fs::read_to_string("docs/grafana/dashboard.json").expect("it is there");
    let dashboard: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let panels = dashboard["panels"].as_array().expect("a list");
    let targets = panels
        .iter()
        .filter_map(|panel| panel["targets"].as_array());
    let query = |target: &serde_json::Value| {
        let query = target["expr"].as_str().expect("a query");
        let query = query.replace("$driver", ".*").replace("$signal", ".*");
        query.replace("$__rate_interval", "2s")
    };
    targets.flatten().map(query).collect()
}

fn prometheus() -> Result<(), Absent> {
    harness::command("prometheus", "prometheus")?;
    let mut machine = Machine::start("kind = \"socket\"\nmax_age = \"10s\"", "keep_forced = true");
    let prometheus = Prometheus::start(&machine.page)?;
    eventually("its line is down", || prometheus.fires("TickbusLineDown"));
    machine.ask(&format!("PUT {LEVEL}"), "125.0");
    // A PLC that goes on sending.
    let mut plc = TcpStream::connect(format!("127.0.0.1:{}", machine.port)).expect("it listens");
    plc.write_all(&[1]).expect("it reads");
    machine.command.after("mirror: running: ");
    for query in dashboard() {
        if OF_TICKS.iter().any(|metric| query.contains(metric)) {
            // A query with a mistake fails.
            prometheus.query(&query);
            continue;
        }
        eventually(&query, || {
            plc.write_all(&[1]).expect("it reads");
            !prometheus.query(&query).is_empty()
        });
    }
    let level = || prometheus.query("tickbus_signal_value{signal=\"Level \\\"left\\\"\"}");
    eventually("the forced value is there", || {
        level()
            .first()
            .is_some_and(|series| series["value"][1] == "125")
    });
    eventually("the alert is over", || !prometheus.fires("TickbusLineDown"));
    drop(plc);
    eventually("the alert is there again", || {
        prometheus.fires("TickbusLineDown")
    });
    let page = machine.page.clone();
    drop(machine);
    eventually(&format!("nobody is at {page}"), || {
        prometheus.fires("TickbusGone")
    });
    Ok(())
}
