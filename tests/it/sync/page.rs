//! The live page of a run, read over HTTP while clients take part over TCP.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use serde_json::Value;
use tickbus::signal::DataType;
use tickbus::virtual_time::{Declaration, Participant, Step, Variable, tcp};
use tickbus_conformance::rig::eventually;

use super::Sync;

/// The page of a run.
struct Page {
    address: String,
    token: String,
}

impl Page {
    fn of(sync: &mut Sync) -> Self {
        let line = sync.line();
        let url = line.strip_prefix("sync: page at http://").expect(&line);
        let (address, token) = url.split_once("/#token=").expect("a token");
        Self {
            address: address.to_owned(),
            token: token.to_owned(),
        }
    }

    /// Sends a request with the token; returns the status and the body.
    fn ask(&self, line: &str, body: &str) -> (String, String) {
        let Self { address, token } = self;
        let mut stream = TcpStream::connect(address).expect("it listens");
        let length = body.len();
        write!(
            stream,
            "{line} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nAuthorization: Bearer {token}\r\n\
             Content-Length: {length}\r\n\r\n{body}"
        )
        .expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("UTF-8");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
        let status = head.split(' ').nth(1).expect("a status");
        (status.to_owned(), body.to_owned())
    }

    /// The document of the run at this path.
    fn run(&self, path: &str) -> Value {
        let (_, body) = self.ask(&format!("GET {path}"), "");
        let mut all: Value = serde_json::from_str(&body).expect("JSON");
        all["drivers"][0].take()
    }

    /// Waits until the line has this state, and a reason that begins like this.
    fn await_line(&self, state: &str, reason: &str) -> Value {
        eventually(&format!("the run is {state}: {reason}"), || {
            let line = self.run("/line");
            let told = line["reason"].as_str().expect("a reason");
            (line["state"] == state && told.starts_with(reason)).then_some(line)
        })
    }

    /// Waits until the variables have these names and values, as JSON.
    fn await_values(&self, right: &[(&str, &str)]) {
        eventually("all values are there", || {
            let run = self.run("/signals");
            let signals = run["signals"].as_array().expect("signals");
            let values: Vec<_> = signals
                .iter()
                .map(|it| {
                    (
                        it["name"].as_str().expect("a name"),
                        it["value"].to_string(),
                    )
                })
                .collect();
            let values = values.iter().map(|(name, value)| (*name, &**value));
            values.eq(right.iter().copied()).then_some(())
        });
    }
}

/// A client that writes a value of each kind, and finishes a step when told to.
struct Machine(Receiver<()>);

impl Participant for Machine {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new("machine");
        declaration.writes = [
            ("on", DataType::Bool),
            ("depth", DataType::Int),
            ("level", DataType::Real),
            ("long", DataType::Lint),
            ("ratio", DataType::Lreal),
        ]
        .map(|(name, data_type)| Variable::new(name, data_type))
        .into();
        declaration
    }

    fn initial(&mut self, writes: &mut [u64]) {
        writes[1] = (-5_i64).cast_unsigned();
    }

    fn run(&mut self, _: Step, _: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.0.recv().map_err(|gone| gone.to_string())?;
        writes[0] = 1;
        writes[1] = (-6_i64).cast_unsigned();
        writes[2] = 0.1_f32.to_bits().into();
        writes[3] = i64::MIN.cast_unsigned();
        writes[4] = 2.5_f64.to_bits();
        Ok(())
    }
}

/// A client that reads the machine in every second step, and writes values that are difficult for a page.
struct Plc;

const MARKUP: &str = "<img src=x onerror=alert(1)>";

impl Participant for Plc {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new("plc");
        declaration.multiple = 2.try_into().expect("not 0");
        declaration.reads = vec!["on".to_owned()];
        declaration.writes = vec![Variable::new(MARKUP, DataType::Bool)];
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, _: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        writes[0] = reads[0];
        Ok(())
    }
}

#[test]
fn the_page_shows_a_run_its_clients_and_its_variables() {
    let text =
        "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"10ms\"\nclients = [\"plc\", \"machine\"]\n";
    let mut sync = Sync::start_logging(text, &["--paused", "--page", "127.0.0.1:0"], "info");
    let mut stderr = sync.child.stderr.take().expect("it is piped");
    let page = Page::of(&mut sync);
    let address = sync.address();
    page.await_line("opening", "waiting for \"plc\", \"machine\"");
    let (go, may_go) = channel();
    thread::scope(|scope| {
        let plc = scope.spawn(|| tcp::join(&address, &mut Plc));
        page.await_line("opening", "waiting for \"machine\"");
        assert_eq!(page.run("/signals")["stations"][0], "plc");
        let machine = scope.spawn(|| tcp::join(&address, &mut Machine(may_go)));
        let line = page.await_line("running", "paused after step 0");
        // In the order of their names.
        let clients = &line["stations"];
        assert_eq!(
            (&clients[0]["name"], &clients[0]["state"]),
            (&"machine".into(), &"in every step".into())
        );
        assert_eq!(
            (&clients[1]["name"], &clients[1]["state"]),
            (&"plc".into(), &"in every step of 2".into())
        );
        eventually("the initial values are committed", || {
            let depth = page.run("/signals")["signals"][1].take();
            (depth["value"] == -5 && depth["raw"] == "16#FFFB").then_some(())
        });

        // The page names a slow client, while the run waits for it.
        sync.say("step 3");
        let line = page.await_line("stale", "\"machine\" has not finished step 1 for ");
        assert!(
            line["reason"]
                .to_string()
                .contains("the run ends after 10s"),
            "{line}"
        );
        assert_eq!(line["stations"][0]["stale"], true);
        assert_eq!(line["stations"][1]["stale"], false);
        for _ in 0..3 {
            go.send(()).expect("it runs");
        }
        let line = page.await_line("running", "paused after step 3");
        let facts: Vec<_> = line["facts"].as_array().expect("facts").iter().collect();
        assert!(
            facts.contains(&&serde_json::json!(["Virtual time", "0.020 s"])),
            "{line}"
        );
        assert!(
            facts.contains(&&serde_json::json!(["Steps", "3"])),
            "{line}"
        );
        page.await_values(&[
            ("on", "1"),
            ("depth", "-6"),
            ("level", "0.1"),
            ("long", "\"-9223372036854775808\""),
            ("ratio", "2.5"),
            (MARKUP, "1"),
        ]);
        let markup = page.run("/signals")["signals"][5].take();
        assert_eq!(
            (&markup["station"], &markup["writable"]),
            (&1.into(), &false.into())
        );

        // The run would then be a different one.
        let (status, told) = page.ask("PUT /force/1/on", "FALSE");
        assert_eq!(status, "409", "{told}");
        assert!(told.contains("have a client write it"), "{told}");
        let (_, metrics) = page.ask("GET /metrics", "");
        let steps = "tickbus_run_steps_total{driver=\"";
        assert!(metrics.contains(steps), "{metrics}");
        assert!(
            metrics.contains("signal=\"ratio\",station=\"machine\",unit=\"\"} 2.5\n"),
            "{metrics}"
        );

        sync.say("stop");
        for client in [plc, machine] {
            client
                .join()
                .expect("no panic")
                .expect("it was stopped between two steps");
        }
    });
    let (last, code) = sync.end();
    assert!(last.starts_with("sync: ok steps=3 time=20ms "), "{last}");
    assert_eq!(code, Some(0));
    // Logs are shown to others: they contain the address, but not the token that permits changes.
    let mut log = String::new();
    stderr.read_to_string(&mut log).expect("text");
    assert!(
        log.contains(&format!("the live page is at http://{}/\n", page.address)),
        "{log}"
    );
    assert!(!log.contains(&page.token), "{log}");
}
