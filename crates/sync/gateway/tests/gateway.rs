//! The gateway: a PLC that knows only two signals and a clock of virtual time, in lock-step.
#![allow(missing_docs, clippy::float_cmp, reason = "tests; small whole numbers")]

#[path = "../../bus-sdsp/tests/it/server/mod.rs"]
mod server;

use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::thread::{self, JoinHandle};

use server::Server;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_conformance::rig::End;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_gateway::{Gateway, GatewayOptions};
use tickbus_image::signal::DataType;
use tickbus_net::Address;
use tickbus_virtual_time::{
    Declaration, Ended, Meeting, Outcome, Participant, Settings, StartCondition, Step, Variable,
    tcp,
};

const SIGNALS: &str = r#"
[[signal]]
name    = "sync.go"
address = "%ID0"
type    = "UDINT"

[[signal]]
name    = "sync.time"
address = "%ID4"
type    = "UDINT"

[[signal]]
name    = "position"
address = "%IW8"
type    = "INT"

[[signal]]
name    = "sync.done"
address = "%QD0"
type    = "UDINT"

[[signal]]
name    = "speed"
address = "%QW4"
type    = "INT"
"#;

fn text(link: &str, role: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"loopback\"\ncycle = \"100us\"\nlink = \"{link}\"\n\
         role = \"{role}\"\n{SIGNALS}"
    )
}

/// A free-running PLC with a scheduler. Its program counts its steps, adds them to the position, and runs after a
/// random time; in between its outputs are meaningless.
struct Plc {
    stop: Stop,
    thread: JoinHandle<u32>,
}

impl Plc {
    /// A PLC that has already finished the steps up to `done`, and hangs in the step after `last`. Its outputs show
    /// that by the time this returns: a gateway opened afterwards never sees the zeros of a bus that started before its
    /// PLC.
    fn start(link: &'static str, done: u32, last: u32, seed: u64) -> Self {
        let stop = Stop::new();
        let (says, is_said) = channel();
        let stopped = stop.clone();
        let thread = thread::spawn(move || {
            let clock = Monotonic::shared();
            let mut end = End::open(&text(link, "controller"), &clock, &Kinds::LOOPBACK);
            let (mut last_go, mut count, mut random) = (done, 0_u32, seed);
            end.set("sync.done", f64::from(done));
            end.tick();
            says.send(()).expect("it waits");
            while !stopped.is_stopped() {
                end.tick();
                let go = end.slots[0].real();
                let is_there = end.link().state == tickbus_fieldbus::LinkState::Running;
                if is_there && go != f64::from(last_go) && go != 0.0 && count < last {
                    assert_eq!(go, f64::from(last_go + 1), "one step after another");
                    assert_eq!(end.get("sync.time"), 10.0 * f64::from(count));
                    random = random.wrapping_mul(6_364_136_223_846_793_005) + 1;
                    let micros = (random >> 33) % 400;
                    end.set("speed", -1.0);
                    end.tick();
                    clock.wait_until(
                        clock.now() + Nanos::from_micros(micros.cast_signed()),
                        &stopped,
                    );
                    (last_go, count) = (last_go + 1, count + 1);
                    end.set("speed", (end.get("position") + f64::from(count)) % 1000.0);
                    end.set("sync.done", go);
                }
                clock.wait_until(clock.now() + Nanos::from_micros(200), &stopped);
            }
            count
        });
        is_said.recv().expect("it has begun");
        Self { stop, thread }
    }

    /// Stops the PLC; returns the number of its steps.
    fn end(self) -> u32 {
        self.stop.stop();
        self.thread.join().expect("no panic")
    }
}

/// A machine that follows the PLC.
struct Machine(u64);

impl Participant for Machine {
    fn declare(&self) -> Declaration {
        Declaration {
            writes: vec![Variable::new("position", DataType::Int)],
            reads: vec!["speed".to_owned()],
            ..Declaration::new("machine")
        }
    }

    fn initial(&mut self, _writes: &mut [u64]) {}

    fn run(&mut self, _step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.0 += 1;
        writes[0] = reads[0] / 2 + self.0 % 7;
        Ok(())
    }
}

fn open(link: &str, timeout: Nanos, stop: &Stop) -> Gateway {
    let config = Config::parse("driver.cfg", &text(link, "device"), &Kinds::LOOPBACK);
    let config = config.unwrap_or_else(|why| panic!("{why}"));
    let options = GatewayOptions {
        client: None,
        multiple: NonZeroU32::new(10).expect("not 0"),
        timeout,
    };
    Gateway::open(&config, options, Monotonic::shared(), stop).expect("opens")
}

/// A run of the machine with a step of 1 ms, and the gateway with one of 10 ms.
fn run(gateway: &mut Gateway, steps: u64) -> Result<Outcome, Ended> {
    let mut settings = Settings::new(Nanos::from_millis(1), StartCondition::Count(2));
    settings.steps = Some(steps);
    let server = Server::start(settings);
    let port = server.port;
    let machine = thread::spawn(move || tcp::join(&Address::local(port), &mut Machine(0)));
    let own = gateway.take_part(&Meeting::Tcp(Address::local(port)));
    let outcome = server.end();
    assert_eq!(own, outcome);
    assert_eq!(machine.join().expect("no panic"), outcome);
    outcome
}

#[test]
fn a_plc_that_answers_at_random_times_is_in_step_and_the_trace_is_the_same() {
    // The second PLC was not restarted: it continues counting.
    let runs = [("one", 0, 1), ("other", 4711, 99)].map(|(link, done, seed)| {
        thread::spawn(move || {
            let plc = Plc::start(link, done, u32::MAX, seed);
            let mut gateway = open(link, Nanos::from_secs(20), &Stop::new());
            gateway.await_plc().expect("it is there");
            let outcome = run(&mut gateway, 10_000).expect("as planned");
            assert_eq!(plc.end(), 1000, "steps");
            gateway.close();
            outcome
        })
    });
    let outcomes = runs.map(|run| run.join().expect("no panic"));
    assert_eq!(outcomes[0].steps, 10_000);
    assert_eq!(outcomes[0], outcomes[1]);
}

#[test]
fn a_plc_that_does_not_answer_ends_the_run_by_name() {
    let mut gateway = open("hangs", Nanos::from_millis(300), &Stop::new());
    let plc = Plc::start("hangs", 0, 5, 1);
    gateway.await_plc().expect("it is there");
    let ended = run(&mut gateway, 1000).expect_err("it hangs");
    assert_eq!(
        ended.to_string(),
        "the run ended after 50 steps: client \"cell PLC\" gave up: the PLC did not finish its step within 300ms \
         (sync.go is 6, sync.done 5); see whether it is in RUN, and its scheduler is called in each cycle"
    );
    assert_eq!(plc.end(), 5);
    gateway.close();
}

#[test]
fn a_plc_that_never_appears_is_not_waited_for_forever() {
    let mut gateway = open("nobody", Nanos::from_millis(50), &Stop::new());
    let why = gateway.await_plc().expect_err("nobody is there");
    assert_eq!(
        why,
        "the PLC did not appear within 50ms: waiting for the other end of the link"
    );
    gateway.close();
    let stop = Stop::new();
    let mut gateway = open("nobody else", Nanos::from_secs(1000), &stop);
    stop.stop();
    assert_eq!(gateway.await_plc(), Err("it was stopped".to_owned()));
    gateway.close();
}

#[test]
fn a_driver_cfg_that_is_none_of_a_gateway_is_told_what_it_lacks() {
    let right = text("wrong", "device");
    for (from, to, told) in [
        (
            "sync.go",
            "go",
            "there is no signal \"sync.go\"; add it as a UDINT in %I, such as address = \"%ID0\"",
        ),
        (
            "address = \"%QD0\"\ntype    = \"UDINT\"",
            "address = \"%QD0\"\ntype    = \"REAL\"",
            "the signal \"sync.done\" is a REAL in %Q; add it as a UDINT in %Q",
        ),
        (
            "address = \"%IW8\"\ntype    = \"INT\"",
            "address = \"%IX8.0\"\nlatch = \"rising\"",
            "the signal \"position\" has a \"latch\"; remove it: in lock-step",
        ),
    ] {
        assert!(right.contains(from), "{from}");
        let config = Config::parse("driver.cfg", &right.replacen(from, to, 1), &Kinds::LOOPBACK);
        let config = config.unwrap_or_else(|why| panic!("{why}"));
        let options = GatewayOptions {
            client: None,
            multiple: NonZeroU32::MIN,
            timeout: Nanos::from_secs(1),
        };
        let clock = Monotonic::shared();
        let error = Gateway::open(&config, options, Arc::clone(&clock) as _, &Stop::new());
        let error = error.expect_err(told);
        assert!(
            error.is_wrong_input() && error.to_string().contains(told),
            "{error}"
        );
    }
}
