//! profirust, a DP master that somebody else wrote, on one end of a pseudo-terminal.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::fs::{File, OpenOptions};
use std::io::{Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

use profirust::Baudrate;
use profirust::dp::{DpMaster, Peripheral, PeripheralEvent, PeripheralOptions};
use profirust::fdl::{FdlActiveStation, ParametersBuilder};
use profirust::phy::ProfibusPhy;
use profirust::time::{Duration, Instant};

/// The time for an answer in the master's project, in bits: a pseudo-terminal has no wire, and a busy machine needs time.
pub const SLOT: u16 = 6_000;

/// What the master's project says of one station.
#[derive(Clone, Debug)]
pub struct Slave {
    pub address: u8,
    pub ident: u16,
    pub parameters: &'static [u8],
    pub config: &'static [u8],
    pub inputs: usize,
    pub outputs: usize,
}

/// The master's project.
#[derive(Clone, Debug)]
pub struct Project {
    pub baud: Baudrate,
    pub slot: u16,
    pub watchdog: Option<Duration>,
    pub slaves: Vec<Slave>,
    /// Damages every so many telegrams, in either direction.
    pub damages: Option<usize>,
}

/// What the master knows of one station.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    pub inputs: Vec<u8>,
    pub outputs: Vec<u8>,
    /// Data exchanges, in all.
    pub exchanges: usize,
    /// Rising edges of the lowest bit of the inputs.
    pub edges: usize,
    pub events: Vec<PeripheralEvent>,
}

impl Seen {
    pub fn has(&self, event: PeripheralEvent) -> bool {
        self.events.contains(&event)
    }
}

/// A master that runs; dropping it ends it.
pub struct Master {
    seen: Arc<Mutex<Vec<Seen>>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Master {
    pub fn run(end: &Path, project: Project) -> Self {
        let seen = project.slaves.iter().map(|slave| Seen {
            outputs: vec![0; slave.outputs],
            ..Seen::default()
        });
        let seen = Arc::new(Mutex::new(seen.collect()));
        let over = Arc::new(AtomicBool::new(false));
        let phy = Pty::open(end, &project);
        let thread = std::thread::spawn({
            let (seen, over) = (Arc::clone(&seen), Arc::clone(&over));
            move || run(phy, &project, &seen, &over)
        });
        Self {
            seen,
            over,
            thread: Some(thread),
        }
    }

    /// What it knows of its first station.
    pub fn first<R>(&self, look: impl FnOnce(&mut Seen) -> R) -> R {
        look(&mut self.all()[0])
    }

    pub fn all(&self) -> MutexGuard<'_, Vec<Seen>> {
        self.seen.lock().expect("the master did not panic")
    }
}

impl Drop for Master {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the master did not panic");
        }
    }
}

fn run(mut phy: Pty, project: &Project, seen: &Mutex<Vec<Seen>>, over: &AtomicBool) {
    let mut dp = DpMaster::new(vec![]);
    let handles: Vec<_> = (project.slaves.iter())
        .map(|slave| {
            let options = PeripheralOptions {
                ident_number: slave.ident,
                user_parameters: Some(slave.parameters),
                config: Some(slave.config),
                max_tsdr: project.slot - 100,
                ..PeripheralOptions::default()
            };
            let (inputs, outputs) = (vec![0; slave.inputs], vec![0; slave.outputs]);
            let slave = Peripheral::new(slave.address, options, inputs, outputs);
            dp.add(slave.with_diag_buffer(vec![0; 64]))
        })
        .collect();
    let mut parameters = ParametersBuilder::new(2, project.baud);
    parameters
        .slot_bits(project.slot)
        .max_retry_limit(3)
        .highest_station_address(3);
    if let Some(time) = project.watchdog {
        parameters.watchdog_timeout(time);
    }
    let mut fdl = FdlActiveStation::new(parameters.build_verified(&dp));
    fdl.set_online();
    dp.enter_operate();
    while !over.load(Ordering::Relaxed) {
        fdl.poll(Instant::now(), &mut phy, &mut dp);
        let events = dp.take_last_events();
        if let Some((handle, event)) = events.peripheral {
            let index = handles.iter().position(|own| *own == handle);
            let mut seen = seen.lock().expect("no test has panicked with it");
            let seen = &mut seen[index.expect("one of them")];
            let slave = dp.get_mut(handle);
            if event == PeripheralEvent::DataExchanged {
                let was = seen.inputs.first().is_some_and(|byte| byte & 1 != 0);
                seen.inputs = slave.pi_i().to_vec();
                let is = seen.inputs.first().is_some_and(|byte| byte & 1 != 0);
                seen.edges += usize::from(is && !was);
                seen.exchanges += 1;
            } else {
                seen.events.push(event);
            }
            slave.pi_q_mut().copy_from_slice(&seen.outputs);
        }
        std::thread::sleep(std::time::Duration::from_micros(50));
    }
}

/// A pseudo-terminal as profirust wants it. It has to pretend that bytes take their time on the wire.
struct Pty {
    file: File,
    baud: Baudrate,
    inbox: Vec<u8>,
    busy_until: Instant,
    damages: Option<usize>,
    telegrams: usize,
}

impl Pty {
    fn open(end: &Path, project: &Project) -> Self {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(i32::try_from(rustix::fs::OFlags::NONBLOCK.bits()).expect("a flag"))
            .open(end)
            .expect("the other end");
        Self {
            file,
            baud: project.baud,
            inbox: Vec::new(),
            busy_until: Instant::ZERO,
            damages: project.damages,
            telegrams: 0,
        }
    }

    /// Flips a bit of every so many telegrams, or cuts the last octet off.
    fn damage(&mut self, bytes: &mut Vec<u8>) {
        self.telegrams += 1;
        let Some(each) = self.damages else { return };
        if self.telegrams.is_multiple_of(each) && bytes.len() > 3 {
            let which = self.telegrams / each;
            if which.is_multiple_of(3) {
                bytes.pop();
            } else {
                let bit = which % (8 * bytes.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
        }
    }
}

impl ProfibusPhy for Pty {
    fn poll_transmission(&mut self, now: Instant) -> bool {
        now < self.busy_until
    }

    fn transmit_data<F, R>(&mut self, now: Instant, fill: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        let (length, result) = fill(&mut buffer);
        if length > 0 {
            let mut bytes = buffer[..length].to_vec();
            self.damage(&mut bytes);
            self.file.write_all(&bytes).expect("a short telegram");
            let bits = u32::try_from(11 * length).expect("a short telegram");
            self.busy_until = now + self.baud.bits_to_time(bits);
        }
        result
    }

    fn receive_data<F, R>(&mut self, _now: Instant, take: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        if let Ok(count) = self.file.read(&mut buffer) {
            let mut bytes = buffer[..count].to_vec();
            if count > 0 {
                self.damage(&mut bytes);
            }
            self.inbox.extend(bytes);
        }
        let (taken, result) = take(&self.inbox);
        self.inbox.drain(..taken);
        result
    }
}
