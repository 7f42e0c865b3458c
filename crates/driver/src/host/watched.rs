//! The scan's part in letting another thread look at a program.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{Role, is_stale};
use tickbus_image::TickEnd;
use tickbus_image::signal::{Plan, Slot};

use crate::Code;
use crate::tap::{Handle, Tap, Wanted, tap};
use crate::view::{StationView, View};

use super::faults::FrameFaults;

/// The data that a scan needs to show itself to another thread.
pub(super) struct WatchedScans {
    tap: Tap,
    config: Arc<Config>,
    role: Role,
    board: Arc<FaultBoard>,
    /// Per station, the plans that read the values of the written and of the read area from its frames.
    plans: Vec<[Plan; 2]>,
}

/// A station after a scan.
pub(super) struct ScannedStation<'a> {
    pub(super) station: usize,
    pub(super) status: Code,
    pub(super) inputs: &'a [u8],
    pub(super) outputs: &'a [u8],
    /// True if these inputs are fail-safe values.
    pub(super) is_fail_safe: bool,
}

impl WatchedScans {
    pub(super) fn new(config: &Arc<Config>, role: Role, board: Arc<FaultBoard>) -> (Self, Handle) {
        let table = &config.table;
        let slots: Vec<Slot> = table.signals.iter().map(|s| s.fail_safe).collect();
        let (tap, handle) = tap(&View::new(slots, table.stations.len()));
        let (writes, reads) = role.areas();
        let stations = 0..table.stations.len();
        let plans =
            stations.map(|station| [writes, reads].map(|area| Plan::new(table, station, area)));
        let watched = Self {
            tap,
            config: Arc::clone(config),
            role,
            board,
            plans: plans.collect(),
        };
        (watched, handle)
    }

    #[inline]
    pub(super) fn is_wanted(&self) -> bool {
        self.tap.is_wanted()
    }

    pub(super) fn take_wanted(&self) -> Wanted {
        self.tap.take_wanted()
    }

    /// Takes over the ordered faults; `inputs` are the values that the program sees of its stations.
    pub(super) fn obey<'a>(
        &mut self,
        faults: &mut Option<FrameFaults>,
        inputs: impl Iterator<Item = &'a [u8]>,
    ) {
        let (table, areas) = (&self.config.table, self.role.areas());
        let board = &self.board;
        let faults =
            faults.get_or_insert_with(|| FrameFaults::new(table, areas, inputs, Arc::clone(board)));
        self.tap.obey(&mut faults.faults);
    }

    /// Hands over a copy; `scans` is the number of scans so far.
    pub(super) fn show<'a>(
        &mut self,
        (now, scans): (Nanos, u64),
        image: &TickEnd,
        stations: impl Iterator<Item = ScannedStation<'a>>,
    ) {
        let (plans, max_age) = (&self.plans, self.config.timing.max_age);
        self.tap.show(|view| {
            let mut code = Code::Fresh;
            for ((station, seen), [writes, reads]) in stations.zip(&mut view.stations).zip(plans) {
                reads.decode(station.inputs, &mut view.slots);
                writes.decode(station.outputs, &mut view.slots);
                let index = station.station;
                let (age, is_valid) = (image.peer_age(index, now), image.is_valid(index));
                *seen = StationView {
                    // A late scan sees the line as down although its data are good.
                    status: if is_stale(age, max_age, is_valid) {
                        Code::Stale
                    } else {
                        station.status
                    },
                    age,
                    is_valid,
                    is_fail_safe: station.is_fail_safe,
                    cycles: image.received(index),
                };
                code = code.worse(seen.status);
                image.edges(index, |signal, count| view.edges[signal] = count);
            }
            view.now = now;
            view.tick = scans;
            view.time = now;
            view.code = code;
        });
    }
}
