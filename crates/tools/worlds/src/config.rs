//! The driver.cfg of each end of a world.

use tickbus_base::time::Nanos;

use crate::plan::{Bus, FAIL_SAFE, Plan, Watchdog};
use crate::{master, wire};

/// The port of the world's line.
pub(crate) const PORT: u16 = 20_030;

/// The names of both ends at a dispatcher, and the lines that give them.
pub(crate) const NAMES: [(&str, &str); 2] = [("D", "name = \"D\""), ("C", "name = \"C\"")];

impl Plan {
    /// The driver.cfg of an end; `link` is the name of a loopback.
    pub fn driver_cfg(&self, end: usize, link: &str) -> String {
        let role = ["device", "controller"][end];
        let mut lines = vec![
            format!("[driver]\nid = {}\nname = \"{role}\"", end + 1),
            format!("[fieldbus]\nrole = \"{role}\""),
        ];
        lines.extend(self.fieldbus(end, link));
        lines.extend(self.timing(end));
        lines.extend(self.life_signs(end));
        lines.extend(self.record_section(end));
        lines.push(self.signal_sections(end, true));
        lines.extend(self.fault_sections(end));
        lines.join("\n")
    }

    /// The stations and their signals, with or without the keys of the bus.
    pub(crate) fn signal_sections(&self, end: usize, has_keys: bool) -> String {
        let mut lines = Vec::new();
        for station in 0..self.stations {
            if self.stations > 1 {
                lines.push(format!("[[station]]\nname = \"s{station}\""));
                if has_keys {
                    lines.extend(self.station_keys(end, station));
                }
            }
        }
        for station in 0..self.stations {
            for area in ['Q', 'I'] {
                lines.extend(self.signals(station, area, (area == 'Q') == (end == 0)));
            }
        }
        lines.join("\n")
    }

    /// The keys of a station that only some buses have.
    fn station_keys(&self, end: usize, station: usize) -> Option<String> {
        match self.bus {
            Bus::Modbus | Bus::ModbusRtu => Some(format!("unit = {}", station + 1)),
            Bus::Profibus if end == 0 => Some(format!(
                "address = {}\nident = {}",
                usize::from(master::FIRST) + station,
                master::IDENT
            )),
            _ => None,
        }
    }

    /// The time within which a slave of PROFIBUS has to answer, in bits.
    fn slot_bits(&self) -> i64 {
        (self.slot() / wire::bits(1)).clamp(200, 16_383)
    }

    /// The bus, and what only some buses have.
    fn fieldbus(&self, end: usize, link: &str) -> Vec<String> {
        let serves = self.serves(end);
        let (kind, place) = match (self.bus, serves) {
            (Bus::Loopback, _) => return vec![format!("kind = \"loopback\"\nlink = \"{link}\"")],
            (Bus::Socket | Bus::SocketOnChange, true) => ("socket", "role_tcp = \"listen\""),
            (Bus::Socket | Bus::SocketOnChange, false) => ("socket", "role_tcp = \"connect\""),
            (Bus::Modbus | Bus::ModbusRtu, true) => ("modbus-server", ""),
            (Bus::Modbus | Bus::ModbusRtu, false) => ("modbus-client", ""),
            (Bus::S7, true) => ("s7-server", ""),
            (Bus::S7, false) => ("s7-client", ""),
            (Bus::Dispatcher, _) => ("dispatcher", NAMES[end].1),
            (Bus::Profibus, _) => return self.profibus(end),
        };
        let mut lines = vec![format!(
            "kind = \"{kind}\"\naddress = \"127.0.0.1:{PORT}\"\n{place}"
        )];
        match self.bus {
            Bus::SocketOnChange => lines.push("send = \"on-change\"".to_owned()),
            Bus::ModbusRtu => lines.push("framing = \"rtu\"".to_owned()),
            _ => {}
        }
        if self.laboratory.is_asked {
            let cables = self
                .cables()
                .map(|(input, output)| format!("\"{input}:{}:{output}\"", NAMES[1 - end].0));
            lines.push(format!(
                "connect = [{}]",
                cables.collect::<Vec<_>>().join(", ")
            ));
        }
        if self.bus.asks() && !serves {
            let other = ["controller", "device"][end];
            lines.push(format!("write_to = \"tickbus {other}\""));
        }
        lines
    }

    /// The time without a request after which a slave of PROFIBUS clears its outputs. In half of all worlds its data are
    /// stale earlier. Masters count in steps of 10 ms.
    pub(crate) fn slave_watchdog(&self) -> Nanos {
        let time = if self.seed.number.is_multiple_of(2) {
            (self.max_age.0 / 3).max(self.cycle.0 * 3 + self.round_trip() + 10_000_000)
        } else {
            self.max_age.0 * 3
        };
        Nanos::from_millis((time / 10_000_000 * 10).clamp(10, 2_500))
    }

    fn profibus(&self, end: usize) -> Vec<String> {
        if end == 1 {
            return vec![format!(
                "kind = \"profibus-master\"\nslot_bits = {}\nwatchdog_ms = {}",
                self.slot_bits(),
                self.slave_watchdog().0 / 1_000_000
            )];
        }
        let (device, baud) = (master::DEVICE, wire::BAUD);
        let late = self.slot_bits() - 15;
        let mut lines = vec![format!(
            "kind = \"profibus-device\"\ndevice = \"{device}\"\nbaud = {baud}\nmax_tsdr = {late}"
        )];
        if self.stations == 1 {
            lines.extend(self.station_keys(end, 0));
        }
        lines
    }

    /// Which input of an end belongs to which output of the other one, at a dispatcher.
    pub(crate) fn cables(&self) -> impl Iterator<Item = (String, String)> {
        let analog = if self.numbers { 3 } else { 1 };
        let kinds = [("", 2 * self.stations), ("A", analog * self.stations)];
        kinds.into_iter().flat_map(|(kind, count)| {
            (1..=count).map(move |number| (format!("{kind}I{number}"), format!("{kind}Q{number}")))
        })
    }

    /// How often an end beats, and within which time the other one wants to see that.
    pub(crate) fn beat(&self, end: usize) -> Option<(Nanos, Option<Nanos>)> {
        let (ticks, is_watched) = self.features.beats[end]?;
        let period = self.ends[end].period;
        let every = Nanos((period.0 * ticks).max(1_000_000));
        let within = (every + period.times(2) + self.cycle).times(3) + self.max_age;
        let within = Nanos(within.0.max(10_000_000));
        Some((every, is_watched.then_some(within)))
    }

    /// Returns true if an end waits for the other one to connect.
    pub(crate) fn serves(&self, end: usize) -> bool {
        (end == 1) == self.controller_serves
    }

    /// The watchdog of an end, as docs/driver-cfg.md has it.
    pub(crate) fn watchdog(&self, end: usize) -> Option<Nanos> {
        match self.ends[end].watchdog {
            Watchdog::After(limit) => Some(limit),
            Watchdog::Default if end == 1 => {
                let least = self.max_age.max(self.cycle.times(10));
                Some(least.max(Nanos::from_millis(250)))
            }
            Watchdog::Off | Watchdog::Default => None,
        }
    }

    /// The signs of life of an end.
    fn life_signs(&self, end: usize) -> Vec<String> {
        let areas = ['I', 'Q'];
        let own = self.beat(end).map(|(every, _)| {
            let area = areas[end];
            format!("heartbeat = {{ signal = \"beat{area}0\", every = \"{every}\" }}")
        });
        let other = self.beat(1 - end).and_then(|(_, within)| within);
        let other = other.map(|within| {
            let area = areas[1 - end];
            format!("alive = {{ signal = \"beat{area}0\", within = \"{within}\" }}")
        });
        own.into_iter().chain(other).collect()
    }

    /// The keys that every bus has.
    fn timing(&self, end: usize) -> Vec<String> {
        let (cycle, max_age, reconnect) = (self.cycle, self.max_age, self.reconnect);
        let mut lines = vec![format!(
            "max_age = \"{max_age}\"\nreconnect = [\"{reconnect}\"]"
        )];
        // The master of PROFIBUS alone decides when it asks.
        if self.bus != Bus::Profibus || end == 1 {
            lines.push(format!("cycle = \"{cycle}\""));
        }
        match self.ends[end].watchdog {
            Watchdog::Default => {}
            Watchdog::Off => lines.push("watchdog = \"off\"".to_owned()),
            Watchdog::After(span) => lines.push(format!("watchdog = \"{span}\"")),
        }
        if end == 1 {
            let outputs = |holds| if holds { "hold" } else { "fail_safe" };
            let at_close = outputs(self.ends[1].holds_at_close);
            let while_stale = outputs(self.ends[1].holds_while_stale);
            lines.push(format!(
                "at_close = \"{at_close}\"\nwhile_stale = \"{while_stale}\""
            ));
        }
        lines
    }

    /// The signals of a station in one direction.
    fn signals(&self, station: usize, area: char, reads: bool) -> Vec<String> {
        let of = if self.stations > 1 {
            format!("\nstation = \"s{station}\"")
        } else {
            String::new()
        };
        let signal = |name: &str, place: &str, rest: &str| {
            format!(
                "[[signal]]\nname = \"{name}{area}{station}\"\naddress = \"%{area}{place}\"\n{rest}{of}"
            )
        };
        let hold = if area == 'I' && self.hold > Nanos::ZERO {
            format!("\nhold = \"{}\"", self.hold)
        } else {
            String::new()
        };
        let mut lines = vec![
            signal(
                "stamp",
                "L0",
                &format!("type = \"LWORD\"\nfail_safe = {FAIL_SAFE}"),
            ),
            signal("pulse", "X8.0", &format!("latch = \"rising\"{hold}")),
            signal("level", "X8.1", ""),
        ];
        if station == 0 && self.beat(usize::from(area == 'Q')).is_some() {
            lines.push(signal("beat", "B9", "type = \"USINT\""));
        }
        if self.numbers {
            let whole = "type = \"INT\"\norder = \"DCBA\"\nfail_safe = -7";
            let real =
                "type = \"REAL\"\nscale = { raw = [0, 100], value = [0.0, 50.0] }\nfail_safe = 2.5";
            lines.extend([signal("whole", "W10", whole), signal("real", "D12", real)]);
        }
        for typed in self.features.beside(area) {
            let sections = typed.sections(area, station, reads).into_iter();
            lines.extend(sections.map(|section| section + of.as_str()));
        }
        lines
    }
}
