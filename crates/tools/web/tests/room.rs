//! The room over real sockets: access, refusals, and that no viewer delays another.
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use tickbus_base::time::{Manual, Nanos};
use tickbus_net::Address;
use tickbus_web::{
    Answer, Asset, Change, Limits, Outcome, Page, Pages, Refused, Room, Serving, Site, State, Verb,
};

/// A page with one text that can be changed.
#[derive(Default)]
struct Toy {
    text: Mutex<String>,
    looks: AtomicU64,
    /// Looks are kept without an answer.
    is_hung: AtomicBool,
    kept: Mutex<Vec<Answer<State>>>,
    /// The changes that hang.
    changes: Mutex<Vec<Answer<Outcome>>>,
    clock: Arc<Manual>,
    /// How far the clock advances while a look waits for its answer, and while it is formatted.
    waiting: AtomicI64,
    formatting: AtomicI64,
}

impl Site for Toy {
    fn assets(&self) -> &[Asset] {
        &[Asset {
            path: "/",
            kind: "text/html; charset=utf-8",
            text: "<p>toy",
        }]
    }

    fn look(&self, answer: Answer<State>) {
        self.looks.fetch_add(1, Ordering::SeqCst);
        self.clock
            .advance(Nanos(self.waiting.load(Ordering::SeqCst)));
        if self.is_hung.load(Ordering::SeqCst) {
            self.kept.lock().expect("no panic").push(answer);
            return;
        }
        let formatting = Nanos(self.formatting.load(Ordering::SeqCst));
        let clock = Arc::clone(&self.clock);
        let text = self.text.lock().expect("no panic").clone();
        // More than sockets buffer, without sending that much.
        let padding = " ".repeat(if text.starts_with("large") {
            1 << 20
        } else {
            0
        });
        answer.give(State::whole(move || {
            clock.advance(formatting);
            format!("\"{text}\"{padding}")
        }));
    }

    fn change(&self, change: Change, answer: Answer<Outcome>) {
        if change.path == "/nobody" {
            return;
        }
        if change.path == "/hang" {
            self.changes.lock().expect("no panic").push(answer);
            return;
        }
        answer.give(match (change.verb, &*change.path) {
            (Verb::Put, "/text") => {
                *self.text.lock().expect("no panic") = change.body;
                Ok(())
            }
            _ => Err(Refused {
                status: 409,
                text: "say \"text\"".to_owned(),
            }),
        });
    }
}

struct Fixture {
    toy: Arc<Toy>,
    address: SocketAddr,
    token: String,
    pages: Pages,
    _serving: Serving,
}

fn serve(limits: Limits) -> Fixture {
    let room = Room::bind(&Address::local(0), limits).expect("a free port");
    let (address, url) = (room.address(), room.url());
    let prefix = format!("http://{address}/#token=");
    let token = url.strip_prefix(&prefix).expect(&url).to_owned();
    let toy = Arc::new(Toy::default());
    let site: Arc<Toy> = Arc::clone(&toy);
    let clock = Arc::clone(&toy.clock);
    let pages = Pages::of("Toy", site);
    let serving = room.serve(pages.clone(), clock).expect("a thread");
    Fixture {
        toy,
        address,
        token,
        pages,
        _serving: serving,
    }
}

impl Fixture {
    fn connect(&self) -> TcpStream {
        TcpStream::connect(self.address).expect("it listens")
    }

    /// Sends a request with these additional headers, and returns the answer, head and body.
    fn ask(&self, line: &str, headers: &str, body: &str) -> String {
        let mut stream = self.connect();
        let length = body.len();
        // An early refusal closes the connection before everything was written.
        let _ = write!(
            stream,
            "{line} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nContent-Length: {length}\r\n{headers}\r\n{body}",
            self.address
        );
        read(stream)
    }

    fn put(&self, text: &str) -> String {
        let headers = format!("Authorization: Bearer {}\r\n", self.token);
        self.ask("PUT /text", &headers, text)
    }

    /// The next kept look.
    fn kept(&self) -> Answer<State> {
        loop {
            if let Some(answer) = self.toy.kept.lock().expect("no panic").pop() {
                return answer;
            }
            thread::yield_now();
        }
    }

    fn view(&self) -> Viewer {
        self.view_at("/events")
    }

    fn view_at(&self, path: &str) -> Viewer {
        let mut stream = self.connect();
        write!(
            stream,
            "GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n",
            self.address
        )
        .expect("it reads");
        let mut viewer = Viewer(BufReader::new(stream));
        assert!(viewer.line().starts_with("HTTP/1.1 200"));
        viewer
    }
}

fn read(mut stream: TcpStream) -> String {
    let mut text = String::new();
    // A server that refuses a body may close before it has read the body.
    let _ = stream.read_to_string(&mut text);
    text
}

struct Viewer(BufReader<TcpStream>);

impl Viewer {
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.0.read_line(&mut line).expect("text");
        assert!(!line.is_empty(), "the stream has ended");
        line
    }

    /// The next event of this name.
    fn event(&mut self, name: &str) -> String {
        let name = format!("event: {name}\n");
        while self.line() != name {}
        self.state()
    }

    /// The next state, or the data of an event.
    fn state(&mut self) -> String {
        loop {
            let line = self.line();
            if let Some(data) = line.strip_prefix("data: ") {
                return data.trim_end().to_owned();
            }
        }
    }
}

#[track_caller]
fn assert_status(answer: &str, status: u16) {
    assert!(
        answer.starts_with(&format!("HTTP/1.1 {status} ")),
        "{answer}"
    );
}

#[test]
fn a_page_is_served_with_its_headers() {
    let fixture = serve(Limits::default());
    let answer = fixture.ask("GET /", "", "");
    assert_status(&answer, 200);
    assert!(answer.ends_with("<p>toy"), "{answer}");
    for header in [
        "cache-control: no-store",
        "content-security-policy: default-src 'none'; script-src 'self'",
        "frame-ancestors 'none'",
        "referrer-policy: no-referrer",
        "x-content-type-options: nosniff",
        "cross-origin-resource-policy: same-origin",
    ] {
        assert!(answer.contains(header), "{header} in {answer}");
    }
    assert!(
        !answer.contains(&fixture.token),
        "the token is not in the page"
    );
    assert_status(&fixture.ask("GET /other", "", ""), 404);
    let refused = fixture.ask("POST /text", "", "");
    assert_status(&refused, 405);
    assert!(refused.contains("allow: GET, PUT, DELETE"), "{refused}");
    assert_status(&fixture.ask("OPTIONS /text", "", ""), 405);
}

#[test]
fn who_has_no_token_only_looks() {
    let fixture = serve(Limits::default());
    assert!(
        fixture
            .ask("GET /access", "", "")
            .ends_with("{\"may_change\":false}\n")
    );
    let right = format!("Authorization: Bearer {}\r\n", fixture.token);
    assert!(
        fixture
            .ask("GET /access", &right, "")
            .ends_with("{\"may_change\":true}\n")
    );
    let wrong = "Authorization: Bearer 0123456789abcdef0123456789abcdef\r\n";
    assert_status(&fixture.ask("GET /access", wrong, ""), 401);
    let referer = format!(
        "Referer: http://{}/?token={}\r\n",
        fixture.address, fixture.token
    );
    for headers in ["", wrong, &*referer] {
        assert_status(&fixture.ask("PUT /text", headers, "x"), 401);
    }
    let in_path = format!("PUT /text?token={}", fixture.token);
    assert_status(&fixture.ask(&in_path, "", "x"), 401);
    assert_eq!(*fixture.toy.text.lock().expect("no panic"), "");
    assert!(fixture.ask("GET /state", "", "").ends_with("\r\n\"\""));
    assert_status(&fixture.put(" new \n"), 200);
    let state = fixture.ask("GET /state", "", "");
    assert!(
        state.ends_with("\r\n\"new\""),
        "what was put is there: {state}"
    );
    let refused = fixture.ask("DELETE /text", &right, "");
    assert_status(&refused, 409);
    assert!(
        refused.ends_with("{\"code\":409,\"text\":\"say \\\"text\\\"\"}\n"),
        "{refused}"
    );
    assert_status(&fixture.ask("PUT /nobody", &right, ""), 503);
}

#[test]
fn other_sites_and_other_hosts_are_refused_even_with_the_token() {
    let fixture = serve(Limits::default());
    let right = format!("Authorization: Bearer {}\r\n", fixture.token);
    for path in ["GET /", "GET /state", "GET /events", "PUT /text"] {
        let headers = format!("{right}Origin: http://evil.example\r\n");
        assert_status(&fixture.ask(path, &headers, "x"), 403);
        let mut stream = fixture.connect();
        write!(
            stream,
            "{path} HTTP/1.1\r\nHost: evil.example:{}\r\nConnection: close\r\n{right}\r\n",
            fixture.address.port()
        )
        .expect("it reads");
        assert_status(&read(stream), 403);
    }
    let absolute = format!("GET http://evil.example:{}/state", fixture.address.port());
    assert_status(&fixture.ask(&absolute, "", ""), 400);
    let own = format!("{right}Origin: http://{}\r\n", fixture.address);
    assert_status(&fixture.ask("PUT /text", &own, "x"), 200);
}

#[test]
fn large_bodies_and_heads_are_refused() {
    let fixture = serve(Limits::default());
    assert_status(&fixture.put(&"x".repeat(4096)), 200);
    assert_status(&fixture.put(&"y".repeat(4097)), 413);
    let right = format!("Authorization: Bearer {}\r\n", fixture.token);
    let mut stream = fixture.connect();
    write!(
        stream,
        "PUT /text HTTP/1.1\r\nHost: {}\r\nTransfer-Encoding: chunked\r\n{right}\r\n",
        fixture.address
    )
    .expect("it reads");
    // Until the server gives up; the announced length never ends.
    let mut writer = stream.try_clone().expect("a descriptor");
    while writer.write_all(b"400\r\n").is_ok()
        && writer.write_all(&[b'z'; 0x400]).is_ok()
        && writer.write_all(b"\r\n").is_ok()
    {}
    drop(stream);
    let head = format!("X: {}\r\n", "x".repeat(64 * 1024));
    let answer = fixture.ask("GET /", &head, "");
    assert!(
        answer.is_empty() || answer.starts_with("HTTP/1.1 431 "),
        "{answer}"
    );
    assert!(
        fixture.ask("GET /state", "", "").contains("xxxx"),
        "nothing of it was kept"
    );
}

#[test]
fn a_viewer_hears_the_newest_state_and_a_beat_without_one() {
    let fixture = serve(Limits::default());
    let mut viewer = fixture.view();
    assert_eq!(viewer.state(), "\"\"");
    fixture.put("one");
    assert_eq!(viewer.state(), "\"one\"");
    while viewer.line() != "event: beat\n" {}
}

#[test]
fn one_stream_has_the_pages_that_it_is_asked_for_and_the_tabs() {
    let fixture = serve(Limits::default());
    let board = Arc::new(Toy::default());
    let joined = fixture
        .pages
        .join(Page::new("Board", "/board", Arc::clone(&board) as _));
    let mut viewer = fixture.view_at("/events?page=%2Fboard&page=/later");
    assert_eq!(
        viewer.event("tabs"),
        "[{\"name\":\"Toy\",\"path\":\"/\"},{\"name\":\"Board\",\"path\":\"/board\"}]"
    );
    assert_eq!(viewer.event("/board"), "\"\"");
    let right = format!("Authorization: Bearer {}\r\n", fixture.token);
    assert_status(&fixture.ask("PUT /board/text", &right, "patched"), 200);
    assert_eq!(viewer.event("/board"), "\"patched\"");
    assert!(
        fixture
            .ask("GET /board/state", "", "")
            .ends_with("\r\n\"patched\"")
    );
    assert_eq!(fixture.view_at("/board/events").state(), "\"patched\"");
    // Nobody looks at the first page.
    assert_eq!(fixture.toy.looks.load(Ordering::SeqCst), 0);
    while viewer.event("beat") != "/board" {}

    let later = Arc::new(Toy::default());
    *later.text.lock().expect("no panic") = "here".to_owned();
    let _later = fixture.pages.join(Page::new("Later", "/later", later));
    assert_eq!(viewer.event("/later"), "\"here\"");
    drop(joined);
    // Another page at the same path is another one.
    let other = Page::new("Board", "/board", Arc::new(Toy::default()));
    let _other = fixture.pages.join(other);
    assert_eq!(viewer.event("/board"), "\"\"");
}

#[test]
fn a_stream_without_pages_has_a_beat_and_asks_no_page() {
    let fixture = serve(Limits::default());
    let mut viewer = fixture.view_at("/events?page=");
    assert_eq!(viewer.event("beat"), "");
    assert_eq!(fixture.toy.looks.load(Ordering::SeqCst), 0);
}

#[test]
fn a_wrong_list_of_pages_is_refused() {
    let fixture = serve(Limits::default());
    for query in ["pages=/", "page=%0Adata:", ""] {
        let answer = fixture.ask(&format!("GET /events?{query}"), "", "");
        assert_status(&answer, 400);
    }
    let many: Vec<_> = (0..33).map(|page| format!("page=/{page}")).collect();
    let answer = fixture.ask(&format!("GET /events?{}", many.join("&")), "", "");
    assert_status(&answer, 400);
    assert!(answer.contains("at most 32 pages"), "{answer}");
    let right = format!("Authorization: Bearer {}\r\n", fixture.token);
    let answer = fixture.ask("PUT /board/text", &right, "x");
    assert_status(&answer, 409);
}

/// An hour.
const HOUR: i64 = 3_600_000_000_000;

#[test]
fn a_site_that_was_slow_is_looked_at_again_at_once() {
    for is_formatting in [false, true] {
        let fixture = serve(Limits::default());
        let span = if is_formatting {
            &fixture.toy.formatting
        } else {
            &fixture.toy.waiting
        };
        span.store(HOUR, Ordering::SeqCst);
        let mut viewer = fixture.view();
        assert_eq!(viewer.state(), "\"\"");
        // Not by a change through the room, which would cut the pause short.
        "slow".clone_into(&mut fixture.toy.text.lock().expect("no panic"));
        assert_eq!(viewer.state(), "\"slow\"");
        fixture.put("changed");
        assert_eq!(viewer.state(), "\"changed\"");
    }
}

#[test]
fn a_change_during_a_look_keeps_nobody_from_seeing_it() {
    let fixture = serve(Limits::default());
    fixture.toy.is_hung.store(true, Ordering::SeqCst);
    let mut viewer = fixture.view();
    let answer = fixture.kept();
    fixture.put("one");
    answer.give(State::whole(|| "\"before\"".to_owned()));
    assert_eq!(viewer.state(), "\"before\"");
    // A viewer who comes after the change gets none of the earlier looks.
    let answer = fixture.kept();
    fixture.put("two");
    let mut late = fixture.view();
    answer.give(State::whole(|| "\"between\"".to_owned()));
    assert_eq!(viewer.state(), "\"between\"");
    fixture.kept().give(State::whole(|| "\"after\"".to_owned()));
    assert_eq!(late.state(), "\"after\"");
    assert_eq!(viewer.state(), "\"after\"");
}

#[test]
fn who_asks_for_the_state_gets_none_from_before() {
    let fixture = serve(Limits::default());
    // While somebody looks, there is always a state.
    let mut viewer = fixture.view();
    assert_eq!(viewer.state(), "\"\"");
    for n in 0..20 {
        // Not by a change through the room, of which it would know.
        *fixture.toy.text.lock().expect("no panic") = n.to_string();
        let answer = fixture.ask("GET /state", "", "");
        assert!(answer.ends_with(&format!("\"{n}\"")), "{n}: {answer}");
    }
}

#[test]
fn a_site_that_answers_nothing_has_no_beat() {
    let fixture = serve(Limits::default());
    let mut viewer = fixture.view();
    assert_eq!(viewer.state(), "\"\"");
    fixture.toy.is_hung.store(true, Ordering::SeqCst);
    let answer = fixture.kept();
    // One event may be due to the looks answered before.
    let stream = viewer.0.get_ref().try_clone().expect("a descriptor");
    let patience = Some(Duration::from_secs(5));
    stream.set_read_timeout(patience).expect("not zero");
    let mut line = String::new();
    let mut beats = 0;
    while viewer.0.read_line(&mut line).is_ok() {
        beats += usize::from(line == "event: beat\n");
        assert!(beats < 2, "it beats, and nothing is answered");
        line.clear();
    }
    stream.set_read_timeout(None).expect("none is fine");
    fixture.toy.is_hung.store(false, Ordering::SeqCst);
    answer.give(State::whole(|| "\"back\"".to_owned()));
    assert_eq!(viewer.state(), "\"back\"");
}

#[test]
fn who_asks_a_site_that_hangs_is_told_so() {
    let limits = Limits {
        patience: Duration::from_millis(100),
        ..Limits::default()
    };
    let fixture = serve(limits);
    fixture.toy.is_hung.store(true, Ordering::SeqCst);
    let answer = fixture.ask("GET /state", "", "");
    assert_status(&answer, 504);
    assert!(answer.contains("does not answer"), "{answer}");
    let headers = format!("Authorization: Bearer {}\r\n", fixture.token);
    let answer = fixture.ask("PUT /hang", &headers, "late");
    assert_status(&answer, 504);
    assert!(answer.contains("may still make the change"), "{answer}");
    // The site can still make the change.
    let late = fixture.toy.changes.lock().expect("no panic").pop();
    late.expect("it was asked").give(Ok(()));
}

#[test]
fn nobody_is_asked_while_nobody_looks() {
    let fixture = serve(Limits::default());
    fixture.ask("GET /", "", "");
    fixture.put("x");
    assert_eq!(fixture.toy.looks.load(Ordering::SeqCst), 0);
    fixture.view().state();
    assert!(fixture.toy.looks.load(Ordering::SeqCst) > 0);
}

#[test]
fn who_does_not_read_keeps_nobody_waiting_and_gets_the_newest() {
    // However slow this computer is, the room does not give the viewer up.
    let fixture = serve(Limits {
        patience: Duration::from_secs(3600),
        ..Limits::default()
    });
    let mut lazy = fixture.view();
    assert_eq!(lazy.state(), "\"\"");
    let mut diligent = fixture.view();
    diligent.state();
    // Far more than a socket buffers.
    for number in 0..40 {
        fixture.put(&format!("large {number}"));
        while diligent.state() != format!("\"large {number}\"") {}
    }
    let mut seen = 0;
    while lazy.state() != "\"large 39\"" {
        seen += 1;
    }
    assert!(seen < 39, "it has missed those between");
}

#[test]
fn a_viewer_who_never_reads_is_given_up() {
    let limits = Limits {
        patience: Duration::from_millis(100),
        ..Limits::default()
    };
    let fixture = serve(limits);
    let lazy = fixture.view();
    let mut number = 0_u64;
    let mut writer = lazy.0.get_ref();
    // The socket fills up, and is closed some time later: a connection that is closed with unread bytes is reset.
    while writer.write_all(b" ").is_ok() {
        number += 1;
        fixture.put(&format!("large {number}"));
    }
}

#[test]
fn two_hundred_viewers_are_served_and_those_above_the_limit_are_not() {
    let limits = Limits {
        connections: 201,
        ..Limits::default()
    };
    let fixture = serve(limits);
    let mut viewers: Vec<Viewer> = (0..200).map(|_| fixture.view()).collect();
    for viewer in &mut viewers {
        assert_eq!(viewer.state(), "\"\"");
    }
    fixture.put("all");
    for viewer in &mut viewers {
        while viewer.state() != "\"all\"" {}
    }
    let last = fixture.view();
    let mut refused = fixture.connect();
    let mut nothing = String::new();
    let _ = refused.read_to_string(&mut nothing);
    assert_eq!(nothing, "", "it is closed at once");
    drop(last);
    // The seat is free as soon as the room has noticed.
    while !fixture.ask("GET /", "", "").starts_with("HTTP/1.1 200") {}
}

#[test]
fn ten_thousand_connections_come_and_go() {
    let fixture = serve(Limits::default());
    for number in 0..10_000 {
        drop(fixture.connect());
        // An answer proves that all earlier connections were accepted. If more come at once than the system queues for
        // a listener, they have to retry after a second.
        if number % 64 == 0 {
            fixture.ask("GET /", "", "");
        }
    }
    while !fixture.ask("GET /", "", "").starts_with("HTTP/1.1 200") {}
}

#[cfg(unix)]
#[test]
fn a_token_in_a_file_survives_a_restart_and_is_for_its_owner_alone() {
    use std::os::unix::fs::PermissionsExt as _;

    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("page.token");
    let open = || Room::bind(&Address::local(0), Limits::default()).expect("a free port");
    let token = |room: &Room| room.url().split_once("#token=").map(|it| it.1.to_owned());
    let mut first = open();
    first.keep_token(&file).expect("it is made");
    let mode = std::fs::metadata(&file).expect("made").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    let mut second = open();
    assert_ne!(token(&second), token(&first));
    second.keep_token(&file).expect("it is read");
    assert_eq!(token(&second), token(&first));
    for (text, mode, words) in [
        ("0\n", 0o600, "something else"),
        ("0123456789abcdef0123456789abcdef\n", 0o644, "chmod 600"),
    ] {
        std::fs::write(&file, text).expect("there is room");
        let permissions = std::fs::Permissions::from_mode(mode);
        std::fs::set_permissions(&file, permissions).expect("it is ours");
        let refused = open().keep_token(&file).expect_err(text).to_string();
        assert!(refused.contains(words), "{refused}");
    }
}
