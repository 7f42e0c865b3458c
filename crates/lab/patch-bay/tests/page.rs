//! The patch bay for programs: HTTP at one end, clients of a real dispatcher at the other.
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use serde_json::{Value, json};
use tickbus_base::time::{Monotonic, Stop};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{Dispatcher, Door, Patch, Settings};
use tickbus_net::Address;
use tickbus_patch_bay::PatchBay;
use tickbus_web::{Limits, Room};

struct Page {
    address: SocketAddr,
    token: String,
}

impl Page {
    /// Sends a request with the token; returns the status and the JSON.
    fn ask(&self, line: &str, body: &str) -> (u16, Value) {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        write!(
            stream,
            "{line} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nAuthorization: Bearer {}\r\nContent-Length: {}\r\n\r\n{body}",
            self.address,
            self.token,
            body.len()
        )
        .expect("it reads");
        let mut text = String::new();
        stream.read_to_string(&mut text).expect("an answer");
        let (head, body) = text.split_once("\r\n\r\n").expect("a head");
        let status = head["HTTP/1.1 ".len()..][..3].parse().expect("a status");
        (status, serde_json::from_str(body).expect("JSON"))
    }

    #[track_caller]
    fn done(&self, line: &str, body: &str) {
        assert_eq!(
            self.ask(line, body),
            (200, json!({"code": 200, "text": "done"}))
        );
    }

    #[track_caller]
    fn refused(&self, line: &str, body: &str, code: u16, text: &str) {
        assert_eq!(
            self.ask(line, body),
            (code, json!({"code": code, "text": text}))
        );
    }
}

struct Client {
    stream: TcpStream,
    lines: Lines<BufReader<TcpStream>>,
}

impl Client {
    fn join(address: SocketAddr, line: &str) -> Self {
        let stream = TcpStream::connect(address).expect("it listens");
        let lines = BufReader::new(stream.try_clone().expect("a descriptor")).lines();
        let mut client = Self { stream, lines };
        client.say(&format!("{line} V=2"));
        while !client.hear().starts_with("END") {}
        client
    }

    fn say(&mut self, line: &str) {
        self.stream
            .write_all(format!("{line}\r\n").as_bytes())
            .expect("it reads");
    }

    fn hear(&mut self) -> String {
        self.lines.next().expect("a further line").expect("text")
    }
}

/// Runs `test` with a dispatcher and its page on free ports.
fn serve(test: impl FnOnce(SocketAddr, &Page)) {
    let listener = Listener::bind(&Address::local(0)).expect("a free port");
    let address = listener.address();
    let stop = Stop::new();
    let door = Door::new(&stop);
    let room = Room::bind(&Address::local(0), Limits::default()).expect("a free port");
    let url = room.url();
    let page = Page {
        address: room.address(),
        token: url.split_once("#token=").expect("a token").1.to_owned(),
    };
    let site = Arc::new(PatchBay::new(door.clone()));
    let _serving = room
        .serve(
            tickbus_web::Pages::of("Patch bay", site),
            Monotonic::shared(),
        )
        .expect("a thread");
    thread::scope(|scope| {
        let served = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                stop: &stop,
                door: Some(&door),
                patch_file: None,
                news: &mut |_| {},
            };
            listener.run(
                &mut Dispatcher::new(Settings::default(), Patch::new()),
                hosting,
            )
        });
        let outcome =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| test(address, &page)));
        stop.stop();
        served.join().expect("no panic").expect("it serves");
        outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
    let (status, _) = page.ask("DELETE /patch/LOGO:I1", "");
    assert_eq!(status, 503, "the dispatcher has ended");
    // The last state answers for a moment.
    while page.ask("GET /state", "").0 != 503 {}
}

#[test]
fn a_program_patches_forces_and_sees_the_board() {
    serve(|address, page| {
        let (status, state) = page.ask("GET /state", "");
        assert_eq!(
            (status, state),
            (
                200,
                json!({"full": true, "clients": [], "connections": [], "places": {}})
            )
        );
        let mut pump = Client::join(address, "VP PUMP Q01 I01");
        let mut logo = Client::join(address, "VR LOGO I01 AI01");
        pump.say("P Q1=24\r\nPING");
        assert_eq!(pump.hear(), "OK PING");
        page.done("PUT /patch/LOGO:I1", "PUMP:Q1");
        assert_eq!(logo.hear(), "P I1=24");
        page.done("PUT /force/LOGO:I1", "7.50");
        assert_eq!(logo.hear(), "P I1=7.5");
        let (_, mut state) = page.ask("GET /state", "");
        let places = state["places"].take();
        assert!(
            places["PUMP"]["x"].as_i64() < places["LOGO"]["x"].as_i64(),
            "sources are to the left: {places}"
        );
        let channel = |channel: &str, value: Value, forced: Value| json!({"channel": channel, "label": null, "value": value, "forced": forced});
        let client = |name: &str, role: &str, stream: &TcpStream, channels: Value| {
            let address = stream.local_addr().expect("it is connected").to_string();
            json!({"name": name, "role": role, "address": address, "channels": channels})
        };
        let expected = json!({
            "full": true,
            "places": null,
            "clients": [
                client("PUMP", "VP", &pump.stream, json!([
                    channel("Q1", json!("24"), Value::Null), channel("I1", Value::Null, Value::Null),
                ])),
                client("LOGO", "VR", &logo.stream, json!([
                    channel("I1", json!("7.5"), json!("7.5")), channel("AI0", Value::Null, Value::Null),
                    channel("AI1", Value::Null, Value::Null),
                ])),
            ],
            "connections": [{"input": "LOGO:I1", "output": "PUMP:Q1", "awake": true}],
        });
        assert_eq!(state, expected);
        logo.say("NAME AI1 Level \"A\\B\" </script> ä");
        assert_eq!(logo.hear(), "OK NAME");
        // Pictures of the board are made 30 times a second.
        let begun = Instant::now();
        while page.ask("GET /state", "").1["clients"][1]["channels"][2]["label"]
            != "Level \"A\\B\" </script> ä"
        {
            assert!(begun.elapsed().as_secs() < 60, "the label is missing");
        }
        page.done("DELETE /force/LOGO:I1", "");
        assert_eq!(logo.hear(), "P I1=24");
        drop(pump);
        assert_eq!(logo.hear(), "P I1=0");
        let (_, state) = page.ask("GET /state", "");
        assert_eq!(state["connections"][0]["awake"], false);
        page.done("DELETE /patch/PUMP:Q1", "");
        page.refused("DELETE /patch/LOGO:I1", "", 404, "LOGO:I1 is not connected");
        page.refused(
            "PUT /patch/LOGO:I1",
            "PUMP:Q1",
            404,
            "there is no client PUMP",
        );
        page.refused("DELETE /force/LOGO:I1", "", 404, "LOGO:I1 is not forced");
        let text = "I1 and I1 cannot be connected; connect an output with an input, digital or analog both";
        page.refused("PUT /patch/LOGO:I1", "LOGO:I1", 422, text);
        let text = "on is not a number; write one such as 24 or -3.5, of at most 23 characters";
        page.refused("PUT /force/LOGO:I1", "on", 400, text);
    });
}

#[test]
fn a_layout_is_changed_while_nobody_looks() {
    serve(|address, page| {
        let _pump = Client::join(address, "VP PUMP Q01");
        page.done("PUT /layout", r#"{"PUMP":{"x":480}}"#);
        let (_, state) = page.ask("GET /state", "");
        assert_eq!(state["places"]["PUMP"]["x"], 480);
    });
}

/// The events of a page, as a viewer without the token gets them.
struct Events(Lines<BufReader<TcpStream>>);

impl Events {
    fn open(page: &Page) -> Self {
        let mut stream = TcpStream::connect(page.address).expect("it listens");
        write!(
            stream,
            "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n",
            page.address
        )
        .expect("it reads");
        Self(BufReader::new(stream).lines())
    }

    /// The next event that fits.
    fn until(&mut self, fits: impl Fn(&Value) -> bool) -> Value {
        loop {
            let line = self.0.next().expect("a further line").expect("text");
            let Some(event) = line.strip_prefix("data: ") else {
                continue;
            };
            let event = serde_json::from_str(event).expect("JSON");
            if fits(&event) {
                return event;
            }
        }
    }
}

#[test]
fn a_viewer_gets_what_has_changed() {
    serve(|address, page| {
        let mut pump = Client::join(address, "VP PUMP Q02 I01");
        let mut logo = Client::join(address, "VR LOGO I01");
        pump.say("CONNECT Q1:LOGO:I1\r\nP Q1=0");
        assert_eq!(pump.hear(), "OK CONNECT");
        assert_eq!(logo.hear(), "P I1=0");
        let mut events = Events::open(page);
        let first = events.until(|_| true);
        assert_eq!(first["full"], true);
        assert_eq!(first["clients"][0]["name"], "PUMP");
        // The places of new boxes may follow.
        pump.say("P Q1=24 Q2=7");
        let event = events.until(|event| event.get("values").is_some());
        assert_eq!(
            event,
            json!({"values": {"PUMP": {"Q1": "24", "Q2": "7"}, "LOGO": {"I1": "24"}}})
        );
        page.done("PUT /force/LOGO:I1", "3");
        let event = events.until(|event| event.get("values").is_some());
        assert_eq!(event, json!({"values": {"LOGO": {"I1": ["3", "3"]}}}));
        // A cable that waits, and one that is cut.
        drop(logo);
        let event = events.until(|event| event.get("gone").is_some());
        assert_eq!(event["gone"], json!(["LOGO"]));
        assert_eq!(
            event["connections"],
            json!([{"input": "LOGO:I1", "output": "PUMP:Q1", "awake": false}])
        );
        page.done("DELETE /patch/LOGO:I1", "");
        let event = events.until(|event| event.get("cut").is_some());
        assert_eq!(event, json!({"cut": ["LOGO:I1"]}));
        pump.say("NAME Q2 Valve");
        let event = events.until(|event| event.get("clients").is_some());
        assert_eq!(event["clients"][0]["channels"][1]["label"], "Valve");
        page.done("PUT /layout", r#"{"PUMP":{"x":48,"y":8,"folded":true}}"#);
        let event = events.until(|event| event.get("places").is_some());
        let place = json!({"x": 48, "y": 8, "folded": true, "group": null});
        assert_eq!(event, json!({"places": {"PUMP": place}}));
        page.done("PUT /layout/arranged", "");
        let (status, refused) = page.ask("PUT /layout", r#"{"FAN":{"x":1}}"#);
        assert_eq!(status, 400);
        assert!(
            refused["text"]
                .to_string()
                .contains("there is no box \\\"FAN\\\""),
            "{refused}"
        );
        page.refused(
            "DELETE /layout",
            "",
            404,
            "change a layout with PUT /layout and PUT /layout/arranged",
        );
    });
}
