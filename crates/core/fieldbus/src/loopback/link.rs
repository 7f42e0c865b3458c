//! The line of a loopback: two ends in one process that find each other by a name.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use crate::{BusError, Port, Receipt, Role};
use tickbus_base::time::Nanos;

/// The named links that have at least one end.
static LINKS: Mutex<Option<HashMap<String, Weak<Mutex<SharedLanes>>>>> = Mutex::new(None);

#[derive(Debug, Default)]
struct SharedLanes {
    /// One per role, in the order of [`lane`].
    lanes: [Lane; 2],
}

/// The frames that one end sends.
#[derive(Debug, Default)]
struct Lane {
    attached: bool,
    /// Sizes of the frames that the end sends and receives, per station.
    sizes: Vec<(usize, usize)>,
    /// The last frames sent, of all stations.
    frames: Vec<Vec<u8>>,
    /// Per station, true if the other end has yet to take the frame.
    waiting: Vec<bool>,
    /// When the frames were offered.
    offered_at: Nanos,
}

fn lane(role: Role) -> usize {
    match role {
        Role::Device | Role::Observer => 0,
        Role::Controller => 1,
    }
}

fn other(role: Role) -> Role {
    match role {
        Role::Device | Role::Observer => Role::Controller,
        Role::Controller => Role::Device,
    }
}

/// One end of a link; dropping it frees its place.
#[derive(Debug)]
pub struct End {
    line: Arc<Mutex<SharedLanes>>,
    role: Role,
    /// The receipt for the frames that the other end may have taken.
    offered: Option<Receipt>,
    /// True if the other end has been present.
    met: bool,
    /// True if both ends belong to one driver, which closes them one after the other: the first closed end does not
    /// count as a peer that left.
    is_private: bool,
}

/// Creates a link without a name, with both its ends: the Device's and the Controller's.
///
/// `sizes` are the numbers of bytes that the Device sends and receives, per station.
pub fn private_link(sizes: &[(usize, usize)]) -> (End, End) {
    let line = Arc::default();
    let attach = |role, sizes| {
        let mut end = End::attach(&line, role, sizes, "").expect("a new line has two free places");
        end.is_private = true;
        end
    };
    (
        attach(Role::Device, sizes.to_vec()),
        attach(Role::Controller, swapped(sizes)),
    )
}

fn swapped(sizes: &[(usize, usize)]) -> Vec<(usize, usize)> {
    sizes.iter().map(|(tx, rx)| (*rx, *tx)).collect()
}

impl End {
    /// Joins the link called `name`, as the end that `port` serves.
    ///
    /// # Errors
    ///
    /// [`BusError::Refused`] if that end is taken, or if the other end has frames of different sizes.
    pub fn join(name: &str, port: &Port) -> Result<Self, BusError> {
        let sizes = (0..port.stations())
            .map(|station| port.sizes(station))
            .collect();
        let mut links = LINKS.lock().unwrap_or_else(PoisonError::into_inner);
        let links = links.get_or_insert_with(HashMap::new);
        links.retain(|_, line| line.strong_count() > 0);
        let line = links.get(name).and_then(Weak::upgrade).unwrap_or_default();
        links.insert(name.to_owned(), Arc::downgrade(&line));
        Self::attach(&line, port.role(), sizes, name)
    }

    fn attach(
        line: &Arc<Mutex<SharedLanes>>,
        role: Role,
        sizes: Vec<(usize, usize)>,
        name: &str,
    ) -> Result<Self, BusError> {
        let mut locked = lock(line);
        let peer = &locked.lanes[lane(other(role))];
        if peer.attached && swapped(&peer.sizes) != sizes {
            return Err(BusError::Refused(format!(
                "the ends of loopback link \"{name}\" differ: this end sends and receives {sizes:?} \
                 bytes per station, the other end expects {:?}; give both the same signal table",
                swapped(&peer.sizes),
            )));
        }
        if locked.lanes[lane(role)].attached {
            return Err(BusError::Refused(format!(
                "loopback link \"{name}\" already has a {}; close that one, or give this driver \
                 another link name or role",
                role.name(),
            )));
        }
        let frames: Vec<Vec<u8>> = sizes.iter().map(|(tx, _)| vec![0; *tx]).collect();
        locked.lanes[lane(role)] = Lane {
            attached: true,
            waiting: vec![false; frames.len()],
            sizes,
            frames,
            offered_at: Nanos::ZERO,
        };
        drop(locked);
        Ok(Self {
            line: Arc::clone(line),
            role,
            offered: None,
            met: false,
            is_private: false,
        })
    }

    /// One bus cycle at `now`: takes the frames of the other end, and offers those of the port.
    pub fn cycle(&mut self, now: Nanos, port: &mut Port) {
        self.take(now, port);
        self.offer(now, port);
    }

    /// Takes the frames that the other end has sent.
    pub fn take(&mut self, now: Nanos, port: &mut Port) {
        if !self.meets(now, port) {
            return;
        }
        let mut line = lock(&self.line);
        let theirs = &mut line.lanes[lane(other(self.role))];
        // Time passes between the cycles of a free line, and the process may be suspended in between. On simulation
        // time the other end's last values are current.
        if port.clock().passes_alone() {
            port.came_at(theirs.offered_at.min(now));
        }
        port.together(|port| {
            let frames = theirs.frames.iter().zip(&mut theirs.waiting);
            for (station, (frame, waiting)) in frames.enumerate() {
                if std::mem::take(waiting) {
                    port.received(station, now, frame);
                }
            }
        });
        drop(line);
        port.running("the other end is there");
    }

    /// Offers the frames of the port.
    ///
    /// Frames that the other end has not taken are overwritten, since only the newest frames matter. Their pulses are
    /// confirmed once the other end takes a frame that shows them.
    pub fn offer(&mut self, now: Nanos, port: &mut Port) {
        if !self.meets(now, port) {
            return;
        }
        let mut line = lock(&self.line);
        let mine = &mut line.lanes[lane(self.role)];
        if !mine.waiting.contains(&true)
            && let Some(receipt) = self.offered.take()
        {
            port.sent(&receipt);
        }
        if let Some(mut frames) = port.take_all(now) {
            mine.offered_at = now;
            let lanes = mine.frames.iter_mut().zip(&mut mine.waiting);
            for (station, (frame, waiting)) in lanes.enumerate() {
                frame.copy_from_slice(frames.frame(station));
                *waiting = frames.is_station_up(station);
            }
            self.offered = Some(frames.receipt());
        }
    }

    /// Returns true if the line is up and the other end is present.
    fn meets(&mut self, now: Nanos, port: &mut Port) -> bool {
        if !port.is_up(now) {
            return false;
        }
        let mut line = lock(&self.line);
        if line.lanes[lane(other(self.role))].attached {
            self.met = true;
            return true;
        }
        // A frame that the previous other end took is confirmed, so that the next end does not see its pulses again. A
        // frame that the previous end did not take is outdated.
        let waiting = &mut line.lanes[lane(self.role)].waiting;
        let is_taken = !waiting.contains(&true);
        waiting.fill(false);
        drop(line);
        if let Some(receipt) = self.offered.take().filter(|_| is_taken) {
            port.sent(&receipt);
        }
        if std::mem::take(&mut self.met) && !self.is_private {
            let left = BusError::Left("the other end of the link was closed".to_owned());
            port.lost(&left, "waiting for the next");
        }
        false
    }
}

impl Drop for End {
    fn drop(&mut self) {
        lock(&self.line).lanes[lane(self.role)] = Lane::default();
    }
}

fn lock(line: &Mutex<SharedLanes>) -> MutexGuard<'_, SharedLanes> {
    // Frames are copied whole under the lock, so they are readable even after a panic of the other end.
    line.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cause, LinkStatus};
    use tickbus_base::time::Manual;
    use tickbus_image::{StationStreams, image};

    fn port(role: Role) -> (Port, LinkStatus) {
        let streams = StationStreams {
            tx_fail_safe: Box::new([0]),
            tx_latched: Box::new([]),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([0]),
            rx_latched: Box::new([]),
        };
        let (_, bus) = image(vec![streams]);
        let status = LinkStatus::new("x", Nanos::from_millis(100));
        let port = Port::new(bus, Manual::new(), role, None, status.clone());
        (port, status)
    }

    #[test]
    fn a_peer_that_leaves_is_told_unless_both_ends_are_one_drivers() {
        for is_private in [false, true] {
            let mut ports = [Role::Device, Role::Controller].map(port);
            let (mut device, mut controller) = if is_private {
                private_link(&[(1, 1)])
            } else {
                [0, 1]
                    .map(|end| End::join("left", &ports[end].0).expect("a free place"))
                    .into()
            };
            let [(port, status), (peer, _)] = &mut ports;
            for _ in 0..2 {
                controller.cycle(Nanos(1), peer);
                device.cycle(Nanos(1), port);
            }
            assert_eq!(status.link().cause, Cause::Running);
            drop(controller);
            device.cycle(Nanos(2), port);
            let cause = status.link().cause;
            assert_eq!(cause == Cause::Left, !is_private, "{cause:?}");
        }
    }
}
