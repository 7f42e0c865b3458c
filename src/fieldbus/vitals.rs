//! Whether the data of a station count, although they arrive: a PLC in STOP goes on answering.

use std::fmt::Write as _;

use super::Cause;

/// What a PLC says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlcState {
    /// It works its program off.
    Run,
    /// It does not, whatever it calls that: STOP, HALT, program mode, start-up. Its outputs are not the program's.
    Stop,
}

impl PlcState {
    /// As the statistics have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Stop => "stop",
        }
    }
}

/// The stations' signs of life beyond frames.
#[derive(Debug)]
pub(super) struct Vitals(Vec<Station>);

#[derive(Debug, Default)]
struct Station {
    /// As the driver.cfg names it; empty where there is one.
    name: String,
    plc: Option<PlcState>,
    /// Its PLC stopped, and has sent nothing since it runs again.
    is_stopped: bool,
}

impl Vitals {
    pub(super) fn new(stations: usize) -> Self {
        let stations = (0..stations).map(|number| Station {
            name: match stations {
                1 => String::new(),
                _ => (number + 1).to_string(),
            },
            ..Station::default()
        });
        Self(stations.collect())
    }

    /// Gives the stations the names that messages call them.
    pub(super) fn name_stations<'a>(&mut self, names: impl Iterator<Item = &'a str>) {
        if self.0.len() > 1 {
            for (station, name) in self.0.iter_mut().zip(names) {
                name.clone_into(&mut station.name);
            }
        }
    }

    /// Takes down what a station's PLC says of itself; whether that is news.
    pub(super) fn plc_says(&mut self, station: usize, state: PlcState) -> bool {
        let station = &mut self.0[station];
        let is_news = station.plc.replace(state) != Some(state);
        station.is_stopped |= state == PlcState::Stop;
        is_news
    }

    /// A whole frame of `station` arrived. Gives whether the station's data count again from this one on.
    pub(super) fn revives(&mut self, station: usize) -> bool {
        let station = &mut self.0[station];
        let revives = station.is_stopped && station.plc == Some(PlcState::Run);
        station.is_stopped &= !revives;
        revives
    }

    /// Whether the data of `station` count.
    pub(super) fn is_valid(&self, station: usize) -> bool {
        !self.0[station].is_stopped
    }

    /// The keys and facts of the statistics: `cpu`, and `cpu.<station>` where there are several.
    pub(super) fn facts(&self) -> Vec<(String, &'static str)> {
        let known = || {
            self.0
                .iter()
                .filter_map(|station| Some((&station.name, station.plc?)))
        };
        let stopped = known().any(|(_, state)| state == PlcState::Stop);
        let all = if stopped {
            PlcState::Stop
        } else {
            PlcState::Run
        };
        let mut facts = vec![("cpu".to_owned(), all.name())];
        if self.0.len() > 1 {
            facts.extend(known().map(|(name, state)| (format!("cpu.{name}"), state.name())));
        }
        facts
    }

    /// Why data that arrive do not count, for programs and for people; `None` while all do.
    pub(super) fn doubt(&self) -> Option<(Cause, String)> {
        let stopped: Vec<&Station> = self.0.iter().filter(|s| s.is_stopped).collect();
        let (first, others) = stopped.split_first()?;
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
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::fieldbus::{LinkState, LinkStatus, Port, Role};
    use crate::image::{Directions, TickEnd, image};
    use crate::time::{Manual, Nanos};

    const MAX_AGE: Nanos = Nanos::from_millis(100);

    fn at(millis: i64) -> Nanos {
        Nanos::from_millis(millis)
    }

    /// A line whose stations receive one byte each.
    fn line(names: &[&str]) -> (TickEnd, Port, LinkStatus) {
        let station = || Directions {
            tx_fail_safe: Box::new([]),
            tx_latched: Box::new([]),
            rx_fail_safe: Box::new([0]),
            rx_latched: Box::new([]),
        };
        let (tick, bus) = image(names.iter().map(|_| station()).collect());
        let status = LinkStatus::new("test", MAX_AGE);
        let mut port = Port::new(bus, Manual::new(), Role::Device, None, status.clone());
        port.name_stations(names.iter().copied());
        (tick, port, status)
    }

    fn is_told(status: &LinkStatus, line: &str) -> bool {
        let mut text = String::new();
        status.write(at(0), &mut text);
        text.lines().any(|told| told == line)
    }

    #[test]
    fn a_plc_in_stop_is_stale_however_young_its_data_are_and_fresh_with_the_first_frame_of_run() {
        let (tick, mut port, status) = line(&[""]);
        port.running("the peer is there");
        port.plc_state(0, at(0), PlcState::Run);
        port.received(0, at(1), &[1]);
        assert!(tick.stations[0].is_valid() && is_told(&status, "cpu=run"));
        port.plc_state(0, at(2), PlcState::Stop);
        assert!(!tick.stations[0].is_valid(), "at once");
        port.received(0, at(3), &[0]);
        port.observe(at(3));
        assert!(!tick.stations[0].is_valid() && is_told(&status, "cpu=stop"));
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Stopped));
        let right = "the PLC is in STOP; put it into RUN, and its next data count";
        assert_eq!(link.reason, right);
        port.plc_state(0, at(4), PlcState::Run);
        assert!(
            !tick.stations[0].is_valid(),
            "the frame that is there is from STOP"
        );
        port.received(0, at(5), &[1]);
        let link = status.link();
        assert!(tick.stations[0].is_valid() && is_told(&status, "cpu=run"));
        assert_eq!(link.state, LinkState::Running);
        assert_eq!(link.reason, "the peer is there");
    }

    #[test]
    fn of_several_plcs_the_one_in_stop_is_named_and_the_others_stay_fresh() {
        let (tick, mut port, status) = line(&["charger", "lathe"]);
        port.running("both are there");
        port.plc_state(1, at(0), PlcState::Stop);
        assert!(tick.stations[0].is_valid() && !tick.stations[1].is_valid());
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
}
