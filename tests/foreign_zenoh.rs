//! `tickbus dispatch --zenoh` on three hosts, each a network namespace with its own name; one is cut off and joined
//! again.
#![cfg(unix)]
#![allow(missing_docs, clippy::unnecessary_wraps, reason = "tests of one shape")]

#[path = "foreign/harness/mod.rs"]
mod foreign;

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, Command, ExitCode, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use foreign::Absent;
use tickbus_conformance::rig::eventually;

/// Far above the duration of any step here, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn main() -> ExitCode {
    foreign::main(&[(
        "zenoh",
        &[(
            "three_hosts_are_one_laboratory_and_a_partition_heals",
            three_hosts,
        )],
    )])
}

fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip")
        .args(arguments.split(' '))
        .output()
        .map_err(|why| format!("there is no ip ({why}; apt-get install iproute2)"))?;
    if output.status.success() {
        return Ok(());
    }
    let told = String::from_utf8_lossy(&output.stderr);
    Err(format!("ip {arguments}: {}", told.trim()))
}

/// Three namespaces on the bridge of a fourth, which is their switch.
struct Network {
    /// The part of the names that distinguishes parallel runs.
    tag: String,
}

const HOSTS: [&str; 3] = ["alpha", "beta", "gamma"];

impl Network {
    fn new() -> Result<Self, Absent> {
        let tag = format!("tb{}", std::process::id());
        let network = Self { tag };
        let absent = |why| Absent(format!("network namespaces are not allowed here: {why}"));
        network.build().map_err(absent)?;
        let tried = network.on(HOSTS[0], "bash").args(["-c", ":"]).output();
        if !tried.is_ok_and(|output| output.status.success()) {
            return Err(absent(
                "bash cannot be run on a host with a name of its own (apt-get install bash util-linux)".to_owned(),
            ));
        }
        Ok(network)
    }

    fn build(&self) -> Result<(), String> {
        let switch = self.namespace("switch");
        ip(&format!("netns add {switch}"))?;
        let inside = |command: &str| ip(&format!("-n {switch} {command}"));
        inside("link add bridge type bridge")?;
        inside("link set bridge up")?;
        for (at, host) in HOSTS.iter().enumerate() {
            let namespace = self.namespace(host);
            ip(&format!("netns add {namespace}"))?;
            inside(&format!(
                "link add {host} type veth peer name lan netns {namespace}"
            ))?;
            inside(&format!("link set {host} master bridge up"))?;
            let own = |command: &str| ip(&format!("-n {namespace} {command}"));
            own(&format!("address add 10.7.0.{}/24 dev lan", at + 1))?;
            own("link set lan up")?;
            own("link set lo up")?;
        }
        Ok(())
    }

    fn namespace(&self, name: &str) -> String {
        format!("{}-{name}", self.tag)
    }

    /// Pulls the cable of a host at the switch, or plugs it in.
    fn cable(&self, host: &str, is_in: bool) {
        let state = if is_in { "up" } else { "down" };
        let command = format!("-n {} link set {host} {state}", self.namespace("switch"));
        ip(&command).expect("the link is there");
    }

    /// The TCP connections of a host with this address.
    fn connections(&self, host: &str, address: &str) -> String {
        let output = Command::new("ip")
            .args(["netns", "exec", &self.namespace(host)])
            .args(["ss", "-Htn", "state", "established", "dst", address])
            .output()
            .expect("ss is of the same package as ip");
        assert!(output.status.success(), "{output:?}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// A command on a host. The system gives it the host's name.
    fn on(&self, host: &str, program: &str) -> Command {
        let script = format!("echo {host} > /proc/sys/kernel/hostname; exec \"$0\" \"$@\"");
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.namespace(host)]);
        command.args(["unshare", "--uts", "sh", "-c", &script, program]);
        command
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        for name in HOSTS.into_iter().chain(["switch"]) {
            // Parts that were not made do not exist.
            let _ = ip(&format!("netns delete {}", self.namespace(name)));
        }
    }
}

/// A program on a host, with its lines.
struct Program {
    child: Child,
    stdin: ChildStdin,
    lines: Receiver<String>,
    /// For messages.
    name: String,
}

impl Program {
    fn start(name: &str, mut command: Command) -> Self {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it runs");
        let stdin = child.stdin.take().expect("it is piped");
        let stdout = BufReader::new(child.stdout.take().expect("it is piped"));
        let (sender, lines) = channel();
        thread::spawn(move || {
            for line in stdout.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        let name = name.to_owned();
        Self {
            child,
            stdin,
            lines,
            name,
        }
    }

    fn say(&mut self, line: &str) {
        let written = self.stdin.write_all(format!("{line}\n").as_bytes());
        written.expect("it reads");
    }

    /// All lines up to the one that contains these words.
    fn until(&self, words: &str) -> Vec<String> {
        let mut all = Vec::new();
        while !all.last().is_some_and(|line: &String| line.contains(words)) {
            match self.lines.recv_timeout(PATIENCE) {
                Ok(line) => all.push(line),
                Err(why) => panic!("{} says no \"{words}\" ({why}), but {all:#?}", self.name),
            }
        }
        all
    }

    /// The next line.
    fn line(&self) -> String {
        self.lines.recv_timeout(PATIENCE).expect("a line")
    }

    fn ask(&mut self, line: &str, until: &str) -> Vec<String> {
        self.say(line);
        self.until(until)
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // The process may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn dispatch(network: &Network, host: &str, folder: &std::path::Path, options: &[&str]) -> Program {
    let mut command = network.on(host, env!("CARGO_BIN_EXE_tickbus"));
    command.args(["dispatch", "--idle", "1h", "--zenoh", "--patch"]);
    command.arg(folder.join(host)).args(options);
    let program = Program::start(host, command);
    assert_eq!(
        program.line(),
        format!("dispatch: in the laboratory lab as {host}")
    );
    program.until("listening on 127.0.0.1:20070");
    program
}

/// A client on a host: its input and output.
fn client(network: &Network, host: &str, identification: &str) -> Result<Program, Absent> {
    const RELAY: &str = "exec 3<>/dev/tcp/127.0.0.1/20070; cat <&3 & exec cat >&3";

    let mut command = network.on(host, "bash");
    command.args(["-c", RELAY]);
    let mut client = Program::start(identification, command);
    client.ask(identification, "END");
    Ok(client)
}

fn three_hosts() -> Result<(), Absent> {
    let network = Network::new()?;
    let folder = tempfile::tempdir().expect("a folder");
    let listen = ["--zenoh-listen", "tcp/10.7.0.1:7447"];
    let connect = ["--zenoh-connect", "tcp/10.7.0.1:7447"];
    let alpha = dispatch(&network, "alpha", folder.path(), &listen);
    let beta = dispatch(&network, "beta", folder.path(), &connect);
    let gamma = dispatch(&network, "gamma", folder.path(), &connect);
    for (host, others) in [
        (&alpha, ["beta", "gamma"]),
        (&beta, ["alpha", "gamma"]),
        (&gamma, ["alpha", "beta"]),
    ] {
        let told: String = others
            .iter()
            .flat_map(|_| host.until("is here; its clients"))
            .collect();
        for other in others {
            assert!(
                told.contains(&format!("the dispatcher of {other} is here")),
                "{told}"
            );
        }
    }

    let mut pump = client(&network, "beta", "VP PUMP Q02 I01 V=2")?;
    let mut logo = client(&network, "alpha", "VR LOGO Q01 I02 V=2")?;
    let mut panel = client(&network, "gamma", "VR PANEL Q01 I02 V=2")?;
    let list = loop {
        let list = panel.ask("LIST", "END");
        if list.last().is_some_and(|line| line == "END 3") {
            break list;
        }
    };
    for (name, host) in [
        ("VP:PUMP:", "@beta"),
        ("VR:LOGO:", "@alpha"),
        ("VR:PANEL:", ""),
    ] {
        let line = list.iter().find(|line| line.starts_with(name)).expect(name);
        assert!(line.ends_with(host), "{line}");
    }

    // Names of channels are everywhere.
    pump.ask("NAME Q1 Running", "OK NAME");
    while !panel
        .ask("LIST NAMES", "END")
        .contains(&"NAME PUMP:Q1 Running".to_owned())
    {}

    // The client's own inputs, an input elsewhere, and a connection between two others.
    logo.ask("CONNECT I1:PUMP:Q1", "OK CONNECT");
    panel.ask("CONNECT I1:PUMP:Q1 Q1:LOGO:I2 Q1:PUMP:I1", "OK CONNECT");
    let refused = pump.ask("CONNECT Q2:LOGO:I1", "ERR");
    assert!(refused[0].starts_with("ERR 409 LOGO:I1 is connected to PUMP:Q1"));
    pump.say("P Q1=1");
    logo.until("P I1=1");
    panel.until("P I1=1");
    panel.say("P Q1=2");
    logo.until("P I2=2");
    pump.until("P I1=2");

    network.cable("beta", false);
    logo.until("P I1=0");
    panel.until("P I1=0");
    pump.until("P I1=0");
    alpha.until("the dispatcher of beta is gone");
    gamma.until("the dispatcher of beta is gone");
    beta.until("the dispatcher of alpha is gone");
    let list = panel.ask("LIST", "END");
    assert!(!list.iter().any(|line| line.contains("PUMP")), "{list:?}");
    // A value that changes meanwhile, and one that continues.
    pump.say("P Q1=5");
    panel.say("P Q1=6");
    logo.until("P I2=6");
    let refused = panel.ask("CONNECT I2:PUMP:Q2", "ERR");
    assert!(refused[0].starts_with("ERR 404"), "{refused:?}");
    // Both sides have the name now.
    let mut second = client(&network, "gamma", "VP PUMP Q01 V=2")?;
    second.say("P Q1=9");
    panel.until("P I1=9");
    logo.until("P I1=9");

    network.cable("beta", true);
    let told = "two clients are named PUMP; the later one is PUMP@gamma until the other leaves";
    for host in [&alpha, &beta, &gamma] {
        host.until(told);
    }
    logo.until("P I1=5");
    panel.until("P I1=5");
    pump.until("P I1=6");

    // Long enough for Zenoh to give up its connections.
    network.cable("gamma", false);
    panel.until("P I1=9");
    logo.until("P I2=0");
    for host in ["alpha", "beta"] {
        eventually("Zenoh gives up", || {
            network
                .connections(host, "10.7.0.3")
                .is_empty()
                .then_some(())
        });
    }
    network.cable("gamma", true);
    panel.until("P I1=5");
    logo.until("P I2=6");

    // The end of a process is noticed without waiting, and so is its return.
    drop(beta);
    logo.until("P I1=9");
    panel.until("P I1=9");
    let kept = std::fs::read_to_string(folder.path().join("alpha")).expect("it was saved");
    for line in ["\"LOGO:I1\" = \"PUMP:Q1\"", "\"LOGO:I2\" = \"PANEL:Q1\""] {
        assert!(kept.contains(line), "{kept}");
    }
    Ok(())
}
