//! The layer of injected line faults, around the port to the image.

use std::ops::Range;
use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_image::{BusEnd, Event};

use super::image::{ImagePort, Report};
use crate::faults::{Diagnosis, Fate, FaultBoard, LineFaults, Request, Shape, Spoilt, Taken};
use crate::{Cause, LinkState, LinkStatus};

/// Passes all calls to an [`ImagePort`], and distorts the data while line faults are active. Until the first fault is
/// injected, the layer allocates nothing and costs one comparison.
#[derive(Debug, Default)]
pub(super) struct FaultLayer {
    board: Arc<FaultBoard>,
    /// The board's change counter when it was last read.
    seen: u64,
    line: Option<Box<LineFaults>>,
    /// When the bus last took the image of each station, while there was no line fault. The first line fault starts
    /// from there.
    taken: Box<[Taken]>,
    /// True if the board was read for the message that the bus is handing in: the same faults act on all frames of the
    /// message.
    has_looked: bool,
    /// A buffer per station, for handing in frames that were held back.
    frames: Vec<Box<[u8]>>,
    /// While a fault holds the line down: the bus's own report of the line.
    beneath: Option<Beneath>,
}

/// The report of a bus that a fault hides.
#[derive(Debug)]
struct Beneath {
    state: LinkState,
    cause: Cause,
    reason: String,
}

impl FaultLayer {
    /// The layer for the faults on `board`, for this number of stations.
    pub(super) fn new(board: Arc<FaultBoard>, stations: usize) -> Self {
        Self {
            taken: vec![Taken::Never; stations].into(),
            board,
            ..Self::default()
        }
    }

    /// Returns true if there is anything to do.
    #[inline]
    pub(super) fn any(&self) -> bool {
        self.line.is_some() || self.board.news() != self.seen
    }

    /// Adopts new faults, and hands in frames that were held back long enough.
    #[inline]
    pub(super) fn attend(&mut self, now: Nanos, port: &mut ImagePort) {
        if self.any() {
            self.attend_to_faults(now, port);
        }
    }

    /// The bus begins to hand in the frames of one message. If there are no faults now, no fault acts on any of these
    /// frames.
    #[inline]
    pub(super) fn begin_together(&mut self) {
        self.has_looked = !self.any();
    }

    #[cold]
    fn attend_to_faults(&mut self, now: Nanos, port: &mut ImagePort) {
        if std::mem::replace(&mut self.has_looked, port.is_held) && port.is_held {
            return;
        }
        self.look(now, port);
        let Some(line) = &mut self.line else {
            return;
        };
        let is_part = std::mem::replace(&mut port.is_held, true);
        for (station, frame) in self.frames.iter_mut().enumerate() {
            while let Some(came) = line.release(station, now, frame) {
                port.received(station, came, frame);
            }
        }
        port.is_held = is_part;
        port.hand_over();
    }

    /// Reads the board: adopts new faults, logs, and updates the state of the line.
    fn look(&mut self, now: Nanos, port: &mut ImagePort) {
        let news = self.board.news();
        if news == self.seen {
            return;
        }
        self.seen = news;
        let (image, status, taken) = (&port.image, &port.status, &self.taken);
        self.board.tell(status.driver());
        for fault in self.board.take_line_faults() {
            let line = self.line.get_or_insert_with(|| {
                let shapes =
                    (0..image.stations()).map(|station| shape(image, station, taken[station]));
                Box::new(LineFaults::new(Arc::clone(&self.board), shapes))
            });
            line.adopt(fault);
            let sizes = (0..image.stations()).map(|station| image.rx_len(station));
            self.frames = sizes.map(|size| vec![0; size].into()).collect();
        }
        let Some(line) = &mut self.line else {
            return;
        };
        line.look();
        status.injected(line.active());
        if line.is_down() {
            self.beneath.get_or_insert_with(|| Beneath::of(status));
            say_down(now, line.active(), status);
        } else if let Some(beneath) = self.beneath.take() {
            port.enter(now, beneath.report());
        }
    }

    /// Returns true if no frames are sent or received.
    #[inline]
    pub(super) fn is_down(&self) -> bool {
        self.line.as_ref().is_some_and(|line| line.is_down())
    }

    /// Decides at random if the next outgoing frames are lost.
    #[inline]
    pub(super) fn loses_cycle(&mut self) -> bool {
        let line = self.line.as_mut();
        line.is_some_and(|line| line.loses_cycle())
    }

    /// The bytes that a station sends at `now`.
    #[inline]
    pub(super) fn outgoing<'a>(
        &'a mut self,
        station: usize,
        now: Nanos,
        port: &'a mut ImagePort,
    ) -> &'a [u8] {
        let Some(line) = &mut self.line else {
            self.taken[station] = Taken::At(now);
            return port.outgoing(station, now);
        };
        let repeats = line.repeats(station, now);
        if line.is_cut(station) {
            return line.frozen(station);
        }
        if !repeats && line.takes(station, now, port.outgoing(station, now)) {
            port.sent(station, None);
        }
        line.outgoing(station)
    }

    /// The peer has these bits of the bytes that [`outgoing`](Self::outgoing) returned last; `None` for all.
    #[inline]
    pub(super) fn sent(
        &mut self,
        station: usize,
        bits: Option<&Range<usize>>,
        port: &mut ImagePort,
    ) {
        let line = self.line.as_mut();
        if line.is_none_or(|line| line.sent(station, bits)) {
            port.sent(station, bits);
        }
    }

    /// Returns true if [`outgoing`](Self::outgoing) has returned the image's newest bytes.
    pub(super) fn gives_newest(&self, station: usize) -> bool {
        let line = self.line.as_ref();
        line.is_none_or(|line| line.gives_newest(station))
    }

    /// A whole frame arrived.
    #[inline]
    pub(super) fn received(
        &mut self,
        station: usize,
        now: Nanos,
        bytes: &[u8],
        port: &mut ImagePort,
    ) {
        let Some(line) = &mut self.line else {
            port.received(station, now, bytes);
            return;
        };
        match line.arrives(station, now, bytes) {
            Fate::Passes(times) => {
                for _ in 0..times {
                    port.received(station, now, bytes);
                }
            }
            // If the frame is held back, its changes become events when it is released.
            Fate::Lost | Fate::Held => {
                if let Some(changes) = port.changes.get_mut(station) {
                    changes.forget();
                }
            }
        }
    }

    /// The peer of a station was alive.
    #[inline]
    pub(super) fn touch(&mut self, station: usize, now: Nanos, port: &mut ImagePort) {
        // While frames are held back or lost, the peer must not seem more alive than the data that have arrived.
        let is_hidden = |line: &LineFaults| line.is_cut(station) || line.withholds(station);
        if !self.line.as_deref().is_some_and(is_hidden) {
            port.touch(station, now);
        }
    }

    /// Returns true if a fault is active, or frames are held back.
    #[inline]
    pub(super) fn is_distorting(&self) -> bool {
        self.line
            .as_ref()
            .is_some_and(|line| !line.active().is_empty() || line.due() != Nanos::MAX)
    }

    /// Returns true if no frames go to or come from this station.
    #[inline]
    pub(super) fn is_cut(&self, station: usize) -> bool {
        self.line.as_ref().is_some_and(|line| line.is_cut(station))
    }

    /// How the answer to a request is spoilt.
    #[inline]
    pub(super) fn answer(&mut self, request: Request<'_>) -> Spoilt {
        let line = self.line.as_mut();
        line.map_or_else(Spoilt::default, |line| line.answer(request))
    }

    pub(super) fn report_diagnoses_anew(&mut self) {
        if let Some(line) = &mut self.line {
            line.report_diagnoses_anew();
        }
    }

    /// The reports of the stations, if they have changed since the last call.
    #[inline]
    pub(super) fn take_diagnoses(&mut self) -> Option<&[Diagnosis]> {
        self.line.as_mut()?.take_diagnoses()
    }

    /// The peer wrote, on a bus for which every write matters.
    pub(super) fn event(&mut self, event: Event, port: &mut ImagePort) {
        if !self.is_down() {
            port.event(event);
        }
    }

    /// The bus reports this state of its line. The report is kept while a fault hides it.
    pub(super) fn enter(&mut self, now: Nanos, report: Report<'_>, port: &mut ImagePort) {
        if report.state == LinkState::Opening {
            self.taken.iter_mut().for_each(Taken::reopen);
            if let Some(line) = &mut self.line {
                line.carries_nothing();
            }
        }
        let (Some(beneath), Some(line)) = (&mut self.beneath, &self.line) else {
            port.enter(now, report);
            return;
        };
        if !beneath.equals(report) {
            *beneath = Beneath {
                state: report.state,
                cause: report.cause,
                reason: report.reason.to_owned(),
            };
            // The supervisor may have reported a failure in the meantime.
            say_down(now, line.active(), &port.status);
        }
    }

    /// When the next held frame is due.
    pub(super) fn due(&self) -> Nanos {
        let line = self.line.as_ref();
        line.map_or(Nanos::MAX, |line| line.due())
    }
}

impl Beneath {
    /// The line as its bus reported it last.
    fn of(status: &LinkStatus) -> Self {
        let link = status.link();
        if link.state == LinkState::Stale {
            // The clock decides staleness, not the bus.
            return Self {
                state: LinkState::Running,
                cause: Cause::Running,
                reason: status.running_reason(),
            };
        }
        Self {
            state: link.state,
            cause: link.cause,
            reason: link.reason,
        }
    }

    fn report(&self) -> Report<'_> {
        Report {
            state: self.state,
            cause: self.cause,
            reason: &self.reason,
        }
    }

    fn equals(&self, report: Report<'_>) -> bool {
        (self.state, self.cause) == (report.state, report.cause) && self.reason == report.reason
    }
}

fn say_down(now: Nanos, active: &str, status: &LinkStatus) {
    let reason = format!("the link is down by injected fault: {active}");
    status.enter(now, LinkState::Failed, Cause::Injected, &reason);
}

fn shape(image: &BusEnd, station: usize, taken: Taken) -> Shape {
    let mut latched = vec![0; image.tx_len(station)];
    for bit in image.tx_latched(station) {
        latched[bit.byte] |= bit.mask;
    }
    Shape {
        last_sent: image.last_outgoing(station).into(),
        taken,
        latched: latched.into(),
        rx_len: image.rx_len(station),
    }
}
