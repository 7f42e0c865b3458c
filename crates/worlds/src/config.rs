//! The driver.cfg of each end of a world.

use std::fmt::Write as _;

use tickbus_base::time::Nanos;

use crate::plan::{Bus, FAIL_SAFE, Plan};

impl Plan {
    /// Whether the end is the one that listens.
    fn serves(&self, end: usize) -> bool {
        (end == 1) == self.controller_serves
    }

    /// The driver.cfg of an end; `link` is the name of a loopback.
    pub fn driver_cfg(&self, end: usize, link: &str) -> String {
        let mut text = String::new();
        let role = ["device", "controller"][end];
        let plan = &self.ends[end];
        let mut line = |line: std::fmt::Arguments<'_>| {
            // Writing to a String cannot fail.
            let _ = text.write_fmt(line);
            text.push('\n');
        };
        line(format_args!(
            "[driver]\nid = {}\nname = \"{role}\"\n[fieldbus]\nrole = \"{role}\"",
            end + 1
        ));
        let (cycle, max_age, reconnect) = (self.cycle, self.max_age, self.reconnect);
        line(format_args!(
            "cycle = \"{cycle}\"\nmax_age = \"{max_age}\"\nreconnect = [\"{reconnect}\"]"
        ));
        match plan.watchdog {
            None => {}
            Some(None) => line(format_args!("watchdog = \"off\"")),
            Some(Some(span)) => line(format_args!("watchdog = \"{span}\"")),
        }
        if end == 1 {
            let outputs = |holds| if holds { "hold" } else { "fail_safe" };
            line(format_args!(
                "at_close = \"{}\"",
                outputs(plan.holds_at_close)
            ));
            line(format_args!(
                "while_stale = \"{}\"",
                outputs(plan.holds_while_stale)
            ));
        }
        let serves = self.serves(end);
        let other = ["controller", "device"][end];
        match self.bus {
            Bus::Loopback => line(format_args!("kind = \"loopback\"\nlink = \"{link}\"")),
            Bus::Socket | Bus::SocketOnChange => {
                let role_tcp = if serves { "listen" } else { "connect" };
                line(format_args!(
                    "kind = \"socket\"\naddress = \"127.0.0.1:20030\"\nrole_tcp = \"{role_tcp}\""
                ));
                if self.bus == Bus::SocketOnChange {
                    line(format_args!("send = \"on-change\""));
                }
            }
            Bus::Modbus | Bus::ModbusRtu if serves => line(format_args!(
                "kind = \"modbus-server\"\naddress = \"127.0.0.1:20030\""
            )),
            Bus::S7 if serves => line(format_args!(
                "kind = \"s7-server\"\naddress = \"127.0.0.1:20030\""
            )),
            Bus::Modbus | Bus::ModbusRtu | Bus::S7 => {
                let kind = if self.bus == Bus::S7 { "s7" } else { "modbus" };
                line(format_args!(
                    "kind = \"{kind}-client\"\naddress = \"127.0.0.1:20030\"\nwrite_to = \"tickbus {other}\""
                ));
            }
        }
        if self.bus == Bus::ModbusRtu {
            line(format_args!("framing = \"rtu\""));
        }
        if self.stations > 1 {
            for station in 0..self.stations {
                line(format_args!("[[station]]\nname = \"s{station}\""));
            }
        }
        for station in 0..self.stations {
            for area in ['Q', 'I'] {
                let mut signal = |name: &str, address: &str, rest: &str| {
                    line(format_args!(
                        "[[signal]]\nname = \"{name}{area}{station}\"\naddress = \"%{area}{address}\"\n{rest}"
                    ));
                    if self.stations > 1 {
                        line(format_args!("station = \"s{station}\""));
                    }
                };
                signal(
                    "stamp",
                    "L0",
                    &format!("type = \"LWORD\"\nfail_safe = {FAIL_SAFE}"),
                );
                let hold = if area == 'I' && self.hold > Nanos::ZERO {
                    format!("\nhold = \"{}\"", self.hold)
                } else {
                    String::new()
                };
                signal("pulse", "X8.0", &format!("latch = \"rising\"{hold}"));
                signal("level", "X8.1", "");
                if self.numbers {
                    signal(
                        "whole",
                        "W10",
                        "type = \"INT\"\norder = \"DCBA\"\nfail_safe = -7",
                    );
                    signal(
                        "real",
                        "D12",
                        "type = \"REAL\"\nscale = { raw = [0, 100], value = [0.0, 50.0] }\nfail_safe = 2.5",
                    );
                }
            }
        }
        text
    }
}
