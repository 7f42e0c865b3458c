//! Injected faults, through drivers on real buses.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod stations;

use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use tickbus::driver::{Code, Host};
use tickbus::driver_cfg::Config;
use tickbus::faults::Phase;
use tickbus::fieldbus::{Cause, LinkState};
use tickbus::programs::Mirror;
use tickbus::time::{Manual, Nanos};
use tickbus_conformance::rig::{Bus, CYCLE, End, Liar, MAX_AGE, Rig, await_that, config, pass};
use tickbus_test_log as logged;

/// A link name used by one test only.
struct Link(String);

impl Link {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        Self(format!("faults-{}", NEXT.fetch_add(1, Ordering::Relaxed)))
    }
}

impl Bus for Link {
    fn kinds(&self) -> &'static tickbus::driver_cfg::Kinds {
        &tickbus::KINDS
    }

    fn fieldbus(&self, _role: &str) -> String {
        format!("kind = \"loopback\"\nlink = \"{}\"", self.0)
    }

    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        unreachable!("nobody lies here")
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        Vec::new()
    }
}

/// A TCP port used by one test only: it was free a moment ago.
struct Tcp(u16);

impl Tcp {
    fn new() -> Self {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        Self(listener.local_addr().expect("an address").port())
    }
}

impl Bus for Tcp {
    fn kinds(&self) -> &'static tickbus::driver_cfg::Kinds {
        &tickbus::KINDS
    }

    fn fieldbus(&self, _role: &str) -> String {
        format!("kind = \"socket\"\naddress = \"127.0.0.1:{}\"", self.0)
    }

    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        unreachable!("nobody lies here")
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        Vec::new()
    }
}

const DOWN: &str = "kind = \"link-down\"\nname = \"cable\"";

#[track_caller]
fn inject(end: &mut End, text: &str) -> u32 {
    end.driver
        .inject_text(text)
        .unwrap_or_else(|why| panic!("{why}"))
}

/// A machine with a mirror as its PLC, stepped: what it writes is read back in the same exchange. Exchanges
/// are 10 ms apart.
struct Stepped {
    end: End,
    ticks: i64,
}

impl Stepped {
    fn new(faults: &str) -> Self {
        Self::with(faults, "")
    }

    fn with(faults: &str, fieldbus: &str) -> Self {
        let text = format!(
            "[driver]\nid = 1\nname = \"stepped\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
             scan = \"10ms\"\nmode = \"stepped\"\nmax_age = \"300ms\"\n{fieldbus}\n\
             [[signal]]\nname = \"sensor\"\naddress = \"%IX0.0\"\nlatch = \"rising\"\n\
             [[signal]]\nname = \"position\"\naddress = \"%IW2\"\ntype = \"INT\"\nunit = \"mm\"\n\
             [[signal]]\nname = \"run\"\naddress = \"%QX0.0\"\nlatch = \"rising\"\n\
             [[signal]]\nname = \"speed\"\naddress = \"%QW2\"\ntype = \"INT\"\nfail_safe = -1\n{faults}"
        );
        Self {
            end: End::open(&text, &Manual::new(), &tickbus::KINDS),
            ticks: 0,
        }
    }

    fn tick(&mut self) -> Code {
        let time = Nanos::from_millis(10 * self.ticks);
        self.ticks += 1;
        self.end.driver.exchange(time, &mut self.end.slots).code
    }

    /// Ticks while the position counts the ticks; returns the values that came back.
    fn count(&mut self, ticks: usize) -> Vec<f64> {
        let one = |_| {
            let position = f64::from(i32::try_from(self.ticks).expect("few"));
            self.end.set("position", position);
            self.tick();
            self.end.get("speed")
        };
        (0..ticks).map(one).collect()
    }
}

#[test]
fn sections_of_a_driver_cfg_begin_and_end_by_time_tick_and_condition() {
    let mut bus = Stepped::new(
        "[[fault]]\nkind = \"stuck\"\nsignal = \"position\"\nvalue = \"50 mm\"\nat = \"20ms\"\nfor = \"30ms\"\n\
         [[fault]]\nkind = \"offset\"\nsignal = \"speed\"\nby = 100\ntick = 8\nticks = 2\n\
         [[fault]]\nkind = \"invert\"\nsignal = \"run\"\nwhile = \"position >= 12\"\n",
    );
    assert_eq!(
        bus.count(12),
        [
            0.0, 1.0, 50.0, 50.0, 50.0, 5.0, 6.0, 107.0, 108.0, 9.0, 10.0, 11.0
        ]
    );
    assert_eq!(bus.end.get("run"), 0.0);
    bus.count(1);
    assert_eq!(bus.end.get("run"), 1.0);
    assert_eq!(bus.end.statistic("fault.active"), "invert run");
    assert_eq!(bus.end.statistic("fault.begun"), "3");
    let phases: Vec<Phase> = bus
        .end
        .driver
        .injected_faults()
        .iter()
        .map(|f| f.phase)
        .collect();
    assert_eq!(phases, [Phase::Over, Phase::Over, Phase::Active]);
}

#[test]
fn faults_are_right_in_both_halves_of_a_tick() {
    let mut bus = Stepped::new(
        "[[fault]]\nkind = \"stuck\"\nsignal = \"position\"\nvalue = \"50 mm\"\ntick = 3\nticks = 2\n\
         [[fault]]\nkind = \"offset\"\nsignal = \"speed\"\nby = 100\ntick = 6\nticks = 2\n",
    );
    let mut seen = Vec::new();
    for tick in 0..9_i32 {
        let end = &mut bus.end;
        let time = Nanos::from_millis(10 * i64::from(tick));
        end.driver.receive(time, &mut end.slots);
        seen.push(end.get("speed"));
        end.set("position", f64::from(tick + 1));
        end.send();
        assert_eq!(
            end.get("position"),
            f64::from(tick + 1),
            "the simulation keeps its own value"
        );
    }
    // The value sent in tick n is read in tick n + 1: wrong if bent when sent, or when read.
    assert_eq!(seen, [0.0, 1.0, 2.0, 50.0, 50.0, 105.0, 106.0, 7.0, 8.0]);
}

#[test]
fn without_simulation_time_the_clock_of_a_free_bus_counts() {
    let (link, clock) = (Link::new(), Manual::new());
    clock.advance(Nanos::from_secs(5));
    let faults = "[[fault]]\nkind = \"stuck\"\nsignal = \"speed\"\nvalue = 9\nat = \"2s\"\n";
    let mut end = End::open(
        &(config(&link, "device", "") + faults),
        &clock,
        &tickbus::KINDS,
    );
    end.tick();
    clock.advance(Nanos::from_millis(1999));
    end.tick();
    assert_eq!(end.get("speed"), -1.0);
    clock.advance(Nanos::from_millis(1));
    end.tick();
    assert_eq!(end.get("speed"), 9.0);
}

#[test]
fn a_cable_that_is_pulled_makes_the_data_stale_and_comes_back_true_stepped() {
    let mut bus =
        Stepped::new("[[fault]]\nkind = \"link-down\"\nname = \"cable\"\ntick = 4\nfor = \"2s\"\n");
    assert_eq!(bus.count(4), [0.0, 1.0, 2.0, 2.0]);
    let link = bus.end.link();
    assert_eq!(
        (link.state, link.cause),
        (LinkState::Failed, Cause::Injected)
    );
    assert_eq!(
        link.reason,
        "the link is down by injected fault: \"cable\" (link-down)"
    );
    bus.end.set("sensor", 1.0);
    bus.tick();
    bus.end.set("sensor", 0.0);
    bus.count(100);
    assert_eq!(bus.tick(), Code::Stale);
    assert_eq!(bus.end.get("speed"), -1.0);
    let before = bus.end.statistic("plc.rises.sensor");
    assert_eq!(before, "0", "the PLC sees nothing of it");
    bus.count(97);
    assert_eq!(bus.count(1), [203.0], "true at the first exchange");
    assert_eq!(bus.end.link().state, LinkState::Running);
    assert_eq!(bus.end.statistic("state"), "running");
    bus.count(2);
    assert_eq!(
        bus.end.statistic("plc.rises.sensor"),
        "1",
        "what was never sent is sent now"
    );
}

#[test]
fn a_line_that_was_in_trouble_when_its_cable_was_pulled_runs_for_its_own_reason_afterwards() {
    let mut bus = Stepped::with("", "alive = { signal = \"speed\", within = \"50ms\" }");
    bus.count(3);
    let running = bus.end.link();
    assert_eq!(running.state, LinkState::Running);
    (0..10).for_each(|_| {
        bus.tick();
    });
    assert_eq!(bus.end.link().cause, Cause::Frozen);
    let cable = inject(&mut bus.end, DOWN);
    bus.tick();
    assert_eq!(bus.end.link().cause, Cause::Injected);
    assert!(bus.end.driver.end_fault(cable));
    bus.count(5);
    let link = bus.end.link();
    assert_eq!(
        (link.state, link.reason),
        (LinkState::Running, running.reason)
    );
}

/// Disconnects a running line, waits until both ends have noticed, and reconnects it.
fn pulls_the_cable(bus: &impl Bus) {
    let mut rig = Rig::new(bus);
    rig.connect();
    let cable = inject(&mut rig.device, DOWN);
    rig.until("both ends are stale", |rig| {
        let device = rig.device.tick().code == Code::Stale;
        rig.controller.tick().code == Code::Stale && device
    });
    let link = rig.device.link();
    assert_eq!(
        (link.state, link.cause),
        (LinkState::Failed, Cause::Injected)
    );
    assert!(link.reason.contains("\"cable\""), "{}", link.reason);
    assert_eq!(rig.device.get("speed"), -1.0);
    rig.controller.set("speed", 12.0);
    assert!(rig.device.driver.end_fault(cable));
    rig.until("true values arrive", |rig| {
        rig.controller.tick();
        rig.device.tick();
        rig.device.get("speed") == 12.0
    });
    rig.until("the line runs", |rig| {
        rig.controller.tick();
        rig.device.tick();
        rig.device.link().state == LinkState::Running
    });
}

#[test]
fn a_cable_that_is_pulled_is_noticed_at_both_ends_of_a_link() {
    pulls_the_cable(&Link::new());
}

#[test]
fn a_cable_that_is_pulled_is_noticed_at_both_ends_of_a_socket() {
    pulls_the_cable(&Tcp::new());
}

/// Delayed data arrive in order, complete, and with all pulses.
fn delays(bus: &impl Bus, kind: &str, at_device: bool) {
    let mut rig = Rig::new(bus);
    rig.connect();
    let text = format!("kind = \"{kind}\"\nby = \"50ms\"");
    let end = if at_device {
        &mut rig.device
    } else {
        &mut rig.controller
    };
    let id = inject(end, &text);
    rig.device.tick();
    rig.controller.tick();
    rig.until("the fault is active", |rig| {
        rig.device.tick();
        let end = if at_device {
            &rig.device
        } else {
            &rig.controller
        };
        end.statistic("fault.active") == kind
    });
    // Until the bus has noticed as well.
    for _ in 0..5 {
        pass(&rig.clock, 2);
        rig.device.tick();
    }
    let begun = rig.clock_now();
    rig.controller.set("speed", 1.0);
    rig.controller.set("run", 1.0);
    rig.controller.tick();
    pass(&rig.clock, 2);
    rig.controller.set("run", 0.0);
    rig.controller.tick();
    let mut edges = 0.0;
    let mut came = None;
    rig.until("the pulse is through", |rig| {
        rig.device.tick();
        rig.controller.tick();
        edges += rig.device.edges("run");
        if rig.device.get("speed") == 1.0 {
            came.get_or_insert(rig.clock_now());
        }
        edges > 0.0 && rig.device.get("run") == 0.0
    });
    assert_eq!(edges, 1.0);
    let late = came.expect("it came") - begun;
    assert!(late >= Nanos::from_millis(50), "{late}");
    // The fault ends while data are in transit.
    rig.controller.set("speed", 2.0);
    rig.controller.set("run", 1.0);
    rig.controller.tick();
    pass(&rig.clock, 2);
    rig.controller.set("run", 0.0);
    rig.controller.tick();
    pass(&rig.clock, 2);
    let end = if at_device {
        &mut rig.device
    } else {
        &mut rig.controller
    };
    assert!(end.driver.end_fault(id));
    rig.until("all is through", |rig| {
        rig.device.tick();
        rig.controller.tick();
        edges += rig.device.edges("run");
        edges > 1.0 && rig.device.get("speed") == 2.0 && rig.device.get("run") == 0.0
    });
    assert_eq!(edges, 2.0);
}

trait Now {
    fn clock_now(&self) -> Nanos;
}

impl Now for Rig {
    fn clock_now(&self) -> Nanos {
        use tickbus::time::Clock as _;
        self.clock.now()
    }
}

#[test]
fn a_late_link_keeps_every_pulse() {
    delays(&Link::new(), "delay", true);
}

#[test]
fn a_late_socket_keeps_every_pulse() {
    delays(&Tcp::new(), "delay", true);
}

#[test]
fn late_values_over_a_link_keep_every_pulse() {
    delays(&Link::new(), "values-late", false);
}

#[test]
fn late_values_over_a_socket_keep_every_pulse() {
    delays(&Tcp::new(), "values-late", false);
}

#[test]
fn a_delay_counts_ticks_of_a_stepped_bus() {
    let mut bus = Stepped::new("[[fault]]\nkind = \"delay\"\nby = \"30ms\"\ntick = 3\nticks = 4\n");
    // The frames of ticks 3 to 6 arrive 3 ticks late; when the fault ends, all remaining ones arrive at once.
    assert_eq!(bus.count(9), [0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 6.0, 7.0, 8.0]);
    let mut bus =
        Stepped::new("[[fault]]\nkind = \"values-late\"\nby = \"20ms\"\ntick = 3\nticks = 4\n");
    assert_eq!(bus.count(9), [0.0, 1.0, 1.0, 1.0, 2.0, 3.0, 6.0, 7.0, 8.0]);
}

#[test]
fn a_kind_is_still_read_by_its_former_name_and_logged_once() {
    logged::expect("\"slow-answers\" is called \"values-late\" now");
    for _ in 0..2 {
        let mut bus = Stepped::new(
            "[[fault]]\nkind = \"slow-answers\"\nby = \"20ms\"\ntick = 3\nticks = 4\n",
        );
        assert_eq!(bus.count(9), [0.0, 1.0, 1.0, 1.0, 2.0, 3.0, 6.0, 7.0, 8.0]);
    }
}

#[test]
fn lost_frames_are_lost_with_their_pulses_and_the_same_seed_loses_the_same() {
    let run = |seed: u32| {
        let mut bus = Stepped::new(&format!(
            "[[fault]]\nkind = \"drop\"\nchance = 0.5\ndirection = \"out\"\nseed = {seed}\n"
        ));
        let mut seen = String::new();
        for tick in 0..200 {
            bus.end.set("sensor", f64::from(tick % 2));
            bus.tick();
            seen.push(if bus.end.get("run") == 1.0 { '1' } else { '0' });
        }
        let dropped: u32 = bus
            .end
            .statistic("fault.dropped")
            .parse()
            .expect("a number");
        assert!((60..140).contains(&dropped), "{dropped}");
        let rises: u32 = bus
            .end
            .statistic("plc.rises.sensor")
            .parse()
            .expect("a number");
        assert!(rises < 90, "{rises} of 100 pulses came through");
        seen
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_cycle_that_comes_twice_counts_twice_and_changes_nothing() {
    let mut bus =
        Stepped::new("[[fault]]\nkind = \"duplicate\"\ndirection = \"in\"\ntick = 3\nticks = 2\n");
    assert_eq!(bus.count(5), [0.0, 1.0, 2.0, 3.0, 4.0]);
    assert_eq!(bus.end.statistic("bus_cycles"), "7");
    assert_eq!(bus.end.statistic("fault.duplicated"), "2");
}

#[test]
fn a_lost_cycle_is_decided_on_once_whatever_else_is_injected() {
    let mut bus = Stepped::new(
        "[[fault]]\nkind = \"duplicate\"\ndirection = \"out\"\ntick = 1\nticks = 10\n\
         [[fault]]\nkind = \"drop\"\nchance = 1\ndirection = \"out\"\ntick = 1\nticks = 10\n",
    );
    bus.count(20);
    let numbers = ["fault.dropped", "fault.duplicated"].map(|key| bus.end.statistic(key));
    assert_eq!(numbers, ["10", "10"]);
}

#[test]
fn a_hosted_program_gets_wrong_inputs_and_its_outputs_arrive_wrong() {
    let (link, clock) = (Link::new(), Manual::new());
    let mut device = End::open(&config(&link, "device", ""), &clock, &tickbus::KINDS);
    let faults = "[[fault]]\nkind = \"offset\"\nsignal = \"position\"\nby = 1000\n\
                  [[fault]]\nkind = \"stuck\"\nsignal = \"run\"\nvalue = true\n";
    let text = config(&link, "controller", "") + faults;
    let config =
        Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let scan = Nanos::from_millis(1);
    let _logged = logged::Watch::new();
    let host = Host::open(&config, Box::new(Mirror), scan, Arc::clone(&clock) as _).expect("opens");
    device.set("position", 5.0);
    await_that("the answer comes", || {
        pass(&clock, 3);
        device.tick();
        device.get("speed") == 1005.0 && device.get("run") == 1.0
    });
    let statistics = host.statistics();
    assert!(
        statistics.contains("\nfault.active=offset position, stuck run\n"),
        "{statistics}"
    );
    host.close();
}

#[test]
fn a_file_for_both_ends_has_the_faults_of_the_machine() {
    use tickbus::driver_cfg::CommandLineEnd;
    use tickbus::fieldbus::Role;

    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("driver.cfg");
    let faults = directory.path().join("faults.toml");
    std::fs::write(
        &path,
        "[driver]\nid = 1\nname = \"x\"\nfaults = \"faults.toml\"\n[fieldbus]\nkind = \"socket\"\n\
         [[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n\
         [[fault]]\nkind = \"link-down\"\nat = \"1s\"\nfor = \"2s\"\n",
    )
    .expect("written");
    let load = |role: Option<Role>| {
        let asked = role.map(|role| CommandLineEnd { role, moved: false });
        Config::load_as(&path, asked, &tickbus::KINDS).map(|config| config.faults.len())
    };
    let missing = load(None).expect_err("no such file").to_string();
    assert!(
        missing.contains("faults.toml: there is no such file"),
        "{missing}"
    );
    std::fs::write(&faults, "[[fault]]\nkind = \"invert\"\nsignal = \"b\"\n").expect("written");
    let wrong = load(None).expect_err("no such signal").to_string();
    assert!(
        wrong.ends_with("faults.toml:3:10: there is no signal \"b\"; signals are a"),
        "{wrong}"
    );
    std::fs::write(&faults, "[[fault]]\nkind = \"invert\"\nsignal = \"a\"\n").expect("written");
    for (role, count) in [
        (None, 2),
        (Some(Role::Device), 2),
        (Some(Role::Controller), 0),
    ] {
        assert_eq!(load(role).expect("right"), count, "{role:?}");
    }
}

/// The same faults give the same run, bit for bit.
#[test]
fn a_stepped_run_with_every_fault_repeats_itself() {
    let run = || {
        let mut faults = String::new();
        for (kind, keys) in [
            ("noise", "signal = \"position\"\namplitude = 20"),
            ("noise", "signal = \"sensor\"\nchance = 0.2"),
            ("drop", "chance = 0.1"),
            ("duplicate", "chance = 0.1"),
            ("delay", "by = \"25ms\"\nat = \"1s\"\nfor = \"500ms\""),
            (
                "values-late",
                "by = \"35ms\"\nat = \"1200ms\"\nfor = \"500ms\"",
            ),
            ("link-down", "when = \"run\"\ntimes = 20\nticks = 3"),
        ] {
            let _ = write!(faults, "[[fault]]\nkind = \"{kind}\"\n{keys}\n");
        }
        let mut bus = Stepped::new(&faults);
        let mut seen = Vec::new();
        for tick in 0..400 {
            bus.end.set("sensor", f64::from(tick / 7 % 2));
            seen.push((bus.count(1)[0], bus.end.get("run"), bus.end.edges("run")));
        }
        let statistics = bus.end.driver.statistics();
        let faults: Vec<String> = statistics
            .lines()
            .filter(|line| line.starts_with("fault.") || line.starts_with("plc.rises"))
            .map(str::to_owned)
            .collect();
        (seen, faults)
    };
    let (one, two) = (run(), run());
    assert_eq!(one, two);
    assert!(
        one.1.iter().any(|line| line == "fault.begun=26"),
        "{:?}",
        one.1
    );
}

#[test]
fn constants_of_the_suite_are_what_these_tests_take_them_for() {
    assert_eq!(
        (CYCLE, MAX_AGE),
        (Nanos::from_millis(1), Nanos::from_millis(300))
    );
}

#[test]
fn a_program_of_its_own_takes_faults_from_its_command_line() {
    use std::process::Command;

    let directory = tempfile::tempdir().expect("a directory");
    let write = |name: &str, text: &str| {
        let path = directory.path().join(name);
        std::fs::write(&path, text).expect("written");
        path
    };
    let port = Tcp::new().0;
    let config = write(
        "driver.cfg",
        &format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\n\
             address = \"127.0.0.1:{port}\"\n[[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n\
             [[signal]]\nname = \"b\"\naddress = \"%QX0.0\"\n"
        ),
    );
    let run = |faults: &std::path::Path| {
        let command = [
            "plc",
            "mirror",
            "--duration",
            "100ms",
            "--stats",
            "--config",
        ];
        let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(command)
            .arg(&config)
            .arg("--faults")
            .arg(faults)
            .output()
            .expect("the tickbus program runs");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        (
            output.status.code(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let right = write(
        "right.toml",
        "[[fault]]\nkind = \"stuck\"\nsignal = \"a\"\nvalue = true\n",
    );
    let (code, out, err) = run(&right);
    assert_eq!(code, Some(3), "nobody is at the other end: {out}\n{err}");
    assert!(out.contains("\nfault.active=stuck a\n"), "{out}");
    assert!(
        out.contains("\nplc.rises.b=1\n"),
        "the program sees it: {out}"
    );
    let told = "plc: fault \"stuck a\" is active (begun so far: 1): \"a\" is stuck at 1\n";
    assert!(out.contains(told), "{out}");
    let wrong = write(
        "wrong.toml",
        "[[fault]]\nkind = \"stuck\"\nsignal = \"c\"\n[x]\n",
    );
    let (code, out, err) = run(&wrong);
    assert_eq!((code, out.as_str()), (Some(1), ""), "{err}");
    assert!(
        err.contains("wrong.toml:3:10: there is no signal \"c\"; signals are a, b\n"),
        "{err}"
    );
    assert!(
        err.contains("wrong.toml:4:2: unknown key \"x\" in the file"),
        "{err}"
    );
    assert!(err.ends_with("plc: failed mistakes=2\n"), "{err}");
}
