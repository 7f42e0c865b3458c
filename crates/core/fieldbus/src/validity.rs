//! The validity of a station's received data: a PLC in STOP still answers.

use std::fmt::Write as _;

use super::{Cause, alive::Watch};
use tickbus_base::statistics::Key;
use tickbus_base::time::Nanos;

/// The operating state reported by a PLC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlcState {
    /// The PLC executes its program.
    Run,
    /// The PLC does not execute its program, whatever the name of the state: STOP, HALT, program mode, start-up. The
    /// outputs are not the program's.
    Stop,
}

impl PlcState {
    /// The state's name in the statistics.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Stop => "stop",
        }
    }
}

/// The stations' signs of life, in addition to frames. A [`Port`](super::Port) has one.
#[derive(Debug)]
pub struct Validity {
    stations: Vec<Station>,
    watched: Vec<Watched>,
}

#[derive(Debug, Default)]
struct Station {
    /// The station's name in the driver.cfg; empty for a single station.
    name: String,
    plc: Option<PlcState>,
    /// The reason why the station's peer is gone, if the bus has reported it.
    left: Option<(Cause, String)>,
    /// True if the station's PLC has stopped, and nothing has arrived since it last reported running.
    is_stopped: bool,
}

/// A signal that must keep changing.
#[derive(Debug)]
struct Watched {
    watch: Watch,
    /// The signal's last bytes.
    last: Vec<u8>,
    /// When the bytes last changed, or arrived for the first time.
    changed: Option<Nanos>,
    /// True if the bytes have not changed for too long.
    is_frozen: bool,
}

impl Watched {
    /// The time from which on the signal has been unchanged for too long.
    fn due(&self) -> Option<Nanos> {
        let changed = self.changed.filter(|_| !self.is_frozen)?;
        Some(changed + self.watch.within + Nanos(1))
    }

    /// Checks a frame that arrived at `now`; returns true if the validity of the station changes.
    fn arrived(&mut self, now: Nanos, frame: &[u8]) -> bool {
        let mask = self.watch.mask;
        let bytes = &frame[self.watch.bytes.clone()];
        let news = bytes.iter().map(|byte| byte & mask);
        if self.changed.is_some() && news.clone().eq(self.last.iter().copied()) {
            return self.look(now);
        }
        self.last.clear();
        self.last.extend(news);
        self.changed = Some(now);
        std::mem::take(&mut self.is_frozen)
    }

    /// Checks the time; returns true if the signal has just been found frozen.
    fn look(&mut self, now: Nanos) -> bool {
        let freezes = self.due().is_some_and(|due| due <= now);
        self.is_frozen |= freezes;
        freezes
    }
}

impl Validity {
    /// The validity for a driver with this many stations; all data are valid at first.
    pub fn new(stations: usize) -> Self {
        let stations = (0..stations).map(|number| Station {
            name: match stations {
                1 => String::new(),
                _ => (number + 1).to_string(),
            },
            ..Station::default()
        });
        Self {
            stations: stations.collect(),
            watched: Vec::new(),
        }
    }

    /// Watches these signals, starting from their first frame.
    pub fn watch(&mut self, watches: Vec<Watch>) {
        let watched = watches.into_iter().map(|watch| Watched {
            watch,
            last: Vec::new(),
            changed: None,
            is_frozen: false,
        });
        self.watched = watched.collect();
    }

    /// Sets the stations' names for messages.
    pub(super) fn name_stations<'a>(&mut self, names: impl Iterator<Item = &'a str>) {
        if self.stations.len() > 1 {
            for (station, name) in self.stations.iter_mut().zip(names) {
                name.clone_into(&mut station.name);
            }
        }
    }

    /// Records the state that a station's PLC reports; returns true if the state is new.
    pub(super) fn plc_state(&mut self, station: usize, state: PlcState) -> bool {
        let station = &mut self.stations[station];
        let is_news = station.plc.replace(state) != Some(state);
        station.left = None;
        station.is_stopped |= state == PlcState::Stop;
        is_news
    }

    /// Records the reason why the peer of a station that [has stopped](Self::plc_state) is gone.
    pub(super) fn station_left(&mut self, station: usize, cause: Cause, why: &str) {
        self.stations[station].left = Some((cause, why.to_owned()));
    }

    /// A whole frame of `station` arrived at `now`. Returns true if the validity of its data changes.
    #[inline]
    pub fn arrived(&mut self, station: usize, now: Nanos, frame: &[u8]) -> bool {
        let mut changes = false;
        for watched in &mut self.watched {
            if watched.watch.station == station {
                changes |= watched.arrived(now, frame);
            }
        }
        changes | self.heard(station)
    }

    /// `station` gave a sign of life. Returns true if the validity of its data changes.
    #[inline]
    pub(super) fn heard(&mut self, station: usize) -> bool {
        let station = &mut self.stations[station];
        let revives = station.is_stopped && station.plc == Some(PlcState::Run);
        station.is_stopped &= !revives;
        revives
    }

    /// Checks the time; returns a station, if any, with a signal that has just been found frozen.
    #[inline]
    pub(super) fn look(&mut self, now: Nanos) -> Option<usize> {
        self.watched.iter_mut().find_map(|watched| {
            let station = watched.watch.station;
            watched.look(now).then_some(station)
        })
    }

    /// When to check next; [`Nanos::MAX`] for never.
    pub(super) fn due(&self) -> Nanos {
        let due = self.watched.iter().filter_map(Watched::due);
        due.min().unwrap_or(Nanos::MAX)
    }

    /// Returns true if the data of `station` are valid.
    pub fn is_valid(&self, station: usize) -> bool {
        let is_frozen = |watched: &Watched| watched.watch.station == station && watched.is_frozen;
        !self.stations[station].is_stopped && !self.watched.iter().any(is_frozen)
    }

    /// The facts for the statistics: `cpu`, or `cpu.<station>` if there are several stations.
    pub(super) fn facts(&self) -> Vec<(Key, &'static str)> {
        let known = || {
            self.stations
                .iter()
                .filter_map(|station| Some((&station.name, station.plc?)))
        };
        let stopped = known().any(|(_, state)| state == PlcState::Stop);
        let all = if stopped {
            PlcState::Stop
        } else {
            PlcState::Run
        };
        let mut facts = vec![("cpu".into(), all.name())];
        if self.stations.len() > 1 {
            facts.extend(known().map(|(name, state)| (Key::of("cpu", name, ""), state.name())));
        }
        facts
    }

    /// The cause and the reason in words for invalid data; `None` if all are valid.
    pub(super) fn doubt(&self) -> Option<(Cause, String)> {
        let stopped: Vec<&Station> = self.stations.iter().filter(|s| s.is_stopped).collect();
        let Some((first, others)) = stopped.split_first() else {
            return self.standstill();
        };
        if let Some(left) = stopped.iter().find_map(|station| station.left.clone()) {
            return Some(left);
        }
        let mut reason = if first.name.is_empty() {
            "the PLC".to_owned()
        } else {
            format!("the PLC of station \"{}\"", first.name)
        };
        for station in others {
            let _ = write!(reason, ", that of \"{}\"", station.name);
        }
        let is = if others.is_empty() { "is" } else { "are" };
        let _ = write!(
            reason,
            " {is} in STOP; put it into RUN, and its next data count"
        );
        Some((Cause::Stopped, reason))
    }

    /// The signals that should have changed and did not.
    fn standstill(&self) -> Option<(Cause, String)> {
        let mut reason = String::new();
        for Watched { watch, .. } in self.watched.iter().filter(|watched| watched.is_frozen) {
            let name = &self.stations[watch.station].name;
            let of = if name.is_empty() {
                String::new()
            } else {
                format!(" of station \"{name}\"")
            };
            let more = if reason.is_empty() { "" } else { "; " };
            let _ = write!(
                reason,
                "{more}the signal \"{}\"{of} has not changed for {}, though data arrive",
                watch.name, watch.within
            );
        }
        if reason.is_empty() {
            return None;
        }
        reason.push_str("; see whether the program that changes it runs");
        Some((Cause::Frozen, reason))
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::{LinkState, LinkStatus, Port, Role};
    use tickbus_base::time::{Manual, Nanos};
    use tickbus_image::{StationStreams, TickEnd, image};

    const MAX_AGE: Nanos = Nanos::from_millis(100);

    fn at(millis: i64) -> Nanos {
        Nanos::from_millis(millis)
    }

    /// A line whose stations receive one byte each.
    fn line(names: &[&str]) -> (TickEnd, Port, LinkStatus) {
        let station = || StationStreams {
            tx_fail_safe: Box::new([]),
            tx_latched: Box::new([]),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([0]),
            rx_latched: Box::new([]),
        };
        let (tick, bus) = image(names.iter().map(|_| station()).collect());
        let status = LinkStatus::new("test", MAX_AGE);
        let port = Port::new(bus, Manual::new(), Role::Device, None, status.clone())
            .with_names(names.iter().copied());
        (tick, port, status)
    }

    fn is_told(status: &LinkStatus, line: &str) -> bool {
        let mut statistics = tickbus_base::statistics::Statistics::default();
        status.write(at(0), &mut statistics);
        let text = statistics.to_string();
        text.lines().any(|told| told == line)
    }

    #[test]
    fn a_station_that_its_peer_left_is_stale_for_that_reason_until_it_runs_again() {
        let (tick, mut port, status) = line(&["a", "b"]);
        port.running("the peer is there");
        for station in [0, 1] {
            port.plc_state(station, at(0), PlcState::Run);
            port.received(station, at(1), &[1]);
        }
        port.station_left(1, at(2), Cause::Link, "its master is silent");
        assert!(tick.peers.is_valid(0) && !tick.peers.is_valid(1));
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Link));
        assert_eq!(link.reason, "its master is silent");
        port.plc_state(1, at(3), PlcState::Run);
        port.received(1, at(3), &[2]);
        assert!(tick.peers.is_valid(1));
        assert_eq!(status.link().state, LinkState::Running);
        port.plc_state(1, at(4), PlcState::Stop);
        assert!(
            status.link().reason.contains("in STOP"),
            "no longer the reason of before"
        );
    }

    #[test]
    fn a_plc_in_stop_is_stale_however_young_its_data_are_and_fresh_with_the_first_frame_of_run() {
        let (tick, mut port, status) = line(&[""]);
        port.running("the peer is there");
        port.plc_state(0, at(0), PlcState::Run);
        port.received(0, at(1), &[1]);
        assert!(tick.peers.is_valid(0) && is_told(&status, "cpu=run"));
        port.plc_state(0, at(2), PlcState::Stop);
        assert!(!tick.peers.is_valid(0), "at once");
        port.received(0, at(3), &[0]);
        port.observe(at(3));
        assert!(!tick.peers.is_valid(0) && is_told(&status, "cpu=stop"));
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Stopped));
        let right = "the PLC is in STOP; put it into RUN, and its next data count";
        assert_eq!(link.reason, right);
        port.plc_state(0, at(4), PlcState::Run);
        assert!(
            !tick.peers.is_valid(0),
            "the frame that is there is from STOP"
        );
        port.received(0, at(5), &[1]);
        let link = status.link();
        assert!(tick.peers.is_valid(0) && is_told(&status, "cpu=run"));
        assert_eq!(link.state, LinkState::Running);
        assert_eq!(link.reason, "the peer is there");
    }

    #[test]
    fn of_several_plcs_the_one_in_stop_is_named_and_the_others_stay_fresh() {
        let (tick, mut port, status) = line(&["charger", "lathe"]);
        port.running("both are there");
        port.plc_state(1, at(0), PlcState::Stop);
        assert!(tick.peers.is_valid(0) && !tick.peers.is_valid(1));
        assert!(is_told(&status, "cpu=stop") && is_told(&status, "cpu.lathe=stop"));
        assert!(
            !is_told(&status, "cpu.charger=run"),
            "it has said nothing yet"
        );
        let reason = status.link().reason;
        assert!(
            reason.starts_with("the PLC of station \"lathe\" is in STOP;"),
            "{reason}"
        );
        port.plc_state(0, at(1), PlcState::Stop);
        let reason = status.link().reason;
        let both = "the PLC of station \"charger\", that of \"lathe\" are in STOP;";
        assert!(reason.starts_with(both), "{reason}");
    }

    #[test]
    fn a_line_that_comes_up_again_is_stale_while_its_plc_has_not_said_that_it_runs() {
        let (_tick, mut port, status) = line(&[""]);
        port.plc_state(0, at(0), PlcState::Stop);
        port.opening("waiting");
        assert_eq!(
            status.link().cause,
            Cause::Waiting,
            "the line tells its own"
        );
        port.running("it is back");
        assert_eq!(status.link().cause, Cause::Stopped);
        assert_eq!(status.runs(), 1, "it came up, though");
    }

    #[test]
    fn a_station_of_which_nothing_is_read_is_fresh_with_the_first_sign_of_life_of_run() {
        let (tick, mut port, status) = line(&["charger", "lathe"]);
        port.running("both are there");
        for station in 0..2 {
            port.touch(station, at(0));
            port.plc_state(station, at(1), PlcState::Stop);
            port.touch(station, at(2));
        }
        assert!(!tick.peers.is_valid(1), "it is in STOP");
        for station in 0..2 {
            port.plc_state(station, at(3), PlcState::Run);
        }
        port.received(0, at(4), &[1]);
        assert_eq!(status.link().cause, Cause::Stopped);
        port.touch(1, at(4));
        assert!(tick.peers.is_valid(0) && tick.peers.is_valid(1));
        let link = status.link();
        assert_eq!(
            (link.state, &*link.reason),
            (LinkState::Running, "both are there")
        );
    }

    #[test]
    fn a_line_is_silent_and_not_running_while_another_station_of_it_is() {
        let (_tick, mut port, status) = line(&["charger", "lathe"]);
        port.running("both are there");
        port.received(0, at(0), &[0]);
        port.received(1, at(0), &[0]);
        port.plc_state(1, at(150), PlcState::Stop);
        port.observe(at(151));
        assert_eq!(status.link().cause, Cause::Stopped);
        port.plc_state(1, at(160), PlcState::Run);
        port.received(1, at(161), &[1]);
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Silent));
        port.received(0, at(170), &[1]);
        port.observe(at(170));
        assert_eq!(status.link().reason, "both are there");
    }

    #[test]
    fn a_silent_line_is_told_as_silent_whatever_stands_still_and_first() {
        for within in [30, 200] {
            let (_tick, mut port, status) = line(&[""]);
            port.running("the peer is there");
            port = watch_within(port, 0, at(within));
            let cause = |port: &mut Port, now| {
                port.observe(at(now));
                status.link().cause
            };
            // The state that the first round leaves must not mislead the second one.
            for round in [0, 1000] {
                port.received(0, at(round), &[u8::from(round > 0)]);
                assert_eq!(cause(&mut port, round + 1), Cause::Running);
                cause(&mut port, round + 31);
                for silent in [140, 201, 300] {
                    assert_eq!(
                        cause(&mut port, round + silent),
                        Cause::Silent,
                        "{within} {silent}"
                    );
                }
                // The signal arrives again, unchanged.
                port.received(0, at(round + 310), &[u8::from(round > 0)]);
                assert_eq!(cause(&mut port, round + 310), Cause::Frozen, "{within}");
            }
        }
    }

    fn watch(port: Port, station: usize) -> Port {
        watch_within(port, station, at(10))
    }

    fn watch_within(port: Port, station: usize, within: Nanos) -> Port {
        port.with_life_signs(vec![Watch {
            name: "Life".to_owned(),
            station,
            bytes: 0..1,
            mask: 1,
            within,
        }])
    }

    #[test]
    fn a_signal_that_stands_still_makes_its_station_stale_by_the_clock_alone_until_it_changes() {
        let (tick, mut port, status) = line(&["charger", "lathe"]);
        port.running("both are there");
        port = watch(port, 1);
        assert_eq!(port.due(), Nanos::MAX, "nothing has come yet");
        port.received(0, at(0), &[0]);
        port.received(1, at(0), &[0]);
        port.received(1, at(5), &[1]);
        assert_eq!(port.due(), at(15) + Nanos(1), "it changed");
        port.observe(at(15));
        assert!(tick.peers.is_valid(1), "just in time");
        port.observe(at(15) + Nanos(1));
        assert!(tick.peers.is_valid(0) && !tick.peers.is_valid(1));
        assert_eq!(port.due(), Nanos::MAX, "nothing to look for any more");
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Frozen));
        assert_eq!(
            link.reason,
            "the signal \"Life\" of station \"lathe\" has not changed for 10ms, though data arrive; see whether the \
             program that changes it runs"
        );
        port.received(1, at(20), &[3]);
        assert!(!tick.peers.is_valid(1), "another bit of its byte changed");
        port.received(1, at(21), &[2]);
        assert!(tick.peers.is_valid(1));
        assert_eq!(status.link().reason, "both are there");
    }

    #[test]
    fn a_frame_that_comes_late_and_unchanged_is_stale_at_once() {
        let (tick, mut port, _status) = line(&[""]);
        port = watch(port, 0);
        port.received(0, at(0), &[1]);
        port.received(0, at(50), &[1]);
        assert!(!tick.peers.is_valid(0));
    }

    #[test]
    fn a_plc_in_stop_is_told_before_a_signal_that_stands_still_and_both_have_to_be_over() {
        let (tick, mut port, status) = line(&[""]);
        port.running("the peer is there");
        port = watch(port, 0);
        port.received(0, at(0), &[1]);
        port.observe(at(11));
        assert_eq!(status.link().cause, Cause::Frozen);
        port.plc_state(0, at(12), PlcState::Stop);
        assert_eq!(status.link().cause, Cause::Stopped);
        port.plc_state(0, at(13), PlcState::Run);
        port.received(0, at(13), &[1]);
        assert_eq!(status.link().cause, Cause::Frozen);
        assert!(!tick.peers.is_valid(0));
        port.received(0, at(14), &[0]);
        assert_eq!(status.link().cause, Cause::Running);
        assert!(tick.peers.is_valid(0));
    }
}
