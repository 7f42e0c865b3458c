//! Tables that replace those of a driver.cfg: the same device on another line.

use super::Config;
use super::timing::Line;
use crate::{Options, PageOptions, loopback};
use tickbus_base::toml_text::{Collector, Mistakes, Table, Value, did_you_mean, parse_text, shown};
use tickbus_fieldbus::{At, Role};
use tickbus_image::signal::SignalTable;
use tickbus_record as record;

impl Config {
    /// Returns the same driver with other tables: `text` is TOML as in a driver.cfg; mistakes call it `origin`. For
    /// example, a test uses the plant's own signal table, but in simulation time.
    ///
    /// A `[fieldbus]` with a `kind` replaces the file's own, except for the keys that belong to the device and not to
    /// the bus: sizes, cycle times, time-outs and life signs stay. Keys about this end that the file leaves open get
    /// the defaults of the new line: a controller has a watchdog and leaves its fail-safe values behind. `[[station]]`
    /// tables contain the keys that the new bus needs for the file's stations, by name. A `[fieldbus]` without a `kind`
    /// changes only the `mode` of the file's own loopback. A `[record]` replaces the file's own; a bus that replays a
    /// recording removes the file's own, which belongs to the plant. A `[fieldbus]` also removes the
    /// file's `[page]`.
    ///
    /// # Errors
    ///
    /// Returns every mistake in the text.
    pub fn overlaid(self, origin: &str, text: &str) -> Result<Self, Mistakes> {
        let mut config = parse_text(origin, text, |root| read(self, root))?;
        if !text.is_empty() {
            config.origin.overlaid(origin, text);
        }
        Ok(config)
    }
}

fn read(mut config: Config, mut root: Table<'_>) -> Option<Config> {
    let fieldbus = root.take("fieldbus");
    let stations = root.take("station");
    let record = root.take("record");
    let page = root.take("page");
    root.finish();
    let stations = stations.map(|value| value.tables("[[station]]"));
    if let Some(value) = fieldbus {
        config.page = None;
        let table = value.table("[fieldbus]", "write a [fieldbus] table")?;
        read_fieldbus(&mut config, table, stations.unwrap_or_default())?;
    } else if let Some(table) = stations.unwrap_or_default().first() {
        table.wrong(
            "[[station]] says what another bus has to know, and there is no [fieldbus]",
            "write a [fieldbus] with its kind, or leave the stations as they are",
        );
        return None;
    }
    if let Some(value) = record {
        let table = value.table("[record]", "write a [record] table")?;
        config.record = Some(record::Options::read(table, config.bus.replayed())?);
    }
    if let Some(value) = page {
        let table = value.table("[page]", "write a [page] table")?;
        config.page = Some(PageOptions::read(table)?);
    }
    Some(config)
}

fn read_fieldbus(
    config: &mut Config,
    mut table: Table<'_>,
    stations: Vec<Table<'_>>,
) -> Option<()> {
    if let Some(kind) = table.take("kind") {
        let collector = table.collector();
        if config.role == Role::Observer {
            kind.wrong(
                "this driver.cfg is an observer's, which has no other end",
                "take the machine's or the PLC's driver.cfg",
            );
            return None;
        }
        let at = table.take("at");
        let roles = Role::ENDS.map(|role| (role.name(), role));
        let role = match table.take("role") {
            None => config.role,
            Some(value) => value.choice("roles", &roles)?,
        };
        let (mut bus, events) = config.kinds.read(&kind, role, false, table)?;
        read_stations(&mut bus, &config.table, stations, &kind, collector);
        if let Some(at) = &at {
            bus.place_signals(&At::read(at, &config.table), &config.table);
        }
        bus.fit(&config.table, collector);
        if bus.replayed().is_some() {
            config.record = None;
        }
        // The values that this end leaves behind depend on the new line.
        config.timing.fit(Line::of(role, Some(&bus)));
        config.bus = bus;
        config.events = events;
        config.role = role;
        return Some(());
    }
    for table in stations {
        table.wrong(
            "[[station]] says what another bus has to know, and [fieldbus] has no \"kind\"",
            "name the kind of bus, or leave the stations as they are",
        );
    }
    let mode = table.require("mode", "write the mode of the file's own bus, or a kind");
    table.finish();
    let mode = mode?;
    let chosen = mode.choice("modes", &loopback::Mode::NAMES)?;
    let kind = config.bus.kind();
    if let Some(options) = config.bus.downcast_mut::<loopback::Options>() {
        options.mode = chosen;
        return Some(());
    }
    mode.wrong(
        format!("the bus \"{kind}\" of the driver.cfg has no mode"),
        "name a PLC program to be at the other end instead",
    );
    None
}

/// Lets `bus` read its keys for each station of the driver, in order.
fn read_stations(
    bus: &mut Options,
    table: &SignalTable,
    stations: Vec<Table<'_>>,
    kind: &Value<'_>,
    collector: &Collector<'_>,
) {
    let names: Vec<&str> = table.stations.iter().map(|s| s.name.as_str()).collect();
    // A file without [[station]] tables has a single station without a name.
    let declared = names.iter().any(|name| !name.is_empty());
    let mut named: Vec<Option<Table<'_>>> = names.iter().map(|_| None).collect();
    for mut station in stations {
        let right = "write the name of a station of the driver.cfg";
        let Some(value) = station.require("name", right) else {
            station.finish_open();
            continue;
        };
        let name = value.text(right).unwrap_or_default();
        let place = names.iter().position(|known| declared && *known == name);
        match place.map(|place| &mut named[place]) {
            Some(place @ None) => *place = Some(station),
            Some(Some(_)) => {
                value.wrong(
                    format!("the station \"{}\" is there twice", shown(name)),
                    "name it once",
                );
            }
            None if declared => {
                let what = format!("the driver.cfg has no station \"{}\"", shown(name));
                value.wrong(what, did_you_mean(name, "stations", &names));
            }
            None => value.wrong("the driver.cfg declares no stations", "remove the table"),
        }
    }
    if !declared {
        return;
    }
    for (name, station) in names.iter().zip(named) {
        if let Some(mut station) = station {
            bus.read_station(names.len(), &mut station);
            station.finish();
        } else {
            let title = format!("[[station]] \"{}\"", shown(name));
            Table::absent(collector, &title, kind.at(), |mut station| {
                bus.read_station(names.len(), &mut station);
                station.finish();
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loopback::{Mode, Peer};
    use tickbus_base::time::Nanos;

    fn plant(fieldbus: &str) -> Config {
        let text = format!(
            "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nmax_age = \"3s\"\ninput_bytes = 8\n{fieldbus}\n\
             [[signal]]\nname = \"A\"\naddress = \"%IX0.0\"\n"
        );
        Config::parse("plant.cfg", &text, &crate::KINDS)
            .unwrap_or_else(|mistakes| panic!("{mistakes}"))
    }

    #[track_caller]
    fn loopback(config: &Config) -> &loopback::Options {
        config.bus.downcast_ref().expect("a loopback")
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
        let options = loopback(&test);
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
        let plant = plant("kind = \"loopback\"\nprogram = \"mirror\"\nscan = \"7ms\"\n[page]");
        assert!(plant.page.is_some());
        let test = plant.overlaid("test", "[fieldbus]\nmode = \"stepped\"\n");
        let test = test.expect("right");
        assert_eq!(test.page, None);
        let options = loopback(&test);
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

    #[test]
    fn a_replay_takes_the_recording_of_the_plant_away_and_may_not_record_over_what_it_replays() {
        let plant = || {
            let mut plant = plant("kind = \"loopback\"\nlink = \"cell\"");
            let file = std::path::Path::new("run.csv");
            plant.record = Some(record::Options::to(file).expect("a format"));
            plant
        };
        let replay = "[fieldbus]\nkind = \"loopback\"\nreplay = \"run.csv\"\n";
        let test = plant().overlaid("test", replay).expect("right");
        assert_eq!(test.record, None);
        let over = format!("{replay}[record]\nfile = \"./run.csv\"\n");
        let told = plant()
            .overlaid("test", &over)
            .expect_err("it would be lost");
        assert!(told.to_string().contains("would be overwritten"), "{told}");
    }
}
