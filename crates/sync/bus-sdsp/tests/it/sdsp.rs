//! The bus `sdsp`: machine and PLC in lock-step over TCP, with the server in this process.
#![allow(clippy::float_cmp, reason = "tests; small whole numbers")]

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};

use crate::server::Server;
use tickbus_base::time::{Clock as _, Manual, Monotonic, Nanos, Stop};
use tickbus_conformance::rig::{End, SIGNALS};
use tickbus_driver::{Code, Exchange, Host};
use tickbus_driver_cfg::{Config, Kind, Kinds};
use tickbus_fieldbus::{Cause, LinkState};
use tickbus_image::signal::DataType;
use tickbus_net::Address;
use tickbus_plc::{Program, Scan};
use tickbus_virtual_time::server::{Control, ToClient};
use tickbus_virtual_time::wire;
use tickbus_virtual_time::{
    Declaration, Ended, Outcome, Participant, Settings, StartCondition, Step, TraceHash, Variable,
    tcp,
};

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_sdsp::Options>()]);

const STEP: Nanos = Nanos::from_millis(1);

/// The server of a run with two clients and this many steps of 1 ms.
pub(super) fn of_two(steps: u64) -> Server {
    let mut settings = Settings::new(STEP, StartCondition::Count(2));
    settings.steps = Some(steps);
    Server::start(settings)
}

fn config(port: u16, role: &str, extra: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"sdsp\"\naddress = \"127.0.0.1:{port}\"\n\
         role = \"{role}\"\n{extra}\n{SIGNALS}"
    )
}

pub(super) fn open(port: u16, role: &str, extra: &str) -> End {
    End::open(&config(port, role, extra), &Manual::new(), &KINDS)
}

/// The other end on a separate thread: ticks as long as the line has data, and lets `each` see and change them.
pub(super) fn controller(
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
    let server = of_two(5);
    let plc = controller(server.port, "", |end, _| {
        end.set("speed", 2.0 * end.get("position"));
        end.set("echo", end.get("echo") + 1.0);
    });
    let mut machine = open(server.port, "device", "");
    let mut seen = Vec::new();
    machine.set("position", 100.0);
    for step in 0..5_u32 {
        let found = machine.tick();
        assert_eq!(found.code, Code::Fresh);
        assert_eq!(
            (found.age, found.sequence),
            (Nanos::ZERO, u64::from(step) + 1)
        );
        assert_eq!(found.granted, STEP.times(i64::from(step) + 1));
        seen.push((machine.get("speed"), machine.get("echo")));
        machine.set("position", -10.0 * (f64::from(step) + 1.0));
    }
    assert_eq!(machine.link().state, LinkState::Running);
    assert_eq!(
        seen,
        [
            (-1.0, 0.0),
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

#[test]
fn a_tick_between_two_steps_waits_for_nobody_and_one_over_several_takes_all_of_them() {
    let server = of_two(20);
    let plc = controller(server.port, "", |end, _| {
        end.set("echo", end.get("echo") + 1.0);
    });
    let mut machine = open(server.port, "device", "step = \"4ms\"\nmax_age = \"3ms\"");
    let mut at = |millis: i64| {
        let found = machine
            .driver
            .exchange(Nanos::from_millis(millis), &mut machine.slots);
        let echo = machine.slots[2].real();
        (found.code, found.granted.0 / STEP.0, echo)
    };
    // The machine's own time begins at 100 ms. The PLC's first value is that of step 1, which the machine sees in step
    // 5.
    assert_eq!(at(100), (Code::Fresh, 104, 0.0));
    assert_eq!(at(101), (Code::Unchanged, 104, 0.0));
    assert_eq!(at(103), (Code::Unchanged, 104, 0.0));
    assert_eq!(at(104), (Code::Fresh, 108, 4.0));
    assert_eq!(at(115), (Code::Fresh, 116, 12.0));
    // Steps 17 to 20 are the last ones.
    assert_eq!(at(119), (Code::Fresh, 120, 16.0));
    assert_eq!(at(120).0, Code::Stale);
    assert!(server.end().is_ok());
    plc.join().expect("no panic");
}

#[test]
fn a_simulation_of_halves_answers_within_its_step() {
    let server = of_two(10);
    let plc = controller(server.port, "", |end, _| {
        end.set("echo", end.get("position"));
    });
    let mut machine = open(server.port, "device", "");
    let mut seen = Vec::new();
    for step in 1..=10 {
        assert_eq!(machine.receive().code, Code::Fresh);
        seen.push(machine.get("echo"));
        machine.set("position", f64::from(step));
        machine.send();
    }
    // The last step is finished when the machine closes.
    machine.driver.close();
    // One step to the PLC, and one back.
    assert_eq!(seen, [0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    assert!(server.end().is_ok());
    plc.join().expect("no panic");
}

/// A pulse of one tick between two steps is transferred in a step, and its edge counted.
#[test]
fn no_pulse_between_two_steps_is_lost() {
    let server = of_two(80);
    let (to, pulses) = mpsc::channel();
    let plc = controller(server.port, "step = \"4ms\"", move |end, _| {
        end.set("speed", end.get("speed") + 1.0);
        to.send(end.edges("sensor")).expect("it listens");
    });
    let mut machine = open(server.port, "device", "multiple = 4");
    let mut sent = 0.0;
    for millis in 0.. {
        // Pulses of one tick, and of changing distances.
        let is_high = millis % 9 == 2;
        sent += f64::from(is_high);
        machine.set("sensor", f64::from(is_high));
        let found = machine
            .driver
            .exchange(STEP.times(millis), &mut machine.slots);
        if found.code == Code::Stale {
            break;
        }
    }
    plc.join().expect("no panic");
    assert_eq!(pulses.iter().sum::<f64>(), sent);
    assert!(sent >= 8.0, "{sent}");
    assert!(server.end().is_ok());
}

/// A client that a test controls.
struct Foreign<F> {
    declaration: Declaration,
    run: F,
}

impl<F: FnMut(Step, &[u64], &mut [u64]) -> Result<(), String>> Participant for Foreign<F> {
    fn declare(&self) -> Declaration {
        self.declaration.clone()
    }

    fn initial(&mut self, _writes: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        (self.run)(step, reads, writes)
    }
}

/// A foreign PLC for the machine at the other end, on a thread.
fn foreign<F>(port: u16, speed: DataType, run: F) -> JoinHandle<Result<Outcome, Ended>>
where
    F: FnMut(Step, &[u64], &mut [u64]) -> Result<(), String> + Send + 'static,
{
    let mut declaration = Declaration::new("foreign PLC");
    declaration.writes = vec![
        Variable::new("run", DataType::Bool),
        Variable::new("speed", speed),
        Variable::new("echo", DataType::Int),
    ];
    declaration.reads = vec!["position".to_owned()];
    thread::spawn(move || {
        let mut client = Foreign { declaration, run };
        tcp::join(&Address::local(port), &mut client)
    })
}

fn broken(machine: &mut End, code: Code) -> (Cause, String) {
    assert_eq!(machine.tick().code, code);
    let link = machine.link();
    assert_eq!(link.state, LinkState::Failed);
    (link.cause, link.reason)
}

#[test]
fn a_client_that_gives_up_ends_the_run_and_its_reason_is_told() {
    let server = of_two(100);
    let plc = foreign(server.port, DataType::Int, |step, reads, writes| {
        writes[1] = reads[0];
        match step.sequence {
            4 => Err("its emergency stop was pressed".to_owned()),
            _ => Ok(()),
        }
    });
    let mut machine = open(server.port, "device", "");
    machine.set("position", -5.0);
    for _ in 0..4 {
        assert_eq!(machine.tick().code, Code::Fresh);
    }
    assert_eq!(machine.get("speed"), -5.0);
    let right = (
        Cause::Left,
        "the peer left: the run ended after 3 steps: client \"foreign PLC\" gave up: its emergency stop was pressed"
            .to_owned(),
    );
    assert_eq!(broken(&mut machine, Code::BusFailed), right);
    assert_eq!(
        broken(&mut machine, Code::BusFailed),
        right,
        "and it stays so"
    );
    assert_eq!(machine.get("speed"), -1.0, "the fail-safe value");
    assert!(server.end().is_err() && plc.join().expect("no panic").is_err());
}

#[test]
fn a_machine_that_is_closed_says_so_to_everyone() {
    let server = of_two(100);
    let plc = foreign(server.port, DataType::Int, |_, _, _| Ok(()));
    let mut machine = open(server.port, "device", "client = \"the machine\"");
    machine.tick();
    machine.driver.close();
    let told = server.end().expect_err("it ends early").to_string();
    assert_eq!(
        told,
        "the run ended before its first step: client \"the machine\" gave up: it was closed"
    );
    assert_eq!(
        plc.join()
            .expect("no panic")
            .expect_err("it too")
            .to_string(),
        told
    );
}

#[test]
fn what_does_not_fit_the_run_is_refused_by_name() {
    let int = DataType::Int;
    for (extra, speed, cause, parts) in [
        (
            "step = \"100us\"",
            int,
            Cause::Refused,
            "its step of 100us is shorter than the server's, 1ms, in which a client runs once at most",
        ),
        (
            "",
            DataType::Uint,
            Cause::Left,
            "client \"cell\" gave up: it reads \"speed\" as INT, but that is UINT; give the signal this \"type\"",
        ),
        (
            "client = \"foreign PLC\"",
            int,
            Cause::Refused,
            "has joined already; give this one another name",
        ),
        (
            "[fieldbus.at]\nspeed = \"velocity\"",
            int,
            Cause::Refused,
            "\"velocity\"",
        ),
    ] {
        let server = of_two(100);
        let plc = foreign(server.port, speed, |_, _, _| Ok(()));
        if extra.starts_with("client") {
            // The other client must be the second one of that name.
            server.says("\"foreign PLC\" has joined");
        }
        let mut machine = open(server.port, "device", extra);
        let (found, reason) = broken(&mut machine, Code::BusFailed);
        assert!(reason.contains(parts), "{reason}");
        assert_eq!(found, cause, "{reason}");
        drop(machine);
        server.controls.send(Control::Stop);
        assert!(plc.join().expect("no panic").is_err());
    }
}

#[test]
fn a_client_that_comes_late_is_refused_with_the_reason() {
    let server = of_two(2);
    let plc = foreign(server.port, DataType::Int, |_, _, _| Ok(()));
    let mut machine = open(server.port, "device", "");
    machine.tick();
    let mut late = open(server.port, "device", "client = \"late\"");
    let (cause, reason) = broken(&mut late, Code::BusFailed);
    assert_eq!(cause, Cause::Refused);
    let begin = "refused: the server refused this client: ";
    assert!(reason.starts_with(begin), "{reason}");
    machine.tick();
    assert_eq!(
        machine.tick().code,
        Code::Stale,
        "the others go on to the end"
    );
    assert!(server.end().is_ok() && plc.join().expect("no panic").is_ok());
}

#[test]
fn no_wait_lasts_longer_than_its_time_out() {
    let server = of_two(10);
    let mut machine = open(server.port, "device", "timeout = \"100ms\"");
    let (cause, reason) = broken(&mut machine, Code::BusFailed);
    assert_eq!(cause, Cause::Link);
    assert!(reason.contains("100ms"), "{reason}");
    server.controls.send(Control::Stop);
    drop(server);
    // Nobody listens there.
    let address = Address::local(0);
    let listener = tcp::Listener::bind(&address).expect("a free port");
    let port = listener.address().port();
    drop(listener);
    let mut early = open(port, "device", "timeout = \"50ms\"");
    let (cause, reason) = broken(&mut early, Code::BusFailed);
    assert_eq!(cause, Cause::Link);
    let right = format!("no server can be reached at 127.0.0.1:{port}");
    assert!(reason.contains(&right), "{reason}");
}

#[test]
fn variables_are_named_by_station_or_as_one_likes() {
    let server = of_two(3);
    let text = format!(
        "[driver]\nid = 1\nname = \"two\"\n[fieldbus]\nkind = \"sdsp\"\naddress = \"127.0.0.1:{}\"\n\
         [fieldbus.at]\nout = \"a long name.of its own\"\n\
         [[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n\
         [[signal]]\nname = \"in\"\nstation = \"A\"\naddress = \"%QD0\"\ntype = \"REAL\"\norder = \"CDAB\"\n\
         [[signal]]\nname = \"out\"\nstation = \"A\"\naddress = \"%ID4\"\ntype = \"REAL\"\norder = \"DCBA\"\n\
         [[signal]]\nname = \"back\"\nstation = \"B\"\naddress = \"%IW0\"\ntype = \"INT\"\n",
        server.port
    );
    let mut declaration = Declaration::new("other");
    declaration.writes = vec![Variable::new("A.in", DataType::Real)];
    declaration.reads = vec!["a long name.of its own".to_owned(), "B.back".to_owned()];
    let port = server.port;
    let other = thread::spawn(move || {
        let mut seen = Vec::new();
        let run = |_: Step, reads: &[u64], writes: &mut [u64]| {
            writes[0] = u64::from(1.5_f32.to_bits());
            seen.push((reads[0], reads[1]));
            Ok(())
        };
        let mut client = Foreign { declaration, run };
        tcp::join(&Address::local(port), &mut client).expect("it ends as planned");
        seen
    });
    let mut machine = End::open(&text, &Manual::new(), &KINDS);
    machine.set("out", -0.25);
    machine.set("back", -2.0);
    machine.tick();
    machine.tick();
    assert_eq!(machine.get("in"), 1.5);
    machine.tick();
    machine.tick();
    let sent = (u64::from((-0.25_f32).to_bits()), u64::MAX - 1);
    assert_eq!(other.join().expect("no panic"), [sent; 3]);
    assert!(server.end().is_ok());
}

/// Counts its scans, and answers with what it sees.
struct Counting;

impl Program for Counting {
    fn name(&self) -> &'static str {
        "counting"
    }

    fn input_bytes(&self) -> usize {
        6
    }

    fn output_bytes(&self) -> usize {
        6
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        assert!(scan.alive, "data of its own step");
        let count = u16::from_be_bytes([scan.outputs[4], scan.outputs[5]]) + 1;
        scan.outputs[4..6].copy_from_slice(&count.to_be_bytes());
        scan.outputs[2..4].copy_from_slice(&scan.inputs[2..4]);
        let millis = 5 * (i64::from(count) - 1);
        assert_eq!(scan.now, Nanos::from_millis(millis), "virtual time");
    }
}

fn host(port: u16, extra: &str) -> Host {
    let text = config(port, "controller", extra);
    let config = Config::parse("driver.cfg", &text, &KINDS).unwrap_or_else(|why| panic!("{why}"));
    let clock = Monotonic::shared();
    Host::open(&config, Box::new(Counting), Nanos::from_millis(5), clock).expect("opens")
}

#[test]
fn a_program_scans_in_steps_of_its_interval_until_the_run_ends() {
    let mut hashes = Vec::new();
    for _ in 0..2 {
        let server = of_two(101);
        let plc = host(server.port, "");
        let mut machine = open(server.port, "device", "");
        let mut steps = 0;
        while machine.tick().code != Code::Stale {
            steps += 1;
            // The PLC scans in steps 1, 6, 11, …; its values appear in the next step, and its first values are 0.
            let scans = f64::from((steps + 3) / 5);
            assert_eq!(machine.get("echo"), scans, "step {steps}");
            machine.set("position", f64::from(steps));
        }
        let outcome = server.end().expect("it ends as planned");
        tickbus_conformance::rig::await_that("it is over", || plc.is_over());
        assert_eq!((steps, outcome.steps), (101, 101));
        assert_eq!(plc.scans(), (21, 0));
        assert_eq!(plc.fact("sdsp.hash"), Some(outcome.hash.to_string()));
        assert_eq!((plc.fault(), plc.close()), (None, None));
        hashes.push(outcome.hash);
    }
    assert_eq!(hashes[0], hashes[1]);
    assert_ne!(hashes[0], TraceHash(0));
}

#[test]
fn a_program_that_is_stopped_leaves_the_run_and_one_whose_run_breaks_says_why() {
    let server = of_two(1_000_000_000);
    let plc = host(server.port, "");
    let machine = foreign_machine(server.port, |_, _, _| Ok(()));
    server.says("starts");
    assert_eq!(plc.close(), None);
    let told = server.end().expect_err("without a PLC").to_string();
    assert!(told.contains("client \"cell PLC\" gave up: "), "{told}");
    assert!(machine.join().expect("no panic").is_err());

    let server = of_two(100);
    let plc = host(server.port, "");
    let machine = foreign_machine(server.port, |_, _, _| Err("it burns".to_owned()));
    assert!(machine.join().expect("no panic").is_err());
    tickbus_conformance::rig::await_that("it is over", || plc.is_over());
    let right = "the peer left: the run ended before its first step: client \"foreign machine\" gave up: it burns";
    assert_eq!(plc.fault().as_deref(), Some(right));
    assert_eq!(plc.link().reason, right);
    assert!(server.end().is_err());
}

fn foreign_machine<F>(port: u16, run: F) -> JoinHandle<Result<Outcome, Ended>>
where
    F: FnMut(Step, &[u64], &mut [u64]) -> Result<(), String> + Send + 'static,
{
    let mut declaration = Declaration::new("foreign machine");
    declaration.writes = vec![
        Variable::new("sensor", DataType::Bool),
        Variable::new("position", DataType::Int),
        Variable::new("copy", DataType::Int),
    ];
    thread::spawn(move || {
        let mut client = Foreign { declaration, run };
        tcp::join(&Address::local(port), &mut client)
    })
}

/// The meeting place makes no difference.
#[cfg(unix)]
#[test]
fn a_run_in_shared_memory_is_that_over_tcp() {
    let name = format!("bus-sdsp-{}", std::process::id());
    let mut settings = Settings::new(STEP, StartCondition::Count(2));
    settings.steps = Some(300);
    let mut outcomes = Vec::new();
    for is_memory in [false, true] {
        let (server, at) = if is_memory {
            let server = Server::in_memory(&name, settings.clone());
            (server, format!("shared_memory = \"{name}\""))
        } else {
            let server = Server::start(settings.clone());
            let at = format!("address = \"127.0.0.1:{}\"", server.port);
            (server, at)
        };
        let text = |role: &str| config(0, role, "").replace("address = \"127.0.0.1:0\"", &at);
        let plc_text = text("controller");
        let plc = thread::spawn(move || {
            let mut plc = End::open(&plc_text, &Manual::new(), &KINDS);
            while plc.tick().code == Code::Fresh {
                plc.set("speed", plc.get("position") + 3.0);
            }
        });
        let mut machine = End::open(&text("device"), &Manual::new(), &KINDS);
        while machine.tick().code == Code::Fresh {
            machine.set("position", machine.get("speed") + 2.0);
        }
        plc.join().expect("no panic");
        assert!(machine.get("position") > 700.0);
        outcomes.push(server.end().expect("as planned"));
    }
    assert_eq!(outcomes[0], outcomes[1]);
}

/// Neither a pause nor a client that joins late counts as a server that hangs.
#[test]
fn a_pause_longer_than_the_time_out_is_waited_for() {
    let name = format!("bus-sdsp-pause-{}", std::process::id());
    let mut settings = Settings::new(STEP, StartCondition::Count(1));
    (settings.steps, settings.paused) = (Some(3), true);
    let servers = [
        Server::start(settings.clone()),
        #[cfg(unix)]
        Server::in_memory(&name, settings),
    ];
    let machines = servers.each_ref().map(|server| {
        let text = config(server.port, "device", "timeout = \"2500ms\"");
        let place = format!("address = \"127.0.0.1:{}\"", server.port);
        let memory = format!("shared_memory = \"{name}\"");
        let text = match server.port {
            0 => text.replace(&place, &memory),
            _ => text,
        };
        let text = text.split("[[signal]]").map(str::to_owned);
        let written: Vec<String> = text
            .enumerate()
            .filter(|(at, section)| *at == 0 || section.contains("%I"))
            .map(|(_, section)| section)
            .collect();
        let text = written.join("[[signal]]");
        thread::spawn(move || {
            let mut machine = End::open(&text, &Manual::new(), &KINDS);
            while machine.tick().code == Code::Fresh {}
            machine.link().reason
        })
    });
    for server in &servers {
        server.says("the run starts");
    }
    let clock = Monotonic::shared();
    clock.wait_until(clock.now() + Nanos::from_secs(4), &Stop::new());
    for (server, machine) in servers.into_iter().zip(machines) {
        server.controls.send(Control::Run);
        let reason = machine.join().expect("no panic");
        assert!(reason.contains("come to its end after 3 steps"), "{reason}");
        assert_eq!(server.end().map(|outcome| outcome.steps), Ok(3));
    }
}

#[test]
fn a_step_in_time_is_the_same_run_as_its_multiple() {
    let hashes = ["step = \"10ms\"", "multiple = 10"].map(|extra| {
        let server = of_two(41);
        let plc = foreign(server.port, DataType::Int, |_, _, _| Ok(()));
        let mut machine = open(server.port, "device", extra);
        let mut ticks = 0;
        while machine.tick().code == Code::Fresh {
            ticks += 1;
            machine.set("position", f64::from(ticks));
        }
        assert_eq!(ticks, 5, "at 0, 10, 20, 30 and 40 ms");
        assert!(plc.join().expect("no panic").is_ok());
        server.end().expect("as planned").hash
    });
    assert_eq!(hashes[0], hashes[1]);
}

#[test]
fn a_simulation_whose_time_jumps_is_told_and_leaves() {
    let server = of_two(1_000_000);
    let plc = foreign(server.port, DataType::Int, |_, _, _| Ok(()));
    let mut machine = open(server.port, "device", "");
    let mut at = |time| {
        let found = machine.driver.exchange(time, &mut machine.slots);
        (found.code, machine.link().reason)
    };
    assert_eq!(at(Nanos::ZERO).0, Code::Fresh);
    let (code, reason) = at(Nanos::from_secs(1000));
    assert_eq!(code, Code::BusFailed);
    let right = "client \"cell\" gave up: its simulation time jumped from 1ms to 1000s, over more than 100000 steps";
    assert!(reason.contains(right), "{reason}");
    let told = server.end().expect_err("it gave up").to_string();
    assert!(told.contains(right), "{told}");
    assert!(plc.join().expect("no panic").is_err());
}

#[test]
fn a_server_that_is_lost_ends_the_run_for_good() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("bound").port();
    let server = thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("the machine");
        let types = [DataType::Bool, DataType::Int, DataType::Int];
        let reads = [1, 2, 3];
        let step = Step {
            sequence: 1,
            time: Nanos::ZERO,
        };
        let mut out = Vec::new();
        wire::to_client(
            &mut out,
            &ToClient::Start {
                step: STEP,
                reads: &types,
            },
        );
        wire::to_client(
            &mut out,
            &ToClient::Step {
                step,
                reads: &reads,
            },
        );
        let frame = |stream: &mut TcpStream| {
            let mut length = [0; 4];
            stream.read_exact(&mut length).expect("its length");
            let length = usize::try_from(u32::from_le_bytes(length)).expect("small");
            stream.read_exact(&mut vec![0; length]).expect("the rest");
        };
        frame(&mut stream);
        let (start, step) = out.split_at(4 + 1 + 8 + types.len());
        stream.write_all(start).expect("it is there");
        frame(&mut stream);
        stream.write_all(step).expect("it is there");
        // Leave no byte unread when the connection is closed.
        frame(&mut stream);
    });
    let mut machine = open(port, "device", "");
    assert_eq!(machine.tick().code, Code::Fresh);
    assert_eq!(machine.get("speed"), 2.0);
    let (cause, reason) = broken(&mut machine, Code::BusFailed);
    server.join().expect("no panic");
    assert_eq!(cause, Cause::Link);
    assert!(reason.contains("the server was lost"), "{reason}");
    assert_eq!(broken(&mut machine, Code::BusFailed), (cause, reason));
}
