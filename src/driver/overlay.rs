//! Tables that stand instead of those of a driver.cfg: the same device, on another line.

use super::Config;
use crate::config::{Collector, Mistakes, Table, read_text};
use crate::fieldbus::{Options, Role, loopback};
use crate::record;

impl Config {
    /// The same driver with other tables: `text` is TOML as in a driver.cfg, and `origin` is what its
    /// mistakes call it. So a test runs on the plant's own signal table, but on simulation time.
    ///
    /// A `[fieldbus]` with a `kind` stands instead of the file's own, but for what belongs to the device and
    /// not to the bus: sizes, cycle times and time-outs stay. One without changes only the `mode` of the
    /// file's own loopback. A `[record]` stands instead of the file's own.
    ///
    /// # Errors
    ///
    /// With every mistake in the text.
    pub fn overlaid(self, origin: &str, text: &str) -> Result<Self, Mistakes> {
        let mut collector = Collector::new(origin, text);
        let config = read_text(&mut collector, text, |root| read(self, root));
        match collector.finish() {
            Some(mistakes) => Err(mistakes),
            None => Ok(config.expect("what is not read has a mistake")),
        }
    }
}

fn read(mut config: Config, mut root: Table<'_>) -> Option<Config> {
    let fieldbus = root.take("fieldbus");
    let record = root.take("record");
    root.finish();
    if let Some(value) = record {
        let table = value.table("[record]", "write a [record] table")?;
        config.record = Some(record::Options::read(table, None)?);
    }
    if let Some(value) = fieldbus {
        let table = value.table("[fieldbus]", "write a [fieldbus] table")?;
        read_fieldbus(&mut config, table)?;
    }
    Some(config)
}

fn read_fieldbus(config: &mut Config, mut table: Table<'_>) -> Option<()> {
    if let Some(kind) = table.take("kind") {
        let roles = Role::ALL.map(|role| (role.name(), role));
        let role = match table.take("role") {
            None => config.role,
            Some(value) => value.choice("roles", &roles)?,
        };
        config.bus = Options::read(&kind, role, false, table)?;
        config.role = role;
        return Some(());
    }
    let mode = table.require("mode", "write the mode of the file's own bus, or a kind");
    table.finish();
    let mode = mode?;
    let chosen = mode.choice("modes", &loopback::Mode::NAMES)?;
    let kind = config.bus.kind();
    if let Options::Loopback(options) = &mut config.bus {
        options.mode = chosen;
        return Some(());
    }
    mode.wrong(
        format!("the bus \"{kind}\" of the driver.cfg has no mode"),
        "name a PLC program to be at the other end instead",
    );
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fieldbus::loopback::{Mode, Peer};
    use crate::time::Nanos;

    fn plant(fieldbus: &str) -> Config {
        let text = format!(
            "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nmax_age = \"3s\"\ninput_bytes = 8\n{fieldbus}\n\
             [[signal]]\nname = \"A\"\naddress = \"%IX0.0\"\n"
        );
        Config::parse("plant.cfg", &text).unwrap_or_else(|mistakes| panic!("{mistakes}"))
    }

    fn refusal(text: &str) -> String {
        let plant = plant("kind = \"loopback\"\nlink = \"cell\"");
        let mistakes = plant.overlaid("other tables", text).expect_err("a mistake");
        mistakes.to_string()
    }

    #[test]
    fn another_bus_leaves_signals_sizes_and_times_as_they_are() {
        let plant = plant("kind = \"loopback\"\nlink = \"cell\"");
        let other = "[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\nprogram = \"mirror\"\nscan = \"5ms\"\n";
        let test = plant.clone().overlaid("test", other).expect("right");
        let Options::Loopback(options) = &test.bus else {
            panic!("{:?}", test.bus)
        };
        assert_eq!(options.mode, Mode::Stepped);
        assert!(
            matches!(&options.peer, Peer::Program { name, scan, .. } if name == "mirror" && *scan == Some(Nanos::from_millis(5)))
        );
        assert_eq!(test.table, plant.table);
        assert_eq!(test.timing, plant.timing);
        assert_eq!(plant.clone().overlaid("test", ""), Ok(plant.clone()));
        let recorded = plant.overlaid("test", "[record]\nfile = \"test.vcd\"\n");
        let record = recorded.expect("right").record.expect("it is recorded");
        assert_eq!(record.file, std::path::Path::new("test.vcd"));
    }

    #[test]
    fn a_table_without_a_kind_changes_the_mode_of_the_file_s_own_bus() {
        let plant = plant("kind = \"loopback\"\nprogram = \"mirror\"\nscan = \"7ms\"");
        let test = plant.overlaid("test", "[fieldbus]\nmode = \"stepped\"\n");
        let Options::Loopback(options) = test.expect("right").bus else {
            panic!("a loopback")
        };
        assert_eq!(options.mode, Mode::Stepped);
        assert!(
            matches!(options.peer, Peer::Program { scan, .. } if scan == Some(Nanos::from_millis(7)))
        );
    }

    #[test]
    fn mistakes_are_told_where_they_stand() {
        assert_eq!(
            refusal("[fieldbus]\nkind = \"loopback\"\nprogram = \"rigg\"\n[recrod]\n"),
            "other tables:3:11: there is no program \"rigg\"; did you mean \"rig\"?\n\
             other tables:4:2: unknown key \"recrod\" in the file; did you mean \"record\"?"
        );
        assert_eq!(
            refusal("[fieldbus]\nscan = \"1ms\"\n"),
            "other tables:1:1: [fieldbus] has no \"mode\"; write the mode of the file's own bus, or a kind\n\
             other tables:2:1: unknown key \"scan\" in [fieldbus]; keys here are kind, mode"
        );
    }
}
