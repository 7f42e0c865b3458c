use super::*;

/// A client with a clock, and the events that it reported.
struct Bench {
    client: Client,
    now: Nanos,
}

impl Bench {
    fn new(cables: &[&str]) -> Self {
        let profile = Profile {
            role: Role::Process,
            name: "PUMP".to_owned(),
            counts: Counts::new(2, 1, 2, 1),
            cables: cables
                .iter()
                .map(|text| Cable::parse(text).expect(text))
                .collect(),
            alive: Some(Nanos::from_millis(250)),
            key: None,
        };
        let mut client = Client::new(profile, KEEP_ALIVE).expect("a right profile");
        client.connected(Nanos::ZERO);
        let now = Nanos::ZERO;
        Self { client, now }
    }

    /// A client that the dispatcher has accepted.
    fn taken(cables: &[&str]) -> Self {
        let mut bench = Self::new(cables);
        assert_eq!(
            bench.says(),
            "VP PUMP Q02 I01 AQ02 AI01 V=3 ALIVE=250ms\r\n"
        );
        let heard = bench.hears("OK VP\r\nVP:PUMP:Q02:I01:AQ02:AI01:127.0.0.1:3330\r\nEND 1\r\n");
        assert_eq!(heard.expect("right"), ["identified", "PUMP is here", "end"]);
        if cables.is_empty() {
            bench.settles();
        }
        bench
    }

    /// Everything was requested; the first values have come.
    fn settles(&mut self) {
        assert_eq!(self.says(), "PING\r\n");
        assert_eq!(self.hears("OK PING\r\n").expect("right"), ["settled"]);
    }

    fn says(&mut self) -> String {
        self.client.turn(self.now);
        let mut all = Vec::new();
        while !self.client.to_write().is_empty() {
            all.push(self.client.to_write()[0]);
            self.client.wrote(self.now, 1);
        }
        String::from_utf8(all).expect("text")
    }

    fn hears(&mut self, text: &str) -> Result<Vec<String>, String> {
        let mut events = Vec::new();
        let take = &mut |event: Event<'_>| events.push(shown(&event));
        let heard = self.client.hear(self.now, text.as_bytes(), take);
        heard.map_err(|error| error.to_string())?;
        Ok(events)
    }

    fn set(&mut self, channel: &str, value: &str) {
        let channel = Channel::parse(channel.as_bytes()).expect(channel);
        self.client
            .set(channel, Number::parse(value.as_bytes()).expect(value));
    }

    fn wait(&mut self, seconds: i64) {
        self.now += Nanos::from_secs(seconds);
    }
}

fn shown(event: &Event<'_>) -> String {
    match event {
        Event::Identified => "identified".to_owned(),
        Event::Value(channel, value) => format!("{channel}={value}"),
        Event::Lost(channel) => format!("{channel} is lost"),
        Event::LineEnd => "end of line".to_owned(),
        Event::Device(device) => format!("{} is here", device.name),
        Event::ListEnd => "end".to_owned(),
        Event::Settled => "settled".to_owned(),
        Event::Connected(cable) => format!("connected {cable}"),
        Event::Refused { cable, code, text } => {
            let cable = cable.map(ToString::to_string).unwrap_or_default();
            format!("refused {cable} {code} {text}")
        }
    }
}

#[test]
fn values_are_said_once_it_is_taken_when_they_change_and_together() {
    let mut bench = Bench::new(&[]);
    bench.set("Q1", "24");
    assert!(bench.says().starts_with("VP PUMP"));
    bench.set("AQ2", "1.5");
    assert_eq!(bench.says(), "", "it is not taken yet");
    assert!(!bench.client.is_identified() && !bench.client.is_all_written());
    bench.hears("OK VP\r\n").expect("right");
    assert!(bench.client.is_identified() && !bench.client.is_all_written());
    assert_eq!(bench.says(), "PING\r\nP Q1=24 AQ2=1.5\r\n");
    assert!(bench.client.is_all_written());
    bench.set("Q1", "24");
    assert_eq!(bench.says(), "", "it has not changed");
    bench.set("Q1", "0");
    bench.set("Q2", "24");
    assert_eq!(bench.says(), "P Q1=0 Q2=24\r\n");
    bench.client.connected(bench.now);
    assert!(bench.says().starts_with("VP PUMP"), "a new connection");
    bench.hears("OK VP\r\n").expect("right");
    assert_eq!(bench.says(), "PING\r\nP Q1=0 Q2=24 AQ2=1.5\r\n");
}

#[test]
fn while_the_system_does_not_take_a_line_the_newest_values_wait() {
    let mut bench = Bench::taken(&[]);
    bench.set("Q1", "1");
    bench.client.turn(bench.now);
    bench.client.wrote(bench.now, 3);
    for value in ["2", "3", "4"] {
        bench.set("Q1", value);
        bench.set("AQ1", value);
        bench.client.turn(bench.now);
    }
    assert_eq!(bench.says(), "1=1\r\nP Q1=4 AQ1=4\r\n");
}

#[test]
fn many_values_make_several_lines() {
    let profile = Profile {
        role: Role::Controller,
        name: "BIG".to_owned(),
        counts: Counts::new(256, 0, 256, 0),
        cables: Vec::new(),
        alive: None,
        key: None,
    };
    let mut client = Client::new(profile, KEEP_ALIVE).expect("a right profile");
    let capacity = client.out.capacity();
    for _ in 0..2 {
        client.connected(Nanos::ZERO);
        client.turn(Nanos::ZERO);
        client.wrote(Nanos::ZERO, client.to_write().len());
        let heard = client.hear(Nanos::ZERO, b"OK VR\n", &mut |_| {});
        heard.expect("right");
        for number in 1..=256 {
            for kind in [Kind::DigitalOutput, Kind::AnalogOutput] {
                let value = Number::parse(b"-12345678901234567890.1").expect("the longest");
                client.set(Channel { kind, number }, value);
            }
        }
        client.turn(Nanos::ZERO);
        let text = String::from_utf8(client.to_write().to_vec()).expect("text");
        assert_eq!(text.matches('=').count(), 512);
        let lines: Vec<&str> = text.lines().collect();
        let (ping, lines) = lines.split_first().expect("some");
        assert_eq!((*ping, lines.len()), ("PING", 4));
        assert!(lines.iter().all(|line| {
            (line.starts_with("P Q") || line.starts_with("P AQ")) && line.len() < 4096 - 2
        }));
    }
    assert_eq!(client.out.capacity(), capacity, "nothing was allocated");
}

#[test]
fn values_arrive_in_any_pieces() {
    let mut bench = Bench::taken(&[]);
    assert_eq!(bench.hears("P I1=2").expect("right"), [""; 0]);
    assert_eq!(bench.hears("4 AI1").expect("right"), [""; 0]);
    let heard = bench
        .hears("=-0.5\r\nP I1=0\nP\r\n\r\nP AI0=3\r\nP I1")
        .expect("right");
    assert_eq!(
        heard,
        [
            "I1=24",
            "AI1=-0.5",
            "end of line",
            "I1=0",
            "end of line",
            "end of line",
            "end of line"
        ],
        "AI0 is not used"
    );
    bench.client.connected(bench.now);
    bench.says();
    let heard = bench
        .hears("OK VP\r\nP I1=3\r\n")
        .expect("what had begun is forgotten");
    assert_eq!(heard, ["identified", "I1=3", "end of line"]);
}

#[test]
fn an_input_whose_source_is_lost_has_no_value() {
    let mut bench = Bench::taken(&[]);
    let heard = bench.hears("P I1=? AI1=2\r\nP AI1=?\r\n").expect("right");
    assert_eq!(
        heard,
        [
            "I1 is lost",
            "AI1=2",
            "end of line",
            "AI1 is lost",
            "end of line"
        ]
    );
}

#[test]
fn what_no_dispatcher_says_is_refused() {
    for (line, part) in [
        ("P I2=24", "I2 is no input of this client"),
        ("P Q1=24", "Q1 is no input"),
        (
            "P I1",
            "\"P I1\" came, but \"\" stands where = and a number",
        ),
        ("P I1=x", "\"x\" is no number for I1"),
        ("OK PING", "nothing was asked"),
        (
            "ERR",
            "no dispatcher says that; see whether a dispatcher listens there",
        ),
        ("ERR 70000 no", "no dispatcher says that"),
        ("HTTP/1.1 400 Bad Request", "\"HTTP/1.1 400 Bad Request\""),
        ("\u{1b}[0m\u{e4}", "\"?[0m??\""),
    ] {
        let mut bench = Bench::taken(&[]);
        let error = bench.hears(&format!("{line}\r\n")).expect_err(line);
        assert!(error.contains(part), "{error}");
    }
    let mut bench = Bench::taken(&[]);
    assert!(bench.hears(&"x".repeat(4095)).is_ok());
    let error = bench.hears("x").expect_err("too long");
    assert!(error.contains("at most 4096 bytes"), "{error}");
    let mut bench = Bench::new(&[]);
    bench.says();
    let error = bench.hears("OK VR\r\n").expect_err("another verb");
    assert!(error.contains("OK VP was expected"), "{error}");
}

#[test]
fn a_name_that_is_taken_is_a_clear_error() {
    for (answer, part) in [
        (
            "ERR 409 there is a client PUMP already; take another name",
            "the dispatcher has another client \"PUMP\"; give this one a \"name\" of its own",
        ),
        (
            "ERR 429 16384 clients are here, and no more are served",
            "does not take \"PUMP\": 16384 clients are here, and no more are served (ERR 429)",
        ),
        (
            "ERR 408 nothing was heard",
            "has disconnected \"PUMP\" (nothing was heard)",
        ),
    ] {
        let mut bench = Bench::new(&[]);
        bench.says();
        let error = bench.hears(&format!("{answer}\r\n")).expect_err(answer);
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn connections_are_asked_for_one_by_one_and_again_when_refused() {
    let mut bench = Bench::taken(&["I1:LOGO:Q1", "Q1:LOGO:I1"]);
    bench.set("Q1", "24");
    assert_eq!(bench.says(), "CONNECT I1:LOGO:Q1\r\nP Q1=24\r\n");
    assert_eq!(bench.says(), "", "the answer is waited for");
    let heard = bench
        .hears("ERR 404 there is no client LOGO\r\n")
        .expect("right");
    assert_eq!(heard, ["refused I1:LOGO:Q1 404 there is no client LOGO"]);
    assert_eq!(bench.says(), "CONNECT Q1:LOGO:I1\r\n");
    assert_eq!(
        bench.hears("OK CONNECT\r\n").expect("right"),
        ["connected Q1:LOGO:I1"]
    );
    bench.settles();
    assert_eq!(bench.says(), "");
    assert_eq!(bench.client.deadline(), ASK_AGAIN);
    bench.now = ASK_AGAIN;
    assert_eq!(bench.says(), "CONNECT I1:LOGO:Q1\r\n");
    assert_eq!(
        bench.hears("OK CONNECT\r\n").expect("right"),
        ["connected I1:LOGO:Q1"]
    );
    assert_eq!(bench.says(), "");
    let heard = bench.hears("ERR 500 who knows\r\n").expect("right");
    assert_eq!(heard, ["refused  500 who knows"]);
}

#[test]
fn a_quiet_client_says_ping_and_notices_that_nobody_answers() {
    let mut bench = Bench::taken(&[]);
    assert_eq!(bench.client.deadline(), KEEP_ALIVE);
    bench.wait(15);
    bench.hears("P I1=1\r\n").expect("right");
    assert_eq!(bench.says(), "");
    assert_eq!(
        bench.client.deadline(),
        KEEP_ALIVE,
        "it has said nothing since"
    );
    bench.wait(5);
    assert_eq!(bench.says(), "PING\r\n");
    bench.hears("OK PING\r\n").expect("right");
    bench.wait(15);
    bench.set("Q1", "24");
    assert_eq!(bench.says(), "P Q1=24\r\n");
    bench.wait(5);
    assert_eq!(bench.says(), "PING\r\n", "it has heard nothing since");
    assert_eq!(bench.client.deadline(), bench.now + PATIENCE);
    bench.wait(9);
    assert_eq!(bench.client.check(bench.now), Ok(()));
    bench.wait(1);
    let error = bench
        .client
        .check(bench.now)
        .expect_err("it has been silent")
        .to_string();
    assert!(error.contains("has not answered for 10s"), "{error}");

    let mut bench = Bench::taken(&[]);
    bench.set("Q1", "24");
    bench.client.turn(bench.now);
    bench.wait(10);
    let error = bench
        .client
        .check(bench.now)
        .expect_err("it does not read")
        .to_string();
    assert!(error.contains("has not read for 10s"), "{error}");
}

#[test]
fn a_dispatcher_that_does_not_answer_is_given_up_although_there_are_values_to_say() {
    let mut bench = Bench::taken(&[]);
    bench.now = KEEP_ALIVE;
    assert_eq!(bench.says(), "PING\r\n");
    let end = KEEP_ALIVE + PATIENCE;
    while bench.now < end {
        assert_eq!(bench.client.check(bench.now), Ok(()));
        assert_eq!(bench.client.deadline(), end);
        bench.wait(1);
        let value = bench.now.0.to_string();
        bench.set("Q1", &value);
        assert_eq!(bench.says(), format!("P Q1={value}\r\n"));
    }
    let error = bench
        .client
        .check(bench.now)
        .expect_err("it has been silent");
    assert!(
        error.to_string().contains("has not answered for 10s"),
        "{error}"
    );
}

#[test]
fn the_list_is_asked_for_between_other_requests() {
    let mut bench = Bench::taken(&["I1:LOGO:Q1"]);
    bench.client.ask_list();
    assert_eq!(bench.says(), "CONNECT I1:LOGO:Q1\r\n");
    bench.hears("OK CONNECT\r\n").expect("right");
    assert_eq!(bench.says(), "LIST\r\n");
    let answer = "OK LIST\r\nVR:LOGO:Q01:I01:AQ00:AI00:192.168.0.20:3330\r\nEND 1\r\n";
    assert_eq!(bench.hears(answer).expect("right"), ["LOGO is here", "end"]);
    bench.settles();
}

#[test]
fn a_profile_that_no_dispatcher_takes_is_a_mistake() {
    let profile = |name: &str, counts, cables: &[&str]| Profile {
        role: Role::Process,
        name: name.to_owned(),
        counts,
        cables: cables
            .iter()
            .map(|text| Cable::parse(text).expect(text))
            .collect(),
        alive: None,
        key: None,
    };
    let some = Counts::new(1, 0, 0, 0);
    for (profile, part) in [
        (
            profile("a b", some, &[]),
            "\"a b\" cannot be the name of a client; take 1 to 63 letters",
        ),
        (
            profile("A", Counts::new(257, 0, 0, 0), &[]),
            "there are 257 channels Q; a client has up to 256",
        ),
        (
            profile("A", some, &["Q2:B:I1"]),
            "no Q2, which it connects by Q2:B:I1; it has Q1 to Q1",
        ),
    ] {
        let mistake = Client::new(profile, KEEP_ALIVE)
            .expect_err(part)
            .to_string();
        assert!(mistake.contains(part), "{mistake}");
    }
}

proptest::proptest! {
    #[test]
    fn any_bytes_mean_the_same_in_any_pieces(
        lines in proptest::collection::vec("(P|OK|ERR|END|VP|)[ -~]{0,20}\r?\n|(P I1=[0-9]{1,3}( AI1=-?[0-9.]{1,4})?|ERR 4[0-9]{2} no)\r\n|[\\x00-\\xff]{0,9}", 0..8),
        cuts in proptest::collection::vec(1..40_usize, 1..20),
    ) {
        let bytes = lines.concat().into_bytes();
        let run = |pieces: &mut dyn Iterator<Item = usize>| {
            let mut bench = Bench::taken(&["I1:LOGO:Q1"]);
            bench.says();
            let mut events = Vec::new();
            let mut rest = &bytes[..];
            while !rest.is_empty() {
                let count = pieces.next().unwrap_or(usize::MAX).min(rest.len());
                let take = &mut |event: Event<'_>| events.push(shown(&event));
                if let Err(error) = bench.client.hear(bench.now, &rest[..count], take) {
                    events.push(error.to_string());
                    break;
                }
                rest = &rest[count..];
            }
            events
        };
        let whole = run(&mut std::iter::empty());
        proptest::prop_assert_eq!(run(&mut cuts.into_iter()), whole);
    }
}

#[test]
fn until_the_key_is_answered_nothing_that_came_is_repeated() {
    const KEY: &str = "0123456789abcdef";

    let bench = || {
        let mut bench = Bench::new(&[]);
        let mut profile = bench.client.profile.clone();
        profile.key = Some(Key::parse(KEY).expect("a key"));
        bench.client = Client::new(profile, KEEP_ALIVE).expect("a right profile");
        bench.client.connected(Nanos::ZERO);
        assert_eq!(bench.says(), format!("KEY {KEY}\r\n"));
        bench
    };
    let mut right = bench();
    assert!(right.hears("\r\nOK KEY\r\n").expect("right").is_empty());
    assert!(right.says().starts_with("VP PUMP"));
    // An echo, Redis, a web server, and a line without an end.
    for (line, expected) in [
        (format!("KEY {KEY}\r\n"), "check the address"),
        (
            format!("-ERR unknown command `KEY`, with args beginning with: `{KEY}`\r\n"),
            "check the address",
        ),
        (format!("OK KEY {KEY}\r\n"), "check the address"),
        (format!("P Q1={KEY}\r\n"), "check the address"),
        (KEY.repeat(300), "check the address"),
        (format!("ERR 403 {KEY}\r\n"), "the key is wrong"),
        (format!("ERR 429 {KEY}\r\n"), "or the dispatcher is full"),
        (format!("ERR 400 {KEY}\r\n"), "ERR 400"),
        (format!("ERR 012{KEY}\r\n"), "ERR 12"),
    ] {
        let told = bench().hears(&line).expect_err("no key is accepted");
        assert!(told.contains(expected), "{line}: {told}");
        assert!(!told.contains("456789ab"), "{told}");
    }
}

#[test]
fn labels_are_announced_once_it_is_settled_and_an_older_dispatcher_does_without() {
    for answer in ["OK NAME\r\n", "ERR 400 \"NAME\" is no keyword\r\n"] {
        let mut bench = Bench::taken(&["I1:LOGO:Q1"]);
        let channel = |text: &str| Channel::parse(text.as_bytes()).expect(text);
        let names = [("Q1", "Pump\nruns"), ("Q2", " "), ("AQ1", "Level")];
        let names = names.map(|(text, name)| (channel(text), name));
        let other = Bench::new(&[]).client;
        let client = std::mem::replace(&mut bench.client, other);
        bench.client = client.with_labels(names.into_iter());
        assert_eq!(bench.says(), "CONNECT I1:LOGO:Q1\r\n");
        bench.hears("OK CONNECT\r\n").expect("right");
        bench.settles();
        assert_eq!(bench.says(), "NAME Q1 Pump runs\r\n");
        assert!(bench.hears(answer).expect("right").is_empty());
        bench.set("Q1", "24");
        let then = if answer.starts_with("OK") {
            "NAME AQ1 Level\r\nP Q1=24\r\n"
        } else {
            "P Q1=24\r\n"
        };
        assert_eq!(bench.says(), then);
        // A new connection announces them again.
        bench.client.connected(bench.now);
        assert!(bench.says().starts_with("VP PUMP"));
    }
}
