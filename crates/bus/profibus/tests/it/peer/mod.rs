//! profirust, an independent DP master, on one end of a pseudo-terminal.

#[path = "../../../../../../tests/peers/dp_phy.rs"]
mod dp_phy;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use profirust::Baudrate;
use profirust::dp::{DiagnosticFlags, DpMaster, Peripheral, PeripheralEvent, PeripheralOptions};
use profirust::fdl::{FdlActiveStation, ParametersBuilder};
use profirust::time::{Duration, Instant};

use dp_phy::Pty;

/// The time for an answer in the master's project, in bits: a pseudo-terminal has no wire, and a busy machine needs time.
pub const SLOT: u16 = 6_000;

/// The settings of one station in the master's project.
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
    /// The master's address.
    pub address: u8,
    pub slot: u16,
    pub watchdog: Option<Duration>,
    pub slaves: Vec<Slave>,
}

/// The master's knowledge of one station.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    pub inputs: Vec<u8>,
    pub outputs: Vec<u8>,
    /// Data exchanges in total.
    pub exchanges: usize,
    /// Rising edges of the lowest bit of the inputs.
    pub edges: usize,
    pub events: Vec<PeripheralEvent>,
    /// The flags of the last diagnosis, and its extended part.
    pub diagnosis: (u16, Vec<u8>),
    /// How often the diagnosis was read.
    pub diagnoses: usize,
}

impl Seen {
    pub fn has(&self, event: PeripheralEvent) -> bool {
        self.events.contains(&event)
    }
}

/// A running master; dropping it ends it.
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
        let phy = Pty::open(end, project.baud).expect("the other end");
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

    /// The master's knowledge of its first station.
    pub fn first<R>(&self, look: impl FnOnce(&mut Seen) -> R) -> R {
        look(&mut self.all()[0])
    }

    pub fn all(&self) -> MutexGuard<'_, Vec<Seen>> {
        locked(&self.seen)
    }
}

/// The master's knowledge, even after an assertion about it has failed: the master must go on, and end with its test.
fn locked(seen: &Mutex<Vec<Seen>>) -> MutexGuard<'_, Vec<Seen>> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
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
    let mut parameters = ParametersBuilder::new(project.address, project.baud);
    parameters
        .slot_bits(project.slot)
        .max_retry_limit(3)
        .highest_station_address(4);
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
            let mut seen = locked(seen);
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
            // A diagnosis read during a restart is no event.
            if let Some(told) = slave.last_diagnostics() {
                let extended = told.extended_diagnostics.raw_diag_buffer();
                // profirust keeps the last diagnosis beyond its end.
                let is_there = told.flags.contains(DiagnosticFlags::EXT_DIAG);
                let extended = extended.filter(|_| is_there);
                seen.diagnosis = (told.flags.bits(), extended.unwrap_or_default().to_vec());
            }
            seen.diagnoses += usize::from(event == PeripheralEvent::Diagnostics);
            slave.pi_q_mut().copy_from_slice(&seen.outputs);
        }
        std::thread::sleep(std::time::Duration::from_micros(50));
    }
}
