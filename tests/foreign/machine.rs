//! The machine in front of a program that somebody else wrote: a driver with its signals by name.

use std::io::Read;
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Clock, Monotonic, Nanos};
use tickbus_test_log as logged;

use super::recorder::Recorder;

/// Programs that start slowly, such as a JVM on a busy machine, are waited for so long.
const PATIENCE: Duration = Duration::from_secs(60);

/// An open driver.
pub struct Machine {
    pub driver: Driver,
    pub slots: Vec<Slot>,
    text: String,
    recorder: Option<Recorder>,
    _logged: logged::Watch,
}

impl Machine {
    /// Opens the driver of a driver.cfg, in real time.
    #[track_caller]
    pub fn open(text: &str) -> Self {
        Self::open_on(Monotonic::shared(), text)
    }

    #[track_caller]
    pub fn open_on<C: Clock + 'static>(clock: Arc<C>, text: &str) -> Self {
        let config = Config::parse("driver.cfg", text).unwrap_or_else(|why| panic!("{why}"));
        let logged = logged::Watch::new();
        let driver = Driver::open(config, clock as _).expect("opens");
        let slots = driver.initial_slots();
        Self {
            driver,
            slots,
            text: text.to_owned(),
            recorder: None,
            _logged: logged,
        }
    }

    #[track_caller]
    fn index(&self, name: &str) -> usize {
        let found = self.driver.config().table.position(name);
        found.unwrap_or_else(|| panic!("no signal {name}"))
    }

    #[track_caller]
    pub fn get(&self, name: &str) -> f64 {
        self.slots[self.index(name)].real()
    }

    #[track_caller]
    pub fn set(&mut self, name: &str, value: f64) {
        let index = self.index(name);
        self.slots[index] = Slot::from_real(value);
    }

    pub fn tick(&mut self) {
        self.driver.exchange(Nanos::ZERO, &mut self.slots);
        if let Some(recorder) = &self.recorder {
            recorder.ticked(&self.slots);
        }
    }

    /// Ticks until `done` gives something.
    #[track_caller]
    pub fn until_some<T>(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> Option<T>) -> T {
        let limit = Instant::now() + PATIENCE;
        loop {
            self.tick();
            if let Some(found) = done(self) {
                return found;
            }
            assert!(
                Instant::now() < limit,
                "waited in vain until {what}\n{}",
                self.driver.statistics()
            );
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Ticks until `done` holds.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        self.until_some(what, |machine| done(machine).then_some(()));
    }

    pub fn statistic(&self, key: &str) -> Option<String> {
        let text = self.driver.statistics();
        let mut lines = text.lines();
        lines.find_map(|line| line.strip_prefix(&format!("{key}=")).map(str::to_owned))
    }

    /// Where it listens.
    #[track_caller]
    pub fn address(&mut self) -> SocketAddr {
        self.until_some("it listens", |machine| {
            let address = machine.statistic("address")?;
            Some(address.parse().expect("an address"))
        })
    }

    /// Where a foreign client finds it: where it listens, or a tap before that which takes down the session `name`
    /// with `client`, where sessions are recorded.
    #[track_caller]
    pub fn address_for(&mut self, name: &str, client: &str) -> SocketAddr {
        let server = self.address();
        let Some(folder) = Recorder::folder() else {
            return server;
        };
        let (recorder, address) = Recorder::before(server, &folder, name, client, self);
        self.recorder = Some(recorder);
        address
    }

    /// The driver.cfg that it was opened with.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Runs a program to its end, which has to be a good one, with `step` again and again meanwhile; gives what it
    /// printed.
    #[track_caller]
    pub fn until_the_end_of(&mut self, mut command: Command, step: impl Fn(&mut Self)) -> String {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        let limit = Instant::now() + PATIENCE;
        let status = loop {
            if let Some(status) = child.try_wait().expect("it is ours") {
                break status;
            }
            if Instant::now() > limit {
                let _ = child.kill();
            }
            step(self);
            std::thread::sleep(Duration::from_millis(1));
        };
        let mut told = String::new();
        let (out, errors) = (child.stdout.take(), child.stderr.take());
        let _ = out.expect("a pipe").read_to_string(&mut told);
        let _ = errors.expect("a pipe").read_to_string(&mut told);
        assert!(
            status.success(),
            "{status}: {told}\n{}",
            self.driver.statistics()
        );
        told
    }
}
