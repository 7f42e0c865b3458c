//! Records the sessions of foreign clients with our servers, for tests/sessions to replay.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

use tickbus::signal::Slot;

use super::machine::Machine;
use super::pcap::{From, Heard, listen_before};
use super::session::{Session, Step};

/// The variable that names the folder for sessions.
const VARIABLE: &str = "TICKBUS_RECORD_SESSIONS";

/// After this many ticks the machine has finished the turn in which a request came, and has made another one: it has
/// seen everything that was written before, and has answered. So an answer does not depend on the speed of either side.
const TICKS: u64 = 4;

/// A recorder; the session is written when it is dropped, unless the test has failed.
pub struct Recorder {
    file: PathBuf,
    client: String,
    config: String,
    heard: Arc<Shared>,
}

/// The data that the threads of the tap and the machine write.
struct Shared {
    notes: Mutex<Notes>,
    ticked: Condvar,
}

struct Notes {
    steps: Vec<Step>,
    /// The name of each signal, true if the simulation sets it, its last value, and the last recorded value.
    signals: Vec<(String, bool, f64, f64)>,
    ticks: u64,
}

impl Recorder {
    /// The folder for sessions, if they are wanted.
    pub fn folder() -> Option<PathBuf> {
        std::env::var_os(VARIABLE).map(PathBuf::from)
    }

    /// Creates a tap in front of a server of `machine`; also returns the address for clients.
    pub fn before(
        server: SocketAddr,
        folder: &Path,
        name: &str,
        client: &str,
        machine: &Machine,
    ) -> (Self, SocketAddr) {
        let config = machine.driver.config();
        let (own, _) = config.role.areas();
        let signals = config
            .table
            .signals
            .iter()
            .zip(machine.driver.initial_slots());
        let signals = signals.map(|(signal, slot)| {
            let value = slot.real();
            (signal.name.clone(), signal.area == own, value, value)
        });
        let heard = Arc::new(Shared {
            notes: Mutex::new(Notes {
                steps: Vec::new(),
                signals: signals.collect(),
                ticks: 0,
            }),
            ticked: Condvar::new(),
        });
        let notes = Arc::clone(&heard);
        let address = listen_before(server, move |connection, it| match it {
            Heard::Said(From::Client, bytes) => {
                let mut notes = notes.lock_after_ticks();
                notes.look();
                notes.hear(connection, From::Client, bytes);
            }
            Heard::Said(From::Server, bytes) => {
                let mut notes = notes.lock();
                notes.hear(connection, From::Server, bytes);
            }
            Heard::Left => {
                let mut notes = notes.lock();
                notes.steps.push(Step::Leaves(connection));
            }
        });
        let recorder = Self {
            file: folder.join(format!("{name}.session")),
            client: client.to_owned(),
            config: machine.text().to_owned(),
            heard,
        };
        (recorder, address)
    }

    /// The machine has ticked, with these values.
    pub fn ticked(&self, slots: &[Slot]) {
        let mut notes = self.heard.lock();
        notes.ticks += 1;
        for ((_, _, value, _), slot) in notes.signals.iter_mut().zip(slots) {
            *value = slot.real();
        }
        self.heard.ticked.notify_all();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Notes> {
        self.notes.lock().expect("nobody panics")
    }

    /// Waits until the machine has ticked often enough; not forever, since it may have been closed.
    fn lock_after_ticks(&self) -> MutexGuard<'_, Notes> {
        let notes = self.lock();
        let enough = notes.ticks + TICKS;
        let limit = Duration::from_secs(2);
        let waited = self
            .ticked
            .wait_timeout_while(notes, limit, |notes| notes.ticks < enough);
        waited.expect("nobody panics").0
    }
}

impl Notes {
    /// Records the changes at the machine.
    fn look(&mut self) {
        for (name, is_own, value, taken) in &mut self.signals {
            if value.to_bits() != taken.to_bits() {
                *taken = *value;
                let name = name.clone();
                self.steps.push(if *is_own {
                    Step::Set(name, *value)
                } else {
                    Step::Sees(name, *value)
                });
            }
        }
    }

    fn hear(&mut self, connection: usize, from: From, bytes: &[u8]) {
        let bytes = bytes.iter().copied().map(Some);
        // TCP may cut a telegram.
        if let Some(Step::Said(last, who, said)) = self.steps.last_mut()
            && (*last, *who) == (connection, from)
        {
            said.extend(bytes);
        } else {
            let step = Step::Said(connection, from, bytes.collect());
            self.steps.push(step);
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if std::thread::panicking() {
            return;
        }
        let mut notes = self.heard.lock();
        notes.look();
        let mut steps = std::mem::take(&mut notes.steps);
        for step in &mut steps {
            if let Step::Said(_, From::Server, bytes) = step {
                mask_s7(bytes);
            }
        }
        let session = Session {
            client: self.client.clone(),
            config: self.config.clone(),
            steps,
        };
        std::fs::write(&self.file, session.to_string())
            .unwrap_or_else(|why| panic!("{}: {why}", self.file.display()));
    }
}

/// Masks the bytes of S7 answers that differ from time to time: the clock, and the version of this program.
fn mask_s7(bytes: &mut [Option<u8>]) {
    let mut telegrams = bytes;
    // Each telegram begins with four bytes, which end with its length.
    while let [Some(3), Some(0), Some(high), Some(low), ..] = telegrams {
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        let Some((telegram, rest)) = telegrams.split_at_mut_checked(length.max(4)) else {
            break;
        };
        mask_telegram(telegram);
        telegrams = rest;
    }
}

fn mask_telegram(telegram: &mut [Option<u8>]) {
    /// Headers of TPKT, COTP and S7, parameters of an answer about the system, and the head of its data.
    const HEADERS: usize = 4 + 3 + 10 + 12 + 4;
    const CLOCK: (u8, u8) = (0x87, 1);
    const STATUS_LISTS: (u8, u8) = (0x84, 1);
    if telegram.len() <= HEADERS || telegram[8] != Some(7) {
        return;
    }
    let (head, data) = telegram.split_at_mut(HEADERS);
    let at = |data: &[Option<u8>], index: usize| data.get(index).copied().flatten().unwrap_or(0);
    match (at(head, 22), at(head, 23)) {
        CLOCK => data.fill(None),
        STATUS_LISTS => match (at(data, 0), at(data, 1)) {
            // The state of the CPU ends with the clock.
            (0x04, 0x24) => {
                let clock = data.len().saturating_sub(8);
                data[clock..].fill(None);
            }
            // Versions: record 7 has 20 bytes of text and two of nothing before a V.
            (0x00 | 0x01, 0x11) => {
                for record in data[8..].chunks_mut(28) {
                    if (at(record, 1), at(record, 24)) == (7, b'V') {
                        record[25..].fill(None);
                    }
                }
            }
            _ => {}
        },
        _ => {}
    }
}
