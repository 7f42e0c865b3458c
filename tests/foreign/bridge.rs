//! `tickbus bridge` with foreign programs: Mosquitto as the broker, and its clients; pyserial on the serial line.
#![allow(missing_docs, reason = "a test")]

use crate::harness::Test;

pub(crate) const TESTS: &[(&str, Test)] = &[
    #[cfg(unix)]
    (
        "mosquitto_and_the_dispatcher_exchange_values",
        unix::exchange,
    ),
    #[cfg(unix)]
    ("the_bridge_outlives_a_restart_of_mosquitto", unix::restart),
    #[cfg(unix)]
    ("mosquitto_says_when_the_bridge_is_gone", unix::gone),
    #[cfg(unix)]
    (
        "mosquitto_lets_in_users_over_tls_and_others_learn_why_not",
        unix::secured,
    ),
    #[cfg(unix)]
    ("pyserial_takes_part_through_a_virtual_port", unix::pyserial),
];

#[cfg(unix)]
mod unix {
    use std::io::{BufRead as _, BufReader, Lines, Read};
    use std::net::TcpListener;
    use std::path::{Path, PathBuf};
    use std::process::{Child, Command, Stdio};

    use crate::commands::{LabClient, Running, bridge, dispatch};
    use crate::harness::{self, Absent};

    /// A foreign program, killed at the end.
    struct Peer {
        child: Child,
        lines: Lines<BufReader<Box<dyn Read>>>,
    }

    impl Peer {
        fn start(mut command: Command) -> Self {
            let mut child = command.stdout(Stdio::piped()).spawn().expect("it runs");
            let stdout = child.stdout.take().expect("it is piped");
            let lines = BufReader::new(Box::new(stdout) as Box<dyn Read>).lines();
            Self { child, lines }
        }

        /// Starts a program that logs to stderr.
        fn start_log(mut command: Command) -> Self {
            let mut child = command.stderr(Stdio::piped()).spawn().expect("it runs");
            let stderr = child.stderr.take().expect("it is piped");
            let lines = BufReader::new(Box::new(stderr) as Box<dyn Read>).lines();
            Self { child, lines }
        }

        /// Reads lines until one has `part`.
        fn until(&mut self, part: &str) -> String {
            let mut read = Vec::new();
            for line in &mut self.lines {
                let line = line.expect("text");
                if line.contains(part) {
                    return line;
                }
                read.push(line);
            }
            panic!("no \"{part}\" in {read:?}");
        }
    }

    impl Drop for Peer {
        fn drop(&mut self) {
            // The program may have ended.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }

    /// A laboratory: a dispatcher, a broker, and the folder of their files.
    struct Lab {
        folder: tempfile::TempDir,
        dispatch: Running,
        dispatcher: String,
        port: u16,
        broker: Peer,
    }

    const MAP: &str = "\
[dispatcher]
name = \"HALL\"
role = \"VR\"
address = \"DISPATCHER\"
[mqtt]
broker = \"127.0.0.1:PORT\"
status = \"hall/bridge\"
[[channel]]
channel = \"AI1\"
topic = \"hall/level\"
retain = true
[[channel]]
channel = \"AQ1\"
topic = \"hall/setpoint\"
[[channel]]
channel = \"Q1\"
topic = \"hall/valve\"
on = \"open\"
off = \"shut\"
";

    impl Lab {
        fn new() -> Result<Self, Absent> {
            harness::command("mosquitto_sub", "mosquitto-clients")?;
            let folder = tempfile::tempdir().expect("a folder");
            let mut dispatch = dispatch(&folder.path().join("lab.toml"), "127.0.0.1:0");
            let dispatcher = dispatch.after("dispatch: listening on ");
            // Mosquitto does not report a port that the system has chosen.
            let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
            let port = free.local_addr().expect("it is bound").port();
            drop(free);
            let text = format!(
                "listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\nlog_dest stderr\nuser root\n"
            );
            std::fs::write(folder.path().join("mosquitto.conf"), text).expect("a file");
            let map = MAP.replace("DISPATCHER", &dispatcher);
            let map = map.replace("PORT", &port.to_string());
            std::fs::write(folder.path().join("map.toml"), map).expect("a file");
            let broker = start_broker(folder.path())?;
            Ok(Self {
                folder,
                dispatch,
                dispatcher,
                port,
                broker,
            })
        }

        fn map(&self) -> PathBuf {
            self.folder.path().join("map.toml")
        }

        /// The bridge, once values go through.
        fn bridge(&self) -> Running {
            let mut running = bridge(&["mqtt", self.map().to_str().expect("text")]);
            running.after("bridge: connected with the broker at ");
            running.after("bridge: connected with ");
            self.subscribe().until("<online>");
            running
        }

        fn command(&self, name: &str, arguments: &[&str]) -> Command {
            let mut command = Command::new(name);
            command.args(["-h", "127.0.0.1", "-p", &self.port.to_string()]);
            command.args(arguments);
            command
        }

        /// All further messages of the broker, with their topics, and 1 for retained ones.
        fn subscribe(&self) -> Peer {
            Peer::start(self.command("mosquitto_sub", &["-t", "hall/#", "-F", "%t %r <%p>"]))
        }

        fn publish(&self, topic: &str, payload: &str) {
            let status = self
                .command("mosquitto_pub", &["-q", "1", "-t", topic, "-m", payload])
                .status();
            assert!(status.expect("it runs").success());
        }

        /// A tank, connected with the hall.
        fn tank(&self) -> LabClient {
            let mut tank = LabClient::connect(&self.dispatcher, "VP TANK AQ1 AI1 I1 V=2");
            tank.say("CONNECT AQ1:HALL:AI1 AI1:HALL:AQ1 I1:HALL:Q1");
            tank.until("OK CONNECT");
            tank
        }
    }

    fn start_broker(folder: &Path) -> Result<Peer, Absent> {
        // Asked for its version, Mosquitto would start.
        let mut command = harness::command_with("mosquitto", "-h", "mosquitto")?;
        command.arg("-c").arg(folder.join("mosquitto.conf"));
        let mut broker = Peer::start_log(command);
        broker.until(" running");
        Ok(broker)
    }

    pub(super) fn exchange() -> Result<(), Absent> {
        let lab = Lab::new()?;
        let mut bridge = lab.bridge();
        let mut topics = lab.subscribe();
        topics.until("<online>");
        let mut tank = lab.tank();
        tank.say("P AQ1=12.50");
        topics.until("hall/level 0 <12.5>");
        // A later subscriber gets the value, too.
        lab.subscribe().until("hall/level 1 <12.5>");
        lab.publish("hall/setpoint", "21.50");
        assert_eq!(tank.until("P "), "P AI1=21.5");
        lab.publish("hall/valve", "open");
        assert_eq!(tank.until("P "), "P I1=24");
        lab.publish("hall/setpoint", "a lot");
        let told = bridge.after("bridge: \"a lot\" from the topic ");
        assert!(
            told.starts_with("\"hall/setpoint\" is no value of AQ1"),
            "{told}"
        );
        lab.publish("hall/setpoint", "-3e-1");
        assert_eq!(tank.until("P "), "P AI1=-0.3");
        // The tank goes: there is no level.
        tank.say("BYE");
        topics.until("hall/level 0 <>");
        let (last, code) = bridge.interrupt();
        // When it joined, the level had no value.
        assert_eq!(
            last,
            "bridge: ok published=3 received=3 refused=1 overtaken=0"
        );
        assert_eq!(code, Some(0));
        lab.dispatch.interrupt();
        Ok(())
    }

    pub(super) fn restart() -> Result<(), Absent> {
        let mut lab = Lab::new()?;
        let mut bridge = lab.bridge();
        let mut tank = lab.tank();
        tank.say("P AQ1=1");
        lab.subscribe().until(" <1>");
        lab.publish("hall/setpoint", "5");
        assert_eq!(tank.until("P "), "P AI1=5");
        drop(lab.broker);
        assert!(
            bridge
                .after("bridge: the broker at ")
                .contains(" is lost (")
        );
        // Now there is no source.
        assert_eq!(tank.until("P "), "P AI1=0");
        tank.say("P AQ1=2");
        lab.broker = start_broker(lab.folder.path())?;
        bridge.after("bridge: connected with the broker at ");
        bridge.after("bridge: connected with ");
        lab.subscribe().until(" <2>");
        lab.publish("hall/setpoint", "7");
        assert_eq!(tank.until("P "), "P AI1=7");
        // The dispatcher goes.
        let mut topics = lab.subscribe();
        topics.until("<online>");
        lab.dispatch.interrupt();
        topics.until("hall/bridge 0 <offline>");
        bridge.after("bridge: the dispatcher at ");
        assert_eq!(bridge.interrupt().1, Some(0));
        Ok(())
    }

    pub(super) fn gone() -> Result<(), Absent> {
        let lab = Lab::new()?;
        let mut bridge = lab.bridge();
        let mut topics = lab.subscribe();
        topics.until("<online>");
        bridge.kill();
        topics.until("hall/bridge 0 <offline>");
        // The dispatcher gives the bridge's name to the next one.
        let bridge = lab.bridge();
        topics.until("hall/bridge 0 <online>");
        assert_eq!(bridge.interrupt().1, Some(0));
        topics.until("hall/bridge 0 <offline>");
        Ok(())
    }

    /// An authority, a certificate for 127.0.0.1 and one for the bridge, by openssl.
    fn make_certificates(folder: &Path) -> Result<(), Absent> {
        const CURVE: &str = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 30";
        harness::command_with("openssl", "version", "openssl")?;
        for arguments in [
            "-keyout ca.key -out ca.pem -subj /CN=authority",
            "-keyout other.key -out other.pem -subj /CN=other",
            "-CA ca.pem -CAkey ca.key -keyout broker.key -out broker.pem -subj /CN=broker \
             -addext basicConstraints=CA:FALSE -addext subjectAltName=IP:127.0.0.1",
            "-CA ca.pem -CAkey ca.key -keyout own.key -out own.pem -subj /CN=hall -addext basicConstraints=CA:FALSE",
        ] {
            let mut openssl = Command::new("openssl");
            openssl.current_dir(folder).args(["req", "-x509"]);
            openssl.args(CURVE.split(' ').chain(arguments.split_whitespace()));
            let output = openssl.output().expect("it runs");
            let told = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{told}");
        }
        Ok(())
    }

    const USER: &str = "user = \"hall\"\npassword_file = \"right\"\n";
    const OWN: &str = "certificate_file = \"own.pem\"\nprivate_key_file = \"own.key\"\n";

    pub(super) fn secured() -> Result<(), Absent> {
        let mut lab = Lab::new()?;
        let folder = lab.folder.path().to_owned();
        make_certificates(&folder)?;
        let made = Command::new("mosquitto_passwd")
            .current_dir(&folder)
            .args(["-b", "-c", "users", "hall", "geheim"])
            .status();
        assert!(made.expect("it comes with mosquitto").success());
        let free = || {
            let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
            listener.local_addr().expect("it is bound").port()
        };
        let (plain, mutual) = (lab.port, free());
        lab.port = free();
        let at = |name: &str| folder.join(name).display().to_string();
        let tls = format!(
            "cafile {}\ncertfile {}\nkeyfile {}\n",
            at("ca.pem"),
            at("broker.pem"),
            at("broker.key")
        );
        let text = format!(
            "allow_anonymous false\npassword_file {0}\npersistence false\nlog_dest stderr\nuser root\n\
             listener {plain} 127.0.0.1\nlistener {1} 127.0.0.1\n{tls}listener {1} 127.0.0.2\n{tls}listener {mutual} 127.0.0.1\n{tls}require_certificate true\n",
            at("users"),
            lab.port
        );
        std::fs::write(folder.join("mosquitto.conf"), text).expect("a file");
        drop(lab.broker);
        lab.broker = start_broker(&folder)?;
        std::fs::write(folder.join("right"), "geheim\n").expect("a file");
        std::fs::write(folder.join("wrong"), "erraten\n").expect("a file");
        let map = |broker: &str, keys: &str| {
            let map = MAP.replace("DISPATCHER", &lab.dispatcher);
            let map = map.replace("127.0.0.1:PORT", broker);
            let text = map.replace("[mqtt]\n", &format!("[mqtt]\n{keys}"));
            std::fs::write(folder.join("map.toml"), text).expect("a file");
            bridge(&["mqtt", folder.join("map.toml").to_str().expect("text")])
        };
        let ca = format!("{USER}ca_file = \"ca.pem\"\n");
        let here = format!("127.0.0.1:{}", lab.port);
        for (broker, keys, why) in [
            (
                &*here,
                ca.replace("right", "wrong"),
                "it refuses this client; check user and password_file",
            ),
            (
                &here,
                "ca_file = \"ca.pem\"\n".to_owned(),
                "it refuses this client",
            ),
            (
                &here,
                ca.replace("ca.pem", "other.pem"),
                "not signed by an authority of ca_file",
            ),
            (
                &format!("127.0.0.2:{}", lab.port),
                ca.clone(),
                "its certificate is for another name",
            ),
            (
                &format!("127.0.0.1:{plain}"),
                ca.clone(),
                "it does not speak TLS at this port",
            ),
            (
                &format!("127.0.0.1:{mutual}"),
                ca.clone(),
                "it may want a certificate_file",
            ),
        ] {
            let mut refused = map(broker, &keys);
            let told = refused.after("bridge: the broker at ");
            assert!(told.contains(why), "{why} in {told}");
        }
        let broken = map(&here, &ca.replace("ca.pem", "right"));
        assert_eq!(broken.end().1, Some(1), "the file has no certificate");
        for (broker, keys) in [
            (&*here, ca.clone()),
            (&format!("127.0.0.1:{mutual}"), format!("{ca}{OWN}")),
            (&format!("127.0.0.1:{plain}"), USER.to_owned()),
        ] {
            let mut running = map(broker, &keys);
            running.after("bridge: connected with the broker at ");
            running.after("bridge: connected with ");
            let login = ["-u", "hall", "-P", "geheim"];
            let mut topics = lab.command("mosquitto_sub", &["-t", "hall/#", "-F", "%t %r <%p>"]);
            topics.args(login).arg("--cafile").arg(at("ca.pem"));
            let mut topics = Peer::start(topics);
            topics.until("<online>");
            let mut tank = lab.tank();
            tank.say("P AQ1=12.50");
            topics.until("<12.5>");
            assert_eq!(running.interrupt().1, Some(0));
        }
        lab.dispatch.interrupt();
        Ok(())
    }

    pub(super) fn pyserial() -> Result<(), Absent> {
        const SCRIPT: &str = "\
import serial, sys
port = serial.Serial(sys.argv[1], 19200, timeout=60)
def say(line, end):
    port.write((line + '\\r').encode())
    while True:
        heard = port.read_until(b'\\r').decode().strip()
        print(heard, flush=True)
        if heard.startswith(end):
            return
say('VR SCADA Q1 I1 V=2', 'END')
say('CONNECT I1:SCADA:Q1', 'OK CONNECT')
say('P Q1=24', 'P I1=24')
say('nonsense', 'ERR 400')
say('PING', 'OK PING')
";
        let mut python = harness::python_with("main", &["serial"])?;
        let folder = tempfile::tempdir().expect("a folder");
        let mut dispatch = dispatch(&folder.path().join("lab.toml"), "127.0.0.1:0");
        let dispatcher = dispatch.after("dispatch: listening on ");
        let port = folder.path().join("com1");
        let name = port.to_str().expect("text");
        let mut bridge = bridge(&[
            "serial",
            "--pty",
            name,
            "--line-end",
            "cr",
            "--dispatcher",
            &dispatcher,
        ]);
        bridge.after("bridge: connected with ");
        python.args(["-c", SCRIPT, name]);
        let output = python.output().expect("it runs");
        let heard = String::from_utf8(output.stdout).expect("text");
        assert!(
            output.status.success(),
            "{heard}{}",
            String::from_utf8_lossy(&output.stderr)
        );
        assert!(
            heard.starts_with("OK VR\nVR:SCADA:Q01:I01:AQ00:AI00:"),
            "{heard}"
        );
        assert!(
            heard.contains("END 1\nOK CONNECT\nP I1=24\nERR 400 "),
            "{heard}"
        );
        assert!(heard.ends_with("OK PING\n"), "{heard}");
        assert_eq!(bridge.interrupt().1, Some(0));
        Ok(())
    }
}
