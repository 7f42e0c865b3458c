//! An example of a bus: `kind = "mailbox"` carries the image in two files of a folder, one for each end.
//!
//! The example shows how little a bus needs: a [frame](Frame) without I/O, the [options](Options) from a driver.cfg,
//! and the thread that carries frames between the port and the line. `src/main.rs` adds the bus to the `tickbus`
//! command; nothing in tickbus knows it. `CONTRIBUTING.md` describes how to add a bus.

mod frame;
mod options;

use std::path::{Path, PathBuf};
use std::{fs, io};

use tickbus_base::time::{Nanos, Pace, Stop};
use tickbus_fieldbus::{BusError, Free, Port, Receipt, Role};

pub use frame::{Frame, NoFrame};
pub use options::Options;

/// The bus: one end of the pair of files.
#[derive(Debug)]
pub struct Mailbox {
    own: PathBuf,
    peers: PathBuf,
    cycle: Nanos,
}

impl Mailbox {
    fn new(folder: &Path, role: Role, cycle: Nanos) -> Self {
        let (writes, reads) = match role {
            Role::Device | Role::Observer => ("inputs", "outputs"),
            Role::Controller => ("outputs", "inputs"),
        };
        Self {
            own: folder.join(writes),
            peers: folder.join(reads),
            cycle,
        }
    }

    /// Replaces its own file atomically, so that the peer never reads half of one.
    fn write(&self, frame: &Frame) -> Result<(), BusError> {
        let beside = self.own.with_extension("new");
        fs::write(&beside, frame.bytes())
            .and_then(|()| fs::rename(&beside, &self.own))
            .map_err(|error| failed("write", &self.own, &error))
    }

    fn read(&self) -> Result<Option<Vec<u8>>, BusError> {
        match fs::read(&self.peers) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed("read", &self.peers, &error)),
        }
    }

    /// Returns the last sequence of an end that was killed. Its successor continues from there; otherwise the peer
    /// could not tell new frames from those that it has seen.
    fn left_behind(&self, image: usize) -> u64 {
        let frame = fs::read(&self.own)
            .ok()
            .map(|bytes| Frame::parse(&bytes, image));
        frame.and_then(Result::ok).map_or(0, |frame| frame.sequence)
    }

    fn serve(&self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        port.opening("waiting for the peer's file");
        let sizes: Vec<(usize, usize)> = (0..port.stations()).map(|n| port.sizes(n)).collect();
        let receives = sizes.iter().map(|(_, rx)| rx).sum();
        let sends = sizes.iter().map(|(tx, _)| tx).sum();
        let mut own = Frame {
            sequence: self.left_behind(sends),
            ..Frame::default()
        };
        // Confirms the frames that the peer has not confirmed yet.
        let mut receipt = None;
        let mut pace = Pace::new(port.clock().now(), self.cycle);
        while !stop.is_stopped() {
            let now = port.clock().now();
            if !pace.take(now) {
                port.observe(now);
            } else if port.is_up(now) {
                match self.read()? {
                    Some(bytes) => {
                        let peers = Frame::parse(&bytes, receives)
                            .map_err(|error| BusError::Protocol(error.to_string()))?;
                        take(port, now, &peers, &mut own, &mut receipt, &sizes);
                    }
                    // The peer's next process counts from 1 again.
                    None => own.seen = 0,
                }
                if own.confirmed
                    && let Some(mut frames) = port.take_all(now)
                {
                    own.image.clear();
                    for station in frames.stations() {
                        own.image.extend_from_slice(frames.frame(station));
                    }
                    receipt = Some(frames.receipt());
                    own.sequence += 1;
                    own.confirmed = false;
                }
                self.write(&own)?;
            }
            port.wait_until(pace.due(), stop);
        }
        Ok(())
    }
}

/// Takes over the peer's frame, if it is a new one, and its confirmation of our frame.
fn take(
    port: &mut Port,
    now: Nanos,
    peers: &Frame,
    own: &mut Frame,
    receipt: &mut Option<Receipt>,
    sizes: &[(usize, usize)],
) {
    if peers.seen == own.sequence && !own.confirmed {
        own.confirmed = true;
        if let Some(receipt) = receipt.take() {
            port.sent(&receipt);
        }
    }
    if peers.image.is_empty() {
        own.seen = 0;
    }
    if peers.sequence == own.seen {
        return;
    }
    own.seen = peers.sequence;
    port.running("the peer writes its file");
    let mut rest = &peers.image[..];
    port.together(|port| {
        for (station, (_, rx)) in sizes.iter().enumerate() {
            let (bytes, behind) = rest.split_at(*rx);
            port.received(station, now, bytes);
            rest = behind;
        }
    });
}

impl Free for Mailbox {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let ended = self.serve(port, stop);
        // A file left behind would look like a stopped peer.
        let _ = fs::remove_file(&self.own);
        ended
    }
}

fn failed(what: &str, file: &Path, error: &io::Error) -> BusError {
    BusError::Link(format!("could not {what} {}: {error}", file.display()))
}
