//! The fixture: a Device and a Controller at the two ends of a bus, sharing one manual clock.

pub use tickbus_test_log as logged;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tickbus_base::time::{Clock, Manual, Nanos};
use tickbus_driver::{Code, Driver, Exchange};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::Link;
use tickbus_image::signal::Slot;

/// The signals at both ends; `{fieldbus}` is replaced by the bus's own table.
pub const SIGNALS: &str = r#"
[[signal]]
name    = "run"
address = "%QX0.0"
latch   = "rising"

[[signal]]
name      = "speed"
address   = "%QW2"
type      = "INT"
fail_safe = -1

[[signal]]
name      = "echo"
address   = "%QW4"
type      = "INT"

[[signal]]
name    = "sensor"
address = "%IX0.0"
latch   = "rising"

[[signal]]
name      = "position"
address   = "%IW2"
type      = "INT"
fail_safe = 77

[[signal]]
name      = "copy"
address   = "%IW4"
type      = "INT"
"#;

/// One open driver, with its slots by name.
pub struct End {
    pub driver: Driver,
    pub slots: Vec<Slot>,
    /// Checks the log when the driver is closed.
    pub logged: logged::Watch,
}

impl End {
    /// Opens the driver of a driver.cfg with this text, which may name only these `kinds` of bus.
    pub fn open<C: Clock + 'static>(text: &str, clock: &Arc<C>, kinds: &'static Kinds) -> Self {
        let config = Config::parse("driver.cfg", text, kinds).unwrap_or_else(|why| panic!("{why}"));
        Self::of(config, clock)
    }

    /// As [`open`](Self::open), for a driver.cfg that was read already.
    pub fn of<C: Clock + 'static>(config: Config, clock: &Arc<C>) -> Self {
        let logged = logged::Watch::new();
        let driver = Driver::open(config, Arc::clone(clock) as _).expect("opens");
        let slots = driver.initial_slots();
        Self {
            driver,
            slots,
            logged,
        }
    }

    fn index(&self, name: &str) -> usize {
        let signals = &self.driver.config().table.signals;
        let found = signals.iter().position(|signal| signal.name == name);
        found.unwrap_or_else(|| panic!("no signal {name}"))
    }

    #[track_caller]
    pub fn set(&mut self, name: &str, value: f64) {
        let index = self.index(name);
        self.slots[index] = Slot::from_real(value);
    }

    #[track_caller]
    pub fn get(&self, name: &str) -> f64 {
        self.slots[self.index(name)].real()
    }

    #[track_caller]
    pub fn edges(&self, name: &str) -> f64 {
        let slot = self.driver.slots().edges[self.index(name)].expect("a latched signal read here");
        self.slots[slot].real()
    }

    pub fn tick(&mut self) -> Exchange {
        self.driver.exchange(None, &mut self.slots)
    }

    /// The first half of a tick; a model may run before the second half.
    pub fn receive(&mut self) -> Exchange {
        self.driver.receive(None, &mut self.slots)
    }

    pub fn send(&mut self) -> Exchange {
        self.driver.send(&mut self.slots)
    }

    #[track_caller]
    pub fn statistic(&self, key: &str) -> String {
        let found = statistic(&self.driver, key);
        found.unwrap_or_else(|| panic!("no {key} in {}", self.driver.statistics()))
    }

    /// The address on which the driver listens.
    #[track_caller]
    pub fn address(&self) -> SocketAddr {
        address(&self.driver)
    }

    /// State, cause and reason of the line.
    pub fn link(&self) -> Link {
        self.driver.link()
    }
}

/// The value of `key` in the statistics of a driver.
pub fn statistic(driver: &Driver, key: &str) -> Option<String> {
    let text = driver.statistics();
    let mut lines = text.lines();
    lines.find_map(|line| line.strip_prefix(&format!("{key}=")).map(str::to_owned))
}

/// The address on which a driver listens; waits until it does.
#[track_caller]
pub fn address(driver: &Driver) -> SocketAddr {
    let address = eventually("it listens", || statistic(driver, "address"));
    address.parse().expect("an address")
}

/// A bus, with the data that the suite needs.
pub trait Bus {
    /// The kinds of bus that the driver.cfg may name: this kind.
    fn kinds(&self) -> &'static Kinds;

    /// The `[fieldbus]` table of the end with `role`, without `role` and timing.
    fn fieldbus(&self, role: &str) -> String;

    /// Starts a peer that violates the protocol, for a Device that is about to open.
    fn liar(&self, clock: &Arc<Manual>) -> Liar;

    /// Wrong `[fieldbus]` tables, each with a word of the error message.
    fn wrong(&self) -> Vec<(&'static str, &'static str)>;

    /// `[[fault]]` sections of both ends.
    fn faults(&self) -> &'static str {
        ""
    }
}

/// A peer that violates the protocol; dropping the value ends the peer.
pub struct Liar {
    pub peer: Box<dyn std::any::Any>,
    /// The cause that the Device reports, and words of the reason.
    pub cause: &'static str,
    pub words: &'static str,
}

pub struct Rig {
    pub clock: Arc<Manual>,
    pub device: End,
    pub controller: End,
}

/// The bus cycle of both ends.
pub const CYCLE: Nanos = Nanos::from_millis(1);
/// Data older than this are stale.
pub const MAX_AGE: Nanos = Nanos::from_millis(300);

pub fn config(bus: &impl Bus, role: &str, extra: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"{role}\"\n[fieldbus]\n{}\nrole = \"{role}\"\ncycle = \"1ms\"\n\
         max_age = \"300ms\"\nreconnect = [\"10ms\"]\n{extra}\n{SIGNALS}{}",
        bus.fieldbus(role),
        bus.faults(),
    )
}

impl Rig {
    pub fn new(bus: &impl Bus) -> Self {
        Self::with(bus, "")
    }

    /// A rig with further lines in the `[fieldbus]` table of both ends.
    pub fn with(bus: &impl Bus, extra: &str) -> Self {
        let clock = Manual::new();
        let device = End::open(&config(bus, "device", extra), &clock, bus.kinds());
        let controller = End::open(&config(bus, "controller", extra), &clock, bus.kinds());
        Self {
            clock,
            device,
            controller,
        }
    }

    /// A rig of a device that is open already, and a controller that connects to the device.
    #[track_caller]
    pub fn around(bus: &impl Bus, clock: Arc<Manual>, device: End) -> Self {
        let controller = End::open(&config(bus, "controller", ""), &clock, bus.kinds());
        let mut rig = Self {
            clock,
            device,
            controller,
        };
        rig.connect();
        rig
    }

    /// Closes the controller: the device is alone again.
    pub fn alone(self) -> (Arc<Manual>, End) {
        self.controller.driver.close();
        (self.clock, self.device)
    }

    /// Lets the controller send a speed, and lets cycles pass until the speed arrives.
    #[track_caller]
    pub fn send_speed(&mut self, speed: f64) {
        self.controller.set("speed", speed);
        self.until(&format!("the speed {speed} arrives"), |rig| {
            rig.controller.tick();
            rig.device.tick();
            rig.device.get("speed") == speed
        });
    }

    /// Lets cycles pass until `done` holds.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        let limit = Instant::now() + VAIN;
        loop {
            pass(&self.clock, 2);
            if done(self) {
                return;
            }
            assert!(
                Instant::now() < limit,
                "waited {VAIN:?} in vain until {what}; the controller:\n{}\nthe device:\n{}",
                self.controller.driver.statistics(),
                self.device.driver.statistics(),
            );
        }
    }

    /// Lets cycles pass until both ends have fresh data.
    #[track_caller]
    pub fn connect(&mut self) {
        let (mut device, mut controller) = (false, false);
        self.until("both ends connect", |rig| {
            device |= rig.device.tick().code == Code::Fresh;
            controller |= rig.controller.tick().code == Code::Fresh;
            device && controller
        });
    }
}

/// Lets one bus cycle pass for `ends` ends that have a bus thread each. The clock waits for each thread, unless the
/// thread waits for something else.
pub fn pass(clock: &Manual, ends: usize) {
    clock.advance(CYCLE);
    let limit = Instant::now() + Duration::from_millis(20);
    let mut looks = Looks::default();
    while !clock.is_settled(ends) && Instant::now() < limit {
        looks.pause();
    }
}

/// The pauses between checks of another thread's progress: short at first; in a long wait they leave the processor to
/// the working threads.
#[derive(Debug, Default)]
pub struct Looks(u32);

impl Looks {
    /// Pauses after a check that found nothing.
    pub fn pause(&mut self) {
        self.0 += 1;
        if self.0 < 20 {
            std::thread::yield_now();
        } else {
            std::thread::sleep(Duration::from_micros(100));
        }
    }
}

/// The limit of a wait for something that takes milliseconds.
const VAIN: Duration = Duration::from_secs(20);

/// Polls until `done` holds, yielding the processor to the bus threads.
#[track_caller]
pub fn await_that(what: &str, mut done: impl FnMut() -> bool) {
    let limit = Instant::now() + VAIN;
    let mut looks = Looks::default();
    while !done() {
        assert!(
            Instant::now() < limit,
            "waited {VAIN:?} in vain until {what}"
        );
        looks.pause();
    }
}

/// How long [`patiently`] waits: a program may start slowly, such as a JVM on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Polls every millisecond until `done` returns a value or the time is up. For real time, and for actions of another
/// process that cause no event here.
pub fn patiently<T>(mut done: impl FnMut() -> Option<T>) -> Option<T> {
    let limit = Instant::now() + PATIENCE;
    loop {
        let found = done();
        if found.is_some() || Instant::now() > limit {
            return found;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// As [`patiently`], but panics with `what` when the time is up.
#[track_caller]
pub fn eventually<T>(what: &str, done: impl FnMut() -> Option<T>) -> T {
    patiently(done).unwrap_or_else(|| panic!("waited {PATIENCE:?} in vain until {what}"))
}
