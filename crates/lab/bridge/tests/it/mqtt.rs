//! Topics as channels, with the real dispatcher at the other end: no broker, no sockets.

use std::net::SocketAddr;

use tickbus_base::time::Nanos;
use tickbus_bridge::Speaker as _;
use tickbus_bridge::mqtt::{Map, Mapping};
use tickbus_dispatcher::{Dispatcher, Patch, Pin, Settings};

const MAP: &str = "\
[mqtt]
broker = \"127.0.0.1:1883\"
status = \"hall/bridge\"
[dispatcher]
name = \"HALL\"
role = \"VR\"
[[channel]]
channel = \"AI1\"
topic = \"hall/level\"
retain = true
[[channel]]
channel = \"AI2\"
topic = \"hall/level/percent\"
factor = 10
offset = -20
[[channel]]
channel = \"I1\"
topic = \"hall/pump\"
on = \"ON\"
off = \"OFF\"
[[channel]]
channel = \"AQ1\"
topic = \"hall/setpoint\"
[[channel]]
channel = \"AQ2\"
topic = \"hall/setpoint/percent\"
factor = 0.1
[[channel]]
channel = \"Q3\"
topic = \"hall/switch\"
on = \"ON\"
off = \"OFF\"
";

struct Lab {
    now: Nanos,
    dispatcher: Dispatcher,
    mapping: Mapping,
    seat: usize,
    /// A directly connected tank.
    tank: usize,
}

impl Lab {
    /// The hall reads the tank's AQ1, AQ2 and Q1, and sets its AI1, AI2 and I1.
    fn new() -> Self {
        let mut patch = Patch::new();
        for (sink, source) in [
            ("HALL:AI1", "TANK:AQ1"),
            ("HALL:AI2", "TANK:AQ2"),
            ("HALL:I1", "TANK:Q1"),
            ("TANK:AI1", "HALL:AQ1"),
            ("TANK:AI2", "HALL:AQ2"),
            ("TANK:I1", "HALL:Q3"),
        ] {
            let pin = |text| Pin::parse(text).expect(text);
            patch.connect(pin(sink), pin(source));
        }
        let mut dispatcher = Dispatcher::new(Settings::default(), patch);
        let map = Map::parse("map.toml", MAP).expect("a right map");
        let mapping = Mapping::new(map).expect("a right client");
        let peer = SocketAddr::from(([127, 0, 0, 1], 3333));
        let mut connect = || dispatcher.connected(Nanos::ZERO, peer).expect("room");
        let (tank, seat) = (connect(), connect());
        let mut lab = Self {
            now: Nanos::ZERO,
            dispatcher,
            mapping,
            seat,
            tank,
        };
        lab.say("VP TANK Q1 I1 AQ2 AI2");
        lab.mapping.connected(lab.now);
        lab.settle();
        assert!(lab.mapping.is_here());
        lab.hear();
        let nothing = [
            "hall/level  (retained)",
            "hall/level/percent ",
            "hall/pump ",
        ];
        assert_eq!(lab.published(""), nothing, "no source has said anything");
        lab
    }

    fn settle(&mut self) {
        loop {
            self.mapping
                .tick(self.now)
                .expect("the dispatcher is there");
            let said = self.mapping.to_write().to_vec();
            self.mapping.wrote(self.now, said.len());
            self.dispatcher.arrived(self.now, self.seat, &said);
            let heard = self.dispatcher.to_write(self.seat).to_vec();
            self.dispatcher.wrote(self.seat, heard.len());
            let taken = self.mapping.hear(self.now, &heard);
            taken.expect("the dispatcher speaks as it should");
            if said.is_empty() && heard.is_empty() {
                return;
            }
        }
    }

    /// The tank sends this.
    fn say(&mut self, line: &str) {
        let line = format!("{line}\n");
        self.dispatcher
            .arrived(self.now, self.tank, line.as_bytes());
    }

    /// The lines for the tank.
    fn hear(&mut self) -> String {
        let bytes = self.dispatcher.to_write(self.tank).to_vec();
        self.dispatcher.wrote(self.tank, bytes.len());
        String::from_utf8(bytes).expect("text").replace("\r\n", ";")
    }

    /// The messages published for this line of the tank.
    fn published(&mut self, line: &str) -> Vec<String> {
        self.say(line);
        self.settle();
        let mut all = Vec::new();
        self.mapping.publish(&mut |entry, payload| {
            let retained = if entry.retain { " (retained)" } else { "" };
            all.push(format!("{} {payload}{retained}", entry.topic));
            true
        });
        all
    }

    /// The lines for the tank after this message.
    fn message(&mut self, topic: &str, payload: &str) -> String {
        self.mapping.message(topic, payload.as_bytes());
        self.settle();
        self.hear()
    }
}

#[test]
fn inputs_are_published_in_their_formats() {
    let mut lab = Lab::new();
    for (said, expected) in [
        ("P AQ1=1.50", &["hall/level 1.5 (retained)"][..]),
        ("P AQ2=4.05", &["hall/level/percent 20.5"]),
        ("P AQ2=0.1", &["hall/level/percent -19"]),
        ("P Q1=24", &["hall/pump ON"]),
        ("P Q1=6", &[]),
        ("P Q1=3", &["hall/pump OFF"]),
        ("P Q1=24\nP Q1=0", &["hall/pump ON", "hall/pump OFF"]),
        (
            "P AQ1=12345678901234567890123",
            &["hall/level 12345678901234567890123 (retained)"],
        ),
        // The source is lost: there is no value, and the broker keeps none.
        (
            "BYE",
            &[
                "hall/pump ",
                "hall/level  (retained)",
                "hall/level/percent ",
            ],
        ),
    ] {
        let mut published = lab.published(said);
        if said == "BYE" {
            lab.dispatcher.gone(lab.tank);
            published = lab.published("");
        }
        assert_eq!(published, expected, "{said}");
    }
}

#[test]
fn messages_become_outputs_and_what_is_none_is_named_and_counted() {
    let mut lab = Lab::new();
    for (topic, payload, expected) in [
        ("hall/setpoint", "21.50", "P AI1=21.5;"),
        ("hall/setpoint", " -3 \n", "P AI1=-3;"),
        ("hall/setpoint", "1.5e-7", "P AI1=0.00000015;"),
        ("hall/setpoint", "+7", "P AI1=7;"),
        ("hall/setpoint/percent", "3", "P AI2=0.3;"),
        ("hall/switch", "ON", "P I1=24;"),
        ("hall/switch", "OFF", "P I1=0;"),
        // No value, as published by the bridge itself.
        ("hall/switch", "ON", "P I1=24;"),
        ("hall/switch", "", "P I1=0;"),
        ("hall/setpoint", "", "P AI1=0;"),
        ("hall/setpoint/percent", "", "P AI2=0;"),
        // The bridge's own topics, and unknown ones.
        ("hall/level", "1", ""),
        ("hall/other", "1", ""),
    ] {
        assert_eq!(lab.message(topic, payload), expected, "{topic} {payload}");
    }
    assert_eq!(lab.mapping.news(), [""; 0]);
    let long = "9".repeat(400);
    let wrong = [
        " ",
        "abc",
        "nan",
        "inf",
        "-infinity",
        "0x10",
        "1,5",
        "1 2",
        "1e24",
        "{\"value\": 1}",
        &long,
    ];
    for payload in wrong {
        assert_eq!(lab.message("hall/setpoint", payload), "", "{payload}");
    }
    assert_eq!(lab.message("hall/switch", "24"), "");
    lab.mapping.message("hall/setpoint", &[0xFF, 0x00]);
    let news = lab.mapping.news();
    // The 1st, 2nd, 4th and 8th message of one topic, and the first of the other.
    assert_eq!(news.len(), 5, "{news:?}");
    assert_eq!(
        news[1],
        "\"abc\" from the topic \"hall/setpoint\" is no value of AQ1, and was left out (2 so far); send a number such as \
         21.5 as plain text"
    );
    assert!(news[4].ends_with("is no value of Q3, and was left out (1 so far); send ON or OFF"));
    let traffic = lab.mapping.traffic();
    assert_eq!((traffic.received, traffic.refused), (11, 13));
}

#[test]
fn a_broker_that_takes_nothing_gets_the_newest_value_of_each_topic_later() {
    let mut lab = Lab::new();
    for value in 0..1000 {
        lab.say(&format!("P AQ1={value} AQ2={value}"));
        lab.settle();
        lab.mapping.publish(&mut |_, _| false);
    }
    let published = lab.published("");
    assert_eq!(published.len(), 256);
    assert_eq!(published[0], "hall/level 0 (retained)");
    assert_eq!(
        published[254..],
        ["hall/level 999 (retained)", "hall/level/percent 9970"]
    );
    assert_eq!(lab.mapping.traffic().overtaken, 2000 - 256);
}

#[test]
fn after_the_broker_was_lost_no_old_value_is_said() {
    let mut lab = Lab::new();
    assert_eq!(lab.message("hall/setpoint", "5"), "P AI1=5;");
    lab.say("P AQ1=1");
    lab.settle();
    assert!(!lab.mapping.disconnected(), "another one after a pause");
    assert!(!lab.mapping.is_here());
    lab.mapping.broker_lost();
    lab.dispatcher.gone(lab.seat);
    assert_eq!(lab.hear(), "P AI1=0;");
    let peer = SocketAddr::from(([127, 0, 0, 1], 3334));
    lab.seat = lab.dispatcher.connected(lab.now, peer).expect("room");
    lab.mapping.connected(lab.now);
    lab.settle();
    assert_eq!(lab.hear(), "");
    assert_eq!(
        lab.published(""),
        [
            "hall/level 1 (retained)",
            "hall/level/percent ",
            "hall/pump "
        ]
    );
}

#[test]
fn the_value_of_a_source_that_left_unseen_is_taken_away() {
    let mut lab = Lab::new();
    assert_eq!(lab.published("P AQ1=21.5"), ["hall/level 21.5 (retained)"]);
    lab.mapping.disconnected();
    lab.dispatcher.gone(lab.seat);
    lab.dispatcher.gone(lab.tank);
    let peer = SocketAddr::from(([127, 0, 0, 1], 3334));
    lab.seat = lab.dispatcher.connected(lab.now, peer).expect("room");
    lab.mapping.connected(lab.now);
    lab.settle();
    assert_eq!(
        lab.published(""),
        [
            "hall/level  (retained)",
            "hall/level/percent ",
            "hall/pump "
        ]
    );
}

#[test]
fn a_value_that_is_too_large_for_its_message_is_named_and_none_is_left() {
    let mut lab = Lab::new();
    let large = "9".repeat(23);
    assert_eq!(
        lab.published(&format!("P AQ2={large}")),
        ["hall/level/percent "]
    );
    let news = lab.mapping.news();
    assert_eq!(news.len(), 1, "{news:?}");
    assert!(
        news[0].starts_with(&format!(
            "{large} of AI2 is too large for the topic \"hall/level/percent\""
        )),
        "{news:?}"
    );
    assert_eq!(lab.mapping.traffic().refused, 1);
}

#[test]
fn the_example_in_the_document_is_right() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/dispatcher.md");
    let document = std::fs::read_to_string(path).expect("the document");
    let (_, rest) = document.split_once("```toml\n[mqtt]").expect("an example");
    let (example, _) = rest.split_once("```").expect("an end");
    let map = Map::parse("map.toml", &format!("[mqtt]{example}")).expect("a right map");
    let topics = map.channels.iter().map(|entry| entry.topic.clone());
    let expected = ["hall/tank/level", "hall/tank/setpoint", "hall/tank/valve"];
    assert_eq!(topics.collect::<Vec<_>>(), expected);
}

#[test]
fn a_wrong_map_is_answered_with_every_mistake_at_its_place() {
    let text = "\
[mqtt]
brokr = \"127.0.0.1:1883\"
status = \"hall/#\"
[dispatcher]
name = \"THE HALL\"
role = \"VQ\"
address = \"127.0.0.1:0\"
[[channel]]
chanel = \"I1\"
topic = \"a\"
[[channel]]
channel = \"X1\"
topic = \"b\"
[[channel]]
channel = \"Q0\"
topic = \"c\"
[[channel]]
channel = \"Q1\"
topic = \"d\"
retain = true
on = \"1\"
[[channel]]
channel = \"AI1\"
topic = \"e\"
factor = 0
[[channel]]
channel = \"I1\"
topic = \"f\"
[[channel]]
channel = \"I1\"
topic = \"g\"
[[channel]]
channel = \"Q1\"
topic = \"f\"
[[channel]]
channel = \"AQ1\"
topic = \"h\"
on = \"x\"
off = \"x\"
[[channel]]
channel = \"I2\"
topic = \"f\"
";
    let told = Map::parse("map.toml", text)
        .expect_err("it is wrong")
        .to_string();
    for part in [
        "map.toml:2:1: unknown key \"brokr\" in [mqtt]; did you mean \"broker\"?",
        "map.toml:3:10: \"hall/#\" is no single topic of yours",
        "map.toml:5:8: \"THE HALL\" cannot be the name of a client",
        "map.toml:6:8: \"VQ\" is not one of the roles",
        "map.toml:7:11: port 0 cannot be connected to",
        "map.toml:9:1: unknown key \"chanel\" in [[channel]]; did you mean \"channel\"?",
        "map.toml:12:11: \"X1\" is no channel",
        "map.toml:15:11: there is no channel Q0",
        "map.toml:21:6: the other word is missing",
        "map.toml:25:10: \"factor\" is 0",
        "map.toml:29:1: I1 stands in line 26 already",
        "map.toml:32:1: the topic of Q1 is that of I1 as well",
        "map.toml:38:6: AQ1 is analog",
        "map.toml:39:7: on and off are the same word",
        "map.toml:40:1: the topic of I2 is that of I1 as well",
    ] {
        assert!(told.contains(part), "{part} in\n{told}");
    }
    let text = MAP.replace("hall/bridge", "hall/setpoint");
    let told = Map::parse("map.toml", &text).expect_err("the status is a setpoint");
    let part = "map.toml:3:10: \"hall/setpoint\" is the topic of AQ1 as well";
    assert!(told.to_string().contains(part), "{told}");
    let told = Map::parse("map.toml", "")
        .expect_err("it is empty")
        .to_string();
    for part in ["has no [mqtt]", "has no [dispatcher]", "has no [channel]"] {
        assert!(told.contains(part), "{part} in\n{told}");
    }
}

/// A map with these lines in its tables, in a folder with these files.
fn map_with(mqtt: &str, dispatcher: &str) -> Result<Map, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("a file");
    };
    // Some editors begin a file with a byte-order mark.
    write("password", "\u{feff}geheim\r\nnotes\n");
    write("ca.pem", "-----BEGIN CERTIFICATE-----\n");
    write("lab.key", "0123456789abcdef\n");
    write("short.key", "short\n");
    let text = MAP.replace(
        "[dispatcher]\n",
        &format!("{mqtt}[dispatcher]\n{dispatcher}"),
    );
    let file = folder.path().join("map.toml");
    std::fs::write(&file, text).expect("a file");
    Map::load(&file).map_err(|mistakes| {
        let folder = format!("{}{}", folder.path().display(), std::path::MAIN_SEPARATOR);
        mistakes.to_string().replace(&folder, "")
    })
}

#[test]
fn user_certificates_and_key_are_read_from_files_beside_the_map() {
    let map = map_with(
        "user = \"hall\"\npassword_file = \"password\"\nca_file = \"ca.pem\"\ncertificate_file = \"ca.pem\"\n\
         private_key_file = \"ca.pem\"\n",
        "key_file = \"lab.key\"\n",
    )
    .expect("a right map");
    let login = map.access.login.as_ref().expect("a user");
    assert_eq!((&*login.user, &*login.password), ("hall", "geheim"));
    assert!(map.access.tls.as_ref().is_some_and(|tls| tls.own.is_some()));
    assert!(map.key.is_some());
    let shown = format!("{map:?}");
    assert!(
        !shown.contains("geheim") && !shown.contains("0123"),
        "{shown}"
    );
    for (mqtt, dispatcher, part) in [
        (
            "user = \"hall\"\n",
            "",
            "map.toml:4:8: \"user\" stands without a password",
        ),
        (
            "password_file = \"password\"\n",
            "",
            "map.toml:4:17: there is a password and no user",
        ),
        (
            "user = \"hall\"\npassword_file = \"no\"\n",
            "",
            "map.toml:5:17: no: there is no such file",
        ),
        (
            "certificate_file = \"ca.pem\"\n",
            "",
            "map.toml:4:20: a certificate stands without \"ca_file\"",
        ),
        (
            "ca_file = \"ca.pem\"\ncertificate_file = \"ca.pem\"\n",
            "",
            "map.toml:5:20: the other file is missing",
        ),
        (
            "",
            "key_file = \"short.key\"\n",
            "map.toml:5:12: the key in short.key: the key has 5 characters",
        ),
    ] {
        let told = map_with(mqtt, dispatcher).expect_err(part);
        assert!(told.contains(part), "{part} in\n{told}");
    }
}
