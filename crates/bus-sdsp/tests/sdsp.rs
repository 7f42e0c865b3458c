//! The bus `sdsp`: machine and PLC in lock-step over TCP, with the server in this process.
#![allow(missing_docs, clippy::float_cmp, reason = "tests; small whole numbers")]

use std::thread::{self, JoinHandle};

use tickbus_base::time::{Manual, Monotonic, Nanos};
use tickbus_conformance::rig::{End, SIGNALS};
use tickbus_driver::{Code, Exchange, Host};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::tcp::Address;
use tickbus_fieldbus::{Cause, LinkState};
use tickbus_image::signal::DataType;
use tickbus_plc::{Program, Scan};
use tickbus_virtual_time::{
    Controls, Declaration, Ended, Hosting, Logic, Outcome, Participant, Settings, StartCondition,
    Step, TraceHash, Variable, tcp,
};

const STEP: Nanos = Nanos::from_millis(1);

/// A server on a thread of its own.
struct Server {
    port: u16,
    thread: JoinHandle<Result<Outcome, Ended>>,
}

impl Server {
    fn start(settings: Settings) -> Self {
        let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
        let port = listener.address().port();
        let thread = thread::spawn(move || {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            listener.run(settings, Logic::new(), hosting)
        });
        Self { port, thread }
    }

    /// A run of two clients with so many steps of 1 ms.
    fn of_two(steps: u64) -> Self {
        let mut settings = Settings::new(STEP, StartCondition::Count(2));
        settings.steps = Some(steps);
        Self::start(settings)
    }

    fn end(self) -> Result<Outcome, Ended> {
        self.thread.join().expect("no panic")
    }
}

fn config(port: u16, role: &str, extra: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"sdsp\"\naddress = \"127.0.0.1:{port}\"\n\
         role = \"{role}\"\n{extra}\n{SIGNALS}"
    )
}

fn open(port: u16, role: &str, extra: &str) -> End {
    End::open(&config(port, role, extra), &Manual::new())
}

/// The other end on a thread of its own: ticks as long as the line gives data, and lets `each` see and change them.
fn controller(
    port: u16,
    extra: &'static str,
    mut each: impl FnMut(&mut End, Exchange) + Send + 'static,
) -> JoinHandle<String> {
    thread::spawn(move || {
        let mut end = open(port, "controller", extra);
        loop {
            let found = end.tick();
            if !matches!(found.code, Code::Fresh | Code::Unchanged) {
                return end.link().reason;
            }
            each(&mut end, found);
        }
    })
}

#[test]
fn a_step_later_each_end_has_what_the_other_wrote_and_the_time_is_granted() {
    let server = Server::of_two(5);
    let plc = controller(server.port, "", |end, _| {
        end.set("speed", 2.0 * end.get("position"));
        end.set("echo", end.get("echo") + 1.0);
    });
    let mut machine = open(server.port, "device", "");
    let mut seen = Vec::new();
    machine.set("position", 100.0);
    for step in 0..5 {
        let found = machine.tick();
        assert_eq!(found.code, Code::Fresh);
        assert_eq!((found.age, found.sequence), (Nanos::ZERO, step + 1));
        assert_eq!(found.granted, Nanos::from_millis(step as i64 + 1));
        seen.push((machine.get("speed"), machine.get("echo")));
        machine.set("position", -10.0 * (step as f64 + 1.0));
    }
    assert_eq!(machine.link().state, LinkState::Running);
    // The initial values of a PLC are 0, its fail-safe value notwithstanding: nobody has written another one.
    assert_eq!(
        seen,
        [
            (0.0, 0.0),
            (200.0, 1.0),
            (-20.0, 2.0),
            (-40.0, 3.0),
            (-60.0, 4.0)
        ]
    );
    let outcome = {
        let last = machine.tick();
        assert_eq!(last.code, Code::Stale, "the run is over");
        server.end().expect("it ends as planned")
    };
    assert_eq!(outcome.steps, 5);
    let link = machine.link();
    assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Left));
    let told = format!(
        "the run has come to its end after 5 steps, at 4ms of virtual time; its trace hash is {}",
        outcome.hash
    );
    assert_eq!(link.reason, told);
    assert_eq!(plc.join().expect("no panic"), told);
    assert_eq!(machine.get("speed"), -1.0, "the fail-safe value");
    assert_eq!(machine.statistic("sdsp.hash"), outcome.hash.to_string());
    assert_eq!(machine.tick().code, Code::Stale, "and it stays so");
}
