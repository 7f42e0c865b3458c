//! The bridge for ASCII clients, with the real dispatcher at its other end: both without I/O, in the same time.

use std::net::SocketAddr;

use tickbus_base::time::Nanos;
use tickbus_bridge::{AsciiBridge, LineEnd, Speaker as _};
use tickbus_dispatcher::{Dispatcher, Key, Patch, Settings};

/// A bridge, a dispatcher, and clients that are connected with it directly.
struct Lab {
    now: Nanos,
    dispatcher: Dispatcher,
    bridge: AsciiBridge,
    seat: Option<usize>,
}

impl Lab {
    /// A laboratory in which the bridge is connected.
    fn new() -> Self {
        let mut lab = Self {
            now: Nanos::ZERO,
            dispatcher: Dispatcher::new(Settings::default(), Patch::new()),
            bridge: AsciiBridge::new(LineEnd::Cr),
            seat: None,
        };
        lab.connect();
        lab
    }

    fn client(&mut self) -> usize {
        let peer = SocketAddr::from(([127, 0, 0, 1], 3333));
        self.dispatcher.connected(self.now, peer).expect("room")
    }

    fn connect(&mut self) {
        self.seat = Some(self.client());
        self.bridge.connected(self.now);
    }

    /// The connection of the bridge breaks.
    fn cut(&mut self) -> bool {
        if let Some(seat) = self.seat.take() {
            self.dispatcher.gone(seat);
        }
        self.bridge.disconnected()
    }

    /// The dispatcher ends, and another one starts with its patch.
    fn restart(&mut self) {
        self.cut();
        let patch = self.dispatcher.patch().clone();
        self.dispatcher = Dispatcher::new(Settings::default(), patch);
    }

    /// A directly connected client sends a line.
    fn say(&mut self, seat: usize, line: &str) {
        let line = format!("{line}\n");
        self.dispatcher.arrived(self.now, seat, line.as_bytes());
        self.settle();
    }

    /// The lines for a client.
    fn hear(&mut self, seat: usize) -> Vec<String> {
        let bytes = self.dispatcher.to_write(seat).to_vec();
        self.dispatcher.wrote(seat, bytes.len());
        lines(&bytes, "\r\n")
    }

    /// Carries bytes between bridge and dispatcher until nothing moves. Returns why the bridge ends the connection, if
    /// it does.
    fn settle(&mut self) -> Option<String> {
        loop {
            if self.dispatcher.unsaved().is_some() {
                self.dispatcher.saved(&Ok(()));
                self.dispatcher.tick(self.now);
                continue;
            }
            let seat = self.seat?;
            let said = self.bridge.to_write().to_vec();
            if !said.is_empty() {
                self.bridge.wrote(self.now, said.len());
                self.dispatcher.arrived(self.now, seat, &said);
                continue;
            }
            let heard = self.dispatcher.to_write(seat).to_vec();
            if !heard.is_empty() && self.bridge.wants_to_hear() {
                self.dispatcher.wrote(seat, heard.len());
                self.dispatcher.tick(self.now);
                if let Err(why) = self.bridge.hear(self.now, &heard) {
                    self.cut();
                    return Some(why);
                }
                continue;
            }
            if self.dispatcher.is_closing(seat) {
                // The bridge may want a new connection at once.
                if self.cut() {
                    self.connect();
                    continue;
                }
            }
            return None;
        }
    }

    /// The client on the serial line sends this; returns the lines for it.
    fn serial(&mut self, text: &str) -> Vec<String> {
        self.bridge.from_serial(self.now, text.as_bytes());
        self.settle();
        self.told()
    }

    /// The current lines for the client on the serial line.
    fn told(&mut self) -> Vec<String> {
        let mut all = Vec::new();
        loop {
            let bytes = self.bridge.to_serial().to_vec();
            if bytes.is_empty() {
                return lines(&all, "\r");
            }
            self.bridge.wrote_to_serial(bytes.len());
            all.extend(bytes);
            self.settle();
        }
    }

    /// Lets time pass for everyone.
    fn pass(&mut self, seconds: i64) -> Result<(), String> {
        for _ in 0..seconds {
            self.now += Nanos::from_secs(1);
            self.dispatcher.tick(self.now);
            self.settle();
            self.bridge.tick(self.now)?;
            self.settle();
        }
        Ok(())
    }
}

fn lines(bytes: &[u8], end: &str) -> Vec<String> {
    let text = std::str::from_utf8(bytes).expect("text");
    assert!(text.is_empty() || text.ends_with(end), "{text:?}");
    text.split_terminator(end).map(str::to_owned).collect()
}

const PUMP: &str = "VP:PUMP:Q02:I02:AQ00:AI00:127.0.0.1:3333";
const SCADA: &str = "VR:SCADA:Q02:I02:AQ00:AI00:127.0.0.1:3333";
const AWAY: &str = "ERR 503 the dispatcher does not answer; the bridge goes on calling it, and sends your values and \
                    connections then";

/// A laboratory with a directly connected pump, and a client on the serial line whose I1 is the pump's Q1, and whose Q1
/// is the pump's I1.
fn patched() -> (Lab, usize) {
    let mut lab = Lab::new();
    let pump = lab.client();
    lab.say(pump, "VP PUMP Q2 I2");
    lab.hear(pump);
    assert_eq!(lab.serial("VR SCADA Q2 I2\r"), [PUMP, SCADA]);
    let none: [&str; 0] = [];
    assert_eq!(lab.serial("CONNECT I1:PUMP:Q1 Q1:PUMP:I1\r"), none);
    (lab, pump)
}

/// The pump comes back to a dispatcher that was restarted.
fn pump_again(lab: &mut Lab) -> usize {
    let pump = lab.client();
    lab.say(pump, "VP PUMP Q2 I2");
    lab.hear(pump);
    pump
}

#[test]
fn lines_go_both_ways_whatever_their_ends_and_mistakes_are_answered() {
    let (mut lab, pump) = patched();
    lab.say(pump, "P Q1=24");
    assert_eq!(lab.told(), ["P I1=24"]);
    for end in ["\r", "\n", "\r\n"] {
        assert!(lab.serial(&format!("P Q1=24{end}P Q1=0{end}")).is_empty());
        assert_eq!(lab.hear(pump), ["P I1=24", "P I1=0"]);
    }
    assert_eq!(lab.serial("PING\r"), ["OK PING"]);
    assert_eq!(lab.serial("LIST\r"), [PUMP, SCADA]);
    for (said, code) in [
        ("\u{0}\u{1}~~\r", "ERR 400 "),
        ("P Q1=x\r", "ERR 400 "),
        ("P Q9=1\r", "ERR 404 "),
        ("P I1=1\r", "ERR 422 "),
        ("CONNECT I1:PUMP:Q2\r", "ERR 409 "),
        ("DISCONNECT I2\r", "ERR 404 "),
    ] {
        let heard = lab.serial(said);
        assert_eq!(heard.len(), 1, "{said}: {heard:?}");
        assert!(heard[0].starts_with(code), "{said}: {heard:?}");
    }
    let long = "x".repeat(10_000);
    let heard = lab.serial(&format!("{long}\rPING\r"));
    assert!(heard[0].starts_with("ERR 413 "), "{heard:?}");
    assert_eq!(heard[1..], ["OK PING"]);
}

#[test]
fn a_silent_client_is_kept_alive_and_hears_no_answers_to_what_it_did_not_ask() {
    let (mut lab, pump) = patched();
    for _ in 0..10 {
        lab.pass(59).expect("the dispatcher answers");
        // No bridge keeps the pump alive.
        lab.say(pump, "");
    }
    assert!(lab.told().is_empty());
    assert_eq!(lab.serial("PING\r"), ["OK PING"]);
}

#[test]
fn a_dispatcher_that_does_not_answer_is_given_up() {
    let (mut lab, _) = patched();
    lab.seat = None;
    let why = lab.pass(60).expect_err("it does not answer");
    assert!(why.contains("20s"), "{why}");
    // The same if it is only sent values.
    let (mut lab, _) = patched();
    lab.seat = None;
    let given_up = (0..60).any(|value| {
        lab.serial(&format!("P Q1={value}\r"));
        let count = lab.bridge.to_write().len();
        lab.bridge.wrote(lab.now, count);
        lab.pass(1).is_err()
    });
    assert!(given_up);
    // A dispatcher that need not answer, since the serial line is slow, is not given up.
    let (mut lab, _) = patched();
    while lab.bridge.wants_to_hear() {
        lab.bridge.from_serial(lab.now, b"LIST\r");
        lab.settle();
    }
    lab.seat = None;
    lab.pass(100).expect("it is not its fault");
}

#[test]
fn after_a_restart_the_client_is_introduced_again_with_its_newest_values() {
    let (mut lab, _) = patched();
    lab.serial("P Q1=24 Q2=3\rP Q1=20\r");
    lab.restart();
    assert_eq!(lab.told(), [AWAY]);
    // The client sends values only on change: it does not send this again.
    assert!(lab.serial("P Q2=7\r").is_empty());
    assert_eq!(lab.serial("PING\r"), [AWAY]);
    let pump = pump_again(&mut lab);
    lab.connect();
    lab.settle();
    assert_eq!(lab.hear(pump), ["P I1=20"]);
    assert_eq!(lab.told(), [PUMP, SCADA]);
    lab.say(pump, "P Q1=5");
    assert_eq!(lab.told(), ["P I1=5"]);
}

#[test]
fn what_somebody_has_cut_or_moved_stays_so_after_a_restart() {
    let (mut lab, pump) = patched();
    lab.say(pump, "DISCONNECT Q1");
    lab.say(pump, "CONNECT Q2:SCADA:I1");
    lab.told();
    lab.restart();
    let pump = pump_again(&mut lab);
    lab.connect();
    lab.settle();
    lab.told();
    lab.say(pump, "P Q1=1 Q2=2");
    assert_eq!(lab.told(), ["P I1=2"]);
}

#[test]
fn requests_that_may_not_have_arrived_are_sent_again() {
    let (mut lab, _) = patched();
    // The request was written, but the connection broke before it arrived; a second one waits until there is a
    // dispatcher.
    lab.bridge.from_serial(lab.now, b"CONNECT I2:PUMP:Q2\r");
    let count = lab.bridge.to_write().len();
    lab.bridge.wrote(lab.now, count);
    lab.restart();
    assert_eq!(lab.serial("CONNECT Q2:PUMP:I2\r"), [AWAY]);
    let pump = pump_again(&mut lab);
    lab.connect();
    lab.settle();
    assert_eq!(lab.told(), [PUMP, SCADA]);
    assert_eq!(lab.dispatcher.patch().len(), 4);
    lab.say(pump, "P Q2=2");
    assert_eq!(lab.told(), ["P I2=2"]);
    // A request that was carried out is not repeated.
    lab.say(pump, "DISCONNECT I2");
    lab.restart();
    pump_again(&mut lab);
    lab.connect();
    lab.settle();
    assert_eq!(lab.dispatcher.patch().len(), 3);
}

#[test]
fn a_name_that_is_still_taken_is_asked_for_again() {
    let (mut lab, _) = patched();
    // The cable was pulled: the dispatcher does not know yet.
    lab.seat = None;
    lab.bridge.disconnected();
    assert_eq!(lab.told(), [AWAY]);
    lab.connect();
    let why = lab.settle().expect("it is taken");
    assert!(why.contains("ERR 409"), "{why}");
    assert!(lab.told().is_empty(), "it did not ask");
    lab.now += Nanos::from_secs(60);
    lab.dispatcher.tick(lab.now);
    for seat in 0..8 {
        if lab.dispatcher.is_closing(seat) {
            lab.dispatcher.gone(seat);
        }
    }
    lab.connect();
    assert_eq!(lab.settle(), None);
    assert_eq!(lab.told(), [SCADA]);
}

#[test]
fn a_client_that_begins_anew_gets_a_new_connection() {
    let (mut lab, pump) = patched();
    lab.serial("P Q1=24\r");
    lab.hear(pump);
    let heard = lab.serial("VR SCADA Q2 I2 V=2\r");
    assert_eq!(heard, ["OK VR", PUMP, SCADA, "END 2"]);
    assert_eq!(lab.hear(pump), ["P I1=0"], "its values went with it");
    // With a name that another client has.
    let heard = lab.serial("VR PUMP Q2 I2 V=2\r");
    assert_eq!(heard.len(), 1, "{heard:?}");
    assert!(heard[0].starts_with("ERR 409 "), "{heard:?}");
}

#[test]
fn a_client_may_leave_and_come_back() {
    let (mut lab, pump) = patched();
    assert!(lab.serial("BYE\r").is_empty());
    assert_eq!(lab.serial("P Q1=1\r").len(), 1, "nobody is here");
    lab.hear(pump);
    assert_eq!(lab.serial("VR SCADA Q2 I2 V=2\r").len(), 4);
    assert_eq!(lab.serial("BYE\r"), ["OK BYE"]);
}

#[test]
fn before_it_says_who_it_is_it_is_asked_for_that() {
    let mut lab = Lab::new();
    for (said, code) in [
        ("P Q1=1\r", "ERR 401 "),
        ("CONNECT I1:PUMP:Q1\r", "ERR 401 "),
        ("hello\r", "ERR 400 "),
        ("VR SCADA\r", "ERR 400 "),
    ] {
        let heard = lab.serial(said);
        assert_eq!(heard.len(), 1, "{said}: {heard:?}");
        assert!(heard[0].starts_with(code), "{said}: {heard:?}");
    }
    assert_eq!(lab.serial("VR SCADA Q2 I2\r"), [SCADA]);
}

#[test]
fn whoever_speaks_before_there_is_a_dispatcher_is_heard_when_there_is_one() {
    let mut lab = Lab::new();
    lab.cut();
    assert_eq!(lab.serial("VR SCADA Q2 I2\r"), [AWAY]);
    lab.serial("CONNECT I1:PUMP:Q1 Q1:PUMP:I1\rP Q1=24\r");
    let pump = pump_again(&mut lab);
    lab.connect();
    lab.settle();
    assert_eq!(lab.told(), [PUMP, SCADA]);
    assert_eq!(lab.hear(pump), ["P I1=24"]);
    // Not endlessly.
    lab.cut();
    lab.told();
    let heard = lab.serial(&"LIST\r".repeat(70));
    assert_eq!(heard.len(), 6, "{heard:?}");
    assert!(heard[0].contains("64 lines wait"), "{heard:?}");
}

#[test]
fn with_the_port_its_client_has_left_and_comes_back_without_old_values() {
    let (mut lab, pump) = patched();
    lab.serial("P Q1=24\r");
    lab.hear(pump);
    lab.bridge.from_serial(lab.now, b"P Q1=");
    lab.bridge.unplugged();
    let seat = lab.seat.take().expect("it was connected");
    lab.dispatcher.gone(seat);
    assert_eq!(lab.hear(pump), ["P I1=0"]);
    lab.connect();
    lab.settle();
    assert_eq!(lab.told(), [PUMP, SCADA]);
    assert!(lab.hear(pump).is_empty());
    assert_eq!(
        lab.serial("7\r")[0][..8],
        *"ERR 400 ",
        "the line that was cut is gone"
    );
}

#[test]
fn a_slow_line_gets_the_newest_values_and_nobody_waits() {
    let (mut lab, pump) = patched();
    for value in 0..5000 {
        lab.say(pump, &format!("P Q1={value}"));
    }
    let heard = lab.told();
    assert!(heard.len() < 300, "{}", heard.len());
    assert_eq!(heard.last().map(String::as_str), Some("P I1=4999"));
    let overtaken = lab.bridge.traffic().overtaken;
    assert_eq!(overtaken + heard.len() as u64, 5000);
}

#[test]
fn what_a_driver_says_right_after_it_begins_anew_is_kept() {
    let (mut lab, pump) = patched();
    let heard = lab.serial("VR SCADA Q2 I2\rP Q1=24\rCONNECT I2:PUMP:Q2\r");
    assert_eq!(heard, [PUMP, SCADA]);
    assert_eq!(lab.hear(pump), ["P I1=24"]);
    lab.say(pump, "P Q2=2");
    assert_eq!(lab.told(), ["P I2=2"]);
    // Pending answers belong to the old requests.
    let heard = lab.serial("LIST\rVR SCADA Q2 I2\rCONNECT I1:PUMP:Q1\rPING\r");
    assert_eq!(heard, [AWAY, PUMP, SCADA, "P I2=2"]);
    assert_eq!(lab.dispatcher.patch().len(), 3);
    assert_eq!(lab.serial("PING\r"), ["OK PING"]);
}

#[test]
fn a_driver_that_takes_another_name_hears_the_answer_and_no_outage() {
    let (mut lab, _) = patched();
    let heard = lab.serial("VR PUMP Q2 I2\r");
    assert!(heard[0].starts_with("ERR 409 "), "{heard:?}");
    assert!(
        lab.serial("VR SCADA Q2 I2\r").is_empty(),
        "it is called after a pause"
    );
    lab.connect();
    lab.settle();
    assert_eq!(lab.told(), [PUMP, SCADA]);
}

#[test]
fn an_input_whose_source_does_not_come_back_is_off_after_a_restart() {
    for (version, lost) in [("", "P I1=0"), (" V=3", "P I1=?")] {
        let (mut lab, pump) = patched();
        lab.serial(&format!("VR SCADA Q2 I2{version}\r"));
        let tank = lab.client();
        lab.say(tank, "VP TANK Q1");
        lab.serial("CONNECT I2:TANK:Q1\r");
        lab.say(pump, "P Q1=24");
        lab.say(tank, "P Q1=24");
        assert_eq!(lab.told()[..], ["P I1=24", "P I2=24"]);
        lab.restart();
        assert_eq!(lab.told(), [AWAY]);
        // The tank comes back, but not the pump.
        let tank = lab.client();
        lab.say(tank, "VP TANK Q1");
        lab.say(tank, "P Q1=24");
        lab.connect();
        lab.settle();
        let heard = lab.told();
        assert!(
            heard.ends_with(&["P I2=24".to_owned(), lost.to_owned()]),
            "{heard:?}"
        );
        // The loss is not reported twice.
        lab.cut();
        lab.connect();
        lab.settle();
        assert!(!lab.told().contains(&lost.to_owned()));
    }
}

#[test]
fn many_requests_at_once_wait_for_their_turn() {
    let mut lab = Lab::new();
    let pump = lab.client();
    lab.say(pump, "VP PUMP Q200");
    lab.serial("VR SCADA I200\r");
    let all = (1..=200).map(|at| format!("CONNECT I{at}:PUMP:Q{at}\r"));
    let heard = lab.serial(&(all.collect::<String>() + "PING\r"));
    assert_eq!(heard, ["OK PING"]);
    assert_eq!(lab.dispatcher.patch().len(), 200);
    // While the dispatcher is connected, but does not answer.
    let seat = lab.seat.take();
    lab.serial(&"LIST\r".repeat(70));
    assert!(lab.told().is_empty());
    assert!(!lab.bridge.wants_serial());
    lab.seat = seat;
    lab.cut();
    lab.bridge.tick(lab.now).expect("it is away");
    assert!(lab.bridge.wants_serial());
    assert_eq!(lab.told().len(), 7, "the outage, and 6 that are too many");
}

#[test]
fn requests_of_any_length_are_carried_out_once() {
    let mut lab = Lab::new();
    lab.cut();
    lab.serial("VR SCADA Q2 I2\r");
    // More than may wait for the dispatcher at once.
    let long = format!("CONNECT{}\r", " I1:PUMP:Q1".repeat(360));
    let heard = lab.serial(&long.repeat(64));
    assert!(heard.is_empty(), "{heard:?}");
    pump_again(&mut lab);
    lab.connect();
    lab.settle();
    assert_eq!(lab.told(), [PUMP, SCADA]);
    assert_eq!(lab.dispatcher.patch().len(), 1);
    lab.restart();
    pump_again(&mut lab);
    lab.connect();
    lab.settle();
    let lines = lab.dispatcher.traffic().lines;
    assert!(lines < 10, "{lines}");
}

proptest::proptest! {
    #[test]
    fn noise_does_no_harm(noise in proptest::collection::vec(proptest::collection::vec(proptest::num::u8::ANY, 0..200), 0..30)) {
        let (mut lab, _) = patched();
        for piece in noise {
            lab.bridge.from_serial(lab.now, &piece);
            lab.settle();
            lab.told();
        }
        lab.serial("\r");
        // A short line that begins like what browsers send is refused only when the next one comes.
        let heard = lab.serial("PING\r");
        proptest::prop_assert_eq!(heard.last().map(String::as_str), Some("OK PING"));
    }
}

#[test]
fn the_bridge_states_the_key_in_its_clients_place() {
    let key = |text: &str| Key::parse(text).expect("a key");
    let with = |said: &str| {
        let mut lab = Lab {
            now: Nanos::ZERO,
            dispatcher: Dispatcher::new(Settings::default(), Patch::new()),
            bridge: AsciiBridge::new(LineEnd::Cr).with_key(Some(key(said))),
            seat: None,
        };
        lab.dispatcher.require(key("0123456789abcdef"));
        lab.connect();
        lab
    };
    let mut lab = with("0123456789abcdef");
    let heard = lab.serial("VR SCADA Q1 I1 V=2\r");
    assert_eq!(heard[0], "OK VR", "and not OK KEY");
    assert_eq!(lab.serial("PING\r"), ["OK PING"]);
    let told = lab.serial("KEY 0123456789abcdef\r");
    assert_eq!(
        told,
        ["ERR 400 the bridge states the key; start it with --key-file"]
    );
    // After a break it states the key again.
    assert!(!lab.cut());
    lab.told();
    lab.connect();
    assert_eq!(lab.settle(), None);
    assert_eq!(lab.told()[0], "OK VR");

    let mut lab = with("0123456789abcdeF");
    lab.bridge.from_serial(lab.now, b"VR SCADA Q1 I1 V=2\r");
    let why = lab.settle().expect("it is refused");
    assert!(
        why.starts_with("it answers ERR 403 the key is wrong"),
        "{why}"
    );
    assert!(lab.told()[0].starts_with("ERR 403"));

    // A bridge without the key says what the dispatcher wants.
    let mut lab = Lab::new();
    lab.cut();
    lab.dispatcher.require(key("0123456789abcdef"));
    lab.connect();
    lab.bridge.from_serial(lab.now, b"VR SCADA Q1 I1 V=2\r");
    let why = lab.settle().expect("it is refused");
    assert!(
        why.starts_with("it answers ERR 401 this laboratory has a key"),
        "{why}"
    );
    assert!(why.contains("start the bridge with --key-file"), "{why}");
    assert!(lab.told()[0].starts_with("ERR 401"));

    // So does a bridge whose driver is silent.
    let mut lab = Lab::new();
    lab.cut();
    lab.dispatcher.require(key("0123456789abcdef"));
    lab.connect();
    lab.now += Nanos::from_secs(10);
    lab.dispatcher.tick(lab.now);
    let why = lab.settle().expect("it is refused");
    assert!(
        why.contains("no key came within 10s") && why.contains("with --key-file"),
        "{why}"
    );
    assert!(!lab.bridge.is_here() && lab.told().is_empty());
}

#[test]
fn what_is_no_dispatcher_gets_no_key_into_a_log_and_no_sequence_to_a_terminal() {
    const KEY: &str = "0123456789abcdef";

    let key = Key::parse(KEY).expect("a key");
    for line in [format!("KEY {KEY}\r\n"), format!("-ERR `{KEY}`\r\n")] {
        let mut bridge = AsciiBridge::new(LineEnd::Cr).with_key(Some(key.clone()));
        bridge.from_serial(Nanos::ZERO, b"VR SCADA Q1 I1\r");
        let length = bridge.to_serial().len();
        bridge.wrote_to_serial(length);
        bridge.connected(Nanos::ZERO);
        let why = bridge.hear(Nanos::ZERO, line.as_bytes());
        let why = why.expect_err("it is no dispatcher");
        let told = String::from_utf8_lossy(bridge.to_serial()).into_owned();
        for text in [&why, &told] {
            assert!(
                text.contains("check the address") && !text.contains(KEY),
                "{text}"
            );
        }
    }
    let mut bridge = AsciiBridge::new(LineEnd::Cr);
    bridge.from_serial(Nanos::ZERO, b"VR SCADA Q1 I1\r");
    bridge.connected(Nanos::ZERO);
    let why = bridge.hear(Nanos::ZERO, b"ERR 409 \x1b]0;owned\x07\xff\r\n");
    assert_eq!(why, Err("it answers ERR 409 ?]0;owned??".to_owned()));
}
