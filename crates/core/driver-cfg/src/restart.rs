//! The parts of another driver.cfg that an open driver cannot take without a restart of the simulation.

use std::fmt::Display;

use tickbus_base::toml_text::shown;
use tickbus_fieldbus::Events;
use tickbus_image::signal::{Signal, Station};

use crate::Config;

/// The most signals that are named one by one.
const NAMED: usize = 8;

impl Config {
    /// Returns how `next` differs from these settings in more than its line, each as half a sentence; empty if only the
    /// line differs, or nothing. Whatever the tick, the recorder, the page or a model works with cannot change while the
    /// simulation runs.
    pub fn needs_restart(&self, next: &Self) -> Vec<String> {
        let mut all = Vec::new();
        let mut differ = |is_other: bool, what: &str| {
            if is_other {
                all.push(what.to_owned());
            }
        };
        differ(self.id != next.id, "[driver] has another \"id\"");
        differ(self.name != next.name, "[driver] has another \"name\"");
        differ(
            self.real_time != next.real_time,
            "[driver] has another \"real_time\"",
        );
        differ(
            self.role != next.role,
            "[fieldbus] has another \"role\": the ends change their places",
        );
        differ(
            self.events == Events::None && next.events != Events::None,
            "[fieldbus] has \"events\", for which a driver that was opened without them has no room",
        );
        differ(
            self.life_signs.heartbeat != next.life_signs.heartbeat,
            "[fieldbus] has another \"heartbeat\", which the ticks count",
        );
        self.compare_stations(next, &mut all);
        self.compare_signals(next, &mut all);
        let mut differ = |is_other: bool, what: &str| {
            if is_other {
                all.push(what.to_owned());
            }
        };
        let structures = self.table.structures != next.table.structures;
        differ(
            self.axes != next.axes || structures,
            "the axes are other ones",
        );
        differ(
            self.replies != next.replies,
            "the replies or drives are other ones",
        );
        differ(
            self.faults != next.faults || self.fault_file != next.fault_file,
            "the faults are other ones: those of a file begin with the simulation",
        );
        differ(
            self.record != next.record,
            "[record] is another one, and the recording is open",
        );
        differ(
            self.page != next.page,
            "[page] is another one, and the page is served",
        );
        all
    }

    /// Returns true if the settings of the line are those of `other`, which [needs no restart](Self::needs_restart).
    pub fn has_line_of(&self, other: &Self) -> bool {
        (&self.timing, &self.bus, self.events) == (&other.timing, &other.bus, other.events)
            && self.life_signs == other.life_signs
    }

    fn compare_stations(&self, next: &Self, all: &mut Vec<String>) {
        let (old, new) = (&self.table.stations, &next.table.stations);
        if old.len() != new.len() {
            all.push(format!(
                "there are {} stations in place of {}",
                new.len(),
                old.len()
            ));
            return;
        }
        for (number, (old, new)) in old.iter().zip(new).enumerate() {
            let which = match &*old.name {
                "" => "the image".to_owned(),
                name => format!("station {} \"{}\"", number + 1, shown(name)),
            };
            if old.name != new.name {
                all.push(format!("{which} has another name"));
            }
            let size = |it: &Station| (it.input_bytes, it.output_bytes, it.observed_bytes);
            if size(old) != size(new) {
                all.push(format!("{which} has another size"));
            }
        }
    }

    fn compare_signals(&self, next: &Self, all: &mut Vec<String>) {
        let (old, new) = (&self.table.signals, &next.table.signals);
        let has = |signals: &[Signal], name: &str| signals.iter().any(|it| it.name == name);
        let mut others = Others::new(all);
        if old.len() != new.len() {
            for signal in old.iter().filter(|it| !has(new, &it.name)) {
                others.push(format!("the signal \"{}\" is gone", shown(&signal.name)));
            }
            for signal in new.iter().filter(|it| !has(old, &it.name)) {
                others.push(format!("the signal \"{}\" is new", shown(&signal.name)));
            }
            return;
        }
        for (number, (old, new)) in old.iter().zip(new).enumerate() {
            let which = format!("signal {} \"{}\"", number + 1, shown(&old.name));
            if old.name != new.name {
                let what = if has(&next.table.signals, &old.name) {
                    format!("{which} has another place in the order")
                } else {
                    format!("{which} has another name")
                };
                others.push(what);
            } else if let Some(what) = difference(old, new) {
                others.push(format!("{which} has another {what}"));
            }
        }
    }
}

/// A list that names the first signals, and counts the rest.
struct Others<'a> {
    all: &'a mut Vec<String>,
    named: usize,
    more: usize,
}

impl<'a> Others<'a> {
    fn new(all: &'a mut Vec<String>) -> Self {
        Self {
            all,
            named: 0,
            more: 0,
        }
    }

    fn push(&mut self, what: String) {
        if self.named < NAMED {
            self.named += 1;
            self.all.push(what);
        } else {
            self.more += 1;
        }
    }
}

impl Drop for Others<'_> {
    fn drop(&mut self) {
        if self.more > 0 {
            self.all.push(format!("{} more signals differ", self.more));
        }
    }
}

/// The first property in which a signal differs, as an author calls it.
fn difference(old: &Signal, new: &Signal) -> Option<impl Display> {
    if old == new {
        return None;
    }
    // The comment and the folder are texts for people, with which nothing works.
    let without_notes = |signal: &Signal| Signal {
        notes: None,
        ..signal.clone()
    };
    let properties = [
        (old.station != new.station, "station"),
        (old.data_type != new.data_type, "type"),
        (
            old.address() != new.address() || old.in_plc != new.in_plc,
            "address",
        ),
        (old.order != new.order, "byte order"),
        (old.scale != new.scale || old.range != new.range, "scale"),
        (old.unit != new.unit, "unit"),
        (
            old.latch != new.latch || old.hold != new.hold,
            "latch or hold",
        ),
        (
            old.fail_safe != new.fail_safe || old.states_fail_safe != new.states_fail_safe,
            "fail_safe",
        ),
        // What is left: count_swallowed, dead_band and what the future brings.
        (without_notes(old) != without_notes(new), "setting"),
    ];
    let mut differing = properties.iter().filter(|(differs, _)| *differs);
    differing.next().map(|(_, what)| *what)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"a\"\n\
                        [[signal]]\nname = \"Lamp\"\naddress = \"%IX0.0\"\n\
                        [[signal]]\nname = \"Valve\"\naddress = \"%QW0\"\n";

    fn of(text: &str) -> Config {
        Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"))
    }

    #[test]
    fn settings_of_the_line_need_no_restart() {
        let old = of(TEXT);
        for (from, to) in [
            ("link = \"a\"", "link = \"b\""),
            ("link = \"a\"", "link = \"a\"\nmax_age = \"2s\""),
            ("link = \"a\"", "link = \"a\"\nat_close = \"fail_safe\""),
        ] {
            let new = of(&TEXT.replace(from, to));
            assert_eq!(old.needs_restart(&new), [""; 0], "{to}");
            assert!(!old.has_line_of(&new), "{to}");
        }
        let noted = TEXT.replace("\"%QW0\"", "\"%QW0\"\ncomment = \"main\"\nfolder = \"IO\"");
        assert_eq!(old.needs_restart(&of(&noted)), [""; 0]);
        assert!(old.has_line_of(&of(&noted)));
        assert!(old.has_line_of(&of(&format!("# a comment\n{TEXT}"))));
    }

    #[test]
    fn what_needs_a_restart_is_named_with_its_signal() {
        let old = of(TEXT);
        for (from, to, told) in [
            ("id = 1", "id = 2", "[driver] has another \"id\""),
            (
                "\"%QW0\"",
                "\"%QW0\"\ntype = \"INT\"",
                "signal 2 \"Valve\" has another type",
            ),
            (
                "\"%IX0.0\"",
                "\"%IX0.1\"",
                "signal 1 \"Lamp\" has another address",
            ),
            (
                "\"Lamp\"",
                "\"Light\"",
                "signal 1 \"Lamp\" has another name",
            ),
            (
                "\"%QW0\"\n",
                "\"%QW0\"\nfail_safe = 7\n",
                "signal 2 \"Valve\" has another fail_safe",
            ),
            (
                "[[signal]]\nname = \"Lamp\"\naddress = \"%IX0.0\"\n",
                "",
                "the signal \"Lamp\" is gone",
            ),
            (
                "\"%QW0\"\n",
                "\"%QW0\"\n[[fault]]\nname = \"f\"\nkind = \"stuck\"\nsignal = \"Valve\"\nvalue = 1\n",
                "the faults are other ones",
            ),
            ("link = \"a\"", "link = \"a\"\nevents = true", "events"),
        ] {
            let new = of(&TEXT.replace(from, to));
            let all = old.needs_restart(&new).join("; ");
            assert!(all.contains(told), "{to}: {all}");
        }
    }
}
